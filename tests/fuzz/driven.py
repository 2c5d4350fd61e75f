"""Instances of FMUs of both versions of FMI, driven by the raw functions."""

from __future__ import annotations

import ctypes
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from fmpy.fmi3 import fmi3Byte

from orchestrator.cosim.messages import CallMessages
from orchestrator.fmi.fmu_files import unpack
from orchestrator.fmi.model_description import describe
from orchestrator.fmu_check.instance import Subject, instantiate

OK, DISCARD, ERROR, FATAL = 0, 2, 3, 4
LAST_SUCCESSFUL_TIME, TERMINATED = 2, 3  # kinds of a status


class Wrong(AssertionError):
    """A call that did what the rules do not allow."""


class _Errors(CallMessages):
    """Errors of an instance, in a list of the caller."""

    def __init__(self, texts: list[str]) -> None:
        super().__init__("fuzzed")
        self._texts = texts

    def receive(self, status: int, message: str, category: str, time: float) -> None:
        """Keep the message, unless it is a traceback."""
        if not message.startswith("Traceback"):
            self._texts.append(message)


class Driven:
    """Instance of an FMU of FMI 2.0 with the raw FMI functions."""

    fmi = 2
    byte: Any = ctypes.c_char

    def __init__(self, fmu: Path) -> None:
        self.messages: list[str] = []
        description, slave = self._instantiated(fmu)
        self.library, self.handle, self._free = slave.library, slave.handle, slave.free

        def of(causality: str) -> list[Any]:
            return [
                v
                for v in description.modelVariables
                if v.type in ("Real", "Float64") and v.causality == causality and v.variability != "constant"
            ]

        self.inputs, self.outputs, self.parameters = of("input"), of("output"), of("parameter")
        self.starts = [self._start(v) for v in self.inputs]
        self.states: list[ctypes.c_void_p] = []
        self.python = (unpack(fmu) / "resources" / "slavemodule.txt").is_file()
        self.refused, self.refused_step = (FATAL, DISCARD) if self.python else (ERROR, ERROR)

    def _instantiated(self, fmu: Path) -> tuple[Any, Any]:
        """Description and slave."""
        subject = Subject(fmu)
        return subject.description, instantiate(subject, None, _Errors(self.messages))

    def _start(self, variable: Any) -> Any:
        return float(variable.start)

    def _of(self, function: str) -> Any:
        """Function of the library by its name in FMI 2.0, without prefix."""
        return getattr(self.library, f"fmi2{function}")

    def close(self) -> None:
        """Free the saved states and the instance."""
        for state in self.states:
            self._of("FreeFMUstate")(self.handle, ctypes.byref(state))
        self._free()

    def _set(self, references: list[int], values: list[Any]) -> int:
        n = len(references)
        return int(
            self.library.fmi2SetReal(self.handle, (ctypes.c_uint * n)(*references), n, (ctypes.c_double * n)(*values))
        )

    def get(self, references: list[int]) -> tuple[int, list[float]]:
        """Status and values of Reals."""
        n = len(references)
        values = (ctypes.c_double * n)()
        return int(self.library.fmi2GetReal(self.handle, (ctypes.c_uint * n)(*references), n, values)), list(values)

    def shown(self) -> bytes:
        """All outputs, as bytes; raises Wrong for a number that is not finite."""
        status, values = self.get([v.valueReference for v in self.outputs])
        if status != OK or not np.isfinite(values).all():
            raise Wrong(f"outputs read with status {status}: {values[:3]}")
        return np.array(values).tobytes()

    def ended(self) -> tuple[float, bool]:
        """Last successful time, and whether the instance calls itself terminated; raises Wrong if it does not say."""
        t, terminated = ctypes.c_double(math.nan), ctypes.c_int(-1)
        last, flag = LAST_SUCCESSFUL_TIME, TERMINATED
        if self.library.fmi2GetRealStatus(self.handle, last, ctypes.byref(t)) != OK:
            raise Wrong("the last successful time is not told")
        if self.library.fmi2GetBooleanStatus(self.handle, flag, ctypes.byref(terminated)) != OK:
            raise Wrong("whether it is terminated is not told")
        return t.value, bool(terminated.value)

    def do(self, name: str, argument: Any) -> int:
        """Make a call; its status."""
        c = self.handle
        match name:
            case "setup":
                start, stop = argument
                return int(self._of("SetupExperiment")(c, 0, 0.0, start, int(not math.isnan(stop)), stop))
            case "enter":
                return int(self._of("EnterInitializationMode")(c))
            case "exit":
                return int(self._of("ExitInitializationMode")(c))
            case "terminate":
                return int(self._of("Terminate")(c))
            case "reset":
                return int(self._of("Reset")(c))
            case "step":
                return int(self._of("DoStep")(c, *argument, 0))
            case "input":
                place, value = argument
                return self._set([self.inputs[place].valueReference], [value])
            case "parameter":
                variable = self.parameters[argument]
                return self._set([variable.valueReference], [self._start(variable)])
            case "set output":
                return self._set([self.outputs[argument].valueReference], [0.0])
            case "get":
                return self.get([self.outputs[argument].valueReference])[0]
            case "get unknown":
                return self.get([argument])[0]
            case "get boolean":
                return int(self._of("GetBoolean")(c, None, 0, None))
            case "save":
                state = ctypes.c_void_p()
                status = int(self._of("GetFMUstate")(c, ctypes.byref(state)))
                self.states.append(state)
                return status
            case "restore":
                return int(self._of("SetFMUstate")(c, self.states[argument]))
            case "restore flipped":
                return self._restore_flipped(*argument)
        raise ValueError(name)

    def serialised(self, at: int) -> bytes:
        """Bytes of a saved state."""
        c, size = self.handle, ctypes.c_size_t()
        self._of("SerializedFMUstateSize")(c, self.states[at], ctypes.byref(size))
        content = (self.byte * size.value)()
        self._of("SerializeFMUstate")(c, self.states[at], content, size)
        return bytes(content)

    def restore(self, content: bytes) -> int:
        """Restore the state of these bytes; its status."""
        c, state = self.handle, ctypes.c_void_p()
        array = (self.byte * len(content)).from_buffer_copy(content)
        status = int(self._of("DeSerializeFMUstate")(c, array, ctypes.c_size_t(len(content)), ctypes.byref(state)))
        if status == OK:
            status = int(self._of("SetFMUstate")(c, state))
            self._of("FreeFMUstate")(c, ctypes.byref(state))
        return status

    def _restore_flipped(self, at: int, place: float) -> int:
        """Restore the bytes of a saved state with one bit flipped."""
        changed = bytearray(self.serialised(at))
        changed[int(place * len(changed))] ^= 4
        return self.restore(bytes(changed))


