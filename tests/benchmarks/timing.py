"""Clocks: CPU time of runs. The least of repeats is reported, as other load only adds time."""

from __future__ import annotations

import gc
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, TypeVar

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
