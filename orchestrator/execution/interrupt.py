"""Ctrl-C and SIGTERM while a run steps."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager


class Interrupt:
    """What Ctrl-C and SIGTERM do: end at once, or, while ``gentle``, ask for it; the second time at once."""

    def __init__(self) -> None:
        self.asked = self.gentle = False

    def __call__(self, number: int, frame: object) -> None:
        """Handle a signal; raises KeyboardInterrupt."""
        again, self.asked = self.asked, True
        if again or not self.gentle:
            raise KeyboardInterrupt


@contextmanager
def interruptible() -> Iterator[Interrupt]:
    """Signals only ask while a run steps: a step in progress ends, and the log is closed properly."""
    interrupt = Interrupt()
    main = threading.current_thread() is threading.main_thread()
    signals = [signal.SIGINT, signal.SIGTERM] if main else []
    before = [signal.signal(number, interrupt) for number in signals]
    try:
        yield interrupt
    finally:
        for number, handler in zip(signals, before, strict=True):
            signal.signal(number, handler)
