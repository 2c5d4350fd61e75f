"""Instance of a model without FMU: variables by reference, phases, failed steps, saved states."""

import numpy as np
import pytest
from toy.model import Model

from fmus.fmi.model_instance import ModelInstance
from fmus.fmi.phases import InstancePhase, Refused
from fmus.interface.model import InvalidParameter, StepFailed

H = 1e-3
CONFIG = {"spare": 3, "start": 0.1}
LINKS = [f"link[{i}].tension" for i in (1, 2, 3)]


@pytest.fixture
def heard():
    return []


@pytest.fixture
def spring(heard):
    """Return an instance of a mass on a spring that initialises, and its references by name."""
    instance = ModelInstance(Model, CONFIG, {})
    instance.warn = heard.append
    instance.setup_experiment(0.0)
    instance.enter_initialization_mode()
    return instance, {port.name: reference for reference, port in enumerate(instance.variables)}


def reals(instance, references, *names):
    return instance.get_real([references[name] for name in names])


def counters(instance, references):
    return instance.get_integer([references["solver.steps"], references["status"]])


def advance(instance, first, count):
    for k in range(first, first + count):
        instance.set_real([0], [np.sin(0.7 * k)])
        instance.do_step(k * H, H)


def test_a_reference_is_the_index_among_the_variables(spring):
    instance, references = spring
    assert [*references][:5] == ["force", "spare[1]", "spare[2]", "spare[3]", "x"]
    assert reals(instance, references, "force", "x", "v", "copy[3]") == [0.0, 0.1, 0.0, 0.1]
    assert reals(instance, references, *LINKS) == [10.0, 20.0, 30.0]
    assert reals(instance, references, "start.x", "stiffness", "damping") == [0.1, 100.0, 0.1]
    assert instance.get_integer([references["substeps"], references["reals.size"]]) == [4, 8 * instance.reals]
    assert instance.get_string([references["trouble"]]) == ["none"]
    assert (instance.continuous, instance.reals) == (references["start.x"], references["solver.steps"])
    for name, value in (("spare[2]", 5.0), ("damping", 0.5)):
        instance.set_real([references[name]], [value])
    instance.set_integer([references["substeps"]], [7])
    instance.set_string([references["trouble"]], ["warn"])
    every = dict(zip(references, instance.get_real([*range(instance.reals)]), strict=False))
    assert {"spare[2]": 5.0, "damping": 0.5, "stiffness": 100.0, "spare[1]": 0.0}.items() <= every.items()
    instance.exit_initialization_mode()
    advance(instance, 0, 2)
    assert counters(instance, references) == [14, 1]
    for get, beyond in ((instance.get_real, instance.reals), (instance.get_integer, 0), (instance.get_string, 0)):
        with pytest.raises(Refused, match=f"value reference {beyond}"):
            get([beyond])


def test_outputs_follow_parameters_until_the_end_of_initialisation(spring):
    instance, references = spring
    assert reals(instance, references, "x", LINKS[0]) == [0.1, 10.0]
    instance.set_real([references["start.x"], references["stiffness"]], [0.4, 10.0])
    assert reals(instance, references, "x", LINKS[0]) == [0.4, 4.0]
    instance.set_real([references["stiffness"]], [-1.0])
    with pytest.raises(InvalidParameter, match="springs push back"):
        instance.exit_initialization_mode()
    assert instance.phase is InstancePhase.INITIALISING
    instance.set_real([references["stiffness"]], [20.0])
    instance.exit_initialization_mode()
    assert reals(instance, references, "x", LINKS[0]) == [0.4, 8.0]
    for refused in (lambda: instance.set_real([references["stiffness"]], [1.0]),
                    lambda: instance.set_integer([references["substeps"]], [2]),
                    lambda: instance.set_string([references["trouble"]], ["none"])):  # fmt: skip
        with pytest.raises(Refused, match="is fixed"):
            refused()
    with pytest.raises(Refused, match="an output cannot be set"):
        instance.set_real([references["x"]], [1.0])


def test_steps_need_their_phase_and_follow_each_other(spring):
    instance, _ = spring
    with pytest.raises(Refused, match="fmi2DoStep is not allowed in the phase initialising"):
        instance.do_step(0.0, H)
    instance.exit_initialization_mode()
    advance(instance, 0, 3)
    with pytest.raises(Refused, match=r"the step begins at t = 0, but the last one ended at 0\.003"):
        instance.do_step(0.0, H)
    instance.terminate()
    with pytest.raises(Refused, match="in the phase terminated"):
        instance.do_step(3 * H, H)


@pytest.mark.parametrize(("trouble", "sentence"), [("raise", "the spring broke at t"), ("nan", "output 'v' is nan")])
def test_a_failed_step_leaves_state_and_counters(spring, trouble, sentence):
    instance, references = spring
    instance.set_string([references["trouble"]], [trouble])
    instance.exit_initialization_mode()
    advance(instance, 0, 5)
    before = instance.get_real([*range(1, instance.reals)])
    for _ in range(2):
        with pytest.raises(StepFailed, match=sentence):
            advance(instance, 5, 1)
        assert instance.get_real([*range(1, instance.reals)]) == before
        assert counters(instance, references) == [20, 3]


def test_a_state_is_all_that_changes(spring, heard):
    instance, references = spring
    instance.set_string([references["trouble"]], ["warn"])
    instance.exit_initialization_mode()
    everything = [*range(instance.reals)]
    advance(instance, 0, 3)
    saved = instance.get_fmu_state()
    here = instance.get_real(everything), counters(instance, references)
    advance(instance, 3, 3)
    there = instance.get_real(everything), counters(instance, references)
    assert there[1] == [24, 1]
    assert heard == ["the spring creaks at 5 % of its load"] * 6
    assert reals(instance, references, *LINKS) == [k * 100.0 * reals(instance, references, "x")[0] for k in (1, 2, 3)]
    for other in (instance, ModelInstance(Model, CONFIG, {})):
        other.set_fmu_state(saved)
        assert (other.get_real(everything), counters(other, references)) == here
        advance(other, 3, 3)
        assert (other.get_real(everything), counters(other, references)) == there
    for wrong, said in ((saved._replace(guid="another"), "belongs to another FMU"), (None, "not a state"),
                        (saved._replace(state=np.zeros(3)), "3 numbers for 2"),
                        (saved._replace(counters=np.array([-1])), "sizes or values")):  # fmt: skip
        with pytest.raises(Refused, match=said):
            instance.set_fmu_state(wrong)
        assert (instance.get_real(everything), counters(instance, references)) == there
