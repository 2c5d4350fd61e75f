"""Functions, types and words of FMI 3.0 for checks; sibling of ``fmi2``."""

from __future__ import annotations

from ctypes import byref, c_bool, c_double
from typing import Any

import fmpy
from fmpy.fmi3 import fmi3Byte

from orchestrator.cosim import fmi3_library

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
