"""The door to how a chain of flexible links meets the equations of its pins: eliminated, or kept beside multipliers.

The class of the links says which: ``constrained_joints`` for links with coordinates of their own, ``eliminated_joints``
for those that share the coordinates of their pins.
"""

from __future__ import annotations

from typing import Any

from fmus.jit import door


def _of(links: type) -> Any:
    if links.__name__ == "ConstrainedCables":
        from fmus.physics.chain.flexible import constrained_joints

        return constrained_joints
    from fmus.physics.chain.flexible import eliminated_joints

    return eliminated_joints


@door(_of)
def factor(links, w):
    """Factor the matrix of the pins, ``w.A``, ``w.U``, ``w.L``. Returns -1, or the pin or link where it is singular."""


@door(_of)
def solve(links, w):
    """The correction of the pins, ``w.b``, from their residuals there; it takes what ``misfit`` found with it."""


@door(_of)
def misfit(links, q, w):
    """What the coordinates, rates or accelerations ``q`` leave open in the equations of the pins."""


@door(_of)
def close(links, s, w):
    """Take coordinates and rates back onto the equations of the pins, along what their forces would do."""


@door(_of)
def speed(links, carried, s, w):
    """Of the chain along itself over its carrier ``carried``, m/s: ``chain_speed`` of its pins, each once."""
