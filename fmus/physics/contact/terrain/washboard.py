"""Sine waves along x, with a phase between the left and the right side, faded in and out over one wave."""

from __future__ import annotations

from typing import NamedTuple

from fmus.kernels.jit import kernel
from fmus.physics.contact.terrain.heights import Six, fade, times
from fmus.physics.elementary import PI, cos, sin


class Washboard(NamedTuple):
    """Waves a sin(2 pi (x - start) / wavelength) on the left, behind by ``phase`` on the right."""

    amplitude: float = 0.0  # a, m; 0: no waves
    wavelength: float = 1.0  # m
    phase: float = 0.0  # rad
    start: float = 0.0  # x where they begin, m
    end: float = 1e9  # x where they end, m


@kernel
def washboard(p: Washboard, blend: float, x: float, y: float) -> Six:
    """Height at (x, y), m, with its derivatives; left turns to right over ``blend`` m on both sides of y = 0."""
    k, (side, side_y, side_yy) = 2.0 * PI / p.wavelength, fade(y, -blend, 2.0 * blend)
    angle, b, b_y = k * (x - p.start) + p.phase * (side - 1.0), p.phase * side_y, p.phase * side_yy
    s, c = p.amplitude * sin(angle), p.amplitude * cos(angle)
    (f, f_x, f_xx) = fade(x, p.start, p.wavelength)
    (g, g_x, g_xx) = fade(x, p.end - p.wavelength, p.wavelength)
    g = 1.0 - g
    envelope = f * g, f_x * g - f * g_x, f_xx * g - 2.0 * f_x * g_x - f * g_xx
    return times(envelope, (s, k * c, b * c, -k * k * s, -k * b * s, b_y * c - b * b * s))
