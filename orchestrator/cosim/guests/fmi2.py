"""Instance of an FMU of FMI 2.0 in the process of a guest; sibling of ``fmi3`` with the same functions."""

from __future__ import annotations

from collections.abc import Sequence
from ctypes import byref, c_char_p, c_double, c_int, c_size_t, c_uint, create_string_buffer
from pathlib import Path
from typing import Any

from fmpy.fmi2 import fmi2FMUstate

from orchestrator.cosim import fmi2_library

PREFIX = "fmi2"
WORDS = {kind: kind for kind in ("Real", "Integer", "Boolean", "String")}  # in names of functions
_TYPES: dict[str, Any] = {"Real": c_double, "Integer": c_int, "Boolean": c_int, "String": c_char_p}
_LAST_SUCCESSFUL_TIME, _TERMINATED = 2, 3  # kinds of a status


class Instance:
    """Instance whose functions return FMI statuses; ``elements`` is for FMI 3.0."""

    def __init__(
        self, folder: Path, identifier: str, name: str, guid: str, elements: object, hear: fmi2_library.Hear
    ) -> None:
        self._library = fmi2_library.load(folder, identifier)
        self.handle, self.free = fmi2_library.instantiate(self._library, folder, name, guid, hear)
        self._states: dict[int, Any] = {}

    def call(self, function: str, *arguments: Any) -> int:
        """Make a call, named without its prefix."""
        return int(getattr(self._library, f"{PREFIX}{function}")(self.handle, *arguments))

    def setup(self, start: float, stop: float | None) -> int:
        """Set times, s."""
        return self.call("SetupExperiment", False, 0.0, start, stop is not None, 0.0 if stop is None else stop)

    def enter(self) -> int:
        """Enter initialisation mode."""
        return self.call("EnterInitializationMode")

    def group(self, kind: str, references: Sequence[int], memory: Any = None, offset: int = 0) -> tuple[Any, ...]:
        """Return the arguments that get or set variables, whose values are in ``memory``."""
        array = _TYPES[kind] * len(references)
        values = array() if memory is None else array.from_buffer(memory, offset)
        return (c_uint * len(references))(*references), len(references), values

    def get(self, kind: str, group: tuple[Any, ...]) -> int:
        """Get the variables of a group."""
        return self.call(f"Get{kind}", *group)

    def set(self, kind: str, group: tuple[Any, ...]) -> int:
        """Set the variables of a group."""
        return self.call(f"Set{kind}", *group)

    def step(self, t: float, h: float, no_rollback: bool) -> int:
        """Step from t to t + h, s."""
        return self.call("DoStep", t, h, no_rollback)

    def outcome(self) -> tuple[bool, float | None]:
        """Return, after a discarded step, whether the FMU has ended the run, and the time that it has reached, s."""
        ended, reached = c_int(), c_double(float("nan"))
        self.call("GetBooleanStatus", _TERMINATED, byref(ended))
        self.call("GetRealStatus", _LAST_SUCCESSFUL_TIME, byref(reached))
        return bool(ended.value), reached.value

    def save(self) -> tuple[int, int]:
        """Save the state; return its number, not 0."""
        state = fmi2FMUstate()
        return self.call("GetFMUstate", byref(state)), self._number(state)

    def _number(self, state: Any) -> int:
        number = max(self._states, default=0) + 1
        self._states[number] = state
        return number

    def restore(self, number: int) -> int:
        """Restore a state."""
        return self.call("SetFMUstate", self._states[number])

    def release(self, number: int) -> int:
        """Free a state."""
        return self.call("FreeFMUstate", byref(self._states.pop(number)))

    def dump(self, number: int) -> tuple[int, bytes]:
        """Serialise a state."""
        size = c_size_t()
        if status := self.call("SerializedFMUstateSize", self._states[number], byref(size)):
            return status, b""
        content = create_string_buffer(size.value)
        return self.call("SerializeFMUstate", self._states[number], content, size), content.raw

    def undump(self, content: bytes) -> tuple[int, int]:
        """Return the number of a state from its bytes."""
        state = fmi2FMUstate()
        buffer = create_string_buffer(content, len(content))
        return self.call("DeSerializeFMUstate", buffer, len(content), byref(state)), self._number(state)
