"""Expected outputs of a steering differential: sides as sprockets of drives, shafts as motors."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache
from typing import Any, NamedTuple

import numpy as np

from mirror import drive_checks
from mirror.check import Check, Expected, View
from mirror.record import Floats, Part, Record
from mirror.spin import Spin

SIDES = {"left": -1.0, "right": 1.0}
# parameters of a half shaft: it turns its sprocket by any given torque
PASSIVE = {"mode": "torque", "brake.torque": 0.0, "stop.start": -1.0, "ramp.start": 0.0,
           "ramp.end": 1.0, "speed.start": 0.0, "speed.end": 0.0}  # fmt: skip


class PrefixedPart:
    """View of a record's part: its variables that begin with ``prefix``, under names without it."""

    def __init__(self, part: Part, prefix: str, config: dict, parameters: dict[str, Any]) -> None:
        self._part, self._prefix, self.config, self.parameters = part, prefix, config, parameters
        self.t, self.h = part.t, part.h
        columns = [k for name, k in part.inputs.items() if name.startswith(prefix)]
        self.u, self.start_values = part.u[:, columns], part.start_values[columns]

    def __getitem__(self, name: str) -> Floats:
        return self._part[self._prefix + name]

    def vector(self, name: str, axes: str = "xyz") -> Floats:
        return self._part.vector(self._prefix + name, axes)

    def input_vectors(self, name: str, axes: str = "xyz") -> Floats:
        return self._part.input_vectors(self._prefix + name, axes)


class Half(NamedTuple):
    """One side, as the checks of a drive need it."""

    record: Record
    part: Any
    spin: Spin
    side: str


def half(view: View, side: str) -> Half:
    config, p = view.part.config, view.part.parameters
    mount = config["drive"]["mount" if side == "left" else "right"]
    config = {**config, "drive": {**config["drive"], "mount": mount}}
    part: Any = PrefixedPart(view.part, f"{side}.", config, {**p, **PASSIVE, "start.lateral": 0.0})
    return Half(view.record, part, Spin(part), side)


def shaft(view: View, name: str) -> Spin:
    """Motor and shaft of the given name."""
    p, prefix = view.part.parameters, f"{name}."
    shaft_parameters = {key.removeprefix(prefix): value for key, value in p.items() if key.startswith(prefix)}
    part: Any = PrefixedPart(view.part, prefix, view.part.config, {**p, **shaft_parameters})
    return Spin(part)


def as_drive(expected: Callable[[Any, Sequence[str]], Expected]) -> Callable[[View, Sequence[str]], Expected]:
    """A check of a drive, applied to each side's variables."""

    def check(view: View, names: Sequence[str]) -> Expected:
        halves = cache(lambda side: half(view, side))
        columns = []
        for name in names:
            side, _, variable = name.partition(".")
            columns.append(np.asarray(expected(halves(side), [variable]))[:, 0])
        return np.stack(columns, axis=1)

    return check


def of_half(quantity: Callable[[Half], Floats]) -> Callable[[View, Sequence[str]], Expected]:
    return as_drive(lambda view, names: quantity(view)[:, None])


def torque(view: Half) -> Floats:
    """Torque that the change of the spin needs in addition to the chain's."""
    spin, part = view.spin, view.part
    return np.concatenate([[0.0], spin.J * np.diff(part["speed"] + spin.mount_rate) / part.h - spin.chain_torque])


def of_shaft(quantity: Callable[[View, Spin, str], Floats]) -> Callable[[View, Sequence[str]], Expected]:
    return lambda view, names: quantity(view, shaft(view, names[0].partition(".")[0]), names[0])[:, None]


def side_sum(view: View, what: str, sign: float) -> Floats:
    return view.part[f"right.{what}"] + sign * view.part[f"left.{what}"]


def motor_torque(view: View, spin: Spin, name: str) -> Floats:
    """Motor torque: half shafts plus the shaft's brake, mean over the step; NaN where it may hold."""
    steering = name.startswith("steering")
    half_shafts = (0.5 if steering else 1.0) * side_sum(view, "torque", -1.0 if steering else 1.0)
    return half_shafts + np.concatenate([[0.0], spin.braked()])


def shaft_angle(view: View, name: str) -> Floats:
    """Angle of a shaft, rad."""
    return side_sum(view, "angle", -1.0) if name.startswith("steering") else 0.5 * side_sum(view, "angle", 1.0)


def motor_work(view: View, spin: Spin, name: str) -> Floats:
    """Work of a motor: its torque over the angle of its shaft, J."""
    return np.concatenate([[0.0], np.cumsum(spin.part["torque"][1:] * np.diff(shaft_angle(view, name)))])


