"""Wires: inputs that are, bit by bit, what the log holds of another component's outputs, and are recorded there only.

What a coupling hands over is an output as it was at the beginning of the step ("start"), at its end ("end") or the mean
of both ("middle"); what it makes otherwise, by extrapolation or iteration, is recorded in full.
"""

from __future__ import annotations

from typing import Literal, NamedTuple, get_args

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Rule = Literal["start", "end", "middle"]
RULES: tuple[Rule, ...] = get_args(Rule)


class Wire(NamedTuple):
    """Inputs of a topic that one rule makes of outputs of another."""

    source: str  # topic of the outputs
    rule: Rule
    outputs: tuple[str, ...]
    inputs: tuple[str, ...]  # as many


def handed_over(rule: Rule, start: Floats, end: Floats) -> Floats:
    """The inputs of a step, from the outputs at its beginning and at its end; of any shape."""
    if rule == "middle":
        return 0.5 * (start + end)
    return start if rule == "start" else end
