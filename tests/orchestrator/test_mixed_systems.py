"""Connections of all FMI types and of different units between FMUs of the user, against a loop of fmpy alone."""

import zipfile

import foreign_fmus
import numpy as np
import pytest
import whole_fmu
from fmpy import extract, read_model_description
from fmpy.fmi2 import FMU2Slave
from foreign_fmus import Variable, library_of
from numpy.testing import assert_array_equal
from ssd_texts import MILLIMETRES, bound, component, connection, document, packed, system, values

from fmus.vehicles.tables import BadInput
from orchestrator.cosim.base_units import UNCHANGED, BaseUnit, Conversion, base_unit, conversion, unit_of
from orchestrator.execution.replay_model import open_replay
from orchestrator.execution.simulate import simulate
from orchestrator.fmi.model_description import describe
from orchestrator.fmi.slave import ComponentFailed
from orchestrator.log.reader import Log
from orchestrator.log.tools import verify
from orchestrator.scene.scene import any_from_table
from orchestrator.scene.ssp_scene import load_ssp
from orchestrator.scene.system_scene import FreeScene

H, STEPS = 0.01, 60
GEARS = ("low", "high", "road")
PARAMETERS = {"T": "s", "start": "N", "warmth_start": "K", "limit": "N", "longest": "s", "end": "s"}  # and units
MIXED = (
    Variable("u", "input", 0.5, unit="N"),
    Variable("x", "output", unit="N"),
    Variable("warmth_in", "input", 300.0, unit="K"),
    Variable("warmth", "output", unit="K"),
    *(Variable(name, "parameter", start, unit=unit)
      for (name, unit), start in zip(PARAMETERS.items(), (0.1, 2000.0, 290.0, 1000.0, 1e9, 1e9), strict=True)),
    Variable("gear_in", "input", 1, "Enumeration", items=GEARS),
    Variable("count_in", "input", 3, "Integer"),
    Variable("forward_in", "input", True, "Boolean"),
    Variable("word_in", "input", "go", "String"),
    Variable("word", "output", "", "String"),
    Variable("forward", "output", False, "Boolean"),
    Variable("count", "output", 0, "Integer"),
    Variable("gear", "output", 1, "Enumeration", items=GEARS),
)  # fmt: skip
NEWTON = {"kg": 1, "m": 1, "s": -2}
UNITS = {
    "N": NEWTON, "kN": NEWTON | {"factor": 1000.0}, "K": {"K": 1}, "degC": {"K": 1, "offset": 273.15}, "s": {"s": 1},
    "mm": {"m": 1, "factor": 1e-3},
}  # fmt: skip
OTHER_UNITS = {"N": "kN", "K": "degC"}
COLD = {"start": 1.5, "warmth_start": 40.0, "limit": 0.8, "T": 0.05}  # of b, in kN and degC
PAIRS = {"u": "x", "warmth_in": "warmth", "count_in": "count", "gear_in": "gear", "forward_in": "forward"}
PAIRS |= {"word_in": "word"}
# value in the unit of the receiver = factor * value + offset
CONVERSIONS = {
    "a": {"u": (1000.0, 0.0), "warmth_in": (1.0, 273.15)},
    "b": {"u": (1.0 / 1000.0, 0.0), "warmth_in": (1.0, -273.15)},
}
FMI_TYPES = {variable.name: variable.kind.replace("Enumeration", "Integer") for variable in MIXED}


def changed(fmu, file, change, other_units=OTHER_UNITS):
    """The model with other variables in its description."""
    variables = [change(each._replace(unit=other_units.get(each.unit, each.unit))) for each in MIXED]
    return foreign_fmus.build(file, "mixed", variables, UNITS, library_of(fmu), states=True)


class Own:
    """An FMU by fmpy alone."""

    def __init__(self, file, name, parameters, folder):
        description, unzipped = read_model_description(str(file)), extract(str(file), unzipdir=str(folder / name))
        self._fmu = FMU2Slave(
            guid=description.guid, unzipDirectory=unzipped, modelIdentifier="mixed", instanceName=name
        )
        self._references = {variable.name: variable.valueReference for variable in description.modelVariables}
        self._fmu.instantiate()
        self._fmu.setupExperiment(startTime=0.0, stopTime=H * STEPS)
        for parameter, value in parameters.items():
            self._fmu.setReal([self._references[parameter]], [value])
        self._fmu.enterInitializationMode()
        self.step = self._fmu.doStep
        self.y = {}

    def start(self):
        self._fmu.exitInitializationMode()
        self.read()

    def set(self, values):
        for name, value in values.items():
            getattr(self._fmu, f"set{FMI_TYPES[name]}")([self._references[name]], [value])

    def read(self):
        found = {out: getattr(self._fmu, f"get{FMI_TYPES[out]}")([self._references[out]])[0] for out in PAIRS.values()}
        self.y = {out: value.decode() if isinstance(value, bytes) else value for out, value in found.items()}

    def close(self):
        self._fmu.terminate()
        self._fmu.freeInstance()


