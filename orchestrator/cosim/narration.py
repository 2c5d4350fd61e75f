"""Progress messages of a command: the current task, repeated every few seconds while it lasts."""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

PATIENCE = 4.0  # s between two messages
KERNELS = "cotrack.kernels"  # logger that receives each kernel compilation
FIRST = "kernels are compiled for this machine, which happens once and takes about half a minute"


class Narration(logging.Handler):
    """Writer of progress messages, active inside its context; thread-safe.

    :param write: receives each line.
    :param patience: s between two reminders, which also count compiled kernels.
    """

    def __init__(self, write: Callable[[str], None], patience: float = PATIENCE) -> None:
        super().__init__()
        self._write, self._patience = write, patience
        self._what, self._detail, self._kernels = "", "", 0
        self._since = self._said = time.monotonic()
        self._quiet, self._over, self._speaking = False, threading.Event(), threading.RLock()
        self._thread: threading.Thread | None = None

    def __enter__(self) -> Narration:
        kernels = logging.getLogger(KERNELS)
        kernels.setLevel(logging.INFO)
        kernels.propagate = False
        kernels.addHandler(self)
        self._over.clear()
        self._thread = threading.Thread(target=self._remind, daemon=True)
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
        self._what, self._detail, self._since = what, "", time.monotonic()
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
            self._quiet, self._said = False, time.monotonic()

    def emit(self, record: logging.LogRecord) -> None:
        """Count a kernel that is about to be compiled."""
        self._kernels += 1
        if self._kernels == 1 and not self._quiet:
            self._say(FIRST)

    def _say(self, line: str) -> None:
        self._write(line)
        self._said = time.monotonic()

    def _remind(self) -> None:
        before = 0
        while not self._over.wait(min(0.25, 0.5 * self._patience)):
            if self._quiet or time.monotonic() < self._said + self._patience:
                continue
            with self._speaking:
                compiled = f"{self._kernels} kernels compiled" if self._kernels > before else ""
                before = self._kernels
                details = ", ".join(filter(None, (self._detail, compiled)))
                self._say(
                    f"{self._what}: {time.monotonic() - self._since:.0f} s so far" + (f", {details}" if details else "")
                )
