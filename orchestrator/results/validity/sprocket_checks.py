"""Checks of pins on their sprocket: deep in its teeth, or over them by a jump of the chain."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from fmus.vehicles.sides import pitch_radius
from orchestrator.log.reader import Missing
from orchestrator.log.time_series import Floats
from orchestrator.results.analyses import hull, record_blocks
from orchestrator.results.run_data import RunData
from orchestrator.results.validity.exceedance import FAILURE, Exceedance, exceedance, exceedances
from orchestrator.results.validity.piece import Piece
from orchestrator.vocabulary import limits

HULL = "chassis.chassis.orientation"
REACH = 1.2  # of the radius of the teeth: pins further away have no contact


def tracks_on_sprockets(run: RunData) -> tuple[str, ...]:
    """Names of the tracks with a sprocket."""
    return tuple(track for track in run.tracks if hull.sprocket(run, track) is not None)


def pin_signals(run: RunData) -> Iterator[str]:
    """Signals: sprocket angles, chain travel; poses of hull and axles are read on demand."""
    for track in tracks_on_sprockets(run):
        yield from (f"{track}.travel", f"{shaft(run, track)}angle")


def drift(piece: Piece, track: str) -> tuple[Floats, Floats]:
    """Times (m,), s, and difference of chain travel and sprocket rotation in teeth (m,).

    Stretch of the spans and motion of the idler make up to 0.4 pitches, sprockets that lock at speed 0.6, a jump a
    tooth or more. Raises Missing.
    """
    teeth = hull.vehicle_number(piece.run, "sprocket", "teeth")
    pitch = hull.vehicle_number(piece.run, "track", "pitch") * hull.pins_per_gap(piece.run)
    pitch /= hull.gaps_per_pin(piece.run)  # of the teeth
    t, travel = piece.signal(f"{track}.travel")
    _, angle = piece.signal(f"{shaft(piece.run, track)}angle")
    if len(travel) != len(angle) or not len(angle):
        raise Missing("the log holds different steps of its components")
    turned = angle * teeth / (2.0 * np.pi)
    differences = travel / pitch - turned, travel / pitch + turned  # links are numbered in either direction
    smallest = min(differences, key=lambda difference: float(np.ptp(difference)))
    return t, smallest - smallest[0]


class Polar(NamedTuple):
    """Polar coordinates of pins, with lugs alone where not all have one, near a sprocket in each record."""

    t: Floats  # (m,) s
    distance: Floats  # (m, pins) m, from the axle; infinite for distant pins
    angle: Floats  # (m, pins) rad, on the sprocket, in its forward direction; NaN for distant pins


def polar(piece: Piece, track: str) -> Polar:
    """Polar coordinates of the pins of a track; the angle jumps opposite the wrap. Raises Missing."""
    return piece.compute_once(f"polar, {track}", lambda: _polar(piece, track))


def _polar(piece: Piece, track: str) -> Polar:
    t, pins = piece.pins(track)
    pins = pins[:, :: hull.pins_per_gap(piece.run)]
    axle, axes = hull.poses(piece.run, track, t)
    turned = np.interp(t, *piece.signal(f"{shaft(piece.run, track)}angle"))
    x, z = (np.einsum("mni,mi->mn", pins - axle[:, None], axes[..., k]) for k in (0, 2))
    reach = REACH * hull.vehicle_number(piece.run, "sprocket", "outer_radius")
    record, pin = np.nonzero((np.abs(x) < reach) & (np.abs(z) < reach))
    near_x, near_z = x[record, pin], z[record, pin]
    distance, angle = np.full(x.shape, np.inf), np.full(x.shape, np.nan)
    distance[record, pin] = np.hypot(near_x, near_z)
    away = np.arctan2(z[0].mean(), -x[0].mean())  # from the middle of the chain
    turn = np.arctan2(-near_z, near_x) - away  # about +y, the direction of forward rotation
    angle[record, pin] = (turn + np.pi) % (2.0 * np.pi) - np.pi - turned[record]
    return Polar(t, distance, angle)


def shaft(run: RunData, track: str) -> str:
    """Prefix of the shaft variables of a track's sprocket; raises Missing."""
    return hull.sprocket_speed(run, track).removesuffix("speed")


