"""Ideal compliant joints between element ends, as linear relations that are eliminated before the run.

An end has ``rows`` vectors: position and slope r_x of a cable (2), position and gradients r_x, r_y, r_z of a beam (4).
A joint defines how the coordinates of one end depend on those of another and on free coordinates p of its own:

    y_j = transfer y_i + free_directions p

so it removes 3 rows - (columns of ``free_directions``) equations. Equations and sections of Shabana et al., Ideal
compliant joints and integration of computer aided design and analysis:

| joint | equations | source |
| --- | --- | --- |
| ``spherical`` | r | (1) |
| ``pin_cable`` | r, and r_x along the axis | (2) |
| ``pin_beam`` | r, and the gradient along the axis, whatever its direction | (3) |
| ``rigid_beam``, ``rigid_cable`` | all: the gradients of one are those of the other, transformed | 3, 5.4 |

``frame`` is the matrix whose columns are the undeformed directions of an element's x, y, z. With G = [r_x r_y r_z],
J = G frame^T is the gradient by the common coordinates of the undeformed structure: the gradient transformation. The
pin (2) is linear only about an axis fixed in the world; a rigid corner of cables only in a plane, where its angle is a
rotation about the fixed normal. Beams have neither limit.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from fmus.physics.arrays import Floats


class Joint(NamedTuple):
    """Linear relation between the coordinates of two ends."""

    transfer: Floats  # (3 rows_j, 3 rows_i), factor of the coordinates of the leading end
    free_directions: Floats  # (3 rows_j, free), directions of the free coordinates; orthonormal columns

    @property
    def equations(self) -> int:
        """Number of scalar equations, which is that of the eliminated coordinates."""
        return self.free_directions.shape[0] - self.free_directions.shape[1]


def across(axis: ArrayLike) -> Floats:
    """Two unit vectors normal to a vector and to each other, as columns (3, 2)."""
    a = np.asarray(axis, float) / np.linalg.norm(axis)
    first = np.cross(a, np.eye(3)[np.argmin(abs(a))])
    first /= np.linalg.norm(first)
    return np.column_stack([first, np.cross(a, first)])


def by_rows(rows: ArrayLike) -> Floats:
    """Expand a relation between vectors to one between their components."""
    return np.kron(np.asarray(rows, float), np.eye(3))


def spherical(rows_i: int, rows_j: int) -> Joint:
    """Spherical joint, three equations (1): a common point."""
    transfer = np.zeros((rows_j, rows_i))
    transfer[0, 0] = 1.0
    return Joint(by_rows(transfer), by_rows(np.eye(rows_j)[:, 1:]))


def pin_cable(axis: ArrayLike) -> Joint:
    """Pin of cables, four equations (2): a common point and slope component along an axis fixed in world."""
    a = np.asarray(axis, float) / np.linalg.norm(axis)
    transfer, free_directions = np.eye(6), np.zeros((6, 2))
    transfer[3:, 3:] = np.outer(a, a)
    free_directions[3:] = across(a)
    return Joint(transfer, free_directions)


def pin_beam(axis: ArrayLike, frame_i: ArrayLike | None = None, frame_j: ArrayLike | None = None) -> Joint:
    """Pin of beams, six equations (3): common point and gradient along an axis of the undeformed beams."""
    a = np.asarray(axis, float) / np.linalg.norm(axis)
    b_i, b_j = (a @ (np.eye(3) if frame is None else np.asarray(frame)) for frame in (frame_i, frame_j))
    transfer, free_directions = np.zeros((4, 4)), np.zeros((4, 2))
    transfer[0, 0] = 1.0
    transfer[1:, 1:] = np.outer(b_j, b_i)
    free_directions[1:] = across(b_j)
    return Joint(by_rows(transfer), by_rows(free_directions))


def rigid_beam(frame_i: ArrayLike, frame_j: ArrayLike) -> Joint:
    """Rigid joint of beams, twelve equations: a common point and G_j = G_i frame_i^T frame_j."""
    transfer = np.zeros((4, 4))
    transfer[0, 0] = 1.0
    transfer[1:, 1:] = (np.asarray(frame_i).T @ np.asarray(frame_j)).T
    return Joint(by_rows(transfer), np.zeros((12, 0)))


def rigid_cable(turn: ArrayLike) -> Joint:
    """Rigid joint of cables, six equations: common point; slopes related by a rotation (3, 3) in a plane."""
    transfer = np.eye(6)
    transfer[3:, 3:] = turn
    return Joint(transfer, np.zeros((6, 0)))


def smooth(rows: int) -> Joint:
    """Smooth joint: all coordinates in common, two elements of one piece."""
    return Joint(np.eye(3 * rows), np.zeros((3 * rows, 0)))


def free(rows: int, *fixed: int) -> Floats:
    """Free directions of a support that fixes the coordinates ``fixed`` (3 x row + component) of an end."""
    return np.delete(np.eye(3 * rows), fixed, axis=1)


def clamped(rows: int) -> Floats:
    """Free directions of a support that fixes all coordinates: none."""
    return free(rows, *range(3 * rows))


def held(rows: int) -> Floats:
    """Free directions of a support that fixes the position: a spherical joint to the ground."""
    return free(rows, 0, 1, 2)
