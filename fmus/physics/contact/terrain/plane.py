"""Inclined plane, which may begin at a place with a smooth transition."""

from __future__ import annotations

from typing import NamedTuple

from fmus.kernels.jit import kernel
from fmus.physics.contact.terrain.heights import EVERYWHERE, Six, fade, faded_length


class Plane(NamedTuple):
    """Plane through the origin, or one into which level ground bends."""

    grade: float = 0.0  # dh/dx, uphill ahead positive
    bank: float = 0.0  # dh/dy, uphill to the left positive
    start: float = EVERYWHERE  # x from which it inclines, m
    length: float = 1.0  # length of the transition, m


@kernel
def plane(p: Plane, x: float, y: float) -> Six:
    """Height at (x, y), m, with its derivatives."""
    s, f, f_x = faded_length(x, p.start, p.length)
    _, _, f_xx = fade(x, p.start, p.length)
    return (
        p.grade * s + p.bank * y * f,
        p.grade * f + p.bank * y * f_x,
        p.bank * f,
        p.grade * f_x + p.bank * y * f_xx,
        p.bank * f_x,
        0.0,
    )
