"""Series of a track's outputs: names of wheels and links, values at the start, integrals."""

from __future__ import annotations

import re

import numpy as np

from mirror.check import View
from mirror.record import Floats

AXES = {axis: k for k, axis in enumerate("xyz")}


def wheel_names(view: View) -> list[str]:
    return [wheel["name"] for wheel in view.track["wheels"]]


def with_start(first: Floats, steps: Floats) -> Floats:
    """Prepend the value at the start to those of the steps."""
    return np.concatenate([first[None], steps])


def integrated(view: View, rates: Floats) -> Floats:
    """Integral of a rate at instants by the trapezium rule, as the component sums it."""
    return np.concatenate([[0.0], np.cumsum(0.5 * view.part.h * (rates[1:] + rates[:-1]))])


def link_number(name: str) -> int:
    return int(re.search(r"\[(\d+)\]", name).group(1)) - 1
