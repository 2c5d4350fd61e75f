"""Sentences of scenes, vehicles, keys, commands, connections and archives: refusals and warnings, each of them once."""

import os
import random
import re
from importlib import resources

import foreign_fmus
import pytest
from pydantic import ValidationError
from scene_files import BARE, scene_file
from short_runs import last
from ssd_texts import LAG, LAGS, packed_lags

from fmus.ground.soils import named
from fmus.vehicles.tables import BadInput
from orchestrator.scene import commented_file, expectations
from orchestrator.scene.assembly import assemble
from orchestrator.scene.kinds import VehicleScene
from orchestrator.scene.scene import OLD_SCENES, SCENE_KINDS, changed_scene, from_table, load, scene_names
from orchestrator.scene.settings import keys, near_keys
from orchestrator.scene.ssp_scene import load_ssp
from orchestrator.scene.values import implausible_numbers

REFUSED = {  # by scene: settings, and words of their sentence
    "hanging_chain": [
        ("run.stp=1", "unknown key 'run.stp': did you mean 'run.stop'?"),
        ("vehicle.contact.ground.frction=1", "did you mean 'vehicle.contact.ground.friction'?"),
        ("run.step=2 kg", "run.step = '2 kg': must be a quantity in s"),
        ("run.step=soon", "run.step = 'soon'"),
        ("run.step=3 ms", "must be a multiple of step"),
        ("run.stop=-1", "run.stop = -1: must be 1e-09 to 1e+09 s"),
        ("run.window={from=2, to=1}", "run.window: from = 2 s must be before to = 1 s"),
        ("vehicle.chassis.mass=-3 kg", "vehicle.chassis.mass = '-3 kg': must be 0.001 to 1e+08 kg"),
        ("vehicle.gravity=inf", "vehicle.gravity = inf: must be 0 to 1000 m/s^2"),
        ("vehicle=leopard", "no vehicle 'leopard'"),
        ("track=soft", 'must be "flexible" or "rigid"'),
        ("track.rtol=1e-8", "rtol = 1e-08 needs integrator = 'adams' or 'dormand_prince'"),
        ("track.atol=1", "track.atol = 1: must be 1e-13 to 0.1 m"),
        ("track.elasticity=large", 'track.elasticity = \'large\': must be "small_deformation" or "general" or'),
        ("track=rigid; track.elasticity=general", "needs model = 'flexible': rigid links have none"),
        ("track.element=beam; track.elasticity=general", "'general' needs element = 'cable': a beam has but one"),
        ("track=rigid; track.element=beam", "element = 'beam' needs model = 'flexible': rigid links have none"),
        ("track.coordinates=cholesky", "'adams' or 'dormand_prince', not 'generalized_alpha': an implicit step"),
        ("track.coordinates=cholesky; track.integrator=runge_kutta; track.joints=constrained", "axes = 'fixed' and"),
        ("track=rigid; track.coordinates=cholesky; track.integrator=runge_kutta", "'cholesky' needs model = 'flex"),
        ("vehicle.sprocket.outer_radius=0.2", "must exceed the pitch radius"),
        ("vehicle.section.torsion=0 m^4", "vehicle.section.torsion = '0 m^4': must be greater than 0, 10 at most,"),
        ("vehicle.section.torsion=2e-4", "must not exceed the polar moment bending + lateral_bending = 0.000182 m^4"),
        ("vehicle.seat.A.position=[0, 0, 0]", "seat.A: a name has small letters, digits and _ alone"),
        ("expect.sag.measure=sagg", "no measure 'sagg'"),
        ("chain.links.first=1", "'links' is a value, not a table"),
        ("vehicle.road_wheel.x.9=0", "the list has entries [1] to [5]"),
        ("nonsense", "must be KEY=VALUE"),
        ("assembly=[1]", "must be one of chain, bench, rig, vehicle"),
        ("run.step=1e-300", "is more than 4294967295 steps of 1e-300 s"),
        ("run.stop=9**9**9 s", "must be a quantity in s: '9' is no known unit"),
        ("run.step=1 ms\nstop=5", "must be a number or a quantity in s"),
        ("run.links=1" + "0" * 5000, "run.links = '10000"),
        ("vehicle=.toml/x.toml", "no vehicle file '.toml/x.toml'"),
        ('vehicle="\\u0000.toml"', "not a readable TOML file: "),
        ("vehicle.road_wheel.x.\N{SUPERSCRIPT ONE}=0", "the list has entries [1] to [5]"),
        ("expect.rest.expected=nan", "expect.rest.expected = nan: must be a finite number"),
        ("vehicle.section.area=13.89 m^2", "section.area = '13.89 m^2': must be greater than 0, 10 at most, in m^2"),
        ("vehicle.guide.clearance=1e18 m", "guide.clearance = '1e18 m': must be 0 to 50 m"),
        ("start.position=[1e9, 0, 0]", "start.position[1] = 1000000000.0: must be -1e+06 to 1e+06 m"),
        ("name=../../up", "name = '../../up'"),
        ("chain={links=8, ends='held', span=0.5}", "chain: span = 0.5 needs ends = 'pinned', not 'held'"),
        ("chain.spin=1", "spin = 1.0 needs ends = 'loop', not 'pinned'"),
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
    "rig": [
        ("run.coupling=jakobi", "run.coupling.scheme"),
        ("run.coupling.hold=constant", "'constant' needs scheme = 'jacobi' or 'gauss_seidel', not 'tracks_first'"),
        ("run.coupling.tolerance=1e-3", "tolerance = 0.001 needs scheme = 'iterative', not 'tracks_first'"),
        ("run.variable.shortest=1 ms", "run.variable.tolerance"),
        ("run.variable.tolerance=1e-3; run.variable.shortest=1 s", "is longer than longest"),
        ("run.variable={tolerance=1e-3, energy='1 J'}", "energy = 1.0 needs estimate = 'power', not 'doubling'"),
        ("planar=true; track=rigid", "planar = true needs track.model = 'flexible'"),
        ("planar=true; track.element=beam", "planar = true needs track.element = 'cable', not 'beam'"),
        ("planar=true; track.elasticity=general", "needs track.elasticity = 'small_deformation'"),
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
        ("drive={mode='torque', brake=5, brake_speed=0.1}", "unknown key 'drive.brake_speed': a brake holds below its"),
        ("drive.torque=5", "torque = 5.0 needs mode = 'torque', not 'speed'"),
        ("drive={mode='torque', ramp_time=2}", "ramp_time = 2.0 needs mode = 'speed' or 'controller', not 'torque'"),
        ("drive={speed=3, speed_points=[[0, 1]]}", "speed = 3.0 excludes speed_points"),
        ("drive={mode='controller', brake=3, brake_points=[[0, 1]]}", "brake = 3.0 excludes brake_points"),
        ("drive={speed=3, left={mode='torque'}, right={mode='torque'}}", "speed = 3.0 needs mode = 'speed' or"),
        ("drive.stop_time=0.1", "stop_time = 0.1 needs stop"),
        ("ground={grade=0.1, incline_length=2}", "ground: incline_length = 2.0 needs incline_start"),
        ("ground.kerb={y=0.3, rise=0.1, length=2}", "ground.kerb: length = 2.0 needs start"),
        ("ground.rough={iso_class='D', isotropic=true, length=3}", "ground.rough: length = 3.0 needs start"),
        ("ground.soil.name=moon", "no soil 'moon': there are dry_sand"),
        ("ground.soil.name=dry_sant", "no soil 'dry_sant': did you mean 'dry_sand'?"),
        ('ground.soil={name="snow", k0=0}', "nearly elastic"),
        ("ground.soil={name='snow'}; tracks=['left']", "needs both tracks and ground.hull = false"),
        ("planar=true", "planar = true needs symmetric = true"),
    ],
    "turn": [
        ("drive.left={mode='torque', speed=3}", "drive.left: speed = 3.0 needs mode = 'speed' or 'controller', not"),
        ("expect.radius.reduce=max", "turn.toml: expect.radius.reduce = 'max': is for a signal"),
    ],
    "settle": [
        ("vehicle.chassis.mass=1e300", "chassis.mass = 1e+300 kg: must be 0.001 to 1e+08 kg"),
        ("start.roll=90 deg", "start: roll = 1.5708 rad must be 0 or half a turn"),
        ("start.roll=180 deg; ground.half_round={x=[1], radius=0.1}", "ground.half_round needs start.roll = 0"),
    ],
    "soft_ground": [("ground.soil.k0=1e16", "soft_ground.toml: ground.soil.k0 = 1e+16 Pa/m: must be 0 to 1e+15 Pa/m")],
}  # fmt: skip


@pytest.mark.parametrize(
    ("scene", "settings", "said"), [(scene, *row) for scene, rows in REFUSED.items() for row in rows]
)
def test_bad_settings_are_one_sentence(scene, settings, said):
    with pytest.raises(BadInput) as error:
        load(scene, None, settings.split("; "))
    assert said in str(error.value)
    assert "\n" not in str(error.value)
    assert "input" not in str(error.value)
    assert len(str(error.value)) < 400


CURVE = "vehicle.suspension.spring={{compression=[0, 0.1, 0.2], force=[0, 5e4, {}]}}"  # beside 1e6 N/m
WHEELS = "vehicle.road_wheel.x=[-0.655, -1.322, {}, -3.322]"


@pytest.mark.parametrize(
    ("setting", "sound", "fault", "said"),
    [
        ("vehicle.chassis.inertia=[1786.92, 10449.67, {}]", 12236.0, 12400.0, "chassis.inertia = [1786.92, 10449.67,"),
        ("vehicle.chassis.inertia=[{}, 10449.67, 10721.22]", 280.0, 160.0, "no body has these, one is more"),
        ("vehicle.track.inertia=[0.22, 0.04, {}]", 0.26, 0.265, "track.inertia = [0.22, 0.04, 0.265] kg m^2: no body"),
        ("vehicle.track.lateral={}", 0.189, 0.185, "track.lateral = 0.185 m: the tracks are in one another"),
        (CURVE, -4.9e4, -5.1e4, "suspension.spring.force: falls by 1.01e+06 N/m of compression, more than"),
        ("vehicle.life.pin.ultimate={}", 4.51e8, 4.5e8, "life.pin.ultimate = 4.5e+08 Pa: must be more than life.pin"),
        (WHEELS, "-1.989, -2.656", "-2.656, -1.989", "road_wheel.x = [-0.655, -1.322, -2.656, -1.989, -3.322] m"),
    ],
)  # fmt: skip
def test_no_such_vehicle_can_be(setting, sound, fault, said):
    """Runs with it went through, with other numbers: each value has a twin beside it that is taken."""
    load("settle", None, [setting.format(sound)])
    with pytest.raises(BadInput) as refused:
        load("settle", None, [setting.format(fault)])
    assert said in str(refused.value)


IS, NO = "expected = 1, tolerance = 1", "own.toml: unknown key"
NEVER = "expect.x.from = 0.04 s: is after to = 0.01 s, so the window"
CHECKS = [
    (f"x = {{ {IS} }}", "needs either signal or measure"),
    (f'x = {{ signal = "a.b", measure = "sag", {IS} }}', "needs either"),
    (f'x = {{ signal = "chain.speed", from = 0.04, to = 0.01, {IS} }}', NEVER),
    (f'x = {{ measure = "sag", from = "40 ms", to = "10 ms", {IS} }}', NEVER),
    (f'x = {{ measure = "yaw_rate", of = "left", {IS} }}', "expect.x.of = 'left': yaw_rate is of no side or part"),
    (f'x = {{ measure = "slip", of = "upper", {IS} }}', "expect.x.of = 'upper': slip is of 'left' or 'right'"),
    (f'x = {{ measure = "propulsion", {IS} }}', "expect.x.of = '': propulsion must be of 'left' or 'right'"),
    (f'x = {{ signal = "chain.speed", of = "left", {IS} }}', "is for a measure; a signal names its component"),
    (f'x = {{ measure = "energy_residual", from = 1, {IS} }}', "expect.x.from = 1 s: energy_residual is of the whole"),
    (f'x = {{ measure = "distance", from = 1, {IS} }}', "expect.x.from = 1 s: distance is of the whole run"),
    ('x = { signal = "a.b", expected = 1, tolerance = -1 }', "must be 0 or more, in"),
    (f'x = {{ signal = "a.b", reduce = "median", {IS} }}', "reduce"),
    ('x = { signal = "a.b", expect = 1, tolerance = 1 }', "expect"),
    (f'x = {{ measure = "sag", reduce = "mean", {IS} }}', "measure = 'sag' is a number already"),
]
HUGE, HUGER = "9" * 400, "0x" + "f" * 5000  # too large for a double, and too large for Python to print
OF_BARE = [
    ("links = 8", f"links = {HUGE}", "chain.links = 999"),
    ('step = "10 ms"', f"step = {HUGE}", "run.step = 999"),
    ('step = "10 ms"', f"step = {HUGER}", "run.step = a huge int: must be a finite number in s"),
    ('title = "a chain"', f"title = {HUGER}", "title = a huge int"),
    ('assembly = "chain"', f"assembly = {HUGER}", "a huge int: must be one of chain"),
    ('vehicle = "m113"', "vehicle.base." + "a." * 5000 + "a = 1", "a key has more than 64 parts"),
    ('vehicle = "m113"', "vehicle.base = 1", "vehicle.base = 1: must be a name"),
    ("links = 8", f"links = {'[' * 5000}", "not a readable TOML file"),
    ('title = "a chain"', 'title = "\udcff"', "not a readable TOML file"),
    *((("[run]", f"[expect]\n{check}\n[run]", said)) for check, said in CHECKS),
    *(('assembly = "chain"', f"assembly = '{old}'", f"own.toml: assembly = '{old}': has no FMU")
      for old in OLD_SCENES.values()),
]  # fmt: skip
OF_STRAIGHT = [
    ('step = "1.25', 'stepp = "1.25', f"{NO} 'run.stepp': did you mean 'run.step'?"),
    ("speed = ", "sped = ", f"{NO} 'drive.sped': did you mean 'drive.speed'?"),
    ("model = ", "modell = ", f"{NO} 'track.modell': did you mean 'track.model'?"),
    ("[drive]", "[drives]", f"{NO} 'drives': did you mean 'drive'?"),
    ("[drive]", "[chain]\nlinks = 8\n[drive]", f"{NO} 'chain': it needs assembly = 'chain'"),
    ("tolerance = 0.002,", "tolerence = 0.002,", "chain_left.tolerence': did you mean 'expect.chain_left.tolerance'?"),
    ('"m113"', '{ base = "m113", mass = 3 }', f"{NO} 'vehicle.mass': did you mean 'vehicle.chassis.mass' or 'vehicle."),
    ('"m113"', '{ base = "m113", track_roller = { mass = 3 } }', "track_roller': did you mean 'vehicle.road_wheel'?"),
    ('"m113"', '{ base = "m113", rear_idler = { mass = 3 } }', "idler': did you mean 'vehicle.wheel.rear_idler'?"),
    ('"m113"', '{ base = "m113", idlers = { mass = 3 } }', f"{NO} 'vehicle.idlers': did you mean 'vehicle.idler'?"),
    ('"m113"', '"tank.toml"', "own.toml with vehicle 'tank.toml': unknown key 'vehicle.track.lateal': did you mean"),
]  # fmt: skip


@pytest.mark.parametrize(
    ("bare", "old", "new", "said"), [(rows is OF_BARE, *row) for rows in (OF_BARE, OF_STRAIGHT) for row in rows]
)
def test_bad_scene_files_are_one_sentence(tmp_path, monkeypatch, bare, old, new, said):
    monkeypatch.chdir(tmp_path)
    gallery = resources.files("orchestrator") / "gallery"
    text = BARE.format(vehicle='vehicle = "m113"') if bare else (gallery / "straight.toml").read_text(encoding="utf-8")
    assert old in text
    (tmp_path / "own.toml").write_bytes(text.replace(old, new, 1).encode(errors="surrogateescape"))
    if "tank" in new:
        commented_file.new_file("vehicle", "tank")
        vehicle = (tmp_path / "tank.toml").read_text(encoding="utf-8")
        (tmp_path / "tank.toml").write_text(vehicle.replace("lateral = ", "lateal = "))
    with pytest.raises(BadInput) as caught:
        load("own.toml")
    assert said in str(caught.value)


def test_unreadable_files_and_unknown_scenes(tmp_path):
    file = tmp_path / "vehicle.toml"
    (tmp_path / "folder.toml").mkdir()
    for content in (b"\xff\xfe", b"mass = \xff", b"a = " + b"[" * 5000, f"name = {HUGE * 13}".encode(), b"title = "):
        file.write_bytes(content)
        for name in (str(file), scene_file(tmp_path, f'vehicle = "{file}"')):
            with pytest.raises(BadInput, match=r"vehicle\.toml.*: not a readable TOML file"):
                load(name)
    for name, said in (
        (str(tmp_path / "folder.toml"), "not a readable TOML"),
        ("a\0b.toml", "not a readable TOML"),
        (str(tmp_path / "none.toml"), "no scene file"),
        ("straigt", "did you mean 'straight'"),
        ("xyz", "the gallery has"),
        *((old, f"scene '{old}' has no FMU .* clone .*: python -m tests.validation mechanics") for old in OLD_SCENES),
    ):
        with pytest.raises(BadInput, match=said):
            load(name)


def test_a_check_that_is_refused_today_is_read_in_a_log_of_an_earlier_version():
    check = {"measure": "yaw_rate", "of": "left", "from": 0.04, "to": 0.01, "expected": 1.0, "tolerance": 1.0}
    old = load("settle", "rigid", ["expect={}"]).resolved() | {"expect": {"x": check}}
    assert from_table(old, "a.mcap: scene.json").expect["x"].fault.startswith("from = 0.04 s: is after to = 0.01 s")
    with pytest.raises(BadInput, match=r"^a\.toml: expect\.x\.from = 0\.04 s: is after"):
        changed_scene(old, ["run.stop=1"], "a.toml")


@pytest.mark.parametrize(
    ("key", "near"),
    [
        ("run.stepp", ["run.step"]), ("drive.left.sped", ["drive.left.speed"]), ("runn", ["run"]),
        ("stepp", ["run.step"]), ("expect.rest.signl", ["expect.rest.signal"]), ("qqq", []),
        ("hull", ["vehicle.chassis.hull", "ground.hull"]),
        ("vehicle.mass", ["vehicle.chassis.mass", "vehicle.sprocket.mass"]),
    ],
)  # fmt: skip
def test_near_keys(key, near):
    assert near_keys(key, keys(SCENE_KINDS["vehicle"]))[:2] == near


# --- any value ---------------------------------------------------------------------------------------

ODD = (HUGE, "-" + HUGE, HUGER, "9" * 5000, "1e400", "nan", "\udcff", "[" * 3000, "[[1]]", "{a = 1}", f'"{HUGE} m"', "")


def leaves(value, above=""):
    """Dotted keys of all values in a table, also of tables and lists."""
    entries = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, inner in entries:
        yield f"{above}{key}"
        yield from leaves(inner, f"{above}{key}.")


@pytest.mark.long
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


LIBRARY = re.compile(r"Input|instance|valid |Table|Error|dict|tuple|None|pydantic|type=")  # words of its sentences
WRONG = (True, "x", "3 kg", "", [], {}, {"q": 1}, -1e99, [1, "a"], [[1, 2], [3]])


def test_any_key_with_a_wrong_value_is_told_in_an_engineers_words():
    names = [key for key in keys(VehicleScene) if not {"*", "NAME"} & set(key.split("."))]
    sample = random.Random(1).sample([(key, value) for key in names for value in WRONG], 250)
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


# --- signals of checks -------------------------------------------------------------------------------

NONE = "no such signal: "
TWO_RATES = "did you mean 'chassis.body_rate.z' or 'chassis.chassis.angular_velocity.z'? Or measure = 'yaw_rate'?"


def require_signals(scene, signal, *settings):
    loaded = load(scene, None, [f'expect.own={{signal="{signal}", expected=1, tolerance=1}}', *settings])
    expectations.require_signals(loaded, assemble(loaded).parts)


@pytest.mark.parametrize(
    ("scene", "signal", "said"),
    [
        ("turn", "chassis.yaw_rate", f"{NONE}{TWO_RATES}"),
        ("turn", "yaw_rate", f"no component 'yaw_rate': {TWO_RATES}"),
        ("straight", "left_track.tension", f"{NONE}did you mean 'left_track.tension.min' or 'left_track.tens"),
        ("straight", "left_track.tension.maxx", f"{NONE}did you mean 'left_track.tension.max'?"),
        ("straight", "leftrack.tension.max", "no component 'leftrack': did you mean 'left_track'?"),
        ("straight", "driver.path.progress", "no component 'driver': did you mean 'left_drive'?"),
        ("straight", "left_track.link[65].tension", f"{NONE}did you mean 'left_track.link["),
        ("straight", "hull.speed", "no component 'hull': there are left_track, right_track, left_drive, "),
        ("straight", "left_track", NONE),
        ("hanging_chain", "chain.solver.steps", NONE),
    ],
)  # fmt: skip
def test_unknown_signals_of_checks_are_told(scene, signal, said):
    with pytest.raises(BadInput) as caught:
        require_signals(scene, signal)
    assert str(caught.value).startswith(f"{scene}.toml: expect.own.signal = '{signal}': {said}")


@pytest.mark.parametrize(
    ("signal", "settings", "other"),
    [
        ("left_track.link[64].tension", None, None),
        ("chassis.settlement", None, None),
        ("chassis.left.idler.force.x", "run.inputs=true", "run.inputs=false"),
        ("stats.left_track.steps", None, None),
        ("left_track.link[64].tension.mean", "run.between=true", "run.between=false"),
        ("no.matter", "expect.own.track=rigid", "expect.own.track=flexible"),
    ],
)
def test_known_signals_of_checks_are_not_refused(signal, settings, other):
    require_signals("straight", signal, *filter(None, [settings]))
    if other:
        with pytest.raises(BadInput, match=r"expect\.own\.signal"):
            require_signals("straight", signal, other)


# --- commands ----------------------------------------------------------------------------------------

WORD, ELSEWHERE = "x" * 3000, "'own.toml' exists already, and is not replaced: give another name"
AT_THE_START = (
    "rig.links = 40, vehicle.track.pitch = 0.1524 m and the wheels do not fit together",
    "rig.tension = 1e+09 N: not reached with the idler",
    "start = 'straight': must be one of rest, polygon",
)
COMMANDS = [
    ("run hanging_chian", "did you mean 'hanging_chain'?"),
    ("run rig --set rig.links=40", AT_THE_START[0]), ("run rig --set rig.tension=1e9", AT_THE_START[1]),
    ("run hanging_chain --set track.start=straight", AT_THE_START[2]),
    ("run hanging_chain --set track.integrator=euler", "hanging_chain.toml: track.integrator = 'euler'"),
    ('run straight --set expect.a={signal="a",expected=1,tolerance=1}', "straight.toml: expect.a.signal = 'a': no "),
    ("run hanging_chain --for fatig", "no analysis 'fatig': one of power, spectrum"),
    ("run hanging_chain --track rigid --for fatigue", "--for fatigue: rigid links have no stress"),
    ("run rig --for ride", "--for ride: assembly = 'rig' has no seats"),
    ("run", "Missing argument"), ("fly straight", "fly"), ("run hanging_chain --track soft", "soft"),
    ("log info none.mcap", "none.mcap"), ("replay none.mcap --component chain", "none.mcap"),
    ("build straight --all -o x", "--all"), ("schema boat", "boat"), ("keys zzz", "begins with 'zzz' in"),
    (WORD, "xxx"), (f"log {WORD}", "xxx"), (f"show rig --{WORD}", "xxx"), (f"run rig --track {WORD}", "xxx"),
    (f"show {WORD}", "xxx"), ("warm strait", "no scene 'strait'"),
    *((f"{command} straight --vehicle none.toml{more}", "cotrack: no vehicle file 'none.toml'\n")
      for command, more in {"run": "", "truth": "", "show": "", "build": " -o built", "ssp": " -o own.ssp",
                            "sweep": " --vary run.stop=1,2 -o swept"}.items()),
    *((f"{command} \udcff.mcap{more}", "\\udcff.mcap")
      for command, more in {"show": "", "truth": "", "build": " -o x", "study": " -o x", "log info": ""}.items()),
    ("run rig --stop \udcff", "\\udcff"), ("run rig --set \udcff", "\\udcff"), ("run rig --set name=\udcff", "\\udcff"),
    ("new scene own", ELSEWHERE), ("new vehicle own.toml", ELSEWHERE), ("new scene link", "'link.toml' exists already"),
    ("new scene far/own", "'far/own' is no name of a file in the current folder"),
    ("new scene new --from straigt", "no scene 'straigt': did you mean 'straight'?"),
    ("new vehicle new --from leopard", "no vehicle 'leopard': give a .toml file or one of dozer"),
    (f"new scene {WORD[:300]}", "cannot be written: File name too long"),
    ("ssp rig -o rig.zip", "rig.zip cannot be written: its name must end in .ssp\n"),
    ("ssp rig --track rigid -o none/rig.ssp", "there is no folder"),
    ("check no.fmu", "there is no FMU 'no.fmu'"), ("check own.toml", "'own.toml' is not an FMU"),
    ("check own.toml --step 0", "--step 0: must be a finite number greater than 0"),
    ("run hanging_chain --log pipe", "the log pipe cannot be written: it is a device or a pipe"),
    ("run hanging_chain --log /dev/null", "the log /dev/null cannot be written: it is a device or a pipe"),
    ("run hanging_chain --log loop", "the log loop cannot be written: it is a link that leads to itself"),
    ("run hanging_chain --log folder", "it is a directory"),
    ("run hanging_chain --log own.toml", "there is a file that is no log"),
    ("run hanging_chain --log own.toml/a.mcap", "own.toml is no folder"),
    ("build hanging_chain -o own.toml", "the folder own.toml cannot be made"),
    ("build hanging_chain -o /proc", "the folder /proc cannot be written: no file can be made in the folder /proc: no"),
    ("run hanging_chain --log /proc/a.mcap", "the log /proc/a.mcap cannot be written: no file can be made"),
    ("ssp rig -o /proc/rig.ssp", "/proc/rig.ssp cannot be written: no file can be made in the folder /proc"),
    ("run own", "the gallery has no scene 'own': give the file, 'own.toml'"),
    ("run a.mcap", "'a.mcap': 'cotrack resume' continues the run of a log"),
    ("truth a.fmu", "'a.fmu': 'cotrack check' examines an FMU"),
    ("run rig --replace drive=a.fmu --replace drive=b.fmu", "drive=b.fmu: 'drive' is replaced already, by a.fmu"),
]  # fmt: skip


@pytest.mark.parametrize(("arguments", "said"), COMMANDS)
def test_bad_commands_are_one_sentence_and_leave_nothing(cotrack, tmp_path, monkeypatch, arguments, said):
    """Nothing is built before; the object of ``--json`` has the sentence too."""
    if said not in AT_THE_START:
        monkeypatch.setattr("orchestrator.execution.simulate.load_scene", lambda *_: pytest.fail("it is built"))
    (tmp_path / "own.toml").write_text("mine")
    (tmp_path / "folder").mkdir()
    (tmp_path / "link.toml").symlink_to(tmp_path / "nowhere")
    (tmp_path / "loop").symlink_to(tmp_path / "loop")
    os.mkfifo(tmp_path / "pipe")
    before = sorted(tmp_path.rglob("*"))
    is_run = arguments.startswith("run ")
    status, out, err = cotrack(*arguments.split(" "), *(["--json"] if is_run else []))
    lines = [line for line in err.splitlines() if line.startswith(("Error: ", "cotrack: "))]
    assert (status, len(lines)) == (2, 1), err
    assert said in err
    assert len(lines[0]) <= 400
    assert "Traceback" not in err
    if is_run and lines[0].startswith("cotrack"):
        message = last(out)["message"].encode("ascii", "backslashreplace").decode()
        assert (last(out)["status"], message in err) == ("failed", True)
    assert sorted(tmp_path.rglob("*")) == before
    assert (tmp_path / "own.toml").read_text() == "mine"


# --- warnings ----------------------------------------------------------------------------------------

SIX = "vehicle.road_wheel.x=[-0.655, -1.19, -1.725, -2.26, -2.79, -3.322]"
LIGHT = "vehicle.road_wheel.radius=0.3; vehicle.road_wheel.spin_inertia="
IDLER = (
    "vehicle.contact.wheel.friction=0.3; vehicle.track.tension=8 kN; vehicle.idler.radius=0.28; run.step=1 ms;"
    " track.step=1 ms; vehicle.idler.spin_inertia="
)
FIFTH = "vehicle.right={road_wheel={x=[-0.655, -1.322, -1.989, -2.656, -3.5]}}"
OVERLAP = (
    "own.toml: vehicle.road_wheel.x[4] = -2.26 m and vehicle.road_wheel.x[5] = -2.79 m: these wheels overlap, 0.53 m"
    " apart; plausible is at least 0.61 m, vehicle.road_wheel.radius + vehicle.road_wheel.radius"
)
FLANGES = (
    "own.toml: vehicle.section.bending = 2.03e-06 m^4: is more than any section of area = 0.01516 m^2 within"
    " outer_fibre = 0.0115 m has, area x outer_fibre^2 = 2.005e-06 m^4"
)
WARNED = [  # settings, and words of all warnings
    ("straight", SIX, [OVERLAP]),
    ("straight", f"{SIX}; vehicle.road_wheel.radius=0.265", []),
    ("straight", f"{SIX}; vehicle.road_wheel.radius=0.266", ["0.53 m apart; plausible is at least 0.532 m"]),
    ("straight", "vehicle.road_wheel.x.4=-3.5", ["road_wheel.x[5] = -3.5 m and vehicle.idler.x = -4 m: these wheels"]),
    ("straight", "vehicle.section.outer_fibre=0.0116", []),  # a section of two thin flanges, 2.04e-6 m^4
    ("straight", "vehicle.section.outer_fibre=0.0115", [FLANGES]),
    ("straight", "vehicle.road_wheel.x[1]=-0.4", ["the sprocket's place = 0 m and vehicle.road_wheel.x[1] = -0.4 m: "]),
    ("straight", FIFTH, ["vehicle.right.road_wheel.x[5] = -3.5 m and vehicle.right.idler.x = -4 m: these wheels"]),
    # at 0.4 kg m2 76 % of the energy of a run is unaccounted for, at 0.5 kg m2 0.12 %
    ("crawler", f"{LIGHT}0.48", ["these wheels overlap", "take --step 0.25ms, or at least 0.496 kg m^2"]),
    ("crawler", f"{LIGHT}0.51", ["these wheels overlap"]),
    # a belt of 8 kN round an idler of 2 kg m2 chatters by 4 % of its tension at 1 ms, and rests at 0.25 ms
    ("straight", f"{IDLER}5.8", ["vehicle.idler.radius = 0.28 m with spin_inertia"]),
    ("straight", f"{IDLER}6.0", []),
    ("soft_ground", "ground.soil.kphi=1528.43", ["kphi = 1528.43 N/m^(n+2): plausible is 10000 to 1e+08 N/m^(n+2)"]),
    *(("soft_ground", f"ground.soil.name='{name}'", []) for name in named()),
    *((name, "", []) for name in scene_names()),
]  # fmt: skip


@pytest.mark.parametrize(("scene", "settings", "said"), WARNED)
def test_implausible_numbers_are_told_with_the_limit(scene, settings, said):
    loaded = load(scene, "rigid", settings.split("; ")) if settings else load(scene)
    told = implausible_numbers(loaded.resolved(), "own.toml")
    assert [words in each for words, each in zip(said, told, strict=True)] == [True] * len(said), told


# --- archives ----------------------------------------------------------------------------------------

OUTSIDE = "must be a file in the archive"
ARCHIVES = [
    ('source="resources/lag.fmu"', 'source="../lag.fmu"', f"source = '../lag.fmu': {OUTSIDE}"),
    ('source="resources/lag.fmu"', 'source="file:///lag.fmu"', OUTSIDE),
    ('source="resources/lag.fmu"', 'source="/lag.fmu"', OUTSIDE),
    ('source="resources/lag.fmu"', 'source="a.fmu"', "there is no such file in the archive"),
    ('source="values/b.ssv"', 'source="http://a.org/b.ssv"', OUTSIDE),
    ("</ssd:Elements>", "<ssd:SignalDictionaryReference/></ssd:Elements>", "an element is called ''"),
    ('startElement="a" ', "", "there is no connector 'x'"),
    ('unit="N"', 'unit="kN"', "connector 'a.x' has the unit 'kN', and its variable 'N': both must have one unit"),
    ('version="1.0" name="t"', 'version="3.0" name="t"', "SSP 3.0: only SSP 1.0 and 2.0 are run"),
    ('name="b" source', 'name="b/c" source', "an element is called 'b/c': its name must have no dot and no slash"),
    ("<ssd:Connections>", "<ssd:Connections", "SystemStructure.ssd cannot be read"),
    ('name="a" source', 'name="a" type="application/x-ssp-package" source', "is not an SSP archive: it has no System"),
    ('startConnector="x"', 'startConnector="x" suppressUnitConversion="yes"', "must be true or false"),
    ('endConnector="u" >', 'endConnector="u"><ssc:LinearTransformation factor="two"/>', "must have finite numbers"),
    ('endConnector="u" >', 'endConnector="u"><ssc:LinearTransformation factor="0"/>', "the factor not 0"),
    ('endConnector="u" >', 'endConnector="u"><ssc:IntegerMappingTransformation/>', "a IntegerMappingTransformation is"),
    ('endConnector="u" >', 'endConnector="u"><ssc:EnumerationMappingTransformation/>', "EnumerationMappingTransfor"),
]  # fmt: skip


@pytest.fixture(scope="module")
def lag(tmp_path_factory):
    return foreign_fmus.build(tmp_path_factory.mktemp("lag") / "lag.fmu", "lag", LAG)


@pytest.mark.parametrize(("old", "new", "said"), ARCHIVES)
def test_what_an_archive_must_not_have_is_one_sentence(lag, tmp_path, old, new, said):
    assert old in LAGS
    with pytest.raises(BadInput) as caught:
        load_ssp(packed_lags(tmp_path / "lags.ssp", lag, LAGS.replace(old, new, 1)), None, ())
    assert said in str(caught.value)
    assert "lags.ssp" in str(caught.value)
    assert "\n" not in str(caught.value)
