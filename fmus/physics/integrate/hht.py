"""Coefficients of the Hilber-Hughes-Taylor method, a member of ``generalized_alpha``.

Improved numerical dissipation for time integration algorithms in structural dynamics, Earthquake Engineering and
Structural Dynamics 5, 1977, doi:10.1002/eqe.4290050306; as a member of the family: Chung, Hulbert, Journal of Applied
Mechanics 60, 1993, doi:10.1115/1.2900803. Forces are averaged over a step, inertia forces are taken at its end:
alpha_m = 0, and alpha_f is the authors' -alpha. At LEAST it equals the generalised-alpha method of the same radius.
"""

from __future__ import annotations

from fmus.kernels.jit import kernel
from fmus.physics.integrate.generalized_alpha import GeneralizedAlpha

order = 2
LEAST = 0.5  # spectral radius at infinite frequency: alpha = -1/3


@kernel
def coefficients(radius: float) -> GeneralizedAlpha:
    """Method with spectral ``radius`` at infinite frequency, from LEAST to 1 (trapezoidal rule)."""
    alpha_f = (1.0 - radius) / (1.0 + radius)
    return GeneralizedAlpha(0.0, alpha_f, 0.25 * (1.0 + alpha_f) ** 2, 0.5 + alpha_f)
