"""Kernels of a track component for all kinds of links: start, communication step, outputs."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from fmus.jit import allocating, kernel
from fmus.link_outputs import AXIS, DEPTH, FIBRES, FORCE, GROUND, POSITION, SLIDING, SLOPES, STRESS, TENSION, WHEELS
from fmus.model import no_rotation, too_many
from fmus.physics.chain import adaptive, on_links
from fmus.physics.chain.environment import Environment
from fmus.physics.chain.explicit import march
from fmus.physics.chain.implicit import advance
from fmus.physics.chain.kinds import fibres, observe_links, pin_axes, slopes
from fmus.physics.chain.report import GROUND as ON_GROUND
from fmus.physics.chain.report import REJECTED, REPORT, STEPS
from fmus.physics.wheels import WIDTH, read_states, to_world
from fmus.ports import STATE
from fmus.sentences import TOLD as NUMBERS
from fmus.start import lay_frame

# Cosine of the angle between a wheel's axis and the pins of links that stay in their plane:
ALONG = np.cos(np.radians(0.2))  # a larger angle is a warning, because the plane of the links holds the wheel back
LEAVES = np.cos(np.radians(5.0))  # a larger angle is a failure, because the results are wrong
MANY = 5  # halvings in one communication step, more of which are a warning
# Failures; the failure of an integrator is added to the last two.
NO_WHEEL, TOO_LONG, ELSEWHERE, ASKEW, IMPLICIT, EXPLICIT = 1, 2, 3, 4, 4, 8
HALVED, TILTED = TOLD = range(2)  # warnings, each given once: flags at the end of the state


class Stand(NamedTuple):
    """Pose of a track, its wheels and counters, for all kinds of links."""

    longest: float  # longest internal step, s
    plane: int  # 1: these links stay in their plane
    pitch: float  # m
    lateral: float  # of the track in the vehicle, m
    frame: np.ndarray  # (5) of the track in the world: origin, cosine and sine of its heading
    start_rows: np.ndarray  # (wheels, 15) states of the wheels round which the chain was laid out
    rows: np.ndarray  # (wheels, 15) states of the wheels now
    given: np.ndarray  # (TOLD) 1 for warnings that were given
    counters: np.ndarray  # int
    interval: float  # communication steps over which link outputs are averaged


class Parts(NamedTuple):
    """Data of a running track: parameters, state and scratch arrays of its kernels."""

    link: Any  # parameters of the links; their class selects the kernels
    contacts: Any  # ``fmus.contacts.Contacts``, or None
    environment: Environment  # gravity, ends, carrier
    scheme: Any  # an ``ImplicitMethod``, the stages of the explicit integrator, or an ``Adams``
    stand: Stand
    s: Any  # views of the state
    work: Any  # scratch
    report: np.ndarray


def alone(link, environment, scheme, longest, s, work, report, counters):
    """Parts of a chain without contacts at the origin, and the array for the numbers of its sentences."""
    none = np.zeros((0, WIDTH))
    stand = Stand(longest, 0, 0.0, 0.0, np.zeros(5), none, none, np.zeros(len(TOLD)), counters, 1.0)
    return Parts(link, None, environment, scheme, stand, s, work, report), np.zeros((1 + len(TOLD), NUMBERS + 1))


class Shown(NamedTuple):
    """Data behind the outputs of a track without its link outputs."""

    frame: np.ndarray  # (5)
    mean: np.ndarray  # (wheels, 6) mean wrenches
    report: np.ndarray


class ShownLinks(NamedTuple):
    """Data behind the link outputs of a track."""

    frame: np.ndarray  # (5)
    link: Any
    environment: Environment
    s: Any
    work: Any
    links: int
    nodes: int
    shows: np.ndarray  # for each group of ``link_outputs``, 1: it is shown
    beyond: int | None  # None: no group with kernels of its own is shown


@allocating
def begin(c, told, p):
    """See ``fmus.model.Component``; p: the start pose, then the track's lateral place, m.

    Sets the frame only: the state is already that of the laid-out chain.
    """
    lay_frame(p, 0.0, p[6], 0.0, c.stand.frame)
    return 0


@allocating
def implicit(c, told, t, h, u):
    """Implicit step, see ``fmus.model.Component``; u: motions of the wheels (13 each); empty: unchanged."""
    stand = c.stand
    wrong = _ready(stand, told, t, h, u)
    if wrong:
        return wrong
    counters = stand.counters
    before = counters[REJECTED]
    on_links.begin_interval(c.s, stand.interval)
    failure, done, link, residual = advance(
        c.link, c.contacts, c.environment, c.scheme, stand.rows, h, stand.longest, c.s, c.work, c.report, counters
    )
    if failure:
        told[0, 0], told[0, 1], told[0, 2] = t + done, link, residual
        return IMPLICIT + failure
    on_links.count_step(c.s, h)
    tell_halved(stand.given, told, t, counters[REJECTED] - before)
    return 0


@kernel
def tell_halved(given, told, t, halved):
    """Warn once of a communication step at ``t`` in which the internal step was halved too often."""
    if halved > MANY and given[HALVED] == 0.0:
        given[HALVED] = told[1 + HALVED, 0] = 1.0
        told[1 + HALVED, 1], told[1 + HALVED, 2] = halved, t


@allocating
def explicit(c, told, t, h, u):
    """Explicit Runge-Kutta step; arguments and result as of ``implicit``."""
    stand = c.stand
    wrong = _ready(stand, told, t, h, u)
    if wrong:
        return wrong
    on_links.begin_interval(c.s, stand.interval)
    return _how(c, told, t, h, march(
        c.link, c.contacts, c.environment, c.scheme, stand.rows, h, stand.longest, c.s, c.work, c.report, stand.counters
    ))  # fmt: skip


@allocating
def adams(c, told, t, h, u):
    """Step by Adams' methods; arguments and result as of ``implicit``."""
    stand = c.stand
    wrong = _ready(stand, told, t, h, u)
    if wrong:
        return wrong
    on_links.begin_interval(c.s, stand.interval)
    return _how(c, told, t, h, adaptive.march(
        c.link, c.contacts, c.environment, c.scheme, stand.rows, h, stand.longest, c.s, c.work, c.report, stand.counters
    ))  # fmt: skip


