"""Handling of Ctrl-C and SIGTERM during a run."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager


class Interrupt:
    """Signal handler: raises at once; while ``deferring`` it only records the first signal."""

    def __init__(self) -> None:
        self.requested = self.deferring = False

    def __call__(self, number: int, frame: object) -> None:
        """Handle a signal; raises KeyboardInterrupt."""
        repeated, self.requested = self.requested, True
        if repeated or not self.deferring:
            raise KeyboardInterrupt


@contextmanager
def interruptible(interrupt: Interrupt | None = None) -> Iterator[Interrupt]:
    """Install the handler; while it is deferring, the first signal lets the step end and the log be closed."""
    interrupt = interrupt or Interrupt()
    main = threading.current_thread() is threading.main_thread()
    signals = [signal.SIGINT, signal.SIGTERM] if main else []
    before = [signal.signal(number, interrupt) for number in signals]
    try:
        yield interrupt
    finally:
        for number, handler in zip(signals, before, strict=True):
            signal.signal(number, handler)
