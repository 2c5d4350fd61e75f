"""The block of a corner: what keeps beams that meet at an angle at that angle.

A rigid connection by gradient transformation (``joints.rigid_beam``) makes one member's slope r_x the other's director.
The bending moment of one then reaches the other through the shear between its slope and its director, in one element:
a compliance that grows as elements get shorter, without bound. Hooke's law (nu = 0) on the gradients G = [r_x r_y r_z]
of the common node, over the volume in which the members overlap, is what the structure has there and the line lacks;
many times as stiff it is the rigid corner of frame theory.

    U = (V E / 2) |(G^T G - 1)/2|^2
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy import sparse

from fmus.physics.arrays import Floats
from tests.validation.ancf.mesh import End, Mesh


class Block(NamedTuple):
    """A block around a node of beams."""

    pull: sparse.csr_array  # (9, n), from q to the gradients r_x, r_y, r_z
    constant: Floats  # (9,), what is held of them
    VE: float  # volume times modulus, N m

    def strained(self, q: Floats) -> tuple[Floats, Floats]:
        """The gradients G (3, 3) and their strain (G^T G - 1)/2."""
        G = (self.pull @ q + self.constant).reshape(3, 3).T
        return G, 0.5 * (G.T @ G - np.eye(3))

    def energy(self, q: Floats) -> float:
        """Strain energy, J."""
        _, strain = self.strained(q)
        return 0.5 * self.VE * (strain**2).sum()

    def force(self, q: Floats) -> Floats:
        """Its gradient: V E G strain."""
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
    """The block at an end of a beam; for a rigid corner some 100 times its modulus."""
    first = mesh.place(end).start + 3
    return Block(mesh.B[first : first + 9], mesh.b[first : first + 9], volume * modulus)