@kernel
def _how(c, told, t, h, outcome):
    """Failure of an explicit integration from its outcome; 0 for none."""
    on_links.count_step(c.s, h)
    failure, done, link, _ = outcome
    if failure:
        told[0, 0], told[0, 1], told[0, 2] = t + done, link, c.stand.longest
        return EXPLICIT + failure
    return 0


@kernel
def _ready(c, told, t, h, u):
    """Read the wheels from the inputs and check them; 0, or the failure."""
    if too_many(told[0], t, h, c.longest):
        return TOO_LONG
    wrong = read_states(u, c.frame, c.rows)
    if wrong >= 0:
        no_rotation(told[0], t, wrong, u, STATE * wrong + 3)
        return NO_WHEEL
    if c.counters[STEPS] == 0 and u.size > 0:
        farthest, where = 0.0, 0
        for k in range(c.rows.shape[0]):
            square = 0.0
            for i in range(3):
                square += (c.rows[k, i] - c.start_rows[k, i]) ** 2
            off = np.sqrt(square)
            if off > farthest:
                farthest, where = off, k
        if farthest > c.pitch:
            told[0, 0], told[0, 1], told[0, 2], told[0, 3] = t, where, farthest, c.lateral
            return ELSEWHERE
    if c.plane == 1 and u.size > 0:
        along = 1.0
        for k in range(c.rows.shape[0]):
            along = min(along, abs(c.rows[k, 10]))
        off = np.arccos(along) * 180.0 / np.pi
        if along < LEAVES:
            told[0, 0], told[0, 1] = t, off
            return ASKEW
        if along < ALONG and c.given[TILTED] == 0.0:
            c.given[TILTED] = told[1 + TILTED, 0] = 1.0
            told[1 + TILTED, 1], told[1 + TILTED, 2] = off, t
    return 0


@allocating
def show(c, y):
    """See ``fmus.model.Component``: mean wrenches on the wheels and the report, world axes; c: ``Shown``."""
    n = c.mean.shape[0]
    for k in range(n):
        to_world(c.mean[k].reshape(2, 3), c.frame, y[6 * k : 6 * k + 6])
    for i in range(REPORT):
        y[6 * n + i] = c.report[i]
    first = 6 * n + ON_GROUND
    to_world(c.report[ON_GROUND : ON_GROUND + 3].reshape(1, 3), c.frame, y[first : first + 3])


@allocating
def show_links(c, y):
    """See ``fmus.model.Component``: the chosen groups of ``link_outputs``, in order; c: ``ShownLinks``."""
    n, m, shows, felt = c.links, c.nodes, c.shows, np.empty(c.s.on_links_sum.shape)
    tension, stress, place = np.empty(n), np.empty(n), np.empty((m, 3))
    observe_links(c.link, c.environment, c.s, c.work, tension, stress, place)
    on_links.interval_means(c.s, felt)
    at = _numbers(shows[TENSION], tension, y, 0)
    at = _numbers(shows[STRESS], stress, y, at)
    if shows[POSITION]:
        to_world(place, c.frame, y[at : at + 3 * m])
        for k in range(m):
            for i in range(3):
                y[at + 3 * k + i] += c.frame[i]
        at += 3 * m
    at = _vectors(shows[FORCE], felt[:, on_links.JOINT : on_links.JOINT + 3], c.frame, y, at)
    at = _vectors(shows[GROUND], felt[:n, on_links.GROUND : on_links.GROUND + 3], c.frame, y, at)
    at = _vectors(shows[WHEELS], felt[:n, on_links.WHEELS : on_links.WHEELS + 3], c.frame, y, at)
    at = _vectors(shows[SLIDING], felt[:n, on_links.SLIDING : on_links.SLIDING + 3], c.frame, y, at)
    if shows[DEPTH]:
        at = _numbers(1, felt[:n, on_links.DEPTH], y, at)
    _beyond(c.beyond, c, y, at)


@allocating
def _beyond(beyond, c, y, at):
    """Write the groups with kernels of their own, which are not compiled where no such group is shown."""
    if beyond is not None:
        axis, found, ends = np.empty((c.nodes, 3)), np.empty((c.links, 2)), np.empty((c.links, 6))
        pin_axes(c.link, c.s, c.work, axis)
        at = _vectors(c.shows[AXIS], axis, c.frame, y, at)
        if c.shows[FIBRES]:
            fibres(c.link, c.s, c.work, found)
            at = _numbers(1, found.ravel(), y, at)
        if c.shows[SLOPES]:
            slopes(c.link, c.s, c.work, ends)
            _vectors(1, ends.reshape(2 * c.links, 3), c.frame, y, at)


@kernel
def _numbers(shown, a, y, at):
    """Copy the array ``a``, if ``shown``, to ``y[at:]``; return the index after it."""
    if shown:
        for i in range(a.shape[0]):
            y[at + i] = a[i]
        at += a.shape[0]
    return at


@kernel
def _vectors(shown, a, frame, y, at):
    """Copy vectors (k, 3) in the track's frame to ``y[at:]`` in world axes, as ``_numbers`` does."""
    if shown:
        to_world(a, frame, y[at : at + 3 * a.shape[0]])
        at += 3 * a.shape[0]
    return at
