"""Common axis of two compared runs: time, travel of the chains, or time since an event."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from fmus.vehicle import BadInput
from orchestrator.results.run_data import EVER, Floats, Missing, RunData

FORMS = "time, travel or SIGNAL=VALUE"


class Alignment(NamedTuple):
    """Map from the time of a run to the axis of the comparison."""

    unit: str
    clock: Callable[[RunData], Callable[[Floats], Floats]]  # run -> (times (m,), s -> places (m,)); raises Missing


def alignment(text: str) -> Alignment:
    """Alignment by name: "time", "travel" or "SIGNAL=VALUE".

    Travel is the mean of the tracks, m. "SIGNAL=VALUE" counts time from the first instant at which the signal passes
    the value. Raises BadInput.
    """
    if text == "time":
        return TIME
    if text == "travel":
        return Alignment("m", _travel_clock)
    signal, _, number = text.rpartition("=")
    try:
        value = float(number)
    except ValueError:
        value = np.nan
    if not signal or not np.isfinite(value):
        raise BadInput(f"--align {text}: must be {FORMS}")
    return Alignment("s", lambda run: _event_clock(run, signal, value))


TIME = Alignment("s", lambda run: lambda t: t)


def _travel_clock(run: RunData) -> Callable[[Floats], Floats]:
    if not run.tracks:
        raise Missing(f"{run.log.path} has no track whose travel runs could be compared along")
    travels = [run.signal(f"{track}.travel", EVER) for track in run.tracks]
    t = min((t_of_track for t_of_track, _ in travels), key=len)
    travel = np.mean([abs(values[: len(t)]) for _, values in travels], axis=0)
    return lambda times: np.interp(times, t, travel)


def _event_clock(run: RunData, signal: str, value: float) -> Callable[[Floats], Floats]:
    t, values = run.signal(signal, EVER)
    above = values >= value
    passed = np.flatnonzero(above[1:] != above[:-1])
    if not len(passed):
        raise Missing(f"'{signal}' of {run.log.path} never passes {value:g}")
    k = passed[0]
    event = t[k] + (value - values[k]) / (values[k + 1] - values[k]) * (t[k + 1] - t[k])
    return lambda times: times - event
