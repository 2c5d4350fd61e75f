"""Runs of SSP archives: ours give the records of their scene, others are free systems of FMUs."""

import json
import zipfile

import foreign_fmus
import numpy as np
import pytest
from foreign_fmus import Variable

from fmus.vehicles.tables import BadInput
from orchestrator.execution.simulate import simulate
from orchestrator.execution.summary import LARGEST_RESIDUAL, verdict
from orchestrator.log.reader import Log
from orchestrator.results.run_data import RunData
from orchestrator.scene.kinds import Scene
from orchestrator.scene.products import write_ssp
from orchestrator.scene.scene import load, load_any
from orchestrator.scene.ssp_scene import load_ssp
from orchestrator.scene.system_scene import FreeScene

SHORT = {"run.stop": "20 ms", "expect": {}}
T1, T2, START = 0.2, 0.5, 3.0
LAG = (
    Variable("u", "input", unit="N"),
    Variable("x", "output", unit="N"),
    Variable("start", "parameter", 0.0, unit="N"),
    Variable("T", "parameter", 1.0, unit="s"),
    Variable("whole", "output", 0, "Integer"),
)
SPACES = " ".join(
    f'xmlns:{letters}="http://ssp-standard.org/SSP1/SystemStructure{name}"'
    for letters, name in (("ssd", "Description"), ("ssc", "Common"), ("ssv", "ParameterValues"))
)
SSV = f"""<ssv:ParameterSet {SPACES} version="1.0" name="second"><ssv:Parameters>
<ssv:Parameter name="T"><ssv:Real value="{T2}"/></ssv:Parameter></ssv:Parameters></ssv:ParameterSet>"""
SSD = f"""<ssd:SystemStructureDescription {SPACES} version="1.0" name="lags"><ssd:System name="lags"><ssd:Elements>
<ssd:Component name="a" type="application/x-fmu-sharedlibrary" source="resources/lag.fmu">
<ssd:Connectors><ssd:Connector name="x" kind="output"><ssc:Real unit="N"/></ssd:Connector></ssd:Connectors>
<ssd:ParameterBindings><ssd:ParameterBinding><ssd:ParameterValues><ssv:ParameterSet version="1.0" name="first">
<ssv:Parameters><ssv:Parameter name="T"><ssv:Real value="{T1}"/></ssv:Parameter>
<ssv:Parameter name="start"><ssv:Real value="{START}"/></ssv:Parameter></ssv:Parameters>
</ssv:ParameterSet></ssd:ParameterValues></ssd:ParameterBinding></ssd:ParameterBindings></ssd:Component>
<ssd:Component name="b" source="resources/lag.fmu"><ssd:ParameterBindings>
<ssd:ParameterBinding source="values/b.ssv"/></ssd:ParameterBindings></ssd:Component>
</ssd:Elements><ssd:Connections>
<ssd:Connection startElement="a" startConnector="x" endElement="b" endConnector="u"/>
<ssd:Connection startElement="b" startConnector="x" endElement="a" endConnector="u"/>
</ssd:Connections></ssd:System><ssd:DefaultExperiment startTime="0" stopTime="1"/></ssd:SystemStructureDescription>"""


@pytest.fixture(scope="module")
def lag(tmp_path_factory):
    return foreign_fmus.build(tmp_path_factory.mktemp("lag") / "lag.fmu", "lag", LAG)


@pytest.fixture(scope="module")
def chain(tmp_path_factory):
    """Archive of a hanging chain."""
    file = tmp_path_factory.mktemp("chain") / "chain.ssp"
    write_ssp(load("hanging_chain", "rigid", SHORT), file, native=False)
    return file


def packed(file, lag, ssd=SSD, **more):
    with zipfile.ZipFile(file, "w") as archive:
        archive.writestr("SystemStructure.ssd", ssd)
        archive.writestr("values/b.ssv", SSV)
        archive.write(lag, "resources/lag.fmu")
        for name, content in more.items():
            archive.writestr(name, content)
    return file


def digest(scene, path):
    summary = simulate(scene, path)
    assert summary["status"] == "ok", summary["message"]
    with Log(path) as log:
        return log.digest()


def rewritten(file, target, change):
    """Copy of an archive with another SystemStructure.ssd."""
    with zipfile.ZipFile(file) as source, zipfile.ZipFile(target, "w") as copy:
        for name in source.namelist():
            content = source.read(name)
            copy.writestr(name, change(content) if name == "SystemStructure.ssd" else content)
    return target


