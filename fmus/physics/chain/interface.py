"""Interface of a kind of link: functions for integrators and contacts, chosen by the class of ``links``.

Groups: ``dynamics``, for integrators (``flexible.dynamics``, ``flexible.cholesky``, ``rigid.dynamics``,
``rigid.jointed``); for rolling contact ``bodies``, links and pins (``flexible.node_faces``, ``rigid.faces``), and
``faces``, points on them (``flexible.cable_faces``, ``turning_faces``, ``beam_faces``, ``rigid.faces``); ``guides``, of
links that can leave their plane. Where ``contacts`` is None numba drops the calls of contacts, and no module of contact
is imported.

Arguments: ``links``, parameters; ``contacts``, the partners or None; ``env``, an Environment; ``s``, the State; ``x``,
the chain's motion; ``w``, its Work; ``report`` (REPORT) and ``counters`` (COUNTERS) of ``report``; ``i``, a link or
pin; ``k``, a wheel, ``row`` its motion, ``rows`` (m, 15) that of all. The matrix of a ``force`` counts only with
``tangent``; ``by_rate``, 1/s, is d velocity / d position. Positions in m, velocities in m/s, ``y`` and ``z`` in m, in
the frame of the start, on faces in the layout of their module.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from fmus.kernels.jit import dispatch
from fmus.physics.arrays import Floats, Integers, Vector

if TYPE_CHECKING:
    from fmus.physics.chain.contacts import ContactPoint, Contacts
    from fmus.physics.chain.implicit import ImplicitMethod
    from fmus.physics.chain.integration import Environment
    from fmus.physics.chain.near import WheelAndLink
    from fmus.physics.chain.state import ChainState, ChainWork, FacedLinks, Links, Motion, Section
    from fmus.physics.contact.face import ContactForce, Sinking


# a stub has no body, also where it returns a number
# mypy: disable-error-code="empty-body"


@dispatch("dynamics", shared=True)
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


@dispatch("dynamics", shared=True)
def derivative(
    links: Links, contacts: Contacts | None, env: Environment, s: ChainState, w: ChainWork, k: Floats
) -> int:
    """Time derivative of ``state.integrated_views`` into ``k`` (flat), with the wheels at ``w.wheels``.

    Returns -1, or the link where it failed.
    """


@dispatch("dynamics", shared=True)
def project(links: Links, s: ChainState, w: ChainWork) -> int:
    """Project the state onto the pin equations after an explicit step.

    Returns -1, or the pin that stays open.
    """


@dispatch("dynamics", shared=True, default=True)
def accelerate(links: Links, contacts: Contacts | None, env: Environment, s: ChainState, w: ChainWork) -> None:
    """Accelerations of the state after an explicit step; rigid links keep those of the last stage."""


@dispatch("dynamics", shared=True)
def newton_joints(links: Links, env: Environment, s: ChainState, w: ChainWork) -> None:
    """Force of each pin on the link that begins there, N, into ``w.on_links``, after an implicit step.

    Skipped if no such columns exist. With the other forces on a link it gives the link's acceleration, to rounding.
    """


@dispatch("dynamics", shared=True)
def stage_joints(links: Links, env: Environment, s: ChainState, w: ChainWork) -> None:
    """Same as ``newton_joints``, after ``derivative``."""


@dispatch("dynamics", shared=True)
def end_work(links: Links, env: Environment, h: float, s: ChainState, w: ChainWork) -> float:
    """Work of the end loads in an implicit step of ``h`` s from ``w.before``, J."""


@dispatch("dynamics", shared=True)
def speed(links: Links, env: Environment, s: ChainState, w: ChainWork) -> float:
    """Speed of the chain along itself relative to the frame of the wheels ``w.wheels``, m/s."""


@dispatch("dynamics", shared=True)
def first_speed(links: Links, env: Environment, s: ChainState, w: ChainWork, report: Floats) -> float:
    """``speed`` at the start of a communication step, with the wheels ``w.wheels`` of that time, m/s."""


@dispatch("dynamics", shared=True)
def observe(links: Links, env: Environment, s: ChainState, w: ChainWork, report: Floats) -> None:
    """Fill the report from the state and its last evaluation, except the summed entries."""


@dispatch("dynamics", shared=True)
def pin_places(links: Links, s: ChainState, w: ChainWork, place: Floats) -> None:
    """Positions of the pins, m, into ``place`` (nodes, 3), in the frame of the start."""


@dispatch("dynamics", shared=True)
def observe_links(
    links: Links, env: Environment, s: ChainState, w: ChainWork, tension: Floats, stress: Floats, place: Floats
) -> None:
    """Tension, N, and stress, Pa, of each link (n each); positions of the pins ``place`` (nodes, 3), m."""


@dispatch("dynamics", shared=True)
def pin_axes(links: Links, s: ChainState, w: ChainWork, axis: Floats) -> None:
    """Unit vectors along the pins into ``axis`` (nodes, 3)."""


@dispatch("dynamics", shared=True)
def slopes(links: Links, s: ChainState, w: ChainWork, slope: Floats) -> None:
    """Position gradients along each link at its first and its last pin into ``slope`` (n, 6).

    For rigid links both are the unit vector along the link.
    """


@dispatch("dynamics", shared=True)
def fibres(links: Links, s: ChainState, w: ChainWork, stress: Floats) -> None:
    """Axial stress at outer and inner fibre of each link, Pa, mean along it, into ``stress`` (n, 2)."""


def _rolling(links: type) -> Any:
    from fmus.physics.chain import rolling

    return rolling


@dispatch(_rolling)
def evaluate_contacts(
    links: FacedLinks, contacts: Contacts, x: Motion, w: ChainWork, rows: Floats, by_rate: float, tangent: bool
) -> None:
    """Evaluate all contacts of a chain with the wheels ``rows`` (m, 15) and the ground.

    ``x``: motion of the chain. Residuals, reactions, energies and powers, with ``tangent`` also iteration matrices, go
    to the arrays ``w``; ``by_rate``, 1/s, is d velocity / d position.
    """


@dispatch(_rolling)
def commit_contacts(links: FacedLinks, contacts: Contacts, s: ChainState, w: ChainWork, report: Floats) -> None:
    """Let the ground remember an accepted step, whose last evaluation is in ``w``; its losses go to the ``report``."""


@dispatch("bodies")
def add_last_correction(links: FacedLinks, x: Motion, w: ChainWork) -> None:
    """Add the change of all contact forces to wrenches, forces on links, and loads on links and pins.

    ``x``: coordinates at the last matrix, with the correction as their rates.
    """


@dispatch("guides", default=True)
def evaluate_guides(
    links: FacedLinks, contacts: Contacts, x: Motion, w: ChainWork, rows: Floats, by_rate: float, tangent: bool
) -> None:
    """Contact of the guide horns of all links with the discs of sprockets."""


@dispatch("guides", default=True)
def horn_height(links: FacedLinks) -> float:
    """Height of a guide horn over the inner face, m; 0 without guides."""
    return 0.0


@dispatch("guides", default=True)
def evaluate_horn(
    links: FacedLinks, contacts: Contacts, x: Motion, w: ChainWork, pair: WheelAndLink, by_rate: float, tangent: bool
) -> None:
    """Contact of the guide horn of a link with the disc of a wheel near it, the ``pair``."""


@dispatch("bodies")
def count(links: FacedLinks, x: Motion) -> tuple[int, int]:
    """Number of links and number of pins."""


@dispatch("faces")
def lateral_points(links: FacedLinks) -> tuple[int, float]:
    """Number of contact points side by side across a link, and their distance from its middle, m."""


@dispatch("bodies")
def length(links: FacedLinks) -> float:
    """Length of a link, m."""


@dispatch("faces")
def depth_below_pins(links: FacedLinks, x: Motion, i: int) -> float:
    """Largest depth of link ``i`` below the lower of its pins, m."""


@dispatch("bodies")
def pin_positions(links: FacedLinks, x: Motion, w: ChainWork, i: int) -> tuple[Vector, Vector]:
    """Positions of the first and of the last pin of link ``i``."""


@dispatch("bodies")
def pin_velocities(links: FacedLinks, x: Motion, w: ChainWork, i: int) -> tuple[Vector, Vector]:
    """Velocities of the first and of the last pin of link ``i``."""


@dispatch("faces", default=True)
def to_ground(links: FacedLinks, x: Motion, w: ChainWork, p: Vector, v: Vector) -> tuple[Vector, Vector]:
    """Position and velocity of a point in the frame of the start, which is that of the ground."""
    return p, v


@dispatch("faces", default=True)
def from_ground(links: FacedLinks, x: Motion, w: ChainWork, force: ContactForce, tangent: bool) -> ContactForce:
    """Convert a ``ContactForce`` of the ground to the axes of the chain's coordinates."""
    return force


