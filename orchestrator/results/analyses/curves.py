"""Signals over a run as thinned curves, with their extremes and moving means, in one pass over the log."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from orchestrator.log.angles import Continuous
from orchestrator.log.reader import Missing
from orchestrator.log.time_series import Floats
from orchestrator.results.analyses import hull, record_blocks, slip, wheel_loads
from orchestrator.results.analyses.motion_states import TURNS
from orchestrator.results.analyses.record_blocks import common_values
from orchestrator.results.approximations import PARTS, Curve, Integrals, MovingMean, Peak, TimeEnvelope
from orchestrator.results.energy import STORED
from orchestrator.results.ground_under_vehicle import pose_signals, split
from orchestrator.results.run_data import EVER, RunData
from orchestrator.results.turning import SIGN
from orchestrator.results.units import number

ENERGIES = {"work": ("work",), "stored": STORED, "lost": ("dissipated", "covered", "towed")}
STANDS = 1e-3  # rad/s: a slower sprocket stands
_DRIVEN = re.compile(r"((?:\w+\.)?)torque")


class SignalCurve(NamedTuple):
    """Curve of a signal, its extreme values and its moving mean."""

    curve: Curve
    unit: str
    least: Peak
    most: Peak
    moving_mean: MovingMean

    @property
    def largest(self) -> Peak:
        """Extreme value of the larger size."""
        return self.most if abs(self.most.value) >= abs(self.least.value) else self.least


def drives(run: RunData) -> list[str]:
    """Prefixes of the variables of drives, "instance." or "instance.side."."""
    return [
        f"{name}.{found[1]}"
        for name in run.instances
        if f"/{name}/out" in run.log.topics
        for variable in run.log.topics[f"/{name}/out"].names
        if (found := _DRIVEN.fullmatch(variable))
    ]


def of(run: RunData, signals: Iterable[str]) -> dict[str, SignalCurve]:
    """Curves of the outputs, "instance.variable", that the log has and that are numbers; raises LogUnreadable."""
    wanted = record_blocks.named_columns(run, [name for name in dict.fromkeys(signals) if run.has(name)])
    gathered = {topic: CurveCollector(run, len(places)) for topic, places in wanted.items()}
    units = {topic: [run.log.topics[topic].units[column] for column in places] for topic, places in wanted.items()}
    angles = {topic: Continuous(each) for topic, each in units.items()}
    for piece in run.log.stream(wanted):
        for topic, series in piece.items():
            gathered[topic].add(series.t, angles[topic](series.values))
    curves: dict[str, SignalCurve] = {}
    for topic, places in wanted.items():
        names = [run.log.name(topic, column) for column in places]
        curves |= gathered[topic].curves(names, units[topic])
    return curves


def loads(run: RunData) -> dict[str, SignalCurve]:
    """Curves of the loads of road wheels (``wheel_loads.py``), "track.road_wheel[1].load"; raises Missing."""
    names = wheel_loads.names(run)
    gathered = CurveCollector(run, len(names))
    for t, values in wheel_loads.blocks(run):
        gathered.add(t, values)
    return gathered.curves([f"{name}.load" for name in names], ["N"] * len(names))


def energies(run: RunData) -> dict[str, Curve]:
    """Work, stored and lost energy of all components since the start, J, by the keys of ENERGIES.

    Raises Missing if the components were not recorded at the same steps, LogUnreadable.
    """
    parts = {
        signal: (k, run.copies(name))
        for name in run.instances
        for k, kinds in enumerate(ENERGIES.values())
        for kind in kinds
        if run.has(signal := f"{name}.energy.{kind}")
    }
    envelope = TimeEnvelope(*run.span, len(ENERGIES))
    first: Floats | None = None
    for t, values in record_blocks.common_blocks(run, [*parts]):
        total = np.zeros((len(t), len(ENERGIES)))
        for column, (k, copies) in zip(values.T, parts.values(), strict=True):
            total[:, k] += copies * column
        if len(t):
            first = total[0] if first is None else first
            with np.errstate(invalid="ignore"):  # an unstable run may overflow
                envelope.add(t, total - first)
    return {name: curve for k, name in enumerate(ENERGIES) if len((curve := envelope.curve(k)).t)}


class Ripple(NamedTuple):
    """Window of moving means."""

    window: float  # s
    description: str


def ripple(run: RunData, drives: Sequence[str], signals: Mapping[str, SignalCurve]) -> Ripple:
    """Shortest time of whole tooth passings at the largest sprocket speed that is a hundredth of the run or longer.

    Without a sprocket that turns, a hundredth of the run.
    """
    duration = run.span[1] - run.span[0]
    least = duration / PARTS
    speeds = [abs(signals[name].largest.value) for prefix in drives if (name := f"{prefix}speed") in signals]
    speed = max(speeds, default=0.0)
    try:
        passing = 2.0 * np.pi / (hull.pins_of_sprocket(run) * speed) if speed > STANDS else np.inf  # s
    except Missing:
        passing = np.inf
    if not 0.0 < passing <= 0.1 * duration:
        return Ripple(least, f"{number(1e3 * least, 3)} ms")
    count = int(np.ceil(least / passing))
    name = f"{count} tooth passings" if count > 1 else "one tooth passing"
    return Ripple(count * passing, f"{name} at top speed, {number(1e3 * count * passing, 3)} ms")


class CurveCollector:
    """Curves, extremes and integrals of some signals, from samples in the order of time."""

    def __init__(self, run: RunData, count: int) -> None:
        self._envelope = TimeEnvelope(*run.span, count)
        self._integrals = Integrals(*run.span, count)

    def add(self, t: Floats, values: Floats) -> None:
        """Add samples (m, signals) at times (m,), s."""
        self._envelope.add(t, values)
        self._integrals.add(t, values)

    def curves(self, names: Sequence[str], units: Sequence[str]) -> dict[str, SignalCurve]:
        """Curves of the signals that have finite values."""
        extremes, integrals = self._envelope, self._integrals
        return {
            name: SignalCurve(extremes.curve(k), unit, least, most, integrals.moving_mean(k))
            for k, (name, unit) in enumerate(zip(names, units, strict=True))
            if (least := extremes.smallest(k)) and (most := extremes.largest(k))
        }


YAW_RATE, GROUND_SPEED, MOMENT = "chassis.chassis.angular_velocity.z", "chassis.ground_speed", "chassis.steering_moment"


def of_turns(run: RunData) -> dict[str, SignalCurve]:
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
