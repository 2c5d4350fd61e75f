"""Wires: inputs that equal recorded outputs of another component and are not recorded again.

The input is the output at the beginning of the step ("start"), at its end ("end") or the mean of both ("middle").
Inputs that a coupling extrapolates or iterates have no wire and are recorded.
"""

from __future__ import annotations

from typing import Literal, NamedTuple, get_args

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Rule = Literal["start", "end", "middle"]
RULES: tuple[Rule, ...] = get_args(Rule)


class Wire(NamedTuple):
    """Inputs of a topic that follow from outputs of another topic by one rule."""

    source: str  # topic of the outputs
    rule: Rule
    outputs: tuple[str, ...]
    inputs: tuple[str, ...]  # as many


def wired_inputs(rule: Rule, start: Floats, end: Floats) -> Floats:
    """Return the inputs of a step from the outputs at its beginning and end, all of one shape."""
    if rule == "middle":
        return 0.5 * (start + end)
    return start if rule == "start" else end
