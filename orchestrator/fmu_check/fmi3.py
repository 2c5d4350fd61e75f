"""Functions, types and words of FMI 3.0 for checks; sibling of ``fmi2``."""

from __future__ import annotations

from collections.abc import Callable
from ctypes import byref, c_bool, c_double
from pathlib import Path
from typing import Any

import fmpy
from fmpy.fmi3 import fmi3Byte

from orchestrator.cosim import fmi3_library
from orchestrator.cosim.graph import ComponentFailed
from orchestrator.cosim.model_description import describe, require_binary

PREFIX = "fmi3"
PLATFORM = fmpy.platform_tuple
INSTANTIATE = "InstantiateCoSimulation"
TOKEN = "instantiation token"
REAL = "Float64"
_KINDS = "Float64", "Float32", "Int64", "Int8", "Int16", "Int32", "UInt8", "UInt16", "UInt32", "UInt64", "Boolean"
GETTERS: tuple[tuple[str, Any, tuple[str, ...]], ...] = tuple(
    (f"Get{kind}", fmi3_library.TYPES[kind], (kind, "Enumeration") if kind == "Int64" else (kind,)) for kind in _KINDS
)
STATE, DESERIALIZE = "FMUState", "DeserializeFMUState"
BYTE = fmi3Byte  # FMPy's: its type has changed
LATE = "EnterInitializationMode"
FLAGS = ("asks for event mode, which is not used", "ends the run", "returns early, which is not allowed")


def instantiate(fmu: Path, token: str | None, hear: Callable[[str, int, str], None]) -> tuple[Any, Any, Any]:
    """Return the library, an instance and the function that frees it; raises ComponentFailed."""
    folder, description = describe(fmu, ("3.0",))
    require_binary(folder, description, fmu)
    try:
        library = fmi3_library.load(folder, description.coSimulation.modelIdentifier)
    except Exception as error:
        raise ComponentFailed(f"cannot load the binary of '{fmu}': {error}") from None
    said: list[str] = []

    def receive(status: int, text: str, category: str) -> None:
        said.append(text)
        hear("checked", status, text)

    given = token or description.guid or ""
    handle, close = fmi3_library.instantiate(library, folder, "checked", given, receive)
    if not handle:
        raise ComponentFailed(f"checked: {said[0] if said else 'the FMU cannot be instantiated'}")
    return library, handle, close


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