def own_loop(files, folder, coupling, stage):
    """Values of all inputs of each step, and of all outputs at its ends, by instance and variable."""
    fmus = {"a": Own(files["a"], "a", {}, folder), "b": Own(files["b"], "b", COLD, folder)}
    peers, groups = {"a": "b", "b": "a"}, ("a", "b") if stage and coupling != "jacobi" else ("ab",)

    def given(name, values):
        converted = {into: values[out] for into, out in PAIRS.items()}
        for into, (factor, offset) in CONVERSIONS[name].items():
            converted[into] = factor * converted[into] + offset
        return converted

    order, before = "ba" if stage else "ab", None  # the last stage first
    for name in order:  # with the start values of inputs
        fmus[name].read()
    while before != (before := {name: fmus[name].y for name in order}):  # until all stands still
        for name in order:
            fmus[name].set(given(name, fmus[peers[name]].y))
            fmus[name].read()
    for name in order:
        fmus[name].set(given(name, fmus[peers[name]].y))
        fmus[name].start()
    inputs = {name: {into: [] for into in PAIRS} for name in fmus}
    outputs = {name: {out: [fmus[name].y[out]] for out in PAIRS.values()} for name in fmus}
    past = None
    for k in range(STEPS):
        now = {name: fmu.y for name, fmu in fmus.items()}
        for group in groups:
            for name in group:
                values = dict(now[peers[name]])  # discrete values are those of the communication point
                for out in ("x", "warmth"):
                    if len(groups) == 2 and name == "b":
                        after = fmus["a"].y[out]
                        values[out] = after if coupling == "gauss_seidel" else 0.5 * (values[out] + after)
                    elif coupling != "gauss_seidel" and past is not None:
                        values[out] += 0.5 * H / H * (values[out] - past[peers[name]][out])
                fmus[name].set(chosen := given(name, values))
                for into, value in chosen.items():
                    inputs[name][into].append(value)
            for name in group:
                fmus[name].step(k * H, H)
                fmus[name].read()
                for out, value in fmus[name].y.items():
                    outputs[name][out].append(value)
        past = now
    for fmu in fmus.values():
        fmu.close()
    return inputs, outputs


REALS = ("u", "warmth_in")
HOLD = {"gauss_seidel": {"hold": "constant"}}


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    """The model in N and K, and in kN and degC."""
    folder = tmp_path_factory.mktemp("mixed")
    one = foreign_fmus.build(folder / "a.fmu", "mixed", MIXED, UNITS, states=True)
    return {"a": one, "b": changed(one, folder / "b.fmu", lambda each: each)}


def scene(files, connections=None, stage=0, parameters=(), **run):
    every = [f"{a}.{out} -> {b}.{into}" for a, b in ("ab", "ba") for into, out in PAIRS.items()]
    table = {
        "name": "mixed", "title": "All types", "assembly": "fmus", "run": {"stop": H * STEPS, "step": H, **run},
        "fmu": {
            "a": {"file": str(files["a"]), "parameters": dict(parameters)},
            "b": {"file": str(files["b"]), "stage": stage, "parameters": COLD},
        },
        "connections": every if connections is None else connections,
    }  # fmt: skip
    made = any_from_table(table, "mixed.toml")
    assert isinstance(made, FreeScene)
    return made


def recorded(log, topic, texts):
    """Values of a topic by variable, Strings as texts."""
    series = log.read(topic)
    instance = topic.split("/")[1]
    values = dict(zip(series.names, series.values.T.tolist(), strict=True))
    return {
        name: [texts[f"{instance}.{name}"][int(x)] for x in row] if f"{instance}.{name}" in texts else row
        for name, row in values.items()
    }


