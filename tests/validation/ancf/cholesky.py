"""Cholesky coordinates, in which the mass matrix of a mesh is the identity.

With M = L L^T, z = L^T q has kinetic energy z'.z'/2, and a force on z is L^-1 times that on q. Yakoub, Shabana, Use of
Cholesky coordinates and the absolute nodal coordinate formulation in the computer simulation of flexible multibody
systems, Nonlinear Dyn. 20, 1999. L is computed once, because joints are eliminated and the mass matrix is constant.
"""

from __future__ import annotations

from scipy import sparse
from scipy.linalg import cholesky, solve_triangular

from fmus.physics.arrays import Floats
from tests.validation.ancf.mesh import Mesh


class CholeskyMesh:
    """Mesh in Cholesky coordinates, with the methods of ``Mesh`` that integrators call."""

    def __init__(self, mesh: Mesh) -> None:
        self.mesh = mesh
        self.L = cholesky(mesh.M.toarray(), lower=True)
        self.M = sparse.eye_array(mesh.n, format="csc")

    def z(self, q: Floats) -> Floats:
        """Cholesky coordinates of nodal coordinates, or rates of rates."""
        return self.L.T @ q

    def q(self, z: Floats) -> Floats:
        """Nodal coordinates of Cholesky coordinates, or rates of rates."""
        return solve_triangular(self.L, z, lower=True, trans="T")

    def _f(self, f: Floats) -> Floats:
        return solve_triangular(self.L, f, lower=True)

    def _matrix(self, K) -> Floats:
        half = solve_triangular(self.L, K.toarray(), lower=True)
        return solve_triangular(self.L, half.T, lower=True).T

    def energy(self, z: Floats) -> float:
        """Strain energy, J."""
        return self.mesh.energy(self.q(z))

    def kinetic(self, v: Floats) -> float:
        """Kinetic energy, J."""
        return float(0.5 * v @ v)

    def force(self, z: Floats) -> Floats:
        """Elastic force."""
        return self._f(self.mesh.force(self.q(z)))

    def damping(self, z: Floats, v: Floats) -> Floats:
        """Damping force."""
        return self._f(self.mesh.damping(self.q(z), self.q(v)))

    def viscosity(self, z: Floats) -> Floats:
        """Derivative of the damping force by the rates."""
        return self._matrix(self.mesh.viscosity(self.q(z)))

    def tangent(self, z: Floats) -> Floats:
        """Derivative of the elastic force."""
        return self._matrix(self.mesh.tangent(self.q(z)))

    def applied(self, z: Floats) -> Floats:
        """Sum of the loads."""
        return self._f(self.mesh.applied(self.q(z)))

    def applied_tangent(self, z: Floats) -> Floats:
        """Derivative of the loads."""
        return self._matrix(self.mesh.applied_tangent(self.q(z)))
