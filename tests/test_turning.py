"""Steering: independent theory, mirror images, turned starts, energy, on rigid links and beams.

The general theory brackets a run within these bands: it has no links, whose pads run about 1.1 % faster than the pitch
circle, and no strand tensions, which move load between the wheels.
"""

from importlib import resources

import numpy as np
import pytest
from skid_steering import Vehicle, turn
from vehicle_in_process import InProcess

from fmus.track.choices import TRACKS
from fmus.vehicles.tables import BadInput
from orchestrator.cli.inventory import contact_pairs
from orchestrator.execution import replay_model
from orchestrator.execution.simulate import simulate
from orchestrator.log.reader import Log
from orchestrator.results import turning
from orchestrator.results.run_data import RunData, Window
from orchestrator.scene.assembly import assemble
from orchestrator.scene.placing import placed
from orchestrator.scene.same_scene import scene_difference
from orchestrator.scene.scene import load

PADS = 1.0114  # speed of a track over that of the pitch circle, measured driving straight
QUICK = ("run.stop=1.5 s", "drive.ramp_start=0.2 s", "drive.ramp_time=0.8 s")


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
                means = {
                    name: measure(run, "", window)
                    for name, measure in vars(turning).items()
                    if name in ("yaw_rate", "turn_radius", "lateral_speed", "rotation_centre", "steering_moment")
                }
                for side in ("left", "right"):
                    for name in ("track_slip", "propulsion", "drive_power"):
                        means[f"{name}_{side}"] = getattr(turning, name)(run, side, window)
                    means[f"torque_{side}"] = run.mean(f"{side}_drive.torque", window)
                    means[f"load_{side}"] = run.mean(f"{side}_track.ground.force.z", window)
                means["ahead"] = np.sqrt((means["turn_radius"] * means["yaw_rate"]) ** 2 - means["lateral_speed"] ** 2)
                means["ledger"] = result["energy"]["residual_relative"]
            made[key] = means, turn(Vehicle(), (left, right))
        return made[key]

    return once


def outside(means, theory):
    """Quantities outside their bands, with value and band."""
    vehicle = Vehicle()
    faster = turn(vehicle._replace(radius=PADS * vehicle.radius), SPEEDS)
    wanted = {
        "yaw_rate": (theory.rate, 0.04 * theory.rate),
        "turn_radius": (theory.radius, 0.04 * theory.radius),
        "ahead": (1.0055 * theory.ahead, 0.0105 * theory.ahead),  # pads run faster than the pitch circle
        "load": (vehicle.mass * 9.81, 2e-3 * vehicle.mass * 9.81),
        "steering_moment": (theory.moment(vehicle), 0.04 * theory.moment(vehicle)),
        "lateral_speed": (theory.left, 0.12 * abs(theory.left)),
        "rotation_centre": (-theory.left / theory.rate, 0.12 * abs(theory.left / theory.rate)),
        "load_left": (0.5 * vehicle.mass * 9.81 - 1.15 * theory.transfer, 0.15 * theory.transfer + 300.0),
        "load_right": (0.5 * vehicle.mass * 9.81 + 1.15 * theory.transfer, 0.15 * theory.transfer + 300.0),
    }
    means["load"] = means["load_left"] + means["load_right"]
    for k, side in enumerate(("left", "right")):
        wanted[f"propulsion_{side}"] = theory.force[k], max(0.04 * abs(theory.force[k]), 500.0)
        sign = (1.0, -1.0)[k]
        ground = means["ahead"] - sign * vehicle.half_width * means["yaw_rate"]
        slip = PADS * vehicle.radius * SPEEDS[k] - ground
        wanted[f"track_slip_{side}"] = slip, 0.06 * abs(slip)
        wanted[f"slip_{side}"] = faster.slip[k], 0.08 * abs(faster.slip[k])
        means[f"slip_{side}"] = slip
    return {name: (means[name], *band) for name, band in wanted.items() if not abs(means[name] - band[0]) <= band[1]}


SPEEDS = (8.0, 12.0)
STEADY = Window(4.0, 6.0)


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
    window = Window(4.0, 6.0)
    rates = {
        "rigid": turned("rigid", *speeds_of, window)[0]["yaw_rate"],
        "cable": turned("flexible", *speeds_of, window)[0]["yaw_rate"],
        "beam": turned("flexible", *speeds_of, window, "track.element=beam")[0]["yaw_rate"],
    }
    for kind, rate in rates.items():
        assert rate == pytest.approx(rates["rigid"], rel=3e-3), kind


@pytest.mark.study
@pytest.mark.parametrize("kind", TRACKS)
def test_a_turn_with_little_slip(turned, kind):
    """The theory is coarse in a turn with little slip (19 and 21 rad/s, below 3 %)."""
    means, theory = turned(kind, 19.0, 21.0, Window(4.0, 6.0))
    assert -0.10 < means["yaw_rate"] / theory.rate - 1.0 < 0.03


