"""Motions of the wheels that a track receives: read, checked against those at the start, and against those assumed.

Over a step the wheels move on with the velocities that they had at its beginning. The next motions tell how far off
that was; times the mean force of the step it is energy that the exchange has put into the vehicle, or taken out of it.
Over the tension at rest times the pitch it is below 0.1 % a step where the step is right, 1.5 % where a brake locks in
steps of 4 ms, and grows without bound where the exchange is unstable (`../in_your_tool.md`).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from fmus.interface.model import no_rotation, not_given, too_many_steps
from fmus.interface.ports import STATE
from fmus.kernels.jit import kernel
from fmus.physics.arrays import Floats
from fmus.physics.chain.report import STEPS, T_MAX, T_MEAN
from fmus.physics.elementary import acos
from fmus.physics.vector import add, dot, scale, vector
from fmus.physics.wheels import WIDTH, read_state
from fmus.track.failures import (
    APART,
    ASKEW,
    CREATED,
    ELSEWHERE,
    NO_WHEEL,
    OFF_ITS_PLACE,
    TAUT,
    TILTED,
    TOO_LONG,
    TURNED,
)

if TYPE_CHECKING:
    from fmus.track.steps import CommonData

# Cosine of the angle between a wheel's axis and the pins of links that stay in their plane:
ALIGNED = 0.9999939076577904  # cos 0.2 deg: a larger angle is a warning, because the plane of the links holds back
OUT_OF_PLANE = 0.9961946980917455  # cos 5 deg: a larger angle is a failure, because the results are wrong
MAX_TURNED = 0.9999143275740072  # cosine of the angle (0.75 deg) by which wheels may be turned at the start
# Pitches by which a wheel is off its place at the start, beside the play of the guides: more than the first are a
# warning, more than the second, which change the mean tension by 1.5 %, a failure.
NOTICED, MISPLACED = 1e-3, 0.02
MAX_APART = 5.0  # pitches by which the distance of a wheel from the first one may differ from that at the start
LENGTH, REST, WHEELS = range(3)  # in ``exchange``: last step, s, 0 for none; tension at rest, N; wheels
MOTION = 6  # numbers of a wheel: position and velocity in the track's frame
MAX_CREATED = 0.02  # energy in a step that is warned of, over tension at rest times pitch
MAX_TENSION = 20.0  # tension that is warned of, over that at rest


def exchange_size(wheels: int) -> int:
    """Length of the part of a track's state that remembers its exchange."""
    return WHEELS + MOTION * wheels


