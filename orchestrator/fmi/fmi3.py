"""FMI 3.0: library of an FMU in this process, and its instances; sibling of ``fmi2``. There is no event mode.

Variables are scalars of the types of FMI 2.0, as ``model_description`` makes them: a reference is the number of an
element. Float32 are Reals; whole numbers of all types, and Booleans, are Int64, a UInt64 above 2^63 - 1 less 2^64.
"""
# ruff: noqa: D102 (methods of ``slave.Slave`` and ``slave.Exchange``)

from __future__ import annotations

import ctypes
import math
import os
from collections.abc import Mapping, Sequence
from ctypes import byref, c_bool, c_char_p, c_double, c_float, c_size_t, c_uint, c_void_p
from functools import lru_cache
from pathlib import Path
from typing import Any

import fmpy
from fmpy.fmi3 import FMU3Slave, fmi3Byte, fmi3IntermediateUpdateCallback, fmi3LogMessageCallback

from orchestrator.fmi.library_calls import LibraryCalls
from orchestrator.fmi.slave import (
    DISCARD,
    OK,
    WARNING,
    CallNote,
    Kind,
    LogCallback,
    NotInstantiated,
    Opening,
    failed,
    worse,
)

TYPES: dict[str, Any] = {"Float64": c_double, "Float32": c_float, "Boolean": c_bool, "String": c_char_p}
TYPES |= {f"Int{n}": getattr(ctypes, f"c_int{n}") for n in (8, 16, 32, 64)}
TYPES |= {f"UInt{n}": getattr(ctypes, f"c_uint{n}") for n in (8, 16, 32, 64)}
FUNCTIONS = {  # of the methods of a slave
    "open": "fmi3InstantiateCoSimulation", "setup": "fmi3EnterInitializationMode", "step": "fmi3DoStep",
    "enter_initialisation": "fmi3EnterInitializationMode", "exit_initialisation": "fmi3ExitInitializationMode",
    "save": "fmi3GetFMUState", "restore": "fmi3SetFMUState", "discard": "fmi3FreeFMUState", "reset": "fmi3Reset",
    "dump": "fmi3SerializeFMUState", "load": "fmi3DeserializeFMUState", "terminate": "fmi3Terminate",
    "free": "fmi3FreeInstance", "discarded": "fmi3DoStep",
}  # fmt: skip
SAME_TIME = 1e-9  # of a step: times that differ by less are equal
ENDS = "ends the run"
FLAGS = ("asks for event mode, which is not used", ENDS, "returns early, which is not allowed")


def binary(folder: Path, identifier: str) -> Path:
    """File of the library in the folder of an FMU; it need not exist."""
    return folder / "binaries" / fmpy.platform_tuple / f"{identifier}{fmpy.sharedLibraryExtension}"


@lru_cache(maxsize=4)
def load(folder: Path, identifier: str) -> Any:
    """Return the library of an unpacked FMU with all functions of the standard; raises OSError, RuntimeError."""
    return FMU3Slave(guid="", modelIdentifier=identifier, unzipDirectory=str(folder), instanceName="").dll


class _Variable:
    """Variable with the elements that have been set or got; a scalar has one."""

    def __init__(self, reference: int, kind: str, size: int) -> None:
        self.kind = "Int64" if kind == "Enumeration" else kind
        self.values = (TYPES[self.kind] * size)()
        self.arguments = (c_uint * 1)(reference), 1, self.values, size
        self.is_known = size == 1  # else a setter gets the other elements first


