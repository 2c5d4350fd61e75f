"""Scenes: the gallery, settings, units, names of logs, runs of one scene."""

import json
from contextlib import nullcontext

import numpy as np
import pytest
from scene_files import BARE
from scipy.spatial.transform import Rotation

from fmus.start import KEYS, start_pose, vehicle_quaternion
from fmus.track.choices import TRACKS
from fmus.vehicles import vehicle
from fmus.vehicles.tables import BadInput
from orchestrator.cli.inventory import describe
from orchestrator.scene.assembly import assemble
from orchestrator.scene.kinds import Scene
from orchestrator.scene.placing import placed
from orchestrator.scene.same_scene import require_same_scene
from orchestrator.scene.scene import OLD_SCENES, from_table, load, read_vehicle, scene_names
from orchestrator.scene.settings import file_part, keys, toml_text
from orchestrator.scene.values import implausible_numbers


@pytest.mark.parametrize("name", scene_names())
@pytest.mark.parametrize("track", TRACKS)
def test_gallery_resolves_and_reads_back(name, track):
    scene = load(name, track)
    assert scene.variant == track
    assert scene.title
    assert scene.expect
    again = from_table(json.loads(json.dumps(scene.resolved())), name)
    assert again == scene


def test_a_mode_that_is_set_leaves_out_what_the_scene_has_for_another():
    """Speeds of the file and of a resolved scene go with a motor's torque; a key that is set is refused, or counts."""
    turn = load("turn", "rigid")
    for drive in (
        load("turn", "rigid", ["drive.mode=torque"]).drive,
        load("turn", "rigid", ["drive.demand=true"]).drive,
    ):
        assert (drive.speed, drive.ramp_time, drive.steers) == (0.0, 1.0, False)
    one = turn.changed({"drive.left.mode": "torque", "drive.left.torque": 5e3, "drive.left.torque_limit": 4e3}).drive
    assert (one.left.speed, one.left.torque, one.right.speed, one.right.ramp_time) == (0.0, 5e3, 12.0, 1.5)
    with pytest.raises(BadInput, match=r"drive\.left: speed = 3\.0 needs mode = 'speed' or 'controller', not 'torque'"):
        turn.changed({"drive.left.mode": "torque", "drive.left.speed": 3.0})
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


def test_gallery_has_its_scenes():
    assert scene_names()[:5] == ["hanging_chain", "sprocket_bench", "rig", "settle", "straight"]


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
    odd = [
        {"fmu.a.file": file} for file in ("a/b.fmu", "a_b.fmu", "a b.fmu", "ab.fmu", "a*b.fmu", "ä.fmu", "\udc80.fmu")
    ]
    texts = [file_part(settings) for settings in (*odd, {"run.x": [1, 2]}, {"run.x": [12]}, {"key": "9" * 300})]
    assert len(set(texts)) == len(texts)
    assert all(text.isascii() and len(text) <= 90 and not set(text) & set("/\\*?[]\"' ") for text in texts)
    assert texts[1] == "-fmu.a.file=a_b.fmu"


@pytest.mark.parametrize("name", OLD_SCENES)
def test_a_scene_that_has_moved_says_where(name, tmp_path):
    with pytest.raises(BadInput, match=f"scene '{name}' has no FMU .* clone .*: python -m tests.validation mechanics"):
        load(name)
    own = tmp_path / "own.toml"
    own.write_text(f"title = 'own'\nassembly = '{OLD_SCENES[name]}'\n[run]\nstop = 1\nstep = 1e-3\n")
    with pytest.raises(BadInput, match=f"own.toml: assembly = '{OLD_SCENES[name]}': has no FMU"):
        load(str(own))


def test_settings_reach_scene_vehicle_and_track():
    scene = load(
        "straight",
        None,
        [
            "run.step=2 ms",
            "vehicle.contact.ground.friction=0.5",
            "track.integrator=runge_kutta",
            "track=rigid",
            "drive.speed=600 deg/s",
            "vehicle.road_wheel.x.0=-0.7",
        ],
    )
    assert scene.run.step == pytest.approx(2e-3, rel=1e-15)
    assert scene.run.steps == 4000
    assert scene.vehicle.contact.ground.friction == 0.5
    assert scene.track.integrator == "runge_kutta"
    assert scene.track.model == "rigid"
    assert scene.drive.speed == pytest.approx(10.471975512)
    assert scene.vehicle.road_wheel.x[0] == -0.7
    assert load("straight").vehicle.contact.ground.friction == 0.3, "the file's value must be back"


