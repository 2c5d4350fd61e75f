"""Scenes: the gallery, settings, units, names of logs, runs of one scene, settings of tracks."""

import copy
import json
import re
from contextlib import nullcontext
from functools import reduce
from typing import Annotated, Literal, get_args, get_origin

import numpy as np
import pytest
from scene_files import BARE
from scipy.spatial.transform import Rotation

from fmus.components import model_of
from fmus.start import KEYS, start_pose, vehicle_quaternion
from fmus.track.choices import TRACKS, models_with
from fmus.track.ports import STARTS
from fmus.vehicles import vehicle
from fmus.vehicles.tables import BadInput
from orchestrator.execution.truth import physical_scene
from orchestrator.scene.assembly import assemble
from orchestrator.scene.placing import placed
from orchestrator.scene.same_scene import require_same_scene
from orchestrator.scene.scene import from_table, load, read_vehicle, scene_names
from orchestrator.scene.settings import file_part, toml_text
from orchestrator.scene.track_table import TrackModelTable
from orchestrator.scene.values import Sets, implausible_numbers


@pytest.mark.parametrize("name", scene_names())
@pytest.mark.parametrize("track", TRACKS)
def test_gallery_resolves_and_reads_back(name, track):
    scene = load(name, track)
    assert scene.variant == track
    assert scene.title
    assert scene.expect
    assert from_table(json.loads(json.dumps(scene.resolved())), name) == scene


def test_a_mode_that_is_set_leaves_out_what_the_scene_has_for_another():
    """Speeds of the file and of a resolved scene go with a motor's torque; a key that is set counts."""
    turn = load("turn", "rigid")
    for setting in ("drive.mode=torque", "drive.demand=true"):
        drive = load("turn", "rigid", [setting]).drive
        assert (drive.speed, drive.ramp_time, drive.steers) == (0.0, 1.0, False)
    one = turn.changed({"drive.left.mode": "torque", "drive.left.torque": 5e3, "drive.left.torque_limit": 4e3}).drive
    assert (one.left.speed, one.left.torque, one.right.speed, one.right.ramp_time) == (0.0, 5e3, 12.0, 1.5)
    assert load("hanging_chain", None, ["chain.ends=held"]).chain.span is None


@pytest.mark.parametrize(
    ("drive", "limit"),
    [("torque=-3e4", 3e4), ("torque_points=[[0, 5], [1, -4e4]]", 4e4), ("torque=5e3", 2e4),
     ("torque=3e4, torque_limit=4e3", 4e3)],
)  # fmt: skip
def test_a_torque_is_cut_by_a_given_limit_alone(drive, limit):
    scene = load("straight", "rigid", ["placed=true", "start.state=drawn", f"drive={{mode='torque', {drive}}}"])
    parts = [part for part in assemble(scene).parts if part.kind == "SprocketDrive"]
    assert [part.parameters["torque.limit"] for part in parts] == [limit, limit]


def test_a_log_may_have_what_a_new_run_is_refused_for():
    """As of an earlier version: a brake that did not count, tracks in one another, half of an unequal vehicle."""
    new = load("settle", "rigid", ["symmetric=true"])
    table = json.loads(json.dumps(new.resolved()))
    table["drive"] |= {"brake": 5.0, "torque_limit": 7.0}
    table["vehicle"]["track"]["lateral"], table["vehicle"]["chassis"]["centre"][1] = 0.1, 2e-4
    read = from_table(table, "scene.json", logged=True)
    assert (read.drive, read.vehicle.track.lateral, read.symmetric) == (new.drive, 0.1, True)
    for said, part, sound in (
        ("the tracks are in one another", table["vehicle"], {"track": new.vehicle.track.model_dump()}),
        ("drive: torque_limit = 7.0 needs mode", table, {"drive": new.drive.model_dump()}),
        ("symmetric = true needs a vehicle that", table, {"symmetric": False}),
    ):
        with pytest.raises(BadInput, match=said):
            from_table(table, "scene.json")
        part |= sound
    assert from_table(table, "scene.json").vehicle.chassis.centre[1] == 2e-4


