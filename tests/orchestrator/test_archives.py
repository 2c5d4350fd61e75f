"""SSP archives as the standard has them: systems in systems, mappings, units, start values, dictionaries."""

import itertools

import foreign_fmus
import pytest
from foreign_fmus import Variable
from gain_fmus import START, gain_fmu, in_unit, with_maximum, with_units
from ssd_texts import MILLIMETRES, SPACES, bound, component, connection, connectors, document, packed, system, values

from fmus.vehicles.tables import BadInput
from orchestrator.execution.simulate import simulate
from orchestrator.files import budget
from orchestrator.fmi.slave import ComponentFailed
from orchestrator.log.reader import Log
from orchestrator.scene.ssp_scene import load_ssp

gain = pytest.fixture(scope="module")(gain_fmu)


def run(tmp_path, ssd, gain, settings=(), **files):
    """Last outputs by "component.variable", and the path of the log."""
    archive = packed(tmp_path / "t.ssp", ssd, **{"resources/gain.fmu": gain} | files)
    path = tmp_path / "t.mcap"
    summary = simulate(load_ssp(archive, None, settings), path)
    assert (summary["status"], summary["message"]) == ("ok", "")
    with Log(path) as log:
        found = {}
        for topic in log.topics:
            if topic.endswith("/out"):
                series = log.read(topic)
                found |= {
                    f"{topic.split('/')[1]}.{name}": value
                    for name, value in zip(series.names, series.values[0], strict=True)
                }
    return found, path


# --- start values in the order of flow ---------------------------------------------------------------


@pytest.mark.long
def test_any_order_of_a_chain_starts_with_the_values_that_flow(gain, tmp_path):
    """Three gains of 2 behind 3.0: 6, 12, 24, in all six orders and to the bit."""
    digests = set()
    for order in itertools.permutations("abc"):
        inner = {"a": bound(START)}
        elements = "".join(component(name, inner.get(name, "")) for name in order)
        wires = connection("a.y", "b.u") + connection("b.y", "c.u")
        found, path = run(tmp_path, document(system(elements, wires)), gain)
        assert [found[f"{name}.y"] for name in "abc"] == [6.0, 12.0, 24.0]
        with Log(path) as log:
            digests.add(tuple(log.read(f"/{name}/{way}").values.tobytes() for name in "abc" for way in ("in", "out")))
    assert len(digests) == 1


def loop(*gains):
    """y_a = k y_b, y_b = k y_a has the solution 0, which the rounds approach, if they settle."""
    inner = [bound(values(k=("Real", k), u=("Real", 1.0))) for k in gains]
    wires = connection("a.y", "b.u") + connection("b.y", "a.u")
    return document(system(component("a", inner[0]) + component("b", inner[1]), wires))


@pytest.mark.parametrize(("one", "other"), [(1.5, 1.5), (-1.0, 1.0)])
def test_a_loop_that_does_not_settle_is_refused(gain, tmp_path, one, other):
    """It grows, or it swings."""
    with pytest.raises(ComponentFailed):
        run(tmp_path, loop(one, other), gain)


# --- systems in systems ------------------------------------------------------------------------------


def nested(outer_values="", inner_values="", own=""):
    wires = connection("in", "g.u") + connection("g.y", "out") + connection("k", "g.k")
    ends = connectors("in input", "out output", "k parameter")
    inner = system(component("g", own), wires, ends + inner_values, name="inner")
    elements = component("s", bound(START)) + inner + component("g")
    return document(system(elements, connection("s.y", "inner.in") + connection("inner.out", "g.u"), outer_values))


@pytest.mark.parametrize(("outer", "inner", "own", "expected"), [
    ("", "", 5.0, 5.0),
    ("", 7.0, 5.0, 7.0),  # a system outweighs what is in it
    ("inner__k", 7.0, 5.0, 11.0),  # a connector of the inner system
    ("inner__g__k", 7.0, 5.0, 11.0),  # a component in it
])  # fmt: skip
def test_the_highest_level_gives_a_parameter(gain, tmp_path, outer, inner, own, expected):
    bindings = [bound(values(**{name: ("Real", k)})) if name and k else "" for name, k in ((outer, 11.0), ("k", inner))]
    found, path = run(tmp_path, nested(*bindings, bound(values(k=("Real", own)))), gain)
    assert (found["s.y"], found["inner_g.y"], found["g.y"]) == (6.0, 6.0 * expected, 12.0 * expected)
    with Log(path) as log:
        assert set(log.table("scene.json")["connections"]) == {"s.y -> inner_g.u", "inner_g.y -> g.u"}


