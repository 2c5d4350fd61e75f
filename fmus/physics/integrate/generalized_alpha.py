"""Coefficients of the generalised-alpha method for second-order systems, with and without constraints.

Arnold and Bruels, Convergence of the generalized-alpha scheme for constrained mechanical systems, Multibody System
Dynamics 18, 2007; on Lie groups: Bruels, Cardona, Arnold, Mechanism and Machine Theory 48, 2012. One step from t to
t + h, with the auxiliary acceleration ``a`` beside the true one, ``vdot``, which satisfies the equations of motion:

    (1 - alpha_m) a1 + alpha_m a0 = (1 - alpha_f) vdot1 + alpha_f vdot0
    v1 = v0 + h ((1 - gamma) a0 + gamma a1)
    q1 = q0 o exp(h v0 + h^2 ((1/2 - beta) a0 + beta a1))

Seen from vdot1 the step is affine:  a1 = a_p + vdot1 (1 - alpha_f)/(1 - alpha_m),  and so on; ``Step`` holds the factors.
The same recursion carries a force's impulse: with W in place of a and the force in place of vdot the impulse over
the step is h ((1 - gamma) W0 + gamma W1), and the sum of all impulses is the change of momentum to rounding.
"""

from __future__ import annotations

from typing import NamedTuple

from fmus.jit import kernel

order = 2


class GeneralizedAlpha(NamedTuple):
    """The four coefficients, all dimensionless."""

    alpha_m: float  # weight of the old auxiliary acceleration
    alpha_f: float  # weight of the old true acceleration
    beta: float  # Newmark's, positions
    gamma: float  # Newmark's, velocities


class Step(NamedTuple):
    """Derivatives of the end of a step with respect to the increment of the position, dq."""

    a_q: float  # da1/ddq, 1/s2
    v_q: float  # dv1/ddq, 1/s
    vdot_q: float  # dvdot1/ddq, 1/s2


@kernel
def coefficients(radius):
    """The coefficients of second order with the spectral ``radius`` at infinite frequency, 0 (hard) to 1 (none)."""
    alpha_m = (2.0 * radius - 1.0) / (radius + 1.0)
    alpha_f = radius / (radius + 1.0)
    gamma = 0.5 + alpha_f - alpha_m
    beta = 0.25 * (gamma + 0.5) ** 2
    return GeneralizedAlpha(alpha_m, alpha_f, beta, gamma)


@kernel
def step(c, h):
    """The factors of a Newton iteration in the position increment for the step ``h``."""
    a_q = 1.0 / (c.beta * h * h)
    return Step(a_q, c.gamma / (c.beta * h), (1.0 - c.alpha_m) / ((1.0 - c.alpha_f) * c.beta * h * h))
