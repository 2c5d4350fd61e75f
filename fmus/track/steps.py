"""Kernels of a track component for all kinds of links: start, communication step, outputs."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from fmus.kernels.jit import allocating, kernel
from fmus.physics.arrays import Floats
from fmus.physics.chain import link_columns as column
from fmus.physics.chain import on_links
from fmus.physics.chain.explicit import march, march_adaptively, march_by_dormand_prince
from fmus.physics.chain.implicit import advance
from fmus.physics.chain.integration import CommunicationStep, Environment, IntegrationOutcome
from fmus.physics.chain.interface import fibres, observe_links, pin_axes, slopes
from fmus.physics.chain.report import GROUND as ON_GROUND
from fmus.physics.chain.report import REJECTED, REPORT
from fmus.physics.chain.state import FORGOTTEN
from fmus.physics.vector import put, vector
from fmus.physics.wheels import from_frame, to_world
from fmus.start import AFTER_POSE, lay_frame
from fmus.track.failures import FORGOTTEN_RUT, HALVED, OF_EXPLICIT, OF_IMPLICIT
from fmus.track.link_outputs import (
    AXIS,
    DEPTH,
    FIBRES,
    FORCE,
    GROUND,
    HORNS,
    MOMENT,
    POSITION,
    RIMS,
    RUBBED,
    SLIDING,
    SLOPES,
    STRESS,
    TEETH,
    TENSION,
    TURNED,
    WHEELS,
    LinkArrays,
)
from fmus.track.motions import read_wheels

MAX_HALVINGS = 5  # halvings in one communication step, more of which are a warning


class CommonData(NamedTuple):
    """Pose of a track, its wheels and counters, for all kinds of links."""

    longest: float  # longest internal step, s
    plane: int  # 1: these links stay in their plane
    pitch: float  # m
    play: float  # of the guides on each side, m
    frame: np.ndarray  # (12) of the track in the world: origin, rotation matrix
    start_rows: np.ndarray  # (wheels, 15) states of the wheels round which the chain was laid out
    rows: np.ndarray  # (wheels, 15) states of the wheels now
    given_warnings: np.ndarray  # (WARNINGS) 1 for warnings that were given
    exchange: np.ndarray  # see ``exchange``
    mean: np.ndarray  # (wheels, 6) mean wrenches of the last step
    report: np.ndarray
    weight: float  # of the chain, N
    counters: np.ndarray  # int
    interval: float  # communication steps over which link outputs are averaged


class Parts(NamedTuple):
    """Data of a running track: parameters, state and scratch arrays of its kernels."""

    link: Any  # parameters of the links; their class selects the kernels
    contacts: Any  # ``physics.chain.contacts.Contacts``, or None
    environment: Environment  # gravity, ends, frame
    scheme: Any  # an ``ImplicitMethod``, the stages of the explicit integrator, or an ``Adams``
    common: CommonData
    s: Any  # views of the state
    work: Any  # scratch
    report: np.ndarray


class OutputData(NamedTuple):
    """Data behind the outputs of a track without its link outputs."""

    frame: np.ndarray  # (12)
    mean: np.ndarray  # (2 wheels, 3) mean wrenches: force, torque
    report: np.ndarray


class LinkOutputData(NamedTuple):
    """Data behind the link outputs of a track."""

    frame: np.ndarray  # (12)
    link: Any
    environment: Environment
    s: Any
    work: Any
    links: int
    nodes: int
    group_flags: np.ndarray  # for each group of ``link_outputs``, 1: it is shown
    extra: int | None  # None: no group with kernels of its own is shown
    arrays: LinkArrays  # work arrays


@allocating
def begin(c: Parts, messages: Floats, p: Sequence[float]) -> int:
    """See ``interface.model.ComponentModel``; p: the start pose, then the track's lateral place, m.

    Sets the frame only: the state is already that of the laid-out chain.
    """
    lay_frame(p, 0.0, p[AFTER_POSE], 0.0, c.common.frame)
    return 0


@allocating
def implicit(c: Parts, messages: Floats, t: float, h: float, u: Floats) -> int:
    """Implicit step, see ``interface.model.ComponentModel``; u: motions of the wheels (13 each); empty: unchanged."""
    common = c.common
    refusal = read_wheels(common, messages, t, h, u)
    if refusal:
        return refusal
    counters = common.counters
    before = counters[REJECTED]
    on_links.begin_interval(c.s, common.interval)
    failure, elapsed, link, residual = advance(
        c.link, c.contacts, c.environment, c.scheme, CommunicationStep(common.rows, h, common.longest),
        c.s, c.work, c.report, counters,
    )  # fmt: skip
    if failure:
        messages[0, 0], messages[0, 1], messages[0, 2] = t + elapsed, link, residual
        return OF_IMPLICIT[failure]
    on_links.count_step(c.s, h)
    warn_of_halvings(common.given_warnings, messages, t, counters[REJECTED] - before)
    warn_of_rut(c.s.rut, messages, t)
    return 0


@kernel
def warn_of_halvings(given_warnings: Floats, messages: Floats, t: float, halvings: int) -> None:
    """Warn once of a communication step at ``t`` in which the internal step was halved too often."""
    if halvings > MAX_HALVINGS and given_warnings[HALVED] == 0.0:
        given_warnings[HALVED] = messages[1 + HALVED, 0] = 1.0
        messages[1 + HALVED, 1], messages[1 + HALVED, 2] = halvings, t


@kernel
def warn_of_rut(rut: Floats, messages: Floats, t: float) -> None:
    """Warn once that a part of the ``rut`` was forgotten, in the communication step at ``t``."""
    if rut.size > 0 and rut[FORGOTTEN] == 1.0:
        rut[FORGOTTEN] = 2.0
        messages[1 + FORGOTTEN_RUT, 0], messages[1 + FORGOTTEN_RUT, 1] = 1.0, t


@allocating
def explicit(c: Parts, messages: Floats, t: float, h: float, u: Floats) -> int:
    """Explicit Runge-Kutta step; arguments and result as of ``implicit``."""
    common = c.common
    refusal = read_wheels(common, messages, t, h, u)
    if refusal:
        return refusal
    on_links.begin_interval(c.s, common.interval)
    return _failure(c, messages, t, h, march(
        c.link, c.contacts, c.environment, c.scheme, CommunicationStep(common.rows, h, common.longest),
        c.s, c.work, c.report, common.counters,
    ))  # fmt: skip


@allocating
def adams(c: Parts, messages: Floats, t: float, h: float, u: Floats) -> int:
    """Step by Adams' methods; arguments and result as of ``implicit``."""
    common = c.common
    refusal = read_wheels(common, messages, t, h, u)
    if refusal:
        return refusal
    on_links.begin_interval(c.s, common.interval)
    return _failure(c, messages, t, h, march_adaptively(
        c.link, c.contacts, c.environment, c.scheme, CommunicationStep(common.rows, h, common.longest),
        c.s, c.work, c.report, common.counters,
    ))  # fmt: skip


