"""Coordinates along the fixed axes of the track's start; see ``axes``; sibling: ``free_axes``."""

from __future__ import annotations

from typing import TYPE_CHECKING

from fmus.jit import kernel
from fmus.physics.ancf.element import axis_count, vector_count
from fmus.physics.arrays import Floats, Vector
from fmus.physics.chain.flexible import inertia
from fmus.physics.chain.flexible.elements import flatten, gather
from fmus.physics.chain.flexible.joints import solve

if TYPE_CHECKING:
    from fmus.physics.chain.flexible.elements import FlexibleLinks
    from fmus.physics.chain.flexible.state import Motion, State
    from fmus.physics.chain.flexible.work import Work
    from fmus.physics.chain.implicit import ImplicitMethod
    from fmus.physics.integrate.generalized_alpha import Slopes


@kernel
def wheels_to_axes(links: FlexibleLinks, x: Motion, w: Work, tangent: bool) -> None:
    """See ``axes``."""
    flatten(links, w)


@kernel
def wrenches_from_axes(links: FlexibleLinks, x: Motion, w: Work) -> None:
    """See ``axes``."""


@kernel
def inertia_and_weight(links: FlexibleLinks, x: Motion, w: Work, weight: Vector, r: Floats) -> None:
    """See ``axes``."""
    rows, dims = vector_count(links.element), axis_count(links.element)
    inertia.inertia(rows, dims, w.M, w.dv, r)
    inertia.weigh(weight, links.element.l, rows // 2, dims, r)


@kernel
def add_lateral_bending(links: FlexibleLinks, w: Work, r: Floats, tangent: bool) -> None:
    """See ``axes``."""


@kernel
def couple_inertia(links: FlexibleLinks, w: Work, by_acceleration: float) -> None:
    """See ``axes``."""


@kernel
def assemble_border(links: FlexibleLinks, w: Work, i: int, j: int) -> None:
    """See ``axes``."""


@kernel
def predict_axes(links: FlexibleLinks, method: ImplicitMethod, h: float, s: State, w: Work) -> None:
    """See ``axes``."""


@kernel
def solve_pins(links: FlexibleLinks, w: Work, fresh: bool) -> None:
    """See ``axes``."""
    solve(links, w)


@kernel
def correct_axes(links: FlexibleLinks, x: Motion, w: Work, by: Slopes) -> float:
    """See ``axes``."""
    return 0.0


@kernel
def motion_with_axes(links: FlexibleLinks, w: Work, p: Vector) -> Vector:
    """See ``axes``."""
    return 0.0, 0.0, 0.0


@kernel
def finish_axes(links: FlexibleLinks, method: ImplicitMethod, s: State, w: Work) -> None:
    """See ``axes``."""


@kernel
def accelerate_origin(links: FlexibleLinks, x: Motion, w: Work) -> None:
    """See ``axes``."""


@kernel
def solve_accelerations(links: FlexibleLinks, x: Motion, w: Work) -> None:
    """See ``axes``."""
    solve_pins(links, w, False)


@kernel
def axes_rates(links: FlexibleLinks, x: State, k: Floats, first: int) -> None:
    """See ``axes``."""


@kernel
def orthogonalise(links: FlexibleLinks, s: State) -> None:
    """See ``axes``."""


def lateral_bending_frequency(links: FlexibleLinks) -> float:
    """See ``axes``."""
    return 0.0


@kernel
def absolute_rates(links: FlexibleLinks, x: State, w: Work) -> None:
    """See ``axes``."""


@kernel
def absolute_accelerations(links: FlexibleLinks, s: State, w: Work, i: int, j: int) -> None:
    """See ``axes``."""
    gather(links, s.vdot, i, j, w.dv)


@kernel
def omitted_accelerations(links: FlexibleLinks, s: State, w: Work, i: int, j: int) -> None:
    """See ``axes``."""
    gather(links, s.vdot, i, j, w.dv)


@kernel
def along_axes(links: FlexibleLinks, s: State, v: Vector) -> Vector:
    """See ``axes``."""
    return v if axis_count(links.element) == 3 else (v[0], v[2], 0.0)


@kernel
def centre_of_mass(links: FlexibleLinks, x: State, w: Work) -> Vector:
    """See ``axes``."""
    last, l = vector_count(links.element) // 2, links.element.l
    first, second = inertia.centre(l, last, 0, w.e), inertia.centre(l, last, 1, w.e)
    return (first, second, inertia.centre(l, last, 2, w.e)) if axis_count(links.element) == 3 else (first, 0.0, second)


@kernel
def start_frame_position(links: FlexibleLinks, s: State, p: Vector) -> Vector:
    """See ``axes``."""
    return p


@kernel
def start_frame_vector(links: FlexibleLinks, s: State, v: Vector) -> Vector:
    """See ``axes``."""
    return v


@kernel
def lateral_bending_energy(links: FlexibleLinks, w: Work) -> float:
    """See ``axes``."""
    return 0.0


@kernel
def rotary_energy(links: FlexibleLinks, x: State) -> float:
    """See ``axes``: zero, the elements contain it."""
    return 0.0