def test_an_archive_can_be_a_component_of_another(gain, tmp_path):
    inner = document(
        system(component("g"), connection("u", "g.u") + connection("g.y", "y"), connectors("u input", "y output"))
    )
    file = packed(tmp_path / "inner.ssp", inner, **{"resources/gain.fmu": gain})
    own = bound(values(g__k=("Real", 10.0)))
    package = f'<ssd:Component name="p" type="application/x-ssp-package" source="inner.ssp">{own}</ssd:Component>'
    ssd = document(system(component("s", bound(START)) + package, connection("s.y", "p.u")))
    found, _ = run(tmp_path, ssd, gain, **{"inner.ssp": file})
    assert (found["s.y"], found["p_g.y"]) == (6.0, 60.0)


# --- mappings, types, units --------------------------------------------------------------------------


def dictionary():
    """Signals of a dictionary join what refers to it, in other units."""
    bus = (
        '<ssd:SignalDictionaries><ssd:SignalDictionary name="bus"><ssb:SignalDictionary version="1.0">'
        '<ssb:DictionaryEntry name="level"><ssc:Real unit="mm"/></ssb:DictionaryEntry>'
        "</ssb:SignalDictionary></ssd:SignalDictionary></ssd:SignalDictionaries>"
    )
    reference = '<ssd:SignalDictionaryReference name="{}" dictionary="bus"/>'
    inner = system(component("g") + reference.format("b"), connection("b.level", "g.u"), name="inner")
    elements = component("s", connectors("y output m") + bound(START)) + reference.format("bus") + inner
    return document(system(elements, connection("s.y", "bus.level"), more=bus), MILLIMETRES)


MAPPING = (
    '<ssm:MappingEntry source="level" target="s.u">'
    '<ssc:LinearTransformation factor="2" offset="10"/></ssm:MappingEntry>'
    '<ssm:MappingEntry source="level" target="g.k"/>'
)
LAST = bound(values("g.", k=("Real", 3.0)), values(g__k=("Real", 4.0)), values("s.", u=("Integer", 1)))


ZERO = pytest.approx(0.0, abs=1e-10)
ITSELF = bound(values(k=("Real", 0.5), u=("Real", 1.0)))


@pytest.mark.parametrize(("ssd", "expected"), [
    (loop(0.5, 0.5), {"a.y": ZERO, "b.y": ZERO}), (loop(-0.75, -0.75), {"a.y": ZERO, "b.y": ZERO}),
    (document(system(component("a", ITSELF), connection("a.y", "a.u"))), {"a.y": ZERO}),  # initialised once
    (document(system(component("s") + component("g"), connection("s.y", "g.u"), LAST)),  # of one level the last binding
     {"s.y": 2.0, "g.y": 8.0}),
    (document(system(component("s", bound(START)) + component("g"), connection("g.u", "s.y"))), {"g.y": 12.0}),
    (dictionary(), {"inner_g.y": 12000.0}),  # 6 m are 6000 mm
    (document(system(component("s") + component("g"), connection("s.y", "g.u"),
                     bound(values("", MAPPING, level=("Real", 5.0), k=("Real", 99.0))))), {"s.y": 40.0, "g.y": 200.0}),
    (document(system(component("a", bound(START))), version="2.0").replace("ssv:Real", "ssv:Float64"), {"a.y": 6.0}),
])  # fmt: skip
def test_outputs_of_archives(gain, tmp_path, ssd, expected):
    found, _ = run(tmp_path, ssd, gain)
    assert {name: found[name] for name in expected} == expected


def test_values_of_all_types(gain, tmp_path, caplog):
    given = values(
        gear_start=("Enumeration", "road"),
        on_start=("Boolean", "true"),
        word_start=("String", "go"),
        whole=("Integer", 7),
    )
    elements = component("a", bound(given, values(nobody=("Real", 1.0)))) + component("b")
    scene = load_ssp(packed(tmp_path / "t.ssp", document(system(elements)), **{"resources/gain.fmu": gain}), None, ())
    assert scene.fmu["a"].parameters == {"gear_start": 3, "on_start": True, "word_start": "go", "whole": 7}
    assert "parameter 'nobody' is ignored: there is no 'nobody' to take it" in caplog.text
    assert run(tmp_path, document(system(elements)), gain)[0]["a.y"] == 0.0


