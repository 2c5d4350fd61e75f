"""Steering by two drives, a differential or a driver: theory, mirror images, turned starts, powers.

The general theory brackets a run within these bands: it has no links, whose pads run about 1.1 % faster than the pitch
circle, and no strand tensions, which move load between the wheels.
"""

import numpy as np
import pytest
from skid_steering import Vehicle, turn
from vehicle_in_process import InProcess

from fmus.track.choices import TRACKS
from orchestrator.cli.inventory import contact_pairs
from orchestrator.execution import replay_model
from orchestrator.execution.simulate import simulate
from orchestrator.log.reader import Log, Missing
from orchestrator.results import difference, turning, vehicle_measures
from orchestrator.results.run_data import RunData, Window
from orchestrator.scene.assembly import assemble
from orchestrator.scene.placing import placed
from orchestrator.scene.same_scene import scene_difference
from orchestrator.scene.scene import load

PADS = 1.0114  # speed of a track over that of the pitch circle, measured driving straight
QUICK = ("run.stop=1.5 s", "drive.ramp_start=0.2 s", "drive.ramp_time=0.8 s", "track.link_outputs=false")
JOINED = (*QUICK, "drive.speed=6", "drive.steering.ramp_start=0.2 s", "drive.steering.ramp_time=0.8 s")
DRIVEN = ("run.stop=1 s", "driver.ramp_start=0", "driver.ramp_time=0.4 s", "track.link_outputs=false")
MEASURES = "yaw_rate", "turn_radius", "lateral_speed", "rotation_centre", "steering_moment"


def speeds(left, right):
    return f"drive.left.speed={left}", f"drive.right.speed={right}"


@pytest.fixture(scope="module")
def turned(tmp_path_factory):
    """Return a function that gives means of a run by name, and the theory."""
    made = {}

    def once(kind, left, right, window, *settings):
        key = (kind, left, right, *settings)
        if key not in made:
            path = tmp_path_factory.mktemp("logs") / "turn.mcap"
            given = (*speeds(left, right), f"run.stop={window.end}", "run.links=1000", *settings)
            result = simulate(load("turn", kind, given), path)
            assert (result["status"], result["message"]) == ("ok", "")
            with Log(path) as log:
                run = RunData(log)
                means = {name: getattr(turning, name)(run, "", window) for name in MEASURES}
                for side in ("left", "right"):
                    for name in ("track_slip", "propulsion", "drive_power"):
                        means[f"{name}_{side}"] = getattr(turning, name)(run, side, window)
                    means[f"torque_{side}"] = run.mean(f"{side}_drive.torque", window)
                    means[f"load_{side}"] = run.mean(f"{side}_track.ground.force.z", window)
                means["load"] = means["load_left"] + means["load_right"]
                means["ahead"] = np.sqrt((means["turn_radius"] * means["yaw_rate"]) ** 2 - means["lateral_speed"] ** 2)
                means["ledger"] = result["energy"]["residual_relative"]
            made[key] = means, turn(Vehicle(), (left, right))
        return made[key]

    return once


SPEEDS = (8.0, 12.0)
STEADY = Window(4.0, 6.0)


def outside(means, theory):
    """Quantities outside their bands, with value and band."""
    vehicle = Vehicle()
    faster = turn(vehicle._replace(radius=PADS * vehicle.radius), SPEEDS)
    weight, moment = vehicle.mass * 9.81, theory.moment(vehicle)
    wanted = {
        "yaw_rate": (theory.rate, 0.04 * theory.rate),
        "turn_radius": (theory.radius, 0.04 * theory.radius),
        "ahead": (1.0055 * theory.ahead, 0.0105 * theory.ahead),  # pads run faster than the pitch circle
        "load": (weight, 2e-3 * weight),
        "steering_moment": (moment, 0.04 * moment),
        "lateral_speed": (theory.left, 0.12 * abs(theory.left)),
        "rotation_centre": (-theory.left / theory.rate, 0.12 * abs(theory.left / theory.rate)),
    }
    for k, (side, sign) in enumerate((("left", 1.0), ("right", -1.0))):
        load = 0.5 * weight - sign * 1.15 * theory.transfer
        wanted[f"load_{side}"] = load, 0.15 * theory.transfer + 300.0
        wanted[f"propulsion_{side}"] = theory.force[k], max(0.04 * abs(theory.force[k]), 500.0)
        ground = means["ahead"] - sign * vehicle.half_width * means["yaw_rate"]
        slip = means[f"slip_{side}"] = PADS * vehicle.radius * SPEEDS[k] - ground
        wanted[f"track_slip_{side}"] = slip, 0.06 * abs(slip)
        wanted[f"slip_{side}"] = faster.slip[k], 0.08 * abs(faster.slip[k])
    return {name: (means[name], *band) for name, band in wanted.items() if not abs(means[name] - band[0]) <= band[1]}