@allocating
def dormand_prince(c: Parts, messages: Floats, t: float, h: float, u: Floats) -> int:
    """Step by the method of Dormand and Prince; arguments and result as of ``implicit``."""
    common = c.common
    refusal = read_wheels(common, messages, t, h, u)
    if refusal:
        return refusal
    on_links.begin_interval(c.s, common.interval)
    return _failure(c, messages, t, h, march_by_dormand_prince(
        c.link, c.contacts, c.environment, c.scheme, CommunicationStep(common.rows, h, common.longest),
        c.s, c.work, c.report, common.counters,
    ))  # fmt: skip


@kernel
def _failure(c: Parts, messages: Floats, t: float, h: float, outcome: IntegrationOutcome) -> int:
    """Failure of an explicit integration from its outcome; 0 for none."""
    on_links.count_step(c.s, h)
    failure, elapsed, link, _ = outcome
    if failure:
        messages[0, 0], messages[0, 1], messages[0, 2] = t + elapsed, link, c.common.longest
        return OF_EXPLICIT[failure]
    return 0


@allocating
def write_outputs(c: OutputData, y: Floats) -> None:
    """Mean wrenches on the wheels and the report, world axes, see ``interface.model.ComponentModel``.

    c: ``OutputData``.
    """
    n = c.mean.size
    to_world(c.mean, c.frame, y[:n])
    for i in range(REPORT):
        y[n + i] = c.report[i]
    put(y, n + ON_GROUND, from_frame(c.frame, vector(c.report, ON_GROUND)))


