"""A chassis whose variables are read and set by name, and a state with everything in motion."""

import copy

import numpy as np
from scipy.spatial.transform import Rotation

from fmus.chassis.dynamics import ROOT
from fmus.chassis.model import Model
from fmus.vehicles.vehicle import read_table, vehicle

TABLE = vehicle(*read_table("m113")).model_dump()
ROLLERS = {
    "mass": 90.0, "spin_inertia": 1.4, "transverse_inertia": 0.9, "radius": 0.118, "width": 0.3,
    "x": (-0.9, -2.1, -3.0), "z": 0.09,
}  # fmt: skip
LEAVES = 12  # left arms, left idler, right arms, right idler: without return rollers


class Probe:
    """A model whose variables are read and set by name; inputs that are not set stay 0."""

    def __init__(self, changes=None, sides=("left", "right"), config=None, **parameters):
        table = copy.deepcopy(TABLE)
        for key, value in (changes or {}).items():
            *path, last = key.split(".")
            part = table
            for name in path:
                part = part[name]
            part[last] = value
        self.model = Model({"vehicle": table, "chassis": {"sides": list(sides), **(config or {})}})
        real = [port for port in self.model.ports if isinstance(port.start, float) and port.causality != "parameter"]
        self.inputs = [port.name for port in real if port.causality == "input"]
        self.names = [port.name for port in real if port.causality == "output"]
        self.u, self.y, self.t = np.zeros(len(self.inputs)), np.zeros(len(self.names)), 0.0
        self.model.initialise({name.replace("__", "."): value for name, value in parameters.items()})

    def __setitem__(self, name, value):
        self.u[self.inputs.index(name)] = value

    def __getitem__(self, name):
        self.model.outputs(self.y)
        if name in self.names:
            return self.y[self.names.index(name)]
        return np.array([self.y[self.names.index(f"{name}.{axis}")] for axis in "xyz"])

    def run(self, duration, h=1e-3):
        for _ in range(round(duration / h)):
            self.model.step(self.t, h, self.u)
            self.t += h
        return self

    @property
    def energy(self):
        return self["energy.kinetic"] + self["energy.gravity"] + self["energy.spring"]


def stir(model, scale=1.0, seed=5):
    """Set a state with everything in motion: turned, moving, arms and idlers displaced, wheels spinning."""
    rng, x, n = np.random.default_rng(seed), model.state, len(model.tree.is_arm)
    x[:3] = rng.normal(size=3)
    x[3:7] = Rotation.from_rotvec(scale * rng.normal(size=3)).as_quat(scalar_first=True)
    x[7:13] = scale * rng.normal(size=6)
    x[ROOT : ROOT + n] = 0.05 * scale * rng.normal(size=n)
    x[ROOT + 2 * n : ROOT + 3 * n] = scale * rng.normal(size=n)
    x[ROOT + 3 * n : ROOT + 4 * n] = 20 * scale * rng.normal(size=n)
    x[ROOT : ROOT + n].reshape(2, -1)[:, LEAVES // 2 :] = 0.0  # return rollers
    x[ROOT + 2 * n : ROOT + 3 * n].reshape(2, -1)[:, LEAVES // 2 :] = 0.0
    return x
