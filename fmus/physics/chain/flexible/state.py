"""State of a chain of flexible links; the common part: ``chain.state``."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fmus.physics.arrays import Floats
from fmus.physics.chain import state
from fmus.physics.chain.on_links import NONE, LinkForcesShape
from fmus.physics.chain.sums import SUMS

FIXED = np.zeros(0)  # state of axes that do not turn


class State(NamedTuple):
    """Views into the flat state; pins (nodes) with ``width`` coordinates, m wheels."""

    flat: np.ndarray  # (size) all of the following
    p: np.ndarray  # (2, nodes, width) Cholesky coordinates and rates, from which q and v follow; (0, ...) if unused
    q: np.ndarray  # (nodes, width) coordinates: positions, m, and gradients
    v: np.ndarray  # (nodes, width) rates of ``q``, m/s and 1/s
    axes: np.ndarray  # (SIZE) see ``axes_state``; (0) where the axes of the coordinates are fixed
    a: np.ndarray  # (nodes, width) auxiliary accelerations, m/s2 and 1/s2
    vdot: np.ndarray  # (nodes, width) accelerations, m/s2 and 1/s2
    wrench: np.ndarray  # (m + 1, 6) present wrench on each wheel and, last, on the ground, N and N m
    aux: np.ndarray  # (m + 1, 6) auxiliary wrenches, N and N m
    mean: np.ndarray  # (m + 1, 6) mean wrenches over the communication step, N and N m
    on_links: np.ndarray  # (k, c) present forces on each link, see ``on_links``; k = 0 without a request
    on_links_aux: np.ndarray  # (k, c) auxiliary forces
    on_links_sum: np.ndarray  # (k, c) impulses since the interval began
    span: np.ndarray  # (2) time since then, s, and steps left of the interval
    lengths: np.ndarray  # (2) of the steps of the auxiliary values, see ``short_steps``
    sums: np.ndarray  # (SUMS) of the last evaluation, see ``sums``
    soil: np.ndarray  # (points, k) memory of the ground at the contact points; (0, 0) on hard ground
    rut: np.ndarray  # (k) rut of the chain, see ``contact.soil.rut``; (0) on hard ground


class Motion(NamedTuple):
    """Arguments of an evaluation, each (nodes, width)."""

    q: np.ndarray  # coordinates
    v: np.ndarray  # rates
    vdot: np.ndarray  # accelerations
    axes: np.ndarray = FIXED  # state of the axes of the coordinates, see ``State``


def shapes(
    width: int,
    nodes: int,
    wheels: int,
    axes: int = 0,
    forces: LinkForcesShape = NONE,
    cholesky: bool = False,
    ground: state.GroundMemory = state.HARD,
) -> state.Shapes:
    """Shapes of the views; ``width``: coordinates of a pin.

    ``axes``: size of the axes' state; ``forces``: shape of the forces on each link; ``cholesky``: with its coordinates;
    ``ground``: its memory.
    """
    pins, on = (nodes, width), (wheels + 1, 6)
    return {
        "p": (2 * cholesky, *pins), "q": pins, "v": pins, "axes": (axes,), "a": pins, "vdot": pins,
        "wrench": on, "aux": on, "mean": on, "on_links": forces, "on_links_aux": forces, "on_links_sum": forces,
        "span": (2,), "lengths": (2,), "sums": (SUMS,), **ground.shapes,
    }  # fmt: skip


def views(flat: Floats, sizes: state.Shapes) -> State:
    """State of views into the array ``flat``; ``sizes`` from ``shapes``."""
    state_views: State = state.views(State, sizes, flat)
    return state_views