def regenerated_power(view: View, names: Sequence[str]) -> Expected:
    """Power that one half shaft takes from the other, W."""
    left, right = (view.part[f"{side}.power"] for side in SIDES)
    return np.where(left * right < 0.0, np.minimum(abs(left), abs(right)), 0.0)[:, None]


def sum_over_sides(quantity: Callable[[Half], Floats]) -> Callable[[View, Sequence[str]], Expected]:
    return lambda view, names: sum(quantity(half(view, side)) for side in SIDES)[:, None]


def sum_over_shafts(quantity: Callable[[View, Spin, str], Floats]) -> Callable[[View, Sequence[str]], Expected]:
    """Sum over both shafts."""
    shafts = ("propulsion", "steering")
    return lambda view, names: sum(quantity(view, shaft(view, name), name) for name in shafts)[:, None]


def brake_loss(view: View, spin: Spin, name: str) -> Floats:
    return spin.dissipated()


def internal_steps(view: View, spin: Spin, name: str) -> Floats:
    """Number of internal steps; the shafts have twice and half of a sprocket's inertia."""
    spin.J *= 2.0 if name == "propulsion" else 0.5
    return spin.steps()


def evaluations(view: View, spin: Spin, name: str) -> Floats:
    return internal_steps(view, spin, name) * (1.0 if spin.p["mode"] == "speed" else 4.0)


SIDE, SHAFT = r"(left|right)\.", r"(propulsion|steering)\."

CHECKS = (
    Check(SIDE + drive_checks.MOTION, "mount moved on", as_drive(drive_checks.motion), 1e-12, 1e-12, balance=True),
    Check(SIDE + r"sprocket\.position\.[xyz]", "mount of the chassis", as_drive(drive_checks.chassis_mount), 0.0, 1e-4),
    Check(SIDE + r"sprocket\.velocity\.[xyz]", "mount of the chassis", as_drive(drive_checks.chassis_mount), 0.06),
    Check(SIDE + r"mount\.(force|torque)\.[xyz]", "chain less spin", as_drive(drive_checks.wrench), 1e-9, 1e-6,
          balance=True),
    Check(SIDE + "speed", "torques", of_half(lambda view: view.spin.speed()), 0.02, 1e-12, balance=True),
    Check(SIDE + "angle", "speed, summed", of_half(lambda view: view.spin.angle()), 1e-3, 1e-12, balance=True),
    Check(SIDE + "torque", "what the spin needs", of_half(torque), 1e-9, 1e-6, balance=True),
    Check(SIDE + "work", "torque on the way", of_half(lambda view: view.spin.work()), 1e-3, 0.1, balance=True),
    Check(SIDE + "power", "work of the step", as_drive(
        lambda view, names: np.concatenate([[0.0], np.diff(view.part["work"]) / view.part.h])[:, None]
    ), 1e-9, 1e-9, balance=True),
    Check(r"propulsion\.speed", "mean", lambda view, names: 0.5 * side_sum(view, "speed", 1.0)[:, None], 1e-12, 1e-12,
          balance=True),
    Check(r"steering\.speed", "profile", of_shaft(lambda view, spin, name: spin.profile(view.part.t)), 1e-9, 1e-12),
    Check(SHAFT + "torque", "half shafts and brake", of_shaft(motor_torque), 5e-3, 1e-6, balance=True),
    Check(r"propulsion\.torque", "controller", of_shaft(lambda view, spin, name: spin.torque()), 0.01, 1e-9,
          balance=True),
    Check(SHAFT + "work", "torque on the way", of_shaft(motor_work), 1e-3, 0.1, balance=True),
    Check(SHAFT + "power", "work of the step", of_shaft(
        lambda view, spin, name: np.concatenate([[0.0], np.diff(spin.part["work"]) / view.part.h])
    ), 1e-9, 1e-9, balance=True),
    Check(r"power\.regenerated", "one takes, the other gives", regenerated_power, 1e-12, 1e-9, balance=True),
    Check(r"energy\.kinetic", "spins", sum_over_sides(lambda view: view.spin.kinetic()), 1e-9, 1e-9, balance=True),
    Check(r"energy\.work", "both motors", sum_over_shafts(lambda view, spin, name: spin.part["work"]), 1e-12, 1e-9,
          balance=True),
    Check(r"energy\.dissipated", "brakes", sum_over_shafts(brake_loss), 1e-3, 0.1, balance=True),
    Check(r"port\.work", "wrenches in less out", sum_over_sides(lambda view: view.spin.port_work()), 1e-3, 1.0,
          balance=True),
    Check(r"solver\.steps", "half of a time constant", sum_over_shafts(internal_steps), 0.0),
    Check(r"solver\.evaluations", "four a step, or one", sum_over_shafts(evaluations), 0.0),
)  # fmt: skip
