"""Random sequences of FMI calls, judged by a state machine of their own.

The rules here follow FMI 2.0.4, section 4.2.4, and `fmus/README.md`; they are written anew, so that a mistake in
`fmus/phases.py` shows. A sequence is repeated without the calls that were refused: its outputs must be the same bits.
Refusals are fmi2Error. In an FMU of pythonfmu, whose wrapper makes fmi2Fatal of every exception, they are that, and a
refused step is fmi2Discard. After each step, the last successful time must be where the instance stands; of a step that
was refused, pythonfmu says the time that was passed, and from then on that the instance is terminated.
"""

from __future__ import annotations

import ctypes
import math
import random
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from orchestrator.cosim.component import Component
from orchestrator.cosim.fmu_files import unpack

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
    stop: float = math.nan
    good_input: bool = True


class Call(NamedTuple):
    """A call: its name and argument, the statuses that the rules allow, and the state after OK."""

    name: str
    argument: Any
    allowed: tuple[int, ...]
    after: Machine


class Driven:
    """Instance of an FMU with the raw FMI functions."""

    def __init__(self, fmu: Path) -> None:
        self.messages: list[str] = []
        self._component = Component(fmu, "fuzzed", lambda name, status, text: self._heard(status, text))
        self.library, self.handle = self._component._library, self._component._handle
        variables = self._component.description.modelVariables

        def of(causality: str) -> list[Any]:
            return [
                v for v in variables if v.type == "Real" and v.causality == causality and v.variability != "constant"
            ]

        self.inputs, self.outputs, self.parameters = of("input"), of("output"), of("parameter")
        self.starts = [float(v.start) for v in self.inputs]
        self.states: list[ctypes.c_void_p] = []
        self.python = (unpack(fmu) / "resources" / "slavemodule.txt").is_file()
        self.refused, self.refused_step = (FATAL, DISCARD) if self.python else (ERROR, ERROR)

    def _heard(self, status: int, text: str) -> None:
        if status >= DISCARD and not text.startswith("Traceback"):
            self.messages.append(text)

    def close(self) -> None:
        """Free the saved states and the instance."""
        for state in self.states:
            self.library.fmi2FreeFMUstate(self.handle, ctypes.byref(state))
        self._component.close()

    def _set(self, references: list[int], values: list[float]) -> int:
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
        lib, c = self.library, self.handle
        match name:
            case "setup":
                start, stop = argument
                return int(lib.fmi2SetupExperiment(c, 0, 0.0, start, int(not math.isnan(stop)), stop))
            case "enter":
                return int(lib.fmi2EnterInitializationMode(c))
            case "exit":
                return int(lib.fmi2ExitInitializationMode(c))
            case "terminate":
                return int(lib.fmi2Terminate(c))
            case "reset":
                return int(lib.fmi2Reset(c))
            case "step":
                return int(lib.fmi2DoStep(c, *argument, 0))
            case "input":
                place, value = argument
                return self._set([self.inputs[place].valueReference], [value])
            case "parameter":
                variable = self.parameters[argument]
                return self._set([variable.valueReference], [float(variable.start)])
            case "set output":
                return self._set([self.outputs[argument].valueReference], [0.0])
            case "get":
                return self.get([self.outputs[argument].valueReference])[0]
            case "get unknown":
                return self.get([argument])[0]
            case "get boolean":
                return int(lib.fmi2GetBoolean(c, None, 0, None))
            case "save":
                state = ctypes.c_void_p()
                status = int(lib.fmi2GetFMUstate(c, ctypes.byref(state)))
                self.states.append(state)
                return status
            case "restore":
                return int(lib.fmi2SetFMUstate(c, self.states[argument]))
            case "restore flipped":
                return self._restore_flipped(*argument)
        raise ValueError(name)

    def serialised(self, at: int) -> bytes:
        """Bytes of a saved state."""
        lib, c, size = self.library, self.handle, ctypes.c_size_t()
        lib.fmi2SerializedFMUstateSize(c, self.states[at], ctypes.byref(size))
        content = ctypes.create_string_buffer(size.value)
        lib.fmi2SerializeFMUstate(c, self.states[at], content, size)
        return content.raw

    def restore(self, content: bytes) -> int:
        """Restore the state of these bytes; its status."""
        lib, c, state = self.library, self.handle, ctypes.c_void_p()
        status = int(lib.fmi2DeSerializeFMUstate(c, content, ctypes.c_size_t(len(content)), ctypes.byref(state)))
        if status == OK:
            status = int(lib.fmi2SetFMUstate(c, state))
            lib.fmi2FreeFMUstate(c, ctypes.byref(state))
        return status

    def _restore_flipped(self, at: int, place: float) -> int:
        """Restore the bytes of a saved state with one bit flipped."""
        changed = bytearray(self.serialised(at))
        changed[int(place * len(changed))] ^= 4
        return self.restore(bytes(changed))


