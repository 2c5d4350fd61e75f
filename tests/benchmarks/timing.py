"""Clocks: CPU time of runs and steps. The least of repeats is reported, as other load only adds time."""

from __future__ import annotations

import gc
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
T = TypeVar("T")


@contextmanager
def quiet() -> Iterator[None]:
    """Switch garbage collection off."""
    gc.disable()
    try:
        yield
    finally:
        gc.enable()


def cpu(action: Callable[[], T]) -> tuple[float, T]:
    """CPU time of this process for an action, s, and its result."""
    with quiet():
        began = time.process_time()
        result = action()
        return time.process_time() - began, result


def least(repeats: int, run: Callable[..., tuple[float, T]], *arguments: Any) -> tuple[float, T]:
    """Time and result of the quickest of several runs, each of which returns both."""
    return min((run(*arguments) for _ in range(repeats)), key=lambda pair: pair[0])


def laps(count: int, *calls: Callable[[int], object]) -> Floats:
    """CPU times of this thread for calls in sequence at each of ``count`` steps, us (calls, steps).

    The time to read the clock is subtracted.
    """
    times, clock = np.empty((len(calls), count)), time.thread_time
    with quiet():
        for k in range(count):
            for i, call in enumerate(calls):
                began = clock()
                call(k)
                times[i, k] = clock() - began
    return 1e6 * (times - reading())


def reading() -> float:
    """Least time to read the clock of ``laps`` around an empty call, s."""
    clock, least, idle = time.thread_time, np.inf, (lambda _: None)
    for _ in range(100):
        began = clock()
        idle(_)
        least = min(least, clock() - began)
    return float(least)


def per_step(repeats: list[Floats], since: int = 0) -> float:
    """Mean over the steps from ``since`` on of the least time of each step (steps) among the repeats."""
    return float(np.min(repeats, axis=0)[since:].mean())
