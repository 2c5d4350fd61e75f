"""Scenes, settings and checks that are not allowed: one sentence for any value."""

import random
import re

import pytest
from pydantic import ValidationError
from scene_files import BARE, scene_file

from fmus.vehicles.tables import BadInput
from orchestrator.scene.kinds import VehicleScene
from orchestrator.scene.scene import changed_scene, from_table, load
from orchestrator.scene.settings import keys

REFUSED = {  # by scene: a setting, and words of its sentence
    "hanging_chain": [
        ("run.stp=1", "unknown key 'run.stp': did you mean 'run.stop'?"),
        ("vehicle.contact.ground.frction=1", "did you mean 'vehicle.contact.ground.friction'?"),
        ("run.step=2 kg", "run.step = '2 kg': must be a quantity in s"),
        ("run.step=soon", "run.step = 'soon'"),
        ("run.step=3 ms", "must be a multiple of step"),
        ("run.stop=-1", "run.stop = -1: must be 1e-09 to 1e+09 s"),
        ("vehicle.chassis.mass=-3 kg", "vehicle.chassis.mass = '-3 kg': must be 0.001 to 1e+08 kg"),
        ("vehicle.chassis.mass=nan", "vehicle.chassis.mass = nan"),
        ("vehicle.gravity=inf", "vehicle.gravity = inf: must be 0 to 1000 m/s^2"),
        ("vehicle=leopard", "no vehicle 'leopard'"),
        ("track=soft", 'must be "flexible" or "rigid"'),
        ("track.rtol=1e-8", "rtol = 1e-08 needs integrator = 'adams' or 'dormand_prince'"),
        ("track.atol=1", "track.atol = 1: must be 1e-13 to 0.1 m"),
        ("track.elasticity=large", 'track.elasticity = \'large\': must be "small_deformation" or "general" or'),
        ("vehicle.sprocket.outer_radius=0.2", "must exceed the pitch radius"),
        ("vehicle.section.torsion=0 m^4", "vehicle.section.torsion = '0 m^4': must be greater than 0 m^4"),
        (
            "vehicle.section.torsion=2e-4",
            "section.torsion = 0.0002 m^4 must not exceed the polar moment bending + lateral_bending = 0.000182 m^4",
        ),
        ("vehicle.seat.A.position=[0, 0, 0]", "seat.A: a name has small letters, digits and _ alone"),
        ("expect.sag.measure=sagg", "no measure 'sagg'"),
        ("chain.links.first=1", "'links' is a value, not a table"),
        ("vehicle.road_wheel.x.9=0", "the list has entries [1] to [5]"),
        ("nonsense", "must be KEY=VALUE"),
        ("assembly=boat", "must be one of chain, bench, rig, vehicle"),
        ("assembly=[1]", "must be one of chain, bench, rig, vehicle"),
        ("run.step=1e-300", "is more than 4294967295 steps of 1e-300 s"),
        ("run.stop=9**9**9 s", "must be a quantity in s: '9' is no known unit"),
        ("run.step=1 ms\nstop=5", "must be a number or a quantity in s"),
        ("run.links=1" + "0" * 5000, "run.links = '10000"),
        ("vehicle=.toml/x.toml", "no vehicle file '.toml/x.toml'"),
        ('vehicle="\\u0000.toml"', "not a readable TOML file: "),
        ("vehicle.road_wheel.x.\N{SUPERSCRIPT ONE}=0", "the list has entries [1] to [5]"),
        ("expect.rest.expected=nan", "expect.rest.expected = nan: must be a finite number"),
        ("start.position=[1e9, 0, 0]", "start.position[1] = 1000000000.0: must be -1e+06 to 1e+06 m"),
        ("name=../../up", "name = '../../up'"),
        ("chain={links=8, ends='held', span=0.5}", "chain: span = 0.5 needs ends = 'pinned', not 'held'"),
        ("chain.spin=1", "spin = 1.0 needs ends = 'loop', not 'pinned'"),
        ("chain.ovalling=1", "ovalling = 1.0 needs ends = 'loop', not 'pinned'"),
    ],
    "released_chain": [
        ("chain.ends=pinned", "ends = 'pinned' needs span"),
        ("chain.ends=hung", 'must be "pinned" or "held" or "lying" or "loop"'),
        ("track.start=crooked", "track.start = 'crooked'"),
    ],
    "spinning_loop": [
        ("chain.links=2", "a loop needs 3 links, not 2"),
        ("chain.spinn=5", "unknown key 'chain.spinn': did you mean 'chain.spin'?"),
    ],
    "straight": [
        ("vehicle.hitch=false", "vehicle.hitch = false: must be a table with the keys x, z"),
        ("vehicle.road_arm.pivot=[]", "vehicle.road_arm.pivot = []: "),
        ("hitch.force=1 m", "hitch.force = '1 m': must be a quantity in N"),
        ("hitch.drag_points=[[1, 2], [1, 3]]", "drag_points: needs at least one point, and speeds that rise"),
        ("hitch.drag_points=none.csv", "hitch.drag_points = 'none.csv': cannot be read"),
        ("seats=['gunner']", "seats names 'gunner': the vehicle has driver"),
        ("seats=['driver', 'driver']", "seats names a seat twice"),
        ("drive.torque_limit=100", "torque_limit = 100.0 needs mode = 'torque' or 'controller', not 'speed'"),
        ("drive.brake=5", "drive: brake = 5.0 needs mode = 'torque' or 'controller', not 'speed'"),
        ("drive.torque=5", "torque = 5.0 needs mode = 'torque', not 'speed'"),
        ("drive={mode='torque', ramp_time=2}", "ramp_time = 2.0 needs mode = 'speed' or 'controller', not 'torque'"),
        ("drive={speed=3, speed_points=[[0, 1]]}", "speed = 3.0 excludes speed_points"),
        ("drive={mode='controller', brake=3, brake_points=[[0, 1]]}", "brake = 3.0 excludes brake_points"),
        ("drive={speed=3, left={mode='torque'}, right={mode='torque'}}", "speed = 3.0 needs mode = 'speed' or"),
        ("drive.stop_time=0.1", "stop_time = 0.1 needs stop"),
        ("ground={grade=0.1, incline_length=2}", "ground: incline_length = 2.0 needs incline_start"),
        ("ground.kerb={y=0.3, rise=0.1, length=2}", "ground.kerb: length = 2.0 needs start"),
        ("ground.rough={iso_class='D', isotropic=true, length=3}", "ground.rough: length = 3.0 needs start"),
    ],
}


