"""Loggers for what a user reads beside results: a command shows them on stderr, a program handles them as any others.

``LOG`` gets sentences about files and results, ``RUN`` what FMUs and scenes warn of while they run, ``PROGRESS`` what
is being done: a task that begins (level INFO), how far it is (DEBUG, with ``done`` and ``of`` in ``extra`` for a bar).
"""

from __future__ import annotations

import logging
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar

LOG = logging.getLogger("cotrack")
RUN = logging.getLogger("cotrack.run")
PROGRESS = logging.getLogger("cotrack.progress")
MAX_LINE = 1000  # characters of a line
_silent: ContextVar[bool] = ContextVar("silent", default=False)


@contextmanager
def silent() -> Iterator[None]:
    """Drop what RUN and PROGRESS get inside: of runs that a command makes by the dozen."""
    token = _silent.set(True)
    try:
        yield
    finally:
        _silent.reset(token)


def plain(text: str) -> str:
    """Return text of any origin as one line of printable characters, shortened to MAX_LINE."""
    shown = "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text[:MAX_LINE])
    return shown if len(text) <= MAX_LINE else f"{shown} ..."


for _logger in (RUN, PROGRESS):
    _logger.addFilter(lambda record: not _silent.get())
