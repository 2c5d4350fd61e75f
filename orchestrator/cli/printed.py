"""Text of any origin for the terminal."""

from __future__ import annotations

from typing import Any

from orchestrator.results.units import finite as finite

LONGEST = 1000  # longest printed sentence, characters


def plain(text: str) -> str:
    """Return text of any origin as one line of printable characters, shortened to LONGEST."""
    shown = "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text[:LONGEST])
    return shown if len(text) <= LONGEST else f"{shown} ..."


def summary(result: dict[str, Any]) -> None:
    """Print the summary of a run."""
    from orchestrator.execution.summary_text import lines

    for line in lines(result):
        print(line)
