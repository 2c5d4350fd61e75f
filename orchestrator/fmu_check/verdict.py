"""Verdict of a check, and how a check ends early."""

from __future__ import annotations

from typing import NamedTuple

SHOWN = 3  # faults in the sentence of a verdict


class Verdict(NamedTuple):
    """Result of a check of an FMU."""

    note: str  # one sentence: facts, or why the check is not applicable
    faults: tuple[str, ...] = ()  # one sentence each
    applicable: bool = True

    @property
    def result(self) -> str:
        """Return ok, wrong or not applicable."""
        return "wrong" if self.faults else "ok" if self.applicable else "not applicable"

    @property
    def detail(self) -> str:
        """Return the first faults, or the note."""
        more = len(self.faults) - SHOWN
        return "; ".join(self.faults[:SHOWN]) + (f"; and {more} more" if more > 0 else "") or self.note


class NotApplicable(Exception):
    """The FMU does not offer what the check needs; the message is one sentence."""


class Refused(Exception):
    """A call that has to succeed was refused; the message is one sentence."""


def listed(names: list[str], most: int = SHOWN) -> str:
    """Return names as text, the first ``most`` of them."""
    return ", ".join(names[:most]) + (f" and {len(names) - most} more" if len(names) > most else "")
