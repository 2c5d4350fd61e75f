"""Keys of scenes and vehicles: their meanings, the reference page, schemas for editors, commented files."""

import copy
import json
import re
import tomllib
from pathlib import Path

import pytest
from jsonschema import Draft202012Validator
from scene_files import toml_lines

from fmus.precompile import component_ports
from fmus.vehicles.ranges import VEHICLE
from fmus.vehicles.tables import BadInput
from orchestrator.cli.key_reference import key_text, measure_keys, page
from orchestrator.results.measures import FIGURES
from orchestrator.scene import commented_file
from orchestrator.scene import scene as scene_module
from orchestrator.scene.assembly import assemble
from orchestrator.scene.drive_tables import DriverTable, DriveTable, HitchTable
from orchestrator.scene.keys import OVERRIDES, facts, scene_keys, scene_schema, vehicle_keys, vehicle_schema
from orchestrator.scene.scene import SCENE_KINDS, load, read_scene, read_vehicle, scene_names
from orchestrator.scene.settings import entries, keys, toml_text

ORCHESTRATOR = Path(scene_module.__file__).parents[1]
KEYS = {key.key: key for key in scene_keys()}


def types(entry):
    """All types of values in a schema of a key."""
    inner = (*entry.get("anyOf", ()), *entry.get("prefixItems", ()), *filter(None, [entry.get("items")]))
    return {entry.get("type"), *(kind for part in inner for kind in types(part))}


NAMED = "expect.NAME", "fmu.NAME", "vehicle.seat.NAME", "vehicle.wheel.NAME", "vehicle.right.wheel.NAME"


def test_every_key_has_a_meaning_and_every_quantity_a_unit():
    schema, count = scene_schema(), 0
    for kind in SCENE_KINDS.values():
        for key, entry, _ in entries(schema["$defs"][kind.__name__], schema["$defs"]):
            found = KEYS[key]
            assert len(found.meaning) > 10 or key.endswith(NAMED), key
            assert not found.meaning.endswith("."), key
            assert bool(found.unit) == ("number" in types(entry)), key
            count += bool(found.unit)
    assert count > 200
    assert {key for kind in SCENE_KINDS.values() for key in keys(kind)} == KEYS.keys() - {"vehicle.base"}
    for measure in measure_keys():
        assert measure.unit, measure
        assert len(measure.meaning) > 10, measure
    assert [measure.key for measure in measure_keys()] == [*FIGURES]


def test_keys_of_drives_driver_and_load_are_parameters_of_their_fmus():
    """A key that names no parameter would do nothing, and the page would lack its default."""
    parts = assemble(load("serpentine", None, ["hitch.force=1"])).parts
    ports = {part.kind: {port.name: port for port in component_ports(part.kind, part.config)} for part in parts}
    tables = (
        ("drive", DriveTable, "SprocketDrive", {"ramp_time", "demand"}, {"stop"}),
        ("driver", DriverTable, "Driver", {"ramp_time"}, {"width", "friction"}),
        ("hitch", HitchTable, "Chassis", {"ramp_time"}, set()),
    )
    for name, table, kind, others, without_default in tables:
        parameters = table.fmu_parameters()
        assert table.model_fields.keys() - parameters.keys() == others
        for key, one in parameters.items():
            port, shown = ports[kind][one.name], KEYS[f"{name}.{key}"]
            if isinstance(port.start, float):
                assert shown.unit.replace("^", "").replace(" ", ".") == port.unit, key
                assert shown.default == ("" if key in without_default else toml_text(port.start)), key


