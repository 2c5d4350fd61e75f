"""Progress messages of a command: the current task, repeated every few seconds while it lasts."""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

PATIENCE = 4.0  # s between two messages
PERIOD = 0.25  # s between two looks at the clock
KERNELS = "cotrack.kernels"  # logger that receives each kernel compilation
FIRST = "kernels are compiled for this machine, which happens once and takes about half a minute"


class Narration(logging.Handler):
    """Writer of progress messages, active inside its context; thread-safe.

    :param write: receives each line.
    :param clock: returns the time, s. Reminders also count compiled kernels.
    """

    def __init__(self, write: Callable[[str], None], clock: Callable[[], float] = time.monotonic) -> None:
        super().__init__()
        self._write, self._clock = write, clock
        self._what, self._detail, self._kernels, self._counted = "", "", 0, 0
        self._since = self._said = clock()
        self._quiet, self._over, self._speaking = False, threading.Event(), threading.RLock()
        self._thread: threading.Thread | None = None

    def __enter__(self) -> Narration:
        kernels = logging.getLogger(KERNELS)
        kernels.setLevel(logging.INFO)
        kernels.propagate = False
        kernels.addHandler(self)
        self._over.clear()
        self._thread = threading.Thread(target=self._watch, daemon=True)
        self._thread.start()
        return self

    def __exit__(self, *ended: object) -> None:
        logging.getLogger(KERNELS).removeHandler(self)
        self._over.set()
        if self._thread is not None:
            self._thread.join()

    def __call__(self, what: str) -> None:
        """Announce a task at once."""
        with self._speaking:
            self.begin(what)
            self._say(what)

    def begin(self, what: str) -> None:
        """Set the task; it is announced only if it takes long."""
        self._what, self._detail, self._since = what, "", self._clock()
        self._said = self._since

    def note(self, detail: str) -> None:
        """Set the detail of the next reminder."""
        self._detail = detail

    @contextmanager
    def elsewhere(self) -> Iterator[None]:
        """Suppress reminders while a progress bar shows the activity."""
        self._quiet = True
        try:
            yield
        finally:
            self._quiet, self._said = False, self._clock()

    def emit(self, record: logging.LogRecord) -> None:
        """Count a kernel that is about to be compiled."""
        self._kernels += 1
        if self._kernels == 1 and not self._quiet:
            self._say(FIRST)

    def _say(self, line: str) -> None:
        self._write(line)
        self._said = self._clock()

    def remind(self) -> None:
        """Write the task and the time since its beginning if the last line is older than the patience."""
        if self._quiet or self._clock() < self._said + PATIENCE:
            return
        with self._speaking:
            compiled = f"{self._kernels} kernels compiled" if self._kernels > self._counted else ""
            self._counted = self._kernels
            details = ", ".join(filter(None, (self._detail, compiled)))
            self._say(f"{self._what}: {self._clock() - self._since:.0f} s so far" + (f", {details}" if details else ""))

    def _watch(self) -> None:
        while not self._over.wait(PERIOD):
            self.remind()
