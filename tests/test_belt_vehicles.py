"""Vehicles on belts that stretch, and vehicles that smooth wheels drive by friction."""

import math

import numpy as np
import pytest

from fmus.vehicles.sides import pins_a_turn
from fmus.vehicles.vehicle import read_table, vehicle
from orchestrator.execution.simulate import simulate
from orchestrator.log.reader import Log
from orchestrator.results.analyses import spectrum, validity
from orchestrator.results.chain_measures import pins_per_revolution
from orchestrator.results.run_data import RunData, Window
from orchestrator.results.vehicle_measures import speed_excess
from orchestrator.results.views.shapes import wheel_body
from orchestrator.scene.scene import load

pytestmark = pytest.mark.long  # kernels of their own
SHAPE = ("teeth", "outer_radius", "pin_radius", "seat_clearance", "flank_angle", "tip_radius")
STEADY = Window(1.0, 1.4)
STRAIGHT = {  # half the robot, at constant speed from 0.75 s on
    "symmetric": True, "drive.left": {}, "drive.right": {}, "drive.speed_points": [[0.25, 0], [0.75, 10], [9, 10]],
    "run.stop": 1.45, "run.links": 1,
}  # fmt: skip
RADIUS, FACE, REGULAR = 0.0693, 0.008, 0.05  # of the smooth wheel and its links, m, and of friction, m/s
FINE = {  # links of half the pitch
    "vehicle.track.links": 86, "vehicle.track.pitch": 0.02, "vehicle.track.mass": 0.075,
    "vehicle.track.inertia": [1.42e-4, 4.1e-6, 1.43e-4], "run.step": 2.5e-4, "track.step": 2.5e-4,
}  # fmt: skip


@pytest.mark.parametrize("native", [False, pytest.param(True, marks=pytest.mark.study)])  # libraries of its own
def test_a_groomer_on_belts_that_stretch(tmp_path, native):
    """In snow the ledger closes, the ground bears the weight, and a belt that stretches has less tension, by 4 %.

    Native FMUs have the same bits, where it drives off at once.
    """
    begin, tensions = ({"run.stop": 0.3, "drive.ramp_start": 0.0} if native else {"run.stop": 2.5}), {}
    for model in ("rigid", "flexible"):
        scene, path = load("snow", model, begin), tmp_path / f"{model}.mcap"
        assert scene.vehicle.track.belt.axial == 4.5e6
        result = simulate(scene, path, estimated=False)
        assert (result["status"], result["validity"]) == ("ok", [])
        if native:
            simulate(scene, tmp_path / "native.mcap", estimated=False, native=True)
            with Log(path) as one, Log(tmp_path / "native.mcap") as other:
                assert one.digest() == other.digest()
            continue
        assert abs(result["energy"]["residual_relative"]) < 5e-4
        assert result["checks"]["ground_force"]["value"] == pytest.approx(88290.0, rel=1e-3)
        with Log(path) as log:
            run = RunData(log)
            tensions[model] = [run.mean("left_track.tension.mean", Window(*span)) for span in ((0.1, 0.5), (1.5, 2.5))]
    if not native:
        ratios = np.divide(tensions["flexible"], tensions["rigid"])
        assert ((ratios > 0.94) & (ratios < 0.98)).all()


def smooth_robot(tmp_path, name, **settings):
    """Run of the robot on smooth driving wheels, straight ahead, and its result."""
    table = read_table("robot")[0]
    table["sprocket"] = {key: value for key, value in table["sprocket"].items() if key not in SHAPE}
    table["sprocket"]["radius"] = RADIUS
    table["contact"]["sprocket"]["friction"] = 0.6
    scene = load("robot", "rigid", STRAIGHT | {"vehicle": table} | settings)
    path = tmp_path / f"{name}.mcap"
    return simulate(scene, path, estimated=False), RunData(Log(path))


