"""FMU under examination, and its instances: every call returns its FMI status, all outputs are one array."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager, suppress
from ctypes import c_double, c_int, c_uint
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from orchestrator.cosim.component import Component, ComponentFailed, describe
from orchestrator.fmu_check.verdict import NotApplicable, Refused, listed

Floats = NDArray[np.float64]

OK, WARNING, DISCARD, ERROR, FATAL = range(5)
STATUS = "fmi2OK", "fmi2Warning", "fmi2Discard", "fmi2Error", "fmi2Fatal"
GETTERS: tuple[tuple[str, Any, tuple[str, ...]], ...] = (  # function, C type, FMI types
    ("GetReal", c_double, ("Real",)),
    ("GetInteger", c_int, ("Integer", "Enumeration")),
    ("GetBoolean", c_int, ("Boolean",)),
)
STEP = 1e-3  # s, communication step of an FMU without a default
STEPS = 20  # communication steps of a run
AMPLITUDES = (1e-3, 1e-6)  # of inputs that vary, relative to their start values, absolute below 1


class Subject:
    """FMU under examination; NotApplicable is raised if its description cannot be read.

    :param fmu: its file.
    :param step: communication step, s; None: that of its DefaultExperiment, else ``STEP``.
    :param begin: called before a piece of work with words that tell where a crash happened.
    """

    def __init__(self, fmu: Path, step: float | None = None, begin: Callable[[str], None] = lambda words: None) -> None:
        self.fmu, self.begin, self._step = fmu, begin, step
        self.instances = 0

    @cached_property
    def description(self) -> Any:
        """Content of modelDescription.xml."""
        try:
            return describe(self.fmu)[1]
        except ComponentFailed as failure:
            raise NotApplicable(str(failure)) from None

    @cached_property
    def step(self) -> float:
        """Communication step, s."""
        return self._step or self._experiment("stepSize") or STEP

    @cached_property
    def start(self) -> float:
        """Start time, s."""
        return self._experiment("startTime")

    def _experiment(self, attribute: str) -> float:
        return float(getattr(self.description.defaultExperiment, attribute, None) or 0.0)

    def variables(self, causality: str, *kinds: str) -> list[Any]:
        """Return the variables of a causality and of these types."""
        return [v for v in self.description.modelVariables if v.causality == causality and v.type in kinds]

    @cached_property
    def inputs(self) -> list[Any]:
        """Real inputs."""
        return self.variables("input", "Real")

    @cached_property
    def outputs(self) -> list[Any]:
        """Outputs other than Strings, in the order of their values."""
        return [variable for _, _, kinds in GETTERS for variable in self.variables("output", *kinds)]

    @cached_property
    def amplitude(self) -> float:
        """Relative amplitude of inputs that vary, the largest that the FMU takes; 0: start values only."""
        for amplitude in AMPLITUDES:
            with suppress(Refused), Instance(self) as trial:
                trial.initialise()
                for k in range(STEPS):
                    trial.step(k, amplitude)
                return amplitude
        return 0.0

    def input_values(self, k: int, amplitude: float) -> Floats:
        """Return the values of the Real inputs over step k."""
        start = np.array([float(v.start or 0.0) for v in self.inputs])
        return start + amplitude * np.maximum(1.0, abs(start)) * np.sin(0.5 * (k + 1) + np.arange(start.size))

    def differing(self, one: Floats, other: Floats) -> list[str]:
        """Return the names of outputs that differ in a bit; the arrays have outputs in their last axis."""
        differ = one.view(np.int64) != other.view(np.int64)
        differ = differ.any(axis=tuple(range(differ.ndim - 1)))
        return [variable.name for variable, is_other in zip(self.outputs, differ, strict=True) if is_other]


class Instance(AbstractContextManager["Instance"]):
    """Instance of an FMU; freed at the end of its ``with``, but never after fmi2Fatal.

    Raises NotApplicable if the FMU cannot be instantiated at all or only once, Refused if it could before.
    """

    def __init__(self, subject: Subject, guid: str | None = None) -> None:
        if subject.instances and subject.description.coSimulation.canBeInstantiatedOnlyOncePerProcess:
            raise NotApplicable("the FMU can be instantiated only once per process")
        self._subject = subject
        self._messages: list[str] = []
        self._lost = self._running = False
        try:
            self._component = Component(subject.fmu, "checked", self._hear, guid)
        except ComponentFailed as failure:
            raise (Refused if subject.instances else NotApplicable)(str(failure)) from None
        subject.instances += 1
        self._library, self._handle = self._component.functions

    def _hear(self, name: str, status: int, message: str) -> None:
        if status > WARNING:
            self._messages.append(" ".join(message.split()))

    def call(self, function: str, *arguments: Any) -> int:
        """Make a call, named without "fmi2"; return its status."""
        self._messages.clear()
        status = int(getattr(self._library, f"fmi2{function}")(self._handle, *arguments))
        self._lost |= status == FATAL
        if status <= WARNING and function in ("ExitInitializationMode", "Terminate", "Reset"):
            self._running = function == "ExitInitializationMode"
        return status

    def must(self, function: str, *arguments: Any) -> None:
        """Make a call that has to succeed; raises Refused."""
        status = self.call(function, *arguments)
        if status > WARNING:
            name = STATUS[status] if status <= FATAL else str(status)
            message = f": {self._messages[0]}" if self._messages else ""
            raise Refused(f"fmi2{function} has the status {name}{message}")

    def set_real(self, reference: int, value: float) -> int:
        """Set a Real; return the status."""
        return self.call("SetReal", (c_uint * 1)(reference), 1, (c_double * 1)(value))

    def get_real(self, reference: int) -> tuple[int, float]:
        """Return the status and the value of a Real."""
        value = c_double()
        return self.call("GetReal", (c_uint * 1)(reference), 1, value), value.value

    def set_inputs(self, values: Sequence[float] | Floats) -> None:
        """Set all Real inputs; raises Refused."""
        if n := len(values):
            references = (c_uint * n)(*(v.valueReference for v in self._subject.inputs))
            self.must("SetReal", references, n, (c_double * n)(*values))

    def outputs(self) -> Floats:
        """Return all outputs; raises Refused."""
        parts = []
        for function, c_type, kinds in GETTERS:
            references = [v.valueReference for v in self._subject.variables("output", *kinds)]
            n, values = len(references), (c_type * len(references))()
            if n:
                self.must(function, (c_uint * n)(*references), n, values)
            parts.append(np.array(values, dtype=float))
        return np.concatenate(parts)

    def enter(self) -> None:
        """Bring a new instance into initialisation mode; raises Refused."""
        self.must("SetupExperiment", 0, 0.0, self._subject.start, 0, 0.0)
        self.must("EnterInitializationMode")

    def initialise(self) -> None:
        """Bring a new instance to its first step; raises Refused."""
        self.enter()
        self.must("ExitInitializationMode")

    def step(self, k: int, amplitude: float | None = None) -> Floats:
        """Make step k of a run with varying inputs; return all outputs. Raises Refused."""
        subject, h = self._subject, self._subject.step
        self.set_inputs(subject.input_values(k, subject.amplitude if amplitude is None else amplitude))
        self.must("DoStep", subject.start + k * h, h, 0)
        return self.outputs()

    def run(self, first: int = 0, count: int = STEPS) -> Floats:
        """Make steps; return the outputs after each, (steps, outputs). Raises Refused."""
        return np.array([self.step(k) for k in range(first, first + count)])

    def attempt_step(self, t: float, h: float) -> tuple[bool, list[str]]:
        """Try a step of length h from t after the start, both in s; return whether it is taken, and its faults."""
        status = self.call("DoStep", self._subject.start + t, h, 0)
        if status > WARNING:
            return False, fatal(status)
        values = zip(self._subject.outputs, self.outputs(), strict=True)
        return True, [f"{variable.name} = {value:g}" for variable, value in values if not math.isfinite(value)]

    def __exit__(self, *ended: object) -> None:
        if self._running and not self._lost:
            self.call("Terminate")
        if not self._lost:
            self._component.close()


def fatal(status: int) -> list[str]:
    """Fault of a refusal by fmi2Fatal."""
    return ["fmi2Fatal, after which no instance may be used"] if status >= FATAL else []


def with_faults(what: str, faults: list[str]) -> list[str]:
    """Return one sentence about the faults of a call, or none."""
    return [f"{what}: {listed(faults)}"] if faults else []
