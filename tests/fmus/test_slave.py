"""Behaviour of the FMUs in any FMI tool, seen through fmpy's own calls: description, state, failures."""

import ctypes
import re
import sys
import zipfile
from xml.etree import ElementTree

import numpy as np
import pytest
from conftest import build_toy
from fmpy.fmi1 import FMICallException
from fmpy.fmi2 import FMU2Slave
from fmpy.validation import validate_fmu

import fmus.fmi.slave
from orchestrator.cosim.component import REALS, Component
from orchestrator.cosim.fmu_files import unpack
from orchestrator.cosim.graph import ComponentFailed

H = 1e-3
LINKS = ("links.base.lo", "links.base.hi", "links.size")  # address and bytes of the link outputs


@pytest.fixture
def component(toy):
    with Component(toy, "toy") as component:
        yield component


@pytest.fixture
def raw(toy, xml):
    """Return the same FMU through fmpy alone, and its value references by name."""
    slave = FMU2Slave(guid="", modelIdentifier="Toy", unzipDirectory=str(unpack(toy)), instanceName="raw")
    slave.instantiate(loggingOn=True)
    references = {
        v.get("name"): int(v.get("valueReference")) for v in ElementTree.fromstring(xml).iter("ScalarVariable")
    }
    return slave, references


def advance(component, first, count):
    """Outputs, counters and link outputs after each of ``count`` steps with a changing force."""
    trace = []
    for i in range(first, first + count):
        component.u[0] = np.sin(0.7 * i)
        component.write()
        component.step(i * H, H)
        component.read()
        component.read_links()
        component.read_counters()
        trace.append((*component.y, *component.y_links, *component.counters))
    return np.array(trace)


# ------------------------------------------------------------------ description


def test_validator_finds_no_problems(toy, tmp_path):
    assert validate_fmu(str(toy)) == []
    flawed = tmp_path / "flawed.fmu"
    with zipfile.ZipFile(toy) as source, zipfile.ZipFile(flawed, "w") as target:
        for name in source.namelist():
            content = source.read(name)
            if name == "modelDescription.xml":
                content = content.replace(b'unit="N/m"', b'unit="N/mm"')
            target.writestr(name, content)
    assert any("N/mm" in problem for problem in validate_fmu(str(flawed)))


