"""FMI 2.0 co-simulation slave around a model, made of pythonfmu's.

A shell derives from `Slave` and names its model. Variables are ordered as Real inputs, Real outputs, Real link outputs,
Real parameters, Integers, Strings, and last the addresses of the link outputs and of all Reals in memory: a master
copies them in less than a microsecond, while `get_real` makes two Python objects of each number. A value reference is
the index in that order, so that get and set are array accesses.

The module is long because pythonfmu wants all FMI calls as methods of one class, and they share its arrays.
"""

from __future__ import annotations

import ctypes
import hashlib
import json
import math
import sys
import traceback
import uuid
from collections.abc import Callable, Mapping, Sequence
from functools import wraps
from pathlib import Path
from typing import Any, NamedTuple
from xml.etree.ElementTree import Element

import numpy as np
from numpy.typing import NDArray
from pythonfmu import Fmi2Slave
from pythonfmu import __version__ as pythonfmu_version
from pythonfmu.enums import Fmi2Status

from fmus.cache import pack
from fmus.cache.files import cache_folder, check_trust, reporting_errors, unlogged_warnings
from fmus.cache.sources import ROOT, source_hash
from fmus.fmi.description import document
from fmus.fmi.phases import ALLOWED, InstancePhase, not_allowed, refused_step
from fmus.fmi.pythonfmu_faults import (
    MESSAGES_WAIT,
    MOST_BYTES,
    Refused,
    add_references,
    finalise_at_exit,
    printf_format,
)
from fmus.fmi.same_build import SameBuild
from fmus.fmi.saved import SlaveState, from_bytes, to_bytes
from fmus.interface import numbers
from fmus.interface.defaults import check_names, check_value, configured_ports, experiment
from fmus.interface.model import ComponentModel, InvalidParameter, StepFailed, finite, flaw_of_state
from fmus.interface.ports import LINKS_ARRAY, REALS_ARRAY, Port, variables
from fmus.kernels.jit import compiled_before
from fmus.vehicles.ranges import contradictions

BUILD = source_hash()  # hash of the fmus sources of this process
OK, WARNING, ERROR = 0, 1, 3  # values of the output `status`, those of fmi2Status
_INT_MAX = 2**31 - 1  # fmi2Integer is 32 bits wide


def _build_mismatch(packed: str, name: str = "this FMU") -> Refused:
    return Refused(
        f"{name} was built from other sources ({packed[:12]}) than the fmus package "
        f"of this process ({BUILD[:12]}): build it again, or load it in a process of its own"
    )


sys.meta_path.append(SameBuild("fmus", BUILD, _build_mismatch))


class _Access(NamedTuple):
    """Kinds of the variables in a list of Real value references."""

    places: slice | NDArray[np.intp]  # their places in the values
    inputs: bool  # all are inputs
    outputs: bool  # some is an output
    links: bool  # some is a link output
    parameters: bool  # some is a parameter


def _place(values: NDArray[np.float64]) -> tuple[int, int, int]:
    """Address of an array, in two halves, and its number of bytes."""
    low, high = (ctypes.c_int32(half).value for half in divmod(values.ctypes.data, 1 << 32)[::-1])
    return low, high, values.nbytes


def _guarded(call: Callable[..., Any]) -> Callable[..., Any]:
    """Decorator: refuse calls that the phase does not allow; log any exception, raise one that pythonfmu survives."""
    name = "fmi2" + call.__name__.title().replace("_", "")
    phases = ALLOWED.get(name, tuple(InstancePhase))

    @wraps(call)
    def guarded(self: Slave, *args: Any) -> Any:
        try:
            if self._waiting:
                self.log_queue += self._waiting
                self._waiting = []
            if self._phase not in phases:
                raise Refused(not_allowed(name, self._phase))
            return call(self, *args)
        except BaseException as error:  # KeyboardInterrupt too: no other exception may leave the call
            sentence = self._report(error, raised=True)
            if MESSAGES_WAIT:
                self._waiting = self.log_queue[:]
                self.log_queue.clear()
            add_references(type(self), self, self.log_queue)
            raise Refused(sentence) from None

    return guarded