@pytest.mark.parametrize("way", ["kernels", "threads", "Python"])
@pytest.mark.parametrize(("coupling", "stage"), [("jacobi", 0), ("tracks_first", 1), ("gauss_seidel", 1)])
def test_a_mixed_system_has_the_bits_of_an_own_loop(files, tmp_path, monkeypatch, coupling, stage, way):
    """All inputs and outputs of all types in every step, and the log can be replayed."""
    monkeypatch.setattr("orchestrator.cosim.coupling.scheme.CAN_STEP", way != "Python")
    if way == "threads":
        monkeypatch.setattr("orchestrator.cosim.program.WORTHWHILE", 0.0)
        monkeypatch.setattr("orchestrator.cosim.program.processors", lambda: 2)
    path = tmp_path / "mixed.mcap"
    summary = simulate(scene(files, stage=stage, coupling={"scheme": coupling} | HOLD.get(coupling, {})), path)
    assert (summary["status"], summary["message"]) == ("ok", "")
    assert [warning["text"] for warning in summary["warnings"]] == []
    inputs, outputs = own_loop(files, tmp_path, coupling, stage)
    with Log(path) as log:
        texts = log.table("texts.json")
        for name in "ab":
            assert recorded(log, f"/{name}/in", texts) == inputs[name]
            assert recorded(log, f"/{name}/out", texts) == outputs[name]
        assert (log.unit("a.u"), log.unit("b.u")) == ("N", "kN")
    assert len(set(outputs["a"]["word"])) > 5
    assert {*outputs["b"]["forward"]} == {False, True}
    assert verify(path).code == 0
    with open_replay(path, "b", str(files["b"])) as replay:
        assert replay.verify().equal


@pytest.mark.parametrize("run", [
    *({"coupling": {"scheme": scheme}} for scheme in ("iterative", "gauss_seidel")),
    {"variable": {"tolerance": 1e-3, "shortest": 1e-3}},
])  # fmt: skip
def test_discrete_inputs_are_held_in_steps_that_are_repeated(files, tmp_path, run):
    """They are the outputs at the beginning of each step, whatever happens to Reals."""
    path = tmp_path / "mixed.mcap"
    summary = simulate(scene(files, **run), path)
    assert summary["status"] == "ok", summary["message"]
    with Log(path) as log:
        texts = log.table("texts.json")
        for name, peer in ("ab", "ba"):
            inputs, outputs = recorded(log, f"/{name}/in", texts), recorded(log, f"/{peer}/out", texts)
            for into, out in PAIRS.items():
                if into not in REALS:
                    assert inputs[into] == outputs[out][:-1], into
        assert outputs["count"] == [*range(len(outputs["count"]))]  # each step counts once
        assert log.read("/a/in").h.max() > 4e-3, "only Reals decide on a step"
    for name in "ab":
        with open_replay(path, name, str(files[name])) as replay:
            assert replay.verify().equal


@pytest.mark.long
@pytest.mark.parametrize(("scheme", "tolerance"), [("gauss_seidel", 1e-12), ("iterative", 1e-5)])
def test_units_change_nothing_but_rounding(files, tmp_path, scheme, tolerance):
    """The same system with b in N and K; an iteration ends within its tolerance."""
    values = {}
    for name, b, factor, offset in (("kilo", files["b"], 1.0, 0.0), ("plain", files["a"], 1e3, 273.15)):
        made = scene({"a": files["a"], "b": b}, coupling={"scheme": scheme})
        cold = {"start": factor * 1.5, "limit": factor * 0.8, "warmth_start": 40.0 + offset, "T": 0.05}
        made = made.model_copy(update={"fmu": made.fmu | {"b": made.fmu["b"].model_copy(update={"parameters": cold})}})
        assert simulate(made, tmp_path / "mixed.mcap")["status"] == "ok"
        with Log(tmp_path / "mixed.mcap") as log:
            values[name] = [log.signal(signal)[1] for signal in ("a.x", "a.warmth", "b.x", "b.warmth")]
            values[name][2] /= factor
            values[name][3] -= offset
    for kilo, plain in zip(*values.values(), strict=True):
        assert np.abs(kilo - plain).max() < tolerance * np.abs(plain).max()


def test_values_at_the_start_are_those_of_the_fmu(files, tmp_path):
    """Strings without a connection are not recorded; an FMU without one gets none of its inputs."""
    path = tmp_path / "mixed.mcap"
    assert simulate(scene(files, ["b.x -> a.u", "a.word -> b.word_in"]), path)["status"] == "ok"
    with Log(path) as log:
        assert log.topics["/a/in"].names == ("u", "warmth_in")
        assert log.topics["/b/out"].names == ("x", "warmth")
        assert set(log.read("/a/in").values[:, 1]) == {300.0}
        texts = log.table("texts.json")
        assert list(texts) == ["a.word", "b.word_in"]
        assert texts["a.word"][:2] == ["ago", "bgo"]  # "go" is the start value of a.word_in
        assert recorded(log, "/b/in", texts)["word_in"] == recorded(log, "/a/out", texts)["word"][:-1]


