"""Instance of a model behind the calls of FMI, without packaging: variables, phases, parameters, saved states.

Variables are ordered as Real inputs, Real outputs, Real link outputs, Real parameters, Integers, Strings, and last the
addresses of the link outputs and of all Reals in memory: a master copies them in less than a microsecond, while
`get_real` makes two Python objects of each number. A value reference is the index in that order, so that get and set
are array accesses.
"""

from __future__ import annotations

import ctypes
import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fmus.cache.files import unlogged_warnings
from fmus.fmi.phases import InstancePhase, Refused, not_allowed, refused_step
from fmus.fmi.saved import SlaveState
from fmus.interface import numbers
from fmus.interface.defaults import all_ports, check_value
from fmus.interface.model import ComponentModel, InvalidParameter, StepFailed, finite, flaw_of_state
from fmus.interface.numbers import Meaning
from fmus.interface.ports import LINKS_ARRAY, REALS_ARRAY, Port, variables
from fmus.vehicles.ranges import contradictions

OK, WARNING, ERROR = 0, 1, 3  # values of the output `status`, those of fmi2Status
_INT_MAX = 2**31 - 1  # fmi2Integer is 32 bits wide


class _Access(NamedTuple):
    """Kinds of the variables in a list of Real value references."""

    places: slice | NDArray[np.intp]  # their places in the values
    inputs: bool  # all are inputs
    outputs: bool  # some is an output
    links: bool  # some is a link output


def _place(values: NDArray[np.float64]) -> tuple[int, int, int]:
    """Address of an array, in two halves, and its number of bytes."""
    low, high = (ctypes.c_int32(half).value for half in divmod(values.ctypes.data, 1 << 32)[::-1])
    return low, high, values.nbytes


