"""Dispatch from the integrators to the kinds of links by the class of ``links``.

The modules are ``flexible.dynamics``, ``flexible.cholesky``, ``rigid.dynamics`` and ``rigid.jointed``. Arguments:
``links``, parameters; ``contacts``, the partners or None; ``env``, an Environment; ``s``, the State; ``w``, the Work;
``report`` (REPORT) and ``counters`` (COUNTERS) of ``report``. Frame: that of the start of the track.
"""

# a stub has no body, also where it returns a number
# mypy: disable-error-code="empty-body"
from __future__ import annotations

from typing import TYPE_CHECKING

from fmus.jit import dispatch, implementation
from fmus.physics.arrays import Floats, Integers

if TYPE_CHECKING:
    from fmus.physics.chain.environment import Environment
    from fmus.physics.chain.implicit import ImplicitMethod
    from fmus.physics.chain.protocols import ChainState, ChainWork, Contacts, Links

_of = implementation("dynamics")


@dispatch(_of, shared=True)
def newton(
    links: Links,
    contacts: Contacts | None,
    env: Environment,
    method: ImplicitMethod,
    h: float,
    s: ChainState,
    w: ChainWork,
    counters: Integers,
) -> tuple[int, int, float]:
    """Do one step of ``h`` s by the implicit ``method``, from ``s`` = ``w.before``, wheels at ``w.wheels``.

    Returns DONE or the failure, the link and its residual, N; after a failure ``s`` is invalid.
    """


@dispatch(_of, shared=True)
def derivative(
    links: Links, contacts: Contacts | None, env: Environment, s: ChainState, w: ChainWork, k: Floats
) -> int:
    """Time derivative of ``state.integrated_views`` into ``k`` (flat), with the wheels at ``w.wheels``.

    Returns -1, or the link where it failed.
    """


@dispatch(_of, shared=True)
def project(links: Links, s: ChainState, w: ChainWork) -> int:
    """Project the state onto the pin equations after an explicit step.

    Returns -1, or the pin that stays open.
    """


@dispatch(_of, shared=True)
def accelerate(links: Links, contacts: Contacts | None, env: Environment, s: ChainState, w: ChainWork) -> None:
    """Accelerations of the state after an explicit step; rigid links keep those of the last stage."""


@dispatch(_of, shared=True)
def newton_joints(links: Links, env: Environment, s: ChainState, w: ChainWork) -> None:
    """Force of each pin on the link that begins there, N, into ``w.on_links``, after an implicit step.

    Skipped if no such columns exist. With the other forces on a link it gives the link's acceleration, to rounding.
    """


@dispatch(_of, shared=True)
def stage_joints(links: Links, env: Environment, s: ChainState, w: ChainWork) -> None:
    """Same as ``newton_joints``, after ``derivative``."""


@dispatch(_of, shared=True)
def end_work(links: Links, env: Environment, h: float, s: ChainState, w: ChainWork) -> float:
    """Work of the end loads in an implicit step of ``h`` s from ``w.before``, J."""


@dispatch(_of, shared=True)
def speed(links: Links, env: Environment, s: ChainState, w: ChainWork) -> float:
    """Speed of the chain along itself relative to the carrier of the wheels ``w.wheels``, m/s."""


@dispatch(_of, shared=True)
def first_speed(links: Links, env: Environment, s: ChainState, w: ChainWork, report: Floats) -> float:
    """``speed`` at the start of a communication step, with the wheels ``w.wheels`` of that time, m/s."""


@dispatch(_of, shared=True)
def observe(links: Links, env: Environment, s: ChainState, w: ChainWork, report: Floats) -> None:
    """Fill the report from the state and its last evaluation, except the summed entries."""


@dispatch(_of, shared=True)
def pin_places(links: Links, s: ChainState, w: ChainWork, place: Floats) -> None:
    """Positions of the pins, m, into ``place`` (nodes, 3), in the frame of the start."""


@dispatch(_of, shared=True)
def observe_links(
    links: Links, env: Environment, s: ChainState, w: ChainWork, tension: Floats, stress: Floats, place: Floats
) -> None:
    """Tension, N, and stress, Pa, of each link (n each); positions of the pins ``place`` (nodes, 3), m."""


@dispatch(_of, shared=True)
def pin_axes(links: Links, s: ChainState, w: ChainWork, axis: Floats) -> None:
    """Unit vectors along the pins into ``axis`` (nodes, 3)."""


@dispatch(_of, shared=True)
def slopes(links: Links, s: ChainState, w: ChainWork, slope: Floats) -> None:
    """Position gradients along each link at its first and its last pin into ``slope`` (n, 6).

    For rigid links both are the unit vector along the link.
    """


@dispatch(_of, shared=True)
def fibres(links: Links, s: ChainState, w: ChainWork, stress: Floats) -> None:
    """Axial stress at outer and inner fibre of each link, Pa, mean along it, into ``stress`` (n, 2)."""
