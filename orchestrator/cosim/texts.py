"""Texts of String outputs as numbers, which arrays and logs hold."""

from __future__ import annotations

from collections.abc import Iterable

from orchestrator.fmi.slave import ComponentFailed

START = -1.0  # number of the start value of a String


class Texts:
    """Texts of the String outputs of a component, numbered in the order of their first appearance."""

    def __init__(self, known: Iterable[bytes] = ()) -> None:
        self._numbers = {text: number for number, text in enumerate(known)}
        self._texts = list(self._numbers)

    def number(self, text: bytes) -> int:
        """Return the number of a text, which is added if it is new."""
        if text not in self._numbers:
            self._numbers[text] = len(self._texts)
            self._texts.append(text)
        return self._numbers[text]

    def text(self, number: float) -> bytes:
        """Return a text by its number; raises ComponentFailed."""
        if not 0 <= number < len(self._texts):
            raise ComponentFailed(f"there is no text of the number {number:g}")
        return self._texts[int(number)]

    def words(self) -> list[str]:
        """Return all texts by their numbers."""
        return [text.decode("utf-8", "replace") for text in self._texts]
