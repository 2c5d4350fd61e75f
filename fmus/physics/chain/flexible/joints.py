"""Dispatch to the formulation of the pin equations by the class of ``links``.

``constrained_joints`` has multipliers, for links with coordinates of their own; ``eliminated_joints`` is for links that
share the coordinates of their pins.
"""

from __future__ import annotations

from fmus.jit import dispatch, implementation

_of = implementation("joints")


@dispatch(_of)
def factor(links, w):
    """Factor the pins' matrix ``w.A``, ``w.U``, ``w.L``; -1, or the pin or link where it is singular."""


@dispatch(_of)
def solve(links, w):
    """Solve for the correction of the pins in ``w.b``, from residuals there and the gap of ``misfit``."""


@dispatch(_of)
def misfit(links, q, w):
    """Misfit of the pin equations by the coordinates, rates or accelerations ``q`` (nodes, width)."""


@dispatch(_of)
def project(links, s, w):
    """Project coordinates and rates onto the pin equations, in the directions of the pin forces."""


@dispatch(_of)
def speed(links, carrier, s, w):
    """``chain_speed``, m/s, of the pins relative to the ``carrier``, each pin counted once."""
