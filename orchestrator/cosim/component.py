"""Component: a loaded co-simulation FMU, called through fmpy with preallocated arrays.

All calls of an instance share its handle, arrays and phase: they are the methods of one class.
"""

from __future__ import annotations

import difflib
import math
from collections.abc import Callable, Collection, Mapping, Sequence
from contextlib import AbstractContextManager, suppress
from ctypes import (
    CFUNCTYPE,
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
from orchestrator.cosim.base_units import UNCHANGED, Conversion, inverse_factors
from orchestrator.cosim.graph import NO_CONVERSIONS, ComponentEnded, ComponentFailed, Floats, GuestTerms
from orchestrator.cosim.guests.library import GuestLibrary, Opening
from orchestrator.cosim.guests.supervisor import Room
from orchestrator.cosim.messages import (
    DISCARD,
    ERROR,
    FATAL,
    OK,
    WARNING,
    CallMessages,
    ComponentWarning,
    Logger,
    WarningList,
    status_text,
)
from orchestrator.cosim.mixed_exchange import ConvertedReals, MixedExchange, MixedInputs, MixedOutputs, guarded, misfit
from orchestrator.cosim.model_description import is_fmi3, load_library, loadable
from orchestrator.cosim.variable_arrays import VariableArrays
from orchestrator.kernels.tables import Record, StepCall, record

REALS = ("reals.base.lo", "reals.base.hi", "reals.size")  # address (two words) and bytes of an FMU's Reals in memory
C_TYPES: dict[str, Any] = {"Real": c_double, "String": c_char_p}  # those of other types depend on the version of FMI
_LAST_SUCCESSFUL_TIME, _TERMINATED = 2, 3  # kinds of a status
DO_STEP = CFUNCTYPE(c_int, c_void_p, c_double, c_double, c_int)
WALL_TIME = "wall_time"  # recorded beside the Integer outputs of a component
CALLS = {"set_real": "fmi2SetReal", "do_step": "fmi2DoStep", "get_real": "fmi2GetReal"}


class ComponentState(NamedTuple):
    """Saved FMU state with the values of the arrays and the warnings; valid until freed."""

    handle: fmi2FMUstate
    arrays: tuple[NDArray[Any], ...]  # u, y, y_links, counters
    warnings: Mapping[str, ComponentWarning]


# ------------------------------------------------------------------ component


class Component(VariableArrays, AbstractContextManager["Component"]):
    """FMU instance with arrays: write ``u``, step, read ``y``. Use it in a ``with``.

    Methods may be called from any thread, one at a time; the GIL is released while the FMU computes, unless the FMU
    itself holds it. Every failure raises ComponentFailed, with the message that the FMU logged, if any.
    """

    def __init__(  # noqa: PLR0913, the terms of an instance
        self,
        fmu: Path,
        name: str,
        logger: Logger | None = None,
        *,
        discrete: Collection[str] = (),
        conversions: Mapping[str, Conversion] = NO_CONVERSIONS,
        units: Mapping[str, str] = NO_CONVERSIONS,
        guest: GuestTerms | None = None,
        room: Room | None = None,
        resources: Path | None = None,
        starts: Sequence[float] = (),
    ) -> None:
        """Load and instantiate an FMU.

        ``discrete``: connected variables that are no Reals, which follow them in the arrays. ``conversions``,
        ``units``, ``guest``, ``resources`` and ``starts``: as of ``graph.Instance``. ``room``: process in which it is
        loaded, instead of this one.
        """
        self._resources, self._starts = resources, starts
        self._guest, self._remote = guest, GuestLibrary(room, self._receive) if room is not None else None
        self._messages = CallMessages(name, logger)
        self._clock = np.zeros(1)  # s from the start of the run, beginning of the last step
        self.start_time = 0.0  # s, time of the FMU at the start of the run
        self._states: list[ComponentState] = []
        self.start_inputs: dict[str, float] = {}  # inputs given before the start, by name
        self._mixed: MixedExchange | None = None
        self._handle: Any = None
        self._step_call: Record | None = None
        self._call_time = 0.0  # s inside the FMU, without steps by ``step_call``
        self._phase = "made"
        self._places: tuple[int, int, int] = 0, 0, 0  # addresses of inputs, outputs, link outputs; 0: unknown
        self._loaded = loadable(fmu)
        if room is None and is_fmi3(self._loaded.description):
            raise ComponentFailed(
                f"'{fmu}' is an FMU of FMI 3.0: only a process of its own runs it (in_process = false); FMUs of cotrack"
                " run in that of the run: build them of FMI 2.0"
            )
        memory = None if self._remote is None else self._remote.memory
        super().__init__(name, self._loaded, discrete, conversions, units, memory, guest is not None)
        if len(starts):
            self.u[: self._u[1]] = starts[: self._u[1]]
        for sentence in inverse_factors(self.description) if guest is not None else ():
            self._receive(WARNING, sentence, "")
        self._load(fmu)

    def _load(self, fmu: Path) -> None:
        folder, guid, elements = self._loaded.folder, self.description.guid or "", self._loaded.elements
        if self._remote is not None:
            self._library: Any = self._remote
            names = self.inputs[: self._u[1]], self.outputs[: self._y[1]]
            inputs, outputs = ([self._variables[name].valueReference for name in group] for group in names)
            places = (inputs, self._u_place), (outputs, self._raw_place)
            version, identifier = self.description.fmiVersion[:3], self.description.coSimulation.modelIdentifier
            opening = Opening(version, str(folder), identifier, self.name, guid, *places, elements)
            handle: int | None = int(self._remote.open(opening, self._u[0], self._y[0]))
            self._free: Callable[[int], int] = self._remote.fmi2FreeInstance
        else:
            self._library = load_library(folder, self.description, fmu)
            given = self._library, folder, self.name, guid, self._receive, self._resources
            handle, free = fmi2_library.instantiate(*given)
            self._free = lambda _: free() or OK
        if not handle:
            raise ComponentFailed(self._messages.refusal())
        self._mixed = self._mixed_exchange() if self._is_mixed else None
        self._handle = handle
        self._phase = "instantiated"

    def _mixed_exchange(self) -> MixedExchange:
        starts = {name: (self._variables[name].start or "").encode() for name in self._strings}
        converted = ConvertedReals(self.inputs, self.conversions)
        groups, known = self._input_groups, (starts, self.input_texts, self.links_in)
        inputs = MixedInputs(self.received, self.u, self._u, converted, groups, *known)
        converted = ConvertedReals(self.outputs, self.conversions)
        outputs = MixedOutputs(self._raw, self.y, converted, self._output_groups, self.texts)
        check = None if self._guest is None else self._check_finite
        return MixedExchange(self._library, inputs, outputs, self._receive, check)

    def _check_finite(self, values: Floats) -> int:
        """Look at outputs that the FMU has just output; return an FMI status."""
        if np.isfinite(values).all():
            return OK
        names = self.links if len(values) == len(self.links) != len(self._raw) else self.outputs
        where = int(np.flatnonzero(~np.isfinite(values))[0])
        sentence = f"output '{names[where]}' is {values[where]}"
        if self._guest is None or self._guest.non_finite == "warn":
            self._receive(WARNING, sentence, "")
            return WARNING
        self._receive(ERROR, f'{sentence} (fmu.{self.name}.non_finite = "warn" lets the run go on)', "")
        return ERROR

    @property
    def is_remote(self) -> bool:
        """Whether the FMU runs in a process of its own."""
        return self._remote is not None

    @property
    def warms_up(self) -> bool:
        """Whether a step that is taken back saves time later: not of an FMU of the user, which compiles nothing."""
        return self._guest is None and bool(self.description.coSimulation.canGetAndSetFMUstate)

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
        """CallMessages that the FMU logged with status warning since its start, without steps taken back."""
        return self._messages.warnings.entries()

    def set_warnings(self, earlier: Mapping[str, ComponentWarning]) -> None:
        """Set the warnings of the earlier process whose run is continued."""
        self._messages.warnings = WarningList(self.name, earlier)

    def _receive(self, status: int, message: str, category: str) -> None:
        self._messages.receive(status, message, category, float(self._clock[0]))

    def _call(self, function: Callable[..., int], *arguments: Any) -> None:
        if self._handle is None or (self._phase == "lost" and self._guest is not None):
            raise ComponentFailed(f"{self.name}: the component is closed")
        self._messages.clear()
        began = perf_counter()
        status = function(self._handle, *arguments)
        self._call_time += perf_counter() - began
        if not 0 <= status <= WARNING:
            raise self._failure(function.__name__, status)

    def _failure(self, function: str, status: int) -> ComponentFailed:
        starts, ends = self._phase == "instantiated", self._phase == "ended"
        if not 0 <= status < FATAL:
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
        if function == "fmi2DoStep" and status == DISCARD and not self._messages.has_error:
            return self._discarded_step(said_as)
        sentence = self._messages.first_error() or status_text(said_as, status)
        if (said_as if ends else "t = ") not in sentence and (self._guest is not None or not starts):
            sentence += f" ({said_as}{'' if ends else f', t = {float(self._clock[0]):.6g} s'})"
        return ComponentFailed(f"{self.name}: {sentence}")

    def _discarded_step(self, function: str) -> ComponentFailed:
        """Outcome of a step that the FMU has not completed, but does not call an error."""
        ended, reached = c_int(), c_double(math.nan)
        self._library.fmi2GetBooleanStatus(self._handle, _TERMINATED, byref(ended))
        self._library.fmi2GetRealStatus(self._handle, _LAST_SUCCESSFUL_TIME, byref(reached))
        start, said = float(self._clock[0]), self._messages.first_error()
        last = reached.value - self.start_time  # s from the start of the run, as all times of messages
        time_known = start < last < math.inf
        if ended.value:
            time = last if time_known else start
            return ComponentEnded(f"{self.name} has ended the run at t = {time:.6g} s{f': {said}' if said else ''}")
        sentence = said or status_text(function, DISCARD)
        if time_known:
            sentence += f"; the step from t = {start:.6g} s ended at t = {last:.6g} s:"
            sentence += f" a step of {last - start:.3g} s or less may help"
        elif "t = " not in sentence:
            sentence += f"; the step from t = {start:.6g} s is discarded, and no time is said that it reached"
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
            self._messages.warnings = WarningList(self.name)
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
        self._find_places()
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
        variable = self._variables.get(name)
        if name in self.constants and variable is not None and not (len(self._starts) and variable.type == "String"):
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
        try:
            value = self._loaded.taken(variable, value, self._guest is not None)
        except ValueError as error:
            raise ComponentFailed(f"{self.name}: parameter '{name}' = {value!r}: {error}") from None
        if name in self.inputs and variable.type != "String":
            k, (factor, offset) = self.inputs.index(name), self.conversions.get(name, UNCHANGED)
            self.u[k], self.received[k] = value, (float(value) - offset) / factor
            return
        c_type = C_TYPES.get(variable.type, self._loaded.whole)
        content = (c_type * 1)(value.encode() if isinstance(value, str) else value)
        setter = f"fmi2Set{variable.type.replace('Enumeration', 'Integer')}"
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
            self._copy_at_places()
            self._clock = self._step_call["t"]
        return self._step_call

    def read_links_when(self, due: int) -> None:
        """Let steps by ``step_call`` read link outputs whenever the word at the address ``due`` is not 0."""
        links_at, n_links, _ = self._y_links
        words = n_links, addressof(links_at), self.y_links.ctypes.data, due
        for name, word in zip(("n_links", "links", "y_links", "links_due"), words, strict=True):
            self.step_call[name] = word

    def prepare_step(self, t: float) -> None:
        """Prepare a step by ``step_call``; raises ComponentFailed."""
        if self._handle is None:
            raise ComponentFailed(f"{self.name}: the component is closed")
        self._clock[0] = t
        self._messages.clear()

    def failure(self) -> ComponentFailed | None:
        """Return the failure of the last step by ``step_call``, or None."""
        call = StepCall(*self.step_call[0].item())
        if not call.failed:
            return None
        return self._failure(CALLS[StepCall._fields[call.failed]], call.status)

    def read_links(self) -> None:
        """Read link outputs into ``y_links``."""
        if place := self._places[2]:
            reference, _, values = self._y_links
            self._call(self._library.fmi2GetReal, reference, 1, values)  # reading one makes the FMU compute all
            memmove(values, place, self.y_links.nbytes)
        else:
            self._exchange(self._library.fmi2GetReal, self._y_links)

    def _find_places(self) -> None:
        """Ask the FMU for the address of its Reals, where inputs, outputs and link outputs can be copied."""
        self._places = 0, 0, 0
        names = [name for name in REALS if name in self._variables and self._variables[name].type == "Integer"]
        if self._guest is None and self._remote is None and self._mixed is None and names == [*REALS]:
            values = (c_int * len(REALS))()
            self._call(self._library.fmi2GetInteger, self._references(REALS), len(REALS), values)
            low, high, size = values
            base = (high & 0xFFFFFFFF) << 32 | low & 0xFFFFFFFF
            groups = [[*references] for references, _, _ in (self._u, self._y, self._y_links)]
            in_rows = all(group == [*range(group[0], group[0] + len(group))] for group in groups if group)
            if in_rows and size == 8 * sum(v.type == "Real" for v in self._variables.values()):
                at_u, at_y, at_links = (base + 8 * group[0] if group else 0 for group in groups)
                self._places = at_u, at_y, at_links
        if self._step_call is not None:
            self._copy_at_places()

    def _copy_at_places(self) -> None:
        """Let steps by ``step_call`` copy values where the FMU has them."""
        for name, place in zip(("u_array", "y_array", "links_array"), self._places, strict=True):
            self.step_call[name] = place

    def read_counters(self) -> None:
        """Read the Integer, Enumeration and Boolean outputs, in this order, into ``counters``."""
        self._exchange(self._library.fmi2GetInteger, self._counters)
        self._exchange(self._library.fmi2GetBoolean, self._truth_values)
        if sentence := misfit(self._ranges, self.counters):
            raise ComponentFailed(f"{self.name}: {sentence} (t = {float(self._clock[0]):.6g} s)")

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
        state = ComponentState(handle, tuple(array.copy() for array in self._arrays), self._messages.warnings.save())
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
        self._messages.warnings.restore(state.warnings)

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
        self._find_places()
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
        """Terminate and free the instance; a failure is a warning. After fmi2Fatal no function may be called."""
        if self._handle is None:
            return
        for state in [] if self._phase == "lost" else list(self._states):
            with suppress(ComponentFailed):
                self.free(state)
        for function in [self._library.fmi2Terminate] * (self._phase == "running") + [self._free]:
            if self._phase == "lost":
                break
            self._phase = "ended"
            try:
                self._call(function)
            except ComponentFailed as failure:
                self._receive(WARNING, str(failure).removeprefix(f"{self.name}: "), "")
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