def test_vehicle_over_a_base(tmp_path):
    over = '[vehicle]\nbase = "m113"\nchassis = { mass = "6 t" }\n'
    file = tmp_path / "own.toml"
    file.write_text(BARE.format(vehicle="") + over)
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


@pytest.mark.parametrize("quantity", ["600 ms", "0.6", "6e-1s", ".01 min", "0.6 N*s/N", "0.6 m^2*s/m**2"])
def test_quantities(quantity):
    assert load("hanging_chain", None, [f"run.stop={quantity}"]).run.stop == pytest.approx(0.6)


def test_a_measure_is_not_reduced():
    """A setting is refused; a log of an earlier version, whose checks of measures hold the default, is read."""
    scene = load("turn")
    with pytest.raises(BadInput, match=r"turn\.toml: expect\.radius\.reduce = 'max': is for a signal"):
        scene.changed({"expect.radius.reduce": "max"})
    resolved = scene.resolved()
    assert "reduce" not in resolved["expect"]["radius"]
    assert load("hard_stop").resolved()["expect"]["nod"]["reduce"] == "max"
    earlier = {**resolved, "expect": {name: {**check, "reduce": "mean"} for name, check in resolved["expect"].items()}}
    assert from_table(earlier, "scene.json") == scene


def test_keys_reach_the_vehicle():
    scene_keys = set(keys(type(load("straight"))))
    assert {"run.step", "vehicle.contact.ground.friction", "drive.speed", "track.model"} <= scene_keys


def test_scenes_are_frozen():
    scene: Scene = load("straight")
    with pytest.raises(ValueError, match="frozen"):
        scene.run.stop = 1.0


def test_soil_has_a_name_or_numbers_and_needs_both_tracks():
    """A key of the scene counts before that of the named soil; tracks get all numbers in SI units."""
    scene = load("straight", None, ['ground.soil={name="dry_sand", cohesion="2 kPa"}'])
    soil = next(part.config["track"]["soil"] for part in assemble(scene).parts if "track" in part.config)
    assert (soil["cohesion"], soil["kphi"], soil["friction_angle"]) == (2e3, 1528.43e3, pytest.approx(0.4886921906))
    for changes, words in (
        (["ground.soil.name=moon"], "name = 'moon': must be one of dry_sand"),
        (['ground.soil={name="snow", k0=0}'], "nearly elastic"),
        (['ground.soil={name="snow"}', "tracks=['left']"], "needs both tracks and ground.hull = false"),
    ):
        with pytest.raises(BadInput, match=words):
            load("straight", None, changes)


def test_half_a_turn_of_roll():
    """The parts get the pose R_z(heading) R_y(pitch) R_x(180 deg) for half a turn of roll."""
    scene = load("settle", None, ["start.heading=0.3", "start.pitch=0.2", "start.roll=180 deg"])
    for part in assemble(scene).parts:
        w, x, y, z = vehicle_quaternion(start_pose(dict.fromkeys(KEYS, 0.0) | part.parameters))
        rotation = Rotation.from_quat([x, y, z, w])
        rolled = Rotation.from_euler("ZYX", [0.3, 0.2, np.pi])
        assert (rotation.inv() * rolled).magnitude() < 1e-12
        assert (rotation.inv() * Rotation.from_euler("ZYX", [0.3, 0.2, 0.97 * np.pi])).magnitude() > 0.09, "a twin"
    with pytest.raises(BadInput, match=r"start: roll = 1\.5708 rad must be 0 or half a turn"):
        load("settle", None, ["start.roll=90 deg"])
    bump = "ground.bump={start=1.0, rise=0.3, slope=0.5, length=1.0, radius=0.3}"
    with pytest.raises(BadInput, match=r"ground\.bump needs start\.roll = 0"):
        load("settle", None, ["start.roll=180 deg", bump])