@pytest.mark.long
def test_a_turn_begins_as_that_of_beams():
    """Cables begin a turn as beams do: 2 % of the yaw at 0.9 s, within the guides' clearance."""
    settings = ("run.stop=0.9 s", *speeds(8, 12))
    yaw = {kind: path("flexible", (*settings, f"track.element={kind}"), 900)[-1, 3] for kind in ("cable", "beam")}
    assert yaw["cable"] == pytest.approx(yaw["beam"], rel=0.02)


def path(kind, settings, steps=1500):
    """Positions of the hull (steps, 3) and its heading."""
    vehicle = InProcess(load("turn", kind, (*QUICK, "track.link_outputs=false", *settings)))
    places = []
    for _ in range(steps):
        vehicle.step()
        chassis = vehicle["chassis"]
        places.append([chassis[f"chassis.position.{axis}"] for axis in "xyz"] + [chassis["yaw"]])
    return np.array(places)


@pytest.mark.long
@pytest.mark.parametrize("kind", TRACKS)
def test_swapped_sides_mirror_the_path_and_a_heading_turns_it(kind):
    there, back = path(kind, speeds(8, 12)), path(kind, speeds(12, 8))
    assert there[-1, 3] > 0.03
    np.testing.assert_allclose(back * [1.0, -1.0, 1.0, -1.0], there, atol=1e-9)
    heading = 0.7
    turned_by = path(kind, (*speeds(8, 12), f"start.heading={heading}"))
    c, s = np.cos(heading), np.sin(heading)
    x, y = turned_by[:, 0] * c + turned_by[:, 1] * s, turned_by[:, 1] * c - turned_by[:, 0] * s
    np.testing.assert_allclose(np.column_stack([x, y, turned_by[:, 2]]), there[:, :3], atol=1e-9)
    np.testing.assert_allclose(turned_by[:, 3] - heading, there[:, 3], atol=1e-9)


@pytest.mark.long
def test_free_axes_go_straight_as_fixed_ones_do():
    """Free axes drive straight as fixed ones do, to 1e-5; only roll and yaw by rounding may differ."""
    settings = ("drive.left.speed=8", "drive.right.speed=8", "track.element=cable")
    ways = [path("flexible", (*settings, f"track.axes={axes}"))[:, :3] for axes in ("fixed", "free")]
    gone = ways[0][-1, 0] - ways[0][0, 0]
    assert gone > 1.0
    assert np.abs(ways[1] - ways[0]).max() < 1e-5 * gone


def test_sides_that_are_alike_are_one_drive():
    one = load("straight", "rigid")
    two = load("straight", "rigid", ["drive.left.speed=20", "drive.right.speed=20", "drive.speed=7"])
    assert two.resolved() == one.resolved()
    assert not two.drive.steers


def test_one_drive_and_two_are_named_as_what_they_are():
    one, two = (load(name, "rigid").resolved() for name in ("straight", "turn"))
    assert scene_difference(one, two).startswith("drive says brake, demand, mode,")
    assert scene_difference(one, two).endswith("and left, right")


def test_a_side_says_what_differs():
    drive = load("straight", "rigid", ["drive.left.speed=8", "drive.stop=7"]).drive
    assert (drive.of_side("left").speed, drive.of_side("right").speed) == (8.0, 20.0)
    assert drive.of_side("left").ramp_time == drive.of_side("right").ramp_time == 4.0
    assert drive.of_side("left").stop == drive.of_side("right").stop == 7.0
    again = load("turn", "rigid")
    assert type(again).model_validate(again.resolved()).resolved() == again.resolved()


def test_sides_need_no_common_mode():
    """Without any mode the sides have that of the default; a key that this mode would ignore is refused below."""
    drive = load("straight", "rigid", ["drive={left={speed=3}, right={speed=4}}"]).drive
    assert [(each.mode, each.speed) for each in drive.motors().values()] == [("speed", 3.0), ("speed", 4.0)]
    braked = load("straight", "rigid", ["drive={brake=5, left={mode='torque'}, right={mode='controller'}}"]).drive
    assert [(each.mode, each.brake) for each in braked.motors().values()] == [("torque", 5.0), ("controller", 5.0)]


