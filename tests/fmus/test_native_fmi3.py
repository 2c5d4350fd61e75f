"""FMUs of FMI 3.0 against those of FMI 2.0 that have the same kernels, in FMPy."""

from __future__ import annotations

import re
import subprocess
from ctypes import byref, c_bool, c_char_p, c_double, c_int64
from pathlib import Path

import fmpy
import numpy as np
import pytest
from fmi3_instance import Three, begun3, native3, scalars
from fmpy import read_model_description
from fmpy.validation import validate_fmu
from lxml import etree
from native_cases import CHAIN, CHASSIS, DRIVE, H, begun, follow, native, ran
from plugged import pairs_of_terminals, plugged_vehicle

from fmus.components import model_of
from fmus.fmi.terminals import TERMINAL_KINDS, carried, read_terminals, terminals
from fmus.interface.ports import NOT_NEGATIVE, Port, motion_ports, variables, wrench_ports
from fmus.native.fmi3_description import arrays
from fmus.native.header import header
from fmus.native.machine_code import HERE, LINUX, WINDOWS, compiler, sources
from fmus.track import link_outputs
from fmus.track.link_outputs import GROUPS
from orchestrator.fmi.fmu_files import unpack
from orchestrator.scene.assembly import assemble, build_native_all
from orchestrator.scene.products import scene_products
from orchestrator.scene.scene import load
from tests import own_master

FMPY = Path(fmpy.__file__).parent
OK, DISCARD, ERROR = 0, 2, 3
each_kind = pytest.mark.parametrize(
    "case", [DRIVE, *(pytest.param(case, marks=pytest.mark.study) for case in (CHAIN, CHASSIS))], ids=lambda c: c.part
)


@each_kind
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


def test_states_go_on_to_the_bit_in_another_instance_and_a_reset_starts_again():
    run = ran(DRIVE)
    with begun3(DRIVE) as one, begun3(DRIVE, parameters=False) as other:
        first, _ = one.follow(run, range(40))
        content = one.slave.serializeFMUState(one.slave.getFMUState())
        y, counted = one.follow(run, range(40, 80))
        restored = other.slave.deserializeFMUState(content)
        other.slave.setFMUState(restored)
        other.slave.freeFMUState(restored)
        elsewhere, counted_there = other.follow(run, range(40, 80))
        np.testing.assert_array_equal(elsewhere, y)
        np.testing.assert_array_equal(counted_there, counted)
        one.slave.terminate()
        one.slave.reset()
        np.testing.assert_array_equal(one.start(run.part.parameters).follow(run, range(40))[0], first)


def test_choices_are_enumerations():
    with begun3(DRIVE, parameters=False) as three:
        described = {v.name: v for v in three.description.modelVariables}
        mode, extrapolation = described["mode"], described["extrapolation"]
        names = "speed", "torque", "controller"
        assert [(item.name, item.value) for item in mode.declaredType.items] == [*zip(names, "123", strict=True)]
        assert (mode.type, mode.causality, mode.start) == ("Enumeration", "parameter", "1")
        assert described["speed.points"].type == "String"
        three.slave.enterInitializationMode()
        both = [mode.valueReference, extrapolation.valueReference]
        for given, status, after in (
            ([1, 2], OK, [1, 2]), ([3, 1], OK, [3, 1]), ([0, 1], ERROR, [3, 1]), ([4, 1], ERROR, [3, 1]),
            ([-(2**40), 1], ERROR, [3, 1]), ([2, 9], ERROR, [3, 1]), ([2, 2], OK, [2, 2]),
        ):  # fmt: skip
            assert three.status("fmi3SetInt64", both, given, c_int64) == status
            assert three.slave.getInt64(both) == after, "a refused call leaves the instance as it was"


