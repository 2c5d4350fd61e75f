"""All figures of a run by name, as summaries and sweeps show them in turn, and reductions of signals."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from orchestrator.results import chain_measures, energy, largest_forces, turning, vehicle_measures
from orchestrator.results.figures import RunObservable, declared
from orchestrator.results.run_data import Floats, mean

MODULES = largest_forces, vehicle_measures, turning, chain_measures, energy
FIGURES = {one.name: one for module in MODULES for one in declared(module)}
OBSERVABLES = {shown.name or one.name: RunObservable(one, shown) for one in FIGURES.values() for shown in one.shown}

REDUCTIONS: dict[str, Callable[[Floats, Floats], float]] = {
    "mean": mean,
    "min": lambda t, values: values.min(),
    "max": lambda t, values: values.max(),
    "last": lambda t, values: values[-1],
    "drop": lambda t, values: values[0] - values[-1],
    "ripple": lambda t, values: np.ptp(values) / abs(mean(t, values)),  # peak to peak over the mean
    "rms": lambda t, values: mean(t, values**2) ** 0.5,
}

DIRECTIONS = "mean", "min", "max", "last"  # of an angle these are one, and not a change of it


def reduce(t: Floats, values: Floats, how: str) -> float:
    """Reduce the samples of a window to one number; a mean weights each by the time since the last one."""
    return float(REDUCTIONS[how](t, values))
