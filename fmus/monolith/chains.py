"""A track's model as a part of the whole: what its equations are asked for, its state in and out, its mirror image."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from fmus.model import Floats, InvalidParameter
from fmus.physics.chain.flexible import cholesky
from fmus.physics.chain.flexible.state import State as Flexible
from fmus.physics.chain.kinds import accelerate, observe
from fmus.physics.chain.on_links import MIRRORED, count, renew
from fmus.physics.chain.report import GROUND, REPORT, SUMMED
from fmus.physics.chain.rigid.joints import fold
from fmus.physics.chain.rigid.state import State as Rigid
from fmus.physics.chain.state import moving
from fmus.physics.chain.state import take as take_evaluated
from fmus.track import TrackModel

FORCE = np.array([1.0, -1, 1])  # what a mirror in the plane of the track makes of a force, ...
WRENCH = np.array([1.0, -1, 1, -1, 1, -1])  # ... of a wrench or a velocity with the angular one, ...
POSE = np.array([1.0, -1, 1, 1, -1, 1, -1])  # ... of a pose, ...
PIN = np.array([1.0, -1, 1, 1, 1, 1, 1, -1])  # ... of the coordinates of a pin of cables, ...
OWN = np.array([1.0, -1, 1, 1, -1, 1])  # ... of one that a cable shares with no other, ...
# ... and of axes that turn: rotation, origin with its rates, angular rates, their auxiliary ones, middle of the wheels
AXES = np.concatenate([np.outer(FORCE, FORCE).ravel(), *3 * [FORCE], *2 * [-FORCE], [-1.0, -1.0], FORCE, FORCE])
MIRRORS = {
    Flexible: {"q": PIN, "v": PIN, "axes": AXES},
    Rigid: {"q": POSE, "v": WRENCH, "lam": FORCE, "load": FORCE, "along": np.ones(1)},
}

BOOKS = REPORT


class Place(NamedTuple):
    """Where a chain stands in the whole; m wheels."""

    start: int  # of its part of the state
    end: int
    seen: np.ndarray  # (m) which motion each wheel has
    wrench: int  # the first of its m + 1 wrenches, the last one being the ground's
    frame: np.ndarray  # (5) of the track, see fmus.physics.wheels
    impulse: np.ndarray  # (m + 1, 6) of its wrenches over the step
    on_links: np.ndarray  # (k, c) likewise of the forces on each link
    books: np.ndarray  # (BOOKS) of the step: what a report sums up


class Chain(NamedTuple):
    """A chain of any kind of link: what ``physics.chain.kinds`` asks for."""

    place: Place
    links: Any
    contacts: Any  # None where there are none
    env: Any
    s: Any  # what moves are views of the stage's argument
    w: Any


def size(model: TrackModel) -> int:
    """Numbers that move; raises InvalidParameter for links that the monolith does not know."""
    element = getattr(model, "element", "cable")
    if element != "cable":
        raise InvalidParameter(f"element = '{element}': the monolith knows chains of cables only")
    if type(model.s) not in MIRRORS:
        raise InvalidParameter(f"the monolith knows no mirror image of the state of {type(model.link).__name__}")
    return sum(part.size for part in moving(model.s).values())


def chain(model: TrackModel, place: Place, y: Floats) -> Chain:
    """The chain of an initialised model, its state being the part ``y`` of the stage's argument."""
    views, start = {}, 0
    for name, part in moving(model.s).items():
        views[name] = y[start : start + part.size].reshape(part.shape)
        start += part.size
    return Chain(place, *model.system(), model.s._replace(**views), model.work)


def give(model: TrackModel, x: Floats) -> None:
    """The model's state into ``x``."""
    x[:] = model.s.flat[: x.size]


def take(model: TrackModel, place: Place, x: Floats, h: float) -> None:
    """The state after a step of ``h``, evaluated, into the model and its report."""
    model.s.flat[: x.size] = x
    renew(model.s, model.interval)
    model.s.mean[:] = place.impulse / h
    model.s.on_links_sum[:] += place.on_links
    count(model.s, h)
    accelerate(*model.system(), model.s, model.work)
    take_evaluated(model.s, model.work)
    observe(model.link, model.environment, model.s, model.work, model.report)
    model.report[[*SUMMED]] += place.books[[*SUMMED]]


def mirror(of: TrackModel, model: TrackModel) -> None:
    """Make ``model`` the mirror image of ``of`` on the other side of the vehicle."""
    s, theirs = model.s, of.s
    for name, signs in MIRRORS[type(s)].items():
        mine, shown = getattr(s, name), getattr(theirs, name)
        if signs is PIN and shown.shape[-1] == OWN.size:
            signs = OWN
        size = min(signs.size, shown.shape[-1])
        mine[..., :size] = shown[..., :size] * signs[:size]
    if "joints" in moving(s):
        fold(model.link.rigid, s)
    if "p" in moving(s):
        cholesky.fold(model.link, s, model.work)
    s.on_links_sum[:], s.span[:] = theirs.on_links_sum * MIRRORED[: theirs.on_links_sum.shape[1]], theirs.span
    s.wrench[:], s.mean[:], s.sums[:] = theirs.wrench * WRENCH, theirs.mean * WRENCH, theirs.sums
    model.report[:] = of.report
    model.report[GROUND + 1] *= -1.0
    model.counters[:] = of.counters
