"""Coefficients of the generalised-alpha method for second-order systems, with and without constraints.

Arnold and Bruels, Convergence of the generalized-alpha scheme for constrained mechanical systems, Multibody
System Dynamics 18, 2007; on Lie groups Bruels, Cardona, Arnold, Mechanism and Machine Theory 48, 2012.
The true acceleration ``vdot`` satisfies the equations of motion at both ends of a step from t to t + h. The method
adds an auxiliary acceleration ``a``:

    (1 - alpha_m) a1 + alpha_m a0 = (1 - alpha_f) vdot1 + alpha_f vdot0
    v1 = v0 + h ((1 - gamma) a0 + gamma a1)
    q1 = q0 o exp(h v0 + h^2 ((1/2 - beta) a0 + beta a1))

All end values are affine in the position increment; ``Slopes`` holds the factors. The impulse of a force follows the
same recursion, with W in place of a and the force in place of vdot: over the step it is
h ((1 - gamma) W0 + gamma W1), so the impulses of all forces add up to the change of momentum, to rounding.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from fmus.kernels.jit import allocating, kernel

if TYPE_CHECKING:
    from typing import TypeVar

    from fmus.physics.arrays import Floats

    Quantity = TypeVar("Quantity", float, Floats)  # of one coordinate, or of many in an array of any shape


order = 2


class GeneralizedAlpha(NamedTuple):
    """Coefficients of the method, dimensionless."""

    alpha_m: float  # weight of the old auxiliary acceleration
    alpha_f: float  # weight of the old true acceleration
    beta: float  # Newmark's, positions
    gamma: float  # Newmark's, velocities


class Slopes(NamedTuple):
    """Derivatives of the end values of a step with respect to its position increment."""

    a: float  # 1/s2, of the auxiliary acceleration
    v: float  # 1/s, of the velocity
    vdot: float  # 1/s2, of the true acceleration


BACKWARD = GeneralizedAlpha(0.0, 0.0, 1.0, 1.0)  # backward Euler, order 1: for the static equilibrium
WITHOUT_MEMORY = GeneralizedAlpha(0.0, 0.0, 0.5, 1.0)  # order 1, reads no earlier acceleration: for single short steps


@kernel
def coefficients(radius: float) -> GeneralizedAlpha:
    """Second-order method with spectral ``radius`` at infinite frequency: 0 (most damping) to 1 (none)."""
    alpha_m = (2.0 * radius - 1.0) / (radius + 1.0)
    alpha_f = radius / (radius + 1.0)
    gamma = 0.5 + alpha_f - alpha_m
    beta = 0.25 * (gamma + 0.5) ** 2
    return GeneralizedAlpha(alpha_m, alpha_f, beta, gamma)


@kernel
def slopes(c: GeneralizedAlpha, h: float) -> Slopes:
    """Slopes of the coefficients ``c`` for a step of ``h`` s."""
    a = 1.0 / (c.beta * h * h)
    return Slopes(a, c.gamma / (c.beta * h), a * (1.0 - c.alpha_m) / (1.0 - c.alpha_f))


@allocating
def auxiliary(c: GeneralizedAlpha, a0: Quantity, vdot0: Quantity, vdot1: Quantity) -> Quantity:
    """Auxiliary acceleration a1 (or impulse rate W1) from a0 and the true values at both ends, in their unit."""
    per = 1.0 / (1.0 - c.alpha_m)  # one division for all coordinates
    return per * ((1.0 - c.alpha_f) * vdot1 + c.alpha_f * vdot0 - c.alpha_m * a0)
