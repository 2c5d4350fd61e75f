"""Rigid chains in the monolith, behind the door ``chains``; sibling: ``flexible``."""

from __future__ import annotations

import numpy as np

from fmus.jit import kernel
from fmus.model import Floats
from fmus.monolith.chains import Place, Rigid
from fmus.track import GROUND
from fmus.track_rigid import explicit
from fmus.track_rigid.chain import accelerations, chain_speed_of
from fmus.track_rigid.explicit import normalise, project, rates
from fmus.track_rigid.loads import COVERED, COVERING, DISSIPATED, LOAD_POWER, POWER, TRAVEL, WORK
from fmus.track_rigid.model import Model

POSE = np.array([1.0, -1, 1, 1, -1, 1, -1])  # what a mirror in the plane of the track makes of a pose
MOTION = np.array([1.0, -1, 1, -1, 1, -1])  # of a velocity, and of a wrench


def size(model: Model) -> int:
    """Poses and velocities."""
    return 13 * model.links_count


def longest(model: Model) -> float:
    """The largest step that regularised friction bears, s."""
    return explicit.LIMIT


def rows(model: Model) -> Floats:
    """Where the model's contacts look for the wheels."""
    return model.work.rows


def chain(model: Model, place: Place, y: Floats) -> Rigid:
    """The chain of an initialised model, its state being the part ``y`` of the stage's argument."""
    n = model.links_count
    state = model.views._replace(q=y[: 7 * n].reshape(n, 7), v=y[7 * n :].reshape(n, 6))
    return Rigid(place, model.link, model.ends, model.contacts, model.environment, state, model.work)


def give(model: Model, x: Floats) -> None:
    """The model's state into ``x``."""
    x[:] = np.concatenate([model.views.q.ravel(), model.views.v.ravel()])


def take(model: Model, place: Place, x: Floats, h: float) -> None:
    """The state after a step of ``h``, evaluated, into the model and its report."""
    s, n = model.views, model.links_count
    s.q[:], s.v[:] = x[: 7 * n].reshape(n, 7), x[7 * n :].reshape(n, 6)
    s.tally[[DISSIPATED, WORK, COVERED, TRAVEL]] += place.books
    model.work.impulse[:] = place.impulse
    model.publish(h)


def mirror(of: Model, model: Model) -> None:
    """Make ``model`` the mirror image of ``of`` on the other side of the vehicle."""
    s, theirs = model.views, of.views
    s.q[:], s.v[:], s.F[:] = theirs.q * POSE, theirs.v * MOTION, theirs.F * MOTION
    s.lam[:, :3], s.load[:] = theirs.lam[:, :3] * MOTION[:3], theirs.load * MOTION[:3]
    s.tally[:] = theirs.tally
    model.work.impulse[:] = of.work.impulse * MOTION
    model.counters[:] = of.counters
    model.publish(1.0)
    model.wrench[:] = of.wrench * np.tile([[1, -1, 1], [-1, 1, -1]], (len(of.wrench) // 2, 1))
    model.report[:] = of.report
    model.report[GROUND + 1] *= -1.0


@kernel
def slopes(c, k):
    """See ``chains``."""
    normalise(c.s)
    failed = accelerations(c.link, c.ends, c.env, c.contacts, c.s, c.w)
    rates(c.s, k)
    return failed


@kernel
def wrenches(c):
    """See ``chains``."""
    return c.s.F


@kernel
def powers(c):
    """See ``chains``."""
    return c.s.tally[POWER], c.s.tally[LOAD_POWER], c.s.tally[COVERING]


@kernel
def speed(c):
    """See ``chains``."""
    return chain_speed_of(c.link, c.ends, c.env, c.s, c.w)


@kernel
def close(c):
    """See ``chains``."""
    normalise(c.s)
    return project(c.link, c.ends, c.s, c.w)
