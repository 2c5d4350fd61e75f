"""SSP archives of scenes: valid, complete, and run by other tools."""

import io
import re
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path
from xml.etree.ElementTree import fromstring

import fmpy.ssp
import numpy as np
import pytest
from fmpy.ssp.simulation import simulate_ssp
from fmpy.ssp.ssd import read_ssd
from lxml import etree

from fmus.vehicles.tables import BadInput
from orchestrator.cli import main
from orchestrator.execution.simulate import simulate
from orchestrator.log.reader import Log
from orchestrator.scene.assembly import assemble
from orchestrator.scene.placing import placed
from orchestrator.scene.products import _page, write_ssp
from orchestrator.scene.scene import load

ROOT = Path(__file__).parents[2]
SCHEMAS = Path(fmpy.ssp.__file__).parent / "schema"
NAMESPACES = {name: f"http://ssp-standard.org/SSP1/SystemStructure{full}"
              for name, full in (("ssd", "Description"), ("ssc", "Common"), ("ssv", "ParameterValues"))}  # fmt: skip


@pytest.fixture(scope="module")
def rig(tmp_path_factory):
    """Archive of the rig with rigid links and FMUs that run in Python."""
    file = tmp_path_factory.mktemp("ssp") / "rig.ssp"
    write_ssp(load("rig", "rigid", ["run.stop=1.5 s"]), file, native=False)
    return file


@pytest.fixture(scope="module")
def structure(rig):
    with zipfile.ZipFile(rig) as archive:
        return etree.fromstring(archive.read("SystemStructure.ssd"))


def schema(name):
    return etree.XMLSchema(etree.parse(str(SCHEMAS / f"SystemStructure{name}.xsd")))


def test_structure_and_values_are_valid(structure):
    description, values = schema("Description"), schema("ParameterValues")
    description.assertValid(structure)
    sets = structure.findall(".//ssv:ParameterSet", NAMESPACES)
    assert [one.get("name") for one in sets] == ["rig"] * 3  # some tools take the sets of one name
    for one in sets:
        values.assertValid(etree.ElementTree(one))
    structure.find(".//ssd:Connector", NAMESPACES).set("kind", "entrance")
    assert not description.validate(structure)
    structure.find(".//ssd:Connector", NAMESPACES).set("kind", "input")


def test_connections_connectors_and_values_are_those_of_the_scene(rig, structure):
    assembly = assemble(placed(load("rig", "rigid")))
    wanted = {
        (connection.source, output, connection.target, into)
        for connection in assembly.connections
        for output, into in zip(connection.outputs, connection.inputs, strict=True)
    }
    ends = ("startElement", "startConnector", "endElement", "endConnector")
    found = [
        tuple(connection.get(end) for end in ends) for connection in structure.findall(".//ssd:Connection", NAMESPACES)
    ]
    assert len(found) == len(wanted) == 38
    assert set(found) == wanted
    inputs = {pair[2:] for pair in wanted}
    for part in assembly.parts:
        component = structure.find(f".//ssd:Component[@name='{part.name}']", NAMESPACES)
        with zipfile.ZipFile(rig) as archive:
            fmu = zipfile.ZipFile(io.BytesIO(archive.read(component.get("source"))))
        variables = {v.get("name"): v for v in fromstring(fmu.read("modelDescription.xml")).iter("ScalarVariable")}
        connectors = component.findall(".//ssd:Connector", NAMESPACES)
        assert {c.get("name") for c in connectors} == {
            name for name, variable in variables.items()
            if (part.name, name) in inputs
            or (variable.get("causality") in ("output", "parameter") and not name.startswith(("link[", "joint[")))
        }  # fmt: skip
        for connector in connectors:
            variable = variables[connector.get("name")]
            assert connector.get("kind") == variable.get("causality")
            assert etree.QName(connector[0]).localname == variable[0].tag
            assert connector[0].get("unit") == variable[0].get("unit")
        values = component.findall(".//ssv:Parameter", NAMESPACES)
        given = {value.get("name"): value[0].get("value") for value in values}
        assert given == {
            name: variable[0].get("start") for name, variable in variables.items()
            if variable.get("causality") == "parameter"
        }  # fmt: skip
        own = {name: value for name, value in part.parameters.items() if name != "link_outputs.interval"}
        assert own == {name: type(value)(given[name]) for name, value in own.items()}
    experiment = structure.find("ssd:DefaultExperiment", NAMESPACES)
    assert float(experiment.get("stopTime")) == 1.5


