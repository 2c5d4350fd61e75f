"""A driver with full vehicles: offsets, S-curves at the friction limit, reversing, turning; replay.

``fmus/test_driver_rides`` has the same with a planar vehicle, ``test_turning`` mirrored and turned paths. Friction of
1.2 is more than the chains of this vehicle bear: a braking track pulls its idler beyond its travel, and the chain jumps
over teeth. There the tensioner is stiffer.
"""

import numpy as np
import pytest
from vehicle_in_process import InProcess

from orchestrator.execution import replay_model
from orchestrator.execution.simulate import simulate
from orchestrator.log.reader import Log
from orchestrator.scene.scene import load

COARSE = ("run.step=2 ms", "track.step=2 ms", "track.link_outputs=false", "driver.ramp_start=0")
STIFF = "vehicle.tensioner.stiffness=1e7 N/m"
SHOWN = ("path.lateral_error", "path.heading_error", "path.progress", "speed.demand")


@pytest.mark.long
def test_in_fmus_it_is_the_same_bits_and_replays(tmp_path):
    settings = ("run.stop=0.1 s", "driver.ramp_start=0", "driver.arcs=[[3, 0.1]]", "driver.ramp_time=0.1 s")
    scene, path = load("serpentine", "rigid", settings), tmp_path / "driven.mcap"
    result = simulate(scene, path)
    assert (result["status"], result["message"]) == ("ok", "")
    vehicle = InProcess(scene).run(0.1)
    with Log(path) as log:
        for name in ("driver.left.speed", "right_drive.speed", "chassis.yaw", "left_track.tension.max"):
            member, _, port = name.partition(".")
            assert log.signal(name)[1][-1] == vehicle[member][port], name
    assert vehicle["right_drive"]["speed"] > vehicle["left_drive"]["speed"] > 0.1
    for component in ("driver", "left_drive"):
        with replay_model.open_replay(path, component, None) as again:
            assert again.verify().difference is None


def ride(track, stop, friction, *settings):
    """Outputs of the driver in each step (4, n), and the vehicle."""
    scene = load("serpentine", track, (*COARSE, f"vehicle.contact.ground.friction={friction}", *settings))
    vehicle, shown = InProcess(scene), []
    for _ in range(round(stop / scene.run.step)):
        vehicle.step()
        shown.append([vehicle["driver"][name] for name in SHOWN])
    return np.array(shown).T, vehicle


def overshoot(track, friction, speed, *settings, off=2.0, stop=14.0):
    """Overshoot over the path of a vehicle that starts at rest ``off`` m beside it, over that distance."""
    path = f"driver.points=[[0, {off}], [300, {off}]]"
    (error, *_, wanted), _ = ride(
        track, stop, friction, "driver.arcs=false", path, f"driver.speed={speed}", "driver.ramp_time=2", *settings
    )
    assert error[1] == pytest.approx(-off, rel=1e-3)
    assert abs(error[-1]) < 0.05 * off
    assert wanted[-1] == speed
    return error.max() / off


def s_curve(track, friction, *settings, radius=12.5):
    """Largest distance from an S-curve, at the speed of 0.8 of the friction unless the driver reduces it."""
    limit = friction * 9.81
    speed = np.sqrt(0.8 * limit * radius)
    k, arc, lead = 1.0 / radius, 1.5 * radius, 6.0 + speed**2 / limit
    arcs = f"driver.arcs=[[{lead}, 0], [{arc}, {k}], [{2 * arc}, {-k}], [{arc}, {k}], [{lead}, 0]]"
    drive = f"driver.speed={speed}", f"driver.ramp_time={3.0 * speed / limit}"
    stop = 2.0 * np.ceil(3.0 + 0.75 * (2.0 * lead + 4.0 * arc) / speed)
    (error, _, way, _), _ = ride(track, stop, friction, arcs, *drive, *settings)
    assert way[-1] > lead + 4.0 * arc
    return abs(error[way < lead + 4.0 * arc]).max()