@pytest.mark.parametrize("early_allowed", [False, True])
def test_a_step_that_cannot_be_done_is_discarded_where_it_began(early_allowed):
    """Before it begins, or in its middle; the standard forbids ``earlyReturn`` for a failure."""
    run = ran(DRIVE)
    with begun3(DRIVE, earlyReturnAllowed=early_allowed) as three, begun3(DRIVE) as other:
        whole = [variable.valueReference for variable in three.of("output", "Int64")][:2]
        for name, values in (("mount.orientation", [1.0, np.nan, 0.0, 0.0]), ("sprocket.torque", [0.0, 1e308, 0.0])):
            (bent,) = (variable.valueReference for variable in three.of("input") if variable.name == name)
            good = three.slave.getFloat64([bent], len(values))
            three.slave.setFloat64([bent], values)
            event, end, early, last = c_bool(True), c_bool(True), c_bool(True), c_double(7.0)
            pointers = [byref(each) for each in (event, end, early, last)]
            assert three.slave.dll.fmi3DoStep(three.slave.component, 0.0, H, True, *pointers) == DISCARD
            assert (event.value, end.value, early.value, last.value) == (False, False, False, 0.0)
            assert three.messages[-1][0] == DISCARD
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


@each_kind
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
        assert tuple(members) == TERMINAL_KINDS[terminal.get("terminalKind")]
        assert [v.shape for v in members.values()] == [(4,) if m == "orientation" else (3,) for m in members]
    elements = {f"{name}.{axis}": quantity for name, quantity in carried(read_terminals(folder)).items()
                for axis in ("wxyz" if name.endswith("orientation") else "xyz")}  # fmt: skip
    assert elements == carried(read_terminals(unpack(native(case)))), "of FMI 2.0"
    names = [terminal.get("name") for terminal in root.iter("Terminal")]
    assert len(names) == (2 if case == DRIVE else 15)  # of a chassis: 7 of each side, and its own motion
    if case == DRIVE:
        assert names == ["mount", "sprocket"]
        assert list(members) == ["position", "orientation", "velocity", "angular_velocity", "force", "torque"]
        assert "<td>mount.orientation[4]</td><td>input</td>" in page


def compile_sources(folder, fmi, platform, *options):
    """Compile the C source of a version of FMI for a platform, with the header of a small component."""
    reals = [*motion_ports("S", "input"), *wrench_ports("S", "output")]
    sizes, sentences = {"x": 1, "n": 0, "f": 1, "k": 1, "z": 1}, dict.fromkeys(("FAILURE", "WARNING", "REFUSED"), ())
    head = f'#define GUID "{"0" * 36}"\n#define SHAPE "shape"\n'
    given = arrays(reals) if fmi == 3 else None
    (folder / "model.h").write_text(head + header(reals, 0, sizes, (), sentences, given))
    command = [*compiler(platform), "-std=c11", "-Werror", f"-I{folder}", f"-I{HERE}", *options, "-c"]
    subprocess.run([*command, str(sources(fmi)[0]), "-o", str(folder / "all.o")], check=True)


@pytest.mark.parametrize("fmi", [2, 3])
def test_the_c_sources_compile_for_windows(fmi, tmp_path):
    """Its headers have names of their own, as GUID; the whole library takes minutes."""
    pytest.importorskip("ziglang")
    compile_sources(tmp_path, fmi, WINDOWS)


def test_all_functions_of_the_standard_are_there_with_their_types(tmp_path):
    """The C source compiles with the standard's headers, which FMPy brings, instead of its own."""
    standard = FMPY / "c-code"
    compile_sources(tmp_path, 3, LINUX, "-DFMI3_H", "-include", str(standard / "fmi3Functions.h"))
    compile_sources(tmp_path, 3, LINUX, "-include", str(standard / "fmi3PlatformTypes.h"))  # declares the same again
    declared = re.findall(r"^FMI3_Export fmi3\w+TYPE\s+(fmi3\w+);", (standard / "fmi3Functions.h").read_text(), re.M)
    assert len(declared) == 75
    library = fmpy.fmi1.cdll.LoadLibrary(str(next(unpack(native3(DRIVE)).glob("binaries/x86_64-linux/*.so"))))
    assert [name for name in declared if not hasattr(library, name)] == []