# --- units and transformations ---------------------------------------------------------------------


def test_a_factor_and_an_offset_follow_the_conversion_of_units(files, tmp_path, cotrack):
    """By the text of a connection, and by the LinearTransformation of an archive."""
    runs = {}
    text = "-2.5 * b.x + 30.0 -> a.u"
    simulate(scene(files, [text]), tmp_path / "scene.mcap")
    transformed = connection("b.x", "a.u", '<ssc:LinearTransformation factor="-2.5" offset="30"/>')
    cold = bound(values(**{key: ("Real", value) for key, value in COLD.items()}))
    elements = component("a", source="a.fmu") + component("b", cold, "b.fmu")
    ssd = document(system(elements, transformed), experiment=f'stopTime="{H * STEPS}"')
    packed(tmp_path / "mixed.ssp", ssd, **{f"{name}.fmu": fmu for name, fmu in files.items()})
    cotrack.done("run", "mixed.ssp", "--step", f"{H} s", "-o", "archive.mcap")
    for name in ("scene", "archive"):
        with Log(tmp_path / f"{name}.mcap") as log:
            x, u = log.signal("b.x")[1], log.signal("a.u")[1]
            runs[name] = log.digest()
            assert log.table("system.json")["instances"][0]["conversions"] == {"u": [-2500.0, 30.0]}
            if name == "scene":
                connections = log.table("scene.json")["connections"]
        now = np.append(x[:1], x[1:-1] + 0.5 * H / H * np.diff(x[:-1]))
        assert_array_equal(u, -2500.0 * now + 30.0)
    assert connections == [text]
    assert runs["scene"] == runs["archive"]


def test_what_cannot_be_connected_is_refused(files, tmp_path):
    def renamed(each):
        return each._replace(items=("low", "high", "reverse")) if each.name == "gear_in" else each

    other = {
        "gears": changed(files["a"], tmp_path / "gears.fmu", renamed),
        "lengths": changed(files["a"], tmp_path / "lengths.fmu", lambda each: each, {"N": "mm"}),
        "unknown": changed(files["a"], tmp_path / "unknown.fmu", lambda each: each, {"N": "kip"}),
    }
    cases = (
        (files["b"], "a.count -> b.u", "input 'u' is of type Real, and a.count of type Integer: only equal types"),
        (files["b"], "a.gear -> b.count_in", "input 'count_in' is of type Integer, and a.gear of type Enumeration"),
        (files["b"], "a.word -> b.forward_in", "input 'forward_in' is of type Boolean, and a.word of type String"),
        (files["b"], "2 * a.count -> b.count_in", "input 'count_in' is of type Integer: only Reals have a factor"),
        (files["b"], "a.count + 1 -> b.count_in", "only Reals have a factor or an offset (a.count)"),
        (other["gears"], "a.gear -> b.gear_in", "input 'gear_in' has the items 1 low, 2 high, 3 reverse, and"),
        (other["lengths"], "a.x -> b.u", "a.x has the unit 'N', and 'mm' is needed by 'u'"),
        (other["unknown"], "a.x -> b.u", "and 'kip', which the FMU does not define, is needed by 'u'"),
        (files["b"], "1e999 * a.x -> b.u", "factor and offset must be finite, and the factor not 0"),
    )
    for fmu, text, said in cases:
        with pytest.raises(BadInput) as caught:
            simulate(scene({"a": files["a"], "b": fmu}, [text]), tmp_path / "mixed.mcap")
        assert said in str(caught.value)
        assert "\n" not in str(caught.value)
    assert not (tmp_path / "mixed.mcap").exists()
    simulate(scene({"a": other["gears"], "b": files["b"]}, ["a.gear -> b.gear_in"]), tmp_path / "mixed.mcap")


TYPES = {
    "2.0": '<SimpleType name="T"><!-- of a difference --><Real unit="degC" {}/></SimpleType>',
    "3.0": '<Float64Type name="T" unit="degC" {}/>',
}
VARIABLES = {
    "2.0": '<ScalarVariable name="{}" valueReference="{}" causality="output"><!-- one --><Real {}/></ScalarVariable>',
    "3.0": '<Float64 name="{}" valueReference="{}" causality="output" {}/>',
}
CELSIUS = '<Unit name="{}"><BaseUnit K="1" factor="{}" offset="{}"/></Unit>'


