"""Functions of FMI 2.0 of an instance in a room, for a ``Component``: the instance may be one of FMI 3.0."""
# ruff: noqa: D102, N802 (functions of the standard)

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from ctypes import addressof, c_char_p, c_void_p, cast, memmove, string_at
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from orchestrator.cosim.graph import ComponentFailed
from orchestrator.cosim.guests.room import FATAL, Room

SIZES = {"Real": 8, "Integer": 4, "Boolean": 4}  # bytes of a value


class Opening(NamedTuple):
    """Contents of a request to make an instance; places in the shared memory are in bytes."""

    version: str  # of FMI
    folder: str
    identifier: str
    name: str
    guid: str
    inputs: tuple[list[int], int]  # value references of the Reals in ``u``, and its place
    outputs: tuple[list[int], int]
    elements: Sequence[tuple[int, str, int, int]]  # of FMI 3.0


class GuestLibrary:
    """Functions of FMI 2.0 of one instance in a room, with the signatures of its library.

    ``failed``: name of the FMI function that failed in the last call, empty if none did.
    """

    def __init__(self, room: Room, hear: Callable[[int, str, str], None]) -> None:
        self._room, self._hear, self._number = room, hear, room.enter()
        self._time: float | None = None  # s, of the present step
        self._written = self._fresh = False  # inputs are to be set from the memory; outputs are in it
        self._reached, self._dumped = math.nan, b""  # of a discarded step; bytes of a state
        self.failed = ""
        room.hear = hear

    def memory(self, n: int) -> tuple[NDArray[np.float64], int]:
        """Return n doubles that are shared with the process, and their place."""
        return self._room.memory(n)

    def open(self, opening: Opening, u: Any, y: Any) -> bool:
        """Make the instance; return whether there is one. ``u`` and ``y``: value references of its shared Reals."""
        self._u, self._y = addressof(u), addressof(y)
        self._n_y = len(opening.outputs[0])
        status, made = self._ask("fmi2Instantiate", "open", opening._asdict())
        if status >= FATAL and made:
            raise ComponentFailed(f"cannot load the binary of '{opening.name}': {made}")
        return status <= 1 and bool(made)

    def _ask(self, function: str, call: str, *arguments: Any) -> tuple[int, Any]:
        self._post(function, call, *arguments)
        return self._take()

    def _post(self, function: str, call: str, *arguments: Any) -> None:
        written, self._written, self._fresh = self._written, False, False
        self._room.post(self._number, (function, self._time), written, call, *arguments)

    def _take(self) -> tuple[int, Any]:
        status, self.failed, value, messages = self._room.take(self._number)
        for message in messages:
            self._hear(*message)
        return status, value

    def fmi2SetupExperiment(
        self, _: int, tolerated: bool, tolerance: float, start: float, ends: bool, stop: float
    ) -> int:
        return self._ask("fmi2SetupExperiment", "setup", start, stop if ends else None)[0]

    def fmi2EnterInitializationMode(self, _: int) -> int:
        return self._ask("fmi2EnterInitializationMode", "enter")[0]

    def fmi2ExitInitializationMode(self, _: int) -> int:
        return self._ask("fmi2ExitInitializationMode", "call", "ExitInitializationMode")[0]

    def fmi2Terminate(self, _: int) -> int:
        return self._ask("fmi2Terminate", "call", "Terminate")[0]

    def fmi2Reset(self, _: int) -> int:
        self._time = None
        return self._ask("fmi2Reset", "call", "Reset")[0]

    def free(self) -> None:
        """Free the instance; the process ends with its last one."""
        self._ask("fmi2FreeInstance", "free")
        self._room.leave()

    def fmi2DoStep(self, _: int, t: float, h: float, no_rollback: int) -> int:
        self.begin_step(_, t, h, no_rollback)
        return self.finish_step(_, t, h, no_rollback)

    def begin_step(self, _: int, t: float, h: float, no_rollback: int) -> int:
        """Begin fmi2DoStep; other guests may step meanwhile."""
        self._time = t
        self._post("fmi2DoStep", "step", t, h, bool(no_rollback))
        return 0

    def finish_step(self, *_: Any) -> int:
        """Return the status of the step that was begun."""
        status, _ = self._take()
        self._fresh = 0 <= status <= 1
        return status

    def fmi2SetReal(self, _: int, references: Any, n: int, values: Any) -> int:
        if cast(references, c_void_p).value == self._u:
            self._written = True  # with the next call
            return 0
        return self._set("Real", references, n, values)

    def fmi2SetInteger(self, _: int, references: Any, n: int, values: Any) -> int:
        return self._set("Integer", references, n, values)

    def fmi2SetBoolean(self, _: int, references: Any, n: int, values: Any) -> int:
        return self._set("Boolean", references, n, values)

    def fmi2SetString(self, _: int, references: Any, n: int, values: Any) -> int:
        return self._ask("fmi2SetString", "set", "String", _numbers(references, n), list(values[:n]))[0]

    def _set(self, kind: str, references: Any, n: int, values: Any) -> int:
        content = string_at(values, n * SIZES[kind])
        return self._ask(f"fmi2Set{kind}", "set", kind, _numbers(references, n), content)[0]

    def fmi2GetReal(self, _: int, references: Any, n: int, values: Any) -> int:
        if cast(references, c_void_p).value == self._y and n == self._n_y:
            return 0 if self._fresh else self._ask("fmi2GetReal", "read")[0]
        return self._get("Real", references, n, values)

    def fmi2GetInteger(self, _: int, references: Any, n: int, values: Any) -> int:
        return self._get("Integer", references, n, values)

    def fmi2GetBoolean(self, _: int, references: Any, n: int, values: Any) -> int:
        return self._get("Boolean", references, n, values)

    def fmi2GetString(self, _: int, references: Any, n: int, values: Any) -> int:
        status, texts = self._ask("fmi2GetString", "get", "String", _numbers(references, n))
        if texts:
            values[:n] = [c_char_p(text) for text in texts]
        return status

    def _get(self, kind: str, references: Any, n: int, values: Any) -> int:
        fresh = self._fresh
        status, content = self._ask(f"fmi2Get{kind}", "get", kind, _numbers(references, n))
        if content:
            memmove(values, content, len(content))
        self._fresh = fresh
        return status

    def fmi2GetBooleanStatus(self, _: int, kind: int, value: Any) -> int:
        """After a discarded step: whether the FMU has ended the run; fmi2GetRealStatus then has the time."""
        ended, self._reached = self._ask("fmi2GetBooleanStatus", "outcome")[1] or (False, math.nan)
        value._obj.value = ended
        return 0

    def fmi2GetRealStatus(self, _: int, kind: int, value: Any) -> int:
        value._obj.value = self._reached
        return 0

    def fmi2GetFMUstate(self, _: int, state: Any) -> int:
        status, number = self._ask("fmi2GetFMUstate", "state", "save")
        state._obj.value = number
        return status

    def fmi2SetFMUstate(self, _: int, state: Any) -> int:
        return self._ask("fmi2SetFMUstate", "state", "restore", state.value)[0]

    def fmi2FreeFMUstate(self, _: int, state: Any) -> int:
        return self._ask("fmi2FreeFMUstate", "state", "release", state._obj.value)[0]

    def fmi2SerializedFMUstateSize(self, _: int, state: Any, size: Any) -> int:
        """Size of the bytes that fmi2SerializeFMUstate then gives."""
        status, content = self._ask("fmi2SerializeFMUstate", "state", "dump", state.value)
        self._dumped = content or b""
        size._obj.value = len(self._dumped)
        return status

    def fmi2SerializeFMUstate(self, _: int, state: Any, content: Any, size: Any) -> int:
        memmove(content, self._dumped, len(self._dumped))
        return 0

    def fmi2DeSerializeFMUstate(self, _: int, content: Any, size: int, state: Any) -> int:
        status, number = self._ask("fmi2DeSerializeFMUstate", "state", "undump", string_at(content, size))
        state._obj.value = number
        return status


def _numbers(references: Any, n: int) -> list[int]:
    return list(references[:n])
