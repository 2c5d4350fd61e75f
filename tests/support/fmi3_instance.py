"""Instances of native FMUs of FMI 3.0 in FMPy."""

from __future__ import annotations

from contextlib import contextmanager
from ctypes import c_uint32
from itertools import product
from pathlib import Path

import numpy as np
from fmpy import read_model_description
from fmpy.fmi3 import FMU3Slave
from native_cases import H, ran

from fmus.native.pack import build_native, with_constants
from orchestrator.fmi.fmu_files import unpack


def native3(case):
    part = ran(case).part
    return build_native(part.kind, with_constants(part.kind, part.config, part.parameters), fmi=3)


def scalars(variable):
    """Names that the elements of a Float64 variable have in FMI 2.0."""
    name, shape = variable.name, variable.shape
    if name.startswith(("link.", "joint.")):
        owner, _, tail = name.partition(".")
        ends = [f".{axis}" for axis in "xyz"] if len(shape) == 2 else [""]
        return [f"{owner}[{i + 1}].{tail}{end}" for i, end in product(range(shape[0]), ends)]
    return [f"{name}.{axis}" for axis in "wxyz"[-shape[0] :]] if shape else [name]


class Three:
    """Instance of an FMU of FMI 3.0 in FMPy; ``messages`` are (status, text)."""

    def __init__(self, file, validate=True, **options):
        self.description = read_model_description(file, validate=validate)
        self.messages = []
        self.slave = FMU3Slave(
            guid=self.description.guid,
            modelIdentifier=self.description.coSimulation.modelIdentifier,
            unzipDirectory=str(unpack(Path(file))),
            instanceName="one",
        )
        self.slave.instantiate(
            logMessage=lambda _, status, category, text: self.messages.append((status, text.decode())), **options
        )

    def of(self, causality, kind="Float64"):
        return [v for v in self.description.modelVariables if (v.causality, v.type) == (causality, kind)]

    def start(self, parameters):
        for kind, set_ in (
            ("Float64", self.slave.setFloat64),
            ("String", self.slave.setString),
            ("Enumeration", self._set_choices),
        ):
            for variable in self.of("parameter", kind):
                names = scalars(variable)
                if values := [parameters[name] for name in names if name in parameters]:
                    assert len(values) == len(names)
                    set_([variable.valueReference], values)
        self.slave.enterInitializationMode()
        self.slave.exitInitializationMode()
        return self

    def _set_choices(self, references, values):
        for reference, value in zip(references, values, strict=True):
            (variable,) = (v for v in self.description.modelVariables if v.valueReference == reference)
            (number,) = (item.value for item in variable.declaredType.items if item.name == value)
            self.slave.setInt64([reference], [int(number)])

    def follow(self, run, steps):
        """Return outputs, link outputs last, and counters after each of the steps."""
        row = [port.name for port in run.member.model.ports if port.causality == "input"]
        inputs, outputs, whole = self.of("input"), self.of("output"), self.of("output", "Int64")
        order = [row.index(name) for variable in inputs for name in scalars(variable)]
        assert sorted(order) == list(range(len(row)))
        u, y, n = ([v.valueReference for v in group] for group in (inputs, outputs, whole))
        count = sum(len(scalars(variable)) for variable in outputs)
        shown, counted = [], []
        for k in steps:
            if u:
                self.slave.setFloat64(u, run.u[k][order])
            assert self.slave.doStep(k * H, H) == (False, False, False, k * H + H)
            shown.append(self.slave.getFloat64(y, count))
            counted.append(self.slave.getInt64(n))
        return np.array(shown), np.array(counted)

    def status(self, function, references, values, type_):
        """Status of a call that gets or sets values; the message goes to ``messages``."""
        call = getattr(self.slave.dll, function)
        n = len(references)
        array = (type_ * len(values))(*values)
        return call(self.slave.component, (c_uint32 * n)(*references), n, array, len(values))


@contextmanager
def begun3(case, parameters=True, **options):
    three = Three(native3(case), **options)
    try:
        yield three.start(ran(case).part.parameters) if parameters else three
    finally:
        three.slave.freeInstance()
