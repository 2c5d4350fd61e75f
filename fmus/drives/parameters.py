"""What can be set of a motor on a shaft: ports, and a ``Drive`` of their values."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import chain
from typing import Any

import numpy as np

from fmus.course import Course, course
from fmus.defaults import check_values
from fmus.drives.motor import Drive
from fmus.model import InvalidParameter
from fmus.ports import Port

MODES = ("speed", "torque", "controller")
EXTRAPOLATIONS = ("velocity", "acceleration")
POINTS = "'time value; time value; ...', straight lines between: the"
NOT_NEGATIVE = "brake.torque", "controller.proportional", "controller.integral", "torque.limit"
POSITIVE = "gear.ratio", "brake.speed", "stop.time"


def mount_ports() -> list[Port]:
    """Of how mounts move and how sprockets stand on them."""
    return [
        Port("start.angle", "parameter", "rad", "angle of the sprocket against the mount at the start"),
        Port("extrapolation", "parameter", "1", "how the mount moves inside a step: with its velocity, or "
             "with the acceleration of its last two velocities besides", "acceleration", EXTRAPOLATIONS),
    ]  # fmt: skip


def lag_port() -> Port:
    """Of a drive that follows demands."""
    return Port("demand.lag", "parameter", "s", "time constant with which the speed follows the demand", 0.1)


def motor_ports(prefix: str = "", what: str = "the sprocket", speed: str = "speed against the mount") -> list[Port]:
    """Of the motor that turns ``what``, names after ``prefix``; ``speed``: what its speed is."""
    ports = [
        Port("mode", "parameter", "1", f"what turns {what}: a prescribed speed, a constant torque, or a "
             "controller that follows the speed profile", "speed", MODES),
        Port("speed.start", "parameter", "rad/s", f"{speed} at the start, before the ramp"),
        Port("speed.end", "parameter", "rad/s", f"{speed} after the ramp"),
        Port("ramp.start", "parameter", "s", "time at which the half-cosine ramp begins", 0.0),
        Port("ramp.end", "parameter", "s", "time at which the half-cosine ramp ends", 1.0),
        Port("stop.start", "parameter", "s", "time at which the speed goes to 0 for good, below 0 for never", -1.0),
        Port("stop.time", "parameter", "s", "how long that takes, along half a cosine", 1e-3),
        Port("torque.drive", "parameter", "N.m", "constant torque of the motor in mode torque"),
        Port("speed.points", "parameter", "1", f"{POINTS} {speed}, rad/s, instead of a ramp", ""),
        Port("torque.points", "parameter", "1", f"{POINTS} torque of the motor, N m, instead of torque.drive", ""),
        Port("brake.points", "parameter", "1", f"{POINTS} torque of the brake, N m, instead of brake.torque", ""),
        Port("engine.points", "parameter", "1", "'speed torque; speed torque; ...', straight lines between: largest "
             "torque of the engine's shaft, N m, over its speed, rad/s, not in mode speed", ""),
        Port("gear.ratio", "parameter", "1", f"turns of the engine to one of {what}", 1.0),
        Port("brake.torque", "parameter", "N.m", "torque of the brake against rotation, not in mode speed"),
        Port("brake.speed", "parameter", "rad/s", "speed below which the brake fades", 0.1),
        Port("controller.proportional", "parameter", "N.m.s/rad", "torque per speed error", 6000.0),
        Port("controller.integral", "parameter", "N.m", "torque per rad of accumulated speed error", 20000.0),
        Port("torque.limit", "parameter", "N.m", "largest torque of the controller, either way", 20000.0),
    ]  # fmt: skip
    return [port._replace(name=prefix + port.name) for port in ports]


def drive(
    ports: Sequence[Port], values: Mapping[str, Any], inertia: float, demand: str = "", prefix: str = ""
) -> Drive:
    """The motor of ``motor_ports(prefix)`` on a shaft of ``inertia`` kg m2; raises InvalidParameter.

    ``demand``: the input that its speed follows, where there is one.
    """
    names = [port.name.removeprefix(prefix) for port in motor_ports(prefix)]
    check_values(ports, values, (prefix + name for name in POSITIVE), (prefix + name for name in NOT_NEGATIVE))
    own = {name: values[prefix + name] for name in names}

    def no(name: str, why: str) -> InvalidParameter:
        return InvalidParameter(f"{prefix}{name} = {_short(own[name])}{why}")

    if own["ramp.end"] < own["ramp.start"]:
        raise no("ramp.end", f" s must not be before {prefix}ramp.start")
    if 0.0 <= own["stop.start"] < own["ramp.end"]:
        raise no("stop.start", f" s must not be before {prefix}ramp.end")
    speeds, torques, brakes = (
        course(f"{prefix}{name}.points", str(own[f"{name}.points"])) for name in ("speed", "torque", "brake")
    )
    engine = course(f"{prefix}engine.points", str(own["engine.points"]), "speed torque")
    if min(chain(engine.value, engine.time), default=0.0) < 0.0:
        raise no("engine.points", " must not be negative")
    if engine.time.size and own["mode"] == "speed":
        raise InvalidParameter(
            f"{prefix}engine.points needs mode 'torque' or 'controller': a prescribed speed has no limit"
        )
    if brakes.value.min(initial=0.0) < 0.0:
        raise no("brake.points", " must not be negative")
    if speeds.time.size and own["stop.start"] >= 0.0:
        raise InvalidParameter(f"{prefix}speed.points and {prefix}stop.start exclude each other")
    if demand:
        if own["mode"] == "torque":
            raise no("mode", f": a drive with the input {demand} has a speed or a controller")
        for name, none in (("speed.points", ""), ("speed.end", 0.0), ("stop.start", -1.0)):
            if own[name] != none:
                raise no(name, f": the input {demand} says how fast it turns")
        check_values(ports, values, ["demand.lag"])
        speeds = Course(np.zeros(2), np.full(2, float(own["speed.start"])), np.zeros(2))
    gear = float(own["gear.ratio"])
    return Drive(
        inertia=inertia,
        mode=MODES.index(own["mode"]),
        start_speed=float(own["speed.start"]),
        end_speed=float(own["speed.end"]),
        ramp_start=float(own["ramp.start"]),
        ramp_end=float(own["ramp.end"]),
        torque=float(own["torque.drive"]),
        brake=float(brakes.value.max()) if brakes.value.size else float(own["brake.torque"]),
        brake_speed=float(own["brake.speed"]),
        proportional=float(own["controller.proportional"]),
        integral=float(own["controller.integral"]),
        limit=float(own["torque.limit"]),
        accelerated=EXTRAPOLATIONS.index(values["extrapolation"]),
        stop_start=float(own["stop.start"]),
        stop_time=float(own["stop.time"]),
        speeds=speeds,
        torques=torques,
        brakes=brakes,
        engine=engine,
        gear=gear,
        steepest=gear * gear * float(np.abs(np.diff(engine.value) / np.diff(engine.time)).max(initial=0.0)),
        lag=float(values["demand.lag"]) if demand else 0.0,
    )


def _short(value: object) -> str:
    return f"'{value[:80]}'" if isinstance(value, str) else str(value)
