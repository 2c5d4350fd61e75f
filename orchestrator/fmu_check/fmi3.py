"""Functions, types and words of FMI 3.0 for checks; sibling of ``fmi2``."""

from __future__ import annotations

import os
from collections.abc import Callable
from ctypes import (
    byref,
    c_bool,
    c_double,
    c_float,
    c_int8,
    c_int16,
    c_int32,
    c_int64,
    c_uint8,
    c_uint16,
    c_uint32,
    c_uint64,
)
from functools import lru_cache
from pathlib import Path
from typing import Any

import fmpy
from fmpy.fmi3 import FMU3Slave, fmi3Byte, fmi3IntermediateUpdateCallback, fmi3LogMessageCallback

from orchestrator.cosim.component import ComponentFailed, describe

PREFIX = "fmi3"
PLATFORM = fmpy.platform_tuple
INSTANTIATE = "InstantiateCoSimulation"
TOKEN = "instantiation token"
REAL = "Float64"
_WHOLE = {"Int8": c_int8, "Int16": c_int16, "Int32": c_int32, "UInt8": c_uint8, "UInt16": c_uint16}
_WHOLE |= {"UInt32": c_uint32, "UInt64": c_uint64}
GETTERS: tuple[tuple[str, Any, tuple[str, ...]], ...] = (
    ("GetFloat64", c_double, ("Float64",)),
    ("GetFloat32", c_float, ("Float32",)),
    ("GetInt64", c_int64, ("Int64", "Enumeration")),
    *((f"Get{name}", c_type, (name,)) for name, c_type in _WHOLE.items()),
    ("GetBoolean", c_bool, ("Boolean",)),
)
STATE, DESERIALIZE = "FMUState", "DeserializeFMUState"
BYTE = fmi3Byte  # FMPy's: its type has changed
LATE = "EnterInitializationMode"
FLAGS = ("asks for event mode, which is not used", "ends the run", "returns early, which is not allowed")


def instantiate(fmu: Path, token: str | None, hear: Callable[[str, int, str], None]) -> tuple[Any, Any, Any]:
    """Return the library, an instance and the function that frees it; raises ComponentFailed.

    There is no event mode, no early return and no intermediate update.
    """
    folder, description = describe(fmu, ("3.0",))
    name = description.coSimulation.modelIdentifier
    if not (folder / "binaries" / PLATFORM / f"{name}{fmpy.sharedLibraryExtension}").is_file():
        raise ComponentFailed(f"'{fmu}' has no binary for {PLATFORM}")
    try:
        library = _library(folder, name)
    except Exception as error:
        raise ComponentFailed(f"cannot load the binary of '{fmu}': {error}") from None
    said: list[str] = []

    def receive(environment: object, status: int, category: bytes, message: bytes) -> None:
        text = (message or b"").decode("utf-8", "replace")
        said.append(text)
        hear("checked", status, text)

    log, update = fmi3LogMessageCallback(receive), fmi3IntermediateUpdateCallback()
    resources = f"{folder / 'resources'}{os.sep}".encode() if (folder / "resources").is_dir() else None
    given = (token or description.guid or "").encode()
    handle = library.fmi3InstantiateCoSimulation(
        b"checked", given, resources, False, True, False, False, None, 0, None, log, update
    )
    if not handle:
        raise ComponentFailed(f"checked: {said[0] if said else 'the FMU cannot be instantiated'}")

    def close(callbacks: object = (log, update)) -> None:  # which live as long as this function
        library.fmi3FreeInstance(handle)

    return library, handle, close


@lru_cache(maxsize=4)
def _library(folder: Path, name: str) -> Any:
    """Library with all functions of the standard, which FMPy gives their types."""
    return FMU3Slave(guid="", modelIdentifier=name, unzipDirectory=str(folder), instanceName="checked").dll


def setup(start: float) -> tuple[Any, ...]:
    """Return the arguments of ``LATE``; start time in s."""
    return False, 0.0, start, False, 0.0


def entry(start: float) -> tuple[tuple[Any, ...], ...]:
    """Return the calls that enter initialisation mode."""
    return (("EnterInitializationMode", *setup(start)),)


def step(t: float, h: float) -> tuple[Any, ...]:
    """Return the arguments of a step from t, of length h, both in s."""
    return t, h, False, *(byref(c_bool()) for _ in FLAGS), byref(c_double())


def fault_of_step(arguments: tuple[Any, ...]) -> str:
    """Return what is wrong about the flags that a step has returned; empty if nothing is."""
    flags = arguments[3 : 3 + len(FLAGS)]
    return "; ".join(words for words, flag in zip(FLAGS, flags, strict=True) if flag._obj.value)


def values(references: Any, content: Any) -> tuple[Any, ...]:
    """Return the arguments of a function that gets or sets values."""
    return references, len(references), content, len(content)