def test_an_archive_of_ours_gives_the_records_of_its_scene(chain, tmp_path):
    scene = load_ssp(chain, None, ())
    assert scene.name == "hanging_chain"
    own = digest(load("hanging_chain", "rigid", SHORT), tmp_path / "own.mcap")
    assert digest(scene, tmp_path / "ssp.mcap") == own
    shorter = {"run.stop": "10 ms", "expect": {}}
    own = digest(load("hanging_chain", "rigid", shorter), tmp_path / "own.mcap")
    assert digest(load_ssp(chain, None, ["run.stop=10 ms"]), tmp_path / "ssp.mcap") == own


def test_values_of_the_archive_count(chain, tmp_path):
    """A value in the SSD that differs from the scene's is set; without a connection it is another system."""
    other = rewritten(chain, tmp_path / "other.ssp", lambda text: text.replace(b'value="0.0"', b'value="0.25"', 1))
    (table,) = load_ssp(other, None, ()).fmu.values()
    assert list(table.parameters.values()) == [0.25]
    (same,) = load_ssp(chain, None, ()).fmu.values()
    assert same.parameters == {}


def test_times_of_the_archive_count(chain, tmp_path):
    """An edited DefaultExperiment: the run has its start and stop."""
    edited = tmp_path / "edited.ssp"
    with zipfile.ZipFile(chain) as old, zipfile.ZipFile(edited, "w") as new:
        for name in old.namelist():
            content = old.read(name)
            if name == "SystemStructure.ssd":
                assert b'startTime="0.0" stopTime="0.02"' in content
                content = content.replace(b'startTime="0.0" stopTime="0.02"', b'startTime="1.0" stopTime="1.01"')
            new.writestr(name, content)
    scene = load_ssp(edited, None, [])
    assert isinstance(scene, Scene)
    assert (scene.run.start, scene.run.stop) == (1.0, pytest.approx(0.01))
    summary = simulate(scene, tmp_path / "edited.mcap")
    assert summary["status"] == "ok", summary["message"]
    with Log(tmp_path / "edited.mcap") as log:
        assert RunData(log).span == pytest.approx((0.0, 0.01))
    assert load_ssp(edited, None, ["run.stop=5 ms"]).run.stop == 5e-3


def test_another_part_makes_a_free_system(chain, tmp_path, caplog):
    assert isinstance(load_ssp(chain, None, ()), Scene)
    assert not caplog.messages
    file = rewritten(chain, tmp_path / "links.ssp", lambda text: text.replace(b'name="chain"', b'name="links"'))
    assert isinstance(load_ssp(file, None, ()), FreeScene)
    (message,) = caplog.messages
    assert message.endswith("links.ssp': parts or connections are not those of its scene: it runs as a free system")


def test_an_archive_of_others_is_a_free_system(lag, tmp_path):
    """Two first-order systems: the exact solution, with an error of order 2 in the communication step."""
    file, errors = packed(tmp_path / "lags.ssp", lag), []
    rate, level, gap = 1 / T1 + 1 / T2, T1 * START / (T1 + T2), START * T2 / (T1 + T2)
    for step in (4e-3, 2e-3, 1e-3):
        summary = simulate(load_ssp(file, None, {"run.step": step}), tmp_path / "lags.mcap", estimated=True)
        assert summary["status"] == "ok"
        assert (summary["energy"], summary["error"]) == (None, None)
        with Log(tmp_path / "lags.mcap") as log:
            t, x = log.signal("a.x")
            assert RunData(log).scene == {}
            assert set(log.topics) == {f"/{kind}" for kind in ("a/in", "a/out", "b/in", "b/out", "stats/a", "stats/b")}
        errors.append(np.abs(x - level - gap * np.exp(-rate * t)).max())
    assert errors[-1] < 1e-4
    assert np.log2(np.array(errors[:-1]) / errors[1:]) == pytest.approx(2.0, abs=0.1)


