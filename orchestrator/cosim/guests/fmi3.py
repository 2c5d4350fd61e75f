"""Instance of an FMU of FMI 3.0 with the functions of FMI 2.0, in the process of a guest; there is no event mode.

Variables are scalars of the types of FMI 2.0, as ``model_description`` makes them: a value reference is the number of
an element. Values are in buffers of bytes.
"""
# ruff: noqa: D102, N802 (functions of the standard)

from __future__ import annotations

import math
from collections.abc import Sequence
from ctypes import byref, c_bool, c_char_p, c_double, c_int, c_int64, c_uint
from pathlib import Path
from typing import Any

from orchestrator.cosim import fmi3_library
from orchestrator.cosim.messages import DISCARD, WARNING

_SCALARS: dict[str, Any] = {"Real": c_double, "Integer": c_int64, "Boolean": c_int64, "String": c_char_p}
_ALIKE = {  # functions by their names in FMI 2.0, which has other capitals
    f"fmi2{name}".lower(): f"fmi3{name}"
    for name in (
        *("ExitInitializationMode", "Terminate", "Reset", "GetFMUState", "SetFMUState", "FreeFMUState"),
        *("SerializedFMUStateSize", "SerializeFMUState", "DeserializeFMUState"),
    )
}
_TERMINATED = 3  # kind of a status


class Array:
    """Variable with the elements that have been set or got; a scalar has one."""

    def __init__(self, reference: int, kind: str, size: int) -> None:
        self.function = "Int64" if kind == "Enumeration" else kind
        self.values = (fmi3_library.TYPES[self.function] * size)()
        self.arguments = (c_uint * 1)(reference), 1, self.values, size
        self.known = size == 1


class Fmi3:
    """Library with one instance.

    :param elements: value reference, type, size and place in the array of its variable, of each scalar.
    """

    def __init__(self, folder: Path, identifier: str, elements: Sequence[tuple[int, str, int, int]]) -> None:
        self._library = fmi3_library.load(folder, identifier)
        arrays = {reference: Array(reference, kind, size) for reference, kind, size, _ in elements}
        self._elements = [(arrays[reference], place) for reference, _, _, place in elements]
        self._times: tuple[Any, ...] = ()
        self._ended, self._reached = c_bool(), c_double()
        self._handle: int | None = None

    def instantiate(self, *given: Any) -> tuple[int | None, Any]:
        """Make the instance; the result is that of ``fmi3_library.instantiate``."""
        self._handle, free = fmi3_library.instantiate(self._library, *given)
        return self._handle, free

    def _call(self, function: str, *arguments: Any) -> int:
        return int(getattr(self._library, f"fmi3{function}")(self._handle, *arguments))

    def __getattr__(self, name: str) -> Any:
        """Getter, setter, or function of FMI 2.0 that differs from that of FMI 3.0 in its name alone."""
        way, kind = name[4:7], name[7:]
        if name.startswith("fmi2") and way in ("Get", "Set") and kind in _SCALARS:
            return lambda _, references, n, values: self._exchange(way, kind, references, n, values)
        if name.lower() in _ALIKE:
            return getattr(self._library, _ALIKE[name.lower()])
        raise AttributeError(name)

    def _exchange(self, way: str, kind: str, references: Any, n: int, values: Any) -> int:
        """Get or set elements; those of an array that are not set keep their values."""
        numbers = (c_uint * n).from_buffer(references)
        values = values if kind == "String" else (_SCALARS[kind] * n).from_buffer(values)
        elements = [self._elements[number] for number in numbers]
        arrays, worst = list(dict.fromkeys(array for array, _ in elements)), 0
        for array in arrays:
            if way == "Get" or not array.known:
                worst = max(worst, self._call(f"Get{array.function}", *array.arguments))
                array.known = worst <= WARNING
        if worst > WARNING:
            return worst
        for k, (array, place) in enumerate(elements):
            if way == "Get":
                values[k] = array.values[place] if kind != "Integer" else min(array.values[place], 2**63 - 1)
            else:
                array.values[place] = values[k]
        for array in arrays if way == "Set" else ():
            worst = max(worst, self._call(f"Set{array.function}", *array.arguments))
        return worst

    def fmi2SetupExperiment(self, _: int, *times: Any) -> int:
        self._times = times
        return 0

    def fmi2EnterInitializationMode(self, _: int) -> int:
        return self._call("EnterInitializationMode", *self._times)

    def fmi2DoStep(self, _: int, t: float, h: float, no_rollback: bool) -> int:
        """Step; one that ends the run or returns early is discarded. A time that is not said stays NaN."""
        event, early, self._ended, self._reached = c_bool(), c_bool(), c_bool(), c_double(math.nan)
        flags = (byref(each) for each in (event, self._ended, early, self._reached))
        status = self._call("DoStep", t, h, no_rollback, *flags)
        is_short = early.value or (self._ended.value and self._reached.value < t + h)
        return DISCARD if status <= WARNING and is_short else status

    def fmi2GetBooleanStatus(self, _: int, kind: int, value: Any) -> int:
        c_int.from_buffer(value).value = kind == _TERMINATED and self._ended.value
        return 0

    def fmi2GetRealStatus(self, _: int, kind: int, value: Any) -> int:
        c_double.from_buffer(value).value = self._reached.value
        return 0
