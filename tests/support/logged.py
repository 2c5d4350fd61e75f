"""Warnings that are logged while something is done."""

from __future__ import annotations

import logging
import re
from collections.abc import Iterator
from contextlib import contextmanager

from orchestrator.files.messages import LOG


class _Kept(logging.Handler):
    def __init__(self) -> None:
        super().__init__(logging.WARNING)
        self.messages: list[str] = []

    def emit(self, record: logging.LogRecord) -> None:
        self.messages.append(record.getMessage())


@contextmanager
def logged(pattern: str | None = None) -> Iterator[list[str]]:
    """Yield the list of warnings of cotrack, those of FMUs too; at the end one must match the pattern, if there is one.

    Without a pattern there may be none.
    """
    kept = _Kept()
    LOG.addHandler(kept)
    try:
        yield kept.messages
    finally:
        LOG.removeHandler(kept)
    assert pattern is None or any(re.search(pattern, message) for message in kept.messages), kept.messages