def test_a_variant_has_a_log_of_its_own():
    """Named by its settings, in any order, as texts or numbers; the log of a run with more in it has the same name."""
    settings = ["vehicle.track.mass=20", "run.stop=3 s", "symmetric=true"]
    named = load("hold", "rigid", settings[:2])
    assert load("hold", "rigid").log_name == "hold-rigid.mcap"
    assert named.log_name == "hold-rigid-run.stop=3s-vehicle.track.mass=20.mcap"
    assert load("hold", "rigid", settings[1::-1]).log_name == named.log_name
    assert load("hold", "rigid", {"run.stop": "3 s"}).changed({"vehicle.track.mass": 20}).log_name == named.log_name
    assert named.recording_for(["slip"]).log_name == named.log_name
    assert named.changed({"run.stop": "3 s"}).log_name == named.log_name
    assert load("hold", "flexible", ["track.model=rigid", "name=own"]).log_name == "own-rigid.mcap"
    others = (*(settings[:n] for n in range(4)), ["run.stop=3.1 s"], ["vehicle=marder"], ["run.links=1"])
    masses = [[f"vehicle.track.mass={mass}"] for mass in ("20 kg", "20.1 kg", "2e1")]
    assert len({load("straight", "rigid", one).log_name for one in (*others, *masses)}) == len(others) + len(masses)


def test_settings_in_a_file_name_are_told_apart_and_short():
    """Characters that shells or systems read otherwise are replaced: a digest tells such settings apart."""
    assert file_part({}) == ""
    odd = [{"fmu.a.file": f"{file}.fmu"} for file in ("a/b", "a_b", "a b", "ab", "a*b", "ä", "\udc80")]
    texts = [file_part(settings) for settings in (*odd, {"run.x": [1, 2]}, {"run.x": [12]}, {"key": "9" * 300})]
    assert len(set(texts)) == len(texts)
    assert all(text.isascii() and len(text) <= 90 and not set(text) & set("/\\*?[]\"' ") for text in texts)
    assert texts[1] == "-fmu.a.file=a_b.fmu"


@pytest.mark.parametrize(
    ("setting", "value"),
    [
        ("run.step=2 ms", 2e-3), ("vehicle.contact.ground.friction=0.5", 0.5), ("track.integrator=hht", "hht"),
        ("drive.speed=600 deg/s", 10.471975512), ("vehicle.road_wheel.x.0=-0.7", -0.7),
        *((f"run.stop={quantity}", 0.6) for quantity in
          ("600 ms", "0.6", "6e-1s", ".01 min", "0.6 N*s/N", "0.6 m^2*s/m**2")),
    ],
)  # fmt: skip
def test_settings_reach_scene_vehicle_and_track_in_si_units(setting, value):
    def found(scene):
        names = setting.partition("=")[0].split(".")
        return reduce(lambda one, name: one[int(name)] if name.isdigit() else getattr(one, name), names, scene)

    scene = load("straight", "rigid", [setting])
    assert found(scene) == (pytest.approx(value, rel=1e-10) if isinstance(value, float) else value)
    assert found(load("straight", "rigid")) != found(scene), "the file's value must be back"
    assert scene.run.steps == round(scene.run.stop / scene.run.step)
    with pytest.raises(ValueError, match="frozen"):
        scene.run.stop = 1.0


def test_vehicle_over_a_base(tmp_path):
    file = tmp_path / "own.toml"
    file.write_text(BARE.format(vehicle="") + '[vehicle]\nbase = "m113"\nchassis = { mass = "6 t" }\n')
    scene = load(str(file))
    assert scene.vehicle.chassis.mass == pytest.approx(6000.0)
    assert scene.vehicle.chassis.inertia == load("straight").vehicle.chassis.inertia


@pytest.mark.parametrize("named", ['vehicle = "{}"', '[vehicle]\nbase = "{}"'])
def test_a_vehicle_is_found_from_the_folder_of_its_scene(named, tmp_path, monkeypatch):
    """Files that a scene names are found from its folder, those that a setting names from the working folder."""
    (tmp_path / "far").mkdir()
    m113 = read_vehicle("m113")
    for folder, mass in ((tmp_path, 1000.0), (tmp_path / "far", 2000.0)):
        own = {**m113, "name": "own", "chassis": {**m113["chassis"], "mass": mass}}
        (folder / "own.toml").write_text("\n".join(f"{key} = {toml_text(value)}" for key, value in own.items()))
    monkeypatch.chdir(tmp_path)
    above, below = ("", named) if "[" in named else (named, "")
    file = tmp_path / "far" / "scene.toml"
    for name, mass in (("own.toml", 2000.0), ("../own.toml", 1000.0), (f"{tmp_path}/own.toml", 1000.0)):
        file.write_text(BARE.format(vehicle=above.format(name)) + below.format(name))
        assert load("far/scene.toml").vehicle.chassis.mass == mass, name
        assert load("far/scene.toml", None, ["vehicle=own.toml"]).vehicle.chassis.mass == 1000.0
    file.write_text(BARE.format(vehicle=above.format("none.toml")) + below.format("none.toml"))
    with pytest.raises(BadInput, match=r"no vehicle file 'far/none\.toml'"):
        load("far/scene.toml")


