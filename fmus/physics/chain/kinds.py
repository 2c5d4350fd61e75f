"""Dispatch from the integrators to the kinds of links by the class of ``links``.

The modules are ``flexible.dynamics``, ``flexible.cholesky``, ``rigid.dynamics`` and ``rigid.jointed``. Arguments:
``links``, parameters; ``contacts``, the partners or None; ``env``, an Environment; ``s``, the State; ``w``, the Work;
``report`` (REPORT) and ``counters`` (COUNTERS) of ``report``. Frame: that of the start of the track.
"""

from __future__ import annotations

from fmus.jit import dispatch, implementation

_of = implementation("dynamics")


@dispatch(_of, shared=True)
def newton(links, contacts, env, method, h, s, w, counters):
    """Do one step of ``h`` s by the implicit ``method``, from ``s`` = ``w.before``, wheels at ``w.wheels``.

    Returns DONE or the failure, the link and its residual, N; after a failure ``s`` is invalid.
    """


@dispatch(_of, shared=True)
def derivative(links, contacts, env, s, w, k):
    """Time derivative of ``state.integrated_views`` into ``k`` (flat), with the wheels at ``w.wheels``.

    Returns -1, or the link where it failed.
    """


@dispatch(_of, shared=True)
def project(links, s, w):
    """Project the state onto the pin equations after an explicit step.

    Returns -1, or the pin that stays open.
    """


@dispatch(_of, shared=True)
def accelerate(links, contacts, env, s, w):
    """Accelerations of the state after an explicit step; rigid links keep those of the last stage."""


@dispatch(_of, shared=True)
def newton_joints(links, env, s, w):
    """Force of each pin on the link that begins there, N, into ``w.on_links``, after an implicit step.

    Skipped if no such columns exist. With the other forces on a link it gives the link's acceleration, to rounding.
    """


@dispatch(_of, shared=True)
def stage_joints(links, env, s, w):
    """Same as ``newton_joints``, after ``derivative``."""


@dispatch(_of, shared=True)
def end_work(links, env, h, s, w):
    """Work of the end loads in an implicit step of ``h`` s from ``w.before``, J."""


@dispatch(_of, shared=True)
def speed(links, env, s, w):
    """Speed of the chain along itself relative to the carrier of the wheels ``w.wheels``, m/s."""


@dispatch(_of, shared=True)
def first_speed(links, env, s, w, report):
    """``speed`` at the start of a communication step, with the wheels ``w.wheels`` of that time, m/s."""


@dispatch(_of, shared=True)
def observe(links, env, s, w, report):
    """Fill the report from the state and its last evaluation, except the summed entries."""


@dispatch(_of, shared=True)
def pin_places(links, s, w, place):
    """Positions of the pins, m, into ``place`` (nodes, 3), in the frame of the start."""


@dispatch(_of, shared=True)
def observe_links(links, env, s, w, tension, stress, place):
    """Tension, N, and stress, Pa, of each link (n each); positions of the pins ``place`` (nodes, 3), m."""


@dispatch(_of, shared=True)
def pin_axes(links, s, w, axis):
    """Unit vectors along the pins into ``axis`` (nodes, 3)."""


@dispatch(_of, shared=True)
def slopes(links, s, w, slope):
    """Position gradients along each link at its first and its last pin into ``slope`` (n, 6).

    For rigid links both are the unit vector along the link.
    """


@dispatch(_of, shared=True)
def fibres(links, s, w, stress):
    """Axial stress at outer and inner fibre of each link, Pa, mean along it, into ``stress`` (n, 2)."""
