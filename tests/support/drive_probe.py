"""A sprocket drive in this process, step by step, on a mount that moves."""

import named_ports
import numpy as np
from scipy.spatial.transform import Rotation

from fmus.sprocket_drive.model import Model

J = 13.87
PLACE = (0.0, 1.0795, 0.0)
MODES = {
    "speed": {"mode": "speed", "speed.start": 3.0, "speed.end": 20.0, "ramp.start": 0.02, "ramp.end": 0.3},
    "torque": {"mode": "torque", "speed.start": 3.0, "torque.drive": 700.0, "brake.torque": 200.0},
    "controller": {"mode": "controller", "speed.start": 3.0, "speed.end": 9.0, "brake.torque": 200.0},
}


class Probe(named_ports.Probe):
    """A drive; its mount is unconnected until ``mount`` is set."""

    def __init__(self, inertia=J, demanded=False, **parameters):
        self.demand = [0.0] * demanded
        drive = {"inertia": inertia, "mount": list(PLACE), "demanded": demanded}
        super().__init__(Model({"drive": drive}), **parameters)

    @property
    def axis(self):
        """Lateral axis of the sprocket in the world frame."""
        return Rotation.from_quat(self["sprocket.orientation"], scalar_first=True).apply([0, 1, 0])

    def step(self, h, chain=(0, 0, 0), force=(0, 0, 0), mount=None):
        """Make one step; mount(t) gives position, Rotation, velocity, angular velocity."""
        if mount is not None:
            position, rotation, velocity, omega = mount(self.t)
            self.u[:13] = *position, *rotation.as_quat(scalar_first=True), *velocity, *omega
        self.u[13:] = *force, *chain, *self.demand
        return super().step(h)


def turning(omega, velocity=(0.0, 0.0, 0.0), start=(0.2, -0.1, 0.4)):
    """Return a mount that turns at a constant world rate and moves at a constant velocity."""
    omega, velocity = np.asarray(omega), np.asarray(velocity)

    def mount(t):
        rotation = Rotation.from_rotvec(omega * t) * Rotation.from_rotvec(start)
        return np.array(PLACE) + velocity * t, rotation, velocity, omega

    return mount