@pytest.mark.long
@pytest.mark.parametrize("kind", TRACKS)
def test_a_turn_is_that_of_the_general_theory(turned, kind):
    means, theory = turned(kind, *SPEEDS, STEADY)
    assert outside(means, theory) == {}
    # tracks without slip, or wheel loads instead of link loads, are far off
    assert abs(2.0 * Vehicle().half_width * means["yaw_rate"] / (4.0 * Vehicle().radius) - 1.0) > 0.25
    wheels = turn(Vehicle(shares=(0.222, 0.208, 0.193, 0.191, 0.186)), SPEEDS)
    assert abs(means["yaw_rate"] / wheels.rate - 1.0) > 0.04
    assert outside(means | {"yaw_rate": 1.05 * means["yaw_rate"]}, theory)


@pytest.mark.long
@pytest.mark.parametrize("kind", TRACKS)
def test_power_goes_where_the_forces_are(turned, kind):
    """Power follows the forces: the inner sprocket brakes, the outer one drives, losses are small."""
    means, _ = turned(kind, *SPEEDS, STEADY)
    assert abs(means["ledger"]) < 1e-3
    for k, side in enumerate(("left", "right")):
        assert means[f"drive_power_{side}"] == pytest.approx(SPEEDS[k] * means[f"torque_{side}"], rel=1e-3)
        loss = means[f"torque_{side}"] - Vehicle().radius * means[f"propulsion_{side}"]
        assert 0.0 < loss < 500.0
    assert means["drive_power_left"] < 0.0 < means["drive_power_right"]


@pytest.mark.long
def test_rigid_and_flexible_links_turn_alike(turned):
    rigid, flexible = (turned(kind, *SPEEDS, STEADY)[0] for kind in ("rigid", "flexible"))
    assert flexible["yaw_rate"] == pytest.approx(rigid["yaw_rate"], rel=3e-3)
    assert flexible["steering_moment"] == pytest.approx(rigid["steering_moment"], rel=5e-3)


@pytest.mark.study
@pytest.mark.parametrize("speeds_of", [(8.0, 12.0), (0.0, 10.0), (-10.0, 10.0), (20.0, 16.0)])
def test_all_kinds_of_links_turn_alike(turned, speeds_of):
    """All kinds of links turn alike to 0.3 %, from 2 s after the ramp on."""
    rigid, cable = (turned(kind, *speeds_of, STEADY)[0]["yaw_rate"] for kind in ("rigid", "flexible"))
    beam = turned("flexible", *speeds_of, STEADY, "track.element=beam")[0]["yaw_rate"]
    assert [cable, beam] == pytest.approx([rigid] * 2, rel=3e-3)


@pytest.mark.study
@pytest.mark.parametrize("kind", TRACKS)
def test_a_turn_with_little_slip(turned, kind):
    """The theory is coarse in a turn with little slip (19 and 21 rad/s, below 3 %)."""
    means, theory = turned(kind, 19.0, 21.0, STEADY)
    assert -0.10 < means["yaw_rate"] / theory.rate - 1.0 < 0.03


# --- paths ---


