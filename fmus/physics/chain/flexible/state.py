"""State of a chain of flexible links; what all States have: ``chain.state``."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fmus.physics.arrays import Floats
from fmus.physics.chain import state
from fmus.physics.chain.on_links import NONE, Felt
from fmus.physics.chain.sums import SUMS

FIXED = np.zeros(0)  # axes of coordinates that do not turn


class State(NamedTuple):
    """Views into the flat state: pins with ``width`` coordinates."""

    flat: np.ndarray
    p: np.ndarray  # (2, nodes, width) Cholesky coordinates and rates, which q and v follow from; (0, ...): none
    q: np.ndarray  # (nodes, width) coordinates
    v: np.ndarray  # (nodes, width) rates
    axes: np.ndarray  # that of ``axes_state``; (0) where the axes of the coordinates are fixed
    a: np.ndarray  # (nodes, width) auxiliary accelerations
    vdot: np.ndarray  # (nodes, width) accelerations
    wrench: np.ndarray  # (m + 1, 6) on each wheel now, and on the ground
    aux: np.ndarray  # (m + 1, 6) auxiliary wrenches
    mean: np.ndarray  # (m + 1, 6) over the communication step
    on_links: np.ndarray  # (k, c) forces on each link now, see ``on_links``; none where nobody asks
    on_links_aux: np.ndarray  # (k, c) auxiliary
    on_links_sum: np.ndarray  # (k, c) impulses since the interval began
    span: np.ndarray  # (2) how long that was, s, and steps left of the interval
    sums: np.ndarray  # (SUMS) of the last evaluation


class Motion(NamedTuple):
    """What an evaluation looks at, each (nodes, width)."""

    q: np.ndarray  # coordinates
    v: np.ndarray  # rates
    vdot: np.ndarray  # accelerations
    axes: np.ndarray = FIXED  # those of the coordinates, see ``State``


def shapes(
    width: int,
    nodes: int,
    wheels: int,
    axes: int = 0,
    felt: Felt = NONE,
    cholesky: bool = False,
) -> state.Shapes:
    """Of the views; ``width``: coordinates of a pin.

    ``felt``: of the forces on each link; ``cholesky``: whether it moves in these coordinates.
    """
    pins, on = (nodes, width), (wheels + 1, 6)
    return {
        "p": (2 * cholesky, *pins), "q": pins, "v": pins, "axes": (axes,), "a": pins, "vdot": pins,
        "wrench": on, "aux": on, "mean": on, "on_links": felt, "on_links_aux": felt, "on_links_sum": felt, "span": (2,),
        "sums": (SUMS,),
    }  # fmt: skip


def views(flat: Floats, sizes: state.Shapes) -> State:
    """A State that looks into the flat array; ``sizes`` from ``shapes``."""
    found: State = state.views(State, sizes, flat)
    return found
