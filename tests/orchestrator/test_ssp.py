"""SSP archives: those of scenes are valid, complete, and run by other tools; ours run them and those of others."""

import io
import json
import re
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path
from xml.etree.ElementTree import fromstring

import fmpy.ssp
import foreign_fmus
import numpy as np
import pytest
from fmpy.ssp.simulation import simulate_ssp
from fmpy.ssp.ssd import read_ssd
from lxml import etree
from ssd_texts import LAG, START, T1, T2, packed_lags

from fmus.fmi.terminals import FILE
from fmus.vehicles.tables import BadInput
from orchestrator.execution.simulate import simulate
from orchestrator.execution.summary import LARGEST_RESIDUAL, verdict
from orchestrator.execution.summary_text import lines
from orchestrator.log.reader import Log
from orchestrator.results.run_data import RunData
from orchestrator.scene.assembly import assemble
from orchestrator.scene.kinds import Scene
from orchestrator.scene.placing import placed
from orchestrator.scene.products import write_ssp
from orchestrator.scene.replacement import ends_of, quantity, staged
from orchestrator.scene.scene import load, load_any
from orchestrator.scene.ssp_scene import load_ssp
from orchestrator.scene.system_scene import FreeScene

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


def rewritten(file, target, **changes):
    """Copy of an archive with other contents by name, or without a file; / and . are _ in a name."""
    with zipfile.ZipFile(file) as source, zipfile.ZipFile(target, "w", zipfile.ZIP_DEFLATED) as copy:
        for name in source.namelist():
            change = changes.get(re.sub(r"\W", "_", name), lambda content: content)
            if (content := change(source.read(name))) is not None:
                copy.writestr(name, content)
    return target


NO_SCENE = {"resources_scene_json": lambda content: None}  # by which cotrack would step it


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


def test_equal_scenes_give_equal_bytes_and_a_title_is_no_html(rig, tmp_path):
    write_ssp(load("rig", "rigid", ["run.stop=1.5 s"]), tmp_path / "again.ssp", native=False)
    assert (tmp_path / "again.ssp").read_bytes() == rig.read_bytes()
    titled = load("rig", "rigid").model_copy(update={"title": "<script>A & B</script>"})
    write_ssp(titled, tmp_path / "titled.ssp", native=False)
    with zipfile.ZipFile(tmp_path / "titled.ssp") as archive:
        page = archive.read("documentation/index.html").decode()
    assert "&lt;script&gt;A &amp; B&lt;/script&gt;" in page
    assert "<script" not in page


def script_of_page(tool):
    """Script of fmus/in_your_tool.md for a tool."""
    page = (ROOT / "fmus" / "in_your_tool.md").read_text(encoding="utf-8")
    return re.search(rf"^### {tool}$.*?^```python\n(.*?)^```$", page, re.DOTALL | re.MULTILINE)[1]


def test_the_script_for_fmpy_runs(rig, tmp_path, monkeypatch, capsys):
    shutil.copy(rig, tmp_path / "vehicle.ssp")
    monkeypatch.chdir(tmp_path)
    exec(compile(script_of_page("FMPy"), "in_your_tool.md", "exec"), {})
    tension, time = re.fullmatch(r"track\.tension\.mean = (\d+) N at (\S+) s\n", capsys.readouterr().out).groups()
    assert float(tension) == pytest.approx(15000, rel=0.05)
    assert time == "0.100"


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
    with zipfile.ZipFile(folder / "own.ssp") as own:
        document = own.read("SystemStructure.ssd")
    rewritten(vehicle, folder / "set.ssp", SystemStructure_ssd=lambda content: document)
    return folder


@pytest.mark.long
def test_a_document_makes_another_vehicle_of_fmus_of_its_shapes(vehicle, other, tmp_path, cotrack):
    rows = []
    for file in (vehicle, other / "own.ssp", other / "set.ssp"):
        rewritten(file, tmp_path / file.name, **NO_SCENE)
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


# --- runs by cotrack ----------------------------------------------------------------------------------

SHORT = {"run.stop": "20 ms", "expect": {}}


@pytest.fixture(scope="module")
def lag(tmp_path_factory):
    return foreign_fmus.build(tmp_path_factory.mktemp("lag") / "lag.fmu", "lag", LAG)


@pytest.fixture(scope="module")
def chain(tmp_path_factory):
    """Archive of a hanging chain."""
    file = tmp_path_factory.mktemp("chain") / "chain.ssp"
    write_ssp(load("hanging_chain", "rigid", SHORT), file, native=False)
    return file


def digest(scene, path):
    summary = simulate(scene, path)
    assert summary["status"] == "ok", summary["message"]
    with Log(path) as log:
        return log.digest()


