"""Chains without wheels behind the ports of a track: held at one end, or a free loop."""

from typing import ClassVar

import numpy as np
import pytest
from named_ports import parameters

from fmus.track_flexible.model import Model as Flexible
from fmus.track_rigid.model import Model as Rigid
from fmus.vehicles.vehicle import read_table, vehicle

TABLE = vehicle(*read_table("m113")).model_dump()
P, PIN = TABLE["track"]["pitch"], TABLE["track"]["inertia"][1]


class Beams(Flexible):
    """A chain that is made of beams."""

    given: ClassVar = {"element": "beam"}

    def initialise(self, parameters):
        """Initialise with the parameters that make the kind."""
        super().initialise({**parameters, **self.given})


class PlanarCables(Beams):
    given: ClassVar = {"element": "planar"}


# with kernels of their own
LONG_RIGID, LONG_BEAMS, LONG_PLANAR = (
    pytest.param(kind, marks=pytest.mark.long) for kind in (Rigid, Beams, PlanarCables)
)
HOLD = {"kind": "held", "first": [1.0, 2.0]}


def made(kind, links, ends=None, gravity=9.81, **changes):
    """A chain of this model with other parameters, initialised; without ``ends`` a loop."""
    track = {"links": links, "closed": ends is None, "wheels": [], "ground": False, "gravity": gravity, "ends": ends}
    model = kind({"vehicle": TABLE, "track": track, "link_outputs": True})
    given = parameters(model)
    assert set(changes) <= set(given)
    model.initialise(given | changes)
    return model


def per_link(model):
    """Return the tensions (n) and the forces of the pins (nodes, 3), N."""
    n, m = model.links_count, model.nodes
    y = np.zeros(2 * n + 6 * m)
    model.link_outputs(y)
    return y[:n], y[2 * n + 3 * m :].reshape(m, 3)