def described(file, version, of_type="", more="", **attributes):
    """Description of a file with variables of these attributes; ``of_type``: further ones of the type T, in degC."""
    degrees = ("K", 1, 0), ("degC", 1, 273.15), ("degR", 5 / 9, 0)
    variables = [VARIABLES[version].format(name, k, each) for k, (name, each) in enumerate(attributes.items())]
    text = (
        f'<fmiModelDescription fmiVersion="{version}" modelName="m" guid="g" instantiationToken="g"><CoSimulation '
        f'modelIdentifier="m"/><UnitDefinitions>{"".join(CELSIUS.format(*each) for each in degrees)}</UnitDefinitions>'
        f"<TypeDefinitions>{TYPES[version].format(of_type)}</TypeDefinitions>"
        f"<ModelVariables>{''.join(variables)}{more}</ModelVariables><ModelStructure/></fmiModelDescription>"
    )
    with zipfile.ZipFile(file, "w") as archive:
        archive.writestr("modelDescription.xml", text)
    description = describe(file, ("2.0", "3.0"))[1]
    return {v.name: v for v in description.modelVariables}, lambda v: base_unit(description, v)


@pytest.mark.parametrize("version", ["2.0", "3.0"])
@pytest.mark.parametrize("of_type", ['relativeQuantity="true"', 'relativeQuantity="false"', ""])
def test_units_of_declared_types_and_of_differences(tmp_path, version, of_type):
    """A temperature has an offset, a difference has none; what a variable says outweighs its declared type."""
    temperature, difference = 'unit="degC" relativeQuantity="false"', 'unit="degC" relativeQuantity="{}"'
    variables, base = described(
        tmp_path / "m.fmu", version, of_type, K='unit="K"', degR='unit="degR"', plain='unit="degC"',
        said=temperature, d=difference.format("true"), d1=difference.format("1"), typed='declaredType="T"',
        over='declaredType="T" relativeQuantity="true"', under='declaredType="T" relativeQuantity="false"',
    )  # fmt: skip
    of = {name: base(variable) for name, variable in variables.items()}
    assert {unit_of(variables[name]) for name in ("plain", "typed", "over", "under")} == {"degC"}
    differs = {"d", "d1", "over"} | ({"typed"} if "true" in of_type else set())
    for name in of.keys() - {"K", "degR"}:
        assert conversion(of[name], of["K"]) == Conversion(1.0, 0.0 if name in differs else 273.15), name
        assert conversion(of["K"], of[name]) == Conversion(1.0, 0.0 if name in differs else -273.15), name
    assert conversion(of["plain"], of["degR"]) == (pytest.approx(1.8), pytest.approx(491.67))
    assert conversion(of["d"], of["degR"]) == (pytest.approx(1.8), 0.0)
    assert conversion(of["plain"], of["K"]).then(Conversion(2.0, 1.0)) == (2.0, 547.3)
    assert conversion(None, of["K"]) == conversion(of["K"], None) == UNCHANGED


def test_bounds_of_unsigned_variables_and_attributes_of_aliases(tmp_path):
    more = '<UInt8 name="n" valueReference="7" causality="parameter" variability="fixed" start="1" min="1" max="9"/>'
    difference = (
        '<Float64 name="d" valueReference="8" causality="output" unit="degC" relativeQuantity="true">{}</Float64>'
    )
    more += difference.format('<Alias name="e"/>')
    variables, base = described(tmp_path / "m.fmu", "3.0", more=more, x='unit="K" min="0"')
    assert [(variables[name].min, variables[name].max) for name in "nx"] == [("1", "9"), ("0", None)]
    assert base(variables["e"]) == base(variables["d"]) == BaseUnit((0, 0, 0, 0, 1, 0, 0), 1.0, 273.15, relative=True)


def test_a_difference_of_temperature_reaches_an_fmu_without_the_offset(files, tmp_path, cotrack):
    """The archive gives 10 K to a parameter that is a difference in degC, and 300 K come over a connection."""
    cold = tmp_path / "difference.fmu"
    with zipfile.ZipFile(files["b"]) as source, zipfile.ZipFile(cold, "w") as copy:
        for name in source.namelist():
            copy.writestr(name, source.read(name).replace(b'unit="degC"', b'unit="degC" relativeQuantity="true"'))
    given = values(warmth_start=("Real", 10.0)).replace('value="10.0"', 'value="10.0" unit="K"')
    elements = component("a", bound(values(warmth_start=("Real", 300.0))), "resources/a.fmu")
    elements += component("b", bound(given), "resources/b.fmu")
    ssd = document(
        system(elements, connection("a.warmth", "b.warmth_in")),
        MILLIMETRES.replace("mm", "K").replace('m="1" factor="0.001"', 'K="1"'),
    )
    file = packed(tmp_path / "t.ssp", ssd, **{"resources/a.fmu": files["a"], "resources/b.fmu": cold})
    assert "  b.warmth_start = 10.0" in cotrack.done("show", file.name)
    assert simulate(load_ssp(file, None, {}), tmp_path / "t.mcap")["status"] == "ok"
    with Log(tmp_path / "t.mcap") as log:
        assert (log.signal("b.warmth")[1][0], log.signal("b.warmth_in")[1][0]) == (10.0, 300.0)


