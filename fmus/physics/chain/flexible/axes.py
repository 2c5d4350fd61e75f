"""Dispatch to the axes of a chain's coordinates, fixed or turning, by the class of ``links``.

The modules are ``free_axes`` for axes that turn and ``fixed_axes`` for all others. The axes are in the motion as
``x.axes`` (``axes_state``), empty if fixed. Functions on one link use its coordinates ``w.e`` (rows, axes), rates
``w.v``, accelerations ``w.dv`` and matrix ``w.K``.
"""

# the stubs of ``dispatch`` have no bodies
# mypy: disable-error-code="empty-body"

from __future__ import annotations

from typing import TYPE_CHECKING

from fmus.jit import dispatch, implementation
from fmus.physics.arrays import Floats, Vector

if TYPE_CHECKING:
    from fmus.physics.chain.flexible.elements import FlexibleLinks
    from fmus.physics.chain.flexible.state import Motion, State
    from fmus.physics.chain.flexible.work import Work
    from fmus.physics.chain.implicit import ImplicitMethod
    from fmus.physics.integrate.generalized_alpha import Slopes

_of = implementation("axes")


@dispatch(_of)
def wheels_to_axes(links: FlexibleLinks, x: Motion, w: Work, tangent: bool) -> None:
    """Prepare an evaluation: the wheels ``w.wheels`` relative to the axes into ``w.flat``; zero the border."""


@dispatch(_of)
def wrenches_from_axes(links: FlexibleLinks, x: Motion, w: Work) -> None:
    """Transform the wrenches on the wheels from the axes to the frame of the start, after the contacts."""


@dispatch(_of)
def inertia_and_weight(links: FlexibleLinks, x: Motion, w: Work, weight: Vector, r: Floats) -> None:
    """Write inertia forces less ``weight``, N, of the link to its residual ``r`` (rows, axes), N and N m."""


@dispatch(_of)
def add_lateral_bending(links: FlexibleLinks, w: Work, r: Floats, tangent: bool) -> None:
    """Add the link's bending about its normal, as far as the element lacks it.

    It goes to the residual ``r`` (rows, axes), N and N m, and with ``tangent`` to ``w.K``.
    """


@dispatch(_of)
def couple_inertia(links: FlexibleLinks, w: Work, by_acceleration: float) -> None:
    """Write the rows and columns of ``w.K`` that couple the link's inertia with the rotation of the axes.

    ``by_acceleration``, 1/s2, is d acceleration / d position; 1 makes the matrix a mass.
    """


@dispatch(_of)
def assemble_border(links: FlexibleLinks, w: Work, i: int, j: int) -> None:
    """Add the condensed coupling of the pins ``i``, ``j`` with the rotation of the axes to the border."""


@dispatch(_of)
def predict_axes(links: FlexibleLinks, method: ImplicitMethod, h: float, s: State, w: Work) -> None:
    """Predict the axes at the end of a step of ``h`` s."""


@dispatch(_of)
def solve_pins(links: FlexibleLinks, w: Work, fresh: bool) -> None:
    """Solve for the pins, ``w.b``; with ``fresh`` factors also for their response to the axes' rotation."""


@dispatch(_of)
def correct_axes(links: FlexibleLinks, x: Motion, w: Work, by: Slopes) -> float:
    """Take the Newton step of the axes and correct the solutions of pins and links for it.

    Returns the size of the step, m.
    """


@dispatch(_of)
def motion_with_axes(links: FlexibleLinks, w: Work, p: Vector) -> Vector:
    """Motion of a point at ``p``, m, by the rotation of the axes in their last Newton step, m."""


@dispatch(_of)
def finish_axes(links: FlexibleLinks, method: ImplicitMethod, s: State, w: Work) -> None:
    """Update the axes at the end of a converged step."""


@dispatch(_of)
def accelerate_origin(links: FlexibleLinks, x: Motion, w: Work) -> None:
    """Acceleration of the axes' origin before an explicit evaluation; zero their angular acceleration."""


@dispatch(_of)
def solve_accelerations(links: FlexibleLinks, x: Motion, w: Work) -> None:
    """Accelerations of pins, axes and links after an evaluation with the mass factored."""


@dispatch(_of)
def axes_rates(links: FlexibleLinks, x: State, k: Floats, first: int) -> None:
    """Time derivative of the axes into ``k`` (flat) from index ``first`` on."""


@dispatch(_of)
def orthogonalise(links: FlexibleLinks, s: State) -> None:
    """Orthogonalise the axes after an explicit step."""


@dispatch(_of)
def lateral_bending_frequency(links: FlexibleLinks) -> float:
    """Highest frequency of the chain in lateral bending, rad/s; not for kernels."""


@dispatch(_of)
def absolute_rates(links: FlexibleLinks, x: State, w: Work) -> None:
    """Convert the rates ``w.v`` of the link to those relative to the ground."""


@dispatch(_of)
def absolute_accelerations(links: FlexibleLinks, s: State, w: Work, i: int, j: int) -> None:
    """Accelerations of the link between pins ``i`` and ``j`` relative to the ground into ``w.dv``.

    They are components along the axes.
    """


@dispatch(_of)
def omitted_accelerations(links: FlexibleLinks, s: State, w: Work, i: int, j: int) -> None:
    """Part of ``absolute_accelerations`` that an evaluation without accelerations leaves out."""


@dispatch(_of)
def along_axes(links: FlexibleLinks, s: State, v: Vector) -> Vector:
    """Components along the axes of the vector ``v`` in the frame of the start; of two axes the first two."""


@dispatch(_of)
def centre_of_mass(links: FlexibleLinks, x: State, w: Work) -> Vector:
    """Centre of mass of the link in the frame of the start, m."""


@dispatch(_of)
def start_frame_position(links: FlexibleLinks, s: State, p: Vector) -> Vector:
    """Position in the frame of the start of the position ``p`` along the axes, m."""


@dispatch(_of)
def start_frame_vector(links: FlexibleLinks, s: State, v: Vector) -> Vector:
    """Components in the frame of the start of the vector ``v`` along the axes."""


@dispatch(_of)
def lateral_bending_energy(links: FlexibleLinks, w: Work) -> float:
    """Strain energy of the lateral bending, J."""


@dispatch(_of)
def rotary_energy(links: FlexibleLinks, x: State) -> float:
    """Kinetic energy of the links' mass beside their centrelines, J."""
