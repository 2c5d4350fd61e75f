"""FMI 2.0 co-simulation slave: a model instance as pythonfmu wants it, with its resources, log and description."""

from __future__ import annotations

import hashlib
import json
import sys
import traceback
import uuid
import weakref
from collections.abc import Callable, Mapping
from functools import wraps
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element

from pythonfmu import Fmi2Slave
from pythonfmu import __version__ as pythonfmu_version
from pythonfmu.enums import Fmi2Status

from fmus.cache import pack
from fmus.cache.files import cache_folder, check_trust, reporting_errors, unlogged_warnings
from fmus.cache.sources import ROOT, source_hash
from fmus.fmi import pythonfmu_faults as faults
from fmus.fmi.description import document
from fmus.fmi.model_instance import ModelInstance
from fmus.fmi.phases import ALLOWED, InstancePhase, Refused, not_allowed
from fmus.fmi.same_build import SameBuild
from fmus.fmi.saved import from_bytes, to_bytes
from fmus.interface import numbers
from fmus.interface.defaults import experiment
from fmus.interface.model import ComponentModel, InvalidParameter, StepFailed
from fmus.kernels.jit import compiled_before

BUILD = source_hash()  # hash of the fmus sources of this process


def _build_mismatch(packed: str, name: str = "this FMU") -> Refused:
    return Refused(
        f"{name} was built from other sources ({packed[:12]}) than the fmus package "
        f"of this process ({BUILD[:12]}): build it again, or load it in a process of its own"
    )


sys.meta_path.append(SameBuild("fmus", BUILD, _build_mismatch))


def _guarded(call: Callable[..., Any]) -> Callable[..., Any]:
    """Make a call of the instance, where the phase allows it; log any exception, raise one that pythonfmu survives."""
    name = "fmi2" + call.__name__.title().replace("_", "")
    phases = ALLOWED.get(name, tuple(InstancePhase))

    @wraps(call)
    def guarded(self: Slave, *args: Any) -> Any:
        try:
            if self._waiting:
                self.log_queue += self._waiting
                self._waiting = []
            instance = self.instance
            if instance.phase not in phases:
                raise Refused(not_allowed(name, instance.phase))
            return call(instance, *args)
        except BaseException as error:  # KeyboardInterrupt too: no other exception may leave the call
            sentence = self._report(error, raised=True)
            if faults.MESSAGES_WAIT:
                self._waiting = self.log_queue[:]
                self.log_queue.clear()
            faults.add_references(type(self), self, self.log_queue)
            raise faults.RefusedCall(sentence) from None

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
        faults.add_references(vars(sys.modules[cls.__module__]))  # the shell runs once more before each release

    def __init__(self, **kwargs: Any) -> None:
        super().__init__(**kwargs)
        self._waiting: list[Any] = []  # messages of a refused call, for the next one
        try:
            self._load(Path(self.resources))
            with reporting_errors():
                check_trust(cache_folder())  # refuse an unsafe cache before a minute of compilation
            if not compiled_before(type(self).model.step_kernel):
                self.log("the first start on this machine compiles the kernels, which takes up to a minute")
            for sentence in unlogged_warnings():
                self.log(sentence, Fmi2Status.warning)
        except Exception as error:
            raise faults.RefusedCall(self._sentence(error)) from None
        self._waiting = self.log_queue[:]  # a host that frees an instance with messages in the queue ends its process
        self.log_queue.clear()

    def _load(self, resources: Path) -> None:
        # before anything may be refused: the process of a refused FMU exits too
        faults.finalise_at_exit(resources.parent / "binaries" / "linux64" / f"{type(self).__name__}.so")
        packed = (resources / "build.txt").read_text().strip()
        if packed != BUILD:
            raise _build_mismatch(packed, type(self).__name__)
        pack.add(resources / ROOT.name)
        shape = (resources / "shape.txt").read_text()
        self.guid = str(uuid.UUID(bytes=hashlib.sha256(f"{BUILD} {type(self)} {shape}".encode()).digest()[:16]))
        model_config = json.loads((resources / "config.json").read_bytes())
        meanings = json.loads((resources / numbers.MEANINGS).read_bytes())
        self._experiment = experiment(model_config)
        self.instance = ModelInstance(type(self).model, model_config, meanings, self.guid)
        self.variables = self.instance.variables
        me = weakref.proxy(self)  # in no circle: the memory of a freed instance is free at once
        self.instance.warn = lambda sentence: me.log(sentence, Fmi2Status.warning)

    get_real, set_real = _guarded(ModelInstance.get_real), _guarded(ModelInstance.set_real)
    get_integer, set_integer = _guarded(ModelInstance.get_integer), _guarded(ModelInstance.set_integer)
    get_string, set_string = _guarded(ModelInstance.get_string), _guarded(ModelInstance.set_string)
    get_boolean, set_boolean = _guarded(ModelInstance.get_boolean), _guarded(ModelInstance.set_boolean)
    setup_experiment = _guarded(ModelInstance.setup_experiment)
    enter_initialization_mode = _guarded(ModelInstance.enter_initialization_mode)
    exit_initialization_mode = _guarded(ModelInstance.exit_initialization_mode)
    terminate = _guarded(ModelInstance.terminate)
    _get_fmu_state, _set_fmu_state = _guarded(ModelInstance.get_fmu_state), _guarded(ModelInstance.set_fmu_state)
    _fmu_state_to_bytes, _fmu_state_from_bytes = staticmethod(to_bytes), staticmethod(from_bytes)

    def do_step(self, current_time: float, step_size: float) -> bool:
        """Do one communication step; False (fmi2Discard) where it failed: the instance is then the one before."""
        try:
            self.instance.do_step(current_time, step_size)
        except BaseException as error:
            self._report(error)
            return False
        return True

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
        if not (raised and faults.MESSAGES_WAIT):
            self.log(sentence, Fmi2Status.error)
        if not isinstance(error, Refused):
            trace = "".join(traceback.format_exception(error))
            self.log(trace[-faults.MAX_BYTES :], Fmi2Status.error, "traceback")
        return sentence

    log_categories = {**Fmi2Slave.log_categories, "traceback": "Where in the code an error arose."}  # noqa: RUF012

    def log(self, msg: str, status: Fmi2Status = Fmi2Status.ok, category: str | None = None, debug: Any = None) -> None:
        """Queue a message."""
        super().log(faults.printf_format(msg), status, category)

    def to_xml(self, model_options: Mapping[str, str] | None = None) -> Element:
        """Root element of modelDescription.xml (see ``description``)."""
        name = type(self).__name__
        return document(
            name,
            guid=self.guid,
            text=(type(self).__doc__ or name).strip().splitlines()[0],
            tool=f"cotrack, PythonFMU {pythonfmu_version}",
            variables=self.variables,
            reals=self.instance.reals,
            continuous=self.instance.continuous,
            categories=self.log_categories,
            experiment=self._experiment,
        )
