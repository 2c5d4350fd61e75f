"""Communication step over which the integrators of a chain advance it."""

from __future__ import annotations

from typing import NamedTuple

from fmus.physics.arrays import Floats


class CommunicationStep(NamedTuple):
    """Motion of the wheels over a communication step, and its length."""

    wheels: Floats  # (m, 15) motions at its start
    h: float  # length, s
    longest: float  # longest internal step, s
