"""State of a chain of rigid links; what all States have: ``chain.state``."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fmus.physics.arrays import Floats
from fmus.physics.chain import state
from fmus.physics.chain.on_links import NONE, Felt
from fmus.physics.chain.sums import SUMS


class State(NamedTuple):
    """Views into the flat state: n links, p pins, m wheels."""

    flat: np.ndarray
    joints: np.ndarray  # (k) joint coordinates and their rates (``joints``), k = 0 in the augmented formulation
    q: np.ndarray  # (n, 7) poses: centre of mass, quaternion
    v: np.ndarray  # (n, 6) velocity, angular velocity in body axes
    a: np.ndarray  # (n, 6) auxiliary accelerations
    vdot: np.ndarray  # (n, 6) accelerations
    wrench: np.ndarray  # (m + 1, 6) on each wheel now, and on the ground
    aux: np.ndarray  # (m + 1, 6) auxiliary wrenches
    mean: np.ndarray  # (m + 1, 6) over the communication step
    on_links: np.ndarray  # (k, c) forces on each link now, see ``on_links``; none where nobody asks
    on_links_aux: np.ndarray  # (k, c) auxiliary
    on_links_sum: np.ndarray  # (k, c) impulses since the interval began
    span: np.ndarray  # (2) how long that was, s, and steps left of the interval
    sums: np.ndarray  # (SUMS) of the last evaluation
    lam: np.ndarray  # (p, 5) multipliers of the pins
    load: np.ndarray  # (p, 3) force of teeth and damping on each pin now: half of it on either of its links, N
    along: np.ndarray  # (n, 1) what contacts between the pins add to the tension of a link, N


def shapes(links: int, closed: bool, wheels: int, felt: Felt = NONE, joints: int = 0) -> state.Shapes:
    """Of the views; ``felt``: of the forces on each link; ``joints``: numbers of the joint coordinates."""
    pins, on = (links if closed else links + 1), (wheels + 1, 6)
    motion = links, 6
    return {
        "joints": (joints,),
        "q": (links, 7), "v": motion, "a": motion, "vdot": motion, "wrench": on, "aux": on, "mean": on,
        "on_links": felt, "on_links_aux": felt, "on_links_sum": felt, "span": (2,), "sums": (SUMS,),
        "lam": (pins, 5), "load": (pins, 3), "along": (links, 1),
    }  # fmt: skip


def views(flat: Floats, sizes: state.Shapes) -> State:
    """A State that looks into the flat array; ``sizes`` from ``shapes``."""
    found: State = state.views(State, sizes, flat)
    return found