def test_a_vehicle_without_hitch_and_seats_tows_nothing_and_seats_nobody():
    own = {key: table for key, table in vehicle.read_table("m113")[0].items() if key not in ("hitch", "seat")}
    scene = from_table({**load("straight").resolved(), "vehicle": own}, "straight.toml")
    with pytest.raises(BadInput, match=r"hitch: needs vehicle\.hitch"):
        scene.changed(["hitch.force=1"])
    with pytest.raises(BadInput, match="--for ride: m113 has no table"):
        scene.recording_for(["ride"])
    with pytest.raises(BadInput, match="--for ride: assembly = 'rig' has no seats"):
        load("rig").recording_for(["ride"])
    assert load("straight").recording_for(["ride"]).seats == ("driver",)


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
        ("vehicle.chassis.mass=1", "vehicle.chassis.mass = 1.0 and "),
        ("drive.speed=19", "drive.speed = 19.0 and 20.0"),
        ("start.heading=1", "start.heading = 1.0 and 0.0"),
        ("track.start=polygon", "track.start = 'polygon' and not given"),
        ("ground.hull=true", "ground.hull = true and false"),
        ("vehicle.hitch.x=-4", "vehicle.hitch.x = -4.0 and -4.41"),
        ("hitch.force=1", "hitch = {"),
    ):
        with pytest.raises(BadInput) as caught:
            require_same_scene(("a", load("straight", None, [change]).resolved()), ("b", whole))
        assert str(caught.value).startswith(f"a ('straight') and b ('straight') are runs of different scenes: {said}")
    with pytest.raises(BadInput, match="b does not say of which scene it is"):
        require_same_scene(("a", whole), ("b", {}))
    older = {
        **whole,
        "vehicle": {key: table for key, table in whole["vehicle"].items() if key not in ("hitch", "seat")},
    }
    require_same_scene(("a", whole), ("b", older))
    for name in ("rig", "settle"):
        flexible, rigid = (placed(load(name, model)).resolved() for model in ("flexible", "rigid"))
        require_same_scene(("a", flexible), ("b", rigid))
    x = rigid["vehicle"]["idler"]["x"]
    for change, same in ((1e-7, True), (1e-3, False)):  # m: within the tolerance of a search; another circuit
        moved = {**rigid, "vehicle": {**rigid["vehicle"], "idler": {**rigid["vehicle"]["idler"], "x": x + change}}}
        with nullcontext() if same else pytest.raises(BadInput, match=r"vehicle\.idler\.x = "):
            require_same_scene(("a", moved), ("b", rigid))
    with pytest.raises(BadInput, match=r"vehicle\.tensioner\.preload = "):
        require_same_scene(
            ("a", placed(load("settle", None, ["vehicle.tensioner.preload=1 kN"])).resolved()), ("b", rigid)
        )


def test_a_scene_takes_a_step_that_suits_its_vehicle():
    """The step is a whole part of the scene's own, at most the vehicle's; a step of the user is only warned of."""
    own = load("straight").run.step
    assert own == 1.25e-3
    for longest, step in ((None, own / 3.0), ("0.63 ms", own / 2.0), ("0.62 ms", own / 3.0), ("2 ms", own)):
        settings = ["vehicle=marder", *([f"vehicle.longest_step={longest}"] if longest else [])]
        scene = load("straight", None, settings)
        assert scene.run.step == pytest.approx(step, rel=1e-15)
        assert bool(scene.shortened) == (step < own)
        told = implausible_numbers(scene.resolved(), "own.toml")
        assert [each for each in told if "spin round" not in each] == []
        assert bool(told) == (scene.run.step > 0.5e-3), "beyond its step the marder's idler is too light"
    scene = load("straight", None, ["vehicle=marder"])
    assert scene.shortened == "run.step is 0.4167 ms instead of 1.25 ms: vehicle 'marder' has longest_step = 0.5 ms"
    assert scene.shortened in "\n".join(describe(scene))
    own = load("straight", None, ["vehicle=marder", "run.step=1 ms"])
    assert (own.run.step, own.shortened) == (1e-3, "")
    said = "own.toml: run.step = 1 ms is longer than suits vehicle 'marder', longest_step = 0.5 ms"
    first, second = implausible_numbers(own.resolved(), "own.toml")
    assert first.startswith(said)
    assert "vehicle.idler.radius" in second
    variable = load("hard_stop", None, ["vehicle=marder", "symmetric=false"]).run.variable
    assert (variable.longest, load("hard_stop").run.variable.longest) == (5e-4, 7e-3)


def test_the_speed_below_which_a_brake_fades():
    settings = ("drive.mode=torque", "drive.brake=25e3", "drive.brake_speed=1e-3")
    parts = {part.name: part for part in assemble(load("hold", "rigid", settings)).parts}
    assert parts["left_drive"].parameters["brake.speed"] == 1e-3
    parts = {part.name: part for part in assemble(load("hold", "rigid", settings[:2])).parts}
    assert "brake.speed" not in parts["left_drive"].parameters, "without the key the drive has its own default"
