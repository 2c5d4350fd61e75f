"""Chains of flexible links by themselves: hanging and on wheels, with their inputs."""

from __future__ import annotations

import numpy as np
from named_ports import parameters

from fmus.physics.block_cyclic import factor, solve
from fmus.physics.chain.flexible.condensation import correct
from fmus.physics.chain.flexible.dynamics import NOTHING
from fmus.physics.chain.flexible.link_layout import coordinate_indices
from fmus.physics.chain.flexible.state import Motion
from fmus.physics.chain.interface import observe
from fmus.physics.chain.report import DISSIPATED, GRAVITY, KINETIC, STRAIN
from fmus.physics.integrate.generalized_alpha import Slopes
from fmus.track_flexible.model import Model
from fmus.vehicles.vehicle import read_table, vehicle

TABLE = vehicle(*read_table("m113")).model_dump()
PITCH, LINKS = 0.1524, 64


def make(track: dict, table: dict = TABLE, **changes) -> Model:
    base = {"links": LINKS, "closed": True, "wheels": [], "ground": False, "gravity": 9.81, "ends": None}
    model = Model({"vehicle": table, "track": base | track, "link_outputs": True})
    model.initialise(parameters(model, **changes))
    return model


def hanging(span: float = 0.8, links: int = LINKS, **changes) -> Model:
    ends = {"kind": "pinned", "first": [0.0, 0.0], "last": [span * links * PITCH, 0.0]}
    return make({"links": links, "closed": False, "ends": ends}, **changes)


def wheels(idler: float = -3.9996) -> list[dict]:
    road = TABLE["road_wheel"]
    return [
        {"name": "sprocket", "kind": "teeth", "position": [0.0, 0.0]},
        *({"name": f"road_wheel[{i}]", "kind": "rim", "radius": road["radius"], "position": [x, road["z"]]}
          for i, x in enumerate(road["x"], 1)),
        {"name": "idler", "kind": "rim", "radius": TABLE["idler"]["radius"], "position": [idler, TABLE["idler"]["z"]]},
    ]  # fmt: skip


def carrier(**changes) -> Model:
    return make({"wheels": wheels(), "ground": True}, **changes)


def at_rest(model: Model, lift: float = 0.0) -> np.ndarray:
    """Inputs of wheels at rest at the places of the layout, raised by ``lift``, m."""
    u = np.zeros(13 * len(model.wheel_list))
    for k, wheel in enumerate(model.wheel_list):
        c, s = model.frame[3], model.frame[6]
        x, z = wheel["position"]
        u[13 * k : 13 * k + 3] = model.frame[0] + c * x, model.frame[1] + s * x, model.frame[2] + z + lift
        u[13 * k + 3], u[13 * k + 6] = np.cos(np.arctan2(s, c) / 2), np.sin(np.arctan2(s, c) / 2)
    return u


def swing(steps: int, **changes):
    """Release a chain from a displaced shape.

    Returns the model and the energy error after each millisecond over the largest kinetic energy.
    """
    model = hanging(start="displaced", **changes)
    parts, lacks = [KINETIC, STRAIN, GRAVITY, DISSIPATED], []
    total, top = model.report[parts].sum(), 0.0
    for k in range(steps):
        model.step(k * 1e-3, 1e-3, np.zeros(0))
        top = max(top, model.report[KINETIC])
        lacks.append(model.report[parts].sum() - total)
    return model, np.array(lacks) / top


def energy_gradient(model: Model) -> np.ndarray:
    """Derivatives of the reported energy by the coordinates, from four differences each."""
    gradient, h = np.zeros_like(model.s.q), 1e-5
    for place in np.ndindex(model.s.q.shape):
        was = model.s.q[place]
        for shift, weight in ((1, 8), (-1, -8), (2, -1), (-2, 1)):
            model.s.q[place] = was + shift * h
            observe(model.link, model.environment, model.s, model.work, model.report)
            gradient[place] += weight * (model.report[STRAIN] + model.report[GRAVITY]) / (12 * h)
        model.s.q[place] = was
    return gradient


def correction(model: Model, mass: float = 0.0) -> float:
    """Make one Newton correction to equilibrium and return its size, m; ``mass`` (1/s2) enters the matrix only."""
    w, x = model.work, Motion(model.s.q, np.zeros_like(model.s.q), np.zeros_like(model.s.q), model.s.axes)
    model.evaluate(x, Slopes(0.0, 0.0, mass), True)
    assert factor(w.diagonal, w.upper, w.lower, w.factors, model.closed) < 0
    solve(w.diagonal, w.upper, w.factors, model.closed, w.right_side)
    return correct(model.link, w, x, NOTHING, np.inf)


def coordinates(model: Model, q=None) -> np.ndarray:
    """Coordinates of all links, shape (n, 4 or 8, 3)."""
    e = np.zeros((model.links_count, *model.kit.ELEMENT))
    for i in range(model.links_count):
        model.kit.gather(model.link, model.s.q if q is None else q, i, (i + 1) % model.nodes, e[i])
    return e


def scattered(model: Model, R: np.ndarray) -> np.ndarray:
    """Residuals of links (n, 4 or 8, 3) summed by coordinate of the pins."""
    f = np.zeros_like(model.s.q)
    np.add.at(f.reshape(-1), coordinate_indices(model.kit, model.s.q, R.shape[1], model.links_count), R)
    return f
