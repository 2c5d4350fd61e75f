"""Entries for chains that jump over teeth: the numbers of seated pins against their gaps change."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from orchestrator.log.time_series import Floats
from orchestrator.results.analyses import hull, link_records
from orchestrator.results.run_data import pitch_radius
from orchestrator.results.validity import limits
from orchestrator.results.validity.exceedance import FAILURE, Exceedance, passed
from orchestrator.results.validity.piece import Piece
from orchestrator.results.validity.sprocket_pins import drift, polar, signals, toothed

__all__ = ["find", "signals"]
SUSPECT, CERTAIN = 0.4, 1.0  # teeth, see ``drift``
SEATED = 0.5  # of the height of a tooth above the pitch circle: closer pins sit in a gap


def find(piece: Piece) -> Iterator[Exceedance]:
    """First jump of each track, and its largest shift in teeth; raises Missing.

    Pins are read where the travel suggests a jump; without records of pins the travel decides.
    """
    for track in toothed(piece.run):
        t, parted = drift(piece, track)
        if np.ptp(parted) < SUSPECT:
            continue
        if link_records.has(piece.run, track, "joint[*].position"):
            yield from _by_pins(piece, track)
        elif (found := passed(t, np.abs(parted), CERTAIN)) is not None:
            yield Exceedance("tooth_jump", track, found[0], "sprocket", found[1], limits.JUMP, FAILURE)


def _by_pins(piece: Piece, track: str) -> Iterator[Exceedance]:
    teeth = round(hull.number(piece.run, "sprocket", "teeth"))
    circle = pitch_radius(piece.run.scene["vehicle"])
    top = hull.number(piece.run, "sprocket", "outer_radius") + hull.number(piece.run, "sprocket", "pin_radius")
    t, distance, angle = polar(piece, track)
    found = [*jumps(angle * teeth / (2.0 * np.pi), distance, circle + SEATED * (top - circle))]
    for at, pin, off in found[:1]:
        most = max(off for _, _, off in found)
        yield Exceedance("tooth_jump", track, float(t[at]), f"sprocket, pin {pin + 1}", most, limits.JUMP, FAILURE)


def jumps(gaps: Floats, distance: Floats, seated: float) -> Iterator[tuple[int, int, float]]:
    """Record, deepest pin and shift in teeth after each jump of pins (m, n), given their gap numbers.

    The number of a pin less that of its gap is equal for all seated pins, as a chain turns with its sprocket. In each
    record the deepest pin decides, if its distance from the axle, m, is less than ``seated``. Pins are numbered round
    the chain.
    """
    pins = gaps.shape[1]
    deepest = distance.argmin(axis=1)
    rows = np.flatnonzero(distance[np.arange(len(deepest)), deepest] < seated)
    if not len(rows):
        return
    pin = deepest[rows]
    beside = gaps[rows[0], [(pin[0] + 1) % pins, pin[0] - 1]]
    along = np.sign(np.nanmean((beside - gaps[rows[0], pin[0]]) * [1.0, -1.0]))
    apart = gaps[rows, pin] - along * pin
    number = np.unwrap(np.round(apart - apart[0]), period=pins)  # modulo the closed chain
    for k in np.flatnonzero(np.diff(number)) + 1:
        yield int(rows[k]), int(pin[k]), float(abs(number[k] - number[0]))
