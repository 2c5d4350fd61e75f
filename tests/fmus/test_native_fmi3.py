"""FMUs of FMI 3.0 against those of FMI 2.0 that have the same kernels, in FMPy."""

from __future__ import annotations

import re
import subprocess
from ctypes import byref, c_bool, c_char_p, c_double, c_int32, c_int64
from pathlib import Path

import fmpy
import numpy as np
import pytest
from fmi3_instance import Three, begun3, native3, scalars
from fmpy import read_model_description, simulate_fmu
from fmpy.validation import validate_fmu
from lxml import etree
from native_cases import CHAIN, CHASSIS, DRIVE, H, begun, follow, ran

from fmus.interface.ports import motion_ports, wrench_ports
from fmus.native.arrays import arrays
from fmus.native.fmi3_description import TERMINALS
from fmus.native.header import header
from fmus.native.link import HERE, compiler
from orchestrator.cosim.fmu_files import unpack

FMPY = Path(fmpy.__file__).parent
OK, DISCARD, ERROR = 0, 2, 3


@pytest.mark.parametrize(
    "case", [DRIVE, *(pytest.param(case, marks=pytest.mark.study) for case in (CHAIN, CHASSIS))], ids=lambda c: c.part
)
def test_both_versions_of_fmi_give_the_same_bits(case):
    run = ran(case)
    with begun(case) as two, begun3(case) as three:
        y, links = follow(two, run, range(case.steps))
        shown, counted = three.follow(run, range(case.steps))
        np.testing.assert_array_equal(shown, np.hstack([y, links]))
        names = [name for variable in three.of("output") for name in scalars(variable)]
        assert names == [v.name for v in two.description.modelVariables if (v.causality, v.type) == ("output", "Real")]
        assert counted[-1].tolist() == two.counters.tolist()
        assert three.slave.getFloat64([three.of("independent")[0].valueReference]) == [(case.steps - 1) * H + H]
        assert np.ptp(shown, axis=0).max() > 0.0


def test_states_go_on_to_the_bit_also_in_another_instance():
    run = ran(DRIVE)
    with begun3(DRIVE) as one, begun3(DRIVE, parameters=False) as other:
        one.follow(run, range(40))
        state = one.slave.getFMUState()
        y, counted = one.follow(run, range(40, 80))
        one.slave.setFMUState(state)
        again, _ = one.follow(run, range(40, 80))
        np.testing.assert_array_equal(again, y)
        content = one.slave.serializeFMUState(state)
        one.slave.freeFMUState(state)
        flawed = content[:-1] + bytes([content[-1] ^ 1])
        for broken, said in ((content[:-1], "not a saved state of this FMU"), (flawed, "checksum does not hold")):
            with pytest.raises(fmpy.fmi1.FMICallException):
                other.slave.deserializeFMUState(broken)
            assert said in other.messages[-1][1]
        restored = other.slave.deserializeFMUState(content)
        other.slave.setFMUState(restored)
        other.slave.freeFMUState(restored)
        elsewhere, counted_there = other.follow(run, range(40, 80))
        np.testing.assert_array_equal(elsewhere, y)
        np.testing.assert_array_equal(counted_there, counted)