class Slave(LibraryCalls):
    """See ``slave.Slave``; raises NotInstantiated. ``library``: of ``load``.

    An FMU that asks for the end of the simulation in a step that it completes ends the run with the next one.
    """

    prefix = "fmi3"
    functions: Mapping[str, str] = FUNCTIONS

    def __init__(self, library: Any, opening: Opening, log: LogCallback, note: CallNote | None = None) -> None:
        super().__init__(library, note)
        self._log = log

        def receive(environment: object, status: int, category: bytes, message: bytes) -> None:
            log(status, (message or b"").decode("utf-8", "replace"), (category or b"").decode("utf-8", "replace"))

        self._callbacks = fmi3LogMessageCallback(receive), fmi3IntermediateUpdateCallback()  # live as long as it
        folder = Path(opening.folder) / "resources"
        resources = f"{folder}{os.sep}".encode() if folder.is_dir() else None
        self.enter("InstantiateCoSimulation")
        self.handle = library.fmi3InstantiateCoSimulation(
            *(opening.name.encode(), opening.token.encode(), resources, False, True),
            *(False, False, None, 0, None, *self._callbacks),  # no event mode, no early return
        )
        if not self.handle:
            raise NotInstantiated
        variables = {reference: _Variable(reference, kind, size) for reference, kind, size, _ in opening.elements}
        self._elements = [(variables[reference], place) for reference, _, _, place in opening.elements]
        self._times: tuple[Any, ...] = ()
        self.step_notes: list[str] = []
        self._has_ended, self._reached = False, math.nan

    def setup(self, start: float, stop: float | None) -> int:
        self._times = False, 0.0, start, stop is not None, 0.0 if stop is None else stop
        self._has_ended = False
        return OK

    def enter_initialisation(self) -> int:
        return self.call("EnterInitializationMode", *self._times)

    def exchange(self, kind: Kind, references: Sequence[int], values: Any, with_steps: bool = False) -> Exchange:
        return Exchange(self, [self._elements[reference] for reference in references], values)

    def step(self, t: float, h: float, no_rollback: bool) -> int:
        if self._has_ended:  # in the step before, which was whole
            self.failed, self._reached = "fmi3DoStep", t
            return DISCARD
        flags, reached = [c_bool() for _ in FLAGS], c_double(math.nan)
        status = self.call("DoStep", t, h, no_rollback, *map(byref, flags), byref(reached))
        self.step_notes = [words for words, flag in zip(FLAGS, flags, strict=True) if flag.value]
        _, self._has_ended, is_early = (flag.value for flag in flags)
        self._reached = reached.value
        if failed(status):
            return status
        is_short = self._reached < t + h - SAME_TIME * h
        if is_early or (self._has_ended and is_short):
            self.failed = "fmi3DoStep"
            return DISCARD
        if is_short or self._reached > t + h + SAME_TIME * h:
            self.step_notes.append(f"reaches {self._reached:.9g} s, not {t + h:.9g} s, without early return")
        for words in self.step_notes:
            if words != ENDS:
                self._log(WARNING, f"fmi3DoStep {words}", "")
        return status

    def discarded(self) -> tuple[bool, float]:
        return self._has_ended, self._reached

    def save(self) -> tuple[int, Any]:
        state = c_void_p()
        return self.call("GetFMUState", byref(state)), state

    def restore(self, state: Any) -> int:
        self._has_ended = False
        return self.call("SetFMUState", state)

    def discard(self, state: Any) -> int:
        return self.call("FreeFMUState", byref(state))

    def dump(self, state: Any) -> tuple[int, bytes]:
        size = c_size_t()
        if failed(status := self.call("SerializedFMUStateSize", state, byref(size))):
            return status, b""
        content = (fmi3Byte * size.value)()
        return self.call("SerializeFMUState", state, content, size), bytes(content)

    def load(self, content: bytes) -> tuple[int, Any]:
        state, buffer = c_void_p(), (fmi3Byte * len(content)).from_buffer_copy(content)
        if failed(status := self.call("DeserializeFMUState", buffer, len(content), byref(state))):
            return status, state
        return self.restore(state), state

    def free(self) -> int:
        self.library.fmi3FreeInstance(self.handle)
        return OK


class Exchange:
    """See ``slave.Exchange``; elements of an array that are not set keep their values."""

    def __init__(self, slave: Slave, elements: Sequence[tuple[_Variable, int]], values: Any) -> None:
        self._slave, self._elements, self._values = slave, elements, values
        self._variables = [*dict.fromkeys(variable for variable, _ in elements)]

    def function(self, way: str) -> str:
        return f"fmi3{way}{self._variables[0].kind}"

    def set(self) -> int:
        if failed(status := self._update([variable for variable in self._variables if not variable.is_known])):
            return status
        for (variable, place), value in zip(self._elements, self._values, strict=True):
            variable.values[place] = value if isinstance(value, bytes) else value.item()
        for variable in self._variables:
            status = worse(status, self._slave.call(f"Set{variable.kind}", *variable.arguments))
        return status

    def get(self) -> int:
        if failed(status := self._update(self._variables)):
            return status
        found = [variable.values[place] for variable, place in self._elements]
        if isinstance(self._values, list):
            self._values[:] = [text or b"" for text in found]
        else:
            for k, value in enumerate(found):
                self._values[k] = value - 2**64 if value > 2**63 - 1 and isinstance(value, int) else value
        return status

    def _update(self, variables: Sequence[_Variable]) -> int:
        """Get all elements of variables."""
        status = OK
        for variable in variables:
            status = worse(status, self._slave.call(f"Get{variable.kind}", *variable.arguments))
            variable.is_known = not failed(status)
        return status
