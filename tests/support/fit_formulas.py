"""Fits of formulas instead of runs: measured values with noise, objectives, solutions."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from orchestrator.results.measured_record import MeasuredSignal
from orchestrator.scene.scene import load
from orchestrator.studies.free_numbers import FreeNumber
from orchestrator.studies.least_squares import Experiment, Objective, search
from orchestrator.studies.uncertainty import fitted_numbers

POINTS = np.linspace(0.0, 1.0, 101)
NOISE = 0.1
EVERYWHERE = -np.inf, np.inf
START = (1.0, *EVERYWHERE)


@dataclass
class Formula(Objective):
    """Objective whose run is a formula of the numbers."""

    model: Callable = None

    def values(self, points):
        """Values of the formula for each point of numbers."""
        return [[self.model(*self.numbers(u))] for u in points]


def formula(model, truth, free, seed=1):
    """Objective of measured values of a model, with noise of a seed; ``free``: start, low and high of each number."""
    drawn = NOISE * np.random.default_rng(seed).standard_normal(len(POINTS)) if seed is not None else 0.0
    signal = MeasuredSignal("y", "y", "1", POINTS, model(*truth) + drawn, False, {})
    experiment = Experiment(load("hanging_chain"), signals=(signal,))
    numbers = tuple(FreeNumber(f"p{k}", *one, abs(one[0])) for k, one in enumerate(free))
    return Formula((experiment,), numbers, {"y": NOISE}, model=model)


S = POINTS
FORMULAS = {
    "line": (lambda a, b: a + b * S, (2.0, 3.0), [START] * 2),
    "parabola": (lambda a, b, c: a + b * S + c * S**2, (2.0, 3.0, 1.5), [START] * 3),
    "bent": (lambda a, b, c: a + b * S + c * S**2, (2.0, 3.0, 2.0), [START] * 3),
    "weak": (lambda a: 0.01 * a * S, [1.0], [START]),
    "exponential": (lambda a: 0.0176 * np.exp(a) * S, [1.0], [(1.1, *EVERYWHERE)], None),
    "ripple": (lambda a: 1e-3 * np.sin(2e4 * a) + 0.05 * a * S, [1.0], [(1.1, *EVERYWHERE)]),
    "flat": (lambda a: 1e-3 * np.sin(2e5 * a) + 0.5 * S, [1.0], [(1.1, *EVERYWHERE)]),
    "springs": (lambda k1, k2: 10.0 * S / (1.0 / k1 + 1.0 / k2), [2.0, 3.0], [(1.9, *EVERYWHERE)] * 2),
    "wave": (lambda a: np.cos(a * S), [31.0], [(8.0, 1.0, 50.0)]),
    "idle": (lambda a, b, c: a + 0.0 * b + c * S, [2.0, 1.0, 3.0], [START] * 3),
    "bound": (lambda a, b: a + b * S, (2.0, 3.0), [(1.0, 0.0, 1.5), START]),
}


def solved(name):
    """Task and answer of a formula."""
    task = formula(*FORMULAS[name])
    return fitted_numbers(task, search(task))