def test_a_refused_call_says_why_and_changes_nothing():
    run = ran(DRIVE)
    with begun3(DRIVE, parameters=False) as three:

        def refused(said, function, *arguments):
            assert three.status(function, *arguments) == ERROR
            assert three.messages[-1][0] == ERROR
            assert said in three.messages[-1][1]

        one = [three.of("input")[0].valueReference]  # mount.position
        shown, end = three.of("output")[0].valueReference, len(three.description.modelVariables) - 1
        refused("fmi3GetFloat64 is not allowed in the phase instantiated", "fmi3GetFloat64", one, [0.0] * 3, c_double)
        with pytest.raises(fmpy.fmi1.FMICallException):
            three.slave.doStep(0.0, H)
        assert "fmi3DoStep is not allowed in the phase instantiated, only when running" in three.messages[-1][1]
        three.start(run.part.parameters)
        y, _ = three.follow(run, range(1))
        position = three.slave.getFloat64(one, 3)
        refused("these variables have 3 values, not 2", "fmi3SetFloat64", one, [7.0] * 2, c_double)
        refused("these variables have 3 values, not 4", "fmi3GetFloat64", one, [7.0] * 4, c_double)
        refused("an output cannot be set (sprocket.position.x", "fmi3SetFloat64", [*one, shown], [7.0] * 6, c_double)
        refused("the time cannot be set", "fmi3SetFloat64", [end], [7.0], c_double)
        refused(f"no Float64 variable has the value reference {end + 1}", "fmi3GetFloat64", [end + 1], [7.0], c_double)
        refused(
            "no Float64 variable has the value reference 4294967295", "fmi3SetFloat64", [2**32 - 1], [7.0], c_double
        )
        refused("no Int32 variable has the value reference 0", "fmi3GetInt32", [0], [7], c_int32)
        refused("output 'solver.steps' cannot be set", "fmi3SetInt64", [three.of("output", "Int64")[0].valueReference],
                [7], c_int64)  # fmt: skip
        fixed = next(v for v in three.of("parameter") if v.name == "start.position")
        refused("parameter 'start.position.x' is fixed", "fmi3SetFloat64", [fixed.valueReference], [7.0] * 3, c_double)
        for unsupported in (three.slave.enterEventMode, three.slave.enterStepMode, three.slave.updateDiscreteStates):
            with pytest.raises(fmpy.fmi1.FMICallException):
                unsupported()
            assert three.messages[-1][1].endswith("is not supported by this FMU")
        assert three.slave.getFloat64(one, 3) == position
        again, _ = three.follow(run, range(1, 2))
        three.slave.terminate()
        with pytest.raises(fmpy.fmi1.FMICallException):
            three.slave.terminate()
        three.slave.reset()
        three.start(run.part.parameters)
        np.testing.assert_array_equal(three.follow(run, range(2))[0], [*y, *again])


def test_choices_are_enumerations():
    with begun3(DRIVE, parameters=False) as three:
        described = {v.name: v for v in three.description.modelVariables}
        mode, extrapolation = described["mode"], described["extrapolation"]
        assert [(item.name, item.value) for item in mode.declaredType.items] == [
            ("speed", "1"), ("torque", "2"), ("controller", "3")]  # fmt: skip
        assert (mode.type, mode.causality, mode.start) == ("Enumeration", "parameter", "1")
        assert described["speed.points"].type == "String"
        get = three.slave.getInt64
        three.slave.enterInitializationMode()
        assert get([mode.valueReference, extrapolation.valueReference]) == [1, 2]
        three.slave.setInt64([mode.valueReference, extrapolation.valueReference], [3, 1])
        assert get([mode.valueReference, extrapolation.valueReference]) == [3, 1]
        for value in (0, 4, -(2**40)):
            assert three.status("fmi3SetInt64", [mode.valueReference], [value], c_int64) == ERROR
            said = f"mode = '{value}': must be one of speed, torque, controller"
            assert three.messages[-1] == (ERROR, said)
        assert get([mode.valueReference]) == [3]
        both = [mode.valueReference, extrapolation.valueReference]
        assert three.status("fmi3SetInt64", both, [2, 9], c_int64) == ERROR
        assert get(both) == [3, 1]  # a refused call leaves the instance as it was
        assert three.status("fmi3SetInt64", both, [2, 2], c_int64) == 0
        assert get(both) == [2, 2]
        with pytest.raises(fmpy.fmi1.FMICallException):
            three.slave.getString([mode.valueReference])
        assert "no String variable has the value reference" in three.messages[-1][1]


