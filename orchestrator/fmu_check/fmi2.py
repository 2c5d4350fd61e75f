"""Functions, types and words of FMI 2.0 for checks; sibling of ``fmi3``."""

from __future__ import annotations

from ctypes import c_char, c_double, c_int
from typing import Any

import fmpy

PREFIX = "fmi2"  # of functions
PLATFORM = fmpy.platform  # folder of the binary
INSTANTIATE = "Instantiate"
TOKEN = "guid"  # what an instantiation has to name
REAL = "Real"  # type of the inputs that vary
GETTERS: tuple[tuple[str, Any, tuple[str, ...]], ...] = (  # function, C type, types of variables
    ("GetReal", c_double, ("Real",)),
    ("GetInteger", c_int, ("Integer", "Enumeration")),
    ("GetBoolean", c_int, ("Boolean",)),
)
STATE, DESERIALIZE = "FMUstate", "DeSerializeFMUstate"
BYTE = c_char
LATE = "SetupExperiment"  # a call that has to come before the first step, and its arguments


def setup(start: float) -> tuple[Any, ...]:
    """Return the arguments of ``LATE``; start time in s."""
    return 0, 0.0, start, 0, 0.0


def entry(start: float) -> tuple[tuple[Any, ...], ...]:
    """Return the calls that enter initialisation mode."""
    return ("SetupExperiment", *setup(start)), ("EnterInitializationMode",)


def step(t: float, h: float) -> tuple[Any, ...]:
    """Return the arguments of a step from t, of length h, both in s."""
    return t, h, 0


def fault_of_step(arguments: tuple[Any, ...]) -> str:
    """Return what is wrong about the values that a step has returned besides its status: there are none."""
    return ""


def values(references: Any, content: Any) -> tuple[Any, ...]:
    """Return the arguments of a function that gets or sets values."""
    return references, len(references), content