def seats(piece: Piece) -> Iterator[Exceedance]:
    """Entries for pins of tracks with recorded pins; raises Missing."""
    radius = hull.vehicle_number(piece.run, "sprocket", "pin_radius")
    seated = pitch_radius(piece.run.scene["vehicle"])
    most = radius * limits.PIN_WARNING, radius * limits.PIN_FAILURE
    for track in tracks_on_sprockets(piece.run):
        if not (piece.signal(f"{track}.penetration.max")[1] > most[0]).any():  # no contact is deeper
            continue
        t, distance, _ = polar(piece, track)
        deepest = distance.argmin(axis=1)
        depth = seated - distance.min(axis=1)
        for entry, worst in exceedances("penetration", track, t, depth, *most):
            pin = int(deepest[np.searchsorted(t, worst)]) * hull.pins_per_gap(piece.run) + 1
            yield entry._replace(place=f"sprocket, pin {pin}")


SUSPECT, CERTAIN = 0.4, 1.0  # a tooth, and a pitch: see ``drift``
SEATED = 0.5  # of the height of a tooth above the pitch circle: closer pins sit in a gap


def tooth_jump(piece: Piece) -> Iterator[Exceedance]:
    """First jump of each track, and its largest shift in teeth; raises Missing.

    Pins are read where the travel suggests a jump; without records of pins the travel decides.
    """
    for track in tracks_on_sprockets(piece.run):
        t, teeth = drift(piece, track)
        if np.ptp(teeth) < SUSPECT:
            continue
        if record_blocks.has(piece.run, track, "joint[*].position"):
            yield from _by_pins(piece, track)
        else:
            most = CERTAIN * hull.gaps_per_pin(piece.run)
            found = exceedance("tooth_jump", track, "sprocket", t, np.abs(teeth), most, FAILURE)
            yield from (entry._replace(limit=limits.JUMP) for entry in found)


def _by_pins(piece: Piece, track: str) -> Iterator[Exceedance]:
    teeth = round(hull.vehicle_number(piece.run, "sprocket", "teeth"))
    circle = pitch_radius(piece.run.scene["vehicle"])
    top = hull.vehicle_number(piece.run, "sprocket", "outer_radius") + hull.vehicle_number(
        piece.run, "sprocket", "pin_radius"
    )
    t, distance, angle = polar(piece, track)
    gaps, seated = angle * teeth / (2.0 * np.pi), circle + SEATED * (top - circle)
    jumps_found = [*jumps(gaps, distance, seated, hull.gaps_per_pin(piece.run))]
    for record, pin, shift in jumps_found[:1]:
        most = max(shift for _, _, shift in jumps_found)
        place = f"sprocket, pin {pin * hull.pins_per_gap(piece.run) + 1}"
        yield Exceedance("tooth_jump", track, float(t[record]), place, most, limits.JUMP, FAILURE)


def jumps(gaps: Floats, distance: Floats, seated: float, per_pin: float = 1.0) -> Iterator[tuple[int, int, float]]:
    """Record, deepest pin and shift in teeth after each jump of pins (m, n), given their gap numbers.

    The number of a pin, times the gaps ``per_pin``, less that of its gap is equal for all seated pins, as a chain turns
    with its sprocket. In each record the deepest pin decides, if its distance from the axle, m, is less than
    ``seated``. Pins are numbered round the chain.
    """
    pins = gaps.shape[1]
    deepest = distance.argmin(axis=1)
    rows = np.flatnonzero(distance[np.arange(len(deepest)), deepest] < seated)
    if not len(rows):
        return
    pin = deepest[rows]
    neighbours = gaps[rows[0], [(pin[0] + 1) % pins, pin[0] - 1]]
    along = np.sign(np.nanmean((neighbours - gaps[rows[0], pin[0]]) * [1.0, -1.0]))
    pin_less_gap = gaps[rows, pin] - along * per_pin * pin
    number = np.unwrap(np.round(pin_less_gap - pin_less_gap[0]), period=pins * per_pin)  # modulo the closed chain
    for k in np.flatnonzero(np.diff(number)) + 1:
        yield int(rows[k]), int(pin[k]), float(abs(number[k] - number[0]))
