"""Clocks: CPU time of runs and of single steps. The least of repeats is told: whatever else runs only adds to it."""

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
    """No collection of garbage meanwhile."""
    gc.disable()
    try:
        yield
    finally:
        gc.enable()


def cpu(action: Callable[[], T]) -> tuple[float, T]:
    """CPU time of this process over an action, s, and what it returns."""
    with quiet():
        began = time.process_time()
        result = action()
        return time.process_time() - began, result


def least(repeats: int, run: Callable[..., tuple[float, T]], *arguments: Any) -> tuple[float, T]:
    """The time and the result of the quickest of several runs, each of which tells both."""
    return min((run(*arguments) for _ in range(repeats)), key=lambda pair: pair[0])


def laps(count: int, *calls: Callable[[int], object]) -> Floats:
    """CPU times of this thread for calls made one after the other at each of ``count`` steps, us (calls, steps).

    Less what it takes to read the clock.
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
    """Of the clock of ``laps`` with a call that does nothing, s."""
    clock, least, idle = time.thread_time, np.inf, (lambda _: None)
    for _ in range(100):
        began = clock()
        idle(_)
        least = min(least, clock() - began)
    return float(least)


def per_step(repeats: list[Floats], since: int = 0) -> float:
    """Mean over the steps from ``since`` on, of the least that any of the repeats (steps) took for each."""
    return float(np.min(repeats, axis=0)[since:].mean())
