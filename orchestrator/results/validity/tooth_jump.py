"""Entries for chains that jump over teeth: the numbers of seated pins against their gaps change."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from orchestrator.log.time_series import Floats
from orchestrator.results.analyses import hull, link_records
from orchestrator.results.run_data import pitch_radius
from orchestrator.results.validity import limits
from orchestrator.results.validity.exceedance import FAILURE, Exceedance, excess
from orchestrator.results.validity.piece import Piece
from orchestrator.results.validity.sprocket_pins import drift, polar, signals, tracks_on_sprockets

__all__ = ["find", "signals"]
SUSPECT, CERTAIN = 0.4, 1.0  # teeth, see ``drift``
SEATED = 0.5  # of the height of a tooth above the pitch circle: closer pins sit in a gap


def find(piece: Piece) -> Iterator[Exceedance]:
    """First jump of each track, and its largest shift in teeth; raises Missing.

    Pins are read where the travel suggests a jump; without records of pins the travel decides.
    """
    for track in tracks_on_sprockets(piece.run):
        t, teeth = drift(piece, track)
        if np.ptp(teeth) < SUSPECT:
            continue
        if link_records.has(piece.run, track, "joint[*].position"):
            yield from _by_pins(piece, track)
        elif (first_and_worst := excess(t, np.abs(teeth), CERTAIN)) is not None:
            yield Exceedance(
                "tooth_jump", track, first_and_worst[0], "sprocket", first_and_worst[1], limits.JUMP, FAILURE
            )


def _by_pins(piece: Piece, track: str) -> Iterator[Exceedance]:
    teeth = round(hull.vehicle_number(piece.run, "sprocket", "teeth"))
    circle = pitch_radius(piece.run.scene["vehicle"])
    top = hull.vehicle_number(piece.run, "sprocket", "outer_radius") + hull.vehicle_number(
        piece.run, "sprocket", "pin_radius"
    )
    t, distance, angle = polar(piece, track)
    jumps_found = [*jumps(angle * teeth / (2.0 * np.pi), distance, circle + SEATED * (top - circle))]
    for record, pin, shift in jumps_found[:1]:
        most = max(shift for _, _, shift in jumps_found)
        yield Exceedance("tooth_jump", track, float(t[record]), f"sprocket, pin {pin + 1}", most, limits.JUMP, FAILURE)


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
    neighbours = gaps[rows[0], [(pin[0] + 1) % pins, pin[0] - 1]]
    along = np.sign(np.nanmean((neighbours - gaps[rows[0], pin[0]]) * [1.0, -1.0]))
    pin_less_gap = gaps[rows, pin] - along * pin
    number = np.unwrap(np.round(pin_less_gap - pin_less_gap[0]), period=pins)  # modulo the closed chain
    for k in np.flatnonzero(np.diff(number)) + 1:
        yield int(rows[k]), int(pin[k]), float(abs(number[k] - number[0]))
