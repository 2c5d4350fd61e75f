"""The plane of a track: ahead of its sprocket's axle and up, as it moves."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from orchestrator.log.reader import NoSuchSignal
from orchestrator.log.time_series import Floats
from orchestrator.results.run_data import RunData


class Plane(NamedTuple):
    """At some instants."""

    origin: Floats  # (m, 3) m, the axle of the sprocket, or where the scene starts without one
    ahead: Floats  # (m, 3) unit vector, level, across the axle
    fixed: bool  # no axle carries it

    def seen(self, places: Floats) -> Floats:
        """Places (m, ..., 3) of the world as ahead of and above the origin, (m, ..., 2) m."""
        between = (slice(None), *(None,) * (places.ndim - 2))
        offset = places - self.origin[between]
        return np.stack([np.sum(offset * self.ahead[between], axis=-1), offset[..., 2]], axis=-1)


def plane(run: RunData, track: str, t: Floats) -> Plane:
    """Of a track at times (m,), s; raises LogUnreadable, and LookupError for a scene without a start."""
    try:
        pose = run.log.sample(_pose(track, "sprocket"), t)
    except NoSuchSignal:
        start = run.scene["start"]
        ahead = np.array([np.cos(start["heading"]), np.sin(start["heading"]), 0.0])
        place = np.array(start["position"], float)
        return Plane(np.tile(place, (len(t), 1)), np.tile(ahead, (len(t), 1)), True)
    w, x, y, z = pose[:, 3:].T
    across = 2.0 * (x * y - w * z), 1.0 - 2.0 * (x * x + z * z)  # the axle along the level
    ahead = np.stack([across[1], -across[0], np.zeros_like(w)], axis=1)
    return Plane(pose[:, :3], ahead / np.linalg.norm(ahead, axis=1, keepdims=True), False)


def wheel(run: RunData, track: str, name: str, of: Plane, t: Floats) -> tuple[Floats, Floats]:
    """Centre (m, 2) m and angle (m,) rad of a wheel, as seen in the plane; raises NoSuchSignal, LogUnreadable."""
    pose = run.log.sample(_pose(track, name), t)
    w, x, y, z = pose[:, 3:].T
    spoke = np.stack([1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + w * z), 2.0 * (x * z - w * y)], axis=1)
    return of.seen(pose[:, :3]), np.arctan2(spoke[:, 2], np.sum(spoke * of.ahead, axis=1))


def _pose(track: str, name: str) -> list[str]:
    parts = [f"position.{axis}" for axis in "xyz"] + [f"orientation.{axis}" for axis in "wxyz"]
    return [f"{track}.{name}.{part}" for part in parts]
