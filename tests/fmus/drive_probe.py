"""A sprocket drive whose variables are read by name, its modes, a turning mount, an exact profile."""

import numpy as np
from scipy.spatial.transform import Rotation

from fmus.sprocket_drive.model import Model

J = 13.87
PLACE = (0.0, 1.0795, 0.0)
RAMP = {"speed.end": 20.0, "ramp.start": 2.0, "ramp.end": 6.0}


class Probe:
    """A drive whose variables are read by name; its mount is unconnected until ``mount`` is set."""

    def __init__(self, inertia=J, **parameters):
        self.model = Model({"drive": {"inertia": inertia, "mount": list(PLACE)}})
        real = [port for port in self.model.ports if isinstance(port.start, float) and port.causality != "parameter"]
        inputs = [port for port in real if port.causality == "input"]
        self.u, self.t = np.array([port.start for port in inputs]), 0.0
        self.names = [port.name for port in real if port.causality == "output"]
        self.y = np.zeros(len(self.names))
        self.model.initialise(parameters)

    def __getitem__(self, name):
        self.model.outputs(self.y)
        if name in self.names:
            return self.y[self.names.index(name)]
        parts = "wxyz" if name.endswith("orientation") else "xyz"
        return np.array([self.y[self.names.index(f"{name}.{part}")] for part in parts])

    @property
    def axis(self):
        """Lateral axis of the sprocket in the world frame."""
        return Rotation.from_quat(self["sprocket.orientation"], scalar_first=True).apply([0, 1, 0])

    def step(self, h, chain=(0, 0, 0), force=(0, 0, 0), mount=None):
        """Make one step; mount(t) gives position, Rotation, velocity, angular velocity."""
        if mount is not None:
            position, rotation, velocity, omega = mount(self.t)
            self.u[:13] = *position, *rotation.as_quat(scalar_first=True), *velocity, *omega
        self.u[13:] = *force, *chain
        self.model.step(self.t, h, self.u)
        self.t += h
        return self

    def run(self, duration, h=1e-3, **inputs):
        for _ in range(round(duration / h)):
            self.step(h, **inputs)
        return self


def turning(omega, velocity=(0.0, 0.0, 0.0), start=(0.2, -0.1, 0.4)):
    """Return a mount that turns at a constant world rate and moves at a constant velocity."""
    omega, velocity = np.asarray(omega), np.asarray(velocity)

    def mount(t):
        rotation = Rotation.from_rotvec(omega * t) * Rotation.from_rotvec(start)
        return np.array(PLACE) + velocity * t, rotation, velocity, omega

    return mount


def half_cosine(t):
    return 20.0 * 0.5 * (1 - np.cos(np.pi * np.clip((t - 2.0) / 4.0, 0.0, 1.0)))


MODES = {
    "speed": {"mode": "speed", "speed.start": 3.0, "speed.end": 20.0, "ramp.start": 0.02, "ramp.end": 0.3},
    "torque": {"mode": "torque", "speed.start": 3.0, "torque.drive": 700.0, "brake.torque": 200.0},
    "controller": {"mode": "controller", "speed.start": 3.0, "speed.end": 9.0, "brake.torque": 200.0},
}
