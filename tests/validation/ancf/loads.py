"""Loads on a mesh: each has a ``force`` on the coordinates q and its derivative by q, ``tangent``."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy import sparse

from fmus.physics.arrays import Floats
from tests.validation.ancf.mesh import End, Mesh


class Dead(NamedTuple):
    """Constant load."""

    f: Floats  # (n,)

    def force(self, q: Floats) -> Floats:
        """Return the constant force."""
        return self.f

    def tangent(self, q: Floats) -> float:
        """Return 0, the derivative of a constant."""
        return 0.0


class Couple(NamedTuple):
    """Moment on one gradient d of an end: virtual work M . (d x delta d)/|d|^2, exact in a plane."""

    pull: sparse.csr_array  # (3, n), from q to the gradient
    constant: Floats  # (3,), constant part of the gradient
    moment: Floats  # (3,), world, N m

    def force(self, q: Floats) -> Floats:
        """Generalised force of (M x d)/|d|^2 on the gradient."""
        d = self.pull @ q + self.constant
        return self.pull.T @ (np.cross(self.moment, d) / (d @ d))

    def tangent(self, q: Floats) -> sparse.csr_array:
        """Derivative of the force by q."""
        d = self.pull @ q + self.constant
        cross = np.cross(np.eye(3), self.moment)  # cross @ d = M x d
        D = cross / (d @ d) - 2.0 * np.outer(cross @ d, d) / (d @ d) ** 2
        return self.pull.T @ sparse.csr_array(D) @ self.pull


def point_force(mesh: Mesh, end: End, force: ArrayLike) -> Dead:
    """Constant force, N, world, at an end."""
    return Dead(mesh.pull(end).T @ np.asarray(force, float))


def gravity(mesh: Mesh, g: ArrayLike) -> Dead:
    """Weight of all elements; ``g`` (3,), m/s2, world."""
    lift = np.zeros_like(mesh.e0)
    for place in mesh.ends:
        lift[place.start : place.start + 3] = g
    return Dead(mesh.B.T @ (mesh.M_e @ lift))


def couple(mesh: Mesh, end: End, moment: ArrayLike, row: int) -> Couple:
    """Moment (3,), N m, world, on the gradient in ``row`` (1: r_x, 3: r_z of a beam) of an end."""
    place = mesh.place(end).start + 3 * row
    return Couple(mesh.pull(end, row), mesh.b[place : place + 3], np.asarray(moment, float))
