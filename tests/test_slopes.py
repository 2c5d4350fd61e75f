"""A vehicle on a slope: where it stands, how it creeps, and what its tracks carry."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from vehicle_in_process import InProcess

from fmus.interface.model import StepFailed
from fmus.kernels.jit import plain
from fmus.start import KEYS, StartPose, standing_pose, start_pose, vehicle_quaternion, world_position
from fmus.vehicles.sides import ground_level
from orchestrator.scene.placing import placed
from orchestrator.scene.scene import load

WEIGHT, CENTRE, TREAD = 155896.4, 0.578, 2.159  # N; height of the centre of mass settled and distance of the tracks, m
CREEP = 0.01  # m/s, friction_velocity of the ground
STANDING = ("drive.speed=0", "run.step=1 ms", "track.step=1 ms", "track.link_outputs=false")
HALVES = "symmetric=true", "symmetric=false"
CHAINS = {"flexible": (), "beam": ("track.element=beam",), "turning": ("track.axes=free",)}


def creeping(slope: float, friction: float = 0.3) -> float:
    """Velocity, m/s, at which regularised friction carries a locked vehicle on a slope, whatever its loads."""
    share = slope / friction
    return CREEP * share / np.sqrt(1.0 - share * share)


def standing(*settings, model="rigid"):
    return InProcess(placed(load("straight", model, (*STANDING, *settings))))


@cache
def locked(*settings, stop=10.0):
    """Times, velocities of hull (3) and left pads, forces of the ground (3) on both tracks, every 50 ms."""
    vehicle = standing(*settings)
    sides = [vehicle.members.get(f"{side}_track", vehicle["left_track"]) for side in ("left", "right")]
    rows = []
    for k in range(round(stop / 0.05)):
        vehicle.run(0.05)
        velocity = [vehicle["chassis"][f"chassis.velocity.{axis}"] for axis in "xyz"]
        forces = [[side[f"ground.force.{axis}"] for axis in "xyz"] for side in sides]
        rows.append([0.05 * (k + 1), *velocity, sides[0]["slip"], *np.ravel(forces)])
    rows = np.array(rows)
    return rows[:, 0], rows[:, 1:4], rows[:, 4], rows[:, 5:].reshape(-1, 2, 3)


def late(times, values, after=8.0):
    return values[times > after].mean(axis=0)


@pytest.mark.parametrize("heading", [0.0, 0.7, -2.5])
def test_a_vehicle_stands_on_the_plane_with_its_nose_along_its_heading(heading):
    vehicle = load("straight", "rigid").vehicle.model_dump()
    rise, ahead, left = 0.3, 0.25, -0.1
    pose = dict.fromkeys(KEYS, 0.0) | {"start.heading": heading}
    place = start_pose(pose | standing_pose(vehicle, (2.0, -1.0, 0.5), heading, (rise, ahead, left)))
    normal = np.array([-ahead, -left, 1.0]) / np.sqrt(1.0 + ahead * ahead + left * left)
    below = np.array(plain(world_position)(place, 0.0, 0.0, ground_level(vehicle)))
    on_plane = np.array([2.0, -1.0, 0.5 + ground_level(vehicle) + rise])
    np.testing.assert_allclose(below, on_plane, atol=1e-14)
    axes = Rotation.from_quat(np.roll(vehicle_quaternion(place), -1)).as_matrix()
    np.testing.assert_allclose(axes[:, 2], normal, atol=1e-15)
    assert np.cos(heading) * axes[1, 0] == pytest.approx(np.sin(heading) * axes[0, 0], abs=1e-15)
    np.testing.assert_allclose(axes @ place.down(), [0.0, 0.0, -1.0], atol=1e-15)
    assert abs(axes @ StartPose(*place[:6], 1.03 * place.slope_pitch, place.slope_roll).down() + [0, 0, 1]).max() > 2e-3


@pytest.mark.long
@pytest.mark.parametrize("slope", [0.1, 0.2])
def test_locked_sprockets_let_the_vehicle_creep(slope):
    """Pads on locked sprockets creep at the exact velocity of regularised friction; the ground carries the weight."""
    times, hull, pads, forces = locked("symmetric=true", f"ground.grade={slope}")
    expected = creeping(slope)
    assert late(times, pads) == pytest.approx(expected, rel=1e-4)
    along = late(times, hull) @ [1.0, 0.0, slope] / np.hypot(1.0, slope)
    assert along == pytest.approx(-expected, rel=1e-3)
    np.testing.assert_allclose(2.0 * late(times, forces)[0], [0.0, 0.0, WEIGHT], atol=1e-4 * WEIGHT)
    assert expected != pytest.approx(creeping(1.02 * slope), rel=1e-2)  # twin


@pytest.mark.parametrize(("torque", "holds"), [(5.0e3, True), (2.5e3, False)])
def test_a_parking_brake_holds_below_its_torque(torque, holds):
    """On 20 % the weight asks 3.7 kN m of each side: the vehicle creeps as on locked sprockets, or rolls away.

    Rolling, all of the brake's heat is its torque times the angle.
    """
    parked = ("ground.grade=0.2", HALVES[0], "drive.mode=torque", f"drive.brake={torque}")
    vehicle = InProcess(placed(load("straight", "rigid", (*STANDING[1:], *parked)))).run(1.0)
    drive, slips = vehicle["left_drive"], []
    for _ in range(40):  # the hull swings on its springs
        slips.append(vehicle.run(0.05)["left_track"]["slip"])
    assert (abs(drive["speed"]) < 1e-9) == holds
    assert (abs(drive["angle"]) < 1e-9) == holds
    assert (np.mean(slips) == pytest.approx(creeping(0.2), rel=0.01)) == holds
    assert drive["energy.dissipated"] == pytest.approx(torque * abs(drive["angle"]), rel=1e-9, abs=1e-6)


@pytest.mark.long
def test_the_start_is_an_equilibrium():
    """Loads of wheels at the start of a slope are those to which they settle; those of level ground are not (twin)."""

    def loads(vehicle):
        return np.array([vehicle["left_track"][f"road_wheel[{i}].force.z"] for i in range(1, 6)])

    vehicle = standing("symmetric=true", "ground.grade=0.2")
    start = loads(vehicle)
    ahead = [vehicle["left_track"][f"road_wheel[{i}].force.x"] for i in range(1, 6)]
    rows = [loads(vehicle.run(0.1)) for _ in range(60)]
    settled = np.mean(rows[30:], axis=0)
    np.testing.assert_allclose(start, settled, rtol=0.02)
    assert abs(loads(standing("symmetric=true")) / settled - 1.0).max() > 0.1
    assert np.isfinite(ahead).all()


@pytest.mark.long
def test_friction_that_is_too_small_lets_it_slide():
    times, hull, _, _ = locked("symmetric=true", "ground.grade=0.32", stop=3.0)
    speed = hull @ [1.0, 0.0, 0.32] / np.hypot(1.0, 0.32)
    angle = np.arctan(0.32)
    expected = -9.81 * (np.sin(angle) - 0.3 * np.cos(angle))
    assert np.polyfit(times[times > 1.0], speed[times > 1.0], 1)[0] == pytest.approx(expected, rel=0.01)
    assert expected == pytest.approx(-0.1869, abs=1e-4)


@pytest.mark.long
def test_a_side_slope_loads_the_lower_track():
    times, hull, _, forces = locked("ground.bank=0.1")
    assert np.hypot(*late(times, hull)[1:]) == pytest.approx(creeping(0.1), rel=2e-3)
    left, right = late(times, forces)
    np.testing.assert_allclose(left + right, [0.0, 0.0, WEIGHT], atol=1e-3 * WEIGHT)
    transfer = (right[2] - left[2]) * np.cos(np.arctan(0.1)) ** 2 / WEIGHT  # vertical forces carry both components
    assert 1.0 < transfer / (2.0 * CENTRE * 0.1 / TREAD) < 1.08


@pytest.mark.long
def test_a_bank_is_a_grade_for_a_vehicle_across_it():
    """Slopes are the ground's: a vehicle with heading 90 degrees has the grade on its right."""
    across = standing("ground.grade=-0.1", "start.heading=90 deg").run(0.05)
    bank = standing("ground.bank=0.1").run(0.05)
    for a, b, sign in (("x", "y", 1.0), ("y", "x", 1.0), ("z", "z", 1.0)):
        moved = across["chassis"][f"chassis.velocity.{a}"] * (-1.0 if a == "x" else 1.0)
        assert moved == pytest.approx(sign * bank["chassis"][f"chassis.velocity.{b}"], abs=1e-9)


