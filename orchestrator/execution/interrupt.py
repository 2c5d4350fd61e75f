"""Handling of Ctrl-C, SIGTERM and SIGHUP during a run."""

from __future__ import annotations

import signal
import socket
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress

SIGNALS = tuple(getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name))


class Interrupt:
    """Signal handler: raises at once; while ``deferring`` it only records the first signal."""

    def __init__(self) -> None:
        self.requested = self.deferring = False
        self.terminated = False  # by another signal than that of Ctrl-C: nothing more is waited for
        self._count = 0
        self._woken, self._wakes = socket.socketpair()
        for end in (self._woken, self._wakes):
            end.setblocking(False)

    def __call__(self, number: int, frame: object) -> None:
        """Handle a signal; raises KeyboardInterrupt."""
        repeated, self.requested = self.requested, True
        self.terminated |= number != signal.SIGINT
        if repeated or not self.deferring:
            raise KeyboardInterrupt

    @contextmanager
    def deferred(self, deferring: bool = True) -> Iterator[None]:
        """Let the first signal wait in this block; with False, inside of such a block, it raises at once."""
        before, self.deferring = self.deferring, deferring
        try:
            yield
        finally:
            self.deferring = before

    @property
    def descriptor(self) -> int:
        """Where the interpreter writes a byte for each signal, also while the main thread runs no Python."""
        return self._wakes.fileno()

    def signals(self) -> int:
        """Return the number of signals so far; for one thread."""
        with suppress(BlockingIOError):
            self._count += sum(number in SIGNALS for number in self._woken.recv(4096))
        return self._count


@contextmanager
def interruptible() -> Iterator[Interrupt]:
    """Install the handler; while it is deferring, the first signal lets the step end and the log be closed."""
    interrupt = Interrupt()
    if threading.current_thread() is not threading.main_thread():
        yield interrupt
        return
    before = [signal.signal(number, interrupt) for number in SIGNALS]
    descriptor = signal.set_wakeup_fd(interrupt.descriptor, warn_on_full_buffer=False)
    try:
        yield interrupt
    finally:
        signal.set_wakeup_fd(descriptor)
        for number, handler in zip(SIGNALS, before, strict=True):
            signal.signal(number, handler)
