"""Force of soil on a contact point, for ``grounds``.

Depth is the sinkage along the normal of the undeformed surface. A point below the surface keeps the deepest sinkage
that it has reached, wherever it moves; as it goes below, it reads that of the rut. Slip sinkage, bulldozing and the
rate of loading are left out.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from fmus.kernels.jit import kernel
from fmus.physics.arrays import Floats, Nine, Vector
from fmus.physics.contact.face import NO_MATRIX, NOTHING, ContactForce, Face
from fmus.physics.contact.soil import memory as rows
from fmus.physics.contact.soil import shear
from fmus.physics.contact.soil.memory import (
    ALONG,
    BEFORE,
    DEEPEST,
    INSIDE,
    MEMORY,
    MIDDLE,
    MOST,
    PLACE,
    PRESSURE,
    SHEAR,
    WORK,
    deepest_at,
)
from fmus.physics.contact.soil.pressure import first_loading, pressure, print_left, reloading
from fmus.physics.contact.soil.shear import strength
from fmus.physics.vector import add, dot, put, scale, vector

if TYPE_CHECKING:
    from fmus.physics.chain.state import ChainState, ChainWork
    from fmus.physics.contact.grounds import GroundPoint
    from fmus.physics.contact.soil.parameters import Soil

LIGHT = 1e3  # pressure at which the damper has half of its effect, Pa: it fades in, so that no force jumps


@kernel
def soil_force(
    law: Soil,
    point: GroundPoint,
    face: Face,
    by_rate: float,
    tangent: bool,
    old: Floats,
    rut: Floats,
    pending: Floats,
) -> ContactForce:
    """Force on a ``point`` with the memory ``old`` (MEMORY) and the ``rut`` (RUT); sets its row ``pending`` (PENDING).

    The ContactForce has the losses of the damper only; those of the soil are in the ledger, see ``memory``.
    """
    n, p, inside = face.n, point.position, old[INSIDE] > 0.0
    held = inside and old[PRESSURE] > 0.0
    before = old[DEEPEST] if inside else deepest_at(rut, p[0], p[1])
    most = old[MOST] if inside else first_loading(law, before)[0]
    if point.depth < before:
        pressed, slope, elastic = reloading(law, before, most, point.depth)
    else:
        pressed, slope, elastic = pressure(law, before, point.depth)
        most = pressed
    for k in range(MEMORY):
        pending[k] = old[k]
    pending[INSIDE], pending[DEEPEST], pending[PRESSURE] = 1.0, max(before, point.depth), pressed
    pending[MOST], pending[BEFORE] = most, before
    m0, u = vector(old, SHEAR), NOTHING
    if pressed <= 0.0:
        put(pending, SHEAR, shear.limited(m0, print_left(law, before, most, point.depth)))
        pending[WORK] = 0.0
        return ContactForce(NOTHING, NO_MATRIX, NOTHING, 0.0, 0.0, 0.0, 0.0)
    if held:
        u = add(p, scale(-1.0, vector(old, PLACE)))
    m0, u = add(m0, scale(-dot(m0, n), n)), add(u, scale(-dot(u, n), n))
    mobilised = shear.mobilise(law.K, m0, u)
    m, area = mobilised.m, point.share * law.length * law.width
    put(pending, SHEAR, m)
    put(pending, PLACE, p)
    pending[ALONG], pending[ALONG + 1], pending[MIDDLE] = point.along[0], point.along[1], point.middle
    pending[WORK] = mobilised.work

    limit, rate = area * strength(law, pressed), -dot(n, face.w)
    effect = law.damping * pressed / (pressed + LIGHT)
    total = pressed + effect * rate
    by_depth = slope + law.damping * rate * slope * LIGHT / (pressed + LIGHT) ** 2
    if total < 0.0:
        total = by_depth = effect = 0.0
    normal = area * total
    f = add(scale(normal, n), scale(-limit, m))
    energy = area * elastic + limit * shear.stored(law.K, m)
    damping = (normal - area * pressed) * rate
    if not tangent:
        return ContactForce(f, NO_MATRIX, NOTHING, normal, energy, 0.0, damping)
    c, stiff = area * effect, area * (by_depth + by_rate * effect)
    r = add(scale(area * law.tan * slope, m), scale(-stiff, n))
    g = shear.derivative(mobilised, n) if held else NO_MATRIX
    matrix = _by_place(face, r, normal * face.curvature, limit, g)
    return ContactForce(f, matrix, scale(c, n), normal, energy, 0.0, damping)


@kernel
def _by_place(face: Face, r: Vector, curved: float, limit: float, g: Nine) -> Nine:
    """Derivative r n^T + ``curved`` u u^T - ``limit`` g of a force by the place of its point, by rows."""
    n, u = face.n, face.u
    return (
        r[0] * n[0] + curved * u[0] * u[0] - limit * g[0],
        r[0] * n[1] + curved * u[0] * u[1] - limit * g[1],
        r[0] * n[2] + curved * u[0] * u[2] - limit * g[2],
        r[1] * n[0] + curved * u[1] * u[0] - limit * g[3],
        r[1] * n[1] + curved * u[1] * u[1] - limit * g[4],
        r[1] * n[2] + curved * u[1] * u[2] - limit * g[5],
        r[2] * n[0] + curved * u[2] * u[0] - limit * g[6],
        r[2] * n[1] + curved * u[2] * u[1] - limit * g[7],
        r[2] * n[2] + curved * u[2] * u[2] - limit * g[8],
    )


@kernel
def ground_force(
    law: Soil, point: GroundPoint, face: Face, by_rate: float, tangent: bool, w: ChainWork
) -> ContactForce:
    """See ``grounds``."""
    row = point.row
    return soil_force(law, point, face, by_rate, tangent, w.before.soil[row], w.rut, w.soil[row])


@kernel
def penetration(law: Soil, depth: float) -> float:
    """See ``grounds``: none, soil gives way."""
    return 0.0


@kernel
def begin_ground(law: Soil, w: ChainWork) -> None:
    """See ``grounds``."""
    rows.clear(w.soil)


@kernel
def commit_ground(law: Soil, sections: Floats, points_across: int, s: ChainState, w: ChainWork) -> tuple[float, float]:
    """See ``grounds``."""
    return rows.commit(law, sections, points_across, s.soil, w.soil, s.rut)