def test_an_inverse_display_factor_is_a_warning(files, tmp_path):
    file = tmp_path / "shown.fmu"
    with zipfile.ZipFile(files["a"]) as source, zipfile.ZipFile(file, "w") as copy:
        for name in source.namelist():
            old = b'<Unit name="N"><BaseUnit kg="1" m="1" s="-2" />'
            content = source.read(name).replace(old, old + b'<DisplayUnit name="kN" factor="1000"/>')
            assert name != "modelDescription.xml" or content != source.read(name)
            copy.writestr(name, content)
    summary = simulate(scene({"a": file, "b": files["b"]}), tmp_path / "mixed.mcap")
    (warning,) = summary["warnings"]
    assert (summary["status"], warning["text"]) == ("ok", "'N' is shown in 'kN' by 1000, the inverse of 0.001")


# --- steps that are not done -----------------------------------------------------------------------


@pytest.mark.parametrize(
    ("parameters", "run", "status", "message", "reached"),
    [
        ({"end": 0.205}, {}, 0, "a has ended the run at t = 0.205 s", 0.2),
        ({"longest": 0.004}, {}, 1, "t = 0 s ended at t = 0.004 s: a step of 0.004 s or less may help", 0.0),
        ({"longest": 0.004}, {"start": 5.0}, 1, "t = 0 s ended at t = 0.004 s: a step of 0.004 s or less", 0.0),
        ({"longest": 0.0}, {}, 1, "with FMI status 2; the step from t = 0 s is discarded, and no", 0.0),
        ({"longest": 0.004}, {"variable": {"tolerance": 0.5, "shortest": 1e-3}}, 0, "", STEPS * H),
        ({"end": 0.205}, {"variable": {"tolerance": 0.5, "shortest": 1e-3}}, 0, "a has ended the run at", 0.204),
    ],
    ids=[
        "terminated",
        "discarded",
        "discarded later",
        "discarded without time",
        "shortened",
        "shortened and terminated",
    ],
)
def test_steps_that_an_fmu_does_not_do(files, tmp_path, parameters, run, status, message, reached):
    """The run ends at the last complete step, or takes shorter steps, and its log is whole."""
    summary = simulate(scene(files, parameters=parameters.items(), **run), tmp_path / "mixed.mcap")
    assert message in summary["message"]
    assert (summary["status"] == "failed") == status
    with Log(tmp_path / "mixed.mcap") as log:
        assert message in log.closing["message"]
        assert log.closing["status"] == summary["status"]
        t, h = log.signal("a.x")[0], log.read("/a/in").h
        assert t[-1] == pytest.approx(reached, abs=1e-3)
        assert not len(h) or h.max() <= parameters.get("longest", H) * (1.0 + 1e-12) or "end" in parameters
        assert log.complete
    assert verify(tmp_path / "mixed.mcap").code == 0


def test_an_fmu_without_reals_is_recorded(files, tmp_path, cotrack, monkeypatch):
    """Every system that can be loaded can be: its discrete outputs are in the statistics.

    Results do not read what has no energies: with thousands of FMUs each reading costs as much as all their steps.
    """
    monkeypatch.setattr(Log, "ends", None)
    whole = [Variable("u", "input", 0, "Integer"), Variable("y", "output", 0, "Integer")]
    fmu = foreign_fmus.build(tmp_path / "whole.fmu", "whole", whole)
    table = {"name": "w", "title": "w", "assembly": "fmus", "run": {"stop": H, "step": H}}
    table["fmu"] = {"a": {"file": str(fmu)}}
    assert simulate(any_from_table(table, "w.toml"), tmp_path / "w.mcap")["status"] == "ok"
    with Log(tmp_path / "w.mcap") as log:
        assert "stats.a.y" in log.signals
    assert cotrack("log", "verify", tmp_path / "w.mcap")[0] == 0


# --- whole numbers of FMI 3.0 ----------------------------------------------------------------------


@pytest.fixture(scope="module")
def whole_packed(tmp_path_factory):
    """Function that packs the FMU of FMI 3.0 with all types of whole numbers."""
    return whole_fmu.build(tmp_path_factory.mktemp("whole"))


