"""What a component warns of: every text once, when it first came and how often."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, replace

NUMBER = re.compile(r"[-+]?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?")


@dataclass(frozen=True)
class Warned:
    """A warning that came at least once."""

    component: str
    text: str  # as it first came, on one line; texts that differ from it in numbers only are counted with it
    time: float  # s, the beginning of the communication step in which it first came
    count: int


class Warnings:
    """The warnings of one component.

    Those of a step that was taken back are forgotten with it, but one that came in such steps alone is kept: an FMU
    may say it once and never again.
    """

    def __init__(self, component: str, earlier: Mapping[str, Warned] | None = None) -> None:
        self._component = component
        self._known = dict(earlier or {})  # by text without numbers; count 0: in steps taken back alone

    def add(self, text: str, time: float) -> bool:
        """Count a warning that came in the step from ``time`` s on; whether it is the first of its kind."""
        text = " ".join(text.split())
        key = NUMBER.sub("#", text)
        known = self._known.get(key)
        if known is None or not known.count:
            self._known[key] = Warned(self._component, text, time, 1)
        else:
            self._known[key] = replace(known, count=known.count + 1)
        return known is None

    def told(self) -> list[Warned]:
        """All of them, in the order in which they came."""
        return [replace(one, count=max(one.count, 1)) for one in self._known.values()]

    def save(self) -> Mapping[str, Warned]:
        """What there is now, for ``restore``."""
        return dict(self._known)

    def restore(self, saved: Mapping[str, Warned]) -> None:
        """Back to what there was."""
        self._known = {key: saved.get(key, replace(one, count=0)) for key, one in self._known.items()}
