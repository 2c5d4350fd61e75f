"""Text of any origin for the terminal."""

from __future__ import annotations

import logging
from typing import Any

from orchestrator.results.units import finite as finite

MOST = 10  # lines of a summary
LONGEST = 1000  # longest printed sentence, characters


def plain(text: str) -> str:
    """Return text of any origin as one line of printable characters, shortened to LONGEST."""
    shown = "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text[:LONGEST])
    return shown if len(text) <= LONGEST else f"{shown} ..."


def summary(result: dict[str, Any], verbose: bool = False) -> None:
    """Print the summary of a run, in MOST lines unless it is to be ``verbose`` or more is wrong."""
    from orchestrator.execution.summary_text import lines

    for line in lines(result, None if verbose else MOST):
        print(plain(line))


class PlainFormatter(logging.Formatter):
    """Formatter of messages of any origin, each as one line."""

    def format(self, record: logging.LogRecord) -> str:
        """Return the line."""
        return f"cotrack: {plain(record.getMessage())}"
