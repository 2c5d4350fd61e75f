"""The sprocket drive as a component: ports, parameters, start, steps of the spin, outputs."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from fmus.defaults import configured
from fmus.drives.motor import Drive, profile
from fmus.drives.mount import WIDTH, place
from fmus.drives.parameters import drive, lag_port, motor_ports, mount_ports
from fmus.drives.shaft import ANGLE, RATE, TARGET
from fmus.model import MOST_STEPS, InvalidParameter, StepFailed, check_orientation, finite
from fmus.physics.arrays import Floats
from fmus.physics.integrate.runge_kutta import RK4
from fmus.ports import STATE, WRENCH, Port, start_pose, wheel_state, wrench
from fmus.sprocket_drive.dynamics import NO_ROTATION, advance, observe
from fmus.start import start

DEMAND = "speed.demand"


def parameter_ports(demanded: bool) -> list[Port]:
    """What can be set before initialisation."""
    return [
        *([lag_port()] if demanded else []),
        *start_pose(),
        Port("start.lateral", "parameter", "m", "lateral position of the mount beside its place as built"),
        *mount_ports(),
        *motor_ports(),
    ]


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
        own = config["drive"]
        self.inertia, self._place = float(own["inertia"]), tuple(float(x) for x in own["mount"])
        if not self.inertia > 0.0:
            raise InvalidParameter(f"drive.inertia = {self.inertia} kg m2 must be positive")
        self._demanded = bool(own.get("demanded", False))
        self._parameters = configured(parameter_ports(self._demanded), config)
        mount = self._standing({port.name: port.start for port in self._parameters})
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
            *self._parameters,
        )
        self._unconnected = np.array([port.start for port in self.ports[:STATE]])
        self.standing = self._unconnected.copy()
        self._u = np.zeros(STATE + WRENCH + self._demanded)
        self.state: Floats = np.zeros(WIDTH)
        self.counters = np.zeros(2, dtype=np.int64)

    def initialise(self, parameters: Mapping[str, float | int | str]) -> None:
        """The sprocket at its start angle and speed on a mount that stands still at the start pose."""
        values = {port.name: parameters.get(port.name, port.start) for port in self._parameters}
        self.drive = drive(self._parameters, values, self.inertia, DEMAND if self._demanded else "")
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
        observe(self.inertia, self.state, y)

    def link_outputs(self, y: Floats) -> None:
        """None here."""

    def warnings(self) -> list[str]:
        """None here."""
        return []

    @property
    def shafts(self) -> tuple[Drive, ...]:
        """What the motor turns: the sprocket."""
        return (self.drive,)

    def _standing(self, values: Mapping[str, Any]) -> tuple[float, ...]:
        """The mount's 13 when nothing moves it."""
        x, y, z = self._place
        return start(values).standing(x, y + float(values["start.lateral"]), z)
