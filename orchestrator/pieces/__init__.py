"""Scenes without an FMU: pieces of the mechanics that the master steps as it steps components.

The door of scenes to ``fmus.physics``. A piece has outputs and points, ``advance`` moves it; ``Stepped`` gives it the
face of a component.
"""

from __future__ import annotations

from time import perf_counter
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from orchestrator.cosim.component import ComponentFailed
from orchestrator.cosim.warned import Warned

Floats = NDArray[np.float64]
COUNTERS = ("solver.steps", "solver.evaluations", "solver.iterations", "solver.rejected")


class Piece(Protocol):
    """What moves."""

    about: str  # elements and degrees of freedom, for ``cotrack show``
    outputs: dict[str, str]  # name -> unit
    count: int  # of points
    counters: NDArray[np.int32]  # in the order of COUNTERS

    def advance(self, t: float, h: float) -> None:
        """From t to t + h; raises ArithmeticError or ValueError with a sentence."""

    def values(self) -> Floats:
        """The outputs now."""

    def points(self) -> Floats:
        """Positions (count, 3), m."""


class Stepped:
    """A piece as the master, the log and the summary see a component; without inputs."""

    def __init__(self, name: str, piece: Piece) -> None:
        self.name = name
        self.piece = piece
        self.inputs: tuple[str, ...] = ()
        self.outputs = tuple(piece.outputs)
        self.links = tuple(f"point[{i}].position.{axis}" for i in range(1, piece.count + 1) for axis in "xyz")
        self.integers: tuple[str, ...] = COUNTERS
        self.u: Floats = np.zeros(0)
        self.y: Floats = np.zeros(len(self.outputs))
        self.y_links: Floats = np.zeros(len(self.links))
        self.counters: NDArray[Any] = piece.counters
        self.warnings: tuple[Warned, ...] = ()  # a piece does or fails
        self.read()
        self.wall_time = 0.0  # s

    def unit(self, name: str) -> str:
        """Unit of an output."""
        return "m" if name.startswith("point[") else self.piece.outputs[name]

    def write(self) -> None:
        """Nothing comes in."""

    def step(self, t: float, h: float) -> None:
        """From t to t + h, both in s; raises ComponentFailed."""
        began = perf_counter()
        try:
            with np.errstate(all="ignore"):  # what overflows is heard of below
                self.piece.advance(t, h)
                self.read()
        except (ArithmeticError, ValueError, np.linalg.LinAlgError) as error:
            raise ComponentFailed(f"{self.name}: {error} (step from t = {t:.6g} s)") from None
        finally:
            self.wall_time += perf_counter() - began
        if not np.isfinite(self.y).all():
            what = self.outputs[int(np.argmin(np.isfinite(self.y)))]
            raise ComponentFailed(f"{self.name}: {what} is no longer finite at t = {t + h:.6g} s: take smaller steps")

    def read(self) -> None:
        """The outputs go into ``y``."""
        self.y[:] = self.piece.values()

    def save(self) -> Any:
        """Pieces do not go back; raises ComponentFailed."""
        raise ComponentFailed(f"{self.name} cannot save its state")

    def restore(self, state: Any) -> None:
        """Nothing was saved."""

    def free(self, state: Any) -> None:
        """Nothing was saved."""

    def read_links(self) -> None:
        """The points go into ``y_links``."""
        self.y_links[:] = self.piece.points().ravel()

    def read_counters(self) -> None:
        """They are the piece's own array."""


def piece(scene: Any) -> Piece:
    """The piece of a scene, as it starts."""
    from orchestrator.pieces.bent import Cantilever, Frame
    from orchestrator.pieces.moved import Pendulum, Slider

    kinds: dict[str, Any] = {
        "pendulum": Pendulum, "cantilever": Cantilever, "frame": Frame, "slider": Slider,
    }  # fmt: skip
    made: Piece = kinds[scene.assembly](getattr(scene, scene.assembly))
    return made
