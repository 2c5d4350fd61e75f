"""Random sequences of FMI calls, judged by a state machine of their own.

The rules here follow FMI 2.0.4, section 4.2.4, FMI 3.0.2, section 2.3, and `fmus/README.md`; they are written anew,
so that a mistake in `fmus/fmi/phases.py` shows. A sequence is repeated without the calls that were refused: its outputs
must be the same bits. Refusals have the status Error. In an FMU of pythonfmu, whose wrapper makes fmi2Fatal of every
exception, they are that, and a refused step is fmi2Discard. After each step, the last successful time must be where
the instance stands; of a step that was refused, pythonfmu says the time that was passed, and from then on that the
instance is terminated. A step of FMI 3.0 raises no flag.
"""

from __future__ import annotations

import ctypes
import math
import random
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from orchestrator.cosim.fmu_files import unpack
from orchestrator.cosim.model_description import describe
from orchestrator.fmu_check import fmi3
from orchestrator.fmu_check.instance import Subject, instantiate

OK, DISCARD, ERROR, FATAL = 0, 2, 3, 4
LAST_SUCCESSFUL_TIME, TERMINATED = 2, 3  # kinds of a status
STEPS = (1e-9, 1e-7, 1e-5, 1e-4, 1e-3)  # s
NOT_STEPS = (0.0, -1e-3, math.nan, math.inf, 4.94e-324, 1e-310, 9e-10)
LONGEST_CALL = 2.0  # s of processor time
LONGEST_MESSAGE = 400  # characters


class Wrong(AssertionError):
    """A call that did what the rules do not allow."""


class Machine(NamedTuple):
    """State of an instance by the rules."""

    phase: str = "instantiated"  # then initialising, running, terminated
    now: float = math.nan
    start: float = math.nan
    stop: float = math.nan
    good_input: bool = True


class Call(NamedTuple):
    """A call: its name and argument, the statuses that the rules allow, and the state after OK."""

    name: str
    argument: Any
    allowed: tuple[int, ...]
    after: Machine


class Driven:
    """Instance of an FMU of FMI 2.0 with the raw FMI functions."""

    fmi = 2
    byte: Any = ctypes.c_char

    def __init__(self, fmu: Path) -> None:
        self.messages: list[str] = []
        description, self.library, self.handle, self._free = self._instantiated(fmu)

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

    def _instantiated(self, fmu: Path) -> tuple[Any, Any, Any, Callable[[], None]]:
        """Description, library, instance, and the function that frees it."""
        subject = Subject(fmu)
        return subject.description, *instantiate(subject, None, lambda name, status, text: self._heard(status, text))

    def _start(self, variable: Any) -> Any:
        return float(variable.start)

    def _of(self, function: str) -> Any:
        """Function of the library by its name in FMI 2.0, without prefix."""
        return getattr(self.library, f"fmi2{function}")

    def _heard(self, status: int, text: str) -> None:
        if status >= DISCARD and not text.startswith("Traceback"):
            self.messages.append(text)

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
    byte = fmi3.BYTE
    RENAMED: Mapping[str, str] = {"DeSerializeFMUstate": "DeserializeFMUState"}

    def _instantiated(self, fmu: Path) -> tuple[Any, Any, Any, Callable[[], None]]:
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


UNSUPPORTED = "EnterEventMode", "EnterStepMode", "EnterConfigurationMode", "EvaluateDiscreteStates"


def driven_instance(fmu: Path) -> Driven:
    """Instance of an FMU, of its version of FMI."""
    return Driven3(fmu) if describe(fmu, ("2.0", "3.0"))[1].fmiVersion == "3.0" else Driven(fmu)


