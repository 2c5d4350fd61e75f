"""Flexible links for integrators: implicit step, accelerations, outputs; sibling: ``rigid.dynamics``.

Implicit step of a chain of flexible links: Newton's iteration on the condensed pin equations.

Accelerations of a chain of flexible links, with a constant mass matrix that is factored once.

Where the axes of the coordinates turn, it has a border for their accelerations, computed at each evaluation.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from fmus.kernels.jit import allocating, kernel, namesake, noalias
from fmus.physics.ancf.element import highest_frequency, vector_count
from fmus.physics.arrays import Floats, Integers
from fmus.physics.chain.flexible import pins
from fmus.physics.chain.flexible.assembly import axials, evaluate, totals
from fmus.physics.chain.flexible.closing import square_of_frequency
from fmus.physics.chain.flexible.condensation import correct
from fmus.physics.chain.flexible.interface import (
    accelerate_origin,
    axes_rates,
    correct_axes,
    factor,
    finish_axes,
    gather,
    in_space,
    lateral_bending_frequency,
    layout,
    orthogonalise,
    outer_and_inner,
    pin_axis,
    pin_speed,
    predict_axes,
    residual,
    solve_accelerations,
    solve_pins,
    start_frame_position,
    start_frame_vector,
)
from fmus.physics.chain.flexible.interface import project as project_joints
from fmus.physics.chain.flexible.link_layout import ends, node
from fmus.physics.chain.flexible.pins import newton_joints  # noqa: F401 - reached by dispatch
from fmus.physics.chain.flexible.state import Motion
from fmus.physics.chain.implicit import CHORD, FASTEST, MAX_ITERATIONS, REUSE, SLOW
from fmus.physics.chain.integration import CROWDED, DONE, PULLED, SINGULAR, STALLED
from fmus.physics.chain.interface import add_last_correction
from fmus.physics.chain.report import EVALUATIONS, ITERATIONS, SPEED, write
from fmus.physics.chain.state import copy_rows
from fmus.physics.chain.wheel_frame import wheel_frame
from fmus.physics.elementary import hypot
from fmus.physics.integrate import generalized_alpha
from fmus.physics.integrate.generalized_alpha import Slopes, auxiliary
from fmus.physics.point import sharpen, too_many
from fmus.physics.vector import put

if TYPE_CHECKING:
    from fmus.physics.chain.contacts import Contacts
    from fmus.physics.chain.flexible.interface import FlexibleLinks
    from fmus.physics.chain.flexible.state import State, Work
    from fmus.physics.chain.implicit import ImplicitMethod
    from fmus.physics.chain.integration import Environment


@allocating
@noalias
def newton(
    links: FlexibleLinks,
    contacts: Contacts | None,
    env: Environment,
    method: ImplicitMethod,
    h: float,
    s: State,
    w: Work,
    counters: Integers,
) -> tuple[int, int, float]:
    """Newton's iteration; arguments and result as of ``interface.newton``."""
    c, by, before, x = (
        method.alpha,
        generalized_alpha.slopes(method.alpha, h),
        w.before,
        Motion(s.q, s.v, s.vdot, s.axes),
    )
    for i in range(s.q.shape[0]):
        for k in range(s.q.shape[1]):
            a0 = before.a[i, k]
            a1 = auxiliary(c, a0, before.vdot[i, k], before.vdot[i, k])
            s.q[i, k] += h * before.v[i, k] + h * h * ((0.5 - c.beta) * a0 + c.beta * a1)
            s.v[i, k] += h * ((1.0 - c.gamma) * a0 + c.gamma * a1)
    predict_axes(links, method, h, s, w)
    size, last, worst, where = np.inf, np.inf, 0.0, 0
    sharp = w.contact.sharp
    sharp[0] = 0
    for _ in range(MAX_ITERATIONS):
        fresh = size > CHORD or size > REUSE * last or sharp[0] == 1  # near the solution the last matrix is reused
        if contacts is not None:  # noqa: SIM102 - numba leaves out the whole branch
            if fresh:
                copy_rows(x.q, w.points.q)
        worst, where = evaluate(links, contacts, env, x, by, w, fresh)
        counters[EVALUATIONS] += 1
        if contacts is not None:  # noqa: SIM102 - numba leaves out the whole branch
            if too_many(w.points.number, w.points.which):
                return CROWDED, where, w.points.number[0]
        if fresh and factor(links, w) >= 0:
            return SINGULAR, where, worst
        residual(links, x.q, w)
        solve_pins(links, w, fresh)
        counters[ITERATIONS] += 1
        if contacts is not None:
            copy_rows(x.q, w.points.step)
        rotation_size = correct_axes(links, x, w, by)
        last, size = size, max(correct(links, w, x, by, 0.5 * links.element.l), rotation_size)
        if not size < FASTEST:
            break
        if size < method.tolerance:
            for i in range(s.q.shape[0]):
                for k in range(s.q.shape[1]):
                    s.a[i, k] = auxiliary(c, before.a[i, k], before.vdot[i, k], s.vdot[i, k])
            finish_axes(links, method, s, w)
            if contacts is not None:
                _finish_contacts(links, s, w)
            return DONE, where, worst
        if size > SLOW * last and fresh and not sharp[0]:
            sharpen(w.contact)
    return STALLED, where, worst