@dispatch("bodies", default=True)
def begin_contacts(links: FacedLinks, x: Motion, w: ChainWork) -> None:
    """Prepare ``w`` for an evaluation of all contacts."""


@dispatch("bodies", default=True)
def begin_link(links: FacedLinks, x: Motion, w: ChainWork, i: int) -> None:
    """Prepare link ``i`` before contact points are located on it."""


@dispatch("faces")
def locate_section(links: FacedLinks, x: Motion, w: ChainWork, i: int, xi: float, z: float) -> Section:
    """Data for ``locate`` at the fraction ``xi`` along link ``i``, ``z`` m outside the pin line.

    Leaves data for the functions below in ``w``.
    """


@dispatch("faces")
def locate(links: FacedLinks, x: Motion, w: ChainWork, i: int, section: Section, y: float) -> tuple[Vector, Vector]:
    """Position and velocity of the point of the ``section``, ``y`` m across the link.

    Leaves data of this point for the functions below in ``w``.
    """


@dispatch("faces")
def position_slope(links: FacedLinks, x: Motion, w: ChainWork, i: int) -> Vector:
    """Change of the point's position with ``xi``, m, as a covered part moves along the link."""


@dispatch("faces")
def apply_force(links: FacedLinks, w: ChainWork, i: int, force: ContactForce, tangent: bool) -> None:
    """Apply a ``ContactForce`` at the located point of link ``i``."""


@dispatch("faces", default=True)
def finish_section(links: FacedLinks, w: ChainWork, i: int, tangent: bool) -> None:
    """Complete a section after all its points."""


@dispatch("faces")
def add_rate_matrix(links: FacedLinks, w: ChainWork, i: int, force: ContactForce, sinking: Sinking) -> None:
    """Add the matrix of the rate at which a face sinks into a rim."""


@dispatch("bodies")
def record_point(links: FacedLinks, w: ChainWork, point: ContactPoint, force: ContactForce, sinking: Sinking) -> None:
    """Record a ``point`` on which a ``force`` with a matrix acts, where an iteration ends before its forces do."""


@dispatch("faces")
def locate_pin(links: FacedLinks, x: Motion, w: ChainWork, i: int, y: float) -> tuple[Vector, Vector]:
    """Position and velocity of the point of pin ``i`` at ``y`` m across.

    Leaves data for ``apply_pin_force`` in ``w``.
    """


@dispatch("faces")
def apply_pin_force(
    links: FacedLinks, x: Motion, w: ChainWork, i: int, y: float, force: ContactForce, tangent: bool
) -> None:
    """Apply a ``ContactForce`` at that point to the pin, or to the links that it joins."""
