"""Parts of a component as source text: arrays become slices of memory blocks, numbers entries of them.

State and counters are blocks of their own; views of them stay views. All other arrays, constants and scratch alike, and
all other numbers go into one block a type, scratch as zeros; numbers that follow from free parameters become
expressions. A named tuple is written as a call of its class. The text holds no number, so that it is equal for all
components of a shape.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fmus.kernels.numba_internals.references import Reference

LINE = 8  # floats of a cache line: an array begins with one
BLOCKS = {"float64": "f", "int64": "k", "bool": "z"}
NUMBERED = str.maketrans("<>", "()")  # around numbers of an expression, which go into the block f
SCRATCH = "work"  # name in the parts of what a step writes before it reads it


class DerivedNumber(NamedTuple):
    """Number that follows from free parameters."""

    text: str  # expression in ``p``, ``c`` and numbers <...>
    value: float | int  # with the parameters of the model


class Frozen:
    """Memory blocks, filled as values are written down; an array that occurs twice is stored once.

    ``free``: expressions of the numbers that are not constant, by their place in the parts, such as "law.mu".
    """

    def __init__(
        self, state: NDArray[np.float64], counters: NDArray[np.int64], free: Mapping[str, DerivedNumber]
    ) -> None:
        self._free, self._matched = free, set[str]()
        self._addresses = {id(_root(state)): ("x", 0, _root(state)), id(_root(counters)): ("n", 0, _root(counters))}
        self._numbers: dict[str, list[float | int | bool]] = {letter: [] for letter in BLOCKS.values()}
        self._scratch: dict[tuple[str, int], int] = {}  # block and first place -> size of arrays in SCRATCH alone
        self.classes: dict[str, type] = {}

    def text(self, value: Any, place: str = "") -> str:
        """Expression of the value in the blocks, ``p``, ``c`` and the names of ``classes``.

        Raises TypeError for a value that cannot be written down, and for a number that differs from its expression.
        """
        if value is None:
            return "None"
        if place in self._free:
            text, expected = self._free[place]
            if value != expected:
                raise TypeError(f"{place} is {value}, but {text} is {expected}")
            self._matched.add(place)
            return re.sub(r"<([^>]+)>", lambda number: self._number(float(number[1])), text)
        if isinstance(value, np.ndarray):
            return self._array(value, SCRATCH in place.split("."))
        if isinstance(value, Reference):
            return f"refer({self.text(value.parts, place)})"
        if isinstance(value, tuple):
            fields = getattr(value, "_fields", range(len(value)))
            parts = zip(fields, value, strict=True)
            inside = "".join(f"{self.text(each, f'{place}.{field}'.lstrip('.'))}, " for field, each in parts)
            if not hasattr(value, "_fields"):
                return f"({inside})"
            name = type(value).__name__
            if self.classes.setdefault(name, type(value)) is not type(value):
                raise TypeError(f"two classes are called {name}")
            return f"{name}({inside})"
        return self._number(value)

    def unmatched(self) -> set[str]:
        """Places of free numbers that the parts do not have."""
        return set(self._free) - self._matched

    def block(self, letter: str) -> NDArray[Any]:
        """Initial content of the block of a type."""
        kind = next(np.dtype(name) for name, each in BLOCKS.items() if each == letter)
        block = np.array(self._numbers[letter] or [0], dtype=kind)
        for (of, first), size in self._scratch.items():
            if of == letter == "f":
                block[first : first + size] = 0
        return block

    def _number(self, value: Any) -> str:
        letter = BLOCKS[np.result_type(type(value)).name]
        self._numbers[letter].append(value)
        return f"{letter}[{len(self._numbers[letter]) - 1}]"

    def _array(self, array: NDArray[Any], scratch: bool) -> str:
        root = _root(array)
        if not array.flags.c_contiguous:
            raise TypeError("an array of a component's parts must be contiguous")
        if id(root) not in self._addresses:
            numbers = self._numbers[BLOCKS[root.dtype.name]]
            numbers += [0] * (-len(numbers) % LINE)
            self._addresses[id(root)] = BLOCKS[root.dtype.name], len(numbers), root
            self._scratch[BLOCKS[root.dtype.name], len(numbers)] = root.size
            numbers += root.ravel().tolist()
        letter, first, _ = self._addresses[id(root)]
        if not scratch:
            self._scratch.pop((letter, first), None)
        first += (array.ctypes.data - root.ctypes.data) // array.itemsize if array.size else 0
        return f"carray(after({letter.upper()}, {first}), {array.shape})"


def _root(array: NDArray[Any]) -> NDArray[Any]:
    while isinstance(array.base, np.ndarray):
        array = array.base
    return array
