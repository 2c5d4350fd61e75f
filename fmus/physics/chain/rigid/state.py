"""State of a chain of rigid links; what all States have: ``chain.state``."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fmus.physics.arrays import Floats
from fmus.physics.chain import state
from fmus.physics.chain.sums import SUMS


class State(NamedTuple):
    """Views into the flat state: n links, p pins, m wheels."""

    flat: np.ndarray
    q: np.ndarray  # (n, 7) poses: centre of mass, quaternion
    v: np.ndarray  # (n, 6) velocity, angular velocity in body axes
    a: np.ndarray  # (n, 6) auxiliary accelerations
    vdot: np.ndarray  # (n, 6) accelerations
    wrench: np.ndarray  # (m + 1, 6) on each wheel now, and on the ground
    aux: np.ndarray  # (m + 1, 6) auxiliary wrenches
    mean: np.ndarray  # (m + 1, 6) over the communication step
    soil: np.ndarray  # (k, 3) force of the ground on each link now, N; none where nobody asks
    soil_aux: np.ndarray  # (k, 3) auxiliary
    soil_mean: np.ndarray  # (k, 3) over the communication step
    sums: np.ndarray  # (SUMS) of the last evaluation
    lam: np.ndarray  # (p, 5) multipliers of the pins
    load: np.ndarray  # (p, 3) force of teeth and damping on each pin now: half of it on either of its links, N


def shapes(links: int, closed: bool, wheels: int, soiled: int = 0) -> state.Shapes:
    """Of the views; ``soiled``: links whose force on the ground is asked for, all or none."""
    pins, on, soil = (links if closed else links + 1), (wheels + 1, 6), (soiled, 3)
    motion = links, 6
    return {
        "q": (links, 7), "v": motion, "a": motion, "vdot": motion, "wrench": on, "aux": on, "mean": on,
        "soil": soil, "soil_aux": soil, "soil_mean": soil, "sums": (SUMS,), "lam": (pins, 5), "load": (pins, 3),
    }  # fmt: skip


def views(flat: Floats, sizes: state.Shapes) -> State:
    """A State that looks into the flat array; ``sizes`` from ``shapes``."""
    found: State = state.views(State, sizes, flat)
    return found
