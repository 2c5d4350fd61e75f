"""Flexible links for ``kinds``; sibling: ``rigid.dynamics``."""

from __future__ import annotations

from typing import TYPE_CHECKING

from fmus.jit import kernel
from fmus.physics.ancf.element import vector_count
from fmus.physics.arrays import Floats
from fmus.physics.chain.carrier import carrier
from fmus.physics.chain.environment import PULLED
from fmus.physics.chain.flexible import joints
from fmus.physics.chain.flexible.assembly import axials, totals
from fmus.physics.chain.flexible.axes import start_frame_position, start_frame_vector
from fmus.physics.chain.flexible.elements import gather, in_space, layout, outer_and_inner, pin_axis
from fmus.physics.chain.flexible.explicit import accelerate, derivative, project, stage_joints  # noqa: F401
from fmus.physics.chain.flexible.link_layout import ends, node
from fmus.physics.chain.flexible.newton import newton  # noqa: F401 - reached by dispatch
from fmus.physics.chain.flexible.pin_forces import newton_joints  # noqa: F401 - reached by dispatch
from fmus.physics.chain.report import SPEED, write
from fmus.physics.vector import put

if TYPE_CHECKING:
    from fmus.physics.chain.environment import Environment
    from fmus.physics.chain.flexible.elements import FlexibleLinks
    from fmus.physics.chain.flexible.state import State
    from fmus.physics.chain.flexible.work import Work


@kernel
def end_work(links: FlexibleLinks, env: Environment, h: float, s: State, w: Work) -> float:
    """See ``kinds``; by the displacements of the ends."""
    work, q, q0 = 0.0, s.q, w.before.q
    if env.ends == PULLED:
        for k in range(env.pull.shape[1]):
            work += env.pull[0, k] * (q[0, k] - q0[0, k]) + env.pull[1, k] * (q[-1, k] - q0[-1, k])
    return work


@kernel
def speed(links: FlexibleLinks, env: Environment, s: State, w: Work) -> float:
    """See ``kinds``."""
    return joints.speed(links, carrier(w.flat, env.mount), s, w)


@kernel
def first_speed(links: FlexibleLinks, env: Environment, s: State, w: Work, report: Floats) -> float:
    """See ``kinds``; as reported, so relative to the carrier as it was extrapolated to the present time."""
    return report[SPEED]


@kernel
def observe(links: FlexibleLinks, env: Environment, s: State, w: Work, report: Floats) -> None:
    """See ``kinds``."""
    tension, energy = totals(links, env, s, w)
    write(report, w, s.mean, speed(links, env, s, w), carrier(w.wheels, env.mount)[3], tension, energy)


@kernel
def pin_places(links: FlexibleLinks, s: State, w: Work, place: Floats) -> None:
    """See ``kinds``."""
    for i in range(place.shape[0]):
        node_index = node(layout(links), s.q.shape[0], i)
        put(place[i], 0, start_frame_position(links, s, in_space(links, s.q[node_index])))


@kernel
def pin_axes(links: FlexibleLinks, s: State, w: Work, axis: Floats) -> None:
    """See ``kinds``."""
    for i in range(axis.shape[0]):
        node_index = node(layout(links), s.q.shape[0], i)
        put(axis[i], 0, start_frame_vector(links, s, pin_axis(links, s.q[node_index])))


@kernel
def fibres(links: FlexibleLinks, s: State, w: Work, stress: Floats) -> None:
    """See ``kinds``."""
    for i in range(links.n):
        first, second = ends(layout(links), s.q.shape[0], i)
        gather(links, s.q, first, second, w.e)
        stress[i, 0], stress[i, 1] = outer_and_inner(links, w)


@kernel
def slopes(links: FlexibleLinks, s: State, w: Work, slope: Floats) -> None:
    """See ``kinds``."""
    rows = vector_count(links.element)
    for i in range(links.n):
        first, second = ends(layout(links), s.q.shape[0], i)
        gather(links, s.q, first, second, w.e)
        put(slope[i], 0, start_frame_vector(links, s, in_space(links, w.e[1])))
        put(slope[i], 3, start_frame_vector(links, s, in_space(links, w.e[rows // 2 + 1])))


@kernel
def observe_links(
    links: FlexibleLinks, env: Environment, s: State, w: Work, tension: Floats, stress: Floats, place: Floats
) -> None:
    """See ``kinds``."""
    axials(links, s, w, tension, stress)
    pin_places(links, s, w, place)
