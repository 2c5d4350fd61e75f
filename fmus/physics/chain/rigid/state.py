"""State of a chain of rigid links; the common part: ``chain.state``."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fmus.physics.arrays import Floats
from fmus.physics.chain import state
from fmus.physics.chain.on_links import NONE, LinkForcesShape
from fmus.physics.chain.sums import SUMS


class State(NamedTuple):
    """Views into the flat state: n links, p pins, m wheels."""

    flat: np.ndarray  # (size) all of the following
    joints: np.ndarray  # (k) joint coordinates and their rates (``joints``), k = 0 in the augmented formulation
    q: np.ndarray  # (n, 7) poses: centre of mass, m, quaternion
    v: np.ndarray  # (n, 6) velocity, m/s, angular velocity in body axes, rad/s
    a: np.ndarray  # (n, 6) auxiliary accelerations, m/s2 and rad/s2
    vdot: np.ndarray  # (n, 6) accelerations, m/s2 and rad/s2
    wrench: np.ndarray  # (m + 1, 6) present wrench on each wheel and, last, on the ground, N and N m
    aux: np.ndarray  # (m + 1, 6) auxiliary wrenches, N and N m
    mean: np.ndarray  # (m + 1, 6) mean wrenches over the communication step, N and N m
    on_links: np.ndarray  # (k, c) present forces on each link, see ``on_links``; k = 0 without a request
    on_links_aux: np.ndarray  # (k, c) auxiliary forces
    on_links_sum: np.ndarray  # (k, c) impulses since the interval began
    span: np.ndarray  # (2) time since then, s, and steps left of the interval
    lengths: np.ndarray  # (2) of the steps of the auxiliary values, see ``short_steps``
    sums: np.ndarray  # (SUMS) of the last evaluation, see ``sums``
    lam: np.ndarray  # (p, 5) multipliers of the pins, N and N m
    load: np.ndarray  # (p, 3) present force of teeth and damping on each pin, N: half on either link
    along: np.ndarray  # (n, 1) tension of a link due to contacts between its pins, N
    soil: np.ndarray  # (points, k) memory of the ground at the contact points; (0, 0) on hard ground
    rut: np.ndarray  # (k) rut of the chain, see ``contact.soil.rut``; (0) on hard ground


def shapes(
    links: int,
    closed: bool,
    wheels: int,
    forces: LinkForcesShape = NONE,
    joints: int = 0,
    ground: state.GroundMemory = state.HARD,
) -> state.Shapes:
    """Shapes of the views.

    ``forces``: shape of the forces on each link; ``joints``: number of joint coordinates with rates; ``ground``: its
    memory.
    """
    pins, on = (links if closed else links + 1), (wheels + 1, 6)
    motion = links, 6
    return {
        "joints": (joints,),
        "q": (links, 7), "v": motion, "a": motion, "vdot": motion, "wrench": on, "aux": on, "mean": on,
        "on_links": forces, "on_links_aux": forces, "on_links_sum": forces, "span": (2,), "lengths": (2,),
        "sums": (SUMS,), "lam": (pins, 5), "load": (pins, 3), "along": (links, 1),
        **ground.shapes,
    }  # fmt: skip


def views(flat: Floats, sizes: state.Shapes) -> State:
    """State of views into the array ``flat``; ``sizes`` from ``shapes``."""
    state_views: State = state.views(State, sizes, flat)
    return state_views