@pytest.mark.parametrize(
    ("key", "text"),
    [
        ("run.stop", "run.stop: s, 1e-09 to 1e+09, required\n    end of the run, a multiple of step"),
        ("run.checkpoints", "run.checkpoints: s, > 0 or false, default 0.5\n    time from one checkpoint"),
        ("track.step", "track.step: s, 1e-12 to 10, default 0.001\n    largest internal step"),
        ("track.rtol", "track.rtol: ratio, 1e-13 to 0.1, default 1e-06\n    relative error of an internal step"),
        ("track.model", 'track.model: "flexible" or "rigid", required\n'),
        ("chain.links", "chain.links: whole number, 2 to 4096, required, assembly chain\n    number of links"),
        ("driver.lateral_acceleration", "driver.lateral_acceleration: m/s^2, > 0, default 10.0, assembly vehicle\n"),
        ("drive.gear_ratio", "drive.gear_ratio: ratio, > 0, default 1.0, assembly bench, rig, vehicle\n"),
        ("drive.left.ramp_time", "drive.left.ramp_time: s, >= 0, assembly vehicle\n"),
        ("drive.speed_points", "drive.speed_points: s, rad/s, list of [>= 0, number] or text, assembly bench"),
        ("vehicle.contact.ground.friction", "vehicle.contact.ground.friction: ratio, 0 to 100, required\n    coeff"),
        ("vehicle.chassis.inertia", "vehicle.chassis.inertia: kg m^2, [> 0, > 0, > 0], required\n    moments of"),
        ("vehicle.tensioner.travel", "vehicle.tensioner.travel: m, 1e-06 to 50, default 0.1\n"),
        (
            "push",
            "push: N, -1e+11 to 1e+11, default 0.0, assembly vehicle, solved by the run\n    share of the",
        ),
        ("expect.NAME.measure", f"expect.NAME.measure: one of {len(FIGURES)} names\n    measure that is"),
    ],
)
def test_text_of_a_key(key, text):
    assert key_text(KEYS[key]).startswith(text)


def test_the_reference_page_is_that_of_the_code():
    """If this fails: cotrack keys --markdown > orchestrator/keys.md."""
    written = (ORCHESTRATOR / "keys.md").read_text(encoding="utf-8")
    assert written == page(scene_keys(), measure_keys()) + "\n"


def keys_of_page(text):
    """Keys that a reference page has, in a list or by the sentence that names another table."""
    found, table = {"": {}}, ""
    for line in text.partition("## Measures")[0].splitlines():
        if line.startswith("## "):
            table = line.removeprefix("## ").strip("[]").replace("Scene", "")
            found[table] = {}
        elif row := re.match(r"- `(\w+)` \((.+?)\): .{5}", line):
            found[table][row[1]] = row[2]
        elif line.startswith("Tables: "):
            found[table] |= dict.fromkeys(re.findall(r"\[`(\w+)`\]\(#", line), "")
        elif repeated := re.match(r"The keys of `\[(.*?)\]`(?:, but for (.*?))?(?:, with another (.*?))?\.", line):
            left_out = re.findall(r"`(\w+)`", repeated[2] or "")
            found[table] |= {name: value for name, value in found[repeated[1]].items() if name not in left_out}
    named = {f"{table}.{name}".lstrip(".") for table, rows in found.items() for name in rows}
    return named | {table for table in found if table.endswith(".NAME")}


def test_the_page_loses_no_key_by_its_sentences():
    text = page(scene_keys(), [])
    assert keys_of_page(text) == KEYS.keys()
    assert text.count("None has a default.") == 2
    for key in ("drive.right.speed", "vehicle.right.suspension.damping", "vehicle.contact.ground.friction"):
        assert KEYS[key].meaning in text, key
    assert keys_of_page(text.replace("but for `left`", "but for `lost`")) != KEYS.keys(), "the twin"


def test_keys_command(cotrack):
    out = cotrack.done("keys", "Friction_V")
    assert [line.partition(":")[0] for line in out.splitlines()[::2]] == [
        f"vehicle.contact.{pair}.friction_velocity" for pair in ("sprocket", "wheel", "ground")
    ]
    found = json.loads(cotrack("keys", "--json")[1].splitlines()[-1])
    assert len(found["keys"]) == len(KEYS)
    assert {"key": "sag", "unit": "m"}.items() <= {one["key"]: one for one in found["measures"]}["sag"].items()
    assert (
        "rut_depth: m\n    Depth of the deepest link of a track, or of all, in the soil, m; none on hard"
        in cotrack("keys", "rut")[1]
    )
    of_rollers = cotrack.done("keys", "roller")  # not those of "controller"
    assert "vehicle.return_roller.x:" in of_rollers
    assert "drive." not in of_rollers
    assert "drive.torque_limit:" in cotrack.done("keys", "controller"), "the twin"
    assert "yaw_rate: rad/s\n    Mean rate about the vertical" in cotrack("keys", "the vertical")[1]


# --- schemas ---------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def check():
    """Return a function that gives the messages of the schema of a kind of file for a raw table."""
    checkers = {"scene": Draft202012Validator(scene_schema()), "vehicle": Draft202012Validator(vehicle_schema())}
    for checker in checkers.values():
        checker.check_schema(checker.schema)

    def messages(kind, table):
        errors = [*checkers[kind].iter_errors(table)]
        return [each.message for error in errors for each in error.context or [error]]

    return messages


