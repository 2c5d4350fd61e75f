"""Behaviour of the FMUs in any FMI tool, seen through fmpy's own calls: description, state, failures.

Random sequences of calls and damaged states: `test_call_sequences.py`.
"""

import ctypes
import logging
import re
import sys
from xml.etree import ElementTree

import numpy as np
import pytest
from built_toy import build_toy
from fmpy.fmi1 import FMICallException
from fmpy.fmi2 import FMU2Slave
from fmpy.validation import validate_fmu
from logged import logged

import fmus.fmi.pythonfmu_faults
from orchestrator.cosim.component import Component
from orchestrator.cosim.fast_calls import REALS
from orchestrator.files.messages import RUN
from orchestrator.fmi.fmu_files import unpack
from orchestrator.fmi.slave import ComponentFailed

H = 1e-3
LINKS = ("links.base.lo", "links.base.hi", "links.size")  # address and bytes of the link outputs


@pytest.fixture
def component(toy):
    with Component(toy, "toy") as component:
        yield component


@pytest.fixture
def raw(toy, xml):
    """Return the same FMU in fmpy alone, initialising, and its value references by name."""
    slave = FMU2Slave(guid="", modelIdentifier="Toy", unzipDirectory=str(unpack(toy)), instanceName="raw")
    slave.instantiate(loggingOn=True)
    slave.setupExperiment()
    slave.enterInitializationMode()
    variables = ElementTree.fromstring(xml).iter("ScalarVariable")
    yield slave, {v.get("name"): int(v.get("valueReference")) for v in variables}
    slave.freeInstance()


def shown(component):
    """All outputs, those of links and counters last."""
    component.read()
    component.read_links()
    component.read_counters()
    return np.array((*component.y, *component.y_links, *component.counters))


def advance(component, first, count):
    """All outputs after each of ``count`` steps with a changing force."""
    trace = []
    for i in range(first, first + count):
        component.u[0] = np.sin(0.7 * i)
        component.write()
        component.step(i * H, H)
        trace.append(shown(component))
    return np.array(trace)


# ------------------------------------------------------------------ description


def test_description_says_all_that_tools_ask_for(toy, xml):
    assert validate_fmu(str(toy)) == []
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
    places = [v for v in variables if v.get("name") in (*LINKS, *REALS)]  # no outputs
    assert {(v.get("causality"), v.get("variability")) for v in places} == {("local", "discrete")}


# ------------------------------------------------------------------ state


def test_a_saved_state_goes_on_to_the_bit_and_a_reset_starts_again(component):
    component.initialise({"damping": 3.0})
    start = advance(component, 0, 5)
    saved = component.save()
    first = advance(component, 5, 10)
    for _ in range(2):
        component.restore(saved)
        assert np.array_equal(shown(component), start[-1])
        assert np.array_equal(advance(component, 5, 10), first)
    assert not np.array_equal(advance(component, 15, 10), first)  # without restoring
    ends = []
    for changes_input in (False, True):
        component.restore(saved)
        if changes_input:
            component.u[0] = 10.0
            component.write()
            component.restore(saved)  # the FMU's own copy of its input too
        component.step(5 * H, H)
        ends.append(shown(component))
    assert np.array_equal(*ends)
    component.free(saved)
    component.initialise({"damping": 3.0})
    assert np.array_equal(advance(component, 0, 5), start)


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
    for bad in (b"", b"not a state", content[:-8]):
        with Component(toy, "bad") as other, pytest.raises(ComponentFailed):
            other.load(bad)
    with Component(build_toy(start=0.2), "other") as other, pytest.raises(ComponentFailed):
        other.load(content)


# ------------------------------------------------------------------ failures


@pytest.mark.parametrize(
    ("trouble", "sentence"),
    [
        ("raise", "the spring broke at t = 0.005 s"),
        ("zero", "ZeroDivisionError: division by zero (model.py, line "),
        ("nan", "output 'v' is nan at t = 0.006"),
    ],
)
def test_failed_step_tells_why_and_keeps_what_was(toy, trouble, sentence, caplog):
    caplog.set_level(logging.DEBUG, RUN.name)
    with Component(toy, "toy") as component:
        component.initialise({"trouble": trouble})
        before = advance(component, 0, 5)[-1]
        with pytest.raises(ComponentFailed, match=re.escape(f"toy: {sentence}")):
            component.step(5 * H, H)
        assert sum(message.startswith(f"toy: {sentence}") for message in caplog.messages) == 1
        assert any("Traceback" in message for message in caplog.messages)
        assert np.array_equal(shown(component)[:-1], before[:-1])
        assert component.counters[component.integers.index("status")] == 3
        with pytest.raises(ComponentFailed, match=re.escape(sentence)):  # and fails again
            component.step(5 * H, H)