def test_a_measure_is_not_reduced():
    """A log of an earlier version, whose checks of measures hold the default, is read."""
    scene = load("turn")
    resolved = scene.resolved()
    assert "reduce" not in resolved["expect"]["radius"]
    assert load("hard_stop").resolved()["expect"]["nod"]["reduce"] == "max"
    earlier = {**resolved, "expect": {name: {**check, "reduce": "mean"} for name, check in resolved["expect"].items()}}
    assert from_table(earlier, "scene.json") == scene


def test_a_key_of_the_scene_counts_before_that_of_the_named_soil():
    scene = load("straight", None, ['ground.soil={name="dry_sand", cohesion="2 kPa"}'])
    soil = next(part.config["track"]["soil"] for part in assemble(scene).parts if "track" in part.config)
    assert (soil["cohesion"], soil["kphi"], soil["friction_angle"]) == (2e3, 1528.43e3, pytest.approx(0.4886921906))


def test_half_a_turn_of_roll():
    """The parts get the pose R_z(heading) R_y(pitch) R_x(180 deg) for half a turn of roll."""
    scene = load("settle", None, ["start.heading=0.3", "start.pitch=0.2", "start.roll=180 deg"])
    for part in assemble(scene).parts:
        w, x, y, z = vehicle_quaternion(start_pose(dict.fromkeys(KEYS, 0.0) | part.parameters))
        rotation = Rotation.from_quat([x, y, z, w])
        rolled = Rotation.from_euler("ZYX", [0.3, 0.2, np.pi])
        assert (rotation.inv() * rolled).magnitude() < 1e-12
        assert (rotation.inv() * Rotation.from_euler("ZYX", [0.3, 0.2, 0.97 * np.pi])).magnitude() > 0.09, "a twin"


def test_a_vehicle_without_hitch_and_seats_tows_nothing_and_seats_nobody():
    own = {key: table for key, table in vehicle.read_table("m113")[0].items() if key not in ("hitch", "seat")}
    scene = from_table({**load("straight").resolved(), "vehicle": own}, "straight.toml")
    with pytest.raises(BadInput, match=r"hitch: needs vehicle\.hitch"):
        scene.changed(["hitch.force=1"])
    with pytest.raises(BadInput, match="--for ride: m113 has no table"):
        scene.recording_for(["ride"])
    assert load("straight").recording_for(["ride"]).seats == ("driver",)


@pytest.mark.long
def test_runs_of_one_scene():
    """Runs of one scene may differ in computation, recording, name, checks and FMUs of the user, in nothing else."""
    whole = load("straight").resolved()
    for change in (
        "track=rigid", "track.element=beam", "track.step=1 ms", "run.stop=1 s", "run.step=2 ms", "run.links=1",
        "run.coupling=jacobi", "name=other", "title=other", "symmetric=true", "expect={}", "fmu.chassis.file=a.fmu",
        "seats=['driver']", "vehicle.seat.driver.position=[0, 0, 0]",
    ):  # fmt: skip
        require_same_scene(("a", load("straight", None, [change]).resolved()), ("b", whole))
    for change, said in (
        ("vehicle.chassis.mass=1", "vehicle.chassis.mass = 1.0 and "), ("drive.speed=19", "drive.speed = 19.0 and"),
        ("start.heading=1", "start.heading = 1.0 and 0.0"), ("ground.hull=true", "ground.hull = true and false"),
        ("track.start=polygon", "track.start = 'polygon' and not given"), ("hitch.force=1", "hitch = {"),
        ("vehicle.hitch.x=-4", "vehicle.hitch.x = -4.0 and -4.41"),
    ):  # fmt: skip
        with pytest.raises(BadInput) as caught:
            require_same_scene(("a", load("straight", None, [change]).resolved()), ("b", whole))
        assert str(caught.value).startswith(f"a ('straight') and b ('straight') are runs of different scenes: {said}")
    with pytest.raises(BadInput, match="b does not say of which scene it is"):
        require_same_scene(("a", whole), ("b", {}))
    older = {key: table for key, table in whole["vehicle"].items() if key not in ("hitch", "seat")}
    require_same_scene(("a", whole), ("b", {**whole, "vehicle": older}))
    for name in ("rig", "settle"):
        flexible, rigid = (placed(load(name, model)).resolved() for model in ("flexible", "rigid"))
        require_same_scene(("a", flexible), ("b", rigid))
    x = rigid["vehicle"]["idler"]["x"]
    for change, same in ((1e-7, True), (1e-3, False)):  # m: within the tolerance of a search; another circuit
        moved = {**rigid, "vehicle": {**rigid["vehicle"], "idler": {**rigid["vehicle"]["idler"], "x": x + change}}}
        with nullcontext() if same else pytest.raises(BadInput, match=r"vehicle\.idler\.x = "):
            require_same_scene(("a", moved), ("b", rigid))
    looser = placed(load("settle", None, ["vehicle.tensioner.preload=1 kN"])).resolved()
    with pytest.raises(BadInput, match=r"vehicle\.tensioner\.preload = "):
        require_same_scene(("a", looser), ("b", rigid))


