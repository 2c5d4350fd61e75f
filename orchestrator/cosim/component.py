"""Component: a loaded co-simulation FMU, called through fmpy with preallocated arrays.

The module is longer than 400 lines because all calls of an instance share its handle, arrays and phase: they are the
methods of one class.
"""

from __future__ import annotations

import difflib
import math
from collections.abc import Callable, Collection, Mapping, Sequence
from contextlib import AbstractContextManager, suppress
from ctypes import (
    CFUNCTYPE,
    POINTER,
    addressof,
    byref,
    c_char_p,
    c_double,
    c_int,
    c_size_t,
    c_uint,
    c_void_p,
    cast,
    create_string_buffer,
    memmove,
)
from pathlib import Path
from time import perf_counter
from typing import Any, NamedTuple

import numpy as np
from fmpy.fmi2 import fmi2FMUstate
from numpy.typing import NDArray

from orchestrator.cosim import fmi2_library
from orchestrator.cosim.base_units import UNCHANGED, Conversion, base_unit, unit_of
from orchestrator.cosim.graph import NO_CONVERSIONS, ComponentEnded, ComponentWarning, Guest, WarningList
from orchestrator.cosim.graph import ComponentFailed as ComponentFailed
from orchestrator.cosim.guests.library import GuestLibrary, Opening
from orchestrator.cosim.guests.room import PRINTED, Room
from orchestrator.cosim.mixed_exchange import (
    START,
    ConvertedReals,
    MixedExchange,
    MixedInputs,
    MixedOutputs,
    Texts,
    discrete_groups,
    guarded,
)
from orchestrator.cosim.model_description import Elements, is_fmi3, loadable
from orchestrator.kernels.tables import Record, StepCall, record

Floats = NDArray[np.float64]
Logger = Callable[[str, int, str], None]  # instance, FMI status, message; of a warning only the first of its kind
LINK_FAMILIES = ("link[", "joint[")  # prefixes of per-link outputs, which are read and recorded at their own rate
ARRAY = ("links.base.lo", "links.base.hi", "links.size")  # address (two words) and bytes of the array of link outputs
SETTERS: dict[str, tuple[str, Any, Any]] = {  # FMI type: setter, C type, allowed Python types
    "Real": ("fmi2SetReal", c_double, int | float),
    "Integer": ("fmi2SetInteger", c_int, int),
    "Enumeration": ("fmi2SetInteger", c_int, int),
    "Boolean": ("fmi2SetBoolean", c_int, bool),
    "String": ("fmi2SetString", c_char_p, str),
}
_OK, _WARNING, _DISCARD, _ERROR, _FATAL, _PENDING = range(6)  # FMI status
_LAST_SUCCESSFUL_TIME, _TERMINATED = 2, 3  # kinds of a status
DO_STEP = CFUNCTYPE(c_int, c_void_p, c_double, c_double, c_int)
WALL_TIME = "wall_time"  # recorded beside the Integer outputs of a component
CALLS = {"set_real": "fmi2SetReal", "do_step": "fmi2DoStep", "get_real": "fmi2GetReal"}
_WRAPPER = "Fatal py exception encountered: "  # pythonfmu: the sentence is on the last line


class ComponentState(NamedTuple):
    """Saved FMU state with the values of the arrays and the warnings; valid until freed."""

    handle: fmi2FMUstate
    arrays: tuple[NDArray[Any], ...]  # u, y, y_links, counters
    warnings: Mapping[str, ComponentWarning]


# ------------------------------------------------------------------ component


