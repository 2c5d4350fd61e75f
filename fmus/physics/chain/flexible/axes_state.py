"""Turning axes of a chain as an array in the state, and transformations of vectors.

``f`` (SIZE) holds the rotation R row by row (start = origin + R x along the axes), the origin, m, and its velocity and
acceleration in the frame of the start, the angular velocity of the axes, rad/s, and its derivative along them, the
auxiliary accelerations of roll and yaw and of the origin, and the middle of the wheels at the start.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fmus.kernels.jit import kernel
from fmus.physics.arrays import Floats, Vector, VectorLike
from fmus.physics.elementary import cos, sin

ROTATION, ORIGIN, VELOCITY, ACCELERATION, OMEGA, OMEGA_RATE, AUXILIARY, AUXILIARY_ORIGIN, MIDDLE = (
    0,
    9,
    12,
    15,
    18,
    21,
    24,
    26,
    29,
)
SIZE = 32
ROLL, YAW = 12, 13  # their rotations among a link's unknowns, after its coordinates


class AxesArrays(NamedTuple):
    """Work arrays of free axes, for m shared coordinates a pin.

    ``whole``: number of unknowns of a link and of the axes. The border has columns and rows for roll and yaw, the
    rotations about x and z of the axes.
    """

    psi: np.ndarray  # (2) rotation of the axes over the step so far, rad
    turn: np.ndarray  # (2) part of it by the last Newton step, rad
    border: np.ndarray  # (nodes, m, 4) condensed border of the pins: two columns, two rows
    response: np.ndarray  # (2, nodes, m) response of the pins to roll and yaw
    corner: np.ndarray  # (2, 2) derivative of the moment balance by roll and yaw, N m
    moment: np.ndarray  # (2) residual of the moment balance, N m
    point: np.ndarray  # (3) contact point of a pin, along the axes, m
    section: np.ndarray  # (6) of a section of a face: p and d of its points p + y d, m and 1
    lever: np.ndarray  # (3) from the pin line to a contact point, m
    sums: np.ndarray  # (36) sums over the contact points of a section, see ``turning_faces``
    section_tangent: np.ndarray  # (2, 3, whole) its force by the unknowns, weighted by y to 0 and 1
    lever_tangent: np.ndarray  # (3, whole) part of it by the leverage
    origin_acceleration: np.ndarray  # (3) acceleration of the origin, along the axes, m/s2


def axes_arrays(nodes: int, shared: int, whole: int) -> AxesArrays:
    """Return zeroed arrays; ``shared`` coordinates a pin, ``whole`` unknowns of a link and of the axes."""
    z = np.zeros
    return AxesArrays(
        z(2), z(2), z((nodes, shared, 4)), z((2, nodes, shared)), z((2, 2)), z(2), z(3), z(6), z(3), z(36),
        z((2, 3, whole)), z((3, whole)), z(3),
    )  # fmt: skip


def begin(f: np.ndarray, wheels: np.ndarray, roll: float, low: float, play: float) -> None:
    """Set ``f`` (SIZE) to axes at rest on ``wheels`` (m, 3), m, with a ``roll``, rad, about the lower run at ``low``.

    Guides with a ``play`` to each side, m, have moved upright axes, and axes with this roll, until none touches.
    """
    f[:] = 0.0
    c, s = cos(roll), sin(roll)
    across = 0.0  # of the lower run
    for slope in (0.0, s / c):
        off = wheels[:, 1] - across + slope * (wheels[:, 2] - low)
        across += max(off.max() - play, 0.0) + min(off.min() + play, 0.0)
    f[ROTATION:ORIGIN] = 1.0, 0.0, 0.0, 0.0, c, 0.0 - s, 0.0, s, c
    f[ORIGIN + 1], f[ORIGIN + 2] = across + s * low, (1.0 - c) * low
    f[MIDDLE:] = to_axes(f, wheels.mean(axis=0) - f[ORIGIN:VELOCITY])


@kernel
def from_axes(f: Floats, v: VectorLike) -> Vector:
    """Vector R v in the frame of the start, with the axes ``f`` (SIZE)."""
    return (
        f[0] * v[0] + f[1] * v[1] + f[2] * v[2],
        f[3] * v[0] + f[4] * v[1] + f[5] * v[2],
        f[6] * v[0] + f[7] * v[1] + f[8] * v[2],
    )


@kernel
def to_axes(f: Floats, v: VectorLike) -> Vector:
    """Vector R^T v along the axes ``f`` (SIZE)."""
    return (
        f[0] * v[0] + f[3] * v[1] + f[6] * v[2],
        f[1] * v[0] + f[4] * v[1] + f[7] * v[2],
        f[2] * v[0] + f[5] * v[1] + f[8] * v[2],
    )


@kernel
def rotate(f: Floats, before: Floats, psi: Floats) -> None:
    """Write R = R(before) exp(psi) to ``f`` (SIZE), Rodrigues' formula; ``psi`` (2), rad, about x and z."""
    x, z = psi[0], psi[1]
    square = x * x + z * z
    s, c = 1.0 - square / 6.0, 0.5 - square / 24.0  # sin(a)/a, (1 - cos a)/a^2; a step turns by milliradians
    if square > 1e-4:
        a = np.sqrt(square)
        s, c = sin(a) / a, (1.0 - cos(a)) / square
    for i in range(3):
        r0, r1, r2 = before[3 * i], before[3 * i + 1], before[3 * i + 2]
        # row r: r + s r [psi x] + c r [psi x]^2 with psi = (x, 0, z)
        f[3 * i] = r0 * (1.0 - c * z * z) + r1 * s * z + r2 * c * x * z
        f[3 * i + 1] = r1 * (1.0 - c * square) - r0 * s * z + r2 * s * x
        f[3 * i + 2] = r2 * (1.0 - c * x * x) + r0 * c * x * z - r1 * s * x