@pytest.mark.parametrize(
    ("settings", "sentence"),
    [
        (("drive.left.speed=8", "symmetric=true"), "symmetric = true needs the same drive on both sides"),
        (("drive.left.speed=8", 'tracks=["left"]'), "drive.left and drive.right differ, but tracks has no 'right'"),
        (("drive.left.sped=8",), "unknown key 'drive.left.sped': did you mean 'drive.left.speed'?"),
        (("drive.left.speed=fast",), "drive.left.speed = 'fast'"),
        (("drive.left.speed=8", "track.axes=fixed"), "track.axes = 'fixed' keeps cables in their plane"),
        (("drive.left.speed=8", "drive.middle.speed=8"), "unknown key 'drive.middle'"),
        (("drive={left={speed=3}, right={torque=5}}",), "drive.right: torque = 5.0 needs mode = 'torque', not 'speed'"),
        (("drive={left={mode='speed'}, rigth={mode='speed'}}",), "unknown key 'drive.rigth': did you mean"),
        (("track.axes=free", "track.element=beam"), "axes = 'free' needs element = 'cable'"),
        (("track.axes=free", "symmetric=true", "planar=true"), "planar = true needs track.axes = 'fixed'"),
    ],
)
def test_sides_that_cannot_be_are_a_sentence(settings, sentence):
    with pytest.raises(BadInput) as refused:
        load("straight", "flexible", settings)
    assert sentence in str(refused.value)


@pytest.mark.long
@pytest.mark.parametrize("step", [2e-3, 4e-3, 8e-3])
def test_free_axes_hold_at_long_steps(step):
    """Free axes are stable at long steps: the origin follows the wheels, and no error grows."""
    given = (f"run.step={step}", f"track.step={step}", f"run.stop={200 * step}", "drive.ramp_time=0.5")
    vehicle = InProcess(load("turn", "flexible", (*QUICK[1:2], *given, "track.link_outputs=false"))).run(200 * step)
    yaw = InProcess(load("turn", "rigid", (*QUICK[1:2], *given, "track.link_outputs=false"))).run(200 * step)
    assert vehicle["chassis"]["yaw"] == pytest.approx(yaw["chassis"]["yaw"], abs=0.01)
    assert vehicle["left_track"]["tension.max"] < 6e4


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


def test_show_counts_what_turning_cables_touch():
    scene = load("turn", "flexible")
    lines = contact_pairs(scene, assemble(scene).parts[0])
    assert lines[1:] == [
        "rims: 6 wheels x 64 links, 4 points where they touch",
        "guides: 6 wheels x 64 links",
        "ground: 64 links, 4 points each",
    ]


def test_a_replay_with_cables_lets_them_turn(tmp_path):
    path = tmp_path / "turn.mcap"
    assert simulate(load("turn", "rigid", ("run.stop=0.02 s",)), path)["status"] == "ok"
    with replay_model.open_replay(path, "left_track", "flexible") as again:
        assert again.component.unit("speed") == "m/s"
        assert again.model.parameters["axes"] == "free"


def test_free_axes_without_wheels_are_a_sentence():
    with pytest.raises(BadInput, match=r"hanging_chain\.toml: track.axes = 'free' needs wheels"):
        load("hanging_chain", "flexible", ["track.axes=free"])


def test_points_of_a_file_are_in_the_scene(tmp_path, monkeypatch):
    """Points of a file beside the scene or in the current folder are copied into the resolved scene."""
    (tmp_path / "left.csv").write_text("time,speed\n0,0\n2,8\n")
    base = (resources.files("orchestrator") / "gallery" / "turn.toml").read_text()
    (tmp_path / "mine.toml").write_text(base.replace('speed = "8 rad/s"', 'speed_points = "left.csv"'))
    scene = load(str(tmp_path / "mine.toml"), "rigid")
    assert scene.drive.left.speed_points == ((0.0, 0.0), (2.0, 8.0))
    part = next(part for part in assemble(placed(scene)).parts if part.name == "left_drive")
    assert part.parameters["speed.points"] == "0.0 0.0; 2.0 8.0"
    monkeypatch.chdir(tmp_path)
    assert (
        load("turn", "rigid", ["drive.left.speed_points=left.csv"]).drive.left.speed_points
        == scene.drive.left.speed_points
    )
    assert type(scene).model_validate(scene.resolved()).drive == scene.drive
    (tmp_path / "left.csv").write_text("0,0\n2,fast\n")
    with pytest.raises(BadInput, match=r"left.csv', line 2: must be two numbers"):
        load("turn", "rigid", ["drive.left.speed_points=left.csv"])
    with pytest.raises(BadInput, match=r"drive.right.speed_points = 'none.csv': cannot be read"):
        load("turn", "rigid", ["drive.right.speed_points=none.csv"])
    for given, sentence in (
        ("speed_points=[[1, 2], [0, 3]]", "times that rise"),
        ("torque_points=[[0, 2]]", "torque_points = .* needs mode = 'torque', not 'speed'"),
    ):
        with pytest.raises(BadInput, match=sentence):
            load("turn", "rigid", [f"drive.left.{given}"])
