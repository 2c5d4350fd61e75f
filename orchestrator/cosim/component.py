"""Component: an FMU in a run, which has a slave of ``fmi``, arrays, a phase, messages and saved states."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from contextlib import AbstractContextManager, suppress
from ctypes import memmove
from pathlib import Path
from time import perf_counter
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from orchestrator.cosim.base_units import UNCHANGED, Conversion, inverse_factors
from orchestrator.cosim.fast_calls import FastCalls, Places, places
from orchestrator.cosim.graph import NO_CONVERSIONS, ImportSettings
from orchestrator.cosim.messages import CallMessages, ComponentWarning, WarningList
from orchestrator.cosim.mixed_exchange import MixedExchange
from orchestrator.cosim.processes.remote import RemoteSlave
from orchestrator.cosim.processes.supervisor import SlaveProcess
from orchestrator.cosim.variables import Variables
from orchestrator.fmi import fmi2
from orchestrator.fmi.model_description import is_fmi3, load_library, loadable, opening
from orchestrator.fmi.slave import (
    DISCARD,
    FATAL,
    WARNING,
    ComponentFailed,
    NotInstantiated,
    Slave,
    failed,
)
from orchestrator.kernels.tables import Record

WALL_TIME = "wall_time"  # recorded beside the Integer outputs of a component


class ComponentState(NamedTuple):
    """Saved FMU state with the values of the arrays and the warnings; valid until freed."""

    slave_state: Any
    arrays: tuple[NDArray[Any], ...]  # u, y, y_links, counters
    warnings: Mapping[str, ComponentWarning]


# ------------------------------------------------------------------ component


class Component(AbstractContextManager["Component"]):
    """FMU instance with arrays: write ``u``, step, read ``y``. Use it in a ``with``.

    Methods may be called from any thread, one at a time; the GIL is released while the FMU computes, unless the FMU
    itself holds it. Every failure raises ComponentFailed, with the message that the FMU logged, if any.
    """

    def __init__(
        self,
        fmu: Path,
        name: str,
        *,
        discrete: Collection[str] = (),
        conversions: Mapping[str, Conversion] = NO_CONVERSIONS,
        units: Mapping[str, str] = NO_CONVERSIONS,
        imported: ImportSettings | None = None,
        process: SlaveProcess | None = None,
        resources: Path | None = None,
        starts: Sequence[float] = (),
    ) -> None:
        """Load and instantiate an FMU.

        ``discrete``: connected variables that are no Reals, which follow them in the arrays. ``conversions``,
        ``units``, ``imported``, ``resources`` and ``starts``: as of ``graph.Instance``. ``process``: that in which it
        is loaded, instead of this one.
        """
        self.name, self._imported = name, imported
        self._messages = CallMessages(name)
        self._clock = np.zeros(1)  # s from the start of the run, beginning of the last step
        self.start_time = 0.0  # s, time of the FMU at the start of the run
        self._states: list[ComponentState] = []
        self.start_inputs: dict[str, float] = {}  # inputs given before the start, by name
        self._call_time = 0.0  # s inside the FMU, without steps by ``step_call``
        self._phase = "made"
        self._slave: Slave | None = None
        self._fast: FastCalls | None = None
        self._places = Places()
        self._loaded = loadable(fmu)
        self.description = self._loaded.description
        if process is None and is_fmi3(self.description):
            raise ComponentFailed(
                f"'{fmu}' is an FMU of FMI 3.0: only a process of its own runs it (in_process = false); FMUs of cotrack"
                " run in that of the run: build them of FMI 2.0"
            )
        remote = None if process is None else RemoteSlave(process, self._receive)
        memory = None if remote is None else remote.memory
        foreign = imported is not None
        self.variables = Variables(name, self._loaded, discrete, conversions, units, memory, foreign, starts)
        self.inputs, self.outputs, self.links = self.variables.inputs, self.variables.outputs, self.variables.links
        self.u, self.y, self.y_links = self.variables.u, self.variables.y, self.variables.y_links
        self.integers, self.counters = self.variables.integers, self.variables.counters
        self.received = self.variables.received
        self._arrays: tuple[NDArray[Any], ...] = (self.u, self.y, self.y_links, self.counters)
        notes = [*inverse_factors(self.description), self._loaded.unused] if imported is not None else []
        for sentence in filter(None, notes):
            self._receive(WARNING, sentence, "")
        self._open(fmu, remote, resources)

    def _open(self, fmu: Path, remote: RemoteSlave | None, resources: Path | None) -> None:
        folder, given = self._loaded.folder, None if resources is None else str(resources)
        made = opening(folder, self.description, self.name, elements=self._loaded.elements, resources=given)
        try:
            if remote is not None:
                remote.open(made)
                slave: Slave = remote
            else:
                slave = fmi2.Slave(load_library(folder, self.description, fmu), made, self._receive)
        except NotInstantiated:
            raise ComponentFailed(self._messages.refusal()) from None
        self._slave, self._phase = slave, "instantiated"
        v = self.variables
        n_in, n_out, n_whole = len(v.reals_in), len(v.reals_out), len(v.whole)
        self._u = slave.exchange("Real", v.references(v.reals_in), v.u[:n_in])
        self._y = slave.exchange("Real", v.references(v.reals_out), v.raw[:n_out], with_steps=True)
        self._y_links = slave.exchange("Real", v.references(v.links), v.y_links)
        self._whole = slave.exchange("Integer", v.references(v.whole), v.counters[:n_whole])
        self._truths = slave.exchange("Boolean", v.references(v.truths), v.counters[n_whole:])
        self._first_link = slave.exchange("Real", v.references(v.links[:1]), v.y_links[:1])
        self._mixed: MixedExchange | None = None
        if v.is_mixed:
            non_finite = None if self._imported is None else self._imported.non_finite
            self._mixed = MixedExchange(slave, v, (self._u, self._y, self._y_links), self._receive, non_finite)

    def unit(self, name: str) -> str:
        """Return the unit of a variable in the arrays, '1' if it has none."""
        return self.variables.unit(name)

    @property
    def is_remote(self) -> bool:
        """Whether the FMU runs in a process of its own."""
        return isinstance(self._slave, RemoteSlave)

    @property
    def warms_up(self) -> bool:
        """Whether a step that is taken back saves time later: not of an FMU of the user, which compiles nothing."""
        return self._imported is None and bool(self.description.coSimulation.canGetAndSetFMUstate)

    @property
    def wall_time(self) -> float:
        """Time inside the FMU since it was initialised, s."""
        return self._call_time + (0.0 if self._fast is None else float(self._fast.table["total"][0]))

    @wall_time.setter
    def wall_time(self, seconds: float) -> None:
        self._call_time = seconds
        if self._fast is not None:
            self._fast.table["total"] = 0.0

    # -------------------------------------------------------------- messages

    @property
    def warnings(self) -> list[ComponentWarning]:
        """Messages that the FMU logged with status warning since its start, without steps taken back."""
        return self._messages.warnings.entries()

    def set_warnings(self, earlier: Mapping[str, ComponentWarning]) -> None:
        """Set the warnings of the earlier process whose run is continued."""
        self._messages.warnings = WarningList(self.name, earlier)

    def _receive(self, status: int, message: str, category: str) -> None:
        self._messages.receive(status, message, category, float(self._clock[0]))

    @property
    def slave(self) -> Slave:
        """Its slave; raises ComponentFailed if it is closed."""
        if self._slave is None or (self._phase == "lost" and self._imported is not None):
            raise ComponentFailed(f"{self.name}: the component is closed")
        return self._slave

    def _call(self, function: Callable[..., Any], *arguments: Any) -> Any:
        """Call a function of the slave; return what follows its status. Raises ComponentFailed."""
        slave = self.slave
        self._messages.clear()
        began = perf_counter()
        result = function(*arguments)
        self._call_time += perf_counter() - began
        status, found = result if isinstance(result, tuple) else (result, None)
        if failed(status):
            raise self._failure(slave.failed, status)
        return found

    def _failure(self, function: str, status: int) -> ComponentFailed:
        time, phase = float(self._clock[0]), self._phase
        if not 0 <= status < FATAL:
            self._phase = "lost"
        if status == DISCARD and function.endswith("DoStep") and not self._messages.has_error:
            has_ended, reached = self.slave.discarded()
            return self._messages.discarded_step(function, time, reached - self.start_time, has_ended)
        is_placed = self._imported is not None or phase != "instantiated"
        return self._messages.failure(function, status, None if phase == "ended" else time, is_placed)

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
        slave = self.slave
        if self._phase != "instantiated":
            self._call(slave.reset)
            self._phase = "instantiated"
            self._messages.warnings = WarningList(self.name)
        self.start_time, self._clock[0] = self.start_time if start is None else start, 0.0
        for name, value in parameters.items():
            self._set_parameter(name, value)
        self._call(slave.setup, self.start_time, stop)
        self._call(slave.enter_initialisation)

    def set_inputs(self) -> None:
        """Set the inputs in ``u``, which need no conversion."""
        self._call(self._u.set if self._mixed is None else self._mixed.set_inputs)

    def leave_initialisation(self) -> None:
        """Set the inputs, leave initialisation mode and read all outputs."""
        self.set_inputs()
        self._call(self.slave.exit_initialisation)
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
            if name in self.variables.conversions:
                factor, offset = self.variables.conversions[name]
                self.u[k] = factor * value + offset
            self.start_inputs[name] = float(self.u[k])

    def _set_parameter(self, name: str, value: float | int | str) -> None:
        known = self.variables
        if name in known.constants:
            return known.require_constant(name, value)
        value, variable = known.taken(name, value, self._imported is not None), known.by_name[name]
        if name in self.inputs and variable.type != "String":
            k, (factor, offset) = self.inputs.index(name), known.conversions.get(name, UNCHANGED)
            self.u[k], self.received[k] = value, (float(value) - offset) / factor
            return
        kind = variable.type.replace("Enumeration", "Integer")
        if isinstance(value, str):
            content: Any = [value.encode()]
        elif kind == "Real":
            content = np.array([value], float)
        else:
            content = np.array([value - 2**64 if value >= 2**63 else value], self._loaded.whole)
        self._call(self.slave.exchange(kind, [variable.valueReference], content).set)

    def write(self) -> None:
        """Set the FMU's inputs from ``u``, or from ``received`` if some are converted."""
        self._call(self._u.set if self._mixed is None else self._mixed.write)

    def step(self, t: float, h: float) -> None:
        """Advance the FMU from t after the start of the run by h, both in s."""
        self._clock[0] = t
        self._call(self.slave.step, self.start_time + t, h, not self._states)

    def read(self) -> None:
        """Read the outputs, without link outputs, into ``y``."""
        self._call(self._y.get if self._mixed is None else self._mixed.read)

    @property
    def _fast_calls(self) -> FastCalls:
        if self._fast is None:
            reals = self._u, self._y, self._y_links
            times = self.start_time, float(self._clock[0])
            self._fast = FastCalls(self.slave, self.variables, reals, self._mixed, *times)
            self._fast.table["no_rollback"] = not self._states
            self._fast.copy_at(self._places)
            self._clock = self._fast.clock
        return self._fast

    @property
    def step_call(self) -> Record:
        """Table (a ``StepCall``) with which kernels do ``write``, ``step`` and ``read``."""
        return self._fast_calls.table

    def read_links_when(self, due: int) -> None:
        """Let steps by ``step_call`` read link outputs whenever the word at the address ``due`` is not 0."""
        self._fast_calls.read_links_when(due)

    def prepare_step(self, t: float) -> None:
        """Prepare a step by ``step_call``; raises ComponentFailed."""
        if self._slave is None:
            raise ComponentFailed(f"{self.name}: the component is closed")
        self._clock[0] = t
        self._messages.clear()

    def failure(self) -> ComponentFailed | None:
        """Return the failure of the last step by ``step_call``, or None."""
        try:
            found = self._fast_calls.failure()
        except ComponentFailed as failure:
            return failure
        return None if found is None else self._failure(*found)

    def read_links(self) -> None:
        """Read link outputs into ``y_links``."""
        if place := self._places.links_array:
            self._call(self._first_link.get)  # makes the FMU compute all
            memmove(self.y_links.ctypes.data, place, self.y_links.nbytes)
        else:
            self._call(self._y_links.get if self._mixed is None else self._mixed.read_links)

    def _find_places(self) -> None:
        """Find the FMU's Reals in memory, where inputs, outputs and link outputs can be copied."""
        own = self._imported is None and self._mixed is None
        self._places = places(self.slave, self.variables) if own else Places()
        if self._fast is not None:
            self._fast.copy_at(self._places)

    def read_counters(self) -> None:
        """Read the Integer, Enumeration and Boolean outputs, in this order, into ``counters``."""
        self._call(self._whole.get)
        self._call(self._truths.get)
        for sentence in self.variables.inexact_counters():
            self._receive(WARNING, sentence, "")

    # -------------------------------------------------------------- state

    def save(self) -> ComponentState:
        """Save the state of the FMU and the arrays; the result must be freed."""
        return self._state(self._call(self._slave_that_can("canGetAndSetFMUstate", "save its state").save))

    def _state(self, slave_state: Any) -> ComponentState:
        arrays = tuple(array.copy() for array in self._arrays)
        state = ComponentState(slave_state, arrays, self._messages.warnings.save())
        self._set_states([*self._states, state])
        return state

    def _set_states(self, states: list[ComponentState]) -> None:
        self._states = states
        if self._fast is not None:
            self._fast.table["no_rollback"] = not states

    def restore(self, state: ComponentState) -> None:
        """Restore a saved state bit by bit; it stays valid."""
        self._call(self._slave_that_can("canGetAndSetFMUstate", "restore a state").restore, state.slave_state)
        self._phase = "running"
        for array, saved in zip(self._arrays, state.arrays, strict=True):
            array[:] = saved
        self._messages.warnings.restore(state.warnings)

    def free(self, state: ComponentState) -> None:
        """Release a saved state."""
        self._set_states([saved for saved in self._states if saved is not state])
        self._call(self.slave.discard, state.slave_state)

    def dump(self, state: ComponentState) -> bytes:
        """Serialise a saved state for another process with the same FMU."""
        slave = self._slave_that_can("canSerializeFMUstate", "write its state")
        content: bytes = self._call(slave.dump, state.slave_state)
        return content

    def load(self, content: bytes) -> ComponentState:
        """Restore from the bytes of ``dump``, also into an instance that is not initialised; must be freed."""
        slave_state = self._call(self._slave_that_can("canSerializeFMUstate", "read a state").load, content)
        self._phase = "running"
        self._find_places()
        self._call(self._u.get)
        self.read()
        self.read_links()
        self.read_counters()
        return self._state(slave_state)

    def _slave_that_can(self, capability: str, what: str) -> Slave:
        if not getattr(self.description.coSimulation, capability):
            raise ComponentFailed(f"{self.name}: the FMU cannot {what}")
        return self.slave

    # -------------------------------------------------------------- end

    def close(self) -> None:
        """Terminate and free the instance; a failure is a warning. After fmi2Fatal no function may be called."""
        if self._slave is None:
            return
        for state in [] if self._phase == "lost" else list(self._states):
            with suppress(ComponentFailed):
                self.free(state)
        for function in [self._slave.terminate] * (self._phase == "running") + [self._slave.free]:
            if self._phase == "lost":
                break
            self._phase = "ended"
            try:
                self._call(function)
            except ComponentFailed as failure:
                self._receive(WARNING, str(failure).removeprefix(f"{self.name}: "), "")
        self._slave = None

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