def _drawn(draw: random.Random, m: Machine, saved: list[Machine], driven: Driven) -> Call:
    """Draw a call and judge it by the rules."""

    def call(name: str, argument: Any = None, ok: bool = True, after: Machine = m, refused: int = 0) -> Call:
        return Call(name, argument, (OK,) if ok else (refused or driven.refused,), after if ok else m)

    def setup() -> Call:
        start, length = draw.choice((0.0, 0.25, -1.0, 1e3, math.nan)), draw.choice((math.nan, 0.01, -1.0))
        fine = m.phase == "instantiated" and math.isfinite(start) and not length < 0.0
        return call("setup", (start, start + length), fine, m._replace(now=start, start=start, stop=start + length))

    def step() -> Call:
        h = draw.choice(NOT_STEPS if draw.random() < 0.15 else STEPS)
        begin = m.now if math.isfinite(m.now) else draw.choice((0.0, 0.5))
        t = begin + (draw.choice((0.3, -0.2, 1e-6, math.nan)) if draw.random() < 0.15 else 0.0)
        shortest = 1e-9 * max(1.0, abs(t - m.start))
        slack = shortest + 1e-15 * abs(t)
        fine = m.phase == "running" and math.isfinite(t) and math.isfinite(h) and h >= shortest
        fine = fine and not abs(t - m.now) > slack and not t + h > m.stop + slack
        if fine and not m.good_input:
            return call("step", (t, h), False, refused=DISCARD)
        return call("step", (t, h), fine, m._replace(now=t + h), driven.refused_step)

    def long_step() -> Call:
        t = m.now if math.isfinite(m.now) else 0.0
        fine = m.phase == "running" and not t + 1e6 > m.stop and m.good_input
        if not fine:
            return step()
        return Call("step", (t, 1e6), (OK, DISCARD), m._replace(now=t + 1e6))

    def set_input() -> Call:
        place = draw.randrange(1, len(driven.inputs))
        value = driven.starts[place]
        return call("input", (place, value), m.phase != "terminated")

    def bad_input() -> Call:
        fine = m.phase != "terminated"
        return call("input", (0, draw.choice((math.nan, math.inf))), fine, m._replace(good_input=False))

    def good_input() -> Call:
        return call("input", (0, driven.starts[0]), m.phase != "terminated", m._replace(good_input=True))

    def parameter() -> Call:
        fine = m.phase in ("instantiated", "initialising")
        return call("parameter", draw.randrange(len(driven.parameters)), fine)

    def restore() -> Call:
        if not saved:
            return call("save")
        at = draw.randrange(len(saved))
        if draw.random() < 0.3:
            return call("restore flipped", (at, draw.random()), False)
        return call("restore", at, True, saved[at]._replace(start=m.start, stop=m.stop))

    def enter(times: tuple[float, float] = (0.0, math.nan)) -> Call:
        """Entry of initialisation, which in FMI 3.0 has the start and the length of the experiment."""
        fine, after = m.phase == "instantiated", m._replace(phase="initialising")
        if driven.fmi == 2:
            return call("enter", None, fine, after)
        start, length = times
        fine = fine and math.isfinite(start) and not length < 0.0
        return call("enter", (start, start + length), fine, after._replace(now=start, start=start, stop=start + length))

    def enter_at_odd_times() -> Call:
        return enter((draw.choice((0.0, 0.25, -1.0, 1e3, math.nan)), draw.choice((math.nan, 0.01, -1.0))))

    readable = m.phase != "instantiated"
    output = draw.randrange(len(driven.outputs))
    towards = {"instantiated": "enter", "initialising": "exit"}.get(m.phase)
    if towards and draw.random() < 0.3:
        return enter() if towards == "enter" else call("exit", None, True, m._replace(phase="running"))
    if not m.good_input and draw.random() < 0.5:
        return good_input()
    makers: list[tuple[float, Callable[[], Call]]] = [
        (6.0, step),
        (0.2, long_step),
        (1.0, setup if driven.fmi == 2 else enter_at_odd_times),
        (0.5, enter),
        (0.5, lambda: call("exit", None, m.phase == "initialising", m._replace(phase="running"))),
        (0.3, lambda: call("terminate", None, m.phase == "running", m._replace(phase="terminated"))),
        (0.3, lambda: call("reset", None, True, Machine())),
        *([(1.0, set_input), (0.5, bad_input)] if len(driven.inputs) > 1 else []),
        (1.0, parameter),
        (0.5, lambda: call("set output", output, False)),
        (1.0, lambda: call("get", output, readable)),
        (0.3, lambda: call("get unknown", draw.choice((10**6, 2**31 - 1)), False)),
        (0.3, lambda: call("get boolean", None, readable if driven.fmi == 2 else True)),
        (0.7, lambda: call("save")),
        (1.0, restore),
    ]
    if driven.fmi == 3:
        makers += [
            (0.5, lambda: call("unsupported", draw.choice(UNSUPPORTED), False)),
            (0.5, lambda: call("get too few", output, False)),
        ]
    weights, functions = zip(*makers, strict=True)
    return draw.choices(functions, weights)[0]()