@pytest.mark.parametrize("moved", ["idler", "rear"])
def test_runs_of_one_scene_whose_further_wheel_was_placed(moved):
    """The place of the wheel that was moved, and pushes, are results of the search; that of the other wheel is not."""
    spring = {"stiffness": 1e6, "damping": 1e4, "preload": 0.0}
    wheel = {**load("straight").vehicle.idler.model_dump(), "x": -3.9, "z": 0.35, "radius": 0.2, "tensioner": spring}
    settings = {"vehicle.wheel": {"rear": wheel}, "vehicle.tensioner.wheel": moved}
    standing = {"standing": {"tracks": []}, "push": 0.0}
    rigid, flexible = ({**load("straight", each, settings).resolved(), **standing} for each in ("rigid", "flexible"))

    def changed(**parts):
        """Rigid links with another place or preload of a wheel."""
        vehicle = copy.deepcopy(rigid["vehicle"])
        vehicle["idler"]["x"] += parts.get("idler", 0.0)
        vehicle["wheel"]["rear"]["x"] += parts.get("rear", 0.0)
        vehicle["wheel"]["rear"]["tensioner"]["preload"] += parts.get("preload", 0.0)
        return {**rigid, "vehicle": vehicle}

    require_same_scene(("a", changed(**{moved: 2e-3}, preload=300.0)), ("b", flexible))
    require_same_scene(("a", changed(**{moved: 1e-6})), ("b", rigid))
    for wheel, run in ((moved, rigid), ("rear" if moved == "idler" else "idler", flexible)):
        key = re.escape("idler" if wheel == "idler" else "wheel.rear")
        with pytest.raises(BadInput, match=rf"vehicle\.{key}\.x = "):
            require_same_scene(("a", changed(**{wheel: 2e-3})), ("b", run))


def test_a_scene_takes_a_step_that_suits_its_vehicle():
    """The step is a whole part of the scene's own, at most the vehicle's; a step of the user is only warned of."""
    own = load("straight").run.step
    assert own == 1.25e-3
    for longest, step in ((None, own / 3.0), ("0.625 ms", own / 2.0), ("0.62 ms", own / 3.0), ("2 ms", own)):
        settings = ["vehicle=marder", *([f"vehicle.longest_step={longest}"] if longest else [])]
        scene = load("straight", None, settings)
        assert scene.run.step == pytest.approx(step, rel=1e-15)
        assert bool(scene.shortened) == (step < own)
        told = implausible_numbers(scene.resolved(), "own.toml")
        assert [each for each in told if "spin round" not in each] == []
        assert bool(told) == (scene.run.step > 0.5e-3), "beyond its step the marder's idler is too light"
    scene = load("straight", None, ["vehicle=marder"])
    assert scene.shortened == "run.step is 0.4167 ms instead of 1.25 ms: vehicle 'marder' has longest_step = 0.5 ms"
    own = load("straight", None, ["vehicle=marder", "run.step=1 ms"])
    assert (own.run.step, own.shortened) == (1e-3, "")
    first, second = implausible_numbers(own.resolved(), "own.toml")
    assert first.startswith("own.toml: run.step = 1 ms is longer than suits vehicle 'marder', longest_step = 0.5 ms")
    assert "vehicle.idler.radius" in second
    variable = load("hard_stop", None, ["vehicle=marder", "symmetric=false"]).run.variable
    assert (variable.longest, load("hard_stop").run.variable.longest) == (5e-4, 7e-3)