@pytest.mark.parametrize("early_allowed", [False, True])
def test_a_step_that_cannot_be_done_is_discarded_where_it_began(early_allowed):
    """Before it begins, or in its middle; the standard forbids ``earlyReturn`` for a failure."""
    run = ran(DRIVE)
    with begun3(DRIVE, earlyReturnAllowed=early_allowed) as three, begun3(DRIVE) as other:
        whole = [variable.valueReference for variable in three.of("output", "Int64")][:2]
        for name, values, said in (
            ("mount.orientation", [1.0, np.nan, 0.0, 0.0], "input 'mount.orientation.x' is nan at t = 0"),
            ("sprocket.torque", [0.0, 1e308, 0.0], "at t = 0 s the sprocket's spin is not finite"),
        ):
            (bent,) = (variable.valueReference for variable in three.of("input") if variable.name == name)
            good = three.slave.getFloat64([bent], len(values))
            three.slave.setFloat64([bent], values)
            event, end, early, last = c_bool(True), c_bool(True), c_bool(True), c_double(7.0)
            pointers = [byref(each) for each in (event, end, early, last)]
            assert three.slave.dll.fmi3DoStep(three.slave.component, 0.0, H, True, *pointers) == DISCARD
            assert (event.value, end.value, early.value, last.value) == (False, False, False, 0.0)
            assert three.messages[-1] == (DISCARD, said)
            assert three.slave.getInt64(whole) == [0, 0]
            three.slave.setFloat64([bent], good)
        np.testing.assert_array_equal(three.follow(run, range(3))[0], other.follow(run, range(3))[0])


def test_what_the_description_denies_is_not_instantiated():
    for options in ({"eventModeUsed": True}, {"requiredIntermediateVariables": [0]}):
        with pytest.raises(Exception, match="Failed to instantiate"):
            Three(native3(DRIVE), **options)
    interface = read_model_description(native3(DRIVE)).coSimulation
    assert interface.canGetAndSetFMUstate
    assert interface.canSerializeFMUstate
    assert not interface.hasEventMode
    assert not interface.mightReturnEarlyFromDoStep


@pytest.mark.parametrize(
    "case", [DRIVE, *(pytest.param(case, marks=pytest.mark.study) for case in (CHAIN, CHASSIS))], ids=lambda c: c.part
)
def test_description_and_terminals_are_valid_and_agree(case):
    file = native3(case)
    assert validate_fmu(str(file)) == []
    folder = unpack(file)
    described = {v.name: v for v in read_model_description(file).modelVariables}
    page = (folder / "documentation/index.html").read_text(encoding="utf-8")
    assert all(f"<td>{name}" in page for name in described)
    path = folder / "terminalsAndIcons/terminalsAndIcons.xml"
    assert path.exists() == (case != CHAIN)  # which has no wheels
    if case == CHAIN:
        assert "<td>joint.position[65, 3]</td><td>output</td>" in page
        return
    root = etree.parse(path)
    etree.XMLSchema(etree.parse(FMPY / "schema/fmi3/fmi3TerminalsAndIcons.xsd")).assertValid(root)
    for terminal in root.iter("Terminal"):
        members = {m.get("memberName"): described[m.get("variableName")] for m in terminal}
        assert tuple(members) == TERMINALS[terminal.get("terminalKind")]
        assert [v.shape for v in members.values()] == [(4,) if m == "orientation" else (3,) for m in members]
    names = [terminal.get("name") for terminal in root.iter("Terminal")]
    assert len(names) == (2 if case == DRIVE else 15)  # of a chassis: 7 of each side, and its own motion
    if case == DRIVE:
        assert names == ["mount", "sprocket"]
        assert list(members) == ["position", "orientation", "velocity", "angular_velocity", "force", "torque"]
        assert "<td>mount.orientation[4]</td><td>input</td>" in page