@pytest.fixture(scope="module")
def whole(whole_packed):
    return whole_packed()


def of_whole(folder, file, parameters, connections=(), names="ab"):
    """Last values in the log by signal, and the summary; ``parameters`` are those of a."""
    fmus = {name: {"file": str(file), "parameters": parameters if name == "a" else {}} for name in names}
    run = {"step": H, "stop": 20 * H, "coupling": {"scheme": "jacobi", "hold": "constant"}}
    table = {"name": "w", "title": "w", "assembly": "fmus", "run": run, "fmu": fmus, "connections": [*connections]}
    summary = simulate(any_from_table(table, "w.toml"), folder / "w.mcap")
    with Log(folder / "w.mcap") as log:
        return {name: log.signal(name)[1][-1] for name in log.signals if not name.endswith("h")}, summary


LARGEST = {
    "Int8": 127, "Int16": -(2**15), "Int32": 0, "Int64": 5_000_000_000,
    "UInt8": 255, "UInt16": 2**16 - 1, "UInt32": 3_000_000_000, "UInt64": 2**53 - 1,
}  # fmt: skip


def test_whole_numbers_keep_the_range_of_their_type(whole, tmp_path):
    """Through start values, connections and the log; 32 bits would make 705,032,704 of 5,000,000,000."""
    wires = [f"a.y.{kind} -> b.u.{kind}" for kind in LARGEST]
    given = {f"p.{kind}": value for kind, value in LARGEST.items()}
    found, summary = of_whole(tmp_path, whole, given, wires)
    assert summary["status"] == "ok", summary["message"]
    for kind, value in LARGEST.items():
        assert [found[f"{name}.{kind}"] for name in ("stats.a.y", "a.y", "b.u", "stats.b.y")] == [value] * 4
    assert np.int64(LARGEST["Int64"]).astype(np.int32) == 705_032_704


@pytest.mark.parametrize(("given", "wires", "said"), [
    ({"p.UInt8": 300}, [], "a: parameter 'p.UInt8' = 300: must be 0 to 255"),
    ({"p.Int64": 2**63}, [], f"a: parameter 'p.Int64' = {2**63}: must be {-2**63} to {2**63 - 1}"),
    ({"p.UInt32": -1}, [], f"a: parameter 'p.UInt32' = -1: must be 0 to {2**32 - 1}"),
    ({"p.UInt32": 1.5}, [], "a: parameter 'p.UInt32' = 1.5: must be of type UInt32"),
    ({"p.Int64": 300}, ["a.y.Int64 -> b.u.Int8"], "b: a.y.Int64 -> b.u.Int8 is 300: it can be -128 to 127"),
    ({"p.Int64": 2**60}, ["a.y.Int64 -> b.u.Int64"],
     f"b: a.y.Int64 -> b.u.Int64 is {2**60}: it can be {1 - 2**53} to {2**53 - 1}"),
    ({"p.UInt64": 2**64 - 2**11}, ["a.y.UInt64 -> b.u.UInt64"],
     f"b: a.y.UInt64 -> b.u.UInt64 is {2**64 - 2**11}: it can be 0 to {2**53 - 1}"),
    ({"p.e": 6}, [], "a: parameter 'p.e' = 6: must be one of 1 low, 5 middle, 9 high"),
    ({"p.e": "highest"}, [], "a: parameter 'p.e' = 'highest': must be one of 1 low, 5 middle, 9 high"),
    ({"p.e": True}, [], "a: parameter 'p.e' = True: must be one of 1 low, 5 middle, 9 high"),
])  # fmt: skip
def test_numbers_that_do_not_fit_are_refused_before_the_run(whole, tmp_path, given, wires, said):
    with pytest.raises(ComponentFailed) as caught:
        of_whole(tmp_path, whole, given, wires)
    assert str(caught.value).startswith(said)
    assert not (tmp_path / "w.mcap").exists()


@pytest.mark.parametrize(("kind", "value", "held"), [
    ("Int64", 2**53 + 1, 2**53), ("Int64", -(2**60) - 1, -(2**60)), ("UInt64", 2**63 - 1, 2**63),
    ("UInt64", 2**64 - 1, 2**63),
])  # fmt: skip
def test_a_number_that_a_log_cannot_hold_is_a_warning_with_its_value(whole, tmp_path, kind, value, held):
    found, summary = of_whole(tmp_path, whole, {f"p.{kind}": value}, [])
    assert summary["status"] == "ok", summary["message"]
    assert [each["text"] for each in summary["warnings"] if each["component"] == "a"] == [
        f"output 'y.{kind}' is {value}, which the log cannot hold: it has {held}"
    ]
    assert found[f"stats.a.y.{kind}"] == held
    _, exact = of_whole(tmp_path, whole, {f"p.{kind}": 2**53 - 1}, [])
    assert exact["warnings"] == []


