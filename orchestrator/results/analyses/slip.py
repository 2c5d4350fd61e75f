"""Two slips of tracks, and thrust; ``orchestrator/analyses.md`` defines both slips.

``speed``, m/s: of a chain, forward positive; ``lag``, m/s: what the hull (slip) or the ground under the pads (pad slip)
is short of it. Both (m,), or (m, k) of k tracks, at times (m,), s. Slips are positive where tracks drive, either way.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from orchestrator.log.reader import Missing
from orchestrator.log.time_series import Floats
from orchestrator.results.analyses import hull
from orchestrator.results.analyses.record_blocks import common_values
from orchestrator.results.ground_under_vehicle import component, ground_axes, pose_signals
from orchestrator.results.run_data import EVER, RunData, Window, mean
from orchestrator.results.table import Table

SLOWEST = 0.05  # m/s: a slower chain stands, so that a lag is no share of its speed
MAX_LAG = 4.0  # lag over speed beyond which a chain stands too: the vehicle slides on it
TURN = 2.0 * np.pi
MOTION = [f"chassis.chassis.{part}.{axis}" for part in ("velocity", "angular_velocity") for axis in "xyz"]


def towards(speed: Floats, lag: Floats) -> Floats:
    """Direction in which a chain runs, 1 or -1; where it stands, that in which the vehicle slides."""
    return np.asarray(np.where(MAX_LAG * np.abs(speed) > np.abs(lag), np.sign(speed), -np.sign(lag)))


def mean_lag(t: Floats, speed: Floats, lag: Floats) -> float:
    """Mean lag along the direction of travel, m/s: positive where the track drives, negative where it brakes."""
    return mean(t, lag * towards(speed, lag))


def ratios(speed: Floats, lag: Floats) -> Floats:
    """Lag over speed; NaN where the chain stands."""
    runs = np.abs(speed) > np.maximum(SLOWEST, np.abs(lag) / MAX_LAG)
    return np.asarray(np.where(runs, lag / np.where(runs, speed, 1.0), np.nan))


def ratio(t: Floats, speed: Floats, lag: Floats) -> float:
    """Mean lag over mean speed, both along the direction of travel; NaN where the chain stands."""
    run = mean(t, speed * towards(speed, lag))
    return float(ratios(np.asarray(run), np.asarray(mean_lag(t, speed, lag))))


class Slip(NamedTuple):
    """Slip and forces of each track over time; ground forces in the axes of the ground under the vehicle."""

    tracks: tuple[str, ...]
    t: Floats  # (m,) s
    chain: Floats  # (m, tracks) m/s, speed of the chain
    pads: Floats  # (m, tracks) m/s, velocity of links over the ground, rearwards positive
    pitched: Floats  # (m, tracks) m/s, a pitch a pin of the sprocket
    lag: Floats  # (m, tracks) m/s, that less the speed of the hull over the track
    thrust: Floats  # (m, tracks) N, forward ground force
    lateral: Floats  # (m, tracks) N, to the left
    load: Floats  # (m, tracks) N, along the normal of the ground

    def series(self) -> Table:
        """Table of all values over time."""
        kinds = (("slip", ""), ("pad slip", ""), ("pads", "m/s"), ("thrust", "N"), ("to the left", "N"), ("load", "N"))
        columns = (("t", "s"), *((f"{track} {kind}", unit) for kind, unit in kinds for track in self.tracks))
        slips = ratios(self.pitched, self.lag), ratios(self.chain, self.pads)
        values = np.column_stack([self.t, *slips, self.pads, self.thrust, self.lateral, self.load])
        return Table.of("Slip and thrust over time", columns, values.tolist())

    def table(self) -> Table:
        """Table of means over the window, and the largest thrust."""
        rows = []
        for k, track in enumerate(self.tracks):
            chain, pads, pitched, lag, thrust, lateral, load = (each[:, k] for each in self[2:])
            ahead, left, up = (mean(self.t, each) / 1e3 for each in (thrust, lateral, load))
            rows.append(
                (
                    track, 100.0 * ratio(self.t, pitched, lag), 100.0 * ratio(self.t, chain, pads),
                    mean_lag(self.t, chain, pads), ahead, float(thrust.min()) / 1e3, float(thrust.max()) / 1e3,
                    left, up, ahead / up if up else float("nan"),
                )
            )  # fmt: skip
        columns = (
            ("track", ""), ("slip", "%"), ("pad slip", "%"), ("pads", "m/s"), ("thrust", "kN"), ("least thrust", "kN"),
            ("largest thrust", "kN"), ("to the left", "kN"), ("load", "kN"), ("thrust over load", ""),
        )  # fmt: skip
        return Table.of(f"Slip and thrust, means over {self.t[0]:.6g} to {self.t[-1]:.6g} s", columns, rows)


def of(run: RunData, window: Window = EVER, track: str = "") -> Slip:
    """Slip of every track, or of one or its side; raises Missing without a ground."""
    if run.scene.get("assembly") != "vehicle":
        raise Missing(f"{run.log.path} holds no vehicle on the ground")
    if not run.has("chassis.yaw"):
        raise Missing(f"{run.log.path} holds no 'chassis.yaw': slip is along the vehicle")
    names = hull.tracks(run, track)
    parts = ("ground.force.x", "ground.force.y", "ground.force.z", "speed", "slip")
    sprockets = (hull.sprocket_speed(run, name) for name in names)
    signals = [*(f"{name}.{part}" for part in parts for name in names), *sprockets, *MOTION, *pose_signals(run)]
    t, values = common_values(run, signals, window)
    x, y, z, chain, pads, turned, motion = np.split(values, len(names) * np.arange(1, 7), axis=1)
    axes = ground_axes(run, motion[:, 6:])
    forces = np.stack([x, y, z], axis=-1)
    thrust, lateral, load = (
        np.stack([component(forces[:, k], axis) for k in range(len(names))], axis=1) for axis in axes
    )
    lugs = hull.pins_of_sprocket(run) * hull.pins_per_gap(run)
    pitched = turned * lugs * hull.vehicle_number(run, "track", "pitch") / TURN
    sides = np.array([1.0 if name.startswith("right") else -1.0 for name in names])
    aside = sides * hull.vehicle_number(run, "track", "lateral")
    over = component(motion[:, :3], axes.ahead)[:, None] + component(motion[:, 3:6], axes.up)[:, None] * aside
    return Slip(names, t, chain, pads, pitched, pitched - over, thrust, lateral, load)
