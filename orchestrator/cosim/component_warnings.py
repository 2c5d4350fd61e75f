"""Warnings of a component: every text once, with its first time and its count."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, replace

NUMBER = re.compile(r"[-+]?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?")


@dataclass(frozen=True)
class ComponentWarning:
    """Warning with its count."""

    component: str
    text: str  # first text, on one line; texts that differ in numbers only are counted with it
    time: float  # s, beginning of the communication step of the first one
    count: int


class WarningList:
    """Warnings of one component.

    Restoring a state removes the warnings of the steps taken back. A warning that came in such steps only is kept
    with count 0, because an FMU may give it once and never again.
    """

    def __init__(self, component: str, earlier: Mapping[str, ComponentWarning] | None = None) -> None:
        self._component = component
        self._known = dict(earlier or {})  # by text without numbers; count 0: in steps taken back only

    def add(self, text: str, time: float) -> bool:
        """Count a warning of the step from ``time``, s; return True for the first of its kind."""
        text = " ".join(text.split())
        key = NUMBER.sub("#", text)
        known = self._known.get(key)
        if known is None or not known.count:
            self._known[key] = ComponentWarning(self._component, text, time, 1)
        else:
            self._known[key] = replace(known, count=known.count + 1)
        return known is None

    def entries(self) -> list[ComponentWarning]:
        """Return all warnings in the order of their first occurrence."""
        return [replace(warning, count=max(warning.count, 1)) for warning in self._known.values()]

    def save(self) -> Mapping[str, ComponentWarning]:
        """Copy of the warnings for ``restore``."""
        return dict(self._known)

    def restore(self, saved: Mapping[str, ComponentWarning]) -> None:
        """Restore saved warnings; those added since get count 0 (see the class)."""
        self._known = {key: saved.get(key, replace(warning, count=0)) for key, warning in self._known.items()}
