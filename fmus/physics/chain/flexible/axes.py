"""Dispatch to the axes of a chain's coordinates, fixed or turning, by the class of ``links``.

The modules are ``free_axes`` for axes that turn and ``fixed_axes`` for all others. The axes are in the motion as
``x.axes`` (``axes_state``), empty if fixed. Functions on one link use its coordinates ``w.e`` (rows, axes), rates
``w.v``, accelerations ``w.dv`` and matrix ``w.K``.
"""

from __future__ import annotations

from fmus.jit import dispatch, implementation

_of = implementation("axes")


@dispatch(_of)
def wheels_to_axes(links, x, w, tangent):
    """Prepare an evaluation: the wheels ``w.wheels`` relative to the axes into ``w.flat``; zero the border."""


@dispatch(_of)
def wrenches_from_axes(links, x, w):
    """Transform the wrenches on the wheels from the axes to the frame of the start, after the contacts."""


@dispatch(_of)
def inertia_and_weight(links, x, w, weight, r):
    """Write inertia forces and ``weight``, N, of the link to ``r`` (rows, axes)."""


@dispatch(_of)
def add_lateral_bending(links, w, r, tangent):
    """Add the link's bending about its normal, as far as the element lacks it, to ``r`` and ``w.K``."""


@dispatch(_of)
def couple_inertia(links, w, by_acceleration):
    """Write the rows and columns of ``w.K`` that couple the link's inertia with the rotation of the axes."""


@dispatch(_of)
def assemble_border(links, w, i, j):
    """Add the condensed coupling of the pins ``i``, ``j`` with the rotation of the axes to the border."""


@dispatch(_of)
def predict_axes(links, method, h, s, w):
    """Predict the axes at the end of a step of ``h`` s."""


@dispatch(_of)
def solve_pins(links, w, fresh):
    """Solve for the pins, ``w.b``; with ``fresh`` factors also for their response to the axes' rotation."""


@dispatch(_of)
def correct_axes(links, x, w, by):
    """Take the Newton step of the axes and correct the solutions of pins and links for it.

    Returns the size of the step, m.
    """


@dispatch(_of)
def finish_axes(links, method, s, w):
    """Update the axes at the end of a converged step."""


@dispatch(_of)
def accelerate_origin(links, x, w):
    """Acceleration of the axes' origin before an explicit evaluation; zero their angular acceleration."""


@dispatch(_of)
def solve_accelerations(links, x, w):
    """Accelerations of pins, axes and links after an evaluation with the mass factored."""


@dispatch(_of)
def axes_rates(links, x, k, first):
    """Time derivative of the axes into ``k`` from ``first`` on."""


@dispatch(_of)
def orthogonalise(links, s):
    """Orthogonalise the axes after an explicit step."""


@dispatch(_of)
def lateral_bending_frequency(links):
    """Highest frequency of the chain in lateral bending, rad/s; not for kernels."""


@dispatch(_of)
def absolute_rates(links, x, w):
    """Convert the rates ``w.v`` of the link to those relative to the ground."""


@dispatch(_of)
def absolute_accelerations(links, s, w, i, j):
    """Accelerations of the link between pins ``i`` and ``j`` relative to the ground into ``w.dv``.

    They are components along the axes.
    """


@dispatch(_of)
def omitted_accelerations(links, s, w, i, j):
    """Part of ``absolute_accelerations`` that an evaluation without accelerations leaves out."""


@dispatch(_of)
def vertical(links, s):
    """Unit vector of the vertical along the axes."""


@dispatch(_of)
def centre_height(links, x, w):
    """Height of the centre of mass of the link, m."""


@dispatch(_of)
def start_frame_position(links, s, p):
    """Position in the frame of the start of the position ``p`` along the axes, m."""


@dispatch(_of)
def start_frame_vector(links, s, v):
    """Components in the frame of the start of the vector ``v`` along the axes."""


@dispatch(_of)
def lateral_bending_energy(links, w):
    """Strain energy of the lateral bending, J."""


@dispatch(_of)
def rotary_energy(links, x):
    """Kinetic energy of the links' mass beside their centrelines, J."""
