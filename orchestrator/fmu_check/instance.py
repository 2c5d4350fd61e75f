"""FMU under examination, its instances and verdicts: every call returns its FMI status, all outputs are one array."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, suppress
from ctypes import c_double, c_int, c_uint
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from orchestrator.cosim.messages import CallMessages
from orchestrator.fmi import fmi3
from orchestrator.fmi.model_description import (
    LIBRARIES,
    describe,
    element_names,
    is_fmi3,
    load_library,
    number_of_elements,
    opening,
    require_binary,
    start_values,
)
from orchestrator.fmi.slave import FATAL, OK, WARNING, ComponentFailed, NotInstantiated
from orchestrator.log.time_series import Floats

MAX_FAULTS = 3  # faults in the sentence of a verdict


class Verdict(NamedTuple):
    """Result of a check of an FMU."""

    note: str  # one sentence: facts, or why the check is not applicable
    faults: tuple[str, ...] = ()  # one sentence each
    outcome: str = "ok"  # or not applicable, not finished

    @property
    def result(self) -> str:
        """Return ok, wrong, not finished or not applicable."""
        return "wrong" if self.faults else self.outcome

    @property
    def detail(self) -> str:
        """Return the first faults, or the note."""
        more = len(self.faults) - MAX_FAULTS
        parts = (
            *self.faults[:MAX_FAULTS],
            *[f"and {more} more"] * (more > 0),
            *[self.note] * (self.outcome == "not finished"),
        )
        return "; ".join(parts) or self.note


class NotApplicable(Exception):
    """The FMU does not offer what the check needs; the message is one sentence."""


class CallRefused(Exception):
    """A call that has to succeed was refused; the message is one sentence."""


def listed(names: list[str]) -> str:
    """Return names as text, the first MAX_FAULTS of them."""
    return ", ".join(names[:MAX_FAULTS]) + (f" and {len(names) - MAX_FAULTS} more" if len(names) > MAX_FAULTS else "")


STATUS = "OK", "Warning", "Discard", "Error", "Fatal"


class Version(NamedTuple):
    """Types and words of a version of FMI."""

    prefix: str  # of functions
    instantiate: str
    token: str  # what an instantiation has to name
    real: str  # type of the inputs that vary
    getters: tuple[tuple[str, Any, tuple[str, ...]], ...]  # function, C type, types of variables
    late: str  # a call that has to come before the first step


WHOLE = "Int64", "Int8", "Int16", "Int32", "UInt8", "UInt16", "UInt32", "UInt64"
VERSIONS = {
    "2.0": Version(
        *("fmi2", "Instantiate", "guid", "Real"),
        (
            ("GetReal", c_double, ("Real",)),
            ("GetInteger", c_int, ("Integer", "Enumeration")),
            ("GetBoolean", c_int, ("Boolean",)),
        ),
        "SetupExperiment",
    ),
    "3.0": Version(
        *("fmi3", "InstantiateCoSimulation", "instantiation token", "Float64"),
        tuple(
            (f"Get{kind}", fmi3.TYPES[kind], (kind, "Enumeration") if kind == "Int64" else (kind,))
            for kind in ("Float64", "Float32", *WHOLE, "Boolean")
        ),
        "EnterInitializationMode",
    ),
}
STEP = 1e-3  # s, communication step of an FMU without a default
STEPS = 20  # communication steps of a run
AMPLITUDES = (1e-3, 1e-6)  # of inputs that vary, relative to their start values, absolute below 1


class Subject:
    """FMU under examination; NotApplicable is raised if its description cannot be read.

    :param fmu: its file.
    :param step: communication step, s; None: that of its DefaultExperiment, else ``STEP``.
    :param note: called before each call of the FMU with words that tell where a crash happened.
    """

    def __init__(self, fmu: Path, step: float | None = None, note: Callable[[str], None] = lambda words: None) -> None:
        self.fmu, self._note, self._step = fmu, note, step
        self.instances, self.doing = 0, ""  # words for a piece of work
        self.unfinished: dict[str, Any] = {}  # note and outcome of a check without time enough
        self.kept: Any = None  # slave of an FMU that is reset instead of a new one
        self.deadline = math.inf  # s since the epoch

    def enter(self, function: str) -> None:
        """Note a call of a function of FMI."""
        self._note(f"{self.doing} ({function})" if self.doing else f"in {function}")

    def each(self, pieces: Sequence[Any]) -> Iterator[Any]:
        """Pieces of work while there is time; ``unfinished`` says how many of them if it does not suffice."""
        for done, piece in enumerate(pieces):
            if time.time() > self.deadline:
                self.unfinished = {"note": f"not finished: {done:,} of {len(pieces):,}", "outcome": "not finished"}
                return
            yield piece

    @cached_property
    def unpacked(self) -> tuple[Path, Any]:
        """Folder of its files, and content of modelDescription.xml."""
        try:
            return describe(self.fmu, VERSIONS)
        except ComponentFailed as failure:
            raise NotApplicable(str(failure)) from None

    @property
    def description(self) -> Any:
        """Content of modelDescription.xml."""
        return self.unpacked[1]

    @cached_property
    def is_fmi3(self) -> bool:
        """Whether it is one of FMI 3.0."""
        return is_fmi3(self.description)

    @cached_property
    def fmi(self) -> Version:
        """Types and words of the FMU's version of FMI."""
        return VERSIONS[self.description.fmiVersion[:3]]

    def name(self, function: str) -> str:
        """Return the whole name of a function."""
        return f"{self.fmi.prefix}{function}"

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

    @cached_property
    def all_variables(self) -> list[Any]:
        """Variables without the aliases of FMI 3.0, which are further names."""
        return [v for v in self.description.modelVariables if getattr(v, "alias", None) is None]

    def variables(self, causality: str, *kinds: str) -> list[Any]:
        """Return the variables of a causality and of these types."""
        return [v for v in self.all_variables if v.causality == causality and v.type in kinds]

    @cached_property
    def inputs(self) -> list[Any]:
        """Inputs that vary: those of the type Real, or Float64."""
        return self.variables("input", self.fmi.real)

    @cached_property
    def outputs(self) -> list[Any]:
        """Outputs other than Strings and Binaries, in the order of their values."""
        return [variable for _, _, kinds in self.fmi.getters for variable in self.variables("output", *kinds)]

    @cached_property
    def owner(self) -> dict[str, str]:
        """Name of the variable of each element of an input or output, by the name of the element."""
        return {name: v.name for v in (*self.inputs, *self.outputs) for name in element_names(v)}

    @cached_property
    def amplitude(self) -> float:
        """Relative amplitude of inputs that vary, the largest that the FMU takes; 0: start values only."""
        if self.description.coSimulation.canBeInstantiatedOnlyOncePerProcess:
            return AMPLITUDES[-1]  # the instance may be in use
        for amplitude in AMPLITUDES:
            with suppress(CallRefused), Instance(self) as trial:
                trial.initialise()
                for k in range(STEPS):
                    trial.step(k, amplitude)
                return amplitude
        return 0.0

    def input_values(self, k: int, amplitude: float) -> Floats:
        """Return the values of the inputs that vary, over step k, by element."""
        start = np.array([float(value or 0.0) for v in self.inputs for value in start_values(v)])
        return start + amplitude * np.maximum(1.0, abs(start)) * np.sin(0.5 * (k + 1) + np.arange(start.size))

    def differing(self, one: Floats, other: Floats) -> list[str]:
        """Return the names of elements of outputs that differ in a bit; outputs are the last axis of the arrays."""
        differ = one.view(np.int64) != other.view(np.int64)
        differ = differ.any(axis=tuple(range(differ.ndim - 1)))
        return [name for name, is_other in zip(names_of(self.outputs), differ, strict=True) if is_other]


