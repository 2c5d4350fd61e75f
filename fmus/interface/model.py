"""Interface between a component's model and its FMU shell: ports, flat state, kernels."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fmus.interface.ports import Port
from fmus.interface.sentences import GAPS, Sentence, format_sentence
from fmus.kernels.jit import by_reference, compile_inner, entry, kernel, plain
from fmus.physics.arrays import Floats


class InvalidParameter(ValueError):
    """A parameter has a value that the model does not accept; the message is one clear sentence."""


class StepFailed(RuntimeError):
    """A step could not be done; the message is one sentence with time, place and residual."""


MAX_STEPS = 10_000  # internal steps in one communication step: more would look like a process that hangs


def finite(values: Floats) -> bool:
    """Whether all values are finite: the sum of their squares is, or each one, which takes three times as long."""
    return math.isfinite(values.dot(values)) or bool(np.isfinite(values).all())


def flaw_of_state(model: ComponentModel, state: Floats) -> str:
    """Why an initialised model cannot have this flat state; empty if it can."""
    if state.shape != model.state.shape:
        return f"{state.size} numbers for {model.state.size}"
    if not finite(state):
        return "numbers that are not finite"
    for place, count in model.indices:
        if state[place] not in range(count):
            return f"{state[place]:g} is no index of {count} entries"
    return ""


TOO_MANY_STEPS = Sentence(
    "at t = {0:.6g} s a communication step of {1:.3g} s takes {2:.3g} internal steps of {3:.3g} s:"
    f" {MAX_STEPS} are allowed"
)
NO_ROTATION = "at t = {0:.6g} s the input {1:name}.orientation is no rotation: its length is {2:.3g}"


@kernel
def too_many_steps(numbers: Floats, t: float, h: float, longest: float) -> bool:
    """Whether a communication step of ``h`` s takes more internal steps of ``longest`` s than are allowed.

    Writes the numbers of the sentence ``TOO_MANY_STEPS`` into ``numbers``.
    """
    steps = h / longest
    numbers[0], numbers[1], numbers[2], numbers[3] = t, h, steps, longest
    return not steps <= MAX_STEPS


@kernel
def no_rotation(numbers: Floats, t: float, name: int, u: Floats, i: int) -> bool:
    """Whether the quaternion at ``u[i]`` of the input number ``name`` is no rotation (length 0.9 to 1.1).

    Writes the numbers of the sentence ``NO_ROTATION`` into ``numbers``.
    """
    length = np.sqrt(u[i] ** 2 + u[i + 1] ** 2 + u[i + 2] ** 2 + u[i + 3] ** 2)
    numbers[0], numbers[1], numbers[2] = t, name, length
    return not 0.9 < length < 1.1


@kernel
def not_given(steps: int, u: Floats, i: int) -> bool:
    """Whether a motion is still to come: before the first step (``steps`` 0) its quaternion at ``u[i]`` is zero.

    Some tools begin with zeros in all inputs and exchange values for the first time after their first step.
    """
    return steps == 0 and u[i] == 0.0 and u[i + 1] == 0.0 and u[i + 2] == 0.0 and u[i + 3] == 0.0


class FreeParameters(NamedTuple):
    """Parameters that stay settable in a native FMU: only ``start_kernel`` is computed again when they change."""

    # Place in the parts ("law.mu") -> expression ("{parameter} * 2.0 * <number of the config>")
    numbers: Mapping[str, str]
    start_only: tuple[str, ...] = ()  # parameters that only ``start_kernel`` reads


class ComponentModel:
    """Base of the components' models, without FMI: ``parts`` (named tuples of arrays and numbers) and kernels on them.

    ``ports`` lists Real inputs first, then Real outputs, then Real link outputs, then Integer outputs, then
    parameters (Real and String). ``state`` holds everything that changes between steps in one contiguous float64
    array that is allocated once: a model is saved by copying it (and ``counters``), and restored by copying back in
    place. A model that starts calls ``begin`` with its parts. The kernels are

    - ``start_kernel(parts, messages, p)``: sets the state to the start for the parameters ``p``, those of
      ``start_parameters``; returns 0 or an index of ``refusals``;
    - ``step_kernel(parts, messages, t, h, u)``: one communication step; returns 0 or an index of ``failures``. The
      numbers of that sentence go to the first row of ``messages``; warning k writes a 1 and its numbers to row k + 1;
    - ``output_kernel(parts, y)``: Real outputs without link outputs;
    - ``link_output_kernel(parts, y)``: link outputs, where there are any.

    Kernels access nothing but their parts, so they can be compiled into a library of their own (``fmus.native``).
    """

    failures: tuple[Sentence, ...] = ()  # the first one is empty
    warning_sentences: tuple[Sentence, ...] = ()
    refusals: tuple[Sentence, ...] = ()  # the first one is empty
    start_parameters: tuple[str, ...] = ()  # names of the parameters that ``start_kernel`` reads
    ports: tuple[Port, ...]
    inputs: int  # number of Real inputs
    indices: tuple[tuple[int, int], ...] = ()  # (place in the state, entries) of the indices that the state holds
    state: Floats
    counters: NDArray[np.int64]  # values of the Integer outputs, in port order
    link_ports = 0  # number of link outputs, the last of the Real outputs (computed only when read)
    unconnected: Floats = np.zeros(0)  # start values of the inputs of mounts: one that has them is moved by nothing
    start_kernel: Callable[..., int]
    step_kernel: Callable[..., int]
    output_kernel: Callable[..., None]
    link_output_kernel: Callable[..., None] | None = None

    def __init__(self, config: Mapping[str, Any]) -> None:
        """Make a model from ``config``, the resolved JSON that the build packed beside the component."""

    @classmethod
    def reads(cls, config: Mapping[str, Any]) -> list[str]:
        """Dotted keys and tables of the vehicle table that a model of this config reads, see ``interface.numbers``."""
        return []

    def free_parameters(self, p: Mapping[str, Any]) -> FreeParameters:
        """Parameters that need not be constant in a native FMU with the checked parameters ``p``."""
        raise NotImplementedError

    def begin(self, p: Mapping[str, Any], parts: Any, output_parts: Any = None, link_output_parts: Any = None) -> None:
        """Start with the checked parameters ``p`` and these parts.

        ``output_parts`` and ``link_output_parts``: those of the two kernels of outputs, where they are others. Raises
        InvalidParameter with a sentence of ``refusals``.
        """
        self.parts = by_reference(parts)
        self.output_parts = self.parts if output_parts is None else by_reference(output_parts)
        self.link_output_parts = self.parts if link_output_parts is None else by_reference(link_output_parts)
        self._messages, self._u = np.zeros((1 + len(self.warning_sentences), GAPS + 1)), np.zeros(self.inputs)
        self._y = np.zeros(0)  # for the type of the outputs
        self._step: Callable[..., int] | None = None  # these three are compiled at their first use
        self._show: Callable[..., None] | None = None
        self._show_links: Callable[..., None] | None = None
        self._new_warnings: list[str] = []
        refusal = plain(self.start_kernel)(parts, self._messages, tuple(p[name] for name in self.start_parameters))
        if refusal:
            raise InvalidParameter(format_sentence(self.refusals[refusal], self._messages[0]))

    def copy_state(self, state: Floats) -> bool:
        """Copy the flat state of an equal component into this one; False where its size differs."""
        if state.shape != self.state.shape:
            return False
        self.state[:] = state
        return True

    def initialise(self, parameters: Mapping[str, float | int | str]) -> None:
        """Set ``state`` to the start; raises InvalidParameter or StepFailed."""
        raise NotImplementedError

    def compile(self, parameters: Mapping[str, float | int | str], native: bool = False) -> None:
        """Compile the kernels of a start and a run, without a step; raises as ``initialise``.

        ``native``: those of a run as a native FMU is made of them, without machine code.
        """
        self.initialise(parameters)
        self.compile_run(native)

    def compile_run(self, native: bool) -> None:
        """Compile the kernels of a step and of outputs, after ``begin``."""
        if native:
            compile_inner(self.step_kernel, self.parts, self._messages, 0.0, 0.0, self._u)
            compile_inner(self.output_kernel, self.output_parts, self._y)
            if self.link_output_kernel is not None:
                compile_inner(self.link_output_kernel, self.link_output_parts, self._y)
            return
        self.compiled_step()
        self._compiled_outputs()
        self._compiled_link_outputs()

    def step(self, t: float, h: float, u: Floats) -> None:
        """Advance from t to t + h (s) with the inputs ``u`` (inputs) of time t.

        Raises StepFailed; the state is then the one before the step.
        """
        self._u[:] = u
        self._do_step(t, h, self._u)

    def compiled_step(self) -> Callable[..., int]:
        """Compiled kernel of a step."""
        if self._step is None:
            self._step = entry(self.step_kernel, self.parts, self._messages, 0.0, 0.0, self._u)
        return self._step

    def _do_step(self, t: float, h: float, u: Floats) -> None:
        before = self.state.copy(), self.counters.copy()
        failure = (self._step or self.compiled_step())(self.parts, self._messages, t, h, u)
        for sentence, row in zip(self.warning_sentences, self._messages[1:], strict=True):
            if row[0]:
                row[0] = 0.0
                self._new_warnings.append(format_sentence(sentence, row[1:]))
        if failure:
            self.state[:], self.counters[:] = before
            for port, value in zip(self.ports, u.tolist(), strict=False):
                if not math.isfinite(value):
                    raise StepFailed(f"at t = {t:.6g} s the input {port.name} is not finite")
            raise StepFailed(format_sentence(self.failures[failure], self._messages[0]))

    def outputs(self, y: Floats) -> None:
        """Write the Real outputs without link outputs into ``y``, in the order of the ports."""
        (self._show or self._compiled_outputs())(self.output_parts, y)

    def _compiled_outputs(self) -> Callable[..., None]:
        if self._show is None:
            self._show = entry(self.output_kernel, self.output_parts, self._y)
        return self._show

    def link_outputs(self, y: Floats) -> None:
        """Write the link outputs into ``y``, in the order of the ports."""
        show = self._show_links or self._compiled_link_outputs()
        if show is not None:
            show(self.link_output_parts, y)

    def _compiled_link_outputs(self) -> Callable[..., None] | None:
        if self._show_links is None and self.link_output_kernel is not None:
            self._show_links = entry(self.link_output_kernel, self.link_output_parts, self._y)
        return self._show_links

    def warnings(self) -> list[str]:
        """Return, and forget, the warnings since the last call: sentences to log with status warning."""
        new, self._new_warnings = self._new_warnings, []
        return new
