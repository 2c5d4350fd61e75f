"""The sprocket drive as a component: ports, parameters, start, steps of the spin, outputs."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from fmus.course import Course, course
from fmus.defaults import configured
from fmus.model import MOST_STEPS, InvalidParameter, StepFailed, check_orientation, finite
from fmus.physics.arrays import Floats
from fmus.physics.integrate.runge_kutta import RK4
from fmus.ports import STATE, WRENCH, Port, start_pose, wheel_state, wrench
from fmus.sprocket_drive.dynamics import (
    ANGLE,
    NO_ROTATION,
    RATE,
    TARGET,
    WIDTH,
    Drive,
    advance,
    observe,
    place,
    profile,
)
from fmus.start import start

MODES = ("speed", "torque", "controller")
EXTRAPOLATIONS = ("velocity", "acceleration")
COURSES = ("speed.points", "torque.points", "brake.points")
DEMAND = "speed.demand"
POINTS = "'time value; time value; ...', straight lines between: the"


def parameter_ports(demanded: bool) -> list[Port]:
    """What can be set before initialisation."""
    lag = Port("demand.lag", "parameter", "s", "time constant with which the speed follows the demand", 0.1)
    return [
        *([lag] if demanded else []),
        *start_pose(),
        Port("start.lateral", "parameter", "m", "lateral position of the mount beside its place as built"),
        Port("start.angle", "parameter", "rad", "angle of the sprocket against the mount at the start"),
        Port("mode", "parameter", "1", "what turns the sprocket: a prescribed speed, a constant torque, or a "
             "controller that follows the speed profile", "speed", MODES),
        Port("extrapolation", "parameter", "1", "how the mount moves inside a step: with its velocity, or "
             "with the acceleration of its last two velocities besides", "acceleration", EXTRAPOLATIONS),
        Port("speed.start", "parameter", "rad/s", "speed against the mount at the start, before the ramp"),
        Port("speed.end", "parameter", "rad/s", "speed against the mount after the ramp"),
        Port("ramp.start", "parameter", "s", "time at which the half-cosine ramp begins", 0.0),
        Port("ramp.end", "parameter", "s", "time at which the half-cosine ramp ends", 1.0),
        Port("stop.start", "parameter", "s", "time at which the speed goes to 0 for good, below 0 for never", -1.0),
        Port("stop.time", "parameter", "s", "how long that takes, along half a cosine", 1e-3),
        Port("torque.drive", "parameter", "N.m", "constant torque of the motor in mode torque"),
        Port("speed.points", "parameter", "1", f"{POINTS} speed against the mount, rad/s, instead of a ramp", ""),
        Port("torque.points", "parameter", "1", f"{POINTS} torque of the motor, N m, instead of torque.drive", ""),
        Port("brake.points", "parameter", "1", f"{POINTS} torque of the brake, N m, instead of brake.torque", ""),
        Port("engine.points", "parameter", "1", "'speed torque; speed torque; ...', straight lines between: largest "
             "torque of the engine's shaft, N m, over its speed, rad/s, not in mode speed", ""),
        Port("gear.ratio", "parameter", "1", "turns of the engine to one of the sprocket", 1.0),
        Port("brake.torque", "parameter", "N.m", "torque of the brake against rotation, not in mode speed"),
        Port("brake.speed", "parameter", "rad/s", "speed below which the brake fades", 0.1),
        Port("controller.proportional", "parameter", "N.m.s/rad", "torque per speed error", 6000.0),
        Port("controller.integral", "parameter", "N.m", "torque per rad of accumulated speed error", 20000.0),
        Port("torque.limit", "parameter", "N.m", "largest torque of the controller, either way", 20000.0),
    ]  # fmt: skip


class Model:
    """Spin of one sprocket, relative to nothing but its mount.

    ``config``: {"drive": {"inertia": kg m2 of the spin, "mount": [x, y, z] of the mount in the vehicle
    frame at the start, "demanded": whether the speed follows an input, false by default}}; what else it holds is
    not read. A mount whose inputs still have their start values
    stands still at the start pose, so an unconnected drive is a fixed axle.
    """

    kernel = advance
    link_ports = 0

    def __init__(self, config: Mapping[str, Any]) -> None:
        drive = config["drive"]
        self._inertia, self._place = float(drive["inertia"]), tuple(float(x) for x in drive["mount"])
        if not self._inertia > 0.0:
            raise InvalidParameter(f"drive.inertia = {self._inertia} kg m2 must be positive")
        self._demanded = bool(drive.get("demanded", False))
        parameters = configured(parameter_ports(self._demanded), config)
        mount = self._standing({port.name: port.start for port in parameters})
        self.ports: tuple[Port, ...] = (
            *wheel_state("mount", "input", mount),
            *wrench("sprocket", "input"),
            *([Port(DEMAND, "input", "rad/s", "wanted speed against the mount")] if self._demanded else []),
            *wheel_state("sprocket", "output", mount),
            *wrench("mount", "output"),
            Port("speed", "output", "rad/s", "speed of the sprocket against the mount"),
            Port("angle", "output", "rad", "angle of the sprocket against the mount, summed over revolutions"),
            Port("torque", "output", "N.m", "torque of the motor on the sprocket, mean over the step"),
            Port("energy.kinetic", "output", "J", "kinetic energy of the spin"),
            Port("energy.work", "output", "J", "work of the motor since the start"),
            Port("energy.dissipated", "output", "J", "work done on the brake since the start"),
            Port("port.work", "output", "J", "work of chain and mount on the spin since the start"),
            Port("power", "output", "W", "power of the motor, mean over the step; negative where the chain turns it"),
            Port("solver.steps", "output", "1", "internal steps since the start", 0),
            Port("solver.evaluations", "output", "1", "evaluations of the spin's equation since the start", 0),
            *parameters,
        )
        self._defaults = {port.name: port for port in self.ports if port.causality == "parameter"}
        self._unconnected = np.array([port.start for port in self.ports[:STATE]])
        self.standing = self._unconnected.copy()
        self._u = np.zeros(STATE + WRENCH + self._demanded)
        self.state: Floats = np.zeros(WIDTH)
        self.counters = np.zeros(2, dtype=np.int64)

    def initialise(self, parameters: Mapping[str, float | int | str]) -> None:
        """The sprocket at its start angle and speed on a mount that stands still at the start pose."""
        values = {name: parameters.get(name, port.start) for name, port in self._defaults.items()}
        self.drive = self._checked(values)
        self.standing[:] = self._standing(values)
        self.state[:] = 0.0
        self.state[ANGLE] = float(values["start.angle"])
        self.state[TARGET] = self.drive.start_speed
        self.state[RATE] = profile(self.drive, 0.0)[0]
        still = (0.0, 0.0, 0.0)
        place(self.state, tuple(self.standing[:3]), self.standing[3:7], still, still)
        self.counters[:] = 0

    def step(self, t: float, h: float, u: Floats) -> None:
        """Advance from t to t + h; the state is left as it was when that fails."""
        self._u[:] = u
        if u[0] == self._unconnected[0] and np.array_equal(u[:STATE], self._unconnected):
            self._u[:STATE] = self.standing
        state = self.state.copy()
        steps = advance(self.drive, state, t, h, self._u)
        if steps == NO_ROTATION and finite(self._u):
            check_orientation(t, "mount", self._u[3:7])
        if steps > MOST_STEPS:
            cause = "brake.speed is too small, or the controller's gains too large"
            raise StepFailed(f"at t = {t:.6g} s {cause}: {steps} internal steps in one of {h:.3g} s")
        if steps == NO_ROTATION or not finite(state):
            bad = [port.name for port, value in zip(self.ports, u, strict=False) if not np.isfinite(value)]
            what = f"input {bad[0]}" if bad else "sprocket's spin"
            raise StepFailed(f"at t = {t:.6g} s the {what} is not finite")
        self.state[:] = state
        self.counters += (steps, len(RK4.b) * steps if self.drive.mode else 1)

    def outputs(self, y: Floats) -> None:
        """Write all Real outputs, in port order."""
        observe(self._inertia, self.state, y)

    def link_outputs(self, y: Floats) -> None:
        """None here."""

    def warnings(self) -> list[str]:
        """None here."""
        return []

    def _standing(self, values: Mapping[str, Any]) -> tuple[float, ...]:
        """The mount's 13 when nothing moves it."""
        x, y, z = self._place
        return start(values).standing(x, y + float(values["start.lateral"]), z)

    def _checked(self, values: Mapping[str, Any]) -> Drive:
        """The parameters as a Drive; raises InvalidParameter."""
        for name, port in self._defaults.items():
            if port.choices and values[name] not in port.choices:
                raise InvalidParameter(f"{name} = {values[name]!r} must be one of {', '.join(port.choices)}")
            if isinstance(port.start, float) and not np.isfinite(values[name]):
                raise InvalidParameter(f"{name} = {values[name]} must be a finite number")
        for name in ("brake.torque", "controller.proportional", "controller.integral", "torque.limit"):
            if values[name] < 0.0:
                raise InvalidParameter(f"{name} = {values[name]} must not be negative")
        if values["gear.ratio"] <= 0.0:
            raise InvalidParameter(f"gear.ratio = {values['gear.ratio']} must be positive")
        if values["brake.speed"] <= 0.0:
            raise InvalidParameter(f"brake.speed = {values['brake.speed']} rad/s must be positive")
        if values["ramp.end"] < values["ramp.start"]:
            raise InvalidParameter(f"ramp.end = {values['ramp.end']} s must not be before ramp.start")
        if values["stop.time"] <= 0.0:
            raise InvalidParameter(f"stop.time = {values['stop.time']} s must be positive")
        if 0.0 <= values["stop.start"] < values["ramp.end"]:
            raise InvalidParameter(f"stop.start = {values['stop.start']} s must not be before ramp.end")
        speeds, torques, brakes = (course(name, str(values[name])) for name in COURSES)
        engine = course("engine.points", str(values["engine.points"]))
        if engine.value.min(initial=0.0) < 0.0 or engine.time.min(initial=0.0) < 0.0:
            raise InvalidParameter(f"engine.points = '{str(values['engine.points'])[:80]}' must not be negative")
        if engine.time.size and values["mode"] == "speed":
            raise InvalidParameter("engine.points needs mode 'torque' or 'controller': a prescribed speed has no limit")
        if self._demanded:
            speeds = self._followed(values)
        if brakes.value.min(initial=0.0) < 0.0:
            raise InvalidParameter(f"brake.points = {values['brake.points']} must not be negative")
        if speeds.time.size and values["stop.start"] >= 0.0:
            raise InvalidParameter("speed.points and stop.start exclude each other")
        return Drive(
            inertia=self._inertia,
            mode=MODES.index(values["mode"]),
            start_speed=float(values["speed.start"]),
            end_speed=float(values["speed.end"]),
            ramp_start=float(values["ramp.start"]),
            ramp_end=float(values["ramp.end"]),
            torque=float(values["torque.drive"]),
            brake=float(brakes.value.max()) if brakes.value.size else float(values["brake.torque"]),
            brake_speed=float(values["brake.speed"]),
            proportional=float(values["controller.proportional"]),
            integral=float(values["controller.integral"]),
            limit=float(values["torque.limit"]),
            accelerated=EXTRAPOLATIONS.index(values["extrapolation"]),
            stop_start=float(values["stop.start"]),
            stop_time=float(values["stop.time"]),
            speeds=speeds,
            torques=torques,
            brakes=brakes,
            engine=engine,
            gear=float(values["gear.ratio"]),
            steepest=float(values["gear.ratio"]) ** 2 * _steepest(engine),
            lag=float(values["demand.lag"]) if self._demanded else 0.0,
        )

    def _followed(self, values: Mapping[str, Any]) -> Course:
        """What each step makes of the demand; raises InvalidParameter."""
        if values["demand.lag"] <= 0.0:
            raise InvalidParameter(f"demand.lag = {values['demand.lag']} s must be positive")
        if values["mode"] == "torque":
            raise InvalidParameter(f"mode = 'torque': a drive with the input {DEMAND} has a speed or a controller")
        for name, none in (("speed.points", ""), ("speed.end", 0.0), ("stop.start", -1.0)):
            if values[name] != none:
                raise InvalidParameter(f"{name} = {values[name]}: the input {DEMAND} says how fast the sprocket turns")
        return Course(np.zeros(2), np.full(2, float(values["speed.start"])), np.zeros(2))


def _steepest(c: Course) -> float:
    """Largest slope of a course, either way."""
    return float(np.abs(np.diff(c.value) / np.diff(c.time)).max(initial=0.0))
