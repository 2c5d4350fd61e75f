"""A chassis whose variables are read and set by name, and a state with everything in motion."""

import copy

import named_ports
import numpy as np
from scipy.spatial.transform import Rotation

from fmus.chassis.leaf import ROOT
from fmus.chassis.model import Model
from fmus.vehicles.vehicle import read_table, vehicle

TABLE = vehicle(*read_table("m113")).model_dump()
ROLLERS = {
    "mass": 90.0, "spin_inertia": 1.4, "transverse_inertia": 0.9, "radius": 0.118, "width": 0.3,
    "x": (-0.9, -2.1, -3.0), "z": 0.09,
}  # fmt: skip
LEAVES = 12  # left arms, left idler, right arms, right idler: without return rollers


class Probe(named_ports.Probe):
    """A chassis of the standard vehicle's table with ``changes``; inputs that are not set stay 0."""

    def __init__(self, changes=None, sides=("left", "right"), config=None, **parameters):
        table = copy.deepcopy(TABLE)
        for key, value in (changes or {}).items():
            *path, last = key.split(".")
            part = table
            for name in path:
                part = part[name]
            part[last] = value
        super().__init__(Model({"vehicle": table, "chassis": {"sides": list(sides), **(config or {})}}), **parameters)

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
    fixed = (model.tree.is_arm == 0) & (model.tree.travel == 0.0)  # return rollers
    x[ROOT : ROOT + n][fixed] = x[ROOT + 2 * n : ROOT + 3 * n][fixed] = 0.0
    return x