@kernel
def read_wheels(c: CommonData, messages: Floats, t: float, h: float, u: Floats) -> int:
    """Read the wheels from the inputs and check them; 0, or the failure."""
    if too_many_steps(messages[0], t, h, c.longest):
        return TOO_LONG
    cosine = 1.0
    for k in range(u.size // STATE):
        if not_given(c.counters[STEPS], u, STATE * k + 3):
            for i in range(WIDTH):
                c.rows[k, i] = c.start_rows[k, i]
        elif not read_state(u[STATE * k : STATE * k + STATE], c.frame, c.rows[k]):
            no_rotation(messages[0], t, k, u, STATE * k + 3)
            return NO_WHEEL
        else:
            cosine = min(cosine, dot(vector(c.rows[k], 9), vector(c.start_rows[k], 9)))
    failure = 0
    if c.counters[STEPS] == 0 and u.size > 0:
        failure = _check_places(c, messages, t, min(cosine, _turned(c.rows, c.start_rows)))
    if failure == 0:
        failure = _check_distances(c, messages, t, u.size // STATE)
    if failure == 0 and c.plane == 1 and u.size > 0:
        failure = _check_axes(c, messages, t)
    if failure == 0 and u.size > 0:
        _observe(c, messages, t, h)
    return failure


@kernel
def _check_places(c: CommonData, messages: Floats, t: float, cosine: float) -> int:
    """Compare the wheels of the first step with those of the start; 0, or the failure.

    ``cosine``: of the largest angle by which they are turned.
    """
    farthest, wheel = 0.0, 0
    for k in range(c.rows.shape[0]):
        distance_squared = 0.0
        for i in range(3):
            off = abs(c.rows[k, i] - c.start_rows[k, i])
            distance_squared += max(off - (c.play if i == 1 else 0.0), 0.0) ** 2
        deviation = np.sqrt(distance_squared)
        if deviation > farthest:
            farthest, wheel = deviation, k
    if farthest <= c.pitch and not cosine > MAX_TURNED:
        messages[0, 0], messages[0, 1] = t, acos(max(cosine, -1.0)) * 180.0 / np.pi
        return TURNED
    if farthest > NOTICED * c.pitch:
        refused = farthest > MISPLACED * c.pitch
        row, at = (0, 0) if refused else (1 + OFF_ITS_PLACE, 1)
        messages[row, at], messages[row, at + 1], messages[row, at + 2] = t, wheel, farthest
        for i in range(3):
            messages[row, at + 3 + i] = c.rows[wheel, i] - c.start_rows[wheel, i]
        if refused:
            return ELSEWHERE
        messages[row, 0] = 1.0
    return 0


@kernel
def _check_distances(c: CommonData, messages: Floats, t: float, wheels: int) -> int:
    """Compare the distances of the ``wheels`` from the first one with those at the start; 0, or the failure."""
    for k in range(1, wheels):
        distance, start_distance = _distance(c.rows, k), _distance(c.start_rows, k)
        if not abs(distance - start_distance) < MAX_APART * c.pitch:
            messages[0, 0], messages[0, 1], messages[0, 2] = t, k, distance
            messages[0, 3], messages[0, 4] = start_distance, 0
            return APART
    return 0


@kernel
def _check_axes(c: CommonData, messages: Floats, t: float) -> int:
    """Compare the axes of the wheels with the pins of links that stay in their plane; 0, or the failure."""
    cosine = 1.0
    for k in range(c.rows.shape[0]):
        cosine = min(cosine, abs(c.rows[k, 10]))
    deviation = acos(cosine) * 180.0 / np.pi
    if cosine < OUT_OF_PLANE:
        messages[0, 0], messages[0, 1] = t, deviation
        return ASKEW
    if cosine < ALIGNED and c.given_warnings[TILTED] == 0.0:
        c.given_warnings[TILTED] = messages[1 + TILTED, 0] = 1.0
        messages[1 + TILTED, 1], messages[1 + TILTED, 2] = deviation, t
    return 0


@kernel
def _turned(rows: Floats, start_rows: Floats) -> float:
    """Cosine of the angle between the longest line from the first wheel to another one and that at the start."""
    last = 0
    for k in range(1, rows.shape[0]):
        if _distance(start_rows, k) > _distance(start_rows, last):
            last = k
    if _distance(start_rows, last) == 0.0:
        return 1.0
    line = add(vector(rows[last], 0), scale(-1.0, vector(rows[0], 0)))
    start_line = add(vector(start_rows[last], 0), scale(-1.0, vector(start_rows[0], 0)))
    return dot(line, start_line) / np.sqrt(dot(line, line) * dot(start_line, start_line))


@kernel
def _distance(rows: Floats, k: int) -> float:
    """Distance of wheel k from the first one, m."""
    return np.sqrt((rows[k, 0] - rows[0, 0]) ** 2 + (rows[k, 1] - rows[0, 1]) ** 2 + (rows[k, 2] - rows[0, 2]) ** 2)


@kernel
def _observe(c: CommonData, messages: Floats, t: float, h: float) -> None:
    """Compare the wheels of a step of h s with those assumed, and remember them; warn once each."""
    x, report, given = c.exchange, c.report, c.given_warnings
    if x[LENGTH] == 0.0:
        x[REST] = max(report[T_MEAN], c.weight)
    created, largest, wheel = 0.0, -1.0, 0
    for k in range(c.rows.shape[0]):
        i, energy = WHEELS + MOTION * k, 0.0
        for n in range(3):
            energy += c.mean[k, n] * (c.rows[k, n] - x[i + n] - x[LENGTH] * x[i + 3 + n])
        for n in range(MOTION):
            x[i + n] = c.rows[k, n]
        created += energy
        if abs(energy) > largest:
            largest, wheel = abs(energy), k
    if x[LENGTH] > 0.0 and abs(created) > MAX_CREATED * x[REST] * c.pitch and given[CREATED] == 0.0:
        row = messages[1 + CREATED]
        given[CREATED] = row[0] = 1.0
        row[1], row[2], row[3], row[4] = t, wheel, x[LENGTH], abs(created)
    if x[REST] > 0.0 and report[T_MAX] > MAX_TENSION * x[REST] and given[TAUT] == 0.0:
        row = messages[1 + TAUT]
        given[TAUT] = row[0] = 1.0
        row[1], row[2], row[3] = t, report[T_MAX], report[T_MAX] / x[REST]
    x[LENGTH] = h
