"""FMI 2.0: library of an FMU in this process, and its instances; sibling of ``fmi3``."""
# ruff: noqa: D102 (methods of ``slave.Slave`` and ``slave.Exchange``)

from __future__ import annotations

import atexit
import math
from collections.abc import Mapping, Sequence
from contextlib import suppress
from ctypes import POINTER, byref, c_char_p, c_double, c_int, c_size_t, c_uint, c_void_p, cast, create_string_buffer
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import fmpy
from fmpy import calloc, free
from fmpy.fmi1 import printLogMessage
from fmpy.fmi2 import (
    FMU2Slave,
    fmi2CallbackAllocateMemoryTYPE,
    fmi2CallbackFreeMemoryTYPE,
    fmi2CallbackFunctions,
    fmi2CallbackLoggerTYPE,
)
from fmpy.logging import addLoggerProxy

from orchestrator.fmi.library_calls import LibraryCalls
from orchestrator.fmi.slave import OK, CallNote, Kind, LogCallback, NotInstantiated, Opening, failed

C_TYPES: dict[str, Any] = {"Real": c_double, "Integer": c_int, "Boolean": c_int}
FUNCTIONS = {  # of the methods of a slave
    "open": "fmi2Instantiate", "setup": "fmi2SetupExperiment", "enter_initialisation": "fmi2EnterInitializationMode",
    "exit_initialisation": "fmi2ExitInitializationMode", "step": "fmi2DoStep", "save": "fmi2GetFMUstate",
    "restore": "fmi2SetFMUstate", "discard": "fmi2FreeFMUstate", "dump": "fmi2SerializeFMUstate",
    "load": "fmi2DeSerializeFMUstate", "reset": "fmi2Reset", "terminate": "fmi2Terminate", "free": "fmi2FreeInstance",
    "discarded": "fmi2GetRealStatus",
}  # fmt: skip
_LAST_SUCCESSFUL_TIME, _TERMINATED = 2, 3  # kinds of a status
_callbacks: dict[int, LogCallback] = {}  # by the FMI component environment
_libraries: dict[Path, Any] = {}


def binary(folder: Path, identifier: str) -> Path:
    """File of the library in the folder of an FMU; it need not exist."""
    return folder / "binaries" / fmpy.platform / f"{identifier}{fmpy.sharedLibraryExtension}"


def load(folder: Path, identifier: str) -> Any:
    """Return the library of an unpacked FMU with all functions of the standard; raises OSError, RuntimeError.

    It is called without FMPy's wrapper of each call, which costs as much as an exchange, and never unloaded: Python
    modules may refer to it.
    """
    file = binary(folder, identifier)
    made = FMU2Slave(
        guid="", modelIdentifier=identifier, unzipDirectory=str(folder), instanceName="", libraryPath=str(file)
    )
    _libraries[file] = made.dll
    return made.dll


