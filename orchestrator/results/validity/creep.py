"""Entries for standing vehicles that creep, because friction is regularised."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from orchestrator.results.analyses import hull
from orchestrator.results.ground_axes import POSE, split
from orchestrator.results.ground_surface import on_terrain
from orchestrator.results.run_data import Missing, RunData, mean
from orchestrator.results.validity import limits
from orchestrator.results.validity.exceedance import WARNING, Exceedance
from orchestrator.results.validity.piece import Piece
from orchestrator.results.validity.sprocket_pins import shaft, tracks_on_sprockets

STANDS = 0.1  # rad/s of a sprocket: brakes fade below
TURNS = 0.02  # rad/s of the hull: a turning vehicle slides sideways
YAW = "chassis.chassis.angular_velocity.z"


def signals(run: RunData) -> Iterator[str]:
    """Signals: slip and ground force, sprocket speeds, yaw rate and place of the hull."""
    yield YAW
    yield from POSE if on_terrain(run.scene) else ()
    for track in tracks_on_sprockets(run):
        yield f"{shaft(run, track)}speed"
        yield f"{track}.slip"
        yield from (f"{track}.ground.force.{axis}" for axis in "xyz")


def find(piece: Piece) -> Iterator[Exceedance]:
    """Entries for tracks that slide though friction could hold them; raises Missing.

    The vehicle must stand for STANDING seconds.
    """
    friction = least_friction(piece.run)
    _, yaw = piece.signal(YAW)
    pose = piece.columns([*POSE])[1] if on_terrain(piece.run.scene) else np.empty((len(yaw), 0))
    for track in tracks_on_sprockets(piece.run):
        t, slip = piece.signal(f"{track}.slip")
        _, speed = piece.signal(f"{shaft(piece.run, track)}speed")
        _, force = piece.vector(f"{track}.ground.force")
        if not len(t) == len(yaw) == len(speed) == len(force):
            raise Missing("the log holds different steps of its components")
        sideways, load = split(piece.run, force, pose)
        below_limit = sideways < limits.STICKS * friction * load
        still = below_limit & (np.abs(speed) < STANDS) & (np.abs(yaw) < TURNS)
        begin = 0
        while len(t) - begin > 1:
            end = int(np.searchsorted(t, t[begin] + limits.STANDING, "right"))
            if end >= len(t):
                return
            part = slice(begin, end)
            if not still[part].all():
                begin += int(np.flatnonzero(~still[part])[-1]) + 1
                continue
            speed_of_creep = abs(mean(t[part], slip[part]))
            if speed_of_creep > limits.CREEP:
                yield Exceedance("creep", track, float(t[begin]), "", speed_of_creep, limits.CREEP, WARNING)
            begin = end


def least_friction(run: RunData) -> float:
    """Least coefficient of friction of the ground: that of the vehicle's contacts, or of a region; raises Missing."""
    friction = hull.vehicle_number(run, "contact", "ground", "friction")
    regions = (run.scene.get("ground") or {}).get("friction") or ()
    return min(
        [friction]
        + [region["coefficient"] if region["factor"] is None else friction * region["factor"] for region in regions]
    )