class Driven3(Driven):
    """Instance of an FMU of FMI 3.0: the same calls, with arrays; times come with the entry of initialisation."""

    fmi = 3
    byte = fmi3Byte
    RENAMED: Mapping[str, str] = {"DeSerializeFMUstate": "DeserializeFMUState"}

    def _instantiated(self, fmu: Path) -> tuple[Any, Any]:
        made = super()._instantiated(fmu)
        self._sizes = {v.valueReference: math.prod(v.shape) for v in made[0].modelVariables if v.type == "Float64"}
        (self._time,) = (v.valueReference for v in made[0].modelVariables if v.causality == "independent")
        self._last = math.nan
        return made

    def _start(self, variable: Any) -> list[float]:
        return [float(value) for value in variable.start.split()]

    def _of(self, function: str) -> Any:
        return getattr(self.library, f"fmi3{self.RENAMED.get(function, function.replace('FMUstate', 'FMUState'))}")

    def _set(self, references: list[int], values: list[Any]) -> int:
        row = [x for v, given in zip(references, values, strict=True) for x in self._elements(v, given)]
        content = (ctypes.c_double * len(row))(*row)
        n = len(references)
        return int(self.library.fmi3SetFloat64(self.handle, (ctypes.c_uint * n)(*references), n, content, len(row)))

    def _elements(self, reference: int, value: Any) -> list[float]:
        return value if isinstance(value, list) else [value] * self._sizes.get(reference, 1)

    def get(self, references: list[int], lacking: int = 0) -> tuple[int, list[float]]:
        """Status and values of variables, all elements of each; ``lacking``: places that the array is too short."""
        n, m = len(references), sum(self._sizes.get(v, 1) for v in references) - lacking
        content = (ctypes.c_double * m)()
        status = self.library.fmi3GetFloat64(self.handle, (ctypes.c_uint * n)(*references), n, content, m)
        return int(status), list(content)

    def ended(self) -> tuple[float, bool]:
        """Last successful time, which is also the variable of time; a step ends no run."""
        status, (t,) = self.get([self._time])
        if status != OK or t != self._last:
            raise Wrong(f"the last successful time is {self._last}, the variable of time is {t}, status {status}")
        return self._last, False

    def do(self, name: str, argument: Any) -> int:
        """Make a call; its status. Raises Wrong for a flag that a step has raised."""
        c = self.handle
        match name:
            case "enter":
                start, stop = argument
                return int(self.library.fmi3EnterInitializationMode(c, False, 0.0, start, not math.isnan(stop), stop))
            case "step":
                flags, last = [ctypes.c_bool(True) for _ in range(3)], ctypes.c_double(math.nan)
                pointers = *map(ctypes.byref, flags), ctypes.byref(last)
                status = int(self.library.fmi3DoStep(c, *argument, False, *pointers))
                self._last = last.value
                if any(flag.value for flag in flags):
                    raise Wrong(f"a step has raised one of the flags event, terminate, early: {flags}")
                return status
            case "unsupported":
                return int(getattr(self.library, f"fmi3{argument}")(c))
            case "get boolean":
                return int(self.library.fmi3GetBoolean(c, None, 0, None, 0))
            case "get too few":
                return self.get([self.outputs[argument].valueReference], 1)[0]
        return super().do(name, argument)


def driven_instance(fmu: Path) -> Driven:
    """Instance of an FMU, of its version of FMI."""
    return Driven3(fmu) if describe(fmu, ("2.0", "3.0"))[1].fmiVersion == "3.0" else Driven(fmu)
