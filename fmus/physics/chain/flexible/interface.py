"""Interface of a kind of flexible link: functions chosen by the class of ``links``; see ``jit.dispatch``.

Groups: ``elements`` (``cables``, ``planar``, ``turning``, ``constrained``, ``beams``); ``axes``, of the coordinates,
which turn with the chain (``free_axes``) or, by default, are those of the track's start; ``joints``, pin equations with
multipliers (``constrained``), or by default none, for links that share the coordinates of their pins.

``w`` has one link: ``w.coordinates``, ``w.rates``, ``w.accelerations`` (rows, axes) and ``w.iteration_matrix``. The
coordinates of the pins are ``q`` (nodes, width). Positions are in m, gradients without a unit. The axes are in the
motion as ``x.axes`` (``axes_state``), empty if fixed.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

from fmus.kernels.jit import dispatch, kernel
from fmus.physics import block_cyclic
from fmus.physics.ancf.element import axis_count, vector_count
from fmus.physics.arrays import Floats, Vector
from fmus.physics.chain.flexible import inertia
from fmus.physics.chain.wheel_frame import chain_speed

if TYPE_CHECKING:
    from fmus.physics.ancf.element import Element
    from fmus.physics.chain.bushing import Bushing
    from fmus.physics.chain.flexible.closing import ClosingSpring
    from fmus.physics.chain.flexible.link_layout import LinkLayout
    from fmus.physics.chain.flexible.state import Motion, State, Work
    from fmus.physics.chain.implicit import ImplicitMethod
    from fmus.physics.chain.state import WheelFrame
    from fmus.physics.integrate.generalized_alpha import Slopes


# the stubs of ``dispatch`` have no bodies
# mypy: disable-error-code="empty-body"


if TYPE_CHECKING:

    class FlexibleLinks(Protocol):
        """Parameters of a chain of equal links of any element."""

        @property
        def n(self) -> int:
            """Number of links."""

        @property
        def closed(self) -> int:
            """1: a closed mesh, 0: an open one."""

        @property
        def element(self) -> Element:
            """Parameters of an element."""

        @property
        def closing(self) -> ClosingSpring | None:
            """Spring of a loop whose mesh is open."""

        @property
        def bushing(self) -> Bushing | None:
            """Bush of each pin between two links."""


@dispatch("elements")
def gather(links: FlexibleLinks, q: Floats, i: int, j: int, e: Floats) -> None:
    """Element coordinates ``e`` (rows, axes) of the link from pin ``i`` to pin ``j``."""


@dispatch("elements", shared=True)
def axial(links: FlexibleLinks, w: Work) -> tuple[float, float]:
    """Tension, N, and largest axial stress, Pa, of the link in ``w``."""


@dispatch("elements", shared=True)
def outer_and_inner(links: FlexibleLinks, w: Work) -> tuple[float, float]:
    """Axial stress at the outer and at the inner fibre of the link in ``w.coordinates``, Pa, mean along it."""


@dispatch("elements")
def pin_axis(links: FlexibleLinks, q: Floats) -> Vector:
    """Unit vector along the pin with the coordinates ``q`` (width)."""


@dispatch("elements", default=True)
def flatten(links: FlexibleLinks, w: Work) -> None:
    """Wheels ``w.wheels`` (m, 15) as seen by the chain, into ``w.flat`` (m, 15)."""


@dispatch("elements")
def layout(links: FlexibleLinks) -> LinkLayout:
    """Layout of a link's coordinates."""


@dispatch("elements")
def lever(links: FlexibleLinks) -> tuple[float, ...]:
    """Motion of the pin per unit of each shared coordinate, m: the weight of a correction."""


@kernel
def in_space(links: FlexibleLinks, a: Floats) -> Vector:
    """Vector in space of the first components of ``a`` (axes or more); in a plane y is 0."""
    return (a[0], a[1], a[2]) if axis_count(links.element) == 3 else (a[0], 0.0, a[1])


