"""Open chains with bushed pins, without wheels."""

from __future__ import annotations

import pytest
from m113 import TRACK, VEHICLE
from named_ports import parameters

from fmus.track_flexible.model import Model as Flexible
from fmus.track_rigid.model import Model as Rigid

P, MASS, INERTIA, G = TRACK["pitch"], TRACK["mass"], TRACK["inertia"][1], 9.81
NONE = {"stiffness": 0.0, "preset": 0.0, "damping": 0.0, "friction": 0.0, "radius": 0.02, "slow": 0.2}
ELASTIC_CHAINS = [  # model, parameters, and the relative difference from rigid links that elastic ones may have
    pytest.param(Rigid, {}, 1e-6, id="rigid"),
    pytest.param(Flexible, {}, 2e-4, id="cable"),
    *(  # the same kernels of bushes, compiled for other layouts
        pytest.param(Flexible, changes, 2e-4, id="-".join(changes.values()), marks=pytest.mark.study)
        for changes in ({"element": "planar"}, {"element": "beam"}, {"joints": "constrained"})
    ),
]


def chain(model, links: int, bushing: dict, ends: dict, changes: dict, gravity: float = G, track=TRACK, **more):
    """An open chain without wheels, initialised."""
    vehicle = VEHICLE | {"track": track | {"bushing": NONE | bushing}}
    config = {"links": links, "closed": False, "wheels": [], "ground": False, "gravity": gravity, "ends": ends}
    made = model({"vehicle": vehicle, "track": config | more, "link_outputs": ["position", "force", "moment"]})
    made.initialise(parameters(made, **changes))
    return made