@pytest.mark.parametrize("way", ["kernels", "Python"])
def test_a_number_that_does_not_fit_later_fails_the_run_with_link_and_time(whole, tmp_path, monkeypatch, way):
    """Each step adds 30: after five of them it is beyond 127."""
    monkeypatch.setattr("orchestrator.cosim.coupling.scheme.CAN_STEP", way != "Python")
    found, summary = of_whole(tmp_path, whole, {"p.Int32": 30}, ["a.y.Int64 -> b.u.Int8"])
    time = 0.05 if way == "kernels" else 0.04  # in Python that of the last step
    allowed = f"it can be -128 to 127 (fmi3DoStep, t = {time} s)"
    assert summary["message"] == f"b: a.y.Int64 -> b.u.Int8 is 150: {allowed}"
    assert (summary["status"], found["b.u.Int8"]) == ("failed", 120)
    assert verify(tmp_path / "w.mcap").code == 0


ENDED = "a has ended the run at t = "


@pytest.mark.parametrize("way", ["kernels", "Python"])
@pytest.mark.parametrize(("manner", "said", "warned", "steps"), [
    (0, "", "", 5),
    (-1, f"{ENDED}0.03 s", "", 3),  # in a step that it completes, which counts
    (-2, f"{ENDED}0.025 s", "", 2),
    (-3, "a: fmi3DoStep failed with FMI status 2; the step from t = 0.02 s ended at t = 0.025 s", "", 2),
    (-4, "", "fmi3DoStep reaches 0.025 s, not 0.03 s, without early return", 5),
    (-5, "", "fmi3DoStep asks for event mode, which is not used", 5),
])  # fmt: skip
def test_flags_of_a_step_of_fmi3_are_looked_at(whole, tmp_path, monkeypatch, way, manner, said, warned, steps):
    monkeypatch.setattr("orchestrator.cosim.coupling.scheme.CAN_STEP", way != "Python")
    table = {"name": "w", "title": "w", "assembly": "fmus", "run": {"stop": 0.05, "step": 0.01}}
    table["fmu"] = {
        "a": {"file": str(whole), "parameters": {"p.Int16": manner - 30000 * (manner < 0)}},
        "b": {"file": str(whole)},
    }
    summary = simulate(any_from_table(table | {"connections": ["a.y.Int8 -> b.u.Int8"]}, "w.toml"), tmp_path / "w.mcap")
    assert said in summary["message"]
    assert summary["communication_steps"] == steps
    assert (summary["status"] == "failed") == (manner == -3)
    assert [each["text"] for each in summary["warnings"]] == [warned] * bool(warned)
    assert verify(tmp_path / "w.mcap").code == 0


def test_clocks_and_structural_parameters_are_told_or_refused(whole_packed, tmp_path):
    clock = '<Clock name="c" valueReference="91" causality="input" variability="discrete" intervalVariability="fixed"/>'
    late = '<Int8 name="late" valueReference="2" causality="output" variability="discrete" clocks="91"/>'
    sizes = '<UInt64 name="n" valueReference="70" causality="structuralParameter" variability="fixed" start="0"/>'
    fmu = whole_packed("clocks.fmu", more=clock + late + sizes)
    table = {"name": "w", "title": "w", "assembly": "fmus", "run": {"stop": 0.05, "step": 0.01}}
    summary = simulate(any_from_table(table | {"fmu": {"a": {"file": str(fmu)}}}, "w.toml"), tmp_path / "w.mcap")
    told = "its clocks (c) need event mode, which is not used: late may keep their start values"
    assert [each["text"] for each in summary["warnings"]] == [told]
    table["fmu"] = {"a": {"file": str(fmu), "parameters": {"n": 5}}}
    with pytest.raises((BadInput, ComponentFailed), match="'n' is a structural parameter: arrays keep their sizes"):
        simulate(any_from_table(table, "w.toml"), tmp_path / "n.mcap")
    assert not (tmp_path / "n.mcap").exists()


@pytest.mark.parametrize(("given", "value"), [("high", 9), (5, 5)])
def test_an_enumeration_takes_an_item_or_its_name(whole, tmp_path, given, value):
    assert of_whole(tmp_path, whole, {"p.e": given}, names="a")[0]["stats.a.y.e"] == value
