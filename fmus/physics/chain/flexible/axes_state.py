"""Axes that turn with a chain, as numbers: where they stand in the state, vectors from one to the other.

``f`` holds the rotation R row by row (start = origin + R x along the axes), the origin and its velocity and
acceleration in the frame of the start, the angular velocity of the axes and its derivative along them, the auxiliary
accelerations of roll and yaw and of the origin, and the middle of the wheels at the start.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fmus.jit import kernel

ROTATION, ORIGIN, VELOCITY, ACCELERATION, RATE, GROWTH, AUXILIARY, CARRIED, MIDDLE = 0, 9, 12, 15, 18, 21, 24, 26, 29
SIZE = 32
ROLL, YAW = 12, 13  # their turning among a link's unknowns, after its coordinates


class Axes(NamedTuple):
    """Arrays that free axes work in; a border has columns for roll and yaw, about x and z of the axes, and as rows."""

    psi: np.ndarray  # (2) turn of the axes over the step so far, rad
    edge: np.ndarray  # (nodes, m, 4) what is left of the border for the pins
    answer: np.ndarray  # (2, nodes, m) of the pins to the turning
    corner: np.ndarray  # (2, 2) the balance by the turning
    moment: np.ndarray  # (2) what the balance of the turning lacks, N m
    point: np.ndarray  # (3) the contact point of a pin, along the axes
    place: np.ndarray  # (6) of a section of a face: p, d of its points at p + y d
    lever: np.ndarray  # (3) from the line of the pins to a contact point
    sums: np.ndarray  # (36) over the contact points of a section, see ``turning_faces``
    given: np.ndarray  # (2, 3, whole) the force there by a link's coordinates and the turning, times y to 0 and 1
    carried: np.ndarray  # (3, whole) what it does by its leverage
    drift: np.ndarray  # (3) of the origin, along the axes


def axes(nodes: int, shared: int, whole: int) -> Axes:
    """Zeroed; ``shared`` coordinates a pin, ``whole``: of a link and of the turning."""
    z = np.zeros
    return Axes(
        z(2), z((nodes, shared, 4)), z((2, nodes, shared)), z((2, 2)), z(2), z(3), z(6), z(3), z(36),
        z((2, 3, whole)), z((3, whole)), z(3),
    )  # fmt: skip


def begin(f: np.ndarray, middle: np.ndarray) -> None:
    """Axes at rest at the start, the wheels' ``middle`` (3) there."""
    f[:] = 0.0
    f[ROTATION:ORIGIN:4] = 1.0
    f[MIDDLE:] = middle


@kernel
def from_axes(f, v):
    """The vector R v in the frame of the start."""
    return (
        f[0] * v[0] + f[1] * v[1] + f[2] * v[2],
        f[3] * v[0] + f[4] * v[1] + f[5] * v[2],
        f[6] * v[0] + f[7] * v[1] + f[8] * v[2],
    )


@kernel
def to_axes(f, v):
    """The vector R^T v along the axes."""
    return (
        f[0] * v[0] + f[3] * v[1] + f[6] * v[2],
        f[1] * v[0] + f[4] * v[1] + f[7] * v[2],
        f[2] * v[0] + f[5] * v[1] + f[8] * v[2],
    )