@pytest.mark.parametrize(("fmus", "connected", "more", "inside", "expected"), [
    (("", ""), ("m", "mm"), "", "", 6000.0),  # by connectors alone
    (("", ""), ("m", "mm"), 'suppressUnitConversion="true"', "", 6.0),
    (("m", "mm"), ("", ""), "", "", 6000.0),  # by the variables
    (("m", "mm"), ("m", "mm"), 'suppressUnitConversion="true"', "", 6.0),
    (("m", "mm"), ("", ""), "", '<ssc:LinearTransformation factor="2" offset="1"/>', 12001.0),
    (("", ""), ("m", "mm"), 'suppressUnitConversion="1"', '<ssc:LinearTransformation factor="2"/>', 12.0),
    (("", ""), ("m", ""), "", "", 6.0),
])  # fmt: skip
def test_units_of_a_connection_are_converted(gain, tmp_path, fmus, connected, more, inside, expected):
    files = {}
    for name, unit, place in zip(("s", "g"), fmus, (1, 0), strict=True):
        pair = ("", unit) if place else (unit, "")
        files[f"resources/{name}.fmu"] = with_units(gain, tmp_path / f"{name}.fmu", *pair) if unit else gain
    one, other = (f" {unit}" if unit else "" for unit in connected)
    elements = component("s", connectors(f"y output{one}") + bound(START), "resources/s.fmu")
    elements += component("g", connectors(f"u input{other}"), "resources/g.fmu")
    ssd = document(system(elements, connection("s.y", "g.u", inside, more)), MILLIMETRES)
    found, _ = run(tmp_path, ssd, gain, **files)
    assert found["g.y"] == pytest.approx(2.0 * expected, rel=1e-14)
    assert expected == 6.0 or abs(found["g.y"] / 12.0 - 1.0) > 0.1


def test_a_value_in_another_unit_is_converted(gain, tmp_path):
    cold = with_units(gain, tmp_path / "cold.fmu", "K", "")
    units = '<ssv:Units><ssc:Unit name="degC"><ssc:BaseUnit K="1" offset="273.15"/></ssc:Unit></ssv:Units>'
    binding = values(u=("Real", 20.0)).replace('value="20.0"', 'value="20.0" unit="degC"')
    binding = binding.replace("</ssv:Parameters>", f"</ssv:Parameters>{units}")
    ssd = document(system(component("s", bound(binding), "resources/cold.fmu")))
    assert run(tmp_path, ssd, gain, **{"resources/cold.fmu": cold})[0]["s.y"] == 2.0 * 293.15


@pytest.mark.parametrize("binding", [
    in_unit("m", "m"), in_unit("mm"), bound(values(k=("Real", 5.0))),
    bound(values(k=("Real", 2.0)), values(k=("Real", 3.0))),
])  # fmt: skip
def test_values_at_their_bounds_in_known_units_and_of_two_bindings_are_taken(gain, tmp_path, binding):
    fmu = with_maximum(gain, tmp_path / "bounded.fmu")
    ssd = document(system(component("s", binding, "resources/b.fmu")), MILLIMETRES)
    load_ssp(packed(tmp_path / "t.ssp", ssd, **{"resources/b.fmu": fmu}), None, ())


def test_a_unit_in_square_brackets_is_its_plain_name(gain, tmp_path, caplog):
    metres = with_units(gain, tmp_path / "m.fmu", "m", "")
    ssd = document(system(component("s", in_unit("[m]"), "resources/m.fmu")))
    assert run(tmp_path, ssd, gain, **{"resources/m.fmu": metres})[0]["s.y"] == 6.0
    assert "parameter 'u' = 3.0 (Real): the unit '[m]' is not defined: 'm' is taken" in caplog.text
    millimetres = with_units(gain, tmp_path / "mm.fmu", "mm", "")
    files = {"resources/m.fmu": millimetres}
    assert run(tmp_path, ssd.replace("<ssd:Default", f"{MILLIMETRES}<ssd:Default"), gain, **files)[0]["s.y"] == 6000.0


# --- experiment, sources, versions -------------------------------------------------------------------


