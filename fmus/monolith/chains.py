"""The door from the monolith to its chains: the class of a chain says which model of links it has.

Kernels call kernels by import; these stand-ins choose theirs when they are compiled, by type, so that a scene of rigid
links loads no elements. The siblings behind the door are ``flexible`` and ``rigid``.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numba.extending import overload

Floats = np.ndarray


class Place(NamedTuple):
    """Where a chain stands in the whole; m wheels."""

    start: int  # of its part of the state
    end: int
    seen: np.ndarray  # (m) which motion each wheel has
    wrench: int  # the first of its m + 1 wrenches, the last one being the ground's
    frame: np.ndarray  # (5) of the track, see fmus.physics.wheels
    rows: np.ndarray  # (m, 15) its wheels now
    impulse: np.ndarray  # (m + 1, 6) of its wrenches over the step
    books: np.ndarray  # (4) dissipated, work of the loads on its ends, lost by covered parts, J; travel m; of the step


class Flexible(NamedTuple):
    """A chain of cable elements."""

    place: Place
    links: Any
    contacts: Any  # None where there are none
    env: Any
    q: Floats  # (nodes, 8) views of the stage's argument
    v: Floats
    still: Floats  # (nodes, 8) zeros
    scratch: Floats  # (2, nodes, 8)
    w: Any  # holds the factored mass


class Rigid(NamedTuple):
    """A chain of rigid links."""

    place: Place
    link: Any
    ends: Any
    contacts: Any  # None where there are none
    env: Any
    s: Any  # the state, q and v views of the stage's argument
    w: Any


def slopes(c, k) -> int:
    """Derivatives of the chain's part of the state into ``k``; -1, or the link where that failed."""
    return int(_kernels(type(c)).slopes(c, k))


def wrenches(c) -> Floats:
    """Wrenches (m + 1, 6) of the last evaluation, in the track's frame."""
    return _kernels(type(c)).wrenches(c)


def powers(c) -> tuple[float, float, float]:
    """Dissipated power, power of the loads on the ends, power that covered parts lose, of the last evaluation, W."""
    return _kernels(type(c)).powers(c)


def speed(c) -> float:
    """Speed of the chain along itself, m/s."""
    return float(_kernels(type(c)).speed(c))


def close(c) -> bool:
    """Take back what the equations of the pins drifted in a step. False: not possible."""
    return bool(_kernels(type(c)).close(c))


def _kernels(chain: type) -> Any:
    """The module of a kind of chain."""
    if chain is Rigid:
        from fmus.monolith import rigid

        return rigid
    from fmus.monolith import flexible

    return flexible


OPTIONS = {"error_model": "numpy", "nogil": True, "_nrt": True}  # as ``fmus.jit.allocating``


@overload(slopes, jit_options=OPTIONS)
def _slopes(c, k) -> Any:
    return _kernels(c.instance_class).slopes.py_func


@overload(wrenches, jit_options=OPTIONS)
def _wrenches(c) -> Any:
    return _kernels(c.instance_class).wrenches.py_func


@overload(powers, jit_options=OPTIONS)
def _powers(c) -> Any:
    return _kernels(c.instance_class).powers.py_func


@overload(speed, jit_options=OPTIONS)
def _speed(c) -> Any:
    return _kernels(c.instance_class).speed.py_func


@overload(close, jit_options=OPTIONS)
def _close(c) -> Any:
    return _kernels(c.instance_class).close.py_func
