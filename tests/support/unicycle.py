"""A driver on a vehicle that moves without slip."""

import numpy as np

from fmus.driver.model import Model
from orchestrator.scene.scene import load

TABLE = load("straight").vehicle.model_dump()
AHEAD = float(np.mean(TABLE["road_wheel"]["x"])) - TABLE["chassis"]["centre"][0]  # of the point that follows the path
RADIUS = TABLE["sprocket"]["teeth"] * TABLE["track"]["pitch"] / (2.0 * np.pi)
H = 2e-3


class Unicycle:
    """A driver, and a vehicle that turns about the point that follows the path without slip."""

    def __init__(self, grip=1.0, left=0.0, **parameters):
        self.model = Model({"vehicle": TABLE})
        self.model.initialise(parameters)
        self.names = [port.name for port in self.model.ports if port.causality == "output"][:-1]
        self.width = grip * self.model.parts.law.width
        start = [port.start for port in self.model.ports[:2]]
        self.x, self.y, self.heading = start[0] + AHEAD, start[1] + left, 0.0
        self.speed = self.rate = 0.0
        self.outputs = np.zeros(len(self.names))
        self.shown = []

    def hull(self):
        """Position, quaternion, velocity and angular velocity of the hull."""
        c, s = np.cos(self.heading), np.sin(self.heading)
        x, y = self.x - AHEAD * c, self.y - AHEAD * s
        v = self.speed * c + AHEAD * self.rate * s, self.speed * s - AHEAD * self.rate * c
        half = 0.5 * self.heading
        return np.array([x, y, 0.4, np.cos(half), 0, 0, np.sin(half), *v, 0, 0, 0, self.rate])

    def step(self, t):
        """Make one step; return the inputs that the driver saw."""
        self.model.outputs(self.outputs)
        left, right = RADIUS * self.outputs[:2]
        self.speed, self.rate = 0.5 * (left + right), (right - left) / self.width
        seen = self.hull()
        self.model.step(t, H, seen)
        self.heading += 0.5 * H * self.rate
        self.x += H * self.speed * np.cos(self.heading)
        self.y += H * self.speed * np.sin(self.heading)
        self.heading += 0.5 * H * self.rate
        self.shown.append(self.outputs.copy())
        return seen

    def run(self, stop):
        """Drive until a time, s."""
        for k in range(round(stop / H)):
            self.step(k * H)
        return self

    def __getitem__(self, name):
        return np.array(self.shown)[:, self.names.index(name)]