@pytest.mark.parametrize(
    ("scene", "setting", "said"), [(scene, *row) for scene, rows in REFUSED.items() for row in rows]
)
def test_bad_settings_are_one_sentence(scene, setting, said):
    with pytest.raises(BadInput) as error:
        load(scene, None, [setting])
    assert said in str(error.value)
    assert "\n" not in str(error.value)
    assert "input" not in str(error.value)
    assert len(str(error.value)) < 400


def test_unknown_scene_names_the_nearest(tmp_path):
    with pytest.raises(BadInput, match="did you mean 'straight'"):
        load("straigt")
    with pytest.raises(BadInput, match="the gallery has"):
        load("xyz")
    with pytest.raises(BadInput, match="no scene file"):
        load(str(tmp_path / "none.toml"))
    broken = tmp_path / "broken.toml"
    for content in ("title = ", "x = " + "[" * 5000):
        broken.write_text(content)
        with pytest.raises(BadInput, match="not a readable TOML"):
            load(str(broken))
    folder = tmp_path / "folder.toml"
    folder.mkdir()
    for text in (str(folder), scene_file(tmp_path, f"vehicle = '{folder}'"), "a\0b.toml"):
        with pytest.raises(BadInput, match="not a readable TOML"):
            load(text)


@pytest.mark.parametrize(
    ("check", "said"),
    [
        ("x = { expected = 1, tolerance = 1 }", "needs either signal or measure"),
        ('x = { signal = "a.b", measure = "sag", expected = 1, tolerance = 1 }', "needs either"),
        *(
            (f"x = {{ {given}, expected = 1, tolerance = 1 }}", f"expect.x.{said}")
            for given, said in (
                (
                    'signal = "chain.speed", from = 0.04, to = 0.01',
                    "from = 0.04 s: is after to = 0.01 s, so the window",
                ),
                ('measure = "sag", from = "40 ms", to = "10 ms"', "from = 0.04 s: is after to = 0.01 s, so the window"),
                ('measure = "yaw_rate", of = "left"', "of = 'left': yaw_rate is of no side or part"),
                ('measure = "slip", of = "upper"', "of = 'upper': slip is of 'left' or 'right'"),
                ('measure = "propulsion"', "of = '': propulsion must be of 'left' or 'right'"),
                ('signal = "chain.speed", of = "left"', "of = 'left': is for a measure; a signal names its component"),
                ('measure = "energy_residual", from = 1', "from = 1 s: energy_residual is of the whole run"),
            )
        ),
        ('x = { signal = "a.b", expected = 1, tolerance = -1 }', "must be 0 or more, in"),
        ('x = { signal = "a.b", reduce = "median", expected = 1, tolerance = 1 }', "reduce"),
        ('x = { signal = "a.b", expect = 1, tolerance = 1 }', "expect"),
        (
            'x = { measure = "sag", reduce = "mean", expected = 1, tolerance = 1 }',
            "expect.x.reduce = 'mean': is for a signal; measure = 'sag' is a number already",
        ),
    ],
)
def test_bad_checks(tmp_path, check, said):
    with pytest.raises(BadInput) as error:
        load(scene_file(tmp_path, more=f"[expect]\n{check}\n"))
    assert said in str(error.value)


