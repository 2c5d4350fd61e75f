"""FMUs of FMI 3.0 against those of FMI 2.0 that have the same kernels, in FMPy."""

from __future__ import annotations

import re
import subprocess
from contextlib import contextmanager
from ctypes import byref, c_bool, c_double, c_int32, c_int64, c_uint32
from itertools import product
from pathlib import Path

import fmpy
import numpy as np
import pytest
from fmpy import read_model_description, simulate_fmu
from fmpy.fmi3 import FMU3Slave
from fmpy.validation import validate_fmu
from lxml import etree
from native_cases import CHAIN, CHASSIS, DRIVE, H, begun, follow, ran

from fmus.components import model_of
from fmus.interface.ports import NOT_NEGATIVE, Port, motion_ports, variables, wrench_ports
from fmus.native.arrays import arrays
from fmus.native.fmi3_description import TERMINALS, terminals
from fmus.native.header import header
from fmus.native.link import HERE, compiler
from fmus.native.pack import build_native, with_constants
from fmus.track import link_outputs
from fmus.track.link_outputs import GROUPS
from orchestrator.cosim.fmu_files import unpack
from orchestrator.scene.assembly import assemble, build_native_all
from orchestrator.scene.products import scene_products
from orchestrator.scene.scene import load
from tests import own_master

FMPY = Path(fmpy.__file__).parent
OK, DISCARD, ERROR = 0, 2, 3


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
        for kind, set_ in (("Float64", self.slave.setFloat64), ("String", self.slave.setString)):
            for variable in self.of("parameter", kind):
                names = scalars(variable)
                if values := [parameters[name] for name in names if name in parameters]:
                    assert len(values) == len(names)
                    set_([variable.valueReference], values)
        self.slave.enterInitializationMode()
        self.slave.exitInitializationMode()
        return self

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
            assert three.messages[-1] == (ERROR, said)
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
    head = '#define GUID "guid"\n#define SHAPE "shape"\n'
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
    names = {v.name for v in read_model_description(native3(DRIVE)).modelVariables if v.causality == "parameter"}
    values = {name: value for name, value in ran(DRIVE).part.parameters.items() if name in names}
    shown = ["sprocket.position", "speed"]
    result = simulate_fmu(native3(DRIVE), stop_time=0.01, output_interval=1e-3, start_values=values, output=shown)
    assert result["time"][-1] == pytest.approx(0.01)
    assert result["sprocket.position"].shape == (11, 3)
    assert np.ptp(result["speed"]) > 0.0


def test_304_connections_of_a_vehicle_are_16_pairs_of_terminals():
    assembly = assemble(load("straight"))
    members = {}  # of the terminals of each part: their variables, and the terminal of each
    for part in assembly.parts:
        found = terminals(arrays(variables(model_of(part.kind)(part.config).ports).reals))
        members[part.name] = {f"{port}.{member}": port for port, own in found.items() for member in own}
    scalar, array, pair = [], set(), set()
    for connection in assembly.connections:
        for output, input_ in zip(connection.outputs, connection.inputs, strict=True):
            ends = (connection.source, output), (connection.target, input_)
            ends_of_array = frozenset((part, name.rpartition(".")[0]) for part, name in ends)
            scalar.append(ends)
            array.add(ends_of_array)
            pair.add(frozenset((part, members[part][name]) for part, name in ends_of_array))
    assert (len(scalar), len(array), len(pair)) == (304, 96, 16)


class Plugged(Three):
    """Instance whose terminals are connected by the rule "plug": members by name, outputs to inputs."""

    def __init__(self, file):
        super().__init__(file)
        self.variables = {v.name: v for v in self.description.modelVariables}
        root = etree.parse(unpack(file) / "terminalsAndIcons/terminalsAndIcons.xml")
        self.terminals = {t.get("name"): {m.get("memberName"): m.get("variableName") for m in t} for t in
                          root.iter("Terminal")}  # fmt: skip
        self.feeds = []

    def plug(self, terminal, other, others):
        ours, theirs = self.terminals[terminal], other.terminals[others]
        assert ours.keys() == theirs.keys()
        for member in ours:
            mine, its = self.variables[ours[member]], other.variables[theirs[member]]
            assert {mine.causality, its.causality} == {"input", "output"}
            taker, to, giver, of = (self, mine, other, its) if mine.causality == "input" else (other, its, self, mine)
            taker.feeds.append((to.valueReference, giver.slave, of.valueReference, of.shape[0]))

    def read(self):
        """Values for all connected inputs."""
        return [(to, giver.getFloat64([of], size)) for to, giver, of, size in self.feeds]

    def step(self, t, h, values):
        for to, each in values:
            self.slave.setFloat64([to], each)
        self.slave.doStep(t, h)

    def show(self, names):
        """Values of outputs, in a row."""
        found = [self.variables[name] for name in names]
        return self.slave.getFloat64([v.valueReference for v in found], sum(len(scalars(v)) for v in found))


SIDES = ("left", 1.0), ("right", -1.0)
PROFILE = {"speed.end": 20.5, "ramp.start": 0.0, "ramp.end": 0.2}
WHEELS = *(f"road_wheel[{i}]" for i in range(1, 6)), "idler"


def parts_of_a_vehicle():
    """Parts in the order of their steps: their kinds, and the parameters that are not the FMU's defaults."""
    parts = {}
    for part, kind, more in (("track", "Track", {}), ("drive", "SprocketDrive", PROFILE)):
        for side, sign in SIDES:
            parts[f"{side}_{part}"] = kind, {"start.lateral": sign * 1.0795, **more}
    return parts | {"chassis": ("Chassis", {})}


def pairs_of_terminals():
    """Pairs that are connected: part and terminal, part and terminal."""
    for side, _ in SIDES:
        track, drive = f"{side}_track", f"{side}_drive"
        yield track, "sprocket", drive, "sprocket"
        yield drive, "mount", "chassis", f"{side}.sprocket"
        yield from ((track, wheel, "chassis", f"{side}.{wheel}") for wheel in WHEELS)


def plugged_vehicle(folder, track):
    """Parts of a vehicle, connected by terminals and initialised."""
    parts = parts_of_a_vehicle()
    kinds = {name: track if kind == "Track" else kind for name, (kind, _) in parts.items()}
    fmus = {name: Plugged(folder / f"{kind}.fmu") for name, kind in kinds.items()}
    for one, terminal, other, others in pairs_of_terminals():
        fmus[one].plug(terminal, fmus[other], others)
    for name, (_, values) in parts.items():
        for parameter, value in values.items():
            fmus[name].slave.setFloat64([fmus[name].variables[parameter].valueReference], [value])
        fmus[name].start({})
    return fmus


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
        apart = arrays([*xyz[:2], xyz[2]._replace(**changed)])
        assert [(array.name, array.first, array.shape) for array in apart] == [
            (port.name, i, ()) for i, port in enumerate(xyz)
        ]
    assert [array.name for array in arrays(xyz[:2])] == [port.name for port in xyz[:2]]


@pytest.mark.parametrize("group", GROUPS)
def test_outputs_of_links_are_arrays(group):
    links = link_outputs.ports((group,), 4, 5)
    of = GROUPS[group]
    (array,) = arrays(links)
    assert array.name == f"{of.owner}.{of.signal}"
    assert array.shape == (4 if of.owner == "link" else 5, *([len(of.parts)] if len(of.parts) > 1 else []))
    assert (array.first, array.elements) == (0, tuple(links))
    assert "1" not in array.text
