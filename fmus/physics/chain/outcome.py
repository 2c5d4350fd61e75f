"""Results of kernels that may fail.

A kernel that solves or searches for one thing returns -1, or the index of the link, pin or wheel where it failed. One
that integrates returns an ``IntegrationOutcome``.
"""

from __future__ import annotations

from typing import NamedTuple

# Newton did not converge; the iteration matrix is singular; the motion is no longer finite; the pins came apart; no
# step is short enough for its tolerances
DONE, STALLED, SINGULAR, UNSTABLE, PINS_OPEN, STEP_TOO_SHORT = range(6)


class IntegrationOutcome(NamedTuple):
    """Result of an integration; link and residual are those of the failure."""

    failure: int  # DONE, 0, or the failure
    time: float  # integrated time, s
    link: int  # index of the link, from 0
    residual: float  # largest residual, N
