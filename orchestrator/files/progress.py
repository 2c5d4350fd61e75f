"""Progress of a command on stderr: each task, again every few seconds while it lasts; a bar on a terminal."""

from __future__ import annotations

import logging
import sys
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from typing import TYPE_CHECKING, Any

from orchestrator.files.messages import PROGRESS, plain

if TYPE_CHECKING:
    from rich.progress import Progress as Bar

PATIENCE = 4.0  # s between two messages
PERIOD = 0.25  # s between two looks at the clock
KERNELS = logging.getLogger("cotrack.kernels")  # gets each kernel that has to be compiled
FIRST = "kernels are compiled, once a machine for each sort of links and vehicle: about 40 s on two quiet cores"


def write_line(line: str) -> None:
    """Write a line on stderr."""
    with suppress(OSError, ValueError, AttributeError):  # stderr is closed, or there is none
        sys.stderr.write(f"... {plain(line)}\n")
        sys.stderr.flush()


class Progress(logging.Handler):
    """Shows what PROGRESS gets, and that kernels are compiled, inside its context; thread-safe.

    :param task: what is being done so far, which is written only if it takes long.
    :param write: receives each line.
    :param clock: returns the time, s.
    """

    def __init__(
        self, task: str, write: Callable[[str], None] = write_line, clock: Callable[[], float] = time.monotonic
    ) -> None:
        super().__init__()
        self._task, self._detail, self._kernels, self._counted = task, "", 0, 0
        self._write, self._clock = write, clock
        self._started = self._last_written = clock()
        self._ended, self._thread = threading.Event(), threading.Thread()
        self._bar: Bar | None = None  # while it is on the terminal

    def __enter__(self) -> Progress:
        for logger in (PROGRESS, KERNELS):
            logger.setLevel(logging.DEBUG)
            logger.propagate = False
            logger.addHandler(self)
        self._ended.clear()
        self._started = self._last_written = self._clock()
        self._thread = threading.Thread(target=self._watch, daemon=True)
        self._thread.start()
        return self

    def __exit__(self, *ended: object) -> None:
        for logger in (PROGRESS, KERNELS):
            logger.removeHandler(self)
            logger.setLevel(logging.NOTSET)
        self._ended.set()
        self._thread.join()
        self._end_bar()

    def emit(self, record: logging.LogRecord) -> None:
        """Take a task that begins, how far it is, or a kernel that is about to be compiled."""
        if record.name == KERNELS.name:
            self._kernels += 1
            if self._kernels == 1:
                self._write_line(FIRST)
            return
        text, counted = record.getMessage(), hasattr(record, "of")
        if record.levelno >= logging.INFO:
            if not counted:
                self._end_bar()
                self._task, self._detail, self._started = text, "", self._clock()
            self._write_line(text)
        else:
            self._detail = text
        if counted:
            self._show_bar(record.__dict__, text)

    def remind(self) -> None:
        """Write the task and the time since its beginning if the last line is older than the patience."""
        self.acquire()
        try:
            if self._bar is not None or self._clock() < self._last_written + PATIENCE:
                return
            compiled = f"{self._kernels} kernels compiled" if self._kernels > self._counted else ""
            self._counted = self._kernels
            spent = f"{self._clock() - self._started:.0f} s so far"
            self._write_line(f"{self._task}: {', '.join(filter(None, (spent, self._detail, compiled)))}")
        finally:
            self.release()

    def _write_line(self, line: str) -> None:
        self._write(line)
        self._last_written = self._clock()

    def _watch(self) -> None:
        while not self._ended.wait(PERIOD):
            self.remind()

    def _show_bar(self, count: dict[str, Any], text: str) -> None:
        """Show ``done`` and ``of`` of a record as a bar with its text, if stderr is a terminal."""
        if sys.stderr is None or not sys.stderr.isatty():
            return
        if self._bar is None:
            from rich.console import Console
            from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

            columns = TextColumn("{task.description}"), BarColumn(), TextColumn("{task.fields[text]}")
            self._bar = Progress(
                *columns, TimeRemainingColumn(), console=Console(stderr=True), auto_refresh=False, transient=True
            )
            self._bar.add_task(self._task, text="")
            self._bar.start()
        self._bar.update(self._bar.task_ids[0], completed=count["done"], total=count["of"], text=text)
        self._bar.refresh()
        if count["done"] >= count["of"]:
            self._end_bar()

    def _end_bar(self) -> None:
        if self._bar is not None:
            self._bar.stop()
            self._bar, self._last_written = None, self._clock()