@dispatch("axes", default=True)
def wheels_to_axes(links: FlexibleLinks, x: Motion, w: Work, tangent: bool) -> None:
    """Prepare an evaluation: the wheels ``w.wheels`` relative to the axes into ``w.flat``; zero the border."""
    flatten(links, w)


@dispatch("axes", default=True)
def wrenches_from_axes(links: FlexibleLinks, x: Motion, w: Work) -> None:
    """Transform the wrenches on the wheels from the axes to the frame of the start, after the contacts."""


@dispatch("axes", default=True)
def inertia_and_weight(links: FlexibleLinks, x: Motion, w: Work, weight: Vector, r: Floats) -> None:
    """Write inertia forces less ``weight``, N, of the link to its residual ``r`` (rows, axes), N and N m."""
    inertia.inertia(links.element, w.mass, w.accelerations, r)
    inertia.weigh(weight, links.element.l, vector_count(links.element) // 2, axis_count(links.element), r)


@dispatch("elements", default=True)
def add_lateral_bending(links: FlexibleLinks, w: Work, r: Floats, tangent: bool) -> None:
    """Add the link's bending about its normal, as far as the element lacks it.

    It goes to the residual ``r`` (rows, axes), N and N m, and with ``tangent`` to ``w.iteration_matrix``.
    """


@dispatch("axes", default=True)
def couple_inertia(links: FlexibleLinks, w: Work, by_acceleration: float) -> None:
    """Write what couples the link's inertia with the rotation of the axes into ``w.iteration_matrix``.

    ``by_acceleration``, 1/s2, is d acceleration / d position; 1 makes the matrix a mass.
    """


@dispatch("axes", default=True)
def assemble_border(links: FlexibleLinks, w: Work, i: int, j: int) -> None:
    """Add the condensed coupling of the pins ``i``, ``j`` with the rotation of the axes to the border."""


@dispatch("axes", default=True)
def predict_axes(links: FlexibleLinks, method: ImplicitMethod, h: float, s: State, w: Work) -> None:
    """Predict the axes at the end of a step of ``h`` s."""


@dispatch("axes", default=True)
def solve_pins(links: FlexibleLinks, w: Work, fresh: bool) -> None:
    """Solve for the pins, ``w.right_side``; with ``fresh`` factors also for their response to the axes' rotation."""
    solve(links, w)


@dispatch("axes", default=True)
def correct_axes(links: FlexibleLinks, x: Motion, w: Work, by: Slopes) -> float:
    """Take the Newton step of the axes and correct the solutions of pins and links for it.

    Returns the size of the step, m.
    """
    return 0.0


@dispatch("axes", default=True)
def motion_with_axes(links: FlexibleLinks, w: Work, p: Vector) -> Vector:
    """Motion of a point at ``p``, m, by the rotation of the axes in their last Newton step, m."""
    return 0.0, 0.0, 0.0


@dispatch("axes", default=True)
def finish_axes(links: FlexibleLinks, method: ImplicitMethod, s: State, w: Work) -> None:
    """Update the axes at the end of a converged step."""


@dispatch("axes", default=True)
def accelerate_origin(links: FlexibleLinks, x: Motion, w: Work) -> None:
    """Acceleration of the axes' origin before an explicit evaluation; zero their angular acceleration."""


@dispatch("axes", default=True)
def solve_accelerations(links: FlexibleLinks, x: Motion, w: Work) -> None:
    """Accelerations of pins, axes and links after an evaluation with the mass factored."""
    solve_pins(links, w, False)


@dispatch("axes", default=True)
def axes_rates(links: FlexibleLinks, x: State, k: Floats, first: int) -> None:
    """Time derivative of the axes into ``k`` (flat) from index ``first`` on."""


@dispatch("axes", default=True)
def orthogonalise(links: FlexibleLinks, s: State) -> None:
    """Orthogonalise the axes after an explicit step."""


@dispatch("elements", default=True)
def lateral_bending_frequency(links: FlexibleLinks) -> float:
    """Highest frequency of the chain in lateral bending, rad/s; not for kernels."""
    return 0.0


@dispatch("axes", default=True)
def absolute_rates(links: FlexibleLinks, x: State, w: Work) -> None:
    """Convert the rates ``w.rates`` of the link to those relative to the ground."""


@dispatch("axes", default=True)
def absolute_accelerations(links: FlexibleLinks, s: State, w: Work, i: int, j: int) -> None:
    """Accelerations of the link between pins ``i`` and ``j`` relative to the ground into ``w.accelerations``.

    They are components along the axes.
    """
    gather(links, s.vdot, i, j, w.accelerations)


@dispatch("axes", default=True)
def omitted_accelerations(links: FlexibleLinks, s: State, w: Work, i: int, j: int) -> None:
    """Part of ``absolute_accelerations`` that an evaluation without accelerations leaves out."""
    gather(links, s.vdot, i, j, w.accelerations)


@dispatch("axes", default=True)
def along_axes(links: FlexibleLinks, s: State, v: Vector) -> Vector:
    """Components along the axes of the vector ``v`` in the frame of the start; of two axes the first two."""
    return v if axis_count(links.element) == 3 else (v[0], v[2], 0.0)


@dispatch("axes", default=True)
def centre_of_mass(links: FlexibleLinks, x: State, w: Work) -> Vector:
    """Centre of mass of the link in the frame of the start, m."""
    last, l, e = vector_count(links.element) // 2, links.element.l, w.coordinates
    first, second = inertia.centre(l, last, 0, e), inertia.centre(l, last, 1, e)
    return (first, second, inertia.centre(l, last, 2, e)) if axis_count(links.element) == 3 else (first, 0.0, second)


@dispatch("axes", default=True)
def start_frame_position(links: FlexibleLinks, s: State, p: Vector) -> Vector:
    """Position in the frame of the start of the position ``p`` along the axes, m."""
    return p


@dispatch("axes", default=True)
def start_frame_vector(links: FlexibleLinks, s: State, v: Vector) -> Vector:
    """Components in the frame of the start of the vector ``v`` along the axes."""
    return v


@dispatch("elements", default=True)
def lateral_bending_energy(links: FlexibleLinks, w: Work) -> float:
    """Strain energy of the lateral bending, J."""
    return 0.0


@dispatch("axes", default=True)
def rotary_energy(links: FlexibleLinks, x: State) -> float:
    """Kinetic energy of the links' mass beside their centrelines, J."""
    return 0.0


@dispatch("joints", default=True)
def factor(links: FlexibleLinks, w: Work) -> int:
    """Factor the pins' matrix ``w.diagonal``, ``w.upper``, ``w.lower``; -1, or the pin or link where it is singular."""
    return block_cyclic.factor(w.diagonal, w.upper, w.lower, w.factors, links.closed == 1)


@dispatch("joints", default=True)
def solve(links: FlexibleLinks, w: Work) -> None:
    """Solve for the correction of the pins in ``w.right_side``, from residuals there and the gap of ``residual``."""
    block_cyclic.solve(w.diagonal, w.upper, w.factors, links.closed == 1, w.right_side)


@dispatch("joints", default=True)
def residual(links: FlexibleLinks, q: Floats, w: Work) -> None:
    """Misfit of the pin equations by the coordinates, rates or accelerations ``q`` (nodes, width)."""


@dispatch("joints", default=True)
def project(links: FlexibleLinks, s: State, w: Work) -> None:
    """Project coordinates and rates onto the pin equations, in the directions of the pin forces."""


@dispatch("joints", default=True)
def pin_speed(links: FlexibleLinks, frame: WheelFrame, s: State, w: Work) -> float:
    """``chain_speed``, m/s, of the pins relative to the ``frame``, each pin counted once."""
    n, pins = axis_count(links.element), links.n if links.closed == 1 else links.n + 1
    return chain_speed(s.q[:pins, :n], s.v[:pins, :n], links.closed == 1, frame)