def test_equal_scenes_give_equal_bytes(rig, tmp_path):
    write_ssp(load("rig", "rigid", ["run.stop=1.5 s"]), tmp_path / "again.ssp", native=False)
    assert (tmp_path / "again.ssp").read_bytes() == rig.read_bytes()


def test_fmpy_runs_the_rig(rig):
    """The runner of FMPy exchanges values for the first time after its first step: it begins with zeros."""
    rows = simulate_ssp(str(rig), stop_time=0.02, step_size=1e-3)
    assert len(rows) >= 20
    tension = rows["track.tension.mean"]
    assert np.ptp(tension) < 1e-3 * tension[0]
    assert tension[-1] == pytest.approx(15000.0, rel=0.05)


def script_of_page(tool):
    """Script of fmus/tools.md for a tool."""
    page = (ROOT / "fmus" / "tools.md").read_text(encoding="utf-8")
    return re.search(rf"^## {tool}$.*?^```python\n(.*?)^```$", page, re.DOTALL | re.MULTILINE)[1]


def test_the_script_for_fmpy_runs(rig, tmp_path, monkeypatch, capsys):
    shutil.copy(rig, tmp_path / "vehicle.ssp")
    monkeypatch.chdir(tmp_path)
    exec(compile(script_of_page("FMPy"), "tools.md", "exec"), {})
    tension, time = re.fullmatch(r"track\.tension\.mean = (\d+) N at (\S+) s\n", capsys.readouterr().out).groups()
    assert float(tension) == pytest.approx(15000, rel=0.05)
    assert time == "0.100"


def test_a_title_is_no_html():
    page = _page(load("rig", "rigid").model_copy(update={"title": "<script>A & B</script>"}), []).decode()
    assert "&lt;script&gt;A &amp; B&lt;/script&gt;" in page
    assert "<script" not in page


def test_bad_files_are_refused_before_anything_is_built(monkeypatch, capsys, tmp_path):
    with pytest.raises(BadInput, match="there is no folder"):
        write_ssp(load("rig", "rigid"), tmp_path / "none" / "rig.ssp")
    monkeypatch.setattr(sys, "argv", ["cotrack", "ssp", "rig", "-o", str(tmp_path / "rig.zip")])
    with pytest.raises(SystemExit) as ended:
        main()
    assert ended.value.code == 2
    assert capsys.readouterr().err.endswith("rig.zip: the name of the archive must end in .ssp\n")
    assert list(tmp_path.iterdir()) == []


@pytest.fixture(scope="module")
def vehicle(tmp_path_factory):
    """Archive of a vehicle that turns, with rigid links and FMUs that run in Python."""
    file = tmp_path_factory.mktemp("ssp") / "vehicle.ssp"
    write_ssp(load("turn", "rigid", ["run.stop=0.1 s"]), file, native=False)
    return file