def drive(scene, kind, settings, steps):
    """Places of the hull (steps, 3), heading and power of all motors, and the vehicle."""
    vehicle = InProcess(load(scene, kind, settings))
    powers = [("differential", f"{motor}.power") for motor in ("propulsion", "steering")]
    if "differential" not in vehicle.members:
        powers = [(f"{side}_drive", "power") for side in ("left", "right")]
    rows = []
    for _ in range(steps):
        vehicle.step()
        chassis = vehicle["chassis"]
        place = [chassis[f"chassis.position.{axis}"] for axis in "xyz"]
        rows.append([*place, chassis["yaw"], sum(vehicle[part][name] for part, name in powers)])
    return np.array(rows), vehicle


@pytest.fixture(scope="module")
def to_the_left():
    return drive("differential", "rigid", (*JOINED, "drive.steering.speed=8"), 1200)


MIRRORED = {  # scene, links, settings, and those of the turn to each side
    "two drives, rigid": ("turn", "rigid", QUICK, speeds(8, 12), speeds(12, 8)),
    "two drives, cables": ("turn", "flexible", QUICK, speeds(8, 12), speeds(12, 8)),
    "differential": ("differential", "rigid", JOINED, ("drive.steering.speed=8",), ("drive.steering.speed=-8",)),
    "driver": ("serpentine", "rigid", DRIVEN, *([f"driver.arcs=[[0.5, 0], [9, {k}]]"] for k in (0.1, -0.1))),
}


@pytest.mark.long
@pytest.mark.parametrize("case", MIRRORED)
def test_swapped_sides_mirror_the_path_and_a_heading_turns_it(case):
    scene, kind, settings, left, right = MIRRORED[case]
    there, back = (drive(scene, kind, (*settings, *side), 1500)[0] for side in (left, right))
    assert there[-1, 3] > 0.01
    mirrored = back * [1.0, -1.0, 1.0, -1.0, 1.0]
    np.testing.assert_allclose(mirrored[:, :4], there[:, :4], atol=1e-9)
    np.testing.assert_allclose(mirrored[:, 4], there[:, 4], atol=1e-4)
    heading = 0.7
    other = drive(scene, kind, (*settings, *left, f"start.heading={heading}"), 600)[0]
    c, s = np.cos(heading), np.sin(heading)
    x, y = other[:, 0] * c + other[:, 1] * s, other[:, 1] * c - other[:, 0] * s
    np.testing.assert_allclose(np.column_stack([x, y, other[:, 2], other[:, 3] - heading]), there[:600, :4], atol=1e-9)


@pytest.mark.long
def test_with_prescribed_speeds_a_differential_drives_as_two_drives_do(to_the_left):
    """Also under a driver."""
    there, _ = to_the_left
    two, _ = drive("turn", "rigid", (*QUICK, *speeds(2, 10)), 1200)
    np.testing.assert_allclose(there[:, :4], two[:, :4], atol=1e-9)
    np.testing.assert_allclose(there[:, 4], two[:, 4], atol=1e-4)
    other, _ = drive("differential", "rigid", (*JOINED, "drive.steering.speed=8.2"), 600)
    assert np.abs(other[:, 3] - there[:600, 3]).max() > 1e-4
    arcs = (*DRIVEN, "driver.arcs=[[0.1, 0], [9, 0.2]]")
    one, vehicle = drive("serpentine", "rigid", (*arcs, "drive.steering.mode=speed"), 1200)
    two, _ = drive("serpentine", "rigid", arcs, 1200)
    assert "differential" in vehicle.members
    assert two[-1, 3] > 0.01
    np.testing.assert_allclose(one[:, :4], two[:, :4], atol=1e-9)


@pytest.mark.long
def test_powers_of_a_differential_close(to_the_left):
    """The power of the half shafts is that of the motors, and the chains receive it."""
    gear = to_the_left[1]["differential"]
    given = gear["left.work"] + gear["right.work"]
    assert given == pytest.approx(gear["propulsion.work"] + gear["steering.work"], rel=1e-9)
    assert given == pytest.approx(gear["energy.work"], rel=1e-9)
    assert gear["left.power"] < 0.0 < gear["right.power"]
    assert gear["power.regenerated"] == pytest.approx(-gear["left.power"])
    taken = gear["energy.work"] + gear["port.work"] - gear["energy.dissipated"] - gear["energy.kinetic"]
    assert abs(taken) < 1e-6 * gear["energy.work"]


