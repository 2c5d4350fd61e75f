"""Elastic block of a corner, which keeps the angle between beams.

A rigid connection by gradient transformation (``joints.rigid_beam``) makes one member's slope r_x the other's director.
The bending moment then passes through the shear between slope and director of one element, a compliance that grows
without bound as elements get shorter. The block stands for the material of the corner: Hooke's law (nu = 0) on the
gradients G = [r_x r_y r_z] of the common node, over the volume in which the members overlap. With a much larger modulus
it is the rigid corner of frame theory.

    U = (V E / 2) |(G^T G - 1)/2|^2
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy import sparse

from fmus.physics.arrays import Floats
from tests.validation.ancf.mesh import End, Mesh


class Block(NamedTuple):
    """Block around a node of beams."""

    pull: sparse.csr_array  # (9, n), from q to the gradients r_x, r_y, r_z
    constant: Floats  # (9,), constant part of the gradients
    VE: float  # volume times modulus, N m

    def strained(self, q: Floats) -> tuple[Floats, Floats]:
        """Gradients G (3, 3) and their strain (G^T G - 1)/2."""
        G = (self.pull @ q + self.constant).reshape(3, 3).T
        return G, 0.5 * (G.T @ G - np.eye(3))

    def energy(self, q: Floats) -> float:
        """Strain energy, J."""
        _, strain = self.strained(q)
        return 0.5 * self.VE * (strain**2).sum()

    def force(self, q: Floats) -> Floats:
        """Gradient of the energy: V E G strain."""
        G, strain = self.strained(q)
        return self.pull.T @ (self.VE * G @ strain).T.ravel()

    def tangent(self, q: Floats) -> sparse.csr_array:
        """Derivative of the force."""
        G, strain = self.strained(q)
        columns = []
        for row in np.eye(9):
            dG = row.reshape(3, 3).T
            change = G.T @ dG
            columns.append((dG @ strain + 0.5 * G @ (change + change.T)).T.ravel())
        return self.pull.T @ sparse.csr_array(self.VE * np.column_stack(columns)) @ self.pull


def block(mesh: Mesh, end: End, volume: float, modulus: float) -> Block:
    """Return the block at an end of a beam; a rigid corner needs about 100 times the beam's modulus, Pa."""
    first = mesh.place(end).start + 3
    return Block(mesh.B[first : first + 9], mesh.b[first : first + 9], volume * modulus)
