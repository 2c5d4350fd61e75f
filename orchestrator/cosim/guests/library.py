"""Functions of FMI 2.0 of an instance in a room, for a ``Component``: the instance may be one of FMI 3.0."""
# ruff: noqa: D102, N802 (functions of the standard)

from __future__ import annotations

import ctypes
from collections.abc import Callable, Sequence
from ctypes import addressof, c_char_p, c_void_p, cast, memmove, sizeof, string_at
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from orchestrator.cosim.graph import ComponentFailed
from orchestrator.cosim.guests.supervisor import Room
from orchestrator.cosim.messages import FATAL, Hear

ENDINGS = ("fmi2Terminate", "fmi2FreeInstance")  # calls after the last step
_BY_REFERENCE: Any = type(ctypes.byref(ctypes.c_int()))
_POINTER: Any = type(ctypes.pointer(ctypes.c_int())).__mro__[1]


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
    """Functions of one instance, with the signatures of its library.

    ``failed``: name of the FMI function that failed in the last call, empty if none did.
    """

    def __init__(self, room: Room, hear: Hear) -> None:
        self._room, self._hear, self._number = room, hear, room.enter()
        self._time: float | None = None  # s, of the present step
        self._written = self._fresh = False  # inputs are to be set from the memory; outputs are in it
        self.failed = ""
        room.hear = hear

    def memory(self, n: int) -> tuple[NDArray[np.float64], int]:
        """Return n doubles that are shared with the process, and their place."""
        return self._room.memory(n)

    def open(self, opening: Opening, u: Any, y: Any) -> bool:
        """Make the instance; return whether there is one. ``u`` and ``y``: value references of its shared Reals."""
        self._u, self._y, self._n_y = addressof(u), addressof(y), len(opening.outputs[0])
        self._post("fmi2Instantiate", "open", opening._asdict())
        status, made = self._take()
        if status >= FATAL and made:
            raise ComponentFailed(f"cannot load the binary of '{opening.name}': {made}")
        return status <= 1 and bool(made)

    def fmi2FreeInstance(self, _: int) -> int:
        """Free the instance; the process ends with its last one."""
        self._post("fmi2FreeInstance", "close")
        status, _ = self._take()
        self._room.leave()
        return status

    def _post(self, function: str, call: str, *arguments: Any) -> None:
        written, self._written, self._fresh = self._written, False, False
        time = None if function in ENDINGS else self._time
        self._room.post(self._number, (function, time), written, call, *arguments)

    def _take(self, given: Sequence[Any] = ()) -> tuple[int, Any]:
        status, self.failed, result, messages = self._room.take(self._number, given)
        for message in messages:
            self._hear(*message)
        return status, result

    def __getattr__(self, name: str) -> Callable[..., int]:
        """Function of FMI 2.0 without a method of its own."""
        if not name.startswith("fmi2"):
            raise AttributeError(name)
        function = partial(self._call, name)
        function.__name__ = name  # type: ignore[attr-defined]
        self.__dict__[name] = function
        return function

    def _call(self, name: str, _: int, *arguments: Any) -> int:
        """Make a call; arrays, pointers and references go there and back as bytes, Strings as texts."""
        fresh, targets, given = self._fresh, list[Any](), list[Any]()
        target: Any
        for k, argument in enumerate(arguments):
            if isinstance(argument, ctypes.Array) and argument._type_ is c_char_p:
                targets.append(argument)
                given.append([text or b"" for text in argument])
            elif isinstance(argument, ctypes.Array | _POINTER | _BY_REFERENCE):
                target = getattr(argument, "_obj", argument)
                one = sizeof(target._type_) if isinstance(target, _POINTER) else 0
                targets.append(target)
                given.append(string_at(target, one * arguments[k - 1]) if one else bytes(target))
            else:
                given.append(argument.value if isinstance(argument, ctypes._SimpleCData) else argument)
        self._post(name, name, *given)
        status, found = self._take([each for each in given if isinstance(each, bytes | list)])
        for target, content in zip(targets, found if isinstance(found, list) else (), strict=False):
            if isinstance(content, list):
                target[:] = content
            else:
                memmove(target if isinstance(target, _POINTER) else addressof(target), content, len(content))
        self._fresh = fresh and name.startswith("fmi2Get")
        return status

    def fmi2SetupExperiment(self, _: int, *times: Any) -> int:
        self._time = times[2]
        return self._call("fmi2SetupExperiment", _, *times)

    def fmi2DoStep(self, _: int, t: float, h: float, no_rollback: int) -> int:
        self.begin_step(_, t, h, no_rollback)
        return self.finish_step()

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
        return self._call("fmi2SetReal", _, references, n, values)

    def fmi2GetReal(self, _: int, references: Any, n: int, values: Any) -> int:
        if cast(references, c_void_p).value != self._y or n != self._n_y:
            return self._call("fmi2GetReal", _, references, n, values)
        if self._fresh:
            return 0
        self._post("fmi2GetReal", "read")
        return self._take()[0]
