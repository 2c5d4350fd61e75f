"""Flexible chains in the monolith, behind the door ``chains``; sibling: ``rigid``."""

from __future__ import annotations

import numpy as np

from fmus.jit import allocating, kernel
from fmus.model import Floats, InvalidParameter
from fmus.monolith.chains import Flexible, Place
from fmus.physics.carrier import carrier
from fmus.physics.chain.cable_nodes import NODE
from fmus.physics.chain.sums import COVERING, POWER
from fmus.physics.chain_speed import chain_speed
from fmus.track import COVERED, DISSIPATED, TRAVEL, WORK
from fmus.track_flexible.assembly import measure
from fmus.track_flexible.explicit import accelerations
from fmus.track_flexible.model import Model

MIRROR = np.array([1.0, -1, 1, 1, 1, 1, 1, -1])  # of a pin's coordinates in the plane of the track


def size(model: Model) -> int:
    """Coordinates and rates; raises InvalidParameter for beams."""
    if model.element != "cable":
        raise InvalidParameter(f"element = '{model.element}': the monolith knows chains of cables only")
    return 2 * model.nodes * NODE


def longest(model: Model) -> float:
    """The largest stable step of the classical Runge-Kutta method, s."""
    return float(model.stable)


def rows(model: Model) -> Floats:
    """Where the model's contacts look for the wheels."""
    return model.work.moved


def chain(model: Model, place: Place, y: Floats) -> Flexible:
    """The chain of an initialised model, its state being the part ``y`` of the stage's argument."""
    q, v = y.reshape(2, model.nodes, NODE)
    still, scratch, _ = model.space
    return Flexible(place, model.link, model.contacts, model.environment, q, v, still, scratch, model.work)


def give(model: Model, x: Floats) -> None:
    """The model's state into ``x``."""
    x[:] = np.concatenate([model.q.ravel(), model.v.ravel()])


def take(model: Model, place: Place, x: Floats, h: float) -> None:
    """The state after a step of ``h``, evaluated, into the model and its report."""
    q, v = x.reshape(2, model.nodes, NODE)
    model.q[:], model.v[:] = q, v
    model.mean[:] = place.impulse / h
    model.settle_forces()
    measure(model.link, model.environment, model.q, model.v, model.work, model.report)
    model.report[[DISSIPATED, WORK, COVERED, TRAVEL]] += place.books
    model.publish()


def mirror(of: Model, model: Model) -> None:
    """Make ``model`` the mirror image of ``of`` on the other side of the vehicle."""
    model.q[:], model.v[:] = of.q * MIRROR, of.v * MIRROR
    model.mean[:] = of.mean * [1, -1, 1, -1, 1, -1]
    model.residual[:] = of.residual * [1, -1, 1]
    model.report[:] = of.report
    model.counters[:] = of.counters
    model.publish()


@allocating
def slopes(c, k):
    """See ``chains``."""
    accelerations(c.links, c.contacts, c.env, c.q, c.v, c.still, c.scratch, c.w)
    n = c.q.size
    k[:n] = c.v.ravel()
    k[n:] = c.scratch[0].ravel()
    return -1


@kernel
def wrenches(c):
    """See ``chains``."""
    return c.w.wrench


@kernel
def powers(c):
    """See ``chains``."""
    load = 0.0
    if c.env.ends == 2:
        for i in range(3):
            load += c.env.pull[0, i] * c.v[0, i] + c.env.pull[1, i] * c.v[-1, i]
    return c.w.sums[POWER], load, c.w.sums[COVERING]


@kernel
def speed(c):
    """See ``chains``."""
    return chain_speed(c.q[:, :3], c.v[:, :3], c.links.closed == 1, carrier(c.w.moved, c.env.mount))


@kernel
def close(c):
    """The pins are eliminated: nothing drifts."""
    return True
