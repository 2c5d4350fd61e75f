"""Sprocket drive component: ports, parameters, start, steps of the spin, outputs."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from fmus.drives.motor import DriveParameters
from fmus.drives.mount import WIDTH
from fmus.drives.parameters import (
    contradictions,
    cut_sentence,
    demanded,
    drive_parameters,
    free_numbers,
    lag_port,
    motor_ports,
    mount_ports,
    torque_demand_port,
)
from fmus.interface import wrenches
from fmus.interface.defaults import configured_ports, parameter_values
from fmus.interface.model import NO_ROTATION, ComponentModel, FreeParameters, InvalidParameter
from fmus.interface.ports import STATE, WRENCH, Port, motion_ports, start_pose_ports, wrench_ports
from fmus.interface.sentences import Sentence
from fmus.kernels.jit import plain
from fmus.physics.arrays import Floats
from fmus.sprocket_drive.dynamics import Parts, begin, step, write_outputs
from fmus.start import KEYS, part_at_rest, stance, start_pose

DEMAND = "speed.demand"


def parameter_ports() -> list[Port]:
    """Parameters of a drive."""
    return [
        lag_port(),
        *start_pose_ports(),
        Port("start.lateral", "parameter", "m", "lateral position of the mount beside its place as built"),
        *mount_ports(),
        wrenches.extrapolate_port(),
        *motor_ports(),
    ]


class Model(ComponentModel):
    """Spin of one sprocket on its mount.

    ``config``: {"drive": {"inertia": kg m2 of the spin, "mount": stance of the mount at the start (``start``),
    "wrench": wrench (6) of the track on the sprocket at rest, in the vehicle, 0 by default, "demanded": whether the
    speed follows an input, false by default; [""]: in mode torque the torque follows another one}}; other keys are not
    read. A mount whose inputs still have their start values stands still at the start pose: an unconnected drive is a
    fixed axle.
    """

    start_kernel, step_kernel, output_kernel = staticmethod(begin), staticmethod(step), staticmethod(write_outputs)
    start_parameters, refusals = (*KEYS, "start.lateral", "start.angle"), (Sentence(""), *contradictions())
    warning_sentences = (cut_sentence(),)
    failures = (
        Sentence(""),
        Sentence(NO_ROTATION, ("mount",)),
        Sentence(
            "at t = {0:.6g} s the engine's curve is too steep, or the controller's gains are too large: {1:d} internal"
            " steps in one of {2:.3g} s"
        ),
        Sentence("at t = {0:.6g} s the sprocket's spin is not finite"),
    )

    def __init__(self, config: Mapping[str, Any]) -> None:
        drive_config = config["drive"]
        self.inertia, self._mount = float(drive_config["inertia"]), stance(drive_config["mount"])
        self._wrench = np.array(drive_config.get("wrench", [0.0] * WRENCH), dtype=float)
        if not self.inertia > 0.0:
            raise InvalidParameter(f"drive.inertia = {self.inertia} kg m2 must be positive")
        self._demands = demanded(drive_config)
        self._parameters = configured_ports(parameter_ports(), config)
        mount = self._start_motion({port.name: port.start for port in self._parameters})
        self.ports: tuple[Port, ...] = (
            *motion_ports("mount", "input", mount),
            *wrench_ports("sprocket", "input"),
            *([Port(DEMAND, "input", "rad/s", "wanted speed against the mount")] if self._demands[0] else []),
            *([torque_demand_port()] if self._demands[1] else []),
            *motion_ports("sprocket", "output", mount),
            *wrench_ports("mount", "output"),
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
        self.unconnected = np.array([port.start for port in self.ports[:STATE]])
        self.rest_motion = self.unconnected.copy()
        self.inputs = STATE + WRENCH + sum(self._demands)
        self.state: Floats = np.zeros(WIDTH + wrenches.received(WRENCH))
        self.counters = np.zeros(2, dtype=np.int64)

    def initialise(self, parameters: Mapping[str, float | int | str]) -> None:
        """Start at the start angle and speed on a mount at rest at the start pose; raises InvalidParameter."""
        values = parameter_values(self._parameters, parameters)
        demand, with_torque = DEMAND if self._demands[0] else "", self._demands[1]
        self.drive = drive_parameters(values, self.inertia, demand, torque_demand=with_torque)
        self.counters[:] = 0
        inputs = np.zeros(self.inputs)
        extrapolate, received = wrenches.CHOICES.index(values["extrapolate"]), self.state[WIDTH:]
        parts = Parts(self.drive, self._mount, self.unconnected, self.rest_motion, self._wrench, inputs, extrapolate,
                      received, self.state, self.counters)  # fmt: skip
        self.begin(values, parts)

    def free_parameters(self, p: Mapping[str, Any]) -> FreeParameters:
        """All parameters but tables of points, and the spin inertia."""
        own = {"drive.inertia": "{sprocket.spin_inertia}", "extrapolate": "{extrapolate}"}
        return FreeParameters(free_numbers(p, self._demands, "drive") | own, self.start_parameters)

    @property
    def shafts(self) -> tuple[DriveParameters, ...]:
        """The one shaft: that of the sprocket."""
        return (self.drive,)

    def _start_motion(self, values: Mapping[str, Any]) -> tuple[float, ...]:
        """Motion (13) of a mount that nothing moves."""
        x, y, *rest = self._mount
        motion: tuple[float, ...] = plain(part_at_rest)(
            start_pose(values), stance((x, y + float(values["start.lateral"]), *rest))
        )
        return motion
