"""Pins as their sprocket sees them."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from orchestrator.log.time_series import Floats
from orchestrator.results.analyses import hull
from orchestrator.results.energy import Port
from orchestrator.results.rotation import matrices
from orchestrator.results.run_data import Missing, RunData
from orchestrator.results.validity.piece import Piece

HULL = "chassis.chassis.orientation"
REACH = 1.2  # of the radius of the teeth: pins that are further away touch none


def toothed(run: RunData) -> tuple[str, ...]:
    """Names of the tracks that have a sprocket."""
    return tuple(track for track in run.tracks if hull.sprocket(run, track) is not None)


def signals(run: RunData) -> Iterator[str]:
    """Places of the axles, angles of the sprockets, travel of the chains, attitude of the hull."""
    yield from (f"{HULL}.{part}" for part in "wxyz")
    for track in toothed(run):
        port = _port(run, track)
        yield f"{track}.travel"
        yield f"{shaft(run, track)}angle"
        yield from (f"{port.taker}.{port.taken}.position.{axis}" for axis in "xyz")


def drift(piece: Piece, track: str) -> tuple[Floats, Floats]:
    """Times (m,), s, and teeth (m,) by which the travel of a chain and the turning of its sprocket have parted.

    Stretch of spans and the way of the idler part them by 0.4, sprockets that lock at speed by 0.6; a jump by 1. Raises
    Missing.
    """
    pitch, teeth = hull.number(piece.run, "track", "pitch"), hull.number(piece.run, "sprocket", "teeth")
    t, travel = piece.signal(f"{track}.travel")
    _, angle = piece.signal(f"{shaft(piece.run, track)}angle")
    if len(travel) != len(angle) or not len(angle):
        raise Missing("the log holds different steps of its components")
    turned = angle * teeth / (2.0 * np.pi)
    parted = travel / pitch - turned, travel / pitch + turned  # links count one way or the other
    least = min(parted, key=lambda each: float(np.ptp(each)))
    return t, least - least[0]


class Polar(NamedTuple):
    """Pins near a sprocket in each record."""

    t: Floats  # (m,) s
    distance: Floats  # (m, pins) m, from the axle; infinite for pins that are far
    angle: Floats  # (m, pins) rad, against the sprocket; grows as that turns ahead; NaN for pins that are far


def polar(piece: Piece, track: str) -> Polar:
    """Pins of a track; raises Missing. The seam of their angles is opposite of the wrap."""
    return piece.once(f"polar, {track}", lambda: _polar(piece, track))


def _polar(piece: Piece, track: str) -> Polar:
    port = _port(piece.run, track)
    t, pins = piece.pins(track)
    axle = _at(t, *piece.vector(f"{port.taker}.{port.taken}.position"))
    turned = _at(t, *piece.columns([f"{shaft(piece.run, track)}angle"]))[:, 0]
    ahead, up = _axes(piece, t)
    offset = pins - axle[:, None]
    x, z = np.einsum("mni,mi->mn", offset, ahead), np.einsum("mni,mi->mn", offset, up)
    reach = REACH * hull.number(piece.run, "sprocket", "outer_radius")
    record, pin = np.nonzero((np.abs(x) < reach) & (np.abs(z) < reach))
    near_x, near_z = x[record, pin], z[record, pin]
    distance, angle = np.full(x.shape, np.inf), np.full(x.shape, np.nan)
    distance[record, pin] = np.hypot(near_x, near_z)
    away = np.arctan2(z[0].mean(), -x[0].mean())  # from the middle of the chain
    turn = np.arctan2(-near_z, near_x) - away  # about +y, as a sprocket turns ahead
    angle[record, pin] = (turn + np.pi) % (2.0 * np.pi) - np.pi - turned[record]
    return Polar(t, distance, angle)


def _port(run: RunData, track: str) -> Port:
    port = hull.sprocket(run, track)
    if port is None:
        raise Missing(f"'{track}' runs on no sprocket")
    return port


def shaft(run: RunData, track: str) -> str:
    """What the variables of the shaft of a track's sprocket begin with; raises Missing."""
    port = _port(run, track)
    return f"{port.taker}.{port.taken.removesuffix('sprocket')}"


def _axes(piece: Piece, t: Floats) -> tuple[Floats, Floats]:
    """Unit vectors ahead and up of the hull (m, 3) each; without a hull those of the start."""
    try:
        q = _at(t, *piece.vector(HULL, "wxyz"))
    except Missing:
        heading = float(piece.run.scene.get("start", {}).get("heading", 0.0))
        ahead = np.tile([np.cos(heading), np.sin(heading), 0.0], (len(t), 1))
        return ahead, np.tile([0.0, 0.0, 1.0], (len(t), 1))
    axes = matrices(q / np.linalg.norm(q, axis=1, keepdims=True))
    return axes[..., 0], axes[..., 2]


def _at(t: Floats, times: Floats, values: Floats) -> Floats:
    """Values (m, k) at the times (m,), by straight lines."""
    if not len(times):
        raise Missing("nothing was recorded in this window")
    return np.stack([np.interp(t, times, column) for column in values.T], axis=1)
