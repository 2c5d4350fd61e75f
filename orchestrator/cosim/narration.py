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
FIRST = "kernels are compiled, once a machine for each sort of links and vehicle: about a minute of two cores"


class Narration(logging.Handler):
    """Writer of progress messages, active inside its context; thread-safe.

    :param write: receives each line.
    :param clock: returns the time, s. Reminders also count compiled kernels.
    """

    def __init__(self, write: Callable[[str], None], clock: Callable[[], float] = time.monotonic) -> None:
        super().__init__()
        self._write, self._clock = write, clock
        self._task, self._detail, self._kernels, self._counted = "", "", 0, 0
        self._started = self._last_written = clock()
        self._quiet, self._ended, self._lock = False, threading.Event(), threading.RLock()
        self._thread: threading.Thread | None = None

    def __enter__(self) -> Narration:
        kernels = logging.getLogger(KERNELS)
        kernels.setLevel(logging.INFO)
        kernels.propagate = False
        kernels.addHandler(self)
        self._ended.clear()
        self._thread = threading.Thread(target=self._watch, daemon=True)
        self._thread.start()
        return self

    def __exit__(self, *ended: object) -> None:
        logging.getLogger(KERNELS).removeHandler(self)
        self._ended.set()
        if self._thread is not None:
            self._thread.join()

    def __call__(self, task: str) -> None:
        """Announce a task at once."""
        with self._lock:
            self.set_task(task)
            self._write_line(task)

    def set_task(self, task: str) -> None:
        """Set the task; it is announced only if it takes long."""
        self._task, self._detail, self._started = task, "", self._clock()
        self._last_written = self._started

    def set_detail(self, detail: str) -> None:
        """Set the detail of the next reminder."""
        self._detail = detail

    @contextmanager
    def suppressed(self) -> Iterator[None]:
        """Suppress reminders while a progress bar shows the activity."""
        self._quiet = True
        try:
            yield
        finally:
            self._quiet, self._last_written = False, self._clock()

    def emit(self, record: logging.LogRecord) -> None:
        """Count a kernel that is about to be compiled."""
        self._kernels += 1
        if self._kernels == 1 and not self._quiet:
            self._write_line(FIRST)

    def _write_line(self, line: str) -> None:
        self._write(line)
        self._last_written = self._clock()

    def remind(self) -> None:
        """Write the task and the time since its beginning if the last line is older than the patience."""
        if self._quiet or self._clock() < self._last_written + PATIENCE:
            return
        with self._lock:
            compiled = f"{self._kernels} kernels compiled" if self._kernels > self._counted else ""
            self._counted = self._kernels
            details = ", ".join(filter(None, (self._detail, compiled)))
            self._write_line(
                f"{self._task}: {self._clock() - self._started:.0f} s so far" + (f", {details}" if details else "")
            )

    def _watch(self) -> None:
        while not self._ended.wait(PERIOD):
            self.remind()
