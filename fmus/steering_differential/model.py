"""Steering differential component: ports, parameters, start, steps, outputs."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from fmus.drives.motor import DriveParameters
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
from fmus.start import KEYS, mirror_stance, part_at_rest, stance, start_pose
from fmus.steering_differential.dynamics import (
    SIDE,
    SIZE,
    Gearbox,
    Parts,
    begin,
    step,
    write_outputs,
)

SIDES = {"left": 1.0, "right": -1.0}  # sign of y
DEMAND = "left.speed.demand"
RELATIVE = "against its mount"
STIFF = (
    "at t = {{0:.6g}} s {} has its engine's curve too steep, or its gains too large: {{1:d}} internal steps in one of"
    " {{2:.3g}} s"
)


BODIES = {"propulsion.": "the mean of both sprockets", "steering.": "the right sprocket less the left one"}


def parameter_ports() -> list[Port]:
    """Parameters of a differential."""
    speeds = "mean of both speeds against the mounts", "speed of the right less the left sprocket"
    motors = [motor_ports(*motor, speed) for motor, speed in zip(BODIES.items(), speeds, strict=True)]
    return [
        lag_port(),
        *start_pose_ports(),
        *mount_ports(),
        wrenches.extrapolate_port(),
        *motors[0],
        *motors[1],
    ]


def connector_ports(mounts: Mapping[str, tuple[float, ...]], demands: Mapping[str, tuple[bool, bool]]) -> list[Port]:
    """Inputs, then motions and wrenches of both sides; ``mounts``: motion (13) of each at the start.

    ``demands``: of each motor, see ``drives.parameters.demanded``.
    """
    found_ports: list[Port] = []
    for side, motion in mounts.items():
        found_ports += [*motion_ports(f"{side}.mount", "input", motion), *wrench_ports(f"{side}.sprocket", "input")]
    for side in mounts if any(follows for follows, _ in demands.values()) else ():
        text = f"wanted speed of the {side} sprocket {RELATIVE}"
        found_ports.append(Port(f"{side}.speed.demand", "input", "rad/s", text))
    found_ports += [torque_demand_port(*motor) for motor in BODIES.items() if demands[motor[0]][1]]
    for side, motion in mounts.items():
        found_ports += [*motion_ports(f"{side}.sprocket", "output", motion), *wrench_ports(f"{side}.mount", "output")]
    return found_ports


def output_ports() -> list[Port]:
    """Outputs of half shafts, motors and energies."""
    side_ports: list[Port] = []
    for side in SIDES:
        side_ports += [
            Port(f"{side}.speed", "output", "rad/s", f"speed of the {side} sprocket {RELATIVE}"),
            Port(f"{side}.angle", "output", "rad", f"angle of the {side} sprocket {RELATIVE}, over revolutions"),
            Port(f"{side}.torque", "output", "N.m", f"torque of the {side} half shaft on its sprocket, mean"),
            Port(f"{side}.power", "output", "W", f"power of the {side} half shaft, mean; negative: it is turned"),
            Port(f"{side}.work", "output", "J", f"work of the {side} half shaft on its sprocket so far"),
        ]
    for shaft, speed in (("propulsion", "mean of both speeds"), ("steering", "right less left speed")):
        side_ports += [
            Port(f"{shaft}.speed", "output", "rad/s", speed),
            Port(f"{shaft}.torque", "output", "N.m", f"torque of the {shaft} motor, mean over the step"),
            Port(f"{shaft}.power", "output", "W", f"power of the {shaft} motor, mean over the step"),
            Port(f"{shaft}.work", "output", "J", f"work of the {shaft} motor since the start"),
        ]
    return [
        *side_ports,
        Port("power.regenerated", "output", "W", "power that one half shaft takes and the other one gives, mean"),
        Port("energy.kinetic", "output", "J", "kinetic energy of both spins"),
        Port("energy.work", "output", "J", "work of both motors since the start"),
        Port("energy.dissipated", "output", "J", "work done on the brakes of both shafts since the start"),
        Port("port.work", "output", "J", "work of chains and mounts on the spins since the start"),
        Port("solver.steps", "output", "1", "internal steps of both shafts since the start", 0),
        Port("solver.evaluations", "output", "1", "evaluations of the spins' equations since the start", 0),
    ]


class Model(ComponentModel):
    """Spins of both sprockets of a vehicle on their mounts, joined by two shafts: mean and difference.

    ``config``: {"drive": {"inertia": kg m2 of each spin, "mount": stance of the left mount at the start
    (``start``), "right": stance of the right mount, by default the left one mirrored, "demanded": whether the
    speeds follow inputs, false by default; a list of "propulsion." and "steering.": speeds, and in mode torque
    torques}}; other keys are not read. Mounts whose inputs still have their start values stand still at the start pose.
    """

    start_kernel, step_kernel, output_kernel = staticmethod(begin), staticmethod(step), staticmethod(write_outputs)
    start_parameters = *KEYS, "start.angle"
    warning_sentences = cut_sentence("propulsion."), cut_sentence("steering.")
    refusals = Sentence(""), *contradictions("propulsion."), *contradictions("steering.")
    failures = (
        Sentence(""),
        Sentence(NO_ROTATION, tuple(f"{side}.mount" for side in SIDES)),
        Sentence(STIFF.format("propulsion")),
        Sentence(STIFF.format("steering")),
        Sentence("at t = {0:.6g} s the sprockets' spin is not finite"),
    )

    def __init__(self, config: Mapping[str, Any]) -> None:
        drive_config = config["drive"]
        self.inertia, left = float(drive_config["inertia"]), stance(drive_config["mount"])
        right = stance(drive_config["right"]) if "right" in drive_config else mirror_stance(left)
        self._mounts = left, right
        self._wrench = np.array(drive_config.get("wrench", [0.0] * 2 * WRENCH), dtype=float)
        if not self.inertia > 0.0:
            raise InvalidParameter(f"drive.inertia = {self.inertia} kg m2 must be positive")
        self._demands = {prefix: demanded(drive_config, prefix) for prefix in BODIES}
        self._parameters = configured_ports(parameter_ports(), config)
        start_motions = self._start_motions({port.name: port.start for port in self._parameters})
        self.ports: tuple[Port, ...] = (
            *connector_ports(dict(zip(SIDES, start_motions, strict=True)), self._demands),
            *output_ports(),
            *self._parameters,
        )
        inputs = [port.start for port in self.ports if port.causality == "input"]
        self.inputs = len(inputs)
        self.unconnected = np.array(inputs)
        self._rest_motions = self.unconnected.copy()
        self.gearbox: Gearbox
        self.state: Floats = np.zeros(SIZE + len(SIDES) * wrenches.received(WRENCH))
        self.counters = np.zeros(2, dtype=np.int64)

    def initialise(self, parameters: Mapping[str, float | int | str]) -> None:
        """Start both sprockets at angle and speeds of the start, on mounts at rest; raises InvalidParameter."""
        values = parameter_values(self._parameters, parameters)
        inertias = {"propulsion.": 2.0 * self.inertia, "steering.": 0.5 * self.inertia}  # (1)
        shafts = (
            drive_parameters(values, inertias[prefix], DEMAND if follows else "", prefix, with_torque)
            for prefix, (follows, with_torque) in self._demands.items()
        )
        self.gearbox = Gearbox(self.inertia, *shafts)
        self.counters[:] = 0
        inputs = np.zeros(self.inputs)
        extrapolate, received = wrenches.CHOICES.index(values["extrapolate"]), self.state[SIZE:].reshape(len(SIDES), -1)
        parts = Parts(
            self.gearbox, self._mounts, self.unconnected, self._rest_motions, self._wrench, inputs, extrapolate,
            received, self.state, self.counters,
        )  # fmt: skip
        self.begin(values, parts)

    def free_parameters(self, p: Mapping[str, Any]) -> FreeParameters:
        """All parameters but tables of points."""
        shafts = (
            free_numbers(p, demands, f"gearbox.{prefix[:-1]}", prefix) for prefix, demands in self._demands.items()
        )
        numbers = {place: how for shaft in shafts for place, how in shaft.items()}
        return FreeParameters(numbers | {"extrapolate": "{extrapolate}"}, self.start_parameters)

    @property
    def shafts(self) -> tuple[DriveParameters, ...]:
        """The two shafts: propulsion and steering."""
        return self.gearbox.propulsion, self.gearbox.steering

    @property
    def rest_motion(self) -> Floats:
        """Motions (2, 13) of mounts that nothing moves."""
        return np.stack([self._rest_motions[at : at + STATE] for at in (0, SIDE)])

    def _start_motions(self, values: Mapping[str, Any]) -> tuple[tuple[float, ...], tuple[float, ...]]:
        """Motions (13 each) of the left and the right mount when nothing moves them."""
        left, right = (plain(part_at_rest)(start_pose(values), mount) for mount in self._mounts)
        return left, right
