"""What a component's model is to its FMU shell: ports, a flat state, four functions."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from fmus.physics.arrays import Floats
from fmus.ports import Port


class InvalidParameter(ValueError):
    """A parameter has a value that the model does not accept; the message is one clear sentence."""


class StepFailed(RuntimeError):
    """A step could not be done; the message is one sentence with time, place and residual."""


MOST_STEPS = 100_000  # internal steps in one communication step: more would look like a process that hangs


def finite(values: Floats) -> bool:
    """Whether all are: one look at their squares, at each where one of those is too large."""
    return math.isfinite(values.dot(values)) or bool(np.isfinite(values).all())


def check_steps(t: float, h: float, longest: float) -> None:
    """Refuse a communication step of ``h`` s at ``t`` that takes too many steps of ``longest`` s."""
    if h / longest > MOST_STEPS:
        raise StepFailed(
            f"at t = {t:.6g} s a communication step of {h:.3g} s takes {h / longest:.3g} internal steps of"
            f" {longest:.3g} s: {MOST_STEPS} are allowed"
        )


def check_orientation(t: float, name: str, q: Floats) -> None:
    """Refuse a quaternion ``q`` (4) of the input ``name`` that is no rotation."""
    length = math.hypot(*q)
    if not 0.9 < length < 1.1:
        raise StepFailed(f"at t = {t:.6g} s the input {name}.orientation is no rotation: its length is {length:.3g}")


class Model(Protocol):
    """A component without FMI.

    ``ports`` lists Real inputs first, then Real outputs, then Real link outputs, then Integer outputs, then
    parameters (Real and String). ``state`` is everything that changes between steps, one contiguous float64
    array made once: saving a model is copying it (and ``counters``), restoring is copying back in place.
    """

    kernel: Any  # what a step spends its time in: compiled at the first one on a machine
    ports: tuple[Port, ...]
    link_ports: int  # how many of the Real outputs, the last ones, are link outputs (computed only when read)
    state: Floats
    counters: NDArray[np.int64]  # values of the Integer outputs, in port order

    def __init__(self, config: Mapping) -> None:
        """``config`` is the resolved JSON that the build packed beside the component."""

    def initialise(self, parameters: Mapping[str, float | int | str]) -> None:
        """Set ``state`` to the start; raises InvalidParameter or StepFailed."""

    def step(self, t: float, h: float, u: Floats) -> None:
        """Advance ``state`` from t to t + h with the inputs ``u`` given at t; raises StepFailed."""

    def outputs(self, y: Floats) -> None:
        """Write the Real outputs (without link outputs) that belong to ``state`` into ``y``."""

    def link_outputs(self, y: Floats) -> None:
        """Write the Real link outputs that belong to ``state`` into ``y``."""

    def warnings(self) -> list[str]:
        """Sentences to log with status warning since the last call; empties the list."""
