"""What acts on a chain besides what it touches: gravity, damping, and the ends of an open one."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

LOOP, PINNED, PULLED, HELD = range(4)  # how the ends are held: LOOP has none, HELD lets the last pin go


class Environment(NamedTuple):
    """Constant through a run."""

    gravity: float  # m/s2
    ends: int  # LOOP, PINNED, PULLED or HELD
    pull: np.ndarray  # (2, 3) force on the first and on the last pin, N; (2, 2) of x and z of a planar chain
    transverse: float  # damping of each pin across the chain, N s/m
    mount: int  # the wheel that shows the carrier (``carrier``), below 0 without wheels
