"""The door from the integrators to the kinds of links: flexible ones and rigid ones."""

from __future__ import annotations

from typing import Any

from fmus.jit import door


def _of(links: type) -> Any:
    """The module of a class of links."""
    if links.__name__ == "RigidLinks":
        from fmus.physics.chain.rigid import dynamics as rigid

        return rigid
    if links.__name__ == "JointedLinks":
        from fmus.physics.chain.rigid import jointed

        return jointed
    if links.__name__ == "CholeskyLinks":
        from fmus.physics.chain.flexible import cholesky

        return cholesky
    from fmus.physics.chain.flexible import dynamics as flexible

    return flexible


@door(_of, shared=True)
def newton(links, contacts, env, method, h, s, w, counters):
    """One step of ``h`` s by the implicit ``method`` to the wheels in ``w.moved``, from ``s`` = ``w.before``.

    Returns DONE or what failed, the link and its residual; ``s`` is then spoilt.
    """


@door(_of, shared=True)
def derivative(links, contacts, env, s, w, k):
    """Of ``state.moving``, into ``k``, with the wheels in ``w.moved``. Returns -1, or the link where it failed."""


@door(_of, shared=True)
def close(links, s, w):
    """Take back what an explicit step did to the equations of the pins. Returns -1, or the pin that stays open."""


@door(_of, shared=True)
def accelerate(links, contacts, env, s, w):
    """After an explicit step: the accelerations that belong to the state; rigid links have those of the last stage."""


@door(_of, shared=True)
def newton_joints(links, env, s, w):
    """After an implicit step: force of each pin on the link that begins there into ``w.on_links``, where asked for.

    With the other forces on a link it makes the link's acceleration, to rounding.
    """


@door(_of, shared=True)
def stage_joints(links, env, s, w):
    """The same after ``derivative``."""


@door(_of, shared=True)
def end_work(links, env, h, s, w):
    """Work that the loads on the ends did in an implicit step of ``h`` s from ``w.before``, J."""


@door(_of, shared=True)
def speed(links, env, s, w):
    """Of the chain along itself over what carries the wheels ``w.moved``, m/s."""


@door(_of, shared=True)
def first_speed(links, env, s, w, report):
    """``speed`` at the beginning of a communication step, with the wheels in ``w.moved`` as they are then, m/s."""


@door(_of, shared=True)
def observe(links, env, s, w, report):
    """Fill the report from the state and its last evaluation, but for what is summed up."""


@door(_of, shared=True)
def pin_places(links, s, w, place):
    """Places of the pins into ``place`` (nodes, 3), in the frame of the start."""


@door(_of, shared=True)
def links_shown(links, env, s, w, tension, stress, place):
    """What each link shows at an instant: tension, N, and stress, Pa, (n), places of the pins (nodes, 3)."""


@door(_of, shared=True)
def pin_axes(links, s, w, axis):
    """Unit vectors along the pins into ``axis`` (nodes, 3)."""


@door(_of, shared=True)
def slopes(links, s, w, found):
    """Position gradients along each link at its first and at its last pin into ``found`` (n, 6).

    Rigid links have the unit vector along them at both.
    """


@door(_of, shared=True)
def fibres(links, s, w, stress):
    """Axial stress at the outer and at the inner fibre of each link, Pa, mean along it, into ``stress`` (n, 2)."""
