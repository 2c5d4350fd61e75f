"""Library of an FMU of FMI 2.0 in this process, and its instances; sibling of ``fmi3_library``."""

from __future__ import annotations

import atexit
from collections.abc import Callable
from contextlib import suppress
from ctypes import byref
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

from orchestrator.cosim.messages import Hear

_hearers: dict[int, Hear] = {}  # by the FMI component environment
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


def instantiate(
    library: Any, folder: Path, name: str, guid: str, hear: Hear, resources: Path | None = None
) -> tuple[int | None, Callable[[], None]]:
    """Return the handle of a new instance, None if it refuses, and the function that frees it.

    ``hear``: its logger; ``resources``: its resources, default those in the ``folder`` of the FMU.
    """
    environment = id(hear)
    _hearers[environment] = hear
    functions = fmi2CallbackFunctions()
    functions.logger = _receiver
    functions.allocateMemory = fmi2CallbackAllocateMemoryTYPE(calloc)
    functions.freeMemory = fmi2CallbackFreeMemoryTYPE(free)
    functions.componentEnvironment = environment
    addLoggerProxy(byref(functions))  # formats the printf arguments, which ctypes cannot take
    handle = library.fmi2Instantiate(
        name.encode(),
        1,  # co-simulation
        guid.encode(),
        _location(resources or folder / "resources").encode(),
        byref(functions),
        False,
        True,  # logging on: without it the FMU sends no messages
    )

    def close(callbacks: object = functions) -> None:  # which live as long as this function
        if handle:
            library.fmi2FreeInstance(handle)
        _hearers.pop(environment, None)

    if not handle:
        close()
    return handle, close


def _receive(environment: int | None, name: bytes, status: int, category: bytes | None, message: bytes) -> None:
    hear = _hearers.get(environment or 0)
    if hear is None:  # an instance of other code: FMPy has one logger per process
        printLogMessage(environment, name, status, category, message)
    else:
        hear(status, (message or b"").decode("utf-8", "replace"), (category or b"").decode("utf-8", "replace"))


_receiver = fmi2CallbackLoggerTYPE(_receive)  # must live as long as the process


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
