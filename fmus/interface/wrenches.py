"""Mean wrenches that a component receives: extrapolated where that is asked, and warned of where they swing.

A master that steps all parts at once (Jacobi) brings means over the step before. Extrapolated, the mean W of a step of
h1 s and the mean W' of the step of h2 s before it give, for a step of h s,

    W + (W - W') (h + h1) / (h1 + h2),  (1)

the value in the middle of the step on the line through both means in the middle of theirs. In the second step W' is
that of the start, and h2 = h1: what the start missed, where a vehicle does not begin at rest, is made up for.
"""

from __future__ import annotations

import numpy as np

from fmus.interface.ports import WRENCH, Port
from fmus.interface.sentences import Sentence
from fmus.kernels.jit import kernel
from fmus.physics.arrays import Floats

CHOICES = "no", "linear"  # of the parameter
LAST, BEFORE, WARNED, FIRST = range(4)  # in ``received``: the last two steps, s, 0 for none; a flag; the wrenches
LONG_EXCHANGE = "the communication step is too long for this exchange, take half of it"
SWING = (
    "at t = {0:.6g} s the force of {1:name} swings to and fro by {2:.3g} N from step to step, {3:.2g} times the weight:"
    f" {LONG_EXCHANGE}"
)
LEAST_SWING = 0.2  # swing of a force in three steps that is warned of, over the weight of the vehicle


def extrapolate_port() -> Port:
    """Parameter of a component that receives mean wrenches."""
    text = (
        "whether received mean wrenches are extrapolated over the step by the last two, for masters that bring those of"
        " the step before (Jacobi)"
    )
    return Port("extrapolate", "parameter", "1", text, CHOICES[0], CHOICES)


def swing_sentence(names: tuple[str, ...]) -> Sentence:
    """Warning of forces that swing; ``names``: of the ports."""
    return Sentence(SWING, names)


def received(count: int) -> int:
    """Length of the part of a state that remembers ``count`` numbers of wrenches, those of the last two steps."""
    return FIRST + 2 * count


@kernel
def expected(r: Floats, u: Floats, first: int, h: float, out: Floats) -> None:
    """Write the inputs ``u`` that ``r`` remembers, from ``first`` on, to ``out`` as expected over h s. (1)"""
    factor, before = 0.0, r[BEFORE] if r[BEFORE] > 0.0 else r[LAST]
    if before > 0.0:
        factor = (h + r[LAST]) / (r[LAST] + before)
    for i in range(first, first + (r.size - FIRST) // 2):
        out[i] = u[i] + factor * (u[i] - r[FIRST + i - first])


@kernel
def keep(r: Floats, u: Floats, first: int, h: float) -> None:
    """Remember the wrenches from ``first`` on in the inputs ``u`` of a step of h s."""
    n = (r.size - FIRST) // 2
    for i in range(n):
        r[FIRST + n + i] = r[FIRST + i]
        r[FIRST + i] = u[first + i]
    r[BEFORE], r[LAST] = r[LAST], h


@kernel
def warn_of_swing(r: Floats, u: Floats, t: float, weight: float, message: Floats) -> None:
    """Write a warning, once, if the force of a port has changed, and changed back, by too much of the ``weight``, N.

    ``u``: inputs that begin with the wrenches that ``r`` remembers; ``message``: 1, then the numbers of the sentence.
    """
    if r[BEFORE] == 0.0 or r[WARNED] == 1.0 or not weight > 0.0:
        return
    n = (r.size - FIRST) // 2
    largest, port = 0.0, 0
    for k in range(n // WRENCH):
        along = change = change_before = 0.0
        for i in range(WRENCH * k, WRENCH * k + 3):
            d, d0 = u[i] - r[FIRST + i], r[FIRST + i] - r[FIRST + n + i]
            along += d * d0
            change += d * d
            change_before += d0 * d0
        swing = np.sqrt(min(change, change_before))
        if along < 0.0 and swing > largest:
            largest, port = swing, k
    if largest > LEAST_SWING * weight:
        r[WARNED] = message[0] = 1.0
        message[1], message[2], message[3], message[4] = t, port, largest, largest / weight