@pytest.mark.long
@pytest.mark.parametrize(("tool", "package"), [("libcosim", "libcosimpy"), ("Ecos", "ecospy")])
def test_a_host_exchanges_as_jacobi_with_held_inputs(tool, package, vehicle, environment, tmp_path):
    """The script of the page gives the numbers of the coupling that it names; needs the package of the tool."""
    pytest.importorskip(package)
    shutil.copy(vehicle, tmp_path)
    script = script_of_page(tool).replace("(4000)", "(50)")
    done = subprocess.run([sys.executable, "-c", script], cwd=tmp_path, env=environment, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    shown = [float(number) for number in re.findall(r"-?\d+\.\d+(?:e-?\d+)?", done.stdout.splitlines()[-1])]
    settings = ["run.stop=0.05 s", "run.step=1 ms", 'run.coupling={scheme="jacobi", hold="constant"}']
    simulate(load("turn", "rigid", settings), tmp_path / "jacobi.mcap")
    with Log(tmp_path / "jacobi.mcap") as log:
        ours = [log.signal(f"chassis.{name}")[1][-1] for name in ("chassis.position.x", "speed")]
    assert shown == pytest.approx(ours, rel=1e-9)


OTHER = {
    "chassis.mass": 6000.0, "chassis.inertia": [1.8e3, 1.1e4, 1.1e4], "gravity": 9.7, "suspension.stiffness": 9e5,
    "suspension.damping": 1.4e4, "tensioner.stiffness": 9e5, "contact.ground.friction": 0.5,
    "contact.wheel.friction": 0.25, "contact.sprocket.friction": 0.2, "contact.wheel.stiffness": 2e6,
}  # fmt: skip


@pytest.fixture(scope="module")
def other(vehicle, tmp_path_factory):
    """Archive of another vehicle of the same shapes, and one with the first one's FMUs and the document of this one."""
    folder = tmp_path_factory.mktemp("ssp")
    settings = [f"vehicle.{key}={value}" for key, value in OTHER.items()]
    write_ssp(load("turn", "rigid", ["run.stop=0.1 s", *settings]), folder / "own.ssp", native=False)
    with (
        zipfile.ZipFile(folder / "own.ssp") as own,
        zipfile.ZipFile(vehicle) as first,
        zipfile.ZipFile(folder / "set.ssp", "w", zipfile.ZIP_DEFLATED) as mixed,
    ):
        for name in first.namelist():
            mixed.writestr(name, (own if name == "SystemStructure.ssd" else first).read(name))
    return folder


@pytest.mark.long
def test_a_document_makes_another_vehicle_of_fmus_of_its_shapes(vehicle, other, tmp_path, cotrack):
    rows = []
    for file in (vehicle, other / "own.ssp", other / "set.ssp"):
        with zipfile.ZipFile(file) as archive, zipfile.ZipFile(tmp_path / file.name, "w") as bare:
            for name in archive.namelist():
                if name != "resources/scene.json":  # by which cotrack would step it
                    bare.writestr(name, archive.read(name))
        log = tmp_path / f"{file.stem}.mcap"
        cotrack.done("run", tmp_path / file.name, "--log", log, "--stop", "0.02", "--step", "1ms")
        with Log(log) as read:
            rows.append([read.signal(f"chassis.{name}")[1] for name in ("chassis.position.z", "speed", "pitch")])
    assert np.array_equal(rows[1], rows[2])
    assert not np.array_equal(rows[0], rows[1])


@pytest.mark.long
@pytest.mark.parametrize(("tool", "package"), [("libcosim", "libcosimpy"), ("Ecos", "ecospy")])
def test_a_host_applies_the_sets_to_all_components(tool, package, vehicle, other, environment, tmp_path):
    """The set of another vehicle makes it of these FMUs, to the bit; Ecos takes the name of the set."""
    pytest.importorskip(package)
    script = script_of_page(tool).replace("(4000)", "(20)").replace(".init()", '.init(parameter_set="turn")')
    said = []
    for file in (vehicle, other / "own.ssp", other / "set.ssp"):
        folder = tmp_path / file.stem
        folder.mkdir()
        shutil.copy(file, folder / "vehicle.ssp")
        done = subprocess.run(
            [sys.executable, "-c", script], cwd=folder, env=environment, capture_output=True, text=True
        )
        assert done.returncode == 0, done.stderr
        said.append(done.stdout.splitlines()[-1])
    assert said[1] == said[2] != said[0]


@pytest.mark.long
def test_every_side_of_a_vehicle_has_its_place(vehicle):
    """A tool that ignores the parameter values of the archive drives the whole vehicle, not half of it."""
    assert len(read_ssd(str(vehicle)).system.connections) == 304
    rows = simulate_ssp(str(vehicle), stop_time=0.05, step_size=1e-3)
    for side, lateral in (("left", 1.0795), ("right", -1.0795)):
        for part in ("track", "drive"):
            with zipfile.ZipFile(vehicle) as archive:
                fmu = zipfile.ZipFile(io.BytesIO(archive.read(f"resources/{side}_{part}.fmu")))
            root = fromstring(fmu.read("modelDescription.xml"))
            assert float(root.find(".//ScalarVariable[@name='start.lateral']/Real").get("start")) == lateral
    assert rows["chassis.chassis.position.z"][-1] == pytest.approx(0.3758, abs=1e-3)
    assert rows["chassis.chassis.position.y"][-1] == pytest.approx(0.0, abs=1e-6)
    assert rows["left_track.tension.mean"][-1] == pytest.approx(rows["right_track.tension.mean"][-1], rel=1e-2)