def test_an_archive_of_ours_gives_the_records_of_its_scene(chain, tmp_path):
    assert load_ssp(chain, None, ()).name == "hanging_chain"
    for settings in ({}, {"run.stop": "10 ms"}):
        own = digest(load("hanging_chain", "rigid", SHORT | settings), tmp_path / "own.mcap")
        assert digest(load_ssp(chain, None, settings), tmp_path / "ssp.mcap") == own


def test_an_edited_archive_has_its_own_values_times_and_parts(chain, tmp_path, caplog):
    """Start and stop are those of the DefaultExperiment; with other parts it is a free system, and says so."""

    def edited(old, new):
        def change(text):
            assert old in text
            return text.replace(old, new, 1)

        return rewritten(chain, tmp_path / "edited.ssp", SystemStructure_ssd=change)

    for file, given in ((chain, []), (edited(b'value="0.0"', b'value="0.25"'), [0.25])):
        (table,) = load_ssp(file, None, ()).fmu.values()
        assert list(table.parameters.values()) == given
    later = edited(b'startTime="0.0" stopTime="0.02"', b'startTime="1.0" stopTime="1.01"')
    scene = load_ssp(later, None, [])
    assert isinstance(scene, Scene)
    assert (scene.run.start, scene.run.stop) == (1.0, pytest.approx(0.01))
    assert simulate(scene, tmp_path / "edited.mcap")["status"] == "ok"
    with Log(tmp_path / "edited.mcap") as log:
        assert RunData(log).span == pytest.approx((0.0, 0.01))
    assert load_ssp(later, None, ["run.stop=5 ms"]).run.stop == 5e-3
    assert not caplog.messages
    assert isinstance(load_ssp(edited(b'name="chain"', b'name="links"'), None, ()), FreeScene)
    (message,) = caplog.messages
    assert message.endswith("edited.ssp': parts or connections are not those of its scene: it runs as a free system")


@pytest.mark.long
def test_an_archive_of_others_is_a_free_system(lag, tmp_path):
    """Two first-order systems: the exact solution, with an error of order 2 in the communication step."""
    file, errors = packed_lags(tmp_path / "lags.ssp", lag), []
    rate, level, gap = 1 / T1 + 1 / T2, T1 * START / (T1 + T2), START * T2 / (T1 + T2)
    for step in (4e-3, 2e-3, 1e-3):
        summary = simulate(load_ssp(file, None, {"run.step": step}), tmp_path / "lags.mcap", estimated=True)
        assert summary["status"] == "ok"
        assert (summary["energy"], summary["error"]) == (None, None)
        assert "  energy balance     none: the log holds no energies" in lines(summary)
        with Log(tmp_path / "lags.mcap") as log:
            t, x = log.signal("a.x")
            assert RunData(log).scene == {}
            assert set(log.topics) == {f"/{kind}" for kind in ("a/in", "a/out", "b/in", "b/out", "stats/a", "stats/b")}
        errors.append(np.abs(x - level - gap * np.exp(-rate * t)).max())
    assert errors[-1] < 1e-4
    assert np.log2(np.array(errors[:-1]) / errors[1:]) == pytest.approx(2.0, abs=0.1)


@pytest.mark.long
def test_commands_on_a_free_system(lag, cotrack, tmp_path):
    packed_lags(tmp_path / "lags.ssp", lag)
    out = cotrack.done("show", "lags.ssp")
    lines = {
        "  1 s in 1000 steps of 1 ms, tracks_first",
        f"  a.T = {T1}",
        f"  b.T = {T2}",
        "  a.x -> b.u",
        "  b.x -> a.u",
    }
    assert lines <= {*out.splitlines()}
    assert out.count("/resources/lag.fmu; 1 values in, 1 out a step, stage 0\n") == 2
    out = cotrack.done("run", "lags.ssp", "--stop", "0.2 s", "--step", "2 ms", "-o", "logs/lags.mcap")
    assert out.startswith(
        "t: ok\n  energy balance     none: the log holds no energies\n  run time           0.2 s simulated in "
    )
    assert cotrack("plot", "logs/lags.mcap", "a.x", "-o", "a.png")[0] == 0
    assert cotrack("log", "verify", "logs/lags.mcap")[0] == 0
    assert cotrack("replay", "logs/lags.mcap", "--component", "a", "--with", lag)[0] == 0
    status, out, _ = cotrack("compare", "logs/lags.mcap", "logs/lags.mcap", "--different", "--bits")
    assert (status, out.splitlines()[-1]) == (0, "bit by bit equal: 402 numbers, to t = 0.2 s")
    for command, said in (
        (("replay", "logs/lags.mcap"), "'a' was an FMU of the user"),
        (("run", "lags.ssp", "--replace", "c=x.fmu"), "fmu.c: no such component: the components are a, b"),
        (("sweep", "lags.ssp", "--vary", "run.step=0.001", "-o", "x"), "an SSP archive can be run and shown"),
        (("ssp", "lags.ssp", "-o", "x.ssp"), "lags.ssp': an SSP archive can be run and shown; here a scene is needed"),
    ):
        status, _, err = cotrack(*command)
        assert (status, said in err) == (2, True), err
    for command in (("analyse", "logs/lags.mcap", "power"), ("view", "logs/lags.mcap"), ("resume", "logs/lags.mcap")):
        status, _, err = cotrack(*command)
        assert (status, len(err.splitlines())) == (2, 1), (command, err)