@pytest.mark.long
def test_measures_of_a_differential_are_those_of_its_outputs(tmp_path):
    log, window = tmp_path / "joined.mcap", Window(1.1, 1.3)
    scene = load("differential", "rigid", (*JOINED, "drive.steering.speed=8", "run.stop=1.3 s"))
    assert simulate(scene, log)["status"] == "ok"
    with Log(log) as opened:
        run = RunData(opened)
        assert run.sides == ("left", "right")
        for of in ("left", "right", "propulsion", "steering"):
            mean = run.mean(f"differential.{of}.power", window)
            assert turning.drive_power(run, of, window) == pytest.approx(mean, rel=0.02)
        with pytest.raises(Missing):
            turning.drive_power(run, "steer", window)
        with np.errstate(invalid="ignore"):
            assert np.isnan(turning.regenerated_power(run, "", Window(1.1, 1.1)))
        assert dict(difference.observables(run))["torque"].read(run, 1).values.shape[1] == 2
        assert turning.regenerated_power(run, "", window) == -turning.drive_power(run, "left", window) > 0.0
        faster = run.mean("chassis.speed", window) / (0.242552 * run.mean("differential.propulsion.speed", window))
        assert vehicle_measures.speed_excess(run, "", window) == pytest.approx(faster - 1.0, abs=1e-5)
    with replay_model.open_replay(log, "differential", None) as again:
        assert again.verify().difference is None


@pytest.mark.long
def test_free_axes_go_straight_as_fixed_ones_do():
    """Free axes drive straight as fixed ones do, to 1e-5; only roll and yaw by rounding may differ."""
    settings = (*QUICK, *speeds(8, 8), "track.element=cable")
    ways = [drive("turn", "flexible", (*settings, f"track.axes={axes}"), 1500)[0][:, :3] for axes in ("fixed", "free")]
    gone = ways[0][-1, 0] - ways[0][0, 0]
    assert gone > 1.0
    assert np.abs(ways[1] - ways[0]).max() < 1e-5 * gone


@pytest.mark.long
@pytest.mark.parametrize("step", [2e-3, 4e-3, 8e-3])
def test_free_axes_hold_at_long_steps(step):
    """Free axes are stable at long steps: the origin follows the wheels, and no error grows."""
    given = (f"run.step={step}", f"track.step={step}", f"run.stop={200 * step}", "drive.ramp_time=0.5")
    settings = (QUICK[1], *given, "track.link_outputs=false")
    cable, rigid = (InProcess(load("turn", kind, settings)).run(200 * step) for kind in ("flexible", "rigid"))
    assert cable["chassis"]["yaw"] == pytest.approx(rigid["chassis"]["yaw"], abs=0.01)
    assert cable["left_track"]["tension.max"] < 6e4


def leaning(kind, *settings):
    """Roll, vertical force, rims' longitudinal moment of a vehicle on a left track and bare wheels."""
    vehicle = InProcess(load("settle", kind, ('tracks=["left"]', "run.step=1 ms", "track.step=1 ms", *settings)))
    track = vehicle.run(1.2)["left_track"]
    held = sum(track[f"road_wheel[{i}].torque.x"] for i in range(1, 6))
    return np.array([vehicle["chassis"]["roll"], track["ground.force.z"], held])


@pytest.mark.long
def test_a_vehicle_leans_on_cables_as_on_rigid_links():
    """A vehicle on one track leans on cables as on rigid links; fixed axes would tip the rims."""
    rigid, cable, fixed = leaning("rigid"), leaning("flexible"), leaning("flexible", "track.axes=fixed")
    assert 0.015 < rigid[0] < 0.025
    np.testing.assert_allclose(cable, rigid, rtol=0.01)
    assert abs(fixed[0] / rigid[0] - 1.0) > 0.01
    assert fixed[2] / rigid[2] < 0.5


# --- scenes ---


