"""Parameters of a motor on a shaft: ports, and the ``DriveParameters`` of their values."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import chain
from typing import Any

import numpy as np

from fmus.drives.motor import DriveParameters
from fmus.drives.points import Points, parse_points
from fmus.drives.shaft import INTEGRATED
from fmus.interface.model import InvalidParameter
from fmus.interface.ports import BRAKE, NOT_NEGATIVE, POSITIVE, SPIN, TORQUE, TORQUE_LIMIT, Port, field_of
from fmus.interface.profile import Profile, parse_profile
from fmus.interface.sentences import Sentence
from fmus.physics.integrate.runge_kutta import RK4

MODES = ("speed", "torque", "controller")
EXTRAPOLATIONS = ("velocity", "acceleration")
INTERPOLATIONS = ("linear", "hold")
FREE = (  # numbers of the ``DriveParameters`` that are free parameters of every motor
    "speed.start", "ramp.start", "ramp.end", "torque.drive", "controller.proportional", "controller.integral",
    "torque.limit", "stop.time", "gear.ratio",
)  # fmt: skip
POINTS = "'time value; time value; ...', see interpolation: the"


def mount_ports() -> list[Port]:
    """Parameters of the mounts' extrapolation and of the sprockets' start angle."""
    return [
        Port("start.angle", "parameter", "rad", "angle of the sprocket against the mount at the start"),
        Port("extrapolation", "parameter", "1", "how the mount moves inside a step: with its velocity, or "
             "with the acceleration of its last two velocities besides", "acceleration", EXTRAPOLATIONS),
    ]  # fmt: skip


def lag_port() -> Port:
    """Parameter of a drive that follows a demand or commands."""
    text = "time constant with which speed or torque follow their demand, and held points are followed"
    return Port("demand.lag", "parameter", "s", text, 0.1, allowed=POSITIVE)


def cut_sentence(prefix: str = "") -> Sentence:
    """Warning of a torque that is cut."""
    return Sentence(
        f"at t = {{0:.6g}} s the torque {{1:.6g}} N m of the motor is beyond {prefix}torque.limit = {{2:.6g}} N m, to"
        " which it is cut"
    )


def torque_demand_port(prefix: str = "", body: str = "the sprocket") -> Port:
    """Input of a drive whose torque follows a demand in mode torque."""
    return Port(f"{prefix}torque.demand", "input", "N.m", f"wanted torque of the motor on {body}, in mode torque")


def demanded(config: Mapping[str, Any], prefix: str = "") -> tuple[bool, bool]:
    """Whether a motor follows a demanded speed, and in mode torque a demanded torque.

    ``config``: of the drive; ``demanded`` in it is false, true (speeds of all motors), or a list of the prefixes of
    motors that follow both. Raises InvalidParameter.
    """
    given = config.get("demanded", False)
    if not isinstance(given, bool | list):
        raise InvalidParameter(f"drive.demanded = {given!r}: must be false, true (speeds) or a list of motors")
    return (given, False) if isinstance(given, bool) else (prefix in given, prefix in given)


def motor_ports(prefix: str = "", body: str = "the sprocket", speed: str = "speed against the mount") -> list[Port]:
    """Parameters of the motor of a ``body``; ``prefix``: of their names; ``speed``: text of its speed."""
    ports = [
        Port("mode", "parameter", "1", f"what turns {body}: a prescribed speed, a constant torque, or a "
             "controller that follows the speed profile", "speed", MODES),
        Port("speed.start", "parameter", "rad/s", f"{speed} at the start, before the ramp", allowed=SPIN),
        Port("speed.end", "parameter", "rad/s", f"{speed} after the ramp", allowed=SPIN),
        Port("ramp.start", "parameter", "s", "time at which the half-cosine ramp begins", 0.0, allowed=NOT_NEGATIVE),
        Port("ramp.end", "parameter", "s", "time at which the half-cosine ramp ends", 1.0, allowed=NOT_NEGATIVE),
        Port("stop.start", "parameter", "s", "time at which the speed goes to 0 for good, below 0 for never", -1.0),
        Port("stop.time", "parameter", "s", "how long that takes, along half a cosine", 1e-3,
             allowed=POSITIVE),
        Port("torque.drive", "parameter", "N.m", "constant torque of the motor in mode torque", allowed=TORQUE),
        Port("speed.points", "parameter", "1", f"{POINTS} {speed}, rad/s, instead of a ramp", ""),
        Port("torque.points", "parameter", "1", f"{POINTS} torque of the motor, N m, instead of torque.drive", ""),
        Port("brake.points", "parameter", "1", f"{POINTS} torque of the brake, N m, instead of brake.torque", ""),
        Port("interpolation", "parameter", "1", "how points over time go on: along straight lines, with the first and "
             "the last value outside, or each holds until the next one, followed with demand.lag from 0 on", "linear",
             INTERPOLATIONS),
        Port("engine.points", "parameter", "1", "'speed torque; speed torque; ...', straight lines between: largest "
             "torque of the engine's shaft, N m, over its speed, rad/s, not in mode speed", ""),
        Port("gear.ratio", "parameter", "1", f"turns of the engine to one of {body}", 1.0, allowed=POSITIVE),
        Port("brake.torque", "parameter", "N.m", "largest torque of the brake against rotation, not in mode speed",
             allowed=BRAKE),
        Port("controller.proportional", "parameter", "N.m.s/rad", "torque per speed error", 6000.0,
             allowed=NOT_NEGATIVE),
        Port("controller.integral", "parameter", "N.m", "torque per rad of accumulated speed error", 20000.0,
             allowed=NOT_NEGATIVE),
        Port("torque.limit", "parameter", "N.m", "largest torque of the motor, either way; not in mode speed",
             TORQUE_LIMIT, allowed=NOT_NEGATIVE),
    ]  # fmt: skip
    return [port._replace(name=prefix + port.name) for port in ports]


def contradictions(prefix: str = "") -> tuple[Sentence, ...]:
    """Sentences of the contradictions that ``motor.find_contradiction`` finds, in its order."""
    return (
        Sentence(f"{prefix}ramp.end = {{0:.6g}} s must not be before {prefix}ramp.start"),
        Sentence(f"{prefix}stop.start = {{1:.6g}} s must not be before {prefix}ramp.end"),
        Sentence(f"{prefix}speed.points and {prefix}stop.start exclude each other"),
        Sentence(f"{prefix}engine.points needs mode 'torque' or 'controller': a prescribed speed has no limit"),
    )


def free_numbers(values: Mapping[str, Any], demands: tuple[bool, bool], path: str, prefix: str = "") -> dict[str, str]:
    """Numbers of the ``DriveParameters`` at ``path`` in a component's parts that follow from free parameters.

    Place -> expression, see ``interface.model.FreeParameters``; ``values``: checked parameters; ``demands``: see
    ``demanded``.
    """
    names: tuple[str, ...] = FREE
    if not demands[0]:
        names = (*names, "speed.end", "stop.start", "mode")
    if demands[1]:
        names = (*(name for name in names if name != "torque.drive"), "mode")
    if not values[f"{prefix}brake.points"]:
        names = (*names, "brake.torque")
    numbers = {f"{path}.{field_of(name)}": f"{{{prefix}{name}}}" for name in names}
    engine = _engine(values, prefix)
    if engine.time.size:
        ratio = f"{{{prefix}gear.ratio}}"
        numbers[f"{path}.steepest_slope"] = f"{ratio} * {ratio} * <{_steepest_slope(engine)!r}>"
    numbers[f"{path}.with_acceleration"] = "{extrapolation}"
    if demands[0]:
        numbers[f"{path}.demand_lag"] = "{demand.lag}"
    return numbers


def _engine(values: Mapping[str, Any], prefix: str) -> Profile:
    return parse_profile(f"{prefix}engine.points", values[f"{prefix}engine.points"], "speed torque")


def _steepest_slope(engine: Profile) -> float:
    return float(np.abs(np.diff(engine.value) / np.diff(engine.time)).max(initial=0.0))


def drive_parameters(
    values: Mapping[str, Any], inertia: float, demand: str = "", prefix: str = "", torque_demand: bool = False
) -> DriveParameters:
    """Drive with the checked parameters of ``motor_ports(prefix)`` on a shaft of ``inertia`` kg m2.

    ``demand``: name of the input that its speed follows, where there is one; ``torque_demand``: there is one for the
    torque too. Raises InvalidParameter.
    """
    names = [port.name.removeprefix(prefix) for port in motor_ports(prefix)]
    values_of = {name: values[prefix + name] for name in names}

    def no(name: str, why: str) -> InvalidParameter:
        return InvalidParameter(f"{prefix}{name} = {_short(values_of[name])}{why}")

    lag = float(values["demand.lag"]) if values_of["interpolation"] == "hold" else 0.0
    speeds, torques, brakes = (
        parse_points(f"{prefix}{name}.points", str(values_of[f"{name}.points"]), lag)
        for name in ("speed", "torque", "brake")
    )
    engine = _engine(values, prefix)
    if min(chain(engine.value, engine.time), default=0.0) < 0.0:
        raise no("engine.points", " must not be negative")
    if brakes.line.value.min(initial=0.0) < 0.0:
        raise no("brake.points", " must not be negative")
    if demand:
        if values_of["mode"] == "torque" and not torque_demand:
            raise no("mode", f": a drive with the input {demand} has a speed or a controller")
        for name, none in (("speed.points", ""), ("speed.end", 0.0), ("stop.start", -1.0)):
            if values_of[name] != none:
                raise no(name, f": the input {demand} says how fast it turns")
        speeds = Points(Profile(*np.zeros((3, 2))))
    if torque_demand:
        for name, none in (("torque.points", ""), ("torque.drive", 0.0)):
            if values_of[name] != none:
                raise no(name, f": the input {prefix}torque.demand says how large it is")
        torques = Points(Profile(*np.zeros((3, 2))))
    gear = float(values_of["gear.ratio"])
    return DriveParameters(
        inertia=inertia,
        mode=MODES.index(values_of["mode"]),
        speed_end=float(values_of["speed.end"]),
        brake_torque=float(brakes.line.value.max()) if brakes.line.value.size else float(values_of["brake.torque"]),
        with_acceleration=EXTRAPOLATIONS.index(values["extrapolation"]),
        stages=np.zeros((len(RK4.b) + 2, INTEGRATED)),
        stop_start=float(values_of["stop.start"]),
        speeds=speeds,
        torques=torques,
        brakes=brakes,
        engine=engine,
        steepest_slope=gear * gear * _steepest_slope(engine),
        demand_lag=float(values["demand.lag"]) if demand else 0.0,
        **{field_of(name): float(values_of[name]) for name in FREE},
    )


def _short(value: object) -> str:
    return f"'{value[:80]}'" if isinstance(value, str) else str(value)