def sequence(fmu: Path, seed: int, length: int = 40) -> list[Call]:
    """Make a random sequence of calls; the calls that were not refused. Raises Wrong."""
    draw, driven, machine = random.Random(seed), driven_instance(fmu), Machine()
    saved: list[Machine] = []
    done: list[Call] = []
    try:
        for _ in range(length):
            call = _drawn(draw, machine, saved, driven)
            readable = machine.phase in ("running", "terminated")
            before = driven.shown() if readable else b""
            driven.messages.clear()
            began = time.process_time()
            status = driven.do(call.name, call.argument)
            _judge(call, status, machine, driven.messages, time.process_time() - began)
            if status == OK:
                machine = call.after
                done.append(call)
                if call.name == "save":
                    saved.append(machine)
            elif readable and driven.shown() != before:
                raise Wrong(f"{call.name} {call.argument} was refused and has changed outputs")
            if call.name == "step" and machine.phase == "running":
                _judge_ending(driven, call, status, machine)
        end = driven.shown() if machine.phase in ("running", "terminated") else b""
        _repeat(fmu, done, end)
    except Wrong as wrong:
        raise Wrong(f"{fmu.name}, seed {seed}: {wrong}") from None
    finally:
        driven.close()
    return done


def _judge(call: Call, status: int, machine: Machine, messages: list[str], seconds: float) -> None:
    where = f"{call.name} {call.argument} in {machine}"
    if status not in call.allowed:
        raise Wrong(f"{where} has status {status} instead of {call.allowed}: {messages}")
    if status != OK and not messages:
        raise Wrong(f"{where} has status {status} without a message")
    if long := [text for text in messages if len(text) > LONGEST_MESSAGE and not text.startswith("Fatal py")]:
        raise Wrong(f"{where}: a message of {len(long[0])} characters: {long[0]}")
    if seconds > LONGEST_CALL:
        raise Wrong(f"{where} took {seconds:.1f} s")


def _judge_ending(driven: Driven, call: Call, status: int, machine: Machine) -> None:
    """Check what the instance says of its last step."""
    refused = driven.python and status != OK
    expected = call.argument[0] if refused else machine.now
    t, terminated = driven.ended()
    may_be = refused or (driven.python and terminated)
    stands = abs(t - expected) <= 1e-9 * max(1.0, abs(t)) or math.isnan(expected)
    if terminated is not may_be or not stands:
        raise Wrong(f"after a step {call.argument} with status {status} in {machine}: {t} s, terminated: {terminated}")


def _repeat(fmu: Path, calls: list[Call], end: bytes) -> None:
    """Repeat the calls in a new instance: all must succeed and end in the same outputs, to the bit."""
    other = driven_instance(fmu)
    try:
        for call in calls:
            if other.do(call.name, call.argument) != OK:
                raise Wrong(f"{call.name} {call.argument} is refused without the refused calls before it")
        if end and other.shown() != end:
            raise Wrong("the outputs differ without the refused calls")
    finally:
        with suppress(Exception):
            other.close()
