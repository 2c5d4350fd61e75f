"""Scope of a command, or of a call from Python: files that it reads, and faults of ours, which it raises last."""

from __future__ import annotations

import os
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path

_scope: ContextVar[tuple[set[str], list[BaseException]] | None] = ContextVar("scope", default=None)


@contextmanager
def command_scope() -> Iterator[None]:
    """Keep what is read, for ``is_input``; raise the first fault, also one of a thread, when all else is done."""
    if _scope.get() is not None:
        yield
        return
    faults: list[BaseException] = []
    token, before = _scope.set((set(), faults)), threading.excepthook
    if threading.current_thread() is threading.main_thread():
        threading.excepthook = lambda ended: faults.append(ended.exc_value or ended.exc_type())
    try:
        yield
    finally:
        _scope.reset(token)
        threading.excepthook = before
        if faults:
            raise faults[0]


def note_input(path: Path) -> None:
    """Note a file that is read."""
    if scope := _scope.get():
        scope[0].add(os.path.realpath(path))


def is_input(path: Path) -> bool:
    """Whether a file to be written is one of those read."""
    return os.path.realpath(path) in (_scope.get() or ((),))[0]


def pass_over(fault: Exception) -> None:
    """Keep a fault for the end of the command; raises it outside one."""
    if (scope := _scope.get()) is None:
        raise fault
    scope[1].append(fault)
