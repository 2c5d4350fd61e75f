"""Angles: signals whose unit is that of an angle. Whole turns do not count, and angles between records are continuous.

A direction is written within a turn (-180 to 180 degrees, as ``chassis.yaw``, or 0 to 360, as a compass) or without
jumps. A step by more than half a turn between two values within a turn is taken for such a jump. So a direction must
change by less than half a turn from record to record.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from orchestrator.log.time_series import Floats

TURNS = {"rad": 2.0 * np.pi, "rev": 1.0} | dict.fromkeys(("deg", "degree", "degrees", "\N{DEGREE SIGN}"), 360.0)
ROUNDED = 1.0 + 1e-6  # of a turn: values within one are written with some digits


def turn_of(unit: str) -> float:
    """Size of a whole turn in a unit; 0 for what is no angle."""
    return TURNS.get(unit, 0.0)


def continuous(values: Floats, turn: float) -> Floats:
    """Values (m,) without jumps by whole turns, from the first one on; NaN stay.

    As they are: values of no angle, and those that leave a turn, as of a shaft whose turns are counted.
    """
    known = np.flatnonzero(np.isfinite(values)) if turn else np.empty(0, int)
    if not len(known) or np.abs(values[known]).max() > turn * ROUNDED:
        return values
    found = values.copy()
    found[known] += turn * _turns(values[known], turn)
    return found


class Continuous:
    """``continuous`` of the columns of successive blocks, by their units."""

    def __init__(self, units: Sequence[str]) -> None:
        turns = np.array([turn_of(unit) for unit in units])
        self._which = np.flatnonzero(turns)
        self._turn = turns[self._which]
        self._last: tuple[Floats, Floats] | None = None  # row before the block, and its turns

    def __call__(self, values: Floats) -> Floats:
        """Values (m, columns) of the next block, without jumps; without gaps."""
        if not len(self._which) or not len(values):
            return values
        found, own = values.copy(), values[:, self._which]
        before, turns = self._last or (own[0], np.zeros(len(self._which)))
        turns = turns + _turns(np.vstack([before, own]), self._turn)[1:]
        self._last = own[-1], turns[-1]
        found[:, self._which] += self._turn * turns
        return found


def _turns(values: Floats, turn: Floats | float) -> Floats:
    """Whole turns to add to each value, as many as ``values``, which remove jumps within a turn."""
    inside = np.abs(values) <= turn * ROUNDED
    jumps = np.where(inside[1:] & inside[:-1], np.round(np.diff(values, axis=0) / turn), 0.0)
    return np.concatenate([np.zeros_like(values[:1]), -np.cumsum(jumps, axis=0)])


def apart(a: Floats, b: Floats, turn: Floats) -> Floats:
    """Sizes of differences of values (m, columns); of angles within half a turn the smaller way round."""
    found = np.abs(a - b)
    within = (turn > 0.0) & (np.maximum(np.abs(a), np.abs(b)) <= 0.5 * turn * ROUNDED)
    return np.where(within, np.minimum(found, turn - found), found)


def turns_beside(values: Floats, others: Floats, turn: float, first: int = 0) -> Floats:
    """Whole turns (m,) to add to angles that bring them beside ``others``: their difference, others - values - turns.

    It is within half a turn at ``first``, and changes by less than half a turn from one to the next: an angle that
    turns once more than the other one differs by a turn.
    """
    apart = (others - values) / turn
    steps = np.where(np.isfinite(others), apart, 0.0)  # a run that blew up
    count = np.cumsum(np.round(np.diff(steps, prepend=steps[:1])))
    return turn * (count - count[first] + np.round(steps[first]))
