"""The door to the axes in which a chain's coordinates are written: fixed ones, or axes that turn with the chain.

The class of the links says which: ``free_axes`` for those that turn, ``fixed_axes`` for all others. A chain's motion
``x`` holds the axes as ``x.axes``, empty where they are fixed.
"""

from __future__ import annotations

from typing import Any

from fmus.jit import door


def _of(links: type) -> Any:
    if links.__name__ == "TurningCables":
        from fmus.physics.chain.flexible import free_axes

        return free_axes
    from fmus.physics.chain.flexible import fixed_axes

    return fixed_axes


@door(_of)
def outside(links, x, w, tangent):
    """Before an evaluation: what the axes make of the wheels, and of accelerations."""


@door(_of)
def homeward(links, x, w):
    """After the contacts: the wrenches on the wheels as others see them."""


@door(_of)
def burden(links, x, w, weight, r):
    """Inertia forces and ``weight``, N, of the link in ``w.e``, ``w.v``, ``w.dv``, written to ``r`` (rows, axes)."""


@door(_of)
def sideways(links, w, r, tangent):
    """Bending of the link in ``w.e`` about the normal, as far as its element leaves it out: into ``r`` and ``w.K``."""


@door(_of)
def lean(links, w, by_acceleration):
    """What the turning of the axes does to the inertia of the link in ``w.e``: its rows and columns of ``w.K``."""


@door(_of)
def border(links, w, i, j):
    """What the turning of the axes does to the pins ``i`` and ``j``, after the link between them was condensed."""


@door(_of)
def foresee(links, method, h, s, w):
    """The axes at the end of a step of ``h`` s, as Newton's iteration begins with them."""


@door(_of)
def resolve(links, w, fresh):
    """Solve for the pins, ``w.b``; with ``fresh`` factors also what they answer to the turning of the axes."""


@door(_of)
def bend(links, x, w, by):
    """Take the Newton step of the axes out of the solutions of pins and links, which it amends; its size, m."""


@door(_of)
def arrive(links, method, s, w):
    """The axes at the end of a step that was found."""


@door(_of)
def follow(links, x, w):
    """Before accelerations are asked for: that of the origin; the axes have none that is known."""


@door(_of)
def swing(links, x, w):
    """After an evaluation with the mass factored: accelerations of pins and axes, and what those do to the links'."""


@door(_of)
def rates(links, x, k, at):
    """Time derivative of the axes, into ``k`` from ``at`` on."""


@door(_of)
def square(links, s):
    """Make the axes orthogonal again after an explicit step."""


@door(_of)
def sideways_frequency(links):
    """Of the chain, the highest in the bending that ``sideways`` knows, rad/s; not for kernels."""


@door(_of)
def absolute(links, x, w):
    """Rates ``w.v`` of the link in ``w.e`` against the ground."""


@door(_of)
def risen(links, x, w):
    """Height of the link in ``w.e``, m."""


@door(_of)
def placed(links, s, p):
    """The place ``p`` along the axes, in the frame of the start."""


@door(_of)
def directed(links, s, v):
    """The vector ``v`` along the axes, in the frame of the start."""


@door(_of)
def sideways_energy(links, w):
    """Strain energy of ``sideways``, J."""


@door(_of)
def turning_energy(links, x):
    """Kinetic energy of what the links weigh beside their lines, J."""