@pytest.mark.study
@pytest.mark.parametrize(
    ("track", "friction", "speed", "settings"),
    [
        ("rigid", 0.3, 2.0, ()),
        ("rigid", 0.3, 5.0, ()),
        ("rigid", 0.3, 8.0, ()),
        ("rigid", 0.2, 5.0, ()),
        ("rigid", 0.7, 2.0, ()),
        ("rigid", 0.7, 5.0, ()),
        ("rigid", 0.7, 8.0, ()),
        ("rigid", 1.2, 5.0, (STIFF,)),
        ("rigid", 1.2, 8.0, (STIFF,)),
        ("flexible", 0.7, 5.0, ()),
    ],
)
def test_from_two_metres_beside_its_path_it_hardly_overshoots(track, friction, speed, settings):
    assert overshoot(track, friction, speed, *settings) < 0.03


@pytest.mark.study
@pytest.mark.parametrize(
    ("track", "friction", "settings"),
    [
        ("rigid", 0.2, ()),
        ("rigid", 0.3, ()),
        ("rigid", 0.7, ()),
        ("rigid", 1.2, (STIFF,)),
        ("flexible", 0.3, ()),
        ("flexible", 0.7, ()),
    ],
)
def test_an_s_curve_at_the_limit_of_friction(track, friction, settings):
    assert s_curve(track, friction, *settings) < 0.15


@pytest.mark.study
def test_an_s_curve_needs_the_friction_as_it_is():
    assert s_curve("rigid", 0.3, "driver.friction=0.4") > 0.15


@pytest.mark.study
def test_without_the_friction_it_overshoots():
    assert overshoot("rigid", 0.3, 3.0, "driver.friction=0", off=1.0, stop=6.0) > 0.0
    assert overshoot("rigid", 0.3, 5.0, "driver.friction=0") > 0.1


@pytest.mark.long
def test_it_comes_to_its_path_from_beside():
    """A vehicle beside its path reaches it in 6 s to 4 %, from one side: errors are critically damped."""
    assert overshoot("rigid", 0.3, 3.0, off=1.0, stop=6.0) < 0.0


@pytest.mark.study
def test_it_drives_back_turns_on_the_spot_and_stops():
    """The vehicle reverses, turns on the spot and stops 5 m ahead and 3 m to the left of its start.

    Places are those of the wheels' middle.
    """
    arcs = f"driver.arcs=[[5, 0], [6, 0.1], [-6, 0.1], [0, {0.5 * np.pi}], [3, 0]]"
    (error, _, way, wanted), vehicle = ride("rigid", 30.0, 0.3, arcs, "driver.speed=2", "driver.ramp_time=1.5")
    chassis = vehicle["chassis"]
    assert chassis["yaw"] == pytest.approx(0.5 * np.pi, abs=0.02)
    assert way[-1] == pytest.approx(20.0, abs=0.05)
    assert abs(error).max() < 0.1
    assert abs(chassis["speed"]) < 0.05
    assert 3.0 < 2e-3 * (wanted < -0.5).sum() < 8.0


@pytest.mark.long
def test_a_held_command_pulls_as_a_demand_does(tmp_path):
    """The largest tension of the robot at 13 rad/s commanded at once; lines from step to step are those of a demand."""
    t = np.arange(1, 501) * 5e-4
    lag = np.stack([0.05 + t, 13.0 * (1.0 - np.exp(-t / 0.1))], axis=1)
    points = {"held": [[0.05, 13.0]], "jump": [[0.05, 0.0], [0.0501, 13.0]], "demanded": [[0.05, 0.0], *lag.tolist()]}
    found = {}
    for name, each in points.items():
        drive = {"mode": "speed", "speed_points": each, "interpolation": "hold" if name == "held" else "linear"}
        settings = {"track.step": 5e-4, "run.step": 5e-4, "run.stop": 0.3, "expect": {}, "drive": drive}
        result = simulate(load("robot", "rigid", settings), tmp_path / f"{name}.mcap")
        found[name] = result["observables"]["tension_max"]
    assert found["held"] == pytest.approx(found["demanded"], rel=1e-3)
    assert found["jump"] > 2.5 * found["held"]
