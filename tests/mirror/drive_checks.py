"""Expected outputs of a drive; ``spin`` has the formulas."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from scipy.spatial.transform import Rotation

from mirror.check import Check, Expected, View
from mirror.record import Floats
from mirror.spin import Spin, Y


def drive_output(quantity: Callable[[Spin], Floats]) -> Callable[[View, Sequence[str]], Expected]:
    """Check of one output."""
    return lambda view, names: quantity(Spin(view.part))[:, None]


def motion(view: View, names: Sequence[str]) -> Floats:
    """Sprocket pose and rates: the extrapolated mount, turned by the angle and spinning at the speed."""
    s, part = view.spin, view.part
    x, q, v, w = s.mount
    attitude = q * Rotation.from_rotvec(part["angle"][:, None] * Y)
    parts = {"position": x, "velocity": v, "orientation": attitude.as_quat(scalar_first=True)}
    parts["angular_velocity"] = w + part["speed"][:, None] * s.axle
    split = [name.split(".")[1:] for name in names]
    return np.stack([parts[what][:, ("wxyz" if what == "orientation" else "xyz").index(a)] for what, a in split], 1)


def chassis_mount(view: View, names: Sequence[str]) -> Floats:
    """Outputs of the chassis' mount at the same instant."""
    chassis = view.record["chassis"]
    return np.stack([chassis[f"{view.side}.{name}"] for name in names], axis=1)


def wrench(view: View, names: Sequence[str]) -> Floats:
    """Wrench on the mount: the chain's force, and its torque less the change of spin; NaN at the start."""
    force = np.vstack([np.full(3, np.nan), view.part.input_vectors("sprocket.force")])
    wrench_of_mount = {"force": force, "torque": view.spin.mount_torque()}
    return np.stack([wrench_of_mount[name.split(".")[1]][:, "xyz".index(name[-1])] for name in names], axis=1)


def power(view: View, names: Sequence[str]) -> Expected:
    """Mean power of the motor over the step, W; 0 at the start."""
    return np.concatenate([[0.0], np.diff(view.part["energy.work"]) / view.part.h])[:, None]


def on_a_chassis(view: View) -> bool:
    return "chassis" in view.record.parts


MOTION = r"sprocket\.(position|orientation|velocity|angular_velocity)\.[wxyz]"

CHECKS = (
    Check(MOTION, "mount moved on", motion, 1e-12, 1e-12, balance=True),
    Check(r"sprocket\.position\.[xyz]", "mount of the chassis", chassis_mount, 0.0, 1e-4, applies=on_a_chassis),
    Check(r"sprocket\.velocity\.[xyz]", "mount of the chassis", chassis_mount, 0.06, applies=on_a_chassis),
    Check(r"mount\.(force|torque)\.[xyz]", "chain less spin", wrench, 1e-9, 1e-6, balance=True),
    Check("speed", "profile, or torques", drive_output(Spin.speed), 0.02, 1e-12, balance=True),
    Check("angle", "speed, summed", drive_output(Spin.angle), 1e-3, 1e-12, balance=True),
    Check("torque", "parameter, controller, or what the profile needs", drive_output(Spin.torque), 0.01, 1e-9,
          balance=True),
    Check("power", "work of the step", power, 1e-9, 1e-9, balance=True),
    Check(r"energy\.kinetic", "spin", drive_output(Spin.kinetic), 1e-9, 1e-9, balance=True),
    Check(r"energy\.work", "torque on the way", drive_output(Spin.work), 1e-3, 0.1, balance=True),
    Check(r"energy\.dissipated", "brake", drive_output(Spin.dissipated), 1e-3, 0.1, balance=True),
    Check(r"port\.work", "wrenches in less out", drive_output(Spin.port_work), 1e-3, 1.0, balance=True),
    Check(r"solver\.steps", "half of a time constant", drive_output(Spin.steps), 0.0),
    Check(r"solver\.evaluations", "four a step, or one", drive_output(Spin.evaluations), 0.0),
)  # fmt: skip
