"""Sentences of failures and warnings: a kernel gives the index of one and the numbers for its gaps.

A gap ``{0:.6g}`` shows the first number in Python's format, ``{0:d}`` as an integer, ``{0:no}`` as an integer plus one
(an index from 0), ``{0:name}`` as the name with that index. The same tables serve Python FMUs and native FMUs.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

GAPS = 6  # largest number of gaps of a sentence


class Sentence(NamedTuple):
    """A text with gaps, and the names for gaps ``name``."""

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


def format_sentence(sentence: Sentence, values: Iterable[float]) -> str:
    """Text of the sentence with the numbers ``values`` in its gaps."""
    numbers = [_Number(value) for value in values]
    for number in numbers:
        number.names = sentence.names
    return sentence.text.format(*numbers)