class Component(AbstractContextManager["Component"]):
    """FMU instance with arrays: write ``u``, step, read ``y``. Use it in a ``with``.

    Methods may be called from any thread, one at a time; the GIL is released while the FMU computes, unless the FMU
    itself holds it. Every failure raises ComponentFailed, with the message that the FMU logged, if any.
    """

    def __init__(  # noqa: PLR0913, the terms of an instance
        self,
        fmu: Path,
        name: str,
        logger: Logger | None = None,
        guid: str | None = None,
        *,
        discrete: Collection[str] = (),
        conversions: Mapping[str, Conversion] = NO_CONVERSIONS,
        units: Mapping[str, str] = NO_CONVERSIONS,
        guest: Guest | None = None,
        room: Room | None = None,
        resources: Path | None = None,
        starts: Sequence[float] = (),
    ) -> None:
        """Load and instantiate an FMU.

        ``guid``: another one than that of its description, which it should refuse. ``discrete``: connected variables
        that are no Reals, which follow them in the arrays. ``conversions``, ``units``, ``guest``, ``resources`` and
        ``starts``: as of ``graph.Instance``. ``room``: process in which it is loaded, instead of this one.
        """
        self.name = name
        self._resources, self._starts = resources, starts
        self._guest, self._remote = guest, GuestLibrary(room, self._receive) if room is not None else None
        self._discrete, self.conversions, self.converted_units = discrete, conversions, units
        self.texts = Texts()  # of its String outputs
        self.input_texts: dict[str, Texts] = {}  # of the sources of String inputs
        self._logger = logger
        self._messages: list[tuple[int, str]] = []
        self._warnings = WarningList(name)
        self._clock = np.zeros(1)  # s from the start of the run, beginning of the last step
        self.start_time = 0.0  # s, time of the FMU at the start of the run
        self._states: list[ComponentState] = []
        self.start_inputs: dict[str, float] = {}  # inputs given before the start, by name
        self._mixed: MixedExchange | None = None
        self._handle: Any = None
        self._step_call: Record | None = None
        self._call_time = 0.0  # s inside the FMU, without steps by ``step_call``
        self._phase = "made"
        folder, self.description, elements = loadable(fmu)
        if room is None and is_fmi3(self.description):
            raise ComponentFailed(f"'{fmu}' is an FMU of FMI 3.0: it runs in a process of its own only")
        self._sort_variables()
        if len(starts):
            self.u[: self._u[1]] = starts[: self._u[1]]
        self._load(folder, fmu, guid or self.description.guid or "", elements)

    def _sort_variables(self) -> None:
        variables = self.description.modelVariables
        self._variables = {v.name: v for v in variables}

        def names(causality: str, kind: str) -> tuple[str, ...]:
            return tuple(v.name for v in variables if v.causality == causality and v.type == kind)

        outputs, reals_in = names("output", "Real"), names("input", "Real")
        reals_out = tuple(n for n in outputs if not n.startswith(LINK_FAMILIES))
        connected = {
            causality: [v for v in variables if v.causality == causality and v.name in self._discrete]
            for causality in ("input", "output")
        }
        self._input_groups = discrete_groups(connected["input"], len(reals_in))
        self._output_groups = discrete_groups(connected["output"], len(reals_out))
        self.inputs = (*reals_in, *(name for group in self._input_groups for name in group.names))
        self.outputs = (*reals_out, *(name for group in self._output_groups for name in group.names))
        self.links = tuple(n for n in outputs if n.startswith(LINK_FAMILIES))
        whole, self._truths = (*names("output", "Integer"), *names("output", "Enumeration")), names("output", "Boolean")
        self.integers = (*whole, *self._truths)
        self.parameters = tuple(v.name for v in variables if v.causality == "parameter")
        self.constants = {v.name: v.start for v in variables if v.variability == "constant"}
        self.u, self._u_place = self._array(len(self.inputs))
        self.u[:] = [_start(self._variables[n]) for n in self.inputs]
        self.received = self.u.copy() if set(self.inputs) & set(self.conversions) else self.u
        self.y = np.zeros(len(self.outputs) + 1)[:-1]  # memory for one link output follows
        self._is_mixed = bool(self.conversions or self._input_groups or self._output_groups or self._guest)
        raw, self._raw_place = self._array(len(reals_out) + 1)
        raw = raw[:-1] if self._is_mixed else self.y
        self.y_links = np.zeros(len(self.links))
        self.counters = np.zeros(len(self.integers), dtype=np.int32)
        self._arrays: tuple[NDArray[Any], ...] = (self.u, self.y, self.y_links, self.counters)
        self._u = self._group(reals_in, self.u, c_double)
        self._y = self._group(reals_out, raw, c_double, self.links[:1])
        self._raw = raw
        self._y_links = self._group(self.links, self.y_links, c_double)
        self._counters = self._group(whole, self.counters, c_int)
        self._truth_values = self._group(self._truths, self.counters[len(whole) :], c_int)
        self._link_address = 0  # address of the FMU's array of link outputs; 0: unknown

    def _array(self, n: int) -> tuple[Floats, int]:
        """Array of n zeros that the FMU's process shares, and its place there."""
        return (np.zeros(n), 0) if self._remote is None else self._remote.memory(n)

    def _group(
        self, names: tuple[str, ...], values: NDArray[Any], kind: type, trailing: tuple[str, ...] = ()
    ) -> tuple[Any, int, Any]:
        return self._references((*names, *trailing)), len(names), values.ctypes.data_as(POINTER(kind))

    def _references(self, names: tuple[str, ...]) -> Any:
        return (c_uint * len(names))(*(self._variables[name].valueReference for name in names))

    def _load(self, folder: Path, fmu: Path, guid: str, elements: Elements) -> None:
        identifier = self.description.coSimulation.modelIdentifier
        if self._remote is not None:
            self._library: Any = self._remote
            names = self.inputs[: self._u[1]], self.outputs[: self._y[1]]
            inputs, outputs = ([self._variables[name].valueReference for name in group] for group in names)
            places = (inputs, self._u_place), (outputs, self._raw_place)
            version = self.description.fmiVersion[:3]
            opening = Opening(version, str(folder), identifier, self.name, guid, *places, elements)
            handle: int | None = int(self._remote.open(opening, self._u[0], self._y[0]))
            self._free: Callable[[], None] = self._remote.free
        else:
            try:
                self._library = fmi2_library.load(folder, identifier)
            except Exception as error:
                raise ComponentFailed(f"cannot load the binary of '{fmu}': {error}") from None
            given = self._library, folder, self.name, guid, self._receive, self._resources
            handle, self._free = fmi2_library.instantiate(*given)
        if not handle:
            raise ComponentFailed(f"{self.name}: {self._first_error() or 'the FMU cannot be instantiated'}")
        self._mixed = self._mixed_exchange() if self._is_mixed else None
        self._handle = handle
        self._phase = "instantiated"

    def recorded_texts(self) -> dict[str, list[str]]:
        """Texts by their numbers in the arrays, for each connected String as "instance.variable"."""
        tables = {name: self.input_texts.get(name, self.texts) for name in self._strings}
        return {f"{self.name}.{name}": texts.words() for name, texts in tables.items()}

    def know_texts(self, texts: Mapping[str, Sequence[str]]) -> None:
        """Number texts as an earlier run did, whose ``recorded_texts`` they are."""
        for name in self._strings:
            known = [text.encode() for text in texts.get(f"{self.name}.{name}", ())]
            if name in self.inputs:
                self.input_texts[name] = Texts(known)
            else:
                for text in known:
                    self.texts.number(text)

    @property
    def _strings(self) -> list[str]:
        groups = (*self._input_groups, *self._output_groups)
        return [name for group in groups if group.kind == "String" for name in group.names]

    def _mixed_exchange(self) -> MixedExchange:
        starts = {name: (self._variables[name].start or "").encode() for name in self._strings}
        converted = ConvertedReals(self.inputs, self.conversions)
        inputs = MixedInputs(self.received, self.u, self._u, converted, self._input_groups, starts, self.input_texts)
        converted = ConvertedReals(self.outputs, self.conversions)
        outputs = MixedOutputs(self._raw, self.y, converted, self._output_groups, self.texts)
        check = None if self._guest is None else self._check_finite
        return MixedExchange(self._library, inputs, outputs, check)

    def _check_finite(self, values: Floats) -> int:
        """Look at outputs that the FMU has just output; return an FMI status."""
        if np.isfinite(values).all():
            return _OK
        names = self.links if len(values) == len(self.links) != len(self._raw) else self.outputs
        where = int(np.flatnonzero(~np.isfinite(values))[0])
        sentence = f"output '{names[where]}' is {values[where]}"
        if self._guest is None or self._guest.non_finite == "warn":
            self._receive(_WARNING, sentence, "")
            return _WARNING
        self._receive(_ERROR, f'{sentence} (fmu.{self.name}.non_finite = "warn" lets the run go on)', "")
        return _ERROR

    @property
    def is_remote(self) -> bool:
        """Whether the FMU runs in a process of its own."""
        return self._remote is not None

    @property
    def warms_up(self) -> bool:
        """Whether a step that is taken back saves time later: not of an FMU of the user, which compiles nothing."""
        return self._guest is None and bool(self.description.coSimulation.canGetAndSetFMUstate)

    @property
    def functions(self) -> tuple[Any, int]:
        """Library of the FMI functions, and the instance, their first argument: for calls that no method makes."""
        return self._library, self._handle

    def unit(self, name: str) -> str:
        """Return the unit of a variable in the arrays, '1' if it has none."""
        return self.converted_units.get(name) or unit_of(self._variables[name]) or "1"

    def dimension(self, name: str) -> tuple[float, ...] | None:
        """Return the exponents of kg, m, s, A, K, mol, cd and 10 in an output's unit; None if unknown."""
        base, conversion = base_unit(self.description, self._variables[name]), self.conversions.get(name, UNCHANGED)
        return None if base is None else (*base.exponents, math.log10(base.factor / conversion.factor))

    @property
    def wall_time(self) -> float:
        """Time inside the FMU since it was initialised, s."""
        return self._call_time + (0.0 if self._step_call is None else float(self._step_call["total"][0]))

    @wall_time.setter
    def wall_time(self, seconds: float) -> None:
        self._call_time = seconds
        if self._step_call is not None:
            self._step_call["total"] = 0.0

    # -------------------------------------------------------------- messages

    @property
    def warnings(self) -> list[ComponentWarning]:
        """Messages that the FMU logged with status warning since its start, without steps taken back."""
        return self._warnings.entries()

    def set_warnings(self, earlier: Mapping[str, ComponentWarning]) -> None:
        """Set the warnings of the earlier process whose run is continued."""
        self._warnings = WarningList(self.name, earlier)

    def _receive(self, status: int, message: str, category: str) -> None:
        if category == PRINTED:
            status, message = _WARNING, f"it prints: {message}"  # shown, but no warning of the FMU
        elif status == _WARNING and not self._warnings.add(message, float(self._clock[0])):
            return
        if status >= _DISCARD and category != "traceback":
            self._messages.append((status, message))
        if self._logger is not None:
            self._logger(self.name, status, message)

    def _first_error(self) -> str:
        """Return the first error message that the FMU logged in the last call, on one line."""
        if not self._messages:
            return ""
        text = self._messages[0][1].strip()
        if text.startswith(_WRAPPER):
            text = text.splitlines()[-1]
        return " ".join(text.split())

    def _call(self, function: Callable[..., int], *arguments: Any) -> None:
        if self._handle is None:
            raise ComponentFailed(f"{self.name}: the component is closed")
        if self._messages:
            self._messages.clear()
        began = perf_counter()
        status = function(self._handle, *arguments)
        self._call_time += perf_counter() - began
        if not 0 <= status <= _WARNING:
            raise self._failure(function.__name__, status)

    def _failure(self, function: str, status: int) -> ComponentFailed:
        if not 0 <= status < _FATAL:
            self._phase = "lost"
        if self._mixed is not None:
            function = self._mixed.failed or function
            if isinstance(self._mixed.raised, ComponentFailed):
                return self._mixed.raised
            if self._mixed.raised is not None:
                raise self._mixed.raised
        if self._remote is not None:
            function = self._remote.failed or function
        said_as = f"fmi3{function[4:]}".replace("Real", "Float64") if is_fmi3(self.description) else function
        if function == "fmi2DoStep" and status == _DISCARD and not any(each >= _ERROR for each, _ in self._messages):
            return self._discarded_step(said_as)
        sentence = self._first_error() or _status_text(said_as, status)
        if self._phase not in ("made", "instantiated") and "t = " not in sentence:
            sentence += f" ({said_as}, t = {float(self._clock[0]):.6g} s)"
        return ComponentFailed(f"{self.name}: {sentence}")

    def _discarded_step(self, function: str) -> ComponentFailed:
        """Outcome of a step that the FMU has not completed, but does not call an error."""
        ended, reached = c_int(), c_double(math.nan)
        self._library.fmi2GetBooleanStatus(self._handle, _TERMINATED, byref(ended))
        self._library.fmi2GetRealStatus(self._handle, _LAST_SUCCESSFUL_TIME, byref(reached))
        start, said = float(self._clock[0]), self._first_error()
        time_known = start < reached.value < math.inf
        if ended.value:
            time = reached.value if time_known else start
            return ComponentEnded(f"{self.name} has ended the run at t = {time:.6g} s{f': {said}' if said else ''}")
        sentence = said or _status_text(function, _DISCARD)
        if time_known:
            sentence += f"; the step from t = {start:.6g} s ended at t = {reached.value:.6g} s: a shorter one may help"
        return ComponentFailed(f"{self.name}: {sentence}")

    # -------------------------------------------------------------- initialisation and steps

    def initialise(
        self, parameters: Mapping[str, float | int | str], start: float | None = None, stop: float | None = None
    ) -> None:
        """Set parameters, initialise with the inputs in ``u`` and read all outputs; times of the FMU in s.

        Raises ComponentFailed, also for an unknown parameter or a value of the wrong type.
        """
        self.enter(parameters, start, stop)
        self.leave_initialisation()

    def enter(
        self, parameters: Mapping[str, float | int | str], start: float | None = None, stop: float | None = None
    ) -> None:
        """Set parameters and enter initialisation mode, as ``initialise`` does."""
        if self._phase != "instantiated":
            self._call(self._library.fmi2Reset)
            self._phase = "instantiated"
            self._warnings = WarningList(self.name)
        self.start_time, self._clock[0] = self.start_time if start is None else start, 0.0
        start = self.start_time
        for name, value in parameters.items():
            self._set_parameter(name, value)
        fmu = self._library
        self._call(fmu.fmi2SetupExperiment, False, 0.0, start, stop is not None, 0.0 if stop is None else stop)
        self._call(fmu.fmi2EnterInitializationMode)

    def set_inputs(self) -> None:
        """Set the inputs in ``u``, which need no conversion."""
        if self._mixed is None:
            self._exchange(self._library.fmi2SetReal, self._u)
        else:
            self._call(self._mixed.set_inputs)

    def leave_initialisation(self) -> None:
        """Set the inputs, leave initialisation mode and read all outputs."""
        self.set_inputs()
        self._call(self._library.fmi2ExitInitializationMode)
        self._phase = "running"
        self._find_link_array()
        self.read()
        self.read_links()
        self.read_counters()
        self.wall_time = 0.0

    def start_with(self, inputs: Mapping[str, float]) -> None:
        """Set inputs before ``initialise``, as others output them; raises ComponentFailed for an unknown one."""
        for name, value in inputs.items():
            if name not in self.inputs:
                raise ComponentFailed(f"{self.name}: there is no input '{name}'")
            k = self.inputs.index(name)
            self.received[k] = self.u[k] = value
            if name in self.conversions:
                factor, offset = self.conversions[name]
                self.u[k] = factor * value + offset
            self.start_inputs[name] = float(self.u[k])

    def _set_parameter(self, name: str, value: float | int | str) -> None:
        if name in self.constants:
            variable = self._variables[name]
            own = len(self._starts) and variable.type == "Real"  # value references are places among the starts
            constant = self._starts[variable.valueReference] if own else self.constants[name]
            if value != (constant if isinstance(value, str) else float(constant)):
                raise ComponentFailed(f"{self.name}: '{name}' = {value}: it is a constant of this FMU, {constant}")
            return
        if name not in self.parameters and not self._has_start(name):
            near = difflib.get_close_matches(name, self.parameters, 1)
            hint = f" (did you mean '{near[0]}'?)" if near else ""
            raise ComponentFailed(f"{self.name}: there is no parameter '{name}'{hint}")
        variable = self._variables[name]
        setter, c_type, allowed = SETTERS[variable.type]
        if not isinstance(value, allowed) or isinstance(value, bool) != (variable.type == "Boolean"):
            raise ComponentFailed(f"{self.name}: parameter '{name}' = {value!r}: must be of type {variable.type}")
        if name in self.inputs and variable.type != "String":
            k, (factor, offset) = self.inputs.index(name), self.conversions.get(name, UNCHANGED)
            self.u[k], self.received[k] = value, (float(value) - offset) / factor
            return
        content = (c_type * 1)(value.encode() if isinstance(value, str) else value)
        self._call(getattr(self._library, setter), (c_uint * 1)(variable.valueReference), 1, content)

    def _has_start(self, name: str) -> bool:
        """Whether a start value of a variable that is no parameter may be set (FMI 2.0.4, section 2.2.7)."""
        variable = self._variables.get(name)
        return variable is not None and (variable.causality == "input" or variable.initial in ("exact", "approx"))

    def write(self) -> None:
        """Set the FMU's inputs from ``u``, or from ``received`` if some are converted."""
        if self._mixed is None:
            self.set_inputs()
        else:
            self._call(self._mixed.write)

    def step(self, t: float, h: float) -> None:
        """Advance the FMU from t after the start of the run by h, both in s."""
        self._clock[0] = t
        self._call(self._library.fmi2DoStep, self.start_time + t, h, not self._states)

    def read(self) -> None:
        """Read the outputs, without link outputs, into ``y``."""
        if self._mixed is None:
            self._exchange(self._library.fmi2GetReal, self._y)
        else:
            self._call(self._mixed.read, *self._y)

    @property
    def step_call(self) -> Record:
        """Table (a ``StepCall``) with which kernels do ``write``, ``step`` and ``read``."""
        if self._step_call is None:
            fmu = self._library
            setter, getter = self._mixed.addresses if self._mixed else (fmu.fmi2SetReal, fmu.fmi2GetReal)
            stepper, begin = fmu.fmi2DoStep, None
            if self._remote is not None:
                stepper, begin = self._in_two = (
                    DO_STEP(guarded(self._remote.finish_step, self._mixed)),
                    DO_STEP(guarded(self._remote.begin_step, self._mixed)),
                )
            write, step, read = (cast(function, c_void_p).value or 0 for function in (setter, stepper, getter))
            begin_at = 0 if begin is None else cast(begin, c_void_p).value or 0
            (u_at, _, _), (y_at, n_y, _) = self._u, self._y
            instance = int(self._handle)
            inputs = write, addressof(u_at), len(self.u), self.u.ctypes.data
            outputs = read, addressof(y_at), n_y, self._raw.ctypes.data
            times = self.start_time, float(self._clock[0]), 0.0
            call = StepCall(instance, *inputs, step, *outputs, *times, not self._states, begin_at)
            self._step_call = record(call)
            self._clock = self._step_call["t"]
        return self._step_call

    def read_links_when(self, due: int) -> None:
        """Let steps by ``step_call`` read link outputs whenever the word at the address ``due`` is not 0."""
        links_at, n_links, _ = self._y_links
        words = n_links, addressof(links_at), self.y_links.ctypes.data, due, self._link_address
        for name, word in zip(StepCall._fields[StepCall._fields.index("n_links") :], words, strict=True):
            self.step_call[name] = word

    def prepare_step(self, t: float) -> None:
        """Prepare a step by ``step_call``; raises ComponentFailed."""
        if self._handle is None:
            raise ComponentFailed(f"{self.name}: the component is closed")
        self._clock[0] = t
        if self._messages:
            self._messages.clear()

    def failure(self) -> ComponentFailed | None:
        """Return the failure of the last step by ``step_call``, or None."""
        call = StepCall(*self.step_call[0].item())
        if not call.failed:
            return None
        return self._failure(CALLS[StepCall._fields[call.failed]], call.status)

    def read_links(self) -> None:
        """Read link outputs into ``y_links``."""
        if self._link_address:
            reference, _, values = self._y_links
            self._call(self._library.fmi2GetReal, reference, 1, values)  # reading one makes the FMU compute all
            memmove(values, self._link_address, self.y_links.nbytes)
        else:
            self._exchange(self._library.fmi2GetReal, self._y_links)

    def _find_link_array(self) -> None:
        """Ask the FMU for the address of its link outputs, from which they can be copied."""
        names = [name for name in ARRAY if name in self._variables and self._variables[name].type == "Integer"]
        if self._remote is None and names == [*ARRAY] and self.links:
            values = (c_int * len(ARRAY))()
            self._call(self._library.fmi2GetInteger, self._references(ARRAY), len(ARRAY), values)
            low, high, size = values
            self._link_address = (high & 0xFFFFFFFF) << 32 | low & 0xFFFFFFFF if size == self.y_links.nbytes else 0

    def read_counters(self) -> None:
        """Read the Integer, Enumeration and Boolean outputs, in this order, into ``counters``."""
        self._exchange(self._library.fmi2GetInteger, self._counters)
        self._exchange(self._library.fmi2GetBoolean, self._truth_values)

    def _exchange(self, function: Callable[..., Any], group: tuple[Any, int, Any]) -> None:
        if group[1]:
            self._call(function, *group)

    # -------------------------------------------------------------- state

    def save(self) -> ComponentState:
        """Save the state of the FMU and the arrays; the result must be freed."""
        handle = fmi2FMUstate()
        self._call(self._library_with("canGetAndSetFMUstate", "save its state").fmi2GetFMUstate, byref(handle))
        return self._state(handle)

    def _state(self, handle: fmi2FMUstate) -> ComponentState:
        state = ComponentState(handle, tuple(array.copy() for array in self._arrays), self._warnings.save())
        self._set_states([*self._states, state])
        return state

    def _set_states(self, states: list[ComponentState]) -> None:
        self._states = states
        if self._step_call is not None:
            self._step_call["no_rollback"] = not states

    def restore(self, state: ComponentState) -> None:
        """Restore a saved state bit by bit; it stays valid."""
        self._call(self._library_with("canGetAndSetFMUstate", "restore a state").fmi2SetFMUstate, state.handle)
        self._phase = "running"
        for array, saved in zip(self._arrays, state.arrays, strict=True):
            array[:] = saved
        self._warnings.restore(state.warnings)

    def free(self, state: ComponentState) -> None:
        """Release a saved state."""
        self._set_states([saved for saved in self._states if saved is not state])
        self._call(self._library.fmi2FreeFMUstate, byref(state.handle))

    def dump(self, state: ComponentState) -> bytes:
        """Serialise a saved state for another process with the same FMU."""
        fmu = self._library_with("canSerializeFMUstate", "write its state")
        size = c_size_t()
        self._call(fmu.fmi2SerializedFMUstateSize, state.handle, byref(size))
        content = create_string_buffer(size.value)
        self._call(fmu.fmi2SerializeFMUstate, state.handle, content, size)
        return content.raw

    def load(self, content: bytes) -> ComponentState:
        """Restore from the bytes of ``dump``, also into an instance that is not initialised; must be freed."""
        fmu = self._library_with("canSerializeFMUstate", "read a state")
        handle = fmi2FMUstate()
        size = len(content)
        self._call(fmu.fmi2DeSerializeFMUstate, create_string_buffer(content, size), size, byref(handle))
        self._call(fmu.fmi2SetFMUstate, handle)
        self._phase = "running"
        self._find_link_array()
        self._exchange(fmu.fmi2GetReal, self._u)
        self.read()
        self.read_links()
        self.read_counters()
        return self._state(handle)

    def _library_with(self, capability: str, what: str) -> Any:
        if not getattr(self.description.coSimulation, capability):
            raise ComponentFailed(f"{self.name}: the FMU cannot {what}")
        return self._library

    # -------------------------------------------------------------- end

    def close(self) -> None:
        """Terminate and free the instance; after fmi2Fatal no function may be called."""
        if self._handle is None:
            return
        if self._phase != "lost":
            for state in list(self._states):
                with suppress(ComponentFailed):
                    self.free(state)
            if self._phase == "running":
                with suppress(ComponentFailed):
                    self._call(self._library.fmi2Terminate)
            self._free()
        self._handle = None

    def __exit__(self, *ended: object) -> None:
        self.close()


def description_of(fmu: Path) -> Any:
    """Model description of an FMU, as of fmpy; raises ComponentFailed unless it is one that can be loaded here."""
    description = loadable(fmu).description
    taken = {WALL_TIME} if any(v.name == WALL_TIME and v.type != "Real" for v in description.modelVariables) else set()
    for name in (variable.name for variable in description.modelVariables):
        if name in taken:
            raise ComponentFailed(f"'{fmu}' has a variable '{name}', and there is another one of that name in its log")
        taken.add(name)
    return description


def _start(variable: Any) -> float:
    """Start value of an input in ``u``."""
    if variable.type == "String":
        return START
    return float(variable.start in ("true", "1") if variable.type == "Boolean" else variable.start or 0.0)


def _status_text(function: str, status: int) -> str:
    if not 0 <= status <= _PENDING:
        return f"{function} returned the status {status}, which FMI does not have"
    if status == _PENDING:
        return f"{function} returned before it was done (fmi2Pending): asynchronous steps are not supported"
    return f"{function} failed with FMI status {status}"
