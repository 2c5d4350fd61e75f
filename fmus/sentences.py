"""Sentences that a kernel decides on: texts whose gaps are filled with the numbers that it tells.

A gap ``{0:.6g}`` shows the first number as Python does, ``{0:d}`` as a whole one, ``{0:no}`` as one that counts from 0,
``{0:name}`` as the name that stands there. So the same table serves a component in Python and one in machine code.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

TOLD = 6  # numbers of a sentence, at most


class Sentence(NamedTuple):
    """A text with gaps."""

    text: str
    names: tuple[str, ...] = ()


class _Number(float):
    names: tuple[str, ...] = ()

    def __format__(self, kind: str) -> str:
        if kind == "name":
            return self.names[int(self)]
        if kind in ("d", "no"):
            return str(int(self) + (kind == "no"))
        return float(self).__format__(kind)


def say(sentence: Sentence, told: Iterable[float]) -> str:
    """The sentence with the numbers in its gaps."""
    numbers = [_Number(value) for value in told]
    for number in numbers:
        number.names = sentence.names
    return sentence.text.format(*numbers)
