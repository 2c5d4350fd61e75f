"""Loads on a chain besides contact: gravity, damping, and the conditions at the ends of an open chain."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fmus.physics.arrays import Vector

LOOP, PINNED, PULLED, HELD = range(4)  # end conditions: LOOP has no ends, HELD fixes the first pin only


class Environment(NamedTuple):
    """Loads and end conditions, constant through a run."""

    gravity: Vector  # acceleration, m/s2
    ends: int  # end condition: LOOP, PINNED, PULLED or HELD
    pull: np.ndarray  # (2, 3) force on the first and on the last pin, N; (2, 2) along x and z for a planar chain
    transverse: float  # damping of each pin across the chain, N s/m
    mount: int  # index of the wheel that the carrier follows (``carrier``), below 0 without wheels
