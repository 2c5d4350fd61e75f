"""Coordinates along the fixed axes of the track's start; see ``axes``; sibling: ``free_axes``."""

from __future__ import annotations

from fmus.jit import kernel
from fmus.physics.ancf.element import axes, vectors
from fmus.physics.chain.flexible import inertia
from fmus.physics.chain.flexible.elements import flatten, gather
from fmus.physics.chain.flexible.joints import solve


@kernel
def wheels_to_axes(links, x, w, tangent):
    """See ``axes``."""
    flatten(links, w)


@kernel
def wrenches_from_axes(links, x, w):
    """See ``axes``."""


@kernel
def inertia_and_weight(links, x, w, weight, r):
    """See ``axes``."""
    rows, dims = vectors(links.element), axes(links.element)
    inertia.inertia(rows, dims, w.M, w.dv, r)
    inertia.weigh(weight, links.element.l, rows // 2, dims - 1, r)


@kernel
def add_lateral_bending(links, w, r, tangent):
    """See ``axes``."""


@kernel
def couple_inertia(links, w, by_acceleration):
    """See ``axes``."""


@kernel
def assemble_border(links, w, i, j):
    """See ``axes``."""


@kernel
def predict_axes(links, method, h, s, w):
    """See ``axes``."""


@kernel
def solve_pins(links, w, fresh):
    """See ``axes``."""
    solve(links, w)


@kernel
def correct_axes(links, x, w, by):
    """See ``axes``."""
    return 0.0


@kernel
def finish_axes(links, method, s, w):
    """See ``axes``."""


@kernel
def accelerate_origin(links, x, w):
    """See ``axes``."""


@kernel
def solve_accelerations(links, x, w):
    """See ``axes``."""
    solve_pins(links, w, False)


@kernel
def axes_rates(links, x, k, first):
    """See ``axes``."""


@kernel
def orthogonalise(links, s):
    """See ``axes``."""


def lateral_bending_frequency(links):
    """See ``axes``."""
    return 0.0


@kernel
def absolute_rates(links, x, w):
    """See ``axes``."""


@kernel
def absolute_accelerations(links, s, w, i, j):
    """See ``axes``."""
    gather(links, s.vdot, i, j, w.dv)


@kernel
def omitted_accelerations(links, s, w, i, j):
    """See ``axes``."""
    gather(links, s.vdot, i, j, w.dv)


@kernel
def vertical(links, s):
    """See ``axes``."""
    return (0.0, 0.0, 1.0) if axes(links.element) == 3 else (0.0, 1.0, 0.0)


@kernel
def centre_height(links, x, w):
    """See ``axes``."""
    rows, dims = vectors(links.element), axes(links.element)
    return inertia.height(links.element.l, rows // 2, dims - 1, w.e)


@kernel
def start_frame_position(links, s, p):
    """See ``axes``."""
    return p


@kernel
def start_frame_vector(links, s, v):
    """See ``axes``."""
    return v


@kernel
def lateral_bending_energy(links, w):
    """See ``axes``."""
    return 0.0


@kernel
def rotary_energy(links, x):
    """See ``axes``: zero, the elements contain it."""
    return 0.0