class Slave(Fmi2Slave):
    """Base of the FMU shells.

    A shell is a script with a unique file name, because pythonfmu imports it by that name and runs it twice::

        from fmus.fmi.slave import Slave
        from fmus.chassis.model import Model

        class Chassis(Slave):
            "Chassis, road arms, road wheels and idlers of a tracked vehicle"

            model = Model

    The FMU's resources also hold ``config.json`` (the argument of the model; under ``parameters`` the defaults of the
    FMU's parameters, see ``defaults``), ``numbers.json`` (meanings of the numbers in it, which are parameters too, see
    ``numbers``), ``shape.txt`` (digest of what is no parameter) and ``build.txt`` (hash of the packed ``fmus``
    sources). All FMUs of a process share the ``fmus`` of the first one, also after its folder was deleted (see
    ``same_build``); an FMU of another build is refused, because it would silently run the wrong code.
    """

    model: type[ComponentModel]

    def __init_subclass__(cls) -> None:
        add_references(vars(sys.modules[cls.__module__]))  # the shell runs once more before each release

    def __init__(self, **kwargs: Any) -> None:
        super().__init__(**kwargs)
        self._status, self._phase = OK, InstancePhase.INSTANTIATED
        self._now = self._stop = self._begun = math.nan  # s: end of the last step, stop time, start time
        self._waiting: list[Any] = []  # messages of a refused call, for the next one
        try:
            self._load(Path(self.resources))
            with reporting_errors():
                check_trust(cache_folder())  # refuse an unsafe cache before a minute of compilation
            if not compiled_before(type(self).model.step_kernel):
                self.log("the first start on this machine compiles the kernels, which takes up to a minute")
            self._forward_warnings()
        except Exception as error:
            raise Refused(self._sentence(error)) from None
        self._waiting = self.log_queue[:]  # a host that frees an instance with messages in the queue ends its process
        self.log_queue.clear()

    # ---------------------------------------------------------------- variables

    def _load(self, resources: Path) -> None:
        # before anything may be refused: the process of a refused FMU exits too
        finalise_at_exit(resources.parent / "binaries" / "linux64" / f"{type(self).__name__}.so")
        packed = (resources / "build.txt").read_text().strip()
        if packed != BUILD:
            raise _build_mismatch(packed, type(self).__name__)
        pack.add(resources / ROOT.name)
        shape = (resources / "shape.txt").read_text()
        self.guid = str(uuid.UUID(bytes=hashlib.sha256(f"{BUILD} {type(self)} {shape}".encode()).digest()[:16]))
        model_config = json.loads((resources / "config.json").read_bytes())
        self._experiment = experiment(model_config)
        self._model, self._config = type(self).model(model_config), model_config
        meanings = json.loads((resources / numbers.MEANINGS).read_bytes())
        ports = (*self._model.ports, *numbers.ports(model_config, meanings, self._model.ports))
        check_names(ports, model_config)
        self._numbers = numbers.values(model_config)  # those of the model
        self._sort_ports(configured_ports(ports, model_config), self._model.link_ports)
        self._stale, self._links_stale = True, False
        self._start_values: dict[str, float | int | str] = {}  # parameters of the last initialisation

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
        if counters != len(self._model.counters):
            raise Refused(f"{len(self._model.counters)} counters for {counters} Integer outputs")
        self._variables = (*sorted_variables.row, *(LINKS_ARRAY if link_ports else ()), *REALS_ARRAY)
        of_integers = [*range(len(self._reals), len(self._reals) + len(self._integers))]
        of_arrays = [*range(len(sorted_variables.row), len(self._variables))]
        self._integer_places = {reference: k for k, reference in enumerate(of_integers + of_arrays)}
        names = [p.name for p in self.variables]
        if len(set(names)) < len(names):
            raise Refused(f"two ports are called '{max(names, key=names.count)}'")

        self._inputs = slice(0, len(inputs))
        self._outputs = slice(len(inputs), len(inputs) + count)
        self._links = slice(self._outputs.stop, self._outputs.stop + link_ports)
        self._parameters = slice(self._links.stop, len(self._reals))
        self._values = np.array([float(p.start) for p in self._reals])
        self._u, self._y = self._values[self._inputs], self._values[self._outputs]
        self._described_inputs = self._u.copy()
        self._y_new, self._links_new = np.zeros(count), np.zeros(link_ports)
        self._arrays = [*(_place(self._values[self._links]) if link_ports else ()), *_place(self._values)]
        self._integer_values = np.array([int(p.start) for p in self._integer_parameters], dtype=np.int64)
        self._string_values = [str(p.start) for p in self._string_ports]
        self._accesses: dict[tuple[int, ...], _Access] = {}
        self._recent: dict[int, tuple[list[int], _Access]] = {}  # last list of references of each length

    @property
    def variables(self) -> tuple[Port, ...]:
        """All variables, see ``fmus.interface.ports.Variables``."""
        return self._variables

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
                parameters=any(r >= self._parameters.start for r in key),
            )
            if len(self._accesses) > 100:  # an importer that reads ever new lists
                self._accesses.clear()
            self._accesses[key] = access
        self._recent[len(key)] = list(key), access
        return access

    @_guarded
    def get_real(self, vrs: list[int]) -> list[float]:
        """Return the values of Real variables."""
        access = self._access(vrs)
        if access.outputs and self._stale:
            self._initialise()
        if access.links and self._links_stale:
            self._refresh_links()
        return self._values[access.places].tolist()

    @_guarded
    def set_real(self, vrs: list[int], values: list[float]) -> None:
        """Set Real inputs; before the end of initialisation also Real parameters."""
        access = self._access(vrs)
        if not access.inputs:
            if access.outputs:
                raise Refused(f"an output cannot be set ({self._reals[max(vrs)].name} or one set with it)")
            self._parameter_set(self._reals[max(vrs)].name)
        self._values[access.places] = values

    def _parameter_set(self, name: str) -> None:
        if self._phase is InstancePhase.RUNNING:
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

    @_guarded
    def get_integer(self, vrs: list[int]) -> list[int]:
        """Return the values of Integer variables; counters saturate at the largest 32 bit number."""
        if self._stale:
            self._initialise()
        places = [self._integer_place(reference) for reference in vrs]
        if self._links_stale and max(places, default=0) >= len(self._integers):
            self._refresh_links()
        values = [*self._model.counters.tolist(), self._status, *self._integer_values.tolist(), *self._arrays]
        return [min(values[place], _INT_MAX) for place in places]

    @_guarded
    def set_integer(self, vrs: list[int], values: list[int]) -> None:
        """Set Integer parameters before the end of initialisation."""
        for reference, value in zip(vrs, values, strict=True):
            place = self._integer_place(reference)
            offset = len(self._integers) - len(self._integer_parameters)
            if not offset <= place < len(self._integers):
                raise Refused(f"output '{self._variables[reference].name}' cannot be set")
            self._parameter_set(self._integers[place].name)
            self._integer_values[place - offset] = value

    @_guarded
    def get_string(self, vrs: list[int]) -> list[str]:
        """Return the values of String parameters."""
        return [self._string_values[self._string_place(reference)] for reference in vrs]

    @_guarded
    def set_string(self, vrs: list[int], values: list[str]) -> None:
        """Set String parameters before the end of initialisation, where they are checked."""
        for reference, value in zip(vrs, values, strict=True):
            place = self._string_place(reference)
            self._parameter_set(self._string_ports[place].name)
            self._string_values[place] = value

    @_guarded
    def get_boolean(self, vrs: list[int]) -> list[bool]:
        """Refuse any reference: there are no Boolean variables."""
        if vrs:
            raise Refused(f"no Boolean variable has the value reference {vrs[0]}")
        return []

    @_guarded
    def set_boolean(self, vrs: list[int], values: list[bool]) -> None:
        """Refuse any reference: there are no Boolean variables."""
        if vrs:
            raise Refused(f"no Boolean variable has the value reference {vrs[0]}")

    # ---------------------------------------------------------------- initialisation and steps

    @_guarded
    def setup_experiment(
        self, start_time: float, stop_time: float | None = None, tolerance: float | None = None
    ) -> None:
        """Set the time of the first step, and that after which none may end, s."""
        stop = math.nan if stop_time is None else stop_time
        if not math.isfinite(start_time) or stop < start_time:
            raise Refused(f"an experiment cannot last from {start_time:g} to {stop:g} s")
        self._now, self._stop, self._begun = float(start_time), float(stop), float(start_time)

    @_guarded
    def enter_initialization_mode(self) -> None:
        """Begin initialisation: the model starts when an output is read, or at the end; parameters may change."""
        self._phase = InstancePhase.INITIALISING

    @_guarded
    def exit_initialization_mode(self) -> None:
        """Start the model, unless reading an output has started it; wrong parameters are refused here."""
        if self._stale:
            self._initialise()
        self._phase = InstancePhase.RUNNING

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
        self._forward_warnings()
        self._refresh()
        self._stale = False

    def _start(self, parameters: Mapping[str, float | int | str]) -> None:
        """Initialise the model, which is made anew for other numbers than those that it has."""
        chosen = {name: float(parameters[name]) for name in self._numbers}
        if chosen != self._numbers:
            config = numbers.with_values(self._config, chosen)
            for complaint in contradictions(config.get("vehicle", {})):
                raise InvalidParameter(complaint)
            self._model, self._numbers = type(self).model(config), chosen
        model = self._model
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
        self._model.outputs(self._y_new)
        if not finite(self._y_new):
            raise self._not_finite(self._y_new, self._outputs, "at the start" if t is None else f"at t = {t}")
        self._y[:] = self._y_new
        self._links_stale = self._links_new.size > 0
        self._warn()

    def _warn(self) -> None:
        for sentence in self._model.warnings():
            self._status = WARNING
            self.log(sentence, Fmi2Status.warning)

    def _refresh_links(self) -> None:
        self._model.link_outputs(self._links_new)
        if not finite(self._links_new):
            raise self._not_finite(self._links_new, self._links, "after the last step")
        self._values[self._links] = self._links_new
        self._links_stale = False

    def do_step(self, current_time: float, step_size: float) -> bool:
        """Do one communication step; False (fmi2Discard) where it failed: the instance is then the one before."""
        try:
            sentence = not_allowed("fmi2DoStep", self._phase)
            if sentence := sentence or refused_step(current_time, step_size, self._now, self._stop, self._begun):
                raise Refused(sentence)
            self._step(current_time, step_size)
        except BaseException as error:
            self._report(error)
            return False
        self._now = float(current_time + step_size)
        return True

    def _step(self, t: float, h: float) -> None:
        model = self._model
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

    @_guarded
    def terminate(self) -> None:
        """End the steps; outputs can still be read, and a saved state can be restored."""
        self._phase = InstancePhase.TERMINATED

    # ---------------------------------------------------------------- state

    @_guarded
    def _get_fmu_state(self) -> SlaveState:
        return SlaveState(
            str(self.guid),
            self._phase,
            self._now,
            (self._stale, self._links_stale),
            tuple(self._string_values),
            self._values.copy(),
            np.array([self._status, *self._integer_values], dtype=np.int64),
            self._model.state.copy(),
            self._model.counters.copy(),
        )

    @_guarded
    def _set_fmu_state(self, state: SlaveState) -> None:
        if not isinstance(state, SlaveState) or state.flaw:
            raise Refused(getattr(state, "flaw", "this is not a state of an FMU of this build"))
        if state.guid != self.guid:
            raise Refused(f"the state belongs to another FMU ({state.guid} instead of {self.guid})")
        self._check_sizes(state)
        stale, links_stale = state.flags
        if not stale:  # before a start there is no state yet, and its size may still change
            self._restore_model(state)
        self._phase, self._now = InstancePhase(state.phase), state.now
        self._stale, self._links_stale = stale, links_stale
        self._string_values[:] = state.strings
        self._values[:] = state.values
        self._status = int(state.integers[0])
        self._integer_values[:] = state.integers[1:]

    def _check_sizes(self, state: SlaveState) -> None:
        """Refuse arrays of other sizes than the FMU's variables, outputs that are not finite, counters below 0."""
        sizes = len(state.strings), state.values.size, state.integers.size, state.counters.size
        expected = (
            len(self._string_values),
            self._values.size,
            1 + self._integer_values.size,
            self._model.counters.size,
        )
        outputs = state.values[self._outputs.start : self._links.stop]
        if sizes != expected or not finite(outputs) or state.counters.min(initial=0) < 0:
            raise Refused("these bytes are not a saved state of this FMU: sizes or values that it cannot have")

    def _restore_model(self, state: SlaveState) -> None:
        """Restore the model, started with other parameters if need be; where that fails it is the one before."""
        model, started_with, own = self._model, self._start_values, self._numbers
        before = model.state.copy(), model.counters.copy()
        parameters = self._parameter_values(state.values, state.integers[1:], state.strings)
        restarts = parameters != started_with
        try:
            if restarts:
                self._start(parameters)
            if flaw := flaw_of_state(self._model, state.state):
                raise Refused(f"these bytes are not a saved state of this FMU: {flaw}")
        except BaseException:
            self._model, self._numbers = model, own
            if restarts and started_with:
                model.initialise(started_with)
                model.state[:], model.counters[:] = before
            raise
        self._start_values = parameters
        self._model.state[:], self._model.counters[:] = state.state, state.counters

    _fmu_state_to_bytes = staticmethod(to_bytes)
    _fmu_state_from_bytes = staticmethod(from_bytes)

    # ---------------------------------------------------------------- log

    @staticmethod
    def _sentence(error: BaseException) -> str:
        if isinstance(error, Refused | InvalidParameter | StepFailed):
            return str(error)
        last = traceback.extract_tb(error.__traceback__)[-1:]
        where = f" ({Path(last[0].filename).name}, line {last[0].lineno})" if last else ""
        return f"{type(error).__name__}: {error}{where}"

    def _report(self, error: BaseException, *, raised: bool = False) -> str:
        """Log an error, unless a refusal with its traceback, and return its sentence."""
        sentence = self._sentence(error)
        if not (raised and MESSAGES_WAIT):
            self.log(sentence, Fmi2Status.error)
        if not isinstance(error, Refused):
            trace = "".join(traceback.format_exception(error))
            self.log(trace[-MOST_BYTES:], Fmi2Status.error, "traceback")
        return sentence

    log_categories = {**Fmi2Slave.log_categories, "traceback": "Where in the code an error arose."}  # noqa: RUF012

    def _forward_warnings(self) -> None:
        """Pass messages of the cache to the host where no log handler received them."""
        for sentence in unlogged_warnings():
            self.log(sentence, Fmi2Status.warning)

    def log(self, msg: str, status: Fmi2Status = Fmi2Status.ok, category: str | None = None, debug: Any = None) -> None:
        """Queue a message."""
        super().log(printf_format(msg), status, category)

    # ---------------------------------------------------------------- modelDescription.xml

    def to_xml(self, model_options: Mapping[str, str] | None = None) -> Element:
        """Root element of modelDescription.xml (see ``description``)."""
        name = type(self).__name__
        return document(
            name,
            guid=str(self.guid),
            text=(type(self).__doc__ or name).strip().splitlines()[0],
            tool=f"cotrack, PythonFMU {pythonfmu_version}",
            variables=self.variables,
            reals=len(self._reals),
            continuous=self._parameters.start,
            categories=self.log_categories,
            experiment=self._experiment,
        )
