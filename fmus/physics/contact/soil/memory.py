"""Memory of soil under each contact point of a track: one row a point, in the state of the track.

The memory is frozen during a step. An evaluation writes to ``pending`` what would be remembered; ``commit`` makes it
the memory once the step is accepted, so a repeated step commits once. A point reads the rut where it passes the
undeformed surface, and presses it as it leaves: a link that is laid down comes down some centimetres behind its place,
where the link before it still presses.

The losses that ``commit`` returns are exact for steps of any length: the work of the soil's pressure and of its shear,
with the mean strength of a step, is the growth of the stored energy, plus the loss by compaction, plus that by shear.
A strength that grows under shear raises the stored energy without work, as in Janosi and Hanamoto's law; the loss by
shear is smaller by that.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from fmus.kernels.jit import kernel
from fmus.physics.arrays import Floats
from fmus.physics.contact.soil.pressure import compaction
from fmus.physics.contact.soil.rut import press
from fmus.physics.contact.soil.shear import stored, strength
from fmus.physics.vector import vector

if TYPE_CHECKING:
    from fmus.physics.contact.soil.parameters import Soil

# 1 below the undeformed surface, else 0 and the rest is 0; deepest sinkage of this place, m; pressure, Pa; mobilised
# shear (3); where it pressed last: place, m (3), horizontal vector from the first to the last pin of the link, m (2),
# fraction of that from the point to the middle of its part of the link; pressure at the deepest sinkage, Pa
INSIDE, DEEPEST, PRESSURE, SHEAR, PLACE, ALONG, MIDDLE, MOST = 0, 1, 2, 3, 6, 9, 11, 12
MEMORY = 13  # width of a row
BEFORE, WORK = 13, 14  # more of a pending row: deepest sinkage before the step, m; work of shear over the strength, m
PENDING = 15


@kernel
def clear(pending: Floats) -> None:
    """Mark all points of ``pending`` (points, PENDING) as outside, before an evaluation."""
    for row in range(pending.shape[0]):
        pending[row, INSIDE] = 0.0


@kernel
def commit(soil: Soil, share: float, memory: Floats, pending: Floats, rut: Floats) -> tuple[float, float]:
    """Make ``pending`` (points, PENDING) the ``memory`` (points, MEMORY); points that leave press the ``rut`` (RUT).

    A point has ``share`` of its link. Returns the losses of the step by compaction and by shear, J.
    """
    area = share * soil.length * soil.width
    compacted = sheared = 0.0
    for row in range(memory.shape[0]):
        old, new = memory[row], pending[row]
        if new[INSIDE] > 0.0:
            if new[DEEPEST] > new[BEFORE]:
                compacted += area * (compaction(soil, new[DEEPEST]) - compaction(soil, new[BEFORE]))
            sheared += area * _shear_loss(soil, old, new)
            for k in range(MEMORY):
                old[k] = new[k]
        elif old[INSIDE] > 0.0:
            sheared += area * _strength(soil, old) * stored(soil.K, vector(old, SHEAR))
            press_part(soil, share, old, rut)
            for k in range(MEMORY):
                old[k] = 0.0
    return compacted, sheared


@kernel
def _strength(soil: Soil, row: Floats) -> float:
    """Shear strength under a point with this ``row``, Pa; none where the soil is not touched."""
    return strength(soil, row[PRESSURE]) if row[PRESSURE] > 0.0 else 0.0


@kernel
def _shear_loss(soil: Soil, old: Floats, new: Floats) -> float:
    """Work of shear in a step less the growth of its stored energy, J/m2, from a row ``old`` to ``new``."""
    before, after = _strength(soil, old), _strength(soil, new)
    kept = before * stored(soil.K, vector(old, SHEAR)) - after * stored(soil.K, vector(new, SHEAR))
    return 0.5 * (before + after) * new[WORK] + kept


@kernel
def press_part(soil: Soil, share: float, row: Floats, rut: Floats) -> None:
    """Press the part of a link that belongs to a point with this ``row`` (MEMORY) into the ``rut`` (RUT)."""
    along, part = (row[ALONG], row[ALONG + 1]), row[MIDDLE]
    middle = row[PLACE] + part * along[0], row[PLACE + 1] + part * along[1]
    press(rut, middle, (0.25 * along[0], 0.25 * along[1]), share * soil.width, row[DEEPEST])
