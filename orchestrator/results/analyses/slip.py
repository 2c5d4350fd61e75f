"""Slip and thrust of tracks: sliding velocity of links on the ground, and propulsive force."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from orchestrator.log.time_series import Floats
from orchestrator.results.analyses import hull
from orchestrator.results.analyses.common_steps import common_values
from orchestrator.results.ground_axes import component, ground_axes, pose_signals
from orchestrator.results.run_data import EVER, Missing, RunData, Window, mean
from orchestrator.results.table import Table

SLOWEST = 0.05  # m/s of the chain: at lower speed the slip ratio is meaningless


class Slip(NamedTuple):
    """Slip and forces of each track over time; ground forces in the axes of the ground under the vehicle."""

    tracks: tuple[str, ...]
    t: Floats  # (m,) s
    slip: Floats  # (m, tracks) m/s, velocity of links over the ground, rearwards positive
    ratio: Floats  # (m, tracks) slip over chain speed; NaN below SLOWEST
    thrust: Floats  # (m, tracks) N, forward ground force
    lateral: Floats  # (m, tracks) N, to the left
    load: Floats  # (m, tracks) N, along the normal of the ground

    def series(self) -> Table:
        """Table of all values over time."""
        kinds = (("slip", "m/s"), ("slip ratio", ""), ("thrust", "N"), ("to the left", "N"), ("load", "N"))
        columns = (("t", "s"), *((f"{track} {kind}", unit) for kind, unit in kinds for track in self.tracks))
        values = [self.t, self.slip, self.ratio, self.thrust, self.lateral, self.load]
        return Table.of("Slip and thrust over time", columns, np.column_stack(values).tolist())

    def table(self) -> Table:
        """Table of means over the window, and the largest thrust."""
        rows = []
        for k, track in enumerate(self.tracks):
            whole = [mean(self.t, each[:, k]) for each in (self.slip, self.thrust, self.lateral, self.load)]
            known = np.isfinite(self.ratio[:, k])
            ratio = mean(self.t, self.ratio[:, k], known) if known.any() else float("nan")
            thrust = self.thrust[:, k]
            rows.append(
                (
                    track, whole[0], 100.0 * ratio, whole[1] / 1e3, float(thrust.min()) / 1e3,
                    float(thrust.max()) / 1e3, whole[2] / 1e3, whole[3] / 1e3, whole[1] / whole[3],
                )
            )  # fmt: skip
        columns = (
            ("track", ""), ("slip", "m/s"), ("slip ratio", "%"), ("thrust", "kN"), ("least thrust", "kN"),
            ("largest thrust", "kN"), ("to the left", "kN"), ("load", "kN"), ("thrust over load", ""),
        )  # fmt: skip
        return Table.of(f"Slip and thrust, means over {self.t[0]:.6g} to {self.t[-1]:.6g} s", columns, rows)


def of(run: RunData, window: Window = EVER) -> Slip:
    """Slip of every track; raises Missing without a ground."""
    if run.scene.get("assembly") != "vehicle":
        raise Missing(f"{run.log.path} holds no vehicle on the ground")
    if not run.has("chassis.yaw"):
        raise Missing(f"{run.log.path} holds no 'chassis.yaw': slip is along the vehicle")
    names = hull.tracks(run)
    parts = ("ground.force.x", "ground.force.y", "ground.force.z", "slip", "speed")
    signals = [*(f"{name}.{part}" for part in parts for name in names), *pose_signals(run)]
    t, values = common_values(run, signals, window)
    count = len(parts) * len(names)
    x, y, z, slip, speed = np.split(values[:, :count], len(parts), axis=1)
    axes = ground_axes(run, values[:, count:])
    forces = np.stack([x, y, z], axis=-1)
    thrust, lateral, load = (
        np.stack([component(forces[:, k], axis) for k in range(len(names))], axis=1) for axis in axes
    )
    ratio = np.where(np.abs(speed) > SLOWEST, slip / np.where(speed, speed, 1.0), np.nan)
    return Slip(names, t, slip, ratio, thrust, lateral, load)
