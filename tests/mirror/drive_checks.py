"""Expected outputs of a drive; ``spin`` has the formulas."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from scipy.spatial.transform import Rotation

from mirror.check import Check, Expected, View
from mirror.record import Floats
from mirror.spin import Spin, Y


def of(quantity: Callable[[Spin], Floats]) -> Callable[[View, Sequence[str]], Expected]:
    """Return a function for a check of one output."""
    return lambda view, names: quantity(Spin(view.part))[:, None]


def thirteen(view: View, names: Sequence[str]) -> Floats:
    """Pose and rates of the sprocket: extrapolated mount, rotated by the angle, plus the spin."""
    s, part = view.spin, view.part
    x, q, v, w = s.mount
    turned = q * Rotation.from_rotvec(part["angle"][:, None] * Y)
    found = {"position": x, "velocity": v, "orientation": turned.as_quat(scalar_first=True)}
    found["angular_velocity"] = w + part["speed"][:, None] * s.axle
    split = [name.split(".")[1:] for name in names]
    return np.stack([found[what][:, ("wxyz" if what == "orientation" else "xyz").index(a)] for what, a in split], 1)


def carried(view: View, names: Sequence[str]) -> Floats:
    """Pose of the chassis' mount at the same instant."""
    chassis = view.record["chassis"]
    return np.stack([chassis[f"{view.side}.{name}"] for name in names], axis=1)


def wrench(view: View, names: Sequence[str]) -> Floats:
    """Force of the chain, and its torque less the rate of angular momentum; 0 at the start."""
    force = np.vstack([np.zeros(3), view.part.given("sprocket.force")])
    found = {"force": force, "torque": view.spin.mount_torque()}
    return np.stack([found[name.split(".")[1]][:, "xyz".index(name[-1])] for name in names], axis=1)


def power(view: View, names: Sequence[str]) -> Expected:
    """Power of the motor, mean over the step; 0 at the start."""
    return np.concatenate([[0.0], np.diff(view.part["energy.work"]) / view.part.h])[:, None]


def on_a_chassis(view: View) -> bool:
    return "chassis" in view.record.parts


MOTION = r"sprocket\.(position|orientation|velocity|angular_velocity)\.[wxyz]"

CHECKS = (
    Check(MOTION, "mount moved on", thirteen, 1e-12, 1e-12, balance=True),
    Check(r"sprocket\.position\.[xyz]", "mount of the chassis", carried, 0.0, 1e-4, applies=on_a_chassis),
    Check(r"sprocket\.velocity\.[xyz]", "mount of the chassis", carried, 0.06, applies=on_a_chassis),
    Check(r"mount\.(force|torque)\.[xyz]", "chain less spin", wrench, 1e-9, 1e-6, balance=True),
    Check("speed", "profile, or torques", of(Spin.speed), 0.02, 1e-12, balance=True),
    Check("angle", "speed, summed", of(Spin.angle), 1e-3, 1e-12, balance=True),
    Check("torque", "parameter, controller, or what the profile needs", of(Spin.torque), 0.01, 1e-9, balance=True),
    Check("power", "work of the step", power, 1e-9, 1e-9, balance=True),
    Check(r"energy\.kinetic", "spin", of(Spin.kinetic), 1e-9, 1e-9, balance=True),
    Check(r"energy\.work", "torque on the way", of(Spin.work), 1e-3, 0.1, balance=True),
    Check(r"energy\.dissipated", "brake", of(Spin.dissipated), 1e-3, 0.1, balance=True),
    Check(r"port\.work", "wrenches in less out", of(Spin.port_work), 1e-3, 1.0, balance=True),
    Check(r"solver\.steps", "half of a time constant", of(Spin.steps), 0.0),
    Check(r"solver\.evaluations", "four a step, or one", of(Spin.evaluations), 0.0),
)  # fmt: skip