@pytest.mark.long
@pytest.mark.parametrize("kind", CHAINS)
def test_all_kinds_of_links_start_alike(kind):
    """All kinds of links begin to creep as rigid ones do, until guides touch: their play is free by tenths of a mm."""
    settings = ("ground.grade=0.15", "ground.bank=0.1", *CHAINS[kind])
    rigid, other = standing(*settings[:2]).run(0.02), standing(*settings, model="flexible").run(0.02)
    for axis in "xyz":
        name = f"chassis.velocity.{axis}"
        assert other["chassis"][name] == pytest.approx(rigid["chassis"][name], abs=1e-4)
    lift = {name: [vehicle[f"{side}_track"]["ground.force.z"] for side in ("left", "right")]
            for name, vehicle in (("rigid", rigid), ("other", other))}  # fmt: skip
    np.testing.assert_allclose(lift["other"], lift["rigid"], rtol=3e-3)


@pytest.mark.parametrize(
    ("part", "key"),
    [
        ("left_track", "start.slope.pitch"),
        ("left_track", "start.slope.roll"),
        ("chassis", "start.heading"),
        ("left_drive", "start.slope.roll"),
    ],
)
def test_parts_that_start_on_different_slopes_are_refused(part, key):
    """A part turned by 1 degree is refused at the first step, where it would carry a multiple of the weight."""
    scene = placed(load("straight", "rigid", (*STANDING, "ground.grade=0.1", "ground.bank=0.3")))
    given = InProcess(scene)[part].parameters.get(key, 0.0)
    InProcess(scene, {part: {key: given + np.radians(0.02)}}).step()  # twin: 1.4 mm at the idler
    with pytest.raises(StepFailed, match=r"the wheels are turned by (0\.\d+|1(\.\d)?) degrees .*start\.slope\.roll"):
        InProcess(scene, {part: {key: given + np.radians(1.0)}}).step()


def test_half_a_vehicle_climbs_as_a_whole_one():
    settings = "ground.grade=0.2", "drive.ramp_start=0", "drive.ramp_time=0.1"
    scenes = [load("straight", "rigid", (*settings, each, "track.link_outputs=false")) for each in HALVES]
    half, whole = (InProcess(placed(scene)).run(0.1) for scene in scenes)
    for name in ("chassis.velocity.x", "chassis.velocity.z", "settlement", "distance"):
        assert half["chassis"][name] == pytest.approx(whole["chassis"][name], rel=1e-9)
    assert half["left_track"]["ground.force.x"] == pytest.approx(whole["right_track"]["ground.force.x"], rel=1e-9)
    assert abs(whole["chassis"]["chassis.velocity.x"]) > 1e-3