def test_a_free_system_in_a_scene_file(lag, tmp_path, cotrack):
    text = f"""title = "Two lags"
assembly = "fmus"
connections = ["a.x -> b.u", "b.x -> a.u"]
run = {{ stop = "0.2 s", step = "1 ms" }}
[fmu.a]
file = "lag.fmu"
parameters = {{ T = {T1}, start = {START} }}
[fmu.b]
file = "lag.fmu"
parameters = {{ T = {T2} }}
stage = 1
[expect]
level = {{ signal = "a.x", reduce = "last", expected = 1.3856, tolerance = 0.001 }}
"""
    (tmp_path / "lag.fmu").write_bytes(lag.read_bytes())
    (tmp_path / "lags.toml").write_text(text)
    status, out, _ = cotrack("run", "lags.toml")
    assert (status, "1 of 1 checks are met" in out) == (0, True), out
    scene = load_any("lags.toml")
    assert isinstance(scene, FreeScene)
    assert not isinstance(scene, Scene)
    cases = (
        ("connections.0=a.x", "connections: 'a.x': must be 'instance.output -> instance.input'"),
        ("connections.0=c.x -> b.u", "no component 'c': there are a, b"),
        ("connections.1=a.x -> b.u", "the input has another connection"),
        ("connections.0=a.y -> b.u", "it has no output 'y', which goes to b.u"),
        ("vehicle=m113", "unknown key 'vehicle'"),
        ("expect.level.signal=c.x", "no component 'c': there are a, b"),
    )
    for setting, said in cases:
        err = cotrack.refused("run", "lags.toml", "--set", setting)
        assert said in err, err
        assert len(err.splitlines()) == 1
    sweep = "sweep", "lags.toml", "--vary", "run.step=0.001", "-o", "x"
    for command in (("truth", "lags.toml"), ("ssp", "lags.toml", "-o", "x.ssp"), sweep):
        status, _, err = cotrack(*command)
        assert (status, "here a scene with a track is needed" in err) == (2, True), err


def test_files_of_an_archive_stay_in_it(lag, chain, tmp_path):
    with pytest.raises(BadInput, match="it holds a file outside of it"):
        load_ssp(packed_lags(tmp_path / "lags.ssp", lag, **{"../up": ""}), None, ())
    with pytest.raises(BadInput, match="there is no SSP archive"):
        load_ssp(tmp_path / "none.ssp", None, ())
    with pytest.raises(BadInput, match=r"it has no SystemStructure\.ssd"):
        load_ssp(lag, None, ())
    with pytest.raises(BadInput, match="track = 'rigid': the FMUs of an archive are as they are"):
        load_ssp(chain, "rigid", ())
    with pytest.raises(BadInput, match=r"vehicle\.track\.mass: the FMUs of an archive are as they are"):
        load_ssp(chain, None, ["vehicle.track.mass=3"])
    table = load("hanging_chain", "rigid", {"fmu.chain.file": "/elsewhere.fmu"}).resolved() | {"placed": True}
    rewritten(chain, tmp_path / "own.ssp", resources_scene_json=lambda content: json.dumps(table))
    (fmu,) = load_ssp(tmp_path / "own.ssp", None, ()).fmu.values()
    assert fmu.file.endswith("/resources/chain.fmu")


def test_messages_about_an_archive_begin_with_it(chain, tmp_path):
    """Also later ones: of its FMUs, its checks, and a changed scene."""
    where = f"'{chain}': "
    for change, call in (
        ({"fmu.chain.file": "none.fmu"}, lambda scene: simulate(scene, tmp_path / "chain.mcap")),
        (
            {"expect.a": {"signal": "b.x", "expected": 0, "tolerance": 1}},
            lambda scene: simulate(scene, tmp_path / "c.mcap"),
        ),
        ({}, lambda scene: scene.changed({"run.step": "2 ms"}).changed({"run.stap": 1})),
        ({}, lambda scene: scene.require_own_parts("a test needs")),
    ):
        with pytest.raises(BadInput) as caught:
            call(load_ssp(chain, None, change))
        assert str(caught.value).startswith(where), caught.value