@pytest.mark.parametrize("name", scene_names())
def test_files_of_the_gallery_fit_the_schema(check, name):
    assert check("scene", read_scene(name)[1]) == []


def test_the_packaged_vehicle_fits_the_schema(check):
    vehicle = read_vehicle("m113")
    assert check("vehicle", vehicle) == []
    for key in ("name", "chassis", "sprocket"):
        assert check("vehicle", {k: v for k, v in vehicle.items() if k != key}) == [f"{key!r} is a required property"]
    assert check("vehicle", {**vehicle, "masss": 1}) == [
        "Additional properties are not allowed ('masss' was unexpected)"
    ]


ACCEPTED = (
    ("run.step", "2 ms"), ("run.step", 2e-3), ("run.coupling", "jacobi"), ("run.coupling", {"scheme": "jacobi"}),
    ("run.variable", False), ("run.checkpoints", False), ("run.allow", "penetration"), ("track", "rigid"),
    ("track.link_outputs", "all"), ("track.link_outputs", ["wheels"]), ("vehicle", "own.toml"), ("driver", False),
    ("vehicle", {"base": "m113", "chassis": {"mass": "6 t"}}), ("drive.speed_points", "speed.csv"),
    ("drive.speed_points", [[0, 0], ["1 s", "5 rad/s"]]), ("start.heading", "-90 deg"),
    ("drive", {"left": {"mode": "speed"}}), ("driver", {"arcs": [["4 m", 0.1], [0, "90 deg"]]}), ("name", "other"),
    ("vehicle.track.tension", "-1 kN"),
)  # fmt: skip
REFUSED = (
    ("run.stepp", 1.0), ("drive.sped", 1.0), ("vehicle.mass", 1.0), ("chain", {"links": 8}),
    ("expect.energy.signl", "a"), ("run.step", 20.0), ("run.step", "-2 ms"), ("run.step", "soon"), ("run.step", True),
    ("run.outputs", 0),
    ("vehicle.chassis.mass", 0.0), ("vehicle.chassis.mass", 1e300), ("vehicle.contact.ground.friction", -0.1),
    ("vehicle.sprocket.teeth", 41), ("track", "soft"), ("track.integrator", "euler"), ("start.position", [0, 0]),
    ("drive.left.brake", 1e12), ("drive.speed_points", [[0, 0, 0]]), ("expect.energy.measure", "energi"),
    ("tracks", ["top"]),
)  # fmt: skip


def test_schema_and_command_accept_and_refuse_the_same(check, tmp_path):
    """Values that the schema accepts are read, those that it refuses are refused."""
    (tmp_path / "speed.csv").write_text("0,0\n1,5\n")
    for values, refused in ((ACCEPTED, False), (REFUSED, True)):
        for key, value in values:
            table = copy.deepcopy(read_scene("straight")[1])
            *path, name = key.split(".")
            place = table
            if path[:1] == ["vehicle"]:
                table["vehicle"] = {"base": "m113"}
            for part in path:
                place = place.setdefault(part, {})
            place[name] = value
            assert bool(check("scene", table)) == refused, (key, value)
            if refused:
                (tmp_path / "own.toml").write_text(toml_lines(table))
                with pytest.raises(BadInput):
                    load(str(tmp_path / "own.toml"))


def test_schema_command(cotrack):
    for kind, made in (("scene", scene_schema()), ("vehicle", vehicle_schema())):
        status, out, _ = cotrack("schema", kind)
        assert (status, json.loads(out)) == (0, made)
    friction = made["$defs"]["ContactLawTable"]["properties"]["friction"]
    assert friction == {
        "type": "number", "minimum": 0, "maximum": 100.0, "unit": "1", "description": "coefficient of friction",
    }  # fmt: skip


# --- commented files -------------------------------------------------------------------------------


@pytest.mark.parametrize("name", scene_names())
def test_a_commented_scene_resolves_as_its_source(cotrack, check, tmp_path, name):
    assert cotrack("new", "scene", "own", "--from", name) == (0, "own.toml\n", "")
    source, written = load(name).resolved(), load("own.toml").resolved()
    assert (source.pop("name"), written.pop("name")) == (name, "own")
    assert written == source
    text = (tmp_path / "own.toml").read_text(encoding="utf-8")
    assert check("scene", tomllib.loads(text)) == []
    assert "stop = " in text
    for key in KEYS.values():
        wanted = not key.assembly or source["assembly"] in key.assembly.split(", ")
        if (
            key.meaning
            and not key.solved
            and not key.key.startswith(("vehicle.", "standing.", *OVERRIDES, "start.equilibrium."))
        ):
            assert (key.meaning in text) >= wanted, key.key


