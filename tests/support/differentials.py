"""A steering differential in this process, with settings of its motors, on mounts that move."""

import numpy as np
from named_ports import Probe
from scipy.spatial.transform import Rotation

from fmus.steering_differential.model import Model

J, H = 13.87, 1e-3
PLACE = [0.1, 1.0795, -0.2]
SIDES = {"left": 1.0, "right": -1.0}
CHAINS = {"left": (30.0, -900.0, 50.0), "right": (-20.0, 500.0, 10.0)}  # chain torques on the sprockets, N m


def both(**values):
    """Return the same settings for both motors."""
    return {f"{shaft}.{name}": value for name, value in values.items() for shaft in ("propulsion", "steering")}


def differential(demanded=False, **parameters):
    """A differential with these parameters; ``demanded``: it has inputs for its demands."""
    return Probe(Model({"drive": {"inertia": J, "mount": PLACE, "demanded": demanded}}), **parameters)


def swaying(t, side):
    """Position, attitude, velocity and angular velocity of a mount with growing yaw and pitch rates."""
    omega = np.array([0.1, 0.3 + 0.8 * t, 0.5 * t])
    turn = Rotation.from_rotvec([0.1 * t, 0.3 * t + 0.4 * t * t, 0.25 * t * t])
    arm = turn.apply(np.array(PLACE) * (1, SIDES[side], 1))
    ahead = np.array([2.0, 0.0, 0.0])
    return arm + t * ahead, turn, np.cross(omega, arm) + ahead, omega


def sway(probe, name, side):
    """Give the mount of a side its motion at the time of the probe."""
    x, turn, v, w = swaying(probe.t, side)
    probe.give(f"{name}.position", x)
    probe.give(f"{name}.orientation", turn.as_quat(scalar_first=True), "wxyz")
    probe.give(f"{name}.velocity", v)
    probe.give(f"{name}.angular_velocity", w)


MOTORS = {
    "speeds": {"propulsion.speed.end": 10.0, "steering.speed.end": 4.0},
    "controllers": {"propulsion.mode": "controller", "propulsion.speed.end": 10.0, "steering.mode": "controller",
                    "steering.speed.end": 4.0},
    "torques and brakes": {"propulsion.mode": "torque", "propulsion.torque.drive": 900.0, "steering.mode": "torque",
                           "steering.torque.drive": 200.0, **both(**{"brake.torque": 150.0})},
}  # fmt: skip
