"""Models of scenes without an FMU, and what makes a component of one.

The door of scenes to ``fmus.physics``. A model has outputs and points, ``advance`` moves it; ``ModelComponent``
shows it to the master as a component.
"""

from __future__ import annotations

from time import perf_counter
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from fmus.physics.arrays import Floats
from orchestrator.cosim.component import ComponentFailed
from orchestrator.cosim.warned import Warned

COUNTERS = ("solver.steps", "solver.evaluations", "solver.iterations", "solver.rejected")


def xyz(name: str, unit: str) -> dict[str, str]:
    """Three outputs."""
    return {f"{name}.{axis}": unit for axis in "xyz"}


class Model(Protocol):
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


class ModelComponent:
    """A model as the master, the log and the summary see a component; without inputs."""

    def __init__(self, name: str, model: Model) -> None:
        self.name = name
        self.model = model
        self.inputs: tuple[str, ...] = ()
        self.outputs = tuple(model.outputs)
        self.links = tuple(f"point[{i}].position.{axis}" for i in range(1, model.count + 1) for axis in "xyz")
        self.integers: tuple[str, ...] = COUNTERS
        self.u: Floats = np.zeros(0)
        self.y: Floats = np.zeros(len(self.outputs))
        self.y_links: Floats = np.zeros(len(self.links))
        self.counters: NDArray[Any] = model.counters
        self.warnings: tuple[Warned, ...] = ()  # a model does or fails
        self.read()
        self.wall_time = 0.0  # s

    def unit(self, name: str) -> str:
        """Unit of an output."""
        return "m" if name.startswith("point[") else self.model.outputs[name]

    def write(self) -> None:
        """Nothing comes in."""

    def step(self, t: float, h: float) -> None:
        """From t to t + h, both in s; raises ComponentFailed."""
        began = perf_counter()
        try:
            with np.errstate(all="ignore"):  # what overflows is heard of below
                self.model.advance(t, h)
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
        self.y[:] = self.model.values()

    def save(self) -> Any:
        """These models do not go back; raises ComponentFailed."""
        raise ComponentFailed(f"{self.name} cannot save its state")

    def restore(self, state: Any) -> None:
        """Nothing was saved."""

    def free(self, state: Any) -> None:
        """Nothing was saved."""

    def read_links(self) -> None:
        """The points go into ``y_links``."""
        self.y_links[:] = self.model.points().ravel()

    def read_counters(self) -> None:
        """They are the model's own array."""


def model_of(scene: Any) -> Model:
    """The model of a scene, as it starts."""
    from orchestrator.without_fmu.bent import Cantilever, Frame
    from orchestrator.without_fmu.moved import Pendulum, Slider

    kinds: dict[str, Any] = {"pendulum": Pendulum, "cantilever": Cantilever, "frame": Frame, "slider": Slider}
    return kinds[scene.assembly](getattr(scene, scene.assembly))
