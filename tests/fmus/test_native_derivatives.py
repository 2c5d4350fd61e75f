"""Derivatives of outputs and inputs of native FMUs."""

from __future__ import annotations

from contextlib import contextmanager
from ctypes import c_double, c_int32, c_uint32

import fmpy
import numpy as np
import pytest
from fmi3_instance import begun3
from fmpy import read_model_description
from fmpy.fmi2 import fmi2Integer, fmi2Real, fmi2ValueReference
from native_cases import DRIVE, H, native, ran, raw


class Two:
    """Instance of the native drive in FMPy, running; ``place``: value references by name."""

    def __init__(self, slave, variables):
        self.slave, self.place = slave, {name: v.valueReference for name, v in variables.items()}
        self.inputs, self.outputs = (
            [v.valueReference for v in variables.values() if (v.type, v.causality) == ("Real", causality)]
            for causality in ("input", "output")
        )
        slave.exitInitializationMode()

    def step(self, k, u=None, slopes=()):
        """Step with the inputs ``u`` and derivatives ``slopes`` by name; return the outputs."""
        self.slave.setReal(self.inputs, ran(DRIVE).u[k] if u is None else u)
        if slopes:
            references = [self.place[name] for name in slopes]
            self.slave.setRealInputDerivatives(references, [1] * len(slopes), list(slopes.values()))
        self.slave.doStep(k * H, H)
        return np.array(self.slave.getReal(self.outputs))

    def derivatives(self, references, order=1):
        n = len(references)
        given, orders, values = (fmi2ValueReference * n)(*references), (fmi2Integer * n)(*[order] * n), (fmi2Real * n)()
        self.slave.fmi2GetRealOutputDerivatives(self.slave.component, given, n, orders, values)
        return np.array(values)


@contextmanager
def two(**parameters):
    with raw(DRIVE, **parameters) as made:
        yield Two(*made)


def test_derivatives_of_outputs_are_their_change_over_the_last_step():
    with two() as drive, begun3(DRIVE) as three:
        rows, shown = [np.array(drive.slave.getReal(drive.outputs))], []
        assert not drive.derivatives(drive.outputs).any()  # before the first step
        for k in range(6):
            rows.append(drive.step(k))
            shown.append(drive.derivatives(drive.outputs))
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
        assert call(*given, count - 1) == 3
        for references, order in ((drive.outputs, 2), (drive.inputs[:1], 1)):
            with pytest.raises(fmpy.fmi1.FMICallException):
                drive.derivatives(references, order)
        said = read_model_description(native(DRIVE)), three.description
        assert [one.coSimulation.maxOutputDerivativeOrder for one in said] == [1, 1]
        assert said[0].coSimulation.canInterpolateInputs


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
        for k in range(8):
            u = ran(DRIVE).u[0].copy()
            u[by_host.inputs.index(by_host.place[torque])] = values[k]
            slope = (values[k] - values[k - 1]) / H if k else 0.0
            y, z = by_host.step(k, u=u, slopes={torque: slope}), by_parameter.step(k, u=u)
            np.testing.assert_allclose(y, z, rtol=1e-9, atol=1e-9)