class Slave(LibraryCalls):
    """See ``slave.Slave``; raises NotInstantiated. ``library``: of ``load``."""

    prefix = "fmi2"
    functions: Mapping[str, str] = FUNCTIONS
    step_notes: Sequence[str] = ()

    def __init__(self, library: Any, opening: Opening, log: LogCallback, note: CallNote | None = None) -> None:
        super().__init__(library, note)
        folder = Path(opening.folder)
        resources = folder / "resources" if opening.resources is None else Path(opening.resources)
        self._environment = id(log)
        _callbacks[self._environment] = log
        self._functions = fmi2CallbackFunctions()  # lives as long as the instance
        self._functions.logger = _logger
        self._functions.allocateMemory = fmi2CallbackAllocateMemoryTYPE(calloc)
        self._functions.freeMemory = fmi2CallbackFreeMemoryTYPE(free)
        self._functions.componentEnvironment = self._environment
        addLoggerProxy(byref(self._functions))  # formats the printf arguments, which ctypes cannot take
        self.enter("Instantiate")
        self.handle = library.fmi2Instantiate(
            opening.name.encode(),
            1,  # co-simulation
            opening.token.encode(),
            _location(resources).encode(),
            byref(self._functions),
            False,
            True,  # logging on: without it the FMU sends no messages
        )
        if not self.handle:
            _callbacks.pop(self._environment, None)
            raise NotInstantiated

    def address(self, function: str) -> int:
        """Address of a function, named without its prefix."""
        return cast(getattr(self.library, f"fmi2{function}"), c_void_p).value or 0

    def setup(self, start: float, stop: float | None) -> int:
        return self.call("SetupExperiment", False, 0.0, start, stop is not None, 0.0 if stop is None else stop)

    def enter_initialisation(self) -> int:
        return self.call("EnterInitializationMode")

    def exchange(self, kind: Kind, references: Sequence[int], values: Any, with_steps: bool = False) -> Exchange:
        return Exchange(self, kind, references, values)

    def step(self, t: float, h: float, no_rollback: bool) -> int:
        return self.call("DoStep", t, h, no_rollback)

    def discarded(self) -> tuple[bool, float]:
        ended, reached = c_int(), c_double(math.nan)
        self.library.fmi2GetBooleanStatus(self.handle, _TERMINATED, byref(ended))
        self.library.fmi2GetRealStatus(self.handle, _LAST_SUCCESSFUL_TIME, byref(reached))
        return bool(ended.value), reached.value

    def save(self) -> tuple[int, Any]:
        state = c_void_p()
        return self.call("GetFMUstate", byref(state)), state

    def restore(self, state: Any) -> int:
        return self.call("SetFMUstate", state)

    def discard(self, state: Any) -> int:
        return self.call("FreeFMUstate", byref(state))

    def dump(self, state: Any) -> tuple[int, bytes]:
        size = c_size_t()
        if failed(status := self.call("SerializedFMUstateSize", state, byref(size))):
            return status, b""
        content = create_string_buffer(size.value)
        return self.call("SerializeFMUstate", state, content, size), content.raw

    def load(self, content: bytes) -> tuple[int, Any]:
        state, size = c_void_p(), len(content)
        if failed(status := self.call("DeSerializeFMUstate", create_string_buffer(content, size), size, byref(state))):
            return status, state
        return self.call("SetFMUstate", state), state

    def free(self) -> int:
        self.library.fmi2FreeInstance(self.handle)
        _callbacks.pop(self._environment, None)
        return OK


class Exchange:
    """See ``slave.Exchange``. ``references``, ``size`` and ``content``: the arguments of its calls."""

    def __init__(self, slave: Slave, kind: Kind, references: Sequence[int], values: Any) -> None:
        self._slave, self._setter, self._getter = slave, f"Set{kind}", f"Get{kind}"
        self.size = len(references)
        self.references = (c_uint * self.size)(*references)
        self._texts = values if kind == "String" else None
        self.content: Any = (
            (c_char_p * self.size)() if kind == "String" else values.ctypes.data_as(POINTER(C_TYPES[kind]))
        )

    def function(self, way: str) -> str:
        return f"fmi2{self._setter.replace('Set', way)}"

    def set(self) -> int:
        if not self.size:
            return OK
        if self._texts is not None:
            self.content[:] = self._texts
        return self._slave.call(self._setter, self.references, self.size, self.content)

    def get(self) -> int:
        if not self.size:
            return OK
        status = self._slave.call(self._getter, self.references, self.size, self.content)
        if self._texts is not None:
            self._texts[:] = [text or b"" for text in self.content]
        return status


def _receive(environment: int | None, name: bytes, status: int, category: bytes | None, message: bytes) -> None:
    log = _callbacks.get(environment or 0)
    if log is None:  # an instance of other code: FMPy has one logger per process
        printLogMessage(environment, name, status, category, message)
    else:
        log(status, (message or b"").decode("utf-8", "replace"), (category or b"").decode("utf-8", "replace"))


_logger = fmi2CallbackLoggerTYPE(_receive)  # must live as long as the process


@atexit.register
def _finalise() -> None:
    """End the helper threads of pythonfmu libraries; without this, one process in five aborts at exit."""
    for library in _libraries.values():
        with suppress(AttributeError):  # not a pythonfmu library
            library.finalizePythonInterpreter()


def _location(resources: Path) -> str:
    """Return the URI of the resources, unquoted if it has other escapes than %20, the one wrappers decode."""
    quoted = resources.as_uri()
    return quoted if "%" not in quoted.replace("%20", "") else unquote(quoted)