def test_a_warning_is_told_with_its_percent_sign(toy):
    with logged() as heard, Component(toy, "toy") as component:
        component.initialise({"trouble": "warn"})
        component.step(0.0, H)
        component.read_counters()
    assert "toy: the spring creaks at 5 % of its load" in heard
    assert component.counters[component.integers.index("status")] == 1


@pytest.mark.parametrize("wait", [False, True])
def test_a_refusal_gives_its_sentence_whether_or_not_messages_wait(toy, monkeypatch, wait, caplog):
    """From Python 3.13 on, a message that is passed on while an exception is set ends that exception."""
    monkeypatch.setattr("fmus.fmi.pythonfmu_faults.MESSAGES_WAIT", wait or sys.version_info >= (3, 13))
    caplog.set_level(logging.DEBUG, RUN.name)
    sentence = "stiffness = -1.0: 100 % of springs push back"
    with Component(toy, "toy") as component:
        with pytest.raises(ComponentFailed, match=re.escape(f"toy: {sentence}")):
            component.initialise({"stiffness": -1.0})
        assert any("Traceback" in message for message in caplog.messages) is not fmus.fmi.pythonfmu_faults.MESSAGES_WAIT
        assert any(line.endswith(sentence) for message in caplog.messages for line in message.splitlines())
        component.set_inputs()  # a call that is not refused passes on what waits
        assert sum("Traceback" in message for message in caplog.messages) == 1


def test_variables_are_what_their_kind_says(raw):
    """Outputs can be read during initialisation and follow the parameters, which are fixed afterwards."""
    slave, references = raw
    x, start = [references["x"]], [references["start.x"]]
    assert slave.getReal(x) == [0.1]
    slave.setReal(start, [0.4])
    assert slave.getReal([*x, references["link[2].tension"]]) == [0.4, 80.0]
    slave.exitInitializationMode()
    for call, name, value in (
        (slave.setReal, "stiffness", 1.0), (slave.setInteger, "substeps", 2), (slave.setString, "trouble", "none"),
        (slave.setReal, "x", 1.0), (slave.setInteger, "status", 1), (slave.setInteger, LINKS[0], 0),
    ):  # fmt: skip
        with pytest.raises(FMICallException):
            call([references[name]], [value])
    for call in (slave.getReal, slave.getInteger, slave.getString, slave.getBoolean):
        with pytest.raises(FMICallException):
            call([12345])
    assert slave.getReal([references["stiffness"], *x]) == [100.0, 0.4]
    assert slave.getString([references["trouble"]]) == [b"none"]
    assert slave.getInteger([references["substeps"]]) == [4]
    slave.doStep(0.0, H)  # and the component still works


def read_array(slave, array):
    """Address, and the values that lie there."""
    low, high, size = slave.getInteger(array)
    address = (high & 0xFFFFFFFF) << 32 | low & 0xFFFFFFFF
    return address, np.frombuffer(ctypes.string_at(address, size)).tolist()


def test_values_lie_where_it_says(raw):
    """Link outputs, computed when read, and all Reals by value reference lie at the given addresses.

    An input that is written there counts as one that is set.
    """
    slave, references = raw
    slave.exitInitializationMode()
    of_links, of_reals = ([references[name] for name in names] for names in (LINKS, REALS))
    links, state = [references[f"link[{i}].tension"] for i in (1, 2, 3)], slave.getFMUstate()
    reals = [*range(len(read_array(slave, of_reals)[1]))]
    outcomes, seen = [], set()
    for written, force in ((True, 1.0), (False, 1.0), (False, 2.0)):
        slave.setFMUState(state)
        for k in range(3):
            place, tensions = read_array(slave, of_links)
            assert tensions == slave.getReal(links)
            seen.add((place, *tensions))
            address, values = read_array(slave, of_reals)
            assert values == slave.getReal(reals)
            if written:
                ctypes.c_double.from_address(address).value = force + k
            else:
                slave.setReal([0], [force + k])
            slave.doStep(k * H, H)
        outcomes.append(slave.getReal(reals))
    assert outcomes[0] == outcomes[1] != outcomes[2]
    assert len(seen) >= 4
    assert len({place for place, *_ in seen}) == 1
    slave.freeFMUState(state)