def tensions(run):
    """Mean tensions of the left track that leave and enter its driving wheel at the rear, N: T1 - T2 = torque / R."""
    links = run.links("left_track", STEADY)
    ahead, up = links.middles()
    slack = float(links.tension[(up > 0.03) & (ahead > 0.02) & (ahead < 0.1)].mean())
    return slack, slack + run.mean("left_drive.torque", STEADY) / (RADIUS + FACE)


def wrap():
    """Angle of the belt round the wheel, rad, between tangents to the rear roller above and the road wheel below."""
    table, line, turned = read_table("robot")[0], RADIUS + FACE, math.pi
    for sign, wheel, x in ((1.0, "return_roller", 0.20), (-1.0, "road_wheel", 0.14)):
        other = float(table[wheel]["radius"].split()[0]) + FACE
        z = float(table[wheel]["z"].split()[0])
        turned += math.asin((line - other) / math.hypot(x, z)) - sign * math.atan2(z, x)
    return turned


def creep(run, friction):
    """Slip of the belt on its wheel over the wheel's speed by Euler-Eytelwein with regularised friction."""
    slack, tight = tensions(run)
    share = math.log(tight / slack) / (friction * wrap() * RADIUS / (RADIUS + FACE))
    speed = REGULAR * share / math.sqrt(1.0 - share**2)
    return speed / (run.mean("left_drive.speed", STEADY) * RADIUS)


@pytest.mark.study  # links of half the pitch
def test_a_smooth_wheel_drives_a_vehicle_and_creeps_as_its_tensions_say(tmp_path):
    ways, creeps = {}, {}
    for force in (0.0, 80.0):
        result, run = smooth_robot(tmp_path, f"{force}", **FINE, **({"hitch": {"force": force}} if force else {}))
        assert (result["status"], result["validity"]) == ("ok", [])
        assert abs(result["energy"]["residual_relative"]) < 2e-3
        pins = pins_a_turn(run.scene["vehicle"])
        assert pins == pytest.approx(2.0 * math.pi * (RADIUS + FACE) / 0.02, rel=1e-12)
        ways[force] = pins_per_revolution(run, "left", STEADY) / pins
        assert ways[force] == pytest.approx(1.0 - creep(run, 0.6), abs=8e-3)
        creeps[force] = np.array([creep(run, 0.6), creep(run, 0.75)])
    expected, twin = creeps[80.0] - creeps[0.0]
    assert ways[0.0] - ways[80.0] == pytest.approx(expected, rel=0.15)  # links are a polygon: 0.3 with the robot's own
    assert ways[0.0] - ways[80.0] != pytest.approx(twin, rel=0.15)
    assert abs(speed_excess(run, "", STEADY)) < 0.04
    assert spectrum.tooth_passing_frequency(run, "left_track.travel", STEADY) == pytest.approx(
        pins * 10.0 / (2.0 * math.pi), rel=1e-3
    )
    unchecked = validity.of(run).unchecked
    assert "vehicle.sprocket.teeth" in unchecked["tooth_jump"]
    drawn = wheel_body("left_track/sprocket", "sprocket", "left_track", run.scene["vehicle"])
    assert (drawn.radius, len(drawn.outline)) == (RADIUS, 0)


def test_a_smooth_wheel_slips_where_tension_or_friction_is_too_small(tmp_path):
    """A load that is towed pulls the vehicle back; the tensions are at the limit of Euler and Eytelwein."""
    settings = {"hitch": {"force": 80.0}, "vehicle.contact.sprocket.friction": 0.05}
    result, run = smooth_robot(tmp_path, "slips", **settings)
    assert (result["status"], result["validity"]) == ("ok", [])
    assert abs(result["energy"]["residual_relative"]) < 2e-3
    slack, tight = tensions(run)
    inside = RADIUS / (RADIUS + FACE)
    assert tight / slack == pytest.approx(math.exp(0.05 * wrap() * inside), rel=0.02)
    assert tight / slack != pytest.approx(math.exp(0.07 * wrap() * inside), rel=0.02)
    assert run.mean("left_track.speed", STEADY) < 0.0 < run.mean("left_drive.speed", STEADY)


