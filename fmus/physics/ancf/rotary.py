"""Rotary inertia of a link beyond its element's mass matrix, from a table of principal inertias.

A rigid link has second moments of mass E_x, E_y, E_z along its length, its pin and its normal, kg m2; its inertias
about these axes are E_y + E_z (roll), E_z + E_x (pin), E_x + E_y (yaw). An element has the second moments of its line
(m l^2 / 12 along x) or of its volume. The difference is a constant term of its kinetic energy, E_k / 2 |dg_k/dt|^2, in
a gradient g_k: r_y and r_z of a beam, and along x of both elements the mean slope of their line,

(1) g_x = 12 / l^3 int (x - l/2) r dx = 6/5 (r(l) - r(0)) / l - (r_x(0) + r_x(l)) / 10.

In a rotation at w a unit vector across it moves at w, so each term counts for the two axes across its gradient. A cable
has r_x alone: along x it gets the difference about the pin.

Term (1) changes one eigenvalue of the mass matrix, that of a turning rod, from 1 to E_x / (m l^2 / 12), so the matrix
stays positive definite for all second moments above 0, which all bodies have; gravity is not affected.
The term j int S_x^T S_x dx (Rayleigh, The Theory of Sound, 1894, section 162) has the same inertia, but would have to
be refused below 0.93 of a rod's.
"""

from __future__ import annotations

NONE = 1e-6  # part of an element's own second moment below which rounding makes its mass matrix singular


def second_moments(inertia: tuple[float, float, float]) -> tuple[float, float, float]:
    """Second moments of mass along x, y, z, kg m2, of a body with principal ``inertia`` (3), kg m2."""
    half = 0.5 * sum(inertia)
    return half - inertia[0], half - inertia[1], half - inertia[2]