@kernel
def _finish_contacts(links: FlexibleLinks, s: State, w: Work) -> None:
    """Add to the contact forces what the last correction changes in them."""
    points = w.points
    for i in range(s.q.shape[0]):
        for k in range(s.q.shape[1]):
            points.step[i, k] = s.q[i, k] - points.step[i, k]
    add_last_correction(links, Motion(points.q, points.step, w.still, s.axes), w)


# step times highest frequency, within the stability region of the method for lightly damped modes
LIMIT = 2.4
NOTHING = Slopes(0.0, 0.0, 0.0)  # for evaluations without a matrix


def stable(links: FlexibleLinks) -> float:
    """Longest stable step of the explicit method, s, contacts apart."""
    fastest = max(highest_frequency(links.element), float(lateral_bending_frequency(links)))
    longest = LIMIT / hypot(fastest, float(np.sqrt(square_of_frequency(links.closing, links.element))))
    return float(f"{longest:.9g}")  # LAPACK's last digits differ by processor


@kernel
def accelerations(links: FlexibleLinks, contacts: Contacts | None, env: Environment, s: State, w: Work) -> None:
    """Accelerations (nodes, width) into ``w.change[0]``; ``w`` has the factored mass and the wheels."""
    change, x = w.change[0], Motion(s.q, s.v, w.still, s.axes)
    accelerate_origin(links, x, w)
    evaluate(links, contacts, env, x, NOTHING, w, False)
    change[:] = 0.0
    residual(links, change, w)
    solve_accelerations(links, x, w)
    correct(links, w, Motion(change, w.change[1], w.change[1], s.axes), NOTHING, np.inf)


@namesake
def derivative(links: FlexibleLinks, contacts: Contacts | None, env: Environment, s: State, w: Work, k: Floats) -> int:
    accelerations(links, contacts, env, s, w)
    n, width = s.q.size, s.q.shape[1]
    for i in range(s.q.shape[0]):
        for j in range(width):
            k[i * width + j] = s.v[i, j]
            k[n + i * width + j] = w.change[0, i, j]
    axes_rates(links, s, k, 2 * n)
    return -1


@namesake
def accelerate(links: FlexibleLinks, contacts: Contacts | None, env: Environment, s: State, w: Work) -> None:
    accelerations(links, contacts, env, s, w)
    copy_rows(w.change[0], s.vdot)


@namesake
def stage_joints(links: FlexibleLinks, env: Environment, s: State, w: Work) -> None:
    copy_rows(w.change[0], s.vdot)
    pins.stage_joints(links, env, s, w)


@namesake
def project(links: FlexibleLinks, s: State, w: Work) -> int:
    orthogonalise(links, s)
    project_joints(links, s, w)
    return -1


@namesake
def end_work(links: FlexibleLinks, env: Environment, h: float, s: State, w: Work) -> float:
    """By the displacements of the ends."""
    work, q, q0 = 0.0, s.q, w.before.q
    if env.ends == PULLED:
        for k in range(env.pull.shape[1]):
            work += env.pull[0, k] * (q[0, k] - q0[0, k]) + env.pull[1, k] * (q[-1, k] - q0[-1, k])
    return work


@namesake
def speed(links: FlexibleLinks, env: Environment, s: State, w: Work) -> float:
    return pin_speed(links, wheel_frame(w.flat, env.mount), s, w)


@namesake
def first_speed(links: FlexibleLinks, env: Environment, s: State, w: Work, report: Floats) -> float:
    """As reported, so relative to the wheel frame as it was extrapolated to the present time."""
    return report[SPEED]


@namesake
def observe(links: FlexibleLinks, env: Environment, s: State, w: Work, report: Floats) -> None:
    tension, energy = totals(links, env, s, w)
    write(report, w, s.mean, speed(links, env, s, w), wheel_frame(w.wheels, env.mount)[3], tension, energy)


@namesake
def pin_places(links: FlexibleLinks, s: State, w: Work, place: Floats) -> None:
    for i in range(place.shape[0]):
        node_index = node(layout(links), s.q.shape[0], i)
        put(place[i], 0, start_frame_position(links, s, in_space(links, s.q[node_index])))


@namesake
def pin_axes(links: FlexibleLinks, s: State, w: Work, axis: Floats) -> None:
    for i in range(axis.shape[0]):
        node_index = node(layout(links), s.q.shape[0], i)
        put(axis[i], 0, start_frame_vector(links, s, pin_axis(links, s.q[node_index])))


@namesake
def fibres(links: FlexibleLinks, s: State, w: Work, stress: Floats) -> None:
    for i in range(links.n):
        first, second = ends(layout(links), s.q.shape[0], i)
        gather(links, s.q, first, second, w.coordinates)
        stress[i, 0], stress[i, 1] = outer_and_inner(links, w)


@namesake
def slopes(links: FlexibleLinks, s: State, w: Work, slope: Floats) -> None:
    rows = vector_count(links.element)
    for i in range(links.n):
        first, second = ends(layout(links), s.q.shape[0], i)
        gather(links, s.q, first, second, w.coordinates)
        put(slope[i], 0, start_frame_vector(links, s, in_space(links, w.coordinates[1])))
        put(slope[i], 3, start_frame_vector(links, s, in_space(links, w.coordinates[rows // 2 + 1])))


@namesake
def observe_links(
    links: FlexibleLinks, env: Environment, s: State, w: Work, tension: Floats, stress: Floats, place: Floats
) -> None:
    axials(links, s, w, tension, stress)
    pin_places(links, s, w, place)