def test_commands_on_a_free_system(lag, cotrack, tmp_path):
    packed(tmp_path / "lags.ssp", lag)
    out = cotrack.done("show", "lags.ssp")
    for line in (
        "  1 s in 1000 steps of 1 ms, tracks_first",
        f"  a.T = {T1}",
        f"  b.T = {T2}",
        "  a.x -> b.u",
        "  b.x -> a.u",
    ):
        assert line in out.splitlines(), line
    assert (
        sum(line.endswith("/resources/lag.fmu; 1 values in, 1 out a step, stage 0") for line in out.splitlines()) == 2
    )
    out = cotrack.done("run", "lags.ssp", "--stop", "0.2 s", "--step", "2 ms", "-o", "logs/lags.mcap")
    assert out.startswith("lags: ok\n  0.2 s simulated in ")
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
        ("connections.0=a.whole -> b.u", "'u' is of type Real, and a.whole of type Integer: only equal types are"),
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


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('source="resources/lag.fmu"', 'source="../lag.fmu"', "source = '../lag.fmu': must be a file in the archive"),
        ('source="resources/lag.fmu"', 'source="file:///lag.fmu"', "must be a file in the archive"),
        ('source="resources/lag.fmu"', 'source="/lag.fmu"', "must be a file in the archive"),
        ('source="resources/lag.fmu"', 'source="a.fmu"', "there is no such file in the archive"),
        ('source="values/b.ssv"', 'source="http://a.org/b.ssv"', "must be a file in the archive"),
        ("</ssd:Elements>", "<ssd:SignalDictionaryReference/></ssd:Elements>", "an element is called ''"),
        ('startElement="a" ', "", "there is no connector 'x'"),
        ('unit="N"', 'unit="kN"', "connector 'a.x' has the unit 'kN', and its variable 'N': both must have one unit"),
        ('version="1.0" name="lags"', 'version="3.0" name="lags"', "SSP 3.0: only SSP 1.0 and 2.0 are run"),
        (f'value="{T1}"', 'value="soon"', "parameter 'T' = 'soon' (Real): must be one finite Real, an Integer"),
        ('name="b" source', 'name="b/c" source', "an element is called 'b/c': its name must have no dot and no slash"),
        ('name="b" source', 'name="a" source', "two elements of 'the system' are called 'a'"),
        (' stopTime="1"', "", "its DefaultExperiment has no stopTime: run.stop gives one"),
        ("<ssd:Connections>", "<ssd:Connections", "SystemStructure.ssd cannot be read"),
        ("x-fmu-sharedlibrary", "x-ssp-package", "is not an SSP archive: it has no SystemStructure.ssd"),
    ],
)
def test_what_an_archive_must_not_have_is_one_sentence(lag, tmp_path, old, new, said):
    assert old in SSD
    with pytest.raises(BadInput) as caught:
        load_ssp(packed(tmp_path / "lags.ssp", lag, SSD.replace(old, new, 1)), None, ())
    assert said in str(caught.value)
    assert "lags.ssp" in str(caught.value)
    assert "\n" not in str(caught.value)


def test_files_of_an_archive_stay_in_it(lag, chain, tmp_path):
    with pytest.raises(BadInput, match="it holds a file outside of it"):
        load_ssp(packed(tmp_path / "lags.ssp", lag, **{"../up": b""}), None, ())
    with pytest.raises(BadInput, match="there is no SSP archive"):
        load_ssp(tmp_path / "none.ssp", None, ())
    with pytest.raises(BadInput, match=r"it has no SystemStructure\.ssd"):
        load_ssp(lag, None, ())
    with pytest.raises(BadInput, match="track = 'rigid': the FMUs of an archive are as they are"):
        load_ssp(chain, "rigid", ())
    with pytest.raises(BadInput, match=r"vehicle\.track\.mass: the FMUs of an archive are as they are"):
        load_ssp(chain, None, ["vehicle.track.mass=3"])
    table = load("hanging_chain", "rigid", {"fmu.chain.file": "/elsewhere.fmu"}).resolved() | {"placed": True}
    with zipfile.ZipFile(chain) as source, zipfile.ZipFile(tmp_path / "own.ssp", "w") as copy:
        for name in source.namelist():
            content = json.dumps(table) if name == "resources/scene.json" else source.read(name)
            copy.writestr(name, content)
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


def test_a_vehicle_at_rest_is_in_balance_unless_its_exchange_swings(tmp_path):
    """With values of the last step a standing m113 loses next to nothing; with much too long steps it swings."""
    write_ssp(load("straight", "rigid"), tmp_path / "own.ssp", native=False)
    with zipfile.ZipFile(tmp_path / "own.ssp") as own, zipfile.ZipFile(tmp_path / "rest.ssp", "w") as copy:
        for name in own.namelist():
            if name != "resources/scene.json":
                copy.writestr(name, own.read(name))
    for step, closed in (("1 ms", True), ("2 ms", True), ("10 ms", False)):
        scene = load_ssp(tmp_path / "rest.ssp", None, {"run.stop": "0.1 s", "run.step": step})
        result = simulate(scene, tmp_path / "rest.mcap")
        assert (abs(result["energy"]["residual_relative"]) < LARGEST_RESIDUAL) == closed
        assert (verdict(result) == "ok") == closed
