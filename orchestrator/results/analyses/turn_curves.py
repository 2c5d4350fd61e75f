"""Curves of a vehicle that turns: thrust of each track, steering moment, and the radius of its way."""

from __future__ import annotations

import numpy as np

from orchestrator.results.analyses import hull, slip
from orchestrator.results.analyses.common_steps import common_values
from orchestrator.results.analyses.curves import CurveCollector, SignalCurve
from orchestrator.results.analyses.phases import TURNS
from orchestrator.results.ground_axes import pose_signals, split
from orchestrator.results.run_data import EVER, RunData
from orchestrator.results.thinned import Curve
from orchestrator.results.turning import SIGN

YAW_RATE, GROUND_SPEED, MOMENT = "chassis.chassis.angular_velocity.z", "chassis.ground_speed", "chassis.steering_moment"


def of(run: RunData) -> dict[str, SignalCurve]:
    """Speed of the hull along the ground, thrust of each track, "left_track.thrust", and the steering moment of both.

    Left turns are positive (``results/turning.py``). Raises Missing without a vehicle on the ground.
    """
    forces = slip.of(run)
    t, values = common_values(run, [*(f"chassis.chassis.velocity.{axis}" for axis in "xyz"), *pose_signals(run)], EVER)
    speed, _ = split(run, values[:, :3], values[:, 3:])
    units = {GROUND_SPEED: "m/s", **{f"{track}.thrust": "N" for track in forces.tracks}}
    columns = [speed, *forces.thrust.T]
    if {f"{side}_track" for side in SIGN} == {*forces.tracks}:
        units[MOMENT] = "N.m"
        signs = [SIGN[track.removesuffix("_track")] for track in forces.tracks]
        columns.append(hull.vehicle_number(run, "track", "lateral") * forces.thrust @ signs)
    gathered = CurveCollector(run, len(columns))
    gathered.add(t, np.column_stack(columns))
    return gathered.curves([*units], [*units.values()])


def radius(speed: SignalCurve, yaw_rate: SignalCurve, window: float) -> Curve:
    """Way over change of heading in a window of time, s, m; NaN where the yaw rate is below TURNS."""
    t, v = speed.moving_mean.over(window)
    rate = np.abs(np.interp(t, *yaw_rate.moving_mean.over(window)))
    return Curve(t, np.where(rate > TURNS, v / np.maximum(rate, TURNS), np.nan))