def towing(tmp_path, model, cut, stop=1.45, native=False, **sprocket):
    """Run of the robot that tows 80 N, its links ``cut`` into so many, with these numbers of its sprocket."""
    table = vehicle(*read_table("robot")).model_dump()
    pitch, width, height = table["track"]["pitch"] / cut, table["track"]["width"], 2.0 * table["track"]["face"]
    box = [width**2 + height**2, pitch**2 + height**2, pitch**2 + width**2]
    mass = table["track"]["mass"] / cut
    settings = {
        "links": 43 * cut, "pitch": pitch, "mass": mass, "inertia": [mass / 12.0 * both for both in box],
    }  # fmt: skip
    settings = {f"vehicle.track.{key}": value for key, value in settings.items()}
    for law, key in ((law, key) for law in ("wheel", "ground") for key in ("stiffness", "damping")):
        settings[f"vehicle.contact.{law}.{key}"] = table["contact"][law][key] / cut
    settings |= {f"vehicle.sprocket.{key}": value for key, value in sprocket.items()}
    path = tmp_path / f"{model}-{cut}-{len(sprocket)}-{native}.mcap"
    scene = load("robot", model, STRAIGHT | {"run.stop": stop, "hitch.force": 80.0} | settings)
    result = simulate(scene, path, estimated=False, native=native)
    assert (result["status"], result["validity"]) == ("ok", [])
    assert abs(result["energy"]["residual_relative"]) < 1e-3
    return path


def driven(path):
    """Mean tension at rest, N; pins a turn, torque, N m, and speed, m/s, at constant speed; teeth a second."""
    with Log(path) as log:
        run = RunData(log)
        pins, torque = pins_per_revolution(run, "left", STEADY), run.mean("left_drive.torque", STEADY)
        teeth = spectrum.tooth_passing_frequency(run, "left_track.travel", STEADY)
        tension, speed = run.mean("left_track.tension.mean", Window(0.05, 0.25)), run.mean("left_track.speed", STEADY)
        return tension, pins, torque, speed, teeth


def test_a_lug_on_every_nth_pin_drives_as_whole_links_do(tmp_path):
    """Links cut in two or three keep tension, way a turn and speed; the torque is that of a tooth for each pin.

    Cut links creep more on soft ground than whole ones, which costs 3 % of the torque.
    """
    tension, pins, torque, speed, teeth = driven(towing(tmp_path, "rigid", 1))
    small = {"teeth": 24, "outer_radius": 0.0785, "pin_radius": 2e-3, "seat_clearance": 1e-3, "tip_radius": 3e-4}
    each = driven(towing(tmp_path, "rigid", 2, **small))[2]
    for model, cut in ("rigid", 2), ("flexible", 2), ("rigid", 3):
        seen = driven(towing(tmp_path, model, cut, pins_per_gap=cut))
        assert seen[0] == pytest.approx(tension, rel=1e-3)
        assert seen[1] == pytest.approx(cut * pins, rel=1e-3)
        assert seen[2] == pytest.approx(torque, rel=0.04)
        assert seen[2] == pytest.approx(each, rel=0.01)
        assert seen[3] == pytest.approx(speed, rel=1e-3)
        assert seen[4] == pytest.approx(teeth, rel=1e-9)
    assert abs(each / torque - 1.0) > 0.02, "the twin: the cut changes the torque, not the lugs"


@pytest.mark.study
@pytest.mark.parametrize("model", ["rigid", "flexible"])
def test_native_lugs_have_the_same_bits(tmp_path, model):
    digests = []
    for native in (False, True):
        with Log(towing(tmp_path, model, 2, 0.5, native, pins_per_gap=2)) as log:
            digests.append(log.digest())
    assert digests[0] == digests[1]
