"""Instance of an FMU of FMI 3.0 in the process of a guest; sibling of ``fmi2`` with the same functions.

Variables are scalars of the types of FMI 2.0, as ``fmi3_scalars`` makes them. There is no event mode.
"""

from __future__ import annotations

from collections.abc import Sequence
from ctypes import (
    byref,
    c_bool,
    c_char_p,
    c_double,
    c_float,
    c_int,
    c_int8,
    c_int16,
    c_int32,
    c_int64,
    c_size_t,
    c_uint,
    c_uint8,
    c_uint16,
    c_uint32,
    c_uint64,
    c_void_p,
)
from pathlib import Path
from typing import Any

from fmpy.fmi3 import fmi3Byte

from orchestrator.cosim import fmi3_library

PREFIX = "fmi3"
WORDS = {"Real": "Float64", "Integer": "Int32", "Boolean": "Boolean", "String": "String"}  # in names of functions
TYPES: dict[str, Any] = {
    "Float64": c_double,
    "Float32": c_float,
    "Int64": c_int64,
    "Int32": c_int32,
    "Int16": c_int16,
    "Int8": c_int8,
    "UInt64": c_uint64,
    "UInt32": c_uint32,
    "UInt16": c_uint16,
    "UInt8": c_uint8,
    "Boolean": c_bool,
    "String": c_char_p,
}
_SCALARS: dict[str, Any] = {"Real": c_double, "Integer": c_int, "Boolean": c_int, "String": c_char_p}
_DISCARD = 2


class Array:
    """Variable with the elements that have been set or got; a scalar has one."""

    def __init__(self, reference: int, kind: str, size: int) -> None:
        self.function = "Int64" if kind == "Enumeration" else kind
        self.arguments = (c_uint * 1)(reference), 1, (TYPES[self.function] * size)(), size
        self.values = self.arguments[2]
        self.known = size == 1


class Instance:
    """Instance whose functions return FMI statuses.

    :param elements: of each scalar, by its number: reference, type, size and place in the array of its variable.
    """

    def __init__(
        self,
        folder: Path,
        identifier: str,
        name: str,
        guid: str,
        elements: Sequence[tuple[int, str, int, int]],
        hear: fmi3_library.Hear,
    ) -> None:
        self._library = fmi3_library.load(folder, identifier)
        self.handle, self.free = fmi3_library.instantiate(self._library, folder, name, guid, hear)
        arrays = {reference: Array(reference, kind, size) for reference, kind, size, _ in elements}
        self._elements = [(arrays[reference], place) for reference, _, _, place in elements]
        self._times: tuple[float, float | None] = 0.0, None
        self._ended, self._reached = False, float("nan")
        self._states: dict[int, c_void_p] = {}

    def call(self, function: str, *arguments: Any) -> int:
        """Make a call, named without its prefix."""
        return int(getattr(self._library, f"{PREFIX}{function}")(self.handle, *arguments))

    def setup(self, start: float, stop: float | None) -> int:
        """Set times, s."""
        self._times = start, stop
        return 0

    def enter(self) -> int:
        """Enter initialisation mode."""
        start, stop = self._times
        return self.call("EnterInitializationMode", False, 0.0, start, stop is not None, 0.0 if stop is None else stop)

    def group(self, kind: str, references: Sequence[int], memory: Any = None, offset: int = 0) -> tuple[Any, ...]:
        """Return scalars and their arrays; their values are in ``memory``."""
        array = _SCALARS[kind] * len(references)
        values = array() if memory is None else array.from_buffer(memory, offset)
        elements = [self._elements[number] for number in references]
        return elements, list(dict.fromkeys(array for array, _ in elements)), values

    def get(self, kind: str, group: tuple[Any, ...]) -> int:
        """Get the variables of a group."""
        elements, arrays, values = group
        worst = 0
        for array in arrays:
            worst = max(worst, self.call(f"Get{array.function}", *array.arguments))
            array.known = worst <= 1
        if worst <= 1:
            values[:] = [array.values[place] for array, place in elements]
        return worst

    def set(self, kind: str, group: tuple[Any, ...]) -> int:
        """Set the variables of a group; elements of an array that are not in the group keep their values."""
        elements, arrays, values = group
        worst = 0
        for array in arrays:
            if not array.known:
                worst = max(worst, self.call(f"Get{array.function}", *array.arguments))
                array.known = True
        for (array, place), value in zip(elements, values, strict=True):
            array.values[place] = value
        for array in arrays:
            worst = max(worst, self.call(f"Set{array.function}", *array.arguments))
        return worst

    def step(self, t: float, h: float, no_rollback: bool) -> int:
        """Step from t to t + h, s; a step that ends the run or returns early is discarded."""
        event, self._ended, early, reached = c_bool(), False, c_bool(), c_double(t + h)
        ended = c_bool()
        status = self.call("DoStep", t, h, no_rollback, byref(event), byref(ended), byref(early), byref(reached))
        self._ended, self._reached = ended.value, reached.value
        return _DISCARD if status <= 1 and (early.value or (ended.value and reached.value < t + h)) else status

    def outcome(self) -> tuple[bool, float | None]:
        """Return, after a discarded step, whether the FMU has ended the run, and the time that it has reached, s."""
        return self._ended, self._reached

    def save(self) -> tuple[int, int]:
        """Save the state; return its number, not 0."""
        state = c_void_p()
        return self.call("GetFMUState", byref(state)), self._number(state)

    def _number(self, state: c_void_p) -> int:
        number = max(self._states, default=0) + 1
        self._states[number] = state
        return number

    def restore(self, number: int) -> int:
        """Restore a state."""
        return self.call("SetFMUState", self._states[number])

    def release(self, number: int) -> int:
        """Free a state."""
        return self.call("FreeFMUState", byref(self._states.pop(number)))

    def dump(self, number: int) -> tuple[int, bytes]:
        """Serialise a state."""
        size = c_size_t()
        if status := self.call("SerializedFMUStateSize", self._states[number], byref(size)):
            return status, b""
        content = (fmi3Byte * size.value)()
        return self.call("SerializeFMUState", self._states[number], content, size), bytes(content)

    def undump(self, content: bytes) -> tuple[int, int]:
        """Return the number of a state from its bytes."""
        state = c_void_p()
        buffer = (fmi3Byte * len(content)).from_buffer_copy(content)
        return self.call("DeserializeFMUState", buffer, len(content), byref(state)), self._number(state)
