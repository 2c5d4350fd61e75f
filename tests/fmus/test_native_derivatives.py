"""Derivatives of outputs and inputs of native FMUs."""

from __future__ import annotations

from contextlib import contextmanager
from ctypes import c_double, c_int32, c_uint32

import fmpy
import numpy as np
import pytest
from fmi3_instance import begun3
from fmpy import read_model_description
from fmpy.fmi2 import FMU2Slave
from native_cases import DRIVE, H, native, ran

from orchestrator.cosim.fmu_files import unpack


class Two:
    """Instance of the native drive in FMPy, initialised."""

    def __init__(self, **parameters):
        self.description = read_model_description(native(DRIVE))
        self.said = []
        variables = {v.name: v for v in self.description.modelVariables}
        self.slave = FMU2Slave(
            guid=self.description.guid,
            modelIdentifier="SprocketDrive",
            unzipDirectory=str(unpack(native(DRIVE))),
            instanceName="a",
        )
        self.slave.instantiate()
        reals = [v for v in self.description.modelVariables if v.type == "Real"]
        self.inputs, self.outputs = (
            [v.valueReference for v in reals if v.causality == causality] for causality in ("input", "output")
        )
        self.place = {name: v.valueReference for name, v in variables.items()}
        for name, value in (ran(DRIVE).part.parameters | parameters).items():
            if name in variables and variables[name].causality == "parameter":
                (self.slave.setString if isinstance(value, str) else self.slave.setReal)([self.place[name]], [value])
        self.slave.enterInitializationMode()
        self.slave.exitInitializationMode()

    def step(self, k, h=H, u=None, slopes=()):
        """Step with the inputs ``u`` and derivatives ``slopes`` by name; return the outputs."""
        self.slave.setReal(self.inputs, ran(DRIVE).u[k] if u is None else u)
        if slopes:
            references = [self.place[name] for name in slopes]
            self.slave.setRealInputDerivatives(references, [1] * len(slopes), list(slopes.values()))
        self.slave.doStep(k * H, h)
        return np.array(self.slave.getReal(self.outputs))

    def derivatives(self, references=None, order=1):
        references = self.outputs if references is None else references
        n = len(references)
        values = (fmpy.fmi2.fmi2Real * n)()
        self.slave.fmi2GetRealOutputDerivatives(
            self.slave.component, (fmpy.fmi2.fmi2ValueReference * n)(*references), n,
            (fmpy.fmi2.fmi2Integer * n)(*[order] * n), values,
        )  # fmt: skip
        return np.array(values)


@contextmanager
def two(**parameters):
    made = Two(**parameters)
    try:
        yield made
    finally:
        made.slave.freeInstance()


def test_derivatives_of_outputs_are_their_change_over_the_last_step():
    with two() as drive, begun3(DRIVE) as three:
        rows, shown = [np.array(drive.slave.getReal(drive.outputs))], []
        assert not drive.derivatives().any()  # before the first step
        for k in range(6):
            rows.append(drive.step(k))
            shown.append(drive.derivatives())
        change = np.diff(rows, axis=0) / H
        np.testing.assert_array_equal(shown, change)
        assert np.abs(change).max() > 1.0
        three.follow(ran(DRIVE), range(6))
        references = [v.valueReference for v in three.of("output")]
        n, count = len(references), change.shape[1]
        call, values = three.slave.dll.fmi3GetOutputDerivatives, (c_double * count)()
        given = three.slave.component, (c_uint32 * n)(*references), n, (c_int32 * n)(*[1] * n), values
        assert call(*given, count) == 0
        np.testing.assert_array_equal(np.array(values), change[-1])
        assert call(*given, count - 1) != 0
        assert f"these variables have {count} values, not {count - 1}" in three.messages[-1][1]
        for refused in (lambda: drive.derivatives(order=2), lambda: drive.derivatives(drive.inputs[:1])):
            with pytest.raises(fmpy.fmi1.FMICallException):
                refused()


def test_derivatives_of_inputs_act_over_the_next_step_alone():
    """A wrench is a mean: that of the next step is a step later; a velocity acts by its mean over the step."""
    slopes = {"sprocket.torque.y": 4e5, "mount.velocity.x": 300.0, "mount.position.z": 7.0}
    share = {"sprocket.torque.y": 1.0, "mount.velocity.x": 0.5, "mount.position.z": 0.0}
    with two() as drive, two() as other:
        for k in range(5):
            u = ran(DRIVE).u[k].copy()
            for name, slope in slopes.items() if k % 2 else ():
                u[drive.inputs.index(drive.place[name])] += share[name] * H * slope
            np.testing.assert_array_equal(drive.step(k, slopes=slopes if k % 2 else {}), other.step(k, u=u))
        with pytest.raises(fmpy.fmi1.FMICallException):
            drive.slave.setRealInputDerivatives([drive.outputs[0]], [1], [1.0])


def test_a_host_that_passes_derivatives_on_extrapolates_as_the_parameter_does():
    """The mean of a wrench over the next step: its value and the step times its derivative."""
    torque, rng = "sprocket.torque.y", np.random.default_rng(1)
    values = 500.0 + 100.0 * rng.standard_normal(8)
    with two() as by_host, two(extrapolate="linear") as by_parameter:
        at = by_host.inputs.index(by_host.place[torque])
        for k in range(8):
            u = ran(DRIVE).u[0].copy()
            u[at] = values[k]
            slope = (values[k] - values[k - 1]) / H if k else 0.0
            y = by_host.step(k, u=u, slopes={torque: slope})
            z = by_parameter.step(k, u=u)
            np.testing.assert_allclose(y, z, rtol=1e-9, atol=1e-9)


def test_what_the_description_says():
    interface = read_model_description(native(DRIVE)).coSimulation
    assert interface.canInterpolateInputs
    assert interface.maxOutputDerivativeOrder == 1
    with begun3(DRIVE, parameters=False) as three:
        assert three.description.coSimulation.maxOutputDerivativeOrder == 1
