"""Times in which something bears next to nothing: the one rule for wheels that are lifted and tracks off the ground.

It is off from the step in which it bears less than LIFTED of the mean load of all of its kind, to the step in which it
bears more than TOUCHES times that. What lies between changes nothing, so that a load near one value counts once.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from orchestrator.log.time_series import Floats
from orchestrator.results.run_data import RunData, since

LIFTED = 0.02  # of the mean load of all: what bears less is off
TOUCHES = 2.0  # times the load below which it is off: what bears more is on again
SETTLING = 0.1  # s: as drawn, a vehicle does not rest on its tracks yet, nor its wheels

Blocks = Iterator[tuple[Floats, Floats]]  # times (m,), s, and loads (m, members), N, some steps at a time


class Spell(NamedTuple):
    """A time in which something is off."""

    start: float  # s, of the step with which it begins
    end: float  # s, of the step with which it ends, or the last one
    time: float  # s, of all of its steps
    begins: bool  # not at the first step
    ends: bool  # before the run does
    load: float  # N, with which it ends; NaN where it does not


class Spells(NamedTuple):
    """Of all that bear a load of the same kind."""

    threshold: float  # N: what bears less is off
    of: dict[str, list[Spell]]  # by name, in order of time


def switches(low: NDArray[np.bool_], high: NDArray[np.bool_], state: bool) -> Iterator[tuple[int, bool]]:
    """Where a state begins, at ``low``, and ends, at ``high``, of samples (m,); what lies between keeps the state."""
    known = np.flatnonzero(low | high)
    changes = np.diff(low[known], prepend=state)
    yield from zip(known[changes].tolist(), low[known[changes]].tolist(), strict=True)


def drops(run: RunData) -> bool:
    """Whether a vehicle starts as drawn, not in equilibrium."""
    return run.scene.get("assembly") == "vehicle" and run.scene.get("start", {}).get("state") != "equilibrium"


def settling(run: RunData, t: float) -> bool:
    """Whether a vehicle is just coming to rest on its tracks at a time, s."""
    return drops(run) and t <= SETTLING


def spells(names: tuple[str, ...], blocks: Callable[[], Blocks]) -> Spells:
    """Of the loads of ``names``, which ``blocks`` gives twice; numbers that are none are passed over."""
    total, duration = np.zeros(len(names)), np.zeros(len(names))
    for _, weights, loads in _weighed(blocks()):
        known = np.isfinite(loads) & np.isfinite(weights)[:, None]
        weights = np.where(np.isfinite(weights), weights, 0.0)
        total += weights @ np.where(known, loads, 0.0)
        duration += weights @ known
    seen = duration > 0.0
    least = LIFTED * float(np.mean(total[seen] / duration[seen])) if seen.any() else 0.0
    found: dict[str, list[Spell]] = {name: [] for name in names}
    if not least > 0.0:
        return Spells(least, found)
    off: dict[str, Spell] = {}  # those that go on
    first = True
    for t, weights, loads in _weighed(blocks()):
        for name, values in zip(names, loads.T, strict=True):
            low, high, done = values < least, values > TOUCHES * least, 0
            if first and low[0]:
                off[name] = Spell(float(t[0]), np.nan, 0.0, False, False, np.nan)
            for at, begins in switches(low, high, name in off):
                if begins:
                    off[name] = Spell(float(t[at]), np.nan, 0.0, True, False, np.nan)
                else:
                    one = off.pop(name)
                    time = one.time + float(weights[done:at].sum())
                    found[name].append(one._replace(end=float(t[at]), time=time, ends=True, load=float(values[at])))
                done = at
            if name in off:
                off[name] = off[name]._replace(end=float(t[-1]), time=off[name].time + float(weights[done:].sum()))
        first = False
    for name, one in off.items():
        found[name].append(one)
    return Spells(least, found)


def _weighed(blocks: Blocks) -> Iterator[tuple[Floats, Floats, Floats]]:
    """Times, what they weigh (m,), s, and loads."""
    last: float | None = None
    for t, loads in blocks:
        if len(t):
            yield t, since(t, last), loads
            last = float(t[-1])