def test_a_check_that_is_refused_today_is_read_in_a_log_of_an_earlier_version():
    check = {"measure": "yaw_rate", "of": "left", "from": 0.04, "to": 0.01, "expected": 1.0, "tolerance": 1.0}
    old = load("settle", "rigid", ["expect={}"]).resolved() | {"expect": {"x": check}}
    assert from_table(old, "a.mcap: scene.json").expect["x"].fault.startswith("from = 0.04 s: is after to = 0.01 s")
    with pytest.raises(BadInput, match=r"^a\.toml: expect\.x\.from = 0\.04 s: is after"):
        changed_scene(old, ["run.stop=1"], "a.toml")


HUGE, HUGER = "9" * 400, "0x" + "f" * 5000  # too large for a double, and too large for Python to print
ODD = (HUGE, "-" + HUGE, HUGER, "9" * 5000, "1e400", "nan", "\udcff", "[" * 3000, "[[1]]", "{a = 1}", f'"{HUGE} m"', "")


def leaves(value, above=""):
    """Dotted keys of all values in a table, also of tables and lists."""
    entries = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, inner in entries:
        yield f"{above}{key}"
        yield from leaves(inner, f"{above}{key}.")


def test_no_value_ends_otherwise_than_in_a_sentence():
    """Every key of a scene accepts values of all kinds or refuses them in a sentence."""
    scene_keys = list(leaves(load("hanging_chain").resolved()))
    assert {"run.step", "run.links", "chain.links", "vehicle.road_wheel.x.0"} <= set(scene_keys)
    deep = "a." * 3000 + "a"
    wild = [f"vehicle.road_wheel.x.{HUGE * 13}", deep, f"vehicle.{deep}", "run.\udcff", "", " "]
    refused = 0
    for number, key in enumerate([*scene_keys, *wild]):
        for value in ODD[number % 6 :: 6] if key in scene_keys else ODD:
            try:
                load("hanging_chain", None, [f"{key}={value}"])
            except BadInput:
                refused += 1
    assert refused > 250
    for key in ("run.step", "run.links", "chain.links", "run.outputs", "expect.rest.tolerance"):
        for value in (HUGE, HUGER, "1e400"):
            with pytest.raises(BadInput, match=r"hanging_chain\.toml: "):
                load("hanging_chain", None, [f"{key}={value}"])


@pytest.mark.long
@pytest.mark.parametrize(
    ("replaced", "said"),
    [
        (("links = 8", f"links = {HUGE}"), "chain.links = 999"),
        (('step = "10 ms"', f"step = {HUGE}"), "run.step = 999"),
        (('step = "10 ms"', f"step = {HUGER}"), "run.step = a huge int: must be a finite number in s"),
        (('title = "a chain"', f"title = {HUGER}"), "title = a huge int"),
        (('assembly = "chain"', f"assembly = {HUGER}"), "a huge int: must be one of chain"),
        (('vehicle = "m113"', "vehicle.base." + "a." * 5000 + "a = 1"), "a key has more than 64 parts"),
        (('vehicle = "m113"', "vehicle.base = 1"), "vehicle.base = 1: must be a name"),
        (("links = 8", f"links = {'[' * 5000}"), "not a readable TOML file"),
        (('title = "a chain"', 'title = "\udcff"'), "not a readable TOML file"),
    ],
)
def test_scene_and_vehicle_files_of_any_content_are_one_sentence(tmp_path, replaced, said):
    text = BARE.format(vehicle='vehicle = "m113"')
    assert replaced[0] in text
    (tmp_path / "own.toml").write_bytes(text.replace(*replaced).encode(errors="surrogateescape"))
    with pytest.raises(BadInput) as caught:
        load(str(tmp_path / "own.toml"))
    assert said in str(caught.value)
    vehicle = tmp_path / "vehicle.toml"
    for content in (b"\xff\xfe", b"mass = \xff", b"a = " + b"[" * 5000, f"name = {HUGE * 13}".encode(), b"name = 1"):
        vehicle.write_bytes(content)
        with pytest.raises(BadInput, match=r"vehicle\.toml.*: not a readable TOML file|own\.toml.*: vehicle"):
            load(scene_file(tmp_path, f'vehicle = "{vehicle}"'))


LIBRARY = re.compile(r"Input|instance|valid |Table|Error|dict|tuple|None|pydantic|type=")  # words of its sentences
WRONG = (True, "x", "3 kg", "", [], {}, {"q": 1}, -1e99, [1, "a"], [[1, 2], [3]])


def test_any_key_with_a_wrong_value_is_told_in_an_engineers_words():
    named = [key for key in keys(VehicleScene) if not {"*", "NAME"} & set(key.split("."))]
    sample = random.Random(1).sample([(key, value) for key in named for value in WRONG], 250)
    refused = 0
    for key, value in sample:
        try:
            load("straight", "flexible", {key: value})
        except BadInput as error:
            text, refused = str(error), refused + 1
            assert not LIBRARY.search(text), text
            assert key.split(".")[-1] in text or "is missing" in text or "drive.speed" in text, (key, value, text)
    assert refused > 200
    with pytest.raises(ValidationError) as twin:
        VehicleScene.model_validate({"name": 1})
    assert LIBRARY.search(str(twin.value))