def test_all_functions_of_the_standard_are_there_with_their_types(tmp_path):
    """The C source compiles with the standard's headers, which FMPy brings, instead of its own."""
    sizes = {"x": 1, "n": 0, "f": 1, "k": 1, "z": 1}
    reals = [*motion_ports("S", "input"), *wrench_ports("S", "output")]
    sentences = dict.fromkeys(("FAILURE", "WARNING", "REFUSED"), ())
    head = f'#define GUID "{"0" * 36}"\n#define SHAPE "shape"\n'
    (tmp_path / "model.h").write_text(head + header(reals, 0, sizes, (), sentences, arrays(reals)))
    standard = FMPY / "c-code"
    command = [*compiler(), "-std=c11", "-Werror", f"-I{tmp_path}", f"-I{HERE}", "-c", "-o", str(tmp_path / "all.o")]
    functions = ["-DFMI3_H", "-include", str(standard / "fmi3Functions.h"), str(HERE / "fmi3.c")]
    types = ["-include", str(standard / "fmi3PlatformTypes.h"), str(HERE / "fmi3.c")]  # declares the same once more
    for sources in (functions, types):
        subprocess.run([*command, *sources], check=True)
    declared = re.findall(r"^FMI3_Export fmi3\w+TYPE\s+(fmi3\w+);", (standard / "fmi3Functions.h").read_text(), re.M)
    assert len(declared) == 75
    library = fmpy.fmi1.cdll.LoadLibrary(str(next(unpack(native3(DRIVE)).glob("binaries/x86_64-linux/*.so"))))
    assert [name for name in declared if not hasattr(library, name)] == []


def test_fmpy_simulates_it():
    known = {v.name: v for v in read_model_description(native3(DRIVE)).modelVariables if v.causality == "parameter"}
    values = {name: value for name, value in ran(DRIVE).part.parameters.items() if name in known}
    for name, value in values.items():
        if known[name].type == "Enumeration":  # which FMPy sets by number
            values[name] = next(item.value for item in known[name].declaredType.items if item.name == value)
    shown = ["sprocket.position", "speed"]
    result = simulate_fmu(native3(DRIVE), stop_time=0.01, output_interval=1e-3, start_values=values, output=shown)
    assert result["time"][-1] == pytest.approx(0.01)
    assert result["sprocket.position"].shape == (11, 3)
    assert np.ptp(result["speed"]) > 0.0


def test_messages_by_category():
    """An unknown category is refused; errors reach the host whatever it chose, a discarded step is no error."""
    with begun3(DRIVE) as three:
        (torque,) = (variable.valueReference for variable in three.of("input") if variable.name == "sprocket.torque")
        good = three.slave.getFloat64([torque], 3)

        def categories(*names):
            texts = (c_char_p * len(names))(*(name.encode() for name in names))
            return three.slave.dll.fmi3SetDebugLogging(three.slave.component, True, len(names), texts)

        def said():
            three.messages.clear()
            three.slave.setFloat64([torque], [0.0, 1e308, 0.0])
            with pytest.raises(fmpy.fmi1.FMICallException):
                three.slave.doStep(0.0, H)
            three.slave.setFloat64([torque], good)
            three.status("fmi3SetInt64", [three.of("output", "Int64")[0].valueReference], [7], c_int64)
            return [status for status, _ in three.messages]

        assert said() == [DISCARD, ERROR]
        assert categories("logStatusWarning", "logEverything") == ERROR
        known = "logStatusWarning, logStatusDiscard and logStatusError"
        assert three.messages[-1] == (ERROR, f"there is no category 'logEverything' of messages: there are {known}")
        assert said() == [DISCARD, ERROR]
        assert categories("logStatusWarning") == OK
        assert said() == [ERROR]
        assert categories("logStatusDiscard", "logStatusError") == OK
        assert said() == [DISCARD, ERROR]
        assert categories() == OK
        assert said() == [DISCARD, ERROR]
        named = etree.parse(unpack(native3(DRIVE)) / "modelDescription.xml").iter("Category")
        assert [each.get("name") for each in named] == ["logStatusWarning", "logStatusDiscard", "logStatusError"]