def test_description_says_all_that_tools_ask_for(xml):
    root = ElementTree.fromstring(xml)
    assert re.fullmatch(r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\dZ", root.get("generationDateAndTime"))
    variables = list(root.iter("ScalarVariable"))
    assert all(variable.get("description") and variable.get("causality") for variable in variables)
    units = {unit.get("name"): dict(unit.find("BaseUnit").attrib) for unit in root.iter("Unit")}
    assert units["N/m"] == {"kg": "1", "s": "-2"}
    assert all(variable[0].get("unit") in units for variable in variables if variable[0].tag == "Real")
    for variable in variables:
        parameter = variable.get("causality") == "parameter"
        assert (variable[0].get("start") is None) == (variable.get("initial") == "calculated")
        assert (variable.get("variability") == "fixed") == parameter
    flags = root.find("CoSimulation").attrib
    assert flags["canGetAndSetFMUstate"] == flags["canSerializeFMUstate"] == "true"
    assert flags["needsExecutionTool"] == flags["canBeInstantiatedOnlyOncePerProcess"] == "false"

    outputs = {str(i) for i, v in enumerate(variables, 1) if v.get("causality") == "output"}
    parameters = " ".join(str(i) for i, v in enumerate(variables, 1) if v.get("causality") == "parameter")
    for group, dependencies in (("Outputs", ""), ("InitialUnknowns", parameters)):
        unknowns = root.find(f"ModelStructure/{group}")
        assert {unknown.get("index") for unknown in unknowns} == outputs
        listed = {unknown.get("dependencies") for unknown in unknowns}
        assert listed - {None} == {dependencies}
        assert (None in listed) == (group == "InitialUnknowns")  # the standard's default: of everything
    assert "none, raise, nan, zero, warn" in xml  # the choices of a String parameter


def test_start_values_keep_all_their_digits():
    start = 0.1 + 0.2  # 0.30000000000000004: 17 digits
    with Component(build_toy(start=start), "toy") as component:
        component.initialise({})
        assert component.y[0] == start
        assert next(v for v in component.description.modelVariables if v.name == "start.x").start == repr(start)


def test_guid_follows_from_sources_and_configuration(toy, fresh_cache):
    def guid(path):
        with zipfile.ZipFile(path) as archive:
            return ElementTree.fromstring(archive.read("modelDescription.xml")).get("guid")

    assert guid(build_toy()) == guid(toy)
    assert guid(build_toy(start=0.11)) != guid(toy)


# ------------------------------------------------------------------ state


def test_save_step_restore_step_is_bit_equal(component):
    component.initialise({"damping": 3.0})
    advance(component, 0, 5)
    saved = component.save()
    first = advance(component, 5, 10)
    component.restore(saved)
    assert np.array_equal(advance(component, 5, 10), first)
    assert not np.array_equal(advance(component, 15, 10), first)  # without restoring
    component.restore(saved)  # a saved state can be restored more than once
    assert np.array_equal(advance(component, 5, 10), first)
    component.free(saved)


def test_restore_brings_back_inputs_outputs_and_link_outputs(component):
    component.initialise({})
    trace = advance(component, 0, 3)
    saved = component.save()
    force = component.u[0]
    advance(component, 3, 3)
    component.restore(saved)
    component.read()
    component.read_links()
    component.read_counters()
    assert np.array_equal((*component.y, *component.y_links, *component.counters), trace[-1])
    component.u[0] = 0.0
    component._exchange(component._library.fmi2GetReal, component._u)  # read the FMU's own copy of its input
    assert component.u[0] == force


def test_state_as_bytes_revives_in_a_new_instance_with_its_parameters(toy):
    with Component(toy, "first") as first:
        first.initialise({"damping": 3.0, "substeps": 7, "start.x": 0.3})
        advance(first, 0, 5)
        content = first.dump(first.save())
        assert content == first.dump(first.save())
        trace = advance(first, 5, 10)
    with Component(toy, "second") as second:  # neither initialised nor given the parameters
        second.load(content)
        assert np.array_equal(advance(second, 5, 10), trace)
    with Component(toy, "third") as third:
        third.initialise({}, start=5 * H)
        assert not np.array_equal(advance(third, 0, 10), trace)


def test_bytes_that_are_no_state_are_refused(toy, component):
    component.initialise({})
    content = component.dump(component.save())
    flipped = content[:-20] + bytes([content[-20] ^ 1]) + content[-19:]
    for bad in (b"", b"not a state", content[:-8], flipped):
        with Component(toy, "bad") as other, pytest.raises(ComponentFailed, match="not a saved state"):
            other.load(bad)
    with (
        Component(build_toy(start=0.2), "other") as other,
        pytest.raises(ComponentFailed, match="belongs to another FMU"),
    ):
        other.load(content)


def test_reset_starts_again(component):
    component.initialise({"damping": 3.0})
    first = advance(component, 0, 5)
    component.initialise({"damping": 3.0})
    assert np.array_equal(advance(component, 0, 5), first)


def test_two_instances_at_once_keep_apart(toy):
    with Component(toy, "left") as left, Component(toy, "right") as right:
        left.initialise({"start.x": 0.2})
        right.initialise({"start.x": 0.4})
        both = [(advance(left, i, 1), advance(right, i, 1)) for i in range(5)]
    with Component(toy, "alone") as alone:
        alone.initialise({"start.x": 0.2})
        assert np.array_equal(np.vstack([pair[0] for pair in both]), advance(alone, 0, 5))
    assert not np.array_equal(both[-1][0], both[-1][1])


# ------------------------------------------------------------------ failures


@pytest.mark.parametrize(
    ("trouble", "sentence"),
    [
        ("raise", "the spring broke at t = 0.005 s"),
        ("zero", "ZeroDivisionError: division by zero (model.py, line "),
        ("nan", "output 'v' is nan at t = 0.006"),
    ],
)
def test_failed_step_tells_why_and_keeps_what_was(toy, trouble, sentence):
    heard = []
    with Component(toy, "toy", lambda *message: heard.append(message)) as component:
        component.initialise({"trouble": trouble})
        before = advance(component, 0, 5)[-1]
        with pytest.raises(ComponentFailed, match=re.escape(f"toy: {sentence}")):
            component.step(5 * H, H)
        assert [status for _, status, message in heard if message.startswith(sentence)] == [3]
        assert any("Traceback" in message for _, _, message in heard)
        component.read()
        component.read_links()
        component.read_counters()
        assert np.array_equal((*component.y, *component.y_links), before[:-2])
        assert component.counters[component.integers.index("status")] == 3
        assert component.counters[component.integers.index("solver.steps")] == before[-2]
        with pytest.raises(ComponentFailed, match=re.escape(sentence)):  # and fails again
            component.step(5 * H, H)


def test_a_step_with_good_input_follows_one_with_bad_input(component):
    component.initialise({})
    advance(component, 0, 1)
    saved = component.save()
    expected = advance(component, 1, 3)
    component.restore(saved)
    component.u[1] = np.inf
    component.write()
    with pytest.raises(ComponentFailed, match=r"input 'spare\[1\]' is inf at t = 0.001"):
        component.step(H, H)
    component.u[1] = 0.0
    assert np.array_equal(advance(component, 1, 3), expected)


@pytest.mark.parametrize("h", [0.0, -H, np.nan, np.inf, 1e300, 4.94e-324, 1e-310, 0.9e-9])
def test_step_needs_a_length(component, h):
    component.initialise({})
    with pytest.raises(ComponentFailed, match="a step needs a finite time and a length of at least 1e-09 s"):
        component.step(0.0, h)
    component.step(0.0, 1e-9)  # still valid


@pytest.mark.parametrize(
    ("parameters", "sentence"),
    [
        ({"trouble": "explode"}, "trouble = 'explode': must be one of none, raise, nan, zero, warn"),
        ({"stiffness": -1.0}, "stiffness = -1.0: 100 % of springs push back"),
        ({"damping": np.nan}, "damping = nan: must be a finite number"),
    ],
)
def test_wrong_parameter_is_refused_at_the_end_of_initialisation(toy, raw, parameters, sentence, capfd):
    with Component(toy, "toy") as component, pytest.raises(ComponentFailed, match=re.escape(f"toy: {sentence}")):
        component.initialise(parameters)

    slave, references = raw
    name, value = next(iter(parameters.items()))
    (slave.setString if isinstance(value, str) else slave.setReal)([references[name]], [value])
    slave.setupExperiment()
    slave.enterInitializationMode()  # no failure up to here
    for _ in range(2):
        with pytest.raises(FMICallException, match="fmi2ExitInitializationMode failed"):
            slave.exitInitializationMode()
    slave.freeInstance()


@pytest.mark.parametrize("wait", [False, True])
def test_a_refusal_gives_its_sentence_whether_or_not_messages_wait(toy, monkeypatch, wait):
    """From Python 3.13 on, a message that is passed on while an exception is set ends that exception."""
    monkeypatch.setattr("fmus.fmi.slave._MESSAGES_WAIT", wait or sys.version_info >= (3, 13))
    heard, sentence = [], "stiffness = -1.0: 100 % of springs push back"
    with Component(toy, "toy", lambda *message: heard.append(message[2])) as component:
        with pytest.raises(ComponentFailed, match=re.escape(f"toy: {sentence}")):
            component.initialise({"stiffness": -1.0})
        assert any("Traceback" in message for message in heard) is not fmus.fmi.slave._MESSAGES_WAIT
        assert any(sentence in message.splitlines() for message in heard)
        with pytest.raises(ComponentFailed, match="not allowed in the phase initialising"):
            component._call(component._library.fmi2Terminate)
        component._call(component._library.fmi2GetReal, None, 0, None)
        assert sum("Traceback" in message for message in heard) == 1


def test_parameters_are_fixed_outputs_are_outputs_and_references_exist(raw):
    slave, references = raw
    slave.setupExperiment()
    slave.enterInitializationMode()
    slave.exitInitializationMode()
    for call, name, value in (
        (slave.setReal, "stiffness", 1.0),
        (slave.setInteger, "substeps", 2),
        (slave.setString, "trouble", "none"),
        (slave.setReal, "x", 1.0),
        (slave.setInteger, "status", 1),
    ):
        with pytest.raises(FMICallException):
            call([references[name]], [value])
    for call in (slave.getReal, slave.getInteger, slave.getString, slave.getBoolean):
        with pytest.raises(FMICallException):
            call([12345])
    assert slave.getReal([references["stiffness"], references["x"]]) == [100.0, 0.1]
    assert slave.getString([references["trouble"]]) == [b"none"]
    assert slave.getInteger([references["substeps"]]) == [4]
    slave.doStep(0.0, H)  # and the component still works
    slave.freeInstance()


def test_outputs_can_be_read_during_initialisation_and_follow_parameters(raw):
    slave, references = raw
    slave.setupExperiment()
    slave.enterInitializationMode()
    assert slave.getReal([references["x"]]) == [0.1]
    slave.setReal([references["start.x"]], [0.4])
    assert slave.getReal([references["x"], references["link[2].tension"]]) == [0.4, 80.0]
    slave.exitInitializationMode()
    assert slave.getReal([references["x"]]) == [0.4]
    slave.freeInstance()


def read_array(slave, array):
    """Address, and the values that lie there."""
    low, high, size = slave.getInteger(array)
    address = (high & 0xFFFFFFFF) << 32 | low & 0xFFFFFFFF
    return address, np.frombuffer(ctypes.string_at(address, size)).tolist()


def test_link_outputs_lie_where_it_says(raw):
    """Link outputs lie at the given address, which reading either half computes, to the bit."""
    slave, references = raw
    slave.setupExperiment()
    slave.enterInitializationMode()
    slave.exitInitializationMode()
    array, links = (
        [references[name] for name in names] for names in (LINKS, (f"link[{i}].tension" for i in (1, 2, 3)))
    )
    seen = set()
    for k in range(5):
        address, values = read_array(slave, array)
        assert values == slave.getReal(links)
        seen.add((address, *values))
        slave.doStep(k * H, H)
    assert len(seen) == 5
    assert len({address for address, *_ in seen}) == 1
    with pytest.raises(FMICallException):
        slave.setInteger([references["links.base.lo"]], [0])
    slave.freeInstance()


def test_reals_lie_where_it_says(raw):
    """All Reals lie at the given address by value reference; an input written there counts as one that is set."""
    slave, references = raw
    slave.setupExperiment()
    slave.enterInitializationMode()
    slave.exitInitializationMode()
    array, state = [references[name] for name in REALS], slave.getFMUstate()
    reals = [*range(len(read_array(slave, array)[1]))]
    outcomes = []
    for written in (True, False):
        slave.setFMUState(state)
        for k in range(3):
            address, values = read_array(slave, array)
            assert values == slave.getReal(reals)
            if written:
                ctypes.c_double.from_address(address).value = 1.0 + k
            else:
                slave.setReal([0], [1.0 + k])
            slave.doStep(k * H, H)
        outcomes.append(slave.getReal(reals))
    assert outcomes[0] == outcomes[1]
    slave.setFMUState(state)
    for k in range(3):
        slave.setReal([0], [2.0 + k])
        slave.doStep(k * H, H)
    assert slave.getReal(reals) != outcomes[0]
    slave.freeFMUState(state)
    slave.freeInstance()


def test_the_places_of_values_are_no_outputs(xml):
    variables = {v.get("name"): v.attrib for v in ElementTree.fromstring(xml).iter("ScalarVariable")}
    kinds = {(variables[name]["causality"], variables[name]["variability"]) for name in (*LINKS, *REALS)}
    assert kinds == {("local", "discrete")}


def test_warning_is_told_with_its_percent_sign(toy):
    heard = []
    with Component(toy, "toy", lambda *message: heard.append(message)) as component:
        component.initialise({"trouble": "warn"})
        component.step(0.0, H)
        component.read_counters()
    assert ("toy", 1, "the spring creaks at 5 % of its load") in heard
    assert component.counters[component.integers.index("status")] == 1