def test_defaults_in_comments_are_those_of_the_scene(tmp_path, monkeypatch):
    """A commented key of a table that the file has may be uncommented: nothing changes, or another key must be set."""
    monkeypatch.chdir(tmp_path)
    path = commented_file.new_file("scene", "own")
    lines, same, refused = path.read_text(encoding="utf-8").splitlines(), 0, []
    source, active = load("own.toml").resolved(), True
    for i, line in enumerate(lines):
        active = not line.startswith("# [") if "[" in line.split("=")[0] else active
        key, _, rest = line.removeprefix("# ").partition(" = ")
        if not active or not line.startswith("# ") or rest.strip().startswith("#") or " " in key or not rest:
            continue
        path.write_text("\n".join([*lines[:i], line[2:], *lines[i + 1 :]]), encoding="utf-8")
        try:
            resolved = load("own.toml").resolved()
        except BadInput as error:
            refused.append(key if " needs " in str(error) else str(error))
            continue
        for table in ("run", "track", "drive"):
            resolved[table] = {name: resolved[table][name] for name in source[table]}
        assert {**resolved, "name": "own"} == source, line
        same += 1
    assert same == 24
    of_track = ["formulation", "closure_stiffness", "closure_damping", "rtol", "atol"]
    assert refused == [*of_track, "torque_limit", "gear_ratio", "demand_lag"]


def test_a_commented_vehicle_is_its_source(cotrack, check, tmp_path):
    assert cotrack("new", "vehicle", "tank.toml") == (0, "tank.toml\n", "")
    source, written = (
        load("straight", None, [f"vehicle={name}"]).resolved()["vehicle"] for name in ("m113", "tank.toml")
    )
    assert (source.pop("name"), written.pop("name")) == ("m113", "tank")
    assert "16 tonnes" in source.pop("title")
    assert written.pop("title") == "made from the m113"  # its own title would go on saying 16 tonnes
    assert written == source
    text = (tmp_path / "tank.toml").read_text(encoding="utf-8")
    assert check("vehicle", tomllib.loads(text)) == []
    assert 'mass = "5489.24 kg"  # kg: mass of the hull\n' in text
    assert '# law = "linear"  # law of the normal force ("linear" or "hunt_crossley")\n' in text
    assert all(key.meaning in text and facts(key) for key in vehicle_keys())
    assert cotrack("new", "vehicle", "second", "--from", "tank.toml")[0] == 0


def test_points_of_a_source_elsewhere_are_written(tmp_path, monkeypatch):
    (tmp_path / "far").mkdir()
    (tmp_path / "far" / "speed.csv").write_text("0,0\n1,5\n")
    table = read_scene("straight")[1]
    (tmp_path / "far" / "a.toml").write_text(
        toml_lines({**table, "drive": {"mode": "speed", "speed_points": "speed.csv"}})
    )
    monkeypatch.chdir(tmp_path)
    commented_file.new_file("scene", "b", "far/a.toml")
    assert load("b.toml").drive.speed_points == ((0.0, 0.0), (1.0, 5.0))


@pytest.mark.parametrize(
    "value",
    [0, -1.5, 1e-10, 1e300, float("inf"), True, 'a "b" \\ \n ü', [1, [2.0, "x"]], {"a": {"b c": 1}, "d": []}, {}],
)
def test_text_of_values_reads_back(value):
    assert tomllib.loads(f"x = {toml_text(value)}") == {"x": value}


def test_every_number_of_a_vehicle_has_an_end():
    """In its type, or by a range of its own; a part of 1e17 m is no vehicle."""
    schema, ranges = vehicle_schema(), {one.key for one in VEHICLE}

    def open_ended(entry):
        inner = [*entry.get("anyOf", ()), *entry.get("prefixItems", ()), *filter(None, [entry.get("items")])]
        endless = entry.get("type") == "number" and not {"maximum", "exclusiveMaximum"} & {*entry}
        return endless or any(map(open_ended, inner))

    found = {key.removeprefix("right.") for key, entry, _ in entries(schema, schema["$defs"]) if open_ended(entry)}
    assert found - ranges == set()
    assert "road_wheel.mass" in found
