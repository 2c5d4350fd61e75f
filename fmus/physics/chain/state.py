"""State of a chain: one flat array, and a ``State`` of named views into it.

Every kind of link has its own State and Work (arrays allocated once). The types here are for annotations of what chains
of every kind of link have in common; a module of one kind of link names the classes of its kind instead.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

import numpy as np

from fmus.kernels.jit import by_reference, kernel
from fmus.physics.arrays import Floats, Vector

if TYPE_CHECKING:
    from fmus.physics.chain.flexible import state as flexible
    from fmus.physics.chain.rigid import state as rigid

    # The integrated views come first in ``flat``: q and v, followed by axes where the axes of the coordinates turn;
    # before them joints (of rigid links) or p (of flexible ones), of size 0 if unused, which determine q and v.
    ChainState = flexible.State | rigid.State
    ChainWork = flexible.Work | rigid.Work
    Motion = ChainState | flexible.Motion  # of a chain at an evaluation: its State, or what an implicit step evaluates


WheelFrame = tuple[Vector, Vector, Vector, tuple[float, float]]  # result of ``wheel_frame``
# result of ``interface.locate_section``; Any: each kind of link puts into it what it reads from it
Section = tuple[Any, ...]
Links = object  # parameters of links: of any class that ``jit.implemented_in`` declares


class FacedLinks(Protocol):
    """Parameters of links that may touch."""

    @property
    def face(self) -> float:
        """Distance of the contact faces from the pin line, m."""


Shapes = dict[str, tuple[int, ...]]  # shapes of the views, in order


class GroundMemory(NamedTuple):
    """Sizes of what the ground remembers under a chain; hard ground remembers nothing."""

    points: int  # rows: contact points of all links on the ground
    memory: int  # width of a row, 0 on hard ground
    pending: int  # width of a row that an evaluation writes
    rut: int  # length of the rut

    @property
    def shapes(self) -> Shapes:
        """Shapes of the views that hold it, the rut last: the state is restored without it."""
        return {"soil": (self.points, self.memory), "rut": (self.rut,)}


HARD = GroundMemory(0, 0, 0, 0)
NO_RUT = np.zeros(0)
FORGOTTEN = 1  # entry of a rut: 1 if a part of it was forgotten, 2 once that is reported


def size(shapes: Shapes) -> int:
    """Length of the flat array."""
    return sum(int(np.prod(shape)) for shape in shapes.values())


def views(kind: Any, shapes: Shapes, flat: np.ndarray) -> Any:
    """Return a State of the class ``kind`` of views into the array ``flat``."""
    parts = np.split(flat, np.cumsum([int(np.prod(shape)) for shape in shapes.values()])[:-1])
    named = {name: part.reshape(shape) for (name, shape), part in zip(shapes.items(), parts, strict=True)}
    return by_reference(kind(flat=flat, **named))


def integrated_views(s: Any) -> dict[str, np.ndarray]:
    """Views that an explicit integrator advances, in order from the start of ``flat``."""
    others = [name for name in ("joints", "p") if name in s._fields and getattr(s, name).size > 0]
    return {name: getattr(s, name) for name in others or ["q", "v", "axes"] if name in s._fields}


@kernel
def copy(source: Floats, target: Floats) -> None:
    """Copy a flat array (n) to another of the same length."""
    for i in range(target.size):
        target[i] = source[i]


@kernel
def copy_rows(source: Floats, target: Floats) -> None:
    """Copy rows (k, c) to rows of the same shape."""
    for k in range(target.shape[0]):
        for i in range(target.shape[1]):
            target[k, i] = source[k, i]


@kernel
def add_share(share: float, source: Floats, target: Floats) -> None:
    """Add ``share`` times rows (k, c) to rows of the same shape."""
    for k in range(target.shape[0]):
        for i in range(target.shape[1]):
            target[k, i] += share * source[k, i]


@kernel
def store_evaluation(s: ChainState, w: ChainWork) -> None:
    """Copy wrenches, forces on links, turning of pins and sums of the last evaluation from ``w`` to the state."""
    copy_rows(w.wrench, s.wrench)
    copy_rows(w.on_links, s.on_links)
    copy_rows(w.bushes.turning, s.turning)
    for i in range(s.sums.shape[0]):
        s.sums[i] = w.sums[i]


@kernel
def store_first_evaluation(s: ChainState, w: ChainWork) -> None:
    """``store_evaluation`` for a new state: its means are the present values."""
    store_evaluation(s, w)
    s.span[0], s.span[1] = 1.0, 0.0
    s.lengths[:] = 0.0
    s.turned[:] = 0.0
    copy_rows(w.wrench, s.aux)
    copy_rows(w.wrench, s.mean)
    copy_rows(w.on_links, s.on_links_aux)
    copy_rows(w.on_links, s.on_links_sum)