def _drawn(draw: random.Random, m: Machine, saved: list[Machine], driven: Driven) -> Call:
    """Draw a call and judge it by the rules."""

    def call(name: str, argument: Any = None, ok: bool = True, after: Machine = m, refused: int = 0) -> Call:
        return Call(name, argument, (OK,) if ok else (refused or driven.refused,), after if ok else m)

    def setup() -> Call:
        start, length = draw.choice((0.0, 0.25, -1.0, 1e3, math.nan)), draw.choice((math.nan, 0.01, -1.0))
        fine = m.phase == "instantiated" and math.isfinite(start) and not length < 0.0
        return call("setup", (start, start + length), fine, m._replace(now=start, stop=start + length))

    def step() -> Call:
        h = draw.choice(NOT_STEPS if draw.random() < 0.15 else STEPS)
        begin = m.now if math.isfinite(m.now) else draw.choice((0.0, 0.5))
        t = begin + (draw.choice((0.3, -0.2, 1e-6, math.nan)) if draw.random() < 0.15 else 0.0)
        slack = 1e-9 * max(1.0, abs(t))
        fine = m.phase == "running" and math.isfinite(t) and math.isfinite(h) and h >= slack
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
        return call("restore", at, True, saved[at]._replace(stop=m.stop))

    readable = m.phase != "instantiated"
    output = draw.randrange(len(driven.outputs))
    towards = {"instantiated": "enter", "initialising": "exit"}.get(m.phase)
    if towards and draw.random() < 0.3:
        return call(towards, None, True, m._replace(phase="initialising" if towards == "enter" else "running"))
    if not m.good_input and draw.random() < 0.5:
        return good_input()
    makers: list[tuple[float, Callable[[], Call]]] = [
        (6.0, step),
        (0.2, long_step),
        (1.0, setup),
        (0.5, lambda: call("enter", None, m.phase == "instantiated", m._replace(phase="initialising"))),
        (0.5, lambda: call("exit", None, m.phase == "initialising", m._replace(phase="running"))),
        (0.3, lambda: call("terminate", None, m.phase == "running", m._replace(phase="terminated"))),
        (0.3, lambda: call("reset", None, True, Machine())),
        *([(1.0, set_input), (0.5, bad_input)] if len(driven.inputs) > 1 else []),
        (1.0, parameter),
        (0.5, lambda: call("set output", output, False)),
        (1.0, lambda: call("get", output, readable)),
        (0.3, lambda: call("get unknown", draw.choice((10**6, 2**31 - 1)), False)),
        (0.3, lambda: call("get boolean", None, readable)),
        (0.7, lambda: call("save")),
        (1.0, restore),
    ]
    weights, functions = zip(*makers, strict=True)
    return draw.choices(functions, weights)[0]()


def sequence(fmu: Path, seed: int, length: int = 40) -> list[Call]:
    """Make a random sequence of calls; the calls that were not refused. Raises Wrong."""
    draw, driven, machine = random.Random(seed), Driven(fmu), Machine()
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
    other = Driven(fmu)
    try:
        for call in calls:
            if other.do(call.name, call.argument) != OK:
                raise Wrong(f"{call.name} {call.argument} is refused without the refused calls before it")
        if end and other.shown() != end:
            raise Wrong("the outputs differ without the refused calls")
    finally:
        with suppress(Exception):
            other.close()