@pytest.mark.parametrize("in_process", [False, True])
@pytest.mark.parametrize("way", ["kernels", "Python"])
def test_an_experiment_may_begin_at_any_time(tmp_path, monkeypatch, in_process, way):
    """An FMU hears the time of the archive, at which its output ends to be finite; the log counts from the start."""
    monkeypatch.setattr("orchestrator.cosim.coupling.scheme.CAN_STEP", way != "Python")
    guest = foreign_fmus.build(
        tmp_path / "guest.fmu", "guest",
        [Variable("u", "input"), Variable("y", "output"), Variable("together", "output"),
         Variable("when", "parameter", 1e6 + 0.0025), Variable("manner", "parameter", 4, "Integer"),
         Variable("steps", "output", 0, "Integer")],
    )  # fmt: skip
    ssd = document(system(component("a")), experiment='startTime="1000000" stopTime="1000000.004"')
    archive = packed(tmp_path / "t.ssp", ssd, **{"resources/gain.fmu": guest})
    summary = simulate(load_ssp(archive, None, {"fmu.a.in_process": in_process}), tmp_path / "t.mcap")
    assert summary["message"].startswith("a: output 'y' is nan")
    assert summary["message"].endswith("(fmi2GetReal, t = 0.002 s)")
    with Log(tmp_path / "t.mcap") as log:
        assert log.read("/a/out").t[-1] == pytest.approx(0.002)
        assert log.table("scene.json")["run"]["start"] == 1e6


def test_a_step_divides_the_experiment(gain, tmp_path):
    ssd = document(system(component("a")), experiment='stopTime="0.0105"')
    scene = load_ssp(packed(tmp_path / "t.ssp", ssd, **{"resources/gain.fmu": gain}), None, ())
    assert (scene.run.steps, scene.run.stop) == (11, 0.0105)


def test_sources_are_uris(gain, tmp_path):
    ssd = document(system(component("a", bound(START), "resources/my%20gain.fmu")))
    assert run(tmp_path, ssd, gain, **{"resources/my gain.fmu": gain})[0]["a.y"] == 6.0


# --- budget of an archive ----------------------------------------------------------------------------


def named_twice(gain, tmp_path, kind):
    """Archive of a system that names the next one twice, which does so too: four components, six uses."""
    ending = {"definition": "ssd", "package": "ssp"}[kind]
    text, files = document(system(component("g"))), {"resources/gain.fmu": gain}
    for k in range(2):
        name = f"{k}.{ending}"
        files |= {name: packed(tmp_path / name, text, **files) if kind == "package" else text}
        one = f'<ssd:Component name="{{}}" type="application/x-ssp-{kind}" source="{name}"/>'
        text = document(system(one.format("a") + one.format("b")))
    return packed(tmp_path / "t.ssp", text, **files)


@pytest.mark.parametrize("kind", ["definition", "package"])
def test_systems_that_name_the_next_one_twice_have_a_budget(gain, tmp_path, monkeypatch, kind):
    archive = named_twice(gain, tmp_path, kind)
    monkeypatch.setattr(budget, "PART", 1 << 30)
    monkeypatch.setattr(budget, "PARTS", 20)
    assert load_ssp(archive, None, ()).fmu.keys() == {"a_a_g", "a_b_g", "b_a_g", "b_b_g"}
    monkeypatch.setattr(budget, "PARTS", 9)
    with pytest.raises(BadInput, match="more than 9 parts"):
        load_ssp(archive, None, ())


def test_a_set_that_is_bound_many_times_has_a_budget(gain, tmp_path, monkeypatch):
    names = ("k", *(f"other{k}" for k in range(9)))
    parameters = "".join(f'<ssv:Parameter name="{name}"><ssv:Real value="3"/></ssv:Parameter>' for name in names)
    given = f"<ssv:ParameterSet {SPACES}><ssv:Parameters>{parameters}</ssv:Parameters></ssv:ParameterSet>"
    archive = []
    for count in (1, 20):
        inner = bound('<ssd:ParameterBinding source="k.ssv"/>' * count)
        files = {"resources/gain.fmu": gain, "k.ssv": given}
        archive.append(packed(tmp_path / f"{count}.ssp", document(system(component("g", inner))), **files))
    monkeypatch.setattr(budget, "ELEMENTS", 100)
    assert load_ssp(archive[0], None, ()).fmu["g"].parameters == {"k": 3.0}
    with pytest.raises(BadInput, match="more than 100 elements"):
        load_ssp(archive[1], None, ())


def test_a_value_goes_through_as_many_connections_as_there_are(gain, tmp_path):
    passing = system("", connection("in", "out"), connectors("in input", "out output"), name="{}")
    ways = ["x", *(f"p{k}.{end}" for k in range(600) for end in ("in", "out")), "g.u"]
    wires = "".join(connection(*pair) for pair in zip(ways[::2], ways[1::2], strict=True))
    before = connectors("x input") + bound(values(x=("Real", 3.0)))
    elements = "".join(passing.format(f"p{k}") for k in range(600)) + component("g")
    scene = load_ssp(
        packed(tmp_path / "t.ssp", document(system(elements, wires, before)), **{"resources/gain.fmu": gain}), None, ()
    )
    assert scene.fmu["g"].parameters == {"u": 3.0}