# --- settings of tracks ------------------------------------------------------------------------------


@pytest.mark.parametrize("model", TRACKS)
def test_keys_of_a_track_are_parameters_of_its_fmu(model):
    """Keys that a track takes are parameters of its FMU, with their choices and defaults; it has no other keys."""
    part = assemble(load("rig", model)).parts[0]
    ports = {port.name: port for port in model_of(part.kind)(part.config).ports}
    for key, target in TrackModelTable.fmu_parameters().items():
        assert (model in models_with(target.name)) == (target.name in ports), key
        if port := ports.get(target.name):
            asked = get_args(TrackModelTable.model_fields[key].annotation)
            chosen = next((get_args(one) for one in asked if get_origin(one) is Literal), ())
            assert set(chosen) <= {*(STARTS if key == "start" else port.choices)}, "an unknown start"
            assert {*port.choices} - set(chosen) <= {"planar"}, "scenes have a key of their own for this choice"
    for name, value in TRACKS[model].defaults.items():
        assert ports[name].start == value


@pytest.mark.parametrize(
    ("model", "settings", "parameters"),
    [
        ("flexible", (), {}),
        ("flexible", ("track.element=beam",), {"element": "beam"}),
        ("flexible", ("track.elasticity=general",), {"elasticity": "general"}),
        ("flexible", ("track.coordinates=cholesky", "track.integrator=runge_kutta"),
         {"coordinates": "cholesky", "integrator": "runge_kutta"}),
        ("rigid", ("track.integrator=hht",), {"integrator": "hht", "spectral_radius": 0.5}),  # the strongest damping
        ("rigid", ("track.integrator=hht", "track.spectral_radius=0.9"), {"integrator": "hht", "spectral_radius": 0.9}),
        *(("rigid", (f"track.integrator={integrator}", "track.rtol=1e-8", "track.atol=1e-7"),
           {"integrator": integrator, "adams.rtol": 1e-8, "adams.atol": 1e-7})
          for integrator in ("adams", "dormand_prince")),
    ],
)  # fmt: skip
def test_settings_of_a_track_reach_its_fmu(model, settings, parameters):
    """Without a setting the FMU has its own default, but for the damping of HHT."""
    default, given = (assemble(load("hanging_chain", model, one)).parts[0].parameters for one in ((), settings))
    assert {key: given[key] for key in given if given[key] != default.get(key)} == parameters
    assert not {"element", "elasticity", "coordinates", "spectral_radius"} & default.keys()


def test_a_key_of_one_model_is_declared_in_its_table_and_with_the_model(monkeypatch):
    """A toy key reaches the FMU, belongs to one model, is dropped when the model changes, is no part of the motion.

    A key that every model has needs no entry in ``TRACKS``.
    """

    class Toy(TrackModelTable):
        stickiness: Annotated[float | None, Sets("glue.stickiness", method=True)] = None

    assert Toy(model="flexible", stickiness=0.5).parameters() == {"glue.stickiness": 0.5}
    monkeypatch.setitem(TRACKS["rigid"].defaults, "glue.stickiness", 0.0)

    toy = Toy(model="rigid", stickiness=0.5)
    assert toy.parameters()["glue.stickiness"] == 0.5
    assert toy.of_model("flexible").parameters() == {}
    with pytest.raises(ValueError, match=r"stickiness = '0.5' needs model = 'rigid': flexible links have none"):
        Toy(model="flexible", stickiness=0.5)
    scene = load("rig", "rigid").model_copy(update={"track": toy})
    assert assemble(scene).parts[0].parameters["glue.stickiness"] == 0.5
    assert physical_scene(placed(scene)).track.stickiness is None


def test_a_vehicle_without_gravity_is_on_earth():
    table = read_vehicle("m113")
    del table["gravity"]
    assert vehicle.vehicle(table, "m113") == load("straight").vehicle
    assert load("straight", None, ["vehicle.gravity=9.5"]).vehicle.gravity == 9.5