class ModelInstance:
    """Component as FMI's calls see it: value references in, plain numbers and texts out, SI units.

    Calls raise Refused (what FMI does not allow, a reference that does not exist), InvalidParameter, StepFailed, and
    what a model raises unforeseen. Whether FMI allows a call in this ``phase`` (``phases.ALLOWED``) the caller checks,
    but for steps, which check it themselves. ``model`` is made anew for other numbers.
    """

    def __init__(
        self, model: type[ComponentModel], config: Mapping[str, Any], meanings: Mapping[str, Meaning], guid: str = ""
    ) -> None:
        """Make an instance of a class of models with the ``config`` of a component.

        ``meanings``: of the numbers in the config, which are parameters too (``interface.numbers``); ``guid``: of the
        FMU, in saved states. Raises Refused, InvalidParameter.
        """
        self.warn: Callable[[str], object] = lambda sentence: None  # receives warnings
        self.phase, self.guid = InstancePhase.INSTANTIATED, guid
        self.model, self._kind, self._config = model(config), model, config
        self._numbers = numbers.values(config)  # those of the model
        self._status = OK
        self._now = self._stop = self._begun = math.nan  # s: end of the last step, stop time, start time
        self._stale, self._links_stale = True, False
        self._start_values: dict[str, float | int | str] = {}  # parameters of the last initialisation
        self._sort_ports(all_ports(self.model.ports, config, meanings), self.model.link_ports)

    def _sort_ports(self, ports: tuple[Port, ...], link_ports: int) -> None:
        self._reals, self._integers, self._string_ports = sorted_variables = variables(ports)
        inputs = [p for p in ports if p.causality == "input"]
        outputs = [p for p in self._reals if p.causality == "output"]
        count = len(outputs) - link_ports
        self._integer_parameters = [p for p in self._integers if p.causality == "parameter"]
        counters = len(self._integers) - len(self._integer_parameters) - 1
        connected = set(map(id, inputs + outputs))
        if [p for p in ports if id(p) in connected] != inputs + outputs:
            raise Refused("the Real inputs must come before the Real outputs")
        if counters != len(self.model.counters):
            raise Refused(f"{len(self.model.counters)} counters for {counters} Integer outputs")
        self.variables: tuple[Port, ...] = (*sorted_variables.row, *(LINKS_ARRAY if link_ports else ()), *REALS_ARRAY)
        of_integers = [*range(len(self._reals), len(self._reals) + len(self._integers))]
        of_arrays = [*range(len(sorted_variables.row), len(self.variables))]
        self._integer_places = {reference: k for k, reference in enumerate(of_integers + of_arrays)}
        names = [p.name for p in self.variables]
        if len(set(names)) < len(names):
            raise Refused(f"two ports are called '{max(names, key=names.count)}'")

        self._inputs = slice(0, len(inputs))
        self._outputs = slice(len(inputs), len(inputs) + count)
        self._links = slice(self._outputs.stop, self._outputs.stop + link_ports)
        self._parameters = slice(self._links.stop, len(self._reals))
        self.continuous, self.reals = self._parameters.start, self._parameters.stop  # numbers of variables
        self._values = np.array([float(p.start) for p in self._reals])
        self._u, self._y = self._values[self._inputs], self._values[self._outputs]
        self._described_inputs = self._u.copy()
        self._y_new, self._links_new = np.zeros(count), np.zeros(link_ports)
        self._arrays = [*(_place(self._values[self._links]) if link_ports else ()), *_place(self._values)]
        self._integer_values = np.array([int(p.start) for p in self._integer_parameters], dtype=np.int64)
        self._string_values = [str(p.start) for p in self._string_ports]
        self._accesses: dict[tuple[int, ...], _Access] = {}
        self._recent: dict[int, tuple[list[int], _Access]] = {}  # last list of references of each length

    def _access(self, references: list[int]) -> _Access:
        recent = self._recent.get(len(references))  # a master repeats its lists: comparing costs less than hashing
        if recent is not None and recent[0] == references:
            return recent[1]
        key = tuple(references)
        access = self._accesses.get(key)
        if access is None:
            if any(not 0 <= r < len(self._reals) for r in key):
                raise Refused(f"no Real variable has the value reference {max(key)}")
            places: slice | NDArray[np.intp] = np.array(key, dtype=np.intp)
            if key and key == tuple(range(key[0], key[0] + len(key))):
                places = slice(key[0], key[0] + len(key))
            access = _Access(
                places,
                inputs=all(r < self._inputs.stop for r in key),
                outputs=any(self._outputs.start <= r < self._links.stop for r in key),
                links=any(self._links.start <= r < self._links.stop for r in key),
            )
            if len(self._accesses) > 100:  # an importer that reads ever new lists
                self._accesses.clear()
            self._accesses[key] = access
        self._recent[len(key)] = list(key), access
        return access

    def get_real(self, vrs: list[int]) -> list[float]:
        """Return the values of Real variables; outputs start the model or compute those of links if need be."""
        access = self._access(vrs)
        if access.outputs and self._stale:
            self._initialise()
        if access.links and self._links_stale:
            self._refresh_links()
        return self._values[access.places].tolist()

    def set_real(self, vrs: list[int], values: list[float]) -> None:
        """Set Real inputs; before the end of initialisation also Real parameters; raises Refused for others."""
        access = self._access(vrs)
        if not access.inputs:
            if access.outputs:
                raise Refused(f"an output cannot be set ({self._reals[max(vrs)].name} or one set with it)")
            self._parameter_set(self._reals[max(vrs)].name)
        self._values[access.places] = values

    def _parameter_set(self, name: str) -> None:
        if self.phase is InstancePhase.RUNNING:
            raise Refused(f"parameter '{name}' is fixed: set it before the end of initialisation")
        self._stale = True

    def _integer_place(self, reference: int) -> int:
        place = self._integer_places.get(reference)
        if place is None:
            raise Refused(f"no Integer variable has the value reference {reference}")
        return place

    def _string_place(self, reference: int) -> int:
        place = reference - len(self._reals) - len(self._integers)
        if not 0 <= place < len(self._string_ports):
            raise Refused(f"no String variable has the value reference {reference}")
        return place

    def get_integer(self, vrs: list[int]) -> list[int]:
        """Return the values of Integer variables; counters saturate at the largest 32 bit number."""
        if self._stale:
            self._initialise()
        places = [self._integer_place(reference) for reference in vrs]
        if self._links_stale and max(places, default=0) >= len(self._integers):
            self._refresh_links()
        values = [*self.model.counters.tolist(), self._status, *self._integer_values.tolist(), *self._arrays]
        return [min(values[place], _INT_MAX) for place in places]

    def set_integer(self, vrs: list[int], values: list[int]) -> None:
        """Set Integer parameters before the end of initialisation."""
        for reference, value in zip(vrs, values, strict=True):
            place = self._integer_place(reference)
            offset = len(self._integers) - len(self._integer_parameters)
            if not offset <= place < len(self._integers):
                raise Refused(f"output '{self.variables[reference].name}' cannot be set")
            self._parameter_set(self._integers[place].name)
            self._integer_values[place - offset] = value

    def get_string(self, vrs: list[int]) -> list[str]:
        """Return the values of String parameters."""
        return [self._string_values[self._string_place(reference)] for reference in vrs]

    def set_string(self, vrs: list[int], values: list[str]) -> None:
        """Set String parameters before the end of initialisation, where they are checked."""
        for reference, value in zip(vrs, values, strict=True):
            place = self._string_place(reference)
            self._parameter_set(self._string_ports[place].name)
            self._string_values[place] = value

    def get_boolean(self, vrs: list[int]) -> list[bool]:
        """Refuse any reference: there are no Boolean variables."""
        if vrs:
            raise Refused(f"no Boolean variable has the value reference {vrs[0]}")
        return []

    def set_boolean(self, vrs: list[int], values: list[bool]) -> None:
        """Refuse any reference, too."""
        self.get_boolean(vrs)

    # ---------------------------------------------------------------- initialisation and steps

    def setup_experiment(self, start: float, stop: float | None = None, tolerance: float | None = None) -> None:
        """Set the time of the first step, and that after which none may end, s; raises Refused."""
        end = math.nan if stop is None else stop
        if not math.isfinite(start) or end < start:
            raise Refused(f"an experiment cannot last from {start:g} to {end:g} s")
        self._now, self._stop, self._begun = float(start), float(end), float(start)

    def enter_initialization_mode(self) -> None:
        """Begin initialisation: the model starts when an output is read, or at the end; parameters may change."""
        self.phase = InstancePhase.INITIALISING

    def exit_initialization_mode(self) -> None:
        """Start the model, unless reading an output has; raises InvalidParameter for wrong parameters, StepFailed."""
        if self._stale:
            self._initialise()
        self.phase = InstancePhase.RUNNING

    def _parameter_values(
        self, values: NDArray[np.float64], integers: NDArray[np.int64], strings: Sequence[str]
    ) -> dict[str, float | int | str]:
        """Checked parameters by name, from the values of all Reals, Integer parameters and Strings."""
        ports = (*self._reals[self._parameters], *self._integer_parameters, *self._string_ports)
        row = (*values[self._parameters].tolist(), *integers.tolist(), *strings)
        return {port.name: check_value(port, value) for port, value in zip(ports, row, strict=True)}

    def _initialise(self) -> None:
        parameters = self._parameter_values(self._values, self._integer_values, self._string_values)
        self._start_values = {}  # of a model that failed to start
        self._start(parameters)
        self._start_values = parameters
        self._status = OK
        for sentence in unlogged_warnings():  # of the cache, where no log handler received them
            self.warn(sentence)
        self._refresh()
        self._stale = False

    def _start(self, parameters: Mapping[str, float | int | str]) -> None:
        """Initialise the model, which is made anew for other numbers than those that it has."""
        chosen = {name: float(parameters[name]) for name in self._numbers}
        if chosen != self._numbers:
            config = numbers.with_values(self._config, chosen)
            for complaint in contradictions(config.get("vehicle", {})):
                raise InvalidParameter(complaint)
            self.model, self._numbers = self._kind(config), chosen
        model = self.model
        if self._numbers and (n := model.unconnected.size):
            described = self._described_inputs[:n]  # a host that sets other start values has those of these numbers
            as_described = np.array_equal(self._u[:n], described)
            model.unconnected[:] = described if as_described else [port.start for port in model.ports[:n]]
        model.initialise(parameters)

    def _not_finite(self, values: NDArray[np.float64], place: slice, when: str) -> StepFailed:
        first = int(np.flatnonzero(~np.isfinite(values))[0])
        port = self._reals[place.start + first]
        return StepFailed(f"{port.causality} '{port.name}' is {values[first]} {when}")

    def _refresh(self, t: float | None = None) -> None:
        """Compute the outputs at t (None: at the start)."""
        self.model.outputs(self._y_new)
        if not finite(self._y_new):
            raise self._not_finite(self._y_new, self._outputs, "at the start" if t is None else f"at t = {t}")
        self._y[:] = self._y_new
        self._links_stale = self._links_new.size > 0
        self._warn()

    def _warn(self) -> None:
        for sentence in self.model.warnings():
            self._status = WARNING
            self.warn(sentence)

    def _refresh_links(self) -> None:
        self.model.link_outputs(self._links_new)
        if not finite(self._links_new):
            raise self._not_finite(self._links_new, self._links, "after the last step")
        self._values[self._links] = self._links_new
        self._links_stale = False

    def do_step(self, t: float, h: float) -> None:
        """Step from t to t + h, s; where that raises Refused or StepFailed, the instance is the one before."""
        sentence = not_allowed("fmi2DoStep", self.phase)
        if sentence := sentence or refused_step(t, h, self._now, self._stop, self._begun):
            raise Refused(sentence)
        model = self.model
        state, counters = model.state.copy(), model.counters.copy()
        self._status = OK
        try:
            if not finite(self._u):
                raise self._not_finite(self._u, self._inputs, f"at t = {t}")
            model.step(t, h, self._u)
            self._refresh(t + h)
        except BaseException:
            self._warn()  # a warning may explain the failure
            model.state[:], model.counters[:] = state, counters
            self._status = ERROR
            raise
        self._now = float(t + h)

    def terminate(self) -> None:
        """End the steps; outputs can still be read, and a saved state can be restored."""
        self.phase = InstancePhase.TERMINATED

    # ---------------------------------------------------------------- state

    def get_fmu_state(self) -> SlaveState:
        """Return all that changes during a run, as copies."""
        flags, strings = (self._stale, self._links_stale), tuple(self._string_values)
        integers = np.array([self._status, *self._integer_values], dtype=np.int64)
        arrays = self._values.copy(), integers, self.model.state.copy(), self.model.counters.copy()
        return SlaveState(self.guid, self.phase, self._now, flags, strings, *arrays)

    def set_fmu_state(self, state: SlaveState) -> None:
        """Go back to a state of an equal instance; raises Refused where it is none."""
        if not isinstance(state, SlaveState) or state.flaw:
            raise Refused(getattr(state, "flaw", "this is not a state of an FMU of this build"))
        if state.guid != self.guid:
            raise Refused(f"the state belongs to another FMU ({state.guid} instead of {self.guid})")
        self._check_sizes(state)
        stale, links_stale = state.flags
        if not stale:  # before a start there is no state yet, and its size may still change
            self._restore_model(state)
        self.phase, self._now = InstancePhase(state.phase), state.now
        self._stale, self._links_stale = stale, links_stale
        self._string_values[:] = state.strings
        self._values[:] = state.values
        self._status = int(state.integers[0])
        self._integer_values[:] = state.integers[1:]

    def _check_sizes(self, state: SlaveState) -> None:
        """Refuse arrays of other sizes than the FMU's variables, outputs that are not finite, counters below 0."""
        sizes = len(state.strings), state.values.size, state.integers.size, state.counters.size
        own = self._values.size, 1 + self._integer_values.size, self.model.counters.size
        outputs = state.values[self._outputs.start : self._links.stop]
        if sizes != (len(self._string_values), *own) or not finite(outputs) or state.counters.min(initial=0) < 0:
            raise Refused("these bytes are not a saved state of this FMU: sizes or values that it cannot have")

    def _restore_model(self, state: SlaveState) -> None:
        """Restore the model, started with other parameters if need be; where that fails it is the one before."""
        model, started_with, own = self.model, self._start_values, self._numbers
        before = model.state.copy(), model.counters.copy()
        parameters = self._parameter_values(state.values, state.integers[1:], state.strings)
        restarts = parameters != started_with
        try:
            if restarts:
                self._start(parameters)
            if flaw := flaw_of_state(self.model, state.state):
                raise Refused(f"these bytes are not a saved state of this FMU: {flaw}")
        except BaseException:
            self.model, self._numbers = model, own
            if restarts and started_with:
                model.initialise(started_with)
                model.state[:], model.counters[:] = before
            raise
        self._start_values = parameters
        self.model.state[:], self.model.counters[:] = state.state, state.counters