def test_messages_by_category():
    """An unknown category is refused; errors reach the host whatever it chose, a discarded step is no error."""
    with begun3(DRIVE) as three:
        (torque,) = (variable.valueReference for variable in three.of("input") if variable.name == "sprocket.torque")
        good = three.slave.getFloat64([torque], 3)

        def said():
            three.messages.clear()
            three.slave.setFloat64([torque], [0.0, 1e308, 0.0])
            with pytest.raises(fmpy.fmi1.FMICallException):
                three.slave.doStep(0.0, H)
            three.slave.setFloat64([torque], good)
            three.status("fmi3SetInt64", [three.of("output", "Int64")[0].valueReference], [7], c_int64)
            return [status for status, _ in three.messages]

        assert said() == [DISCARD, ERROR]
        for names, status, heard in (
            (("logStatusWarning", "logEverything"), ERROR, [DISCARD, ERROR]),
            (("logStatusWarning",), OK, [ERROR]),
            (("logStatusDiscard", "logStatusError"), OK, [DISCARD, ERROR]),
            ((), OK, [DISCARD, ERROR]),
        ):
            texts = (c_char_p * len(names))(*(name.encode() for name in names))
            set_logging = three.slave.dll.fmi3SetDebugLogging
            assert set_logging(three.slave.component, True, len(names), texts) == status
            assert said() == heard
        named = etree.parse(unpack(native3(DRIVE)) / "modelDescription.xml").iter("Category")
        assert [each.get("name") for each in named] == ["logStatusWarning", "logStatusDiscard", "logStatusError"]


# --- terminals and arrays ---------------------------------------------------------------------------


def test_304_connections_of_a_vehicle_are_16_pairs_of_terminals():
    assembly = assemble(load("straight"))
    members = {}  # of the terminals of each part: their variables, and the terminal of each
    for part in assembly.parts:
        found = arrays(variables(model_of(part.kind)(part.config).ports).reals)
        ways = [[each.name for each in found if each.elements[0].causality == way] for way in ("input", "output")]
        ports = terminals(part.kind, *ways)
        members[part.name] = {f"{port}.{member}": port for port, own in ports.items() for member in own.members}
    scalar, array, pair = [], set(), set()
    for connection in assembly.connections:
        for output, input_ in zip(connection.outputs, connection.inputs, strict=True):
            ends = (connection.source, output), (connection.target, input_)
            ends_of_array = frozenset((part, name.rpartition(".")[0]) for part, name in ends)
            scalar.append(ends)
            array.add(ends_of_array)
            pair.add(frozenset((part, members[part][name]) for part, name in ends_of_array))
    assert (len(scalar), len(array), len(pair)) == (304, 96, 16)


@pytest.mark.study
def test_a_vehicle_drives_by_16_pairs_of_terminals_to_the_bits_of_304_connections(tmp_path):
    products = scene_products([load("straight")])
    for version in (2, 3):
        build_native_all(products, tmp_path / str(version), fmi=version)
    expected = own_master.main(tmp_path / "2", stop=0.05, speed=20.5, ramp=(0.0, 0.2))
    fmus = plugged_vehicle(tmp_path / "3", "TrackFlexible")
    assert len([*pairs_of_terminals()]) == 16
    for k in range(40):
        for fmu in fmus.values():
            fmu.step(k * 1.25e-3, 1.25e-3, fmu.read())
    x, _, z, speed = fmus["chassis"].show(["chassis.position", "speed"])
    for fmu in fmus.values():
        fmu.slave.freeInstance()
    assert dict(zip(expected, (x, z, speed), strict=True)) == expected
    assert abs(speed) > 0.01


def test_reals_that_differ_stay_scalars():
    xyz = [Port(f"start.position.{axis}", "parameter", "m", f"{axis} of it") for axis in "xyz"]
    (array,) = arrays(xyz)
    assert (array.name, array.text, array.shape) == ("start.position", "x, y, z of it", (3,))
    for changed in ({"causality": "local"}, {"unit": "1"}, {"allowed": NOT_NEGATIVE}):
        apart = [(each.name, each.first, each.shape) for each in arrays([*xyz[:2], xyz[2]._replace(**changed)])]
        assert apart == [(port.name, i, ()) for i, port in enumerate(xyz)]
    assert [array.name for array in arrays(xyz[:2])] == [port.name for port in xyz[:2]]


@pytest.mark.parametrize("group", GROUPS)
def test_outputs_of_links_are_arrays(group):
    links, of = link_outputs.ports((group,), 4, 5), GROUPS[group]
    (array,) = arrays(links)
    assert array.name == f"{of.owner}.{of.signal}"
    assert array.shape == (4 if of.owner == "link" else 5, *([len(of.parts)] if len(of.parts) > 1 else []))
    assert (array.first, array.elements) == (0, tuple(links))
    assert "1" not in array.text
