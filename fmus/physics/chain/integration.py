"""Loads on a chain, the communication step over which it is integrated, and the outcome.

A kernel that solves or searches for one thing returns -1, or the index of the link, pin or wheel where it failed. One
that integrates returns an ``IntegrationOutcome``.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fmus.physics.arrays import Floats, Vector

LOOP, PINNED, PULLED, HELD = range(4)  # end conditions: LOOP has no ends, HELD fixes the first pin only


class Environment(NamedTuple):
    """Loads and end conditions, constant through a run."""

    gravity: Vector  # acceleration, m/s2
    ends: int  # end condition: LOOP, PINNED, PULLED or HELD
    pull: np.ndarray  # (2, 3) force on the first and on the last pin, N; (2, 2) along x and z for a planar chain
    transverse: float  # damping of each pin across the chain, N s/m
    mount: int  # index of the wheel that ``wheel_frame`` follows, below 0 without wheels


class CommunicationStep(NamedTuple):
    """Motion of the wheels over a communication step, and its length."""

    wheels: Floats  # (m, 15) motions at its start
    h: float  # length, s
    longest: float  # longest internal step, s


# Newton did not converge; the iteration matrix is singular; the motion is no longer finite; the pins came apart; no
# step is short enough for its tolerances; there are too many contact points
DONE, STALLED, SINGULAR, UNSTABLE, PINS_OPEN, STEP_TOO_SHORT, CROWDED = CAUSES = range(7)


class IntegrationOutcome(NamedTuple):
    """Result of an integration; link and residual are those of the failure."""

    failure: int  # DONE, 0, or the failure
    time: float  # integrated time, s
    link: int  # index of the link, from 0
    residual: float  # largest residual, N; where it is CROWDED the number of contact points
