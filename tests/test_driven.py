"""A driver drives the vehicle: paths, mirror images, turned starts, keys of a scene, replay."""

import numpy as np
import pytest
from vehicle_in_process import InProcess

from fmus.vehicles.tables import BadInput
from orchestrator.execution import replay_model
from orchestrator.execution.simulate import simulate
from orchestrator.log.reader import Log
from orchestrator.scene.assembly import assemble
from orchestrator.scene.placing import placed
from orchestrator.scene.scene import load

BRIEF = ("run.stop=1 s", "driver.ramp_start=0", "driver.ramp_time=0.4 s", "track.link_outputs=false")


def way(*settings, steps=1200):
    """Positions of the hull (steps, 3), its heading, and its distance from its path."""
    vehicle = InProcess(load("serpentine", "rigid", (*BRIEF, *settings)))
    places = []
    for _ in range(steps):
        vehicle.step()
        chassis, driver = vehicle["chassis"], vehicle["driver"]
        place = [chassis[f"chassis.position.{axis}"] for axis in "xyz"]
        places.append([*place, chassis["yaw"], driver["path.lateral_error"]])
    return np.array(places)


@pytest.mark.long
def test_a_mirrored_path_is_driven_in_mirror_and_a_heading_turns_it():
    arcs = "driver.arcs=[[0.5, 0], [9, {}]]"
    there, back = way(arcs.format(0.1)), way(arcs.format(-0.1))
    assert there[-1, 3] > 0.01
    mirrored = back * [1.0, -1.0, 1.0, -1.0, -1.0]
    np.testing.assert_allclose(mirrored, there, atol=1e-9)
    turned = way(arcs.format(0.1), "start.heading=0.7", steps=600)
    c, s = np.cos(0.7), np.sin(0.7)
    x, y = turned[:, 0] * c + turned[:, 1] * s, turned[:, 1] * c - turned[:, 0] * s
    np.testing.assert_allclose(np.column_stack([x, y, turned[:, 3] - 0.7]), there[:600, [0, 1, 3]], atol=1e-9)


@pytest.mark.long
def test_in_fmus_it_is_the_same_bits_and_replays(tmp_path):
    settings = (*BRIEF[1:], "run.stop=0.1 s", "driver.arcs=[[3, 0.1]]", "driver.ramp_time=0.1 s")
    path = tmp_path / "driven.mcap"
    result = simulate(load("serpentine", "rigid", settings), path)
    assert (result["status"], result["message"]) == ("ok", "")
    vehicle = InProcess(load("serpentine", "rigid", settings)).run(0.1)
    with Log(path) as log:
        for name in ("driver.left.speed", "right_drive.speed", "chassis.yaw", "left_track.tension.max"):
            member, _, port = name.partition(".")
            assert log.signal(name)[1][-1] == vehicle[member][port], name
    assert vehicle["right_drive"]["speed"] > vehicle["left_drive"]["speed"] > 0.1
    for component in ("driver", "left_drive"):
        with replay_model.open_replay(path, component, None) as again:
            assert again.verify().difference is None


def test_a_scene_without_a_driver_has_nothing_of_it():
    parts = assemble(placed(load("turn", "rigid"))).parts
    assert {part.kind for part in parts} == {"TrackRigid", "SprocketDrive", "Chassis"}
    assert not any("demanded" in part.config.get("drive", {}) for part in parts)


def test_points_of_a_file_make_the_path(tmp_path, monkeypatch):
    (tmp_path / "way.csv").write_text("x,y\n0,0\n5,0\n9,2\n")
    monkeypatch.chdir(tmp_path)
    table = "driver={points='way.csv', speed='2 m/s'}"
    scene = load("serpentine", "rigid", [table])
    assert scene.driver.points == ((0.0, 0.0), (5.0, 0.0), (9.0, 2.0))
    driver = next(part for part in assemble(placed(scene)).parts if part.name == "driver")
    assert driver.parameters["path.points"] == "0.0 0.0; 5.0 0.0; 9.0 2.0"
    assert type(scene).model_validate(scene.resolved()) == scene


def test_a_driver_and_a_path_can_be_left_out():
    held = load("serpentine", "rigid", ["driver.arcs=false", "driver.heading=1"])
    assert (held.driver.arcs, held.driver.heading) == (None, 1.0)
    alone = load("serpentine", "rigid", ["driver=false", "drive.speed=3"])
    assert alone.driver is None
    assert not alone.turns


@pytest.mark.parametrize("head", ["", "\ufeff", "x,y\n"])
def test_a_file_of_points_loses_no_line(tmp_path, monkeypatch, head):
    (tmp_path / "way.csv").write_text(f"{head}0,0\n5,0\n", encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    (tmp_path / "arcs.csv").write_text(f"{head}4,0\n10,0.08\n", encoding="utf-8")
    assert load("serpentine", "rigid", ["driver.arcs=arcs.csv"]).driver.arcs == ((4.0, 0.0), (10.0, 0.08))
    settings = ["driver.arcs=false", "driver.points=way.csv"]
    assert load("serpentine", "rigid", settings).driver.points == ((0.0, 0.0), (5.0, 0.0))
    (tmp_path / "way.csv").write_text("0,O\n5,0\n9,0\n")
    with pytest.raises(BadInput, match=r"driver.points = 'way.csv', line 1: must be two numbers"):
        load("serpentine", "rigid", settings)


@pytest.mark.parametrize(
    ("settings", "sentence"),
    [
        (("symmetric=true",), "symmetric = true needs the same drive on both sides"),
        (('tracks=["left"]',), "a driver steers with both sides, but tracks has no 'right'"),
        (("track.axes=fixed",), "this vehicle turns: track.axes = 'fixed' keeps cables in their plane"),
        (("drive.mode=torque",), "drive.mode = 'torque': a driver needs 'speed' or 'controller'"),
        (("drive.speed=3",), "drive.speed = 3.0: a driver says how fast sprockets turn"),
        (("driver.heading=1",), "arcs and heading exclude each other"),
        (("driver.arcs=[[0, 0]]",), "an arc of length 0 turns on the spot: its second number is the angle, not 0"),
        (("driver.arcs=[[0, '1 1/m']]",), "driver.arcs[1]"),
        (("driver.arcs=[[3]]",), "driver.arcs[1]"),
        (("driver.grip=1",), "driver.grip = 1"),
        (("driver.arcs=[]",), "arcs: needs at least 1"),
        (("driver.speed_points=[[0, 1]]", "driver.speed=3"), "speed = 3.0 excludes speed_points"),
        (("driver.arcs=false", "driver.heading=1", "driver.reach=3"), "reach needs a path, arcs or points"),
        (("driver.arcs=false", "driver.points=[[0, 0], [1, 0], [1, 0]]"), "number 2 and 3 are the same place"),
        (("drive.left.brake=5", "drive.mode=speed"), "brake = 5.0 needs mode = 'torque' or 'controller', not 'speed'"),
        (("driver.sped=3",), "unknown key 'driver.sped': did you mean 'driver.speed'?"),
        (("driver.speed_points=[[1, 2], [0, 3]]",), "speed_points: needs times that rise"),
    ],
)
def test_what_a_driver_cannot_is_a_sentence(settings, sentence):
    with pytest.raises(BadInput) as refused:
        load("serpentine", "flexible", settings)
    assert sentence in str(refused.value)