@allocating
def write_link_outputs(c: LinkOutputData, y: Floats) -> None:
    """Write the chosen groups of ``link_outputs`` in order, see ``interface.model.ComponentModel``.

    c: ``LinkOutputData``.
    """
    n, m, group_flags = c.links, c.nodes, c.group_flags
    means, tension, stress, place = c.arrays.means, c.arrays.tension, c.arrays.stress, c.arrays.place
    observe_links(c.link, c.environment, c.s, c.work, tension, stress, place)
    on_links.interval_means(c.s, means)
    index = _copy_numbers(group_flags[TENSION], tension, y, 0)
    index = _copy_numbers(group_flags[STRESS], stress, y, index)
    if group_flags[POSITION]:
        to_world(place, c.frame, y[index : index + 3 * m])
        for k in range(m):
            for i in range(3):
                y[index + 3 * k + i] += c.frame[i]
        index += 3 * m
    index = _copy_vectors(group_flags[FORCE], means[:, column.JOINT : column.JOINT + 3], c.frame, y, index)
    index = _copy_vectors(group_flags[GROUND], means[:n, column.GROUND : column.GROUND + 3], c.frame, y, index)
    index = _copy_vectors(group_flags[WHEELS], means[:n, column.WHEELS : column.WHEELS + 3], c.frame, y, index)
    index = _copy_vectors(group_flags[SLIDING], means[:n, column.SLIDING : column.SLIDING + 3], c.frame, y, index)
    if group_flags[DEPTH]:
        index = _copy_numbers(1, means[:n, column.DEPTH], y, index)
    index = _copy_vectors(group_flags[TEETH], means[:, column.TEETH : column.TEETH + 3], c.frame, y, index)
    index = _copy_vectors(group_flags[RIMS], means[:n, column.RIMS : column.RIMS + 3], c.frame, y, index)
    index = _copy_vectors(group_flags[HORNS], means[:n, column.HORNS : column.HORNS + 3], c.frame, y, index)
    index = _copy_vectors(group_flags[MOMENT], means[:, column.MOMENT : column.MOMENT + 3], c.frame, y, index)
    _write_extra_groups(c.extra, c, y, index)


@allocating
def _write_extra_groups(extra: int | None, c: LinkOutputData, y: Floats, index: int) -> None:
    """Write the groups with kernels of their own, which are not compiled where no such group is shown."""
    if extra is not None:
        axis, fibre_stress, ends = c.arrays.place, c.arrays.fibres, c.arrays.ends
        pin_axes(c.link, c.s, c.work, axis)
        index = _copy_vectors(c.group_flags[AXIS], axis, c.frame, y, index)
        if c.group_flags[FIBRES]:
            fibres(c.link, c.s, c.work, fibre_stress)
            index = _copy_numbers(1, fibre_stress.ravel(), y, index)
        if c.group_flags[SLOPES]:
            slopes(c.link, c.s, c.work, ends)
            for i in range(2 * c.links):
                index = _copy_vectors(1, ends[i // 2 : i // 2 + 1, i % 2 * 3 :][:, :3], c.frame, y, index)
        if c.group_flags[TURNED]:
            index = _copy_numbers(1, c.s.turned[:, 0], y, index)
        if c.group_flags[RUBBED]:
            _copy_numbers(1, c.s.turned[:, 1], y, index)


@kernel
def _copy_numbers(flag: int, a: Floats, y: Floats, index: int) -> int:
    """Copy the array ``a``, if ``flag``, to ``y[index:]``; return the index after it."""
    if flag:
        for i in range(a.shape[0]):
            y[index + i] = a[i]
        index += a.shape[0]
    return index


@kernel
def _copy_vectors(flag: int, a: Floats, frame: Floats, y: Floats, index: int) -> int:
    """Copy vectors (k, 3) in the track's frame to ``y[index:]`` in world axes, as ``_copy_numbers`` does."""
    if flag:
        to_world(a, frame, y[index : index + 3 * a.shape[0]])
        index += 3 * a.shape[0]
    return index