def names_of(variables: Sequence[Any]) -> list[str]:
    """Return the names of the elements of variables."""
    return [name for variable in variables for name in element_names(variable)]


def instantiate(subject: Subject, token: str | None, messages: CallMessages) -> Any:
    """Return a new instance, a slave of ``fmi``; raises ComponentFailed.

    ``token``: another guid or instantiation token than that of the description. ``messages`` gets the errors of calls.
    """
    folder, description = subject.unpacked

    def receive(status: int, message: str, category: str) -> None:
        if status > WARNING:
            messages.receive(status, message, category, 0.0)

    require_binary(folder, description, subject.fmu)
    library = load_library(folder, description, subject.fmu)
    made = opening(folder, description, "checked", token or "")
    try:
        return LIBRARIES[made.version].Slave(library, made, receive, subject.enter)
    except NotInstantiated:
        raise ComponentFailed(messages.refusal()) from None


class Instance(AbstractContextManager["Instance"]):
    """Instance of an FMU; freed at the end of its ``with``, but never after the status Fatal.

    One that can be instantiated once per process is reset for the next instance. Raises NotApplicable if the FMU cannot
    be instantiated at all or only once at a time, CallRefused if it could before.
    """

    def __init__(self, subject: Subject, token: str | None = None) -> None:
        self._subject = subject
        self._messages = CallMessages("checked")
        self._lost = self._running = False
        self._once = bool(subject.description.coSimulation.canBeInstantiatedOnlyOncePerProcess)
        if subject.kept is not None and token is None:
            self.slave, subject.kept = subject.kept, None
            self.reset()
            return
        if subject.instances and self._once:
            raise NotApplicable("the FMU can be instantiated only once per process")
        try:
            self.slave = instantiate(subject, token, self._messages)
        except ComponentFailed as failure:
            raise (CallRefused if subject.instances or token else NotApplicable)(str(failure)) from None
        subject.instances += 1

    def attempt(self, function: Callable[..., Any], *arguments: Any) -> Any:
        """Call a function of the slave; return its result, a status or a tuple that begins with it."""
        self._messages.clear()
        result = function(*arguments)
        status = result[0] if isinstance(result, tuple) else result
        self._lost |= status == FATAL
        return result

    def must(self, function: Callable[..., Any], *arguments: Any) -> Any:
        """Make a call that has to succeed; return what follows its status. Raises CallRefused."""
        result = self.attempt(function, *arguments)
        status, *found = result if isinstance(result, tuple) else (result,)
        self._require(status)
        return found[0] if found else None

    def _require(self, status: int) -> None:
        if status > WARNING:
            name = self._subject.name(STATUS[status]) if status <= FATAL else str(status)
            message = f": {said}" if (said := self._messages.first_error()) else ""
            raise CallRefused(f"{self.slave.failed} has the status {name}{message}")

    def set_reals(self, references: Sequence[int], values: Sequence[float] | Floats) -> int:
        """Set variables of the type Real or Float64, all elements of each; return the status."""
        content = (c_double * len(values))(*values)
        return int(self._values(f"Set{self._subject.fmi.real}", references, content))

    def get_reals(self, references: Sequence[int], count: int) -> tuple[int, Floats]:
        """Return the status and the ``count`` values of variables of the type Real or Float64."""
        content = (c_double * count)()
        status = self._values(f"Get{self._subject.fmi.real}", references, content)
        return status, np.array(content)

    def _values(self, function: str, references: Sequence[int], content: Any) -> int:
        """Set or get variables, all elements of each."""
        n = len(references)
        arguments = (c_uint * n)(*references), n, content, *[len(content)] * self._subject.is_fmi3
        return int(self.attempt(self.slave.call, function, *arguments))

    def try_inputs(self, values: Sequence[float] | Floats) -> int:
        """Set all inputs that vary; return the status."""
        return self.set_reals([v.valueReference for v in self._subject.inputs], values) if len(values) else OK

    def set_inputs(self, values: Sequence[float] | Floats) -> None:
        """Set all inputs that vary; raises CallRefused."""
        self._require(self.try_inputs(values))

    def outputs(self) -> Floats:
        """Return all outputs, by element; raises CallRefused."""
        parts = []
        for function, c_type, kinds in self._subject.fmi.getters:
            variables = self._subject.variables("output", *kinds)
            content = (c_type * sum(map(number_of_elements, variables)))()
            if variables:
                self._require(self._values(function, [v.valueReference for v in variables], content))
            parts.append(np.array(content, dtype=float))
        return np.concatenate(parts)

    def enter(self) -> None:
        """Bring a new instance into initialisation mode; raises CallRefused."""
        self.must(self.slave.setup, self._subject.start, None)
        self.must(self.slave.enter_initialisation)

    def initialise(self) -> None:
        """Bring a new instance to its first step; raises CallRefused."""
        self.enter()
        self.leave_initialisation()

    def leave_initialisation(self) -> None:
        """Bring an instance from initialisation mode to its first step; raises CallRefused."""
        self.must(self.slave.exit_initialisation)
        self._running = True

    def terminate(self) -> None:
        """Terminate; raises CallRefused."""
        self.must(self.slave.terminate)
        self._running = False

    def reset(self) -> None:
        """Return to a new instance; raises CallRefused."""
        self.must(self.slave.reset)
        self._running = False

    def step(self, k: int, amplitude: float | None = None) -> Floats:
        """Make step k of a run with varying inputs; return all outputs. Raises CallRefused."""
        subject, h = self._subject, self._subject.step
        self.set_inputs(subject.input_values(k, subject.amplitude if amplitude is None else amplitude))
        status = self.attempt(self.slave.step, subject.start + k * h, h, False)
        if notes := self.slave.step_notes:
            raise CallRefused(f"{subject.name('DoStep')} {'; '.join(notes)}")
        self._require(status)
        return self.outputs()

    def run(self, first: int = 0, count: int = STEPS) -> Floats:
        """Make steps; return the outputs after each, (steps, outputs). Raises CallRefused."""
        return np.array([self.step(k) for k in range(first, first + count)])

    def attempt_step(self, t: float, h: float) -> tuple[bool, list[str]]:
        """Try a step of length h from t after the start, both in s; return whether it is taken, and its faults."""
        status = self.attempt(self.slave.step, self._subject.start + t, h, False)
        if status > WARNING:
            return False, self.fatal(status)
        values = zip(names_of(self._subject.outputs), self.outputs(), strict=True)
        return True, [f"{name} = {value:g}" for name, value in values if not math.isfinite(value)]

    def fatal(self, status: int) -> list[str]:
        """Return the fault of a refusal by the status Fatal."""
        words = f"{self._subject.name(STATUS[FATAL])}, after which no instance may be used"
        return [words] if status >= FATAL else []

    def __exit__(self, *ended: object) -> None:
        if self._running and not self._lost:
            self.attempt(self.slave.terminate)
        if self._once and not self._lost:
            self._subject.kept = self.slave
        elif not self._lost:
            self.slave.free()


def with_faults(what: str, faults: list[str]) -> list[str]:
    """Return one sentence about the faults of a call, or none."""
    return [f"{what}: {listed(faults)}"] if faults else []