@pytest.mark.parametrize(
    ("scene", "settings", "motors"),
    [
        ("turn", (), {"SprocketDrive"}),
        ("serpentine", (), {"SprocketDrive", "Driver"}),
        ("serpentine", ("driver=false", "drive.speed=3"), {"SprocketDrive"}),
        ("differential", (), {"SteeringDifferential"}),
        ("differential", ("drive.steering=false",), {"SprocketDrive"}),
    ],
)
def test_a_scene_has_the_parts_that_it_asks_for(scene, settings, motors):
    asked = load(scene, "rigid", settings)
    parts = assemble(placed(asked)).parts
    assert {part.kind for part in parts} == {"TrackRigid", "Chassis", *motors}
    assert asked.turns == (not settings)
    assert any("demanded" in part.config.get("drive", {}) for part in parts) == ("Driver" in motors)
    assert type(asked).model_validate(asked.resolved()).resolved() == asked.resolved()


def test_drives_of_sides():
    """Equal sides are one drive; a side says what differs; without a mode the sides have that of the default."""
    one, turn_scene = load("straight", "rigid"), load("turn", "rigid")
    two = load("straight", "rigid", [*speeds(20, 20), "drive.speed=7"])
    assert (two.resolved(), two.drive.steers) == (one.resolved(), False)
    said = scene_difference(one.resolved(), turn_scene.resolved())
    assert said.startswith("drive says brake, demand, interpolation, mode,")
    assert said.endswith("and left, right")
    drive = load("straight", "rigid", ["drive.left.speed=8", "drive.stop=7"]).drive
    assert [(of.speed, of.ramp_time, of.stop) for of in map(drive.of_side, ("left", "right"))] == [
        (8.0, 4.0, 7.0), (20.0, 4.0, 7.0),
    ]  # fmt: skip
    drive = load("straight", "rigid", ["drive={left={speed=3}, right={speed=4}}"]).drive
    assert [(each.mode, each.speed) for each in drive.motors().values()] == [("speed", 3.0), ("speed", 4.0)]
    braked = load("straight", "rigid", ["drive={brake=5, left={mode='torque'}, right={mode='controller'}}"]).drive
    assert [(each.mode, each.brake) for each in braked.motors().values()] == [("torque", 5.0), ("controller", 5.0)]


def test_points_are_parameters_of_the_parts():
    given = "driver={points=[[0, 0], [5, 0], [9, 2]], speed='2 m/s'}"
    for scene, setting, part, name, text in (
        ("serpentine", given, "driver", "path.points", "0.0 0.0; 5.0 0.0; 9.0 2.0"),
        ("turn", "drive.left.speed_points=[[0, 0], [2, 8]]", "left_drive", "speed.points", "0.0 0.0; 2.0 8.0"),
    ):
        parts = {each.name: each for each in assemble(placed(load(scene, "rigid", [setting]))).parts}
        assert parts[part].parameters[name] == text
    held = load("serpentine", "rigid", ["driver.arcs=false", "driver.heading=1"])
    assert (held.driver.arcs, held.driver.heading) == (None, 1.0)


def test_cables_turn_where_the_vehicle_does(tmp_path):
    """In `show`, and in the replay of a run with rigid links."""
    assert load("differential", "flexible").track.axes == "free"
    scene = load("turn", "flexible")
    assert contact_pairs(scene, assemble(scene).parts[0])[1:] == [
        "rims: 6 wheels x 64 links, 4 points where they touch",
        "guides: 6 wheels x 64 links",
        "ground: 64 links, 4 points each, up to 88 mm apart along it and 189 mm across",
    ]
    path = tmp_path / "turn.mcap"
    assert simulate(load("turn", "rigid", ("run.stop=0.02 s",)), path)["status"] == "ok"
    with replay_model.open_replay(path, "left_track", "flexible") as again:
        assert again.component.unit("speed") == "m/s"
        assert again.model.parameters["axes"] == "free"
    with Log(path) as log, pytest.raises(Missing):
        turning.regenerated_power(RunData(log), "", Window(0.0, 0.01))