def test_an_archive_of_ours_is_shown(chain, cotrack):
    out = cotrack.done("show", chain)
    assert "\n  chain        FMU /" in out
    assert "left out\n" in out
    assert "contact pairs" not in out, "what FMUs of the user evaluate is not known"


# --- free systems of our own FMUs -------------------------------------------------------------------


def unmarked(content):
    """FMU of another tool without terminals."""
    made = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(content)) as source, zipfile.ZipFile(made, "w") as copy:
        for name in (name for name in source.namelist() if name != FILE):
            copy.writestr(name, source.read(name).replace(b'generationTool="cotrack', b'generationTool="other'))
    return made.getvalue()


def turned(content):
    """System structure with its components and connections in the opposite order."""
    root = etree.fromstring(content)
    for group in ("Elements", "Connections"):
        (parent,) = root.findall(f".//ssd:{group}", NAMESPACES)
        parent[:] = reversed(parent)
    return etree.tostring(root)


def steps_of(file, path):
    """Recorded inputs and outputs by topic, and the summary."""
    result = simulate(load_ssp(file, None, {"run.step": "4 ms", "run.stop": "0.1 s"}), path)
    assert result["status"] == "ok"
    with Log(path) as log:
        return {topic: log.read(topic).values for topic in log.topics if topic.endswith(("/in", "/out"))}, result


@pytest.mark.long
def test_a_free_system_has_the_bits_of_its_scene(rig, tmp_path):
    """In any order, and with one FMU of others, which is told; without any mark it has not."""
    own, _ = steps_of(rig, tmp_path / "own.mcap")
    parts = [f"resources_{part}_fmu" for part in ("drive", "idler_drive", "track")]
    ways = {"turned": {"SystemStructure_ssd": turned}, "partial": {parts[0]: unmarked}}
    for name, changes in (ways | {"foreign": dict.fromkeys(parts, unmarked)}).items():
        file = rewritten(rig, tmp_path / f"{name}.ssp", **NO_SCENE | changes)
        found, result = steps_of(file, tmp_path / f"{name}.mcap")
        assert all(np.array_equal(values, found[topic]) for topic, values in own.items()) == (name != "foreign"), name
        said = [(warning["component"], warning["text"].partition(":")[0]) for warning in result["warnings"]]
        assert said == [("drive", "no terminal marks its outputs to track.sprocket")] * (name == "partial")


@pytest.mark.parametrize("scene", ["straight", "differential", "serpentine", "rig"])
def test_terminals_tell_all_connections_and_the_order_of_a_scene(scene):
    """They tell what is carried, and who steps before whom; a stage that a user gives stays."""
    assembly = assemble(load(scene))
    ends = ends_of(assembly.parts, {})
    for one in assembly.connections:
        for output, into in zip(one.outputs, one.inputs, strict=True):
            assert quantity(ends[one.source][output], ends[one.target][into], into) == one.carries
    parts = staged(assembly.parts, assembly.connections, ends, dict.fromkeys(ends))
    order = {part.name: part.stage for part in parts}
    for one in (one for one in assembly.connections if one.carries == "mean"):
        assert order[one.source] < order[one.target]
    assert {order[part.name] for part in assembly.parts if part.stage <= 0} == {0}
    last = parts[-1].name
    given = staged(assembly.parts, assembly.connections, ends, dict.fromkeys(ends) | {last: 7})
    assert {part.name: part.stage for part in given}[last] == 7


@pytest.mark.long
def test_a_vehicle_at_rest_is_in_balance_unless_its_exchange_swings(tmp_path):
    """With values of the last step a standing m113 loses next to nothing; extrapolated over long steps, it swings."""
    write_ssp(load("straight", "rigid"), tmp_path / "own.ssp", native=False)
    rewritten(tmp_path / "own.ssp", tmp_path / "rest.ssp", **NO_SCENE)
    for step, hold, closed in (("1 ms", "constant", True), ("2 ms", "constant", True), ("10 ms", "linear", False)):
        run = {"run.stop": "0.1 s", "run.step": step, "run.coupling": {"scheme": "jacobi", "hold": hold}}
        scene = load_ssp(tmp_path / "rest.ssp", None, run)
        result = simulate(scene, tmp_path / "rest.mcap")
        assert (abs(result["energy"]["residual_relative"]) < LARGEST_RESIDUAL) == closed
        assert (verdict(result) == "ok") == closed
