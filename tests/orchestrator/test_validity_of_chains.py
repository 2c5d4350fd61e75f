"""Validity of chains on their wheels: tooth jumps, penetration, travel of the idler, steps that are too long."""

import re

import numpy as np
import pytest
from ledger_logs import EVERY, LINKS, SPROCKET, TEETH, entries_of, running, vehicle
from made_logs import of_columns

from orchestrator.execution.simulate import simulate
from orchestrator.log.reader import Log
from orchestrator.results.analyses import validity
from orchestrator.results.run_data import RunData
from orchestrator.results.validity import chain_checks
from orchestrator.results.validity.chain_checks import deepest, depths
from orchestrator.results.validity.piece import LENGTH
from orchestrator.results.validity.sprocket_checks import jumps
from orchestrator.scene.scene import load, scene_names
from orchestrator.vocabulary import limits


@pytest.mark.parametrize("turn", [0.0, 2.5], ids=["in front", "behind"])
def test_pins_that_pass_regularly_do_not_jump(tmp_path, turn):
    """Pins that pass regularly are no jump, though they climb 0.4 pitch up their flanks; nor do any far from it."""
    turned = np.concatenate([np.linspace(0.0, 12.6, 1500), np.linspace(12.6, 6.3, 800)])
    climbing = 0.4 * np.sin(np.linspace(0.0, 40.0, len(turned)))
    assert entries_of(running(tmp_path / "log.mcap", turned, climbing, turn)) == ()
    assert [*jumps(np.zeros((5, 4)), np.full((5, 4), 1.0), 0.5)] == []


@pytest.mark.parametrize("way", [1, -1])
@pytest.mark.parametrize("turn", [0.0, 2.5], ids=["in front", "behind"])
def test_a_jump_is_found_where_and_when_it_is(tmp_path, turn, way):
    """A jump is found with place and time: by a tooth at 7 s, back by two at 14 s.

    The chain is in two pieces, and pin 1 follows pin 64.
    """
    turned = np.linspace(0.0, 90.0, 3600)
    t = EVERY * np.arange(len(turned))
    off = way * (1.0 * (t >= 7.0 - 1e-9) - 2.0 * (t >= 14.0 - 1e-9))
    assert t[-1] > LENGTH
    (entry,) = entries_of(running(tmp_path / "log.mcap", turned, off, turn))
    assert (entry.what, entry.component, entry.severity) == ("tooth_jump", "left_track", "failure")
    assert entry.time == pytest.approx(7.0)
    at = round(7.0 / EVERY)
    pin = int(entry.place.removeprefix("sprocket, pin ")) - 1
    place = pin * 2.0 * np.pi / TEETH + turned[at] + off[at] * 2.0 * np.pi / TEETH
    assert abs((place + np.pi) % (LINKS * 2.0 * np.pi / TEETH) - np.pi) < 0.5 * np.pi, "the pin is not on the wrap"
    assert entry.value == 2.0


@pytest.mark.parametrize(("gaps", "found"), [(1, []), (2, [1.0])])
def test_a_tooth_is_half_a_pitch_where_pins_lie_in_every_second_gap(tmp_path, gaps, found):
    """Half a pitch is the next gap of a sprocket with as many teeth again; a chain cannot sit there without these."""
    turned = np.linspace(0.0, 45.0, 1800)
    off = 0.5 * (EVERY * np.arange(len(turned)) >= 7.0 - 1e-9)
    entries = entries_of(running(tmp_path / "log.mcap", turned, off, gaps=gaps))
    assert [entry.value for entry in entries if gaps > 1] == found
    assert entries_of(running(tmp_path / "still.mcap", turned, 0.0 * off, gaps=gaps)) == ()


def test_a_tooth_is_two_pitches_where_every_second_pin_has_a_lug(tmp_path):
    """The jump is by one tooth, of a pin with a lug: of an odd number; without lugs it would be by two."""
    turned = np.linspace(0.0, 45.0, 1800)
    off = 2.0 * (EVERY * np.arange(len(turned)) >= 7.0 - 1e-9)
    for lugs, teeth in (2, 1.0), (1, 2.0):
        (entry,) = entries_of(running(tmp_path / f"{lugs}.mcap", turned, off, lugs=lugs))
        assert (entry.what, entry.time, entry.value) == ("tooth_jump", pytest.approx(7.0), teeth)
        assert int(entry.place.removeprefix("sprocket, pin ")) % lugs == 1 % lugs
        assert entries_of(running(tmp_path / f"still {lugs}.mcap", turned, 0.0 * off, lugs=lugs)) == ()


@pytest.mark.parametrize("gaps", [1, 2])
@pytest.mark.parametrize(("pitches", "jumps_"), [(1.1, True), (0.6, False)])
def test_travel_shows_a_jump_where_no_pins_were_recorded(tmp_path, pitches, jumps_, gaps):
    t = EVERY * np.arange(400)
    pitch, turned = 0.1524, 3.0 * t
    travel = -pitch * (turned * TEETH / (2.0 * np.pi) + pitches * np.clip((t - 1.0) / 0.05, 0.0, 1.0))
    columns = {
        "left_track.travel": travel, "left_drive.angle": turned, "left_track.sprocket.force.x": t,
        "left_drive.sprocket.position.x": t,
    }  # fmt: skip
    table = vehicle()
    table["sprocket"] |= {"teeth": gaps * TEETH, "gaps_per_pin": gaps}
    scene = {"assembly": "rig", "vehicle": table, "run": {"step": EVERY}}
    entries = entries_of(of_columns(tmp_path / "log.mcap", columns, t, scene, [SPROCKET]))
    assert [(e.what, e.place) for e in entries] == [("tooth_jump", "sprocket")] * jumps_
    assert all(1.0 < entry.time <= 1.05 for entry in entries)
    assert all(entry.value == pytest.approx(gaps * pitches) for entry in entries)


# limits at altered logs


@pytest.fixture(scope="module")
def settled(tmp_path_factory):
    path = tmp_path_factory.mktemp("validity") / "settled.mcap"
    result = simulate(load("settle", "rigid", ("run.stop=0.25 s", "run.links=5", "symmetric=true")), path)
    assert (result["message"], result["validity"]) == ("", [])
    with Log(path) as log:
        assert validity.of(RunData(log)).unchecked == {}, "a kind cannot look at an ordinary run"
    return path


@pytest.mark.long
@pytest.mark.parametrize(("limit", "severity"), [(limits.LINK_WARNING, "warning"), (limits.LINK_FAILURE, "failure")])
def test_penetration_has_limits(settled, scaled, limit, severity):
    face = vehicle()["track"]["face"]
    with Log(settled) as log:
        deepest = log.signal("left_track.penetration.max")[1].max()
    for off, passes in ((1.02, True), (0.98, False)):
        with Log(settled) as log:
            scaled(log, "/left_track/out", "penetration.max", off * limit * face / deepest)
            entries = [e for e in validity.of(RunData(log)).entries if e.severity == severity]
        assert [e.what for e in entries] == ["penetration"] * passes
        if passes:
            assert entries[0].value == pytest.approx(off * limit * face)
            assert entries[0].limit == pytest.approx(limit * face)
        with Log(settled) as log:
            scaled(log, "/left_track/out", "penetration.max", deepest / (off * limit * face))


def test_a_rim_is_named_by_the_geometry_of_the_pins(settled):
    with Log(settled) as log:
        run = RunData(log)
        t, depth = run.signal("left_track.penetration.max")
        at = float(t[depth.argmax()])
        maxima = depths(run, "left_track", at)
        assert max(maxima.values()) == pytest.approx(depth.max(), rel=0.15), "the points are near the deepest place"
        assert deepest(run, "left_track", at, float(depth.max())).startswith("road_wheel[")
        assert deepest(run, "left_track", at, 2.0 * float(depth.max())) == "sprocket"
        run.scene["ground"]["soil"] = {"n": 1.0}  # links in soil penetrate nothing
        assert maxima.keys() - depths(run, "left_track", at).keys() == {"ground"}


@pytest.mark.parametrize(("share", "aside"), [(0.7, 0.45), (0.1, -0.2)])
def test_ground_that_rises_within_a_link_is_named(settled, share, aside):
    """A rock 20 mm high and 16 mm wide, between pins and off the middle; the sprocket is not known by exclusion."""
    with Log(settled) as log:
        run = RunData(log)
        at = float(run.signal("left_track.penetration.max")[0][-1])
        pins = np.stack([run.vector_at("left_track", "links", f"joint[{k}].position", at) for k in range(1, 65)])
        after = np.roll(pins, -1, axis=0)
        low = int((pins + after)[:, 2].argmin())
        place = pins[low] + share * (after - pins)[low]
        place[1] += aside * run.scene["vehicle"]["track"]["width"]
        x, y = (np.arange(-25, 26) * 2e-3 + place[k] for k in (0, 1))
        rock = 0.02 * np.exp(-((x[:, None] - place[0]) ** 2 + (y - place[1]) ** 2) / (2.0 * 8e-3**2))
        rocks = {
            "heights": rock.tolist(),
            "corner": [x[0], y[0]],
            "spacing": [2e-3, 2e-3],
            "start": -9.0,
            "length": 0.01,
        }
        level, uneven = depths(run, "left_track", at)["ground"], RunData(log)
        uneven.scene["ground"] |= {"heightmap": rocks, "refinement": [16, 16]}
        expected = 0.02 + level + pins[:, 2].min() - place[2]
        assert depths(uneven, "left_track", at)["ground"] == pytest.approx(expected, rel=0.05)
        assert deepest(uneven, "left_track", at, 0.02) == "ground"
        assert deepest(uneven, "left_track", at, 0.05) == "sprocket, or ground between the points of a link"


def test_an_idler_beyond_its_travel(settled, scaled):
    with Log(settled) as log:
        x = log.signal("chassis.left.idler.position.x")[1][0]
        for moved, passes in ((0.09, False), (0.11, True)):
            scaled(log, "/chassis/out", "left.idler.position.x", 1.0 + moved / x)
            entries = validity.of(RunData(log)).entries
            assert [(e.what, e.place) for e in entries] == [("idler_travel", "left.idler")] * passes
            scaled(log, "/chassis/out", "left.idler.position.x", 1.0 / (1.0 + moved / x))


SPRING = {"stiffness": 1e6, "damping": 1e4, "preload": 0.0, "travel": 0.03}
REAR = {**vehicle()["idler"], "x": -3.9, "z": 0.35, "radius": 0.2, "mass": 200.0, "tensioner": SPRING}


@pytest.mark.parametrize(("moved", "angle", "passes"), [
    (0.029, 0.0, False), (0.031, 0.0, True), (0.031, 0.5, True), (0.029, 0.5, False),
])  # fmt: skip
def test_a_further_wheel_beyond_its_own_travel(tmp_path, moved, angle, passes):
    """The right wheel slides by ``moved`` from its own place; the idler by more, within its own travel."""
    t, spring = 1e-2 * np.arange(300), {**SPRING, "angle": angle}
    table = {**vehicle(), "wheel": {"rear": {**REAR, "tensioner": spring}, "fixed": {**REAR, "tensioner": None}}}
    table["right"] = {"wheel": {"rear": {"x": -3.8}}}
    way = np.linspace(0.0, moved, len(t))
    places = {"right.rear": -3.8 + way * np.cos(angle), "left.rear": -3.9 + 0.0 * t, "left.fixed": 9.0 + 0.0 * t}
    places["right.idler"] = table["idler"]["x"] - 0.09 + 0.0 * t
    columns = {f"chassis.{name}.position.x": x - table["chassis"]["centre"][0] for name, x in places.items()}
    columns |= {f"chassis.{name}.position.{axis}": 0.0 * t for name in places for axis in "yz"}
    columns |= {f"chassis.chassis.position.{axis}": 2.0 * (axis == "z") + 0.0 * t for axis in "xyz"}
    columns |= {f"chassis.chassis.orientation.{part}": (part == "w") + 0.0 * t for part in "wxyz"}
    scene = {"assembly": "vehicle", "vehicle": table, "ground": {}, "run": {"step": 1e-3}}
    scene["start"] = {"position": [0.0, 0.0, 2.0], "heading": 0.0}
    entries = entries_of(of_columns(tmp_path / "log.mcap", columns, t, scene))
    assert [(each.what, each.place) for each in entries] == [("idler_travel", "right.rear")] * passes
    if passes:
        assert (entries[0].value, entries[0].limit) == (pytest.approx(moved), 0.03)


def test_the_radius_of_each_wheel_counts_in_its_depth(settled):
    """A list of equal radii is one radius; that of the fourth wheel, 3 mm larger, is 3 mm deeper."""
    with Log(settled) as log:
        run = RunData(log)
        road, alike = run.scene["vehicle"]["road_wheel"], depths(run, "left_track", 0.5)
        for more in (0.0, 3e-3):
            radius = [road["radius"] + more * (k == 3) for k in range(5)]
            run.scene["vehicle"]["road_wheel"] = {**road, "radius": radius}
            expected = {name: depth + more * (name == "road_wheel[4]") for name, depth in alike.items()}
            assert depths(run, "left_track", 0.5) == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize(("z", "places"), [(-0.258, [-4.6, -3.322]), (-0.2, [-0.655, -1.322])])
def test_links_that_push_lie_between_all_wheels_on_the_ground(tmp_path, z, places):
    """The widest gap is that to a second idler on the ground, 1.278 m; without it (twin) that of road wheels."""
    t = np.arange(3) * 1e-2
    table = {**vehicle(), "wheel": {"rear": {**REAR, "x": -4.6, "z": z, "radius": 0.262}}}
    path = of_columns(tmp_path / "log.mcap", {"left_track.travel": t}, t, {"assembly": "vehicle", "vehicle": table})
    with Log(path) as log:
        limit = chain_checks.thrust(RunData(log))
    assert limit == pytest.approx(18.02 * 9.81 / 0.1524 * np.ptp(places) ** 2 / 0.08, rel=1e-6)


# known before the run


@pytest.mark.parametrize(
    ("share", "slides", "place"), [(2.0, True, "idler"), (0.9, True, "rear"), (0.9, False, "idler")]
)
def test_a_step_that_is_long_for_the_lightest_wheel_that_slides(share, slides, place):
    """A further wheel with a share of the idler's mass; on a fixed axle it moves with the hull."""
    scene = load("settle", "rigid", ["run.step=8 ms", "track.step=1 ms", "run.stop=1 s"]).resolved()
    table, idler = scene["vehicle"], scene["vehicle"]["idler"]["mass"]
    rear = {**REAR, "mass": share * idler, "tensioner": SPRING if slides else None}
    (found,) = chain_checks.contact_steps_of_scene({**scene, "vehicle": {**table, "wheel": {"rear": rear}}})
    wrapped = 0.5 * TEETH * table["contact"]["wheel"]["stiffness"]
    lightest = idler * (share if place == "rear" else 1.0)
    assert (found.place, found.value) == (place, pytest.approx(np.sqrt(wrapped / lightest) * 8e-3))
    advised = float(re.search(r"; (\S+) times run.step", found.sentence)[1])
    for factor, fits in ((1.0, True), (1.03, False)):
        shorter = {"run": {"step": factor * advised * 8e-3}, "vehicle": {**table, "wheel": {"rear": rear}}}
        assert ([*chain_checks.contact_steps_of_scene({**scene, **shorter})] == []) == fits


@pytest.mark.parametrize(("scene", "options"), [
    ({"run": {"step": 1e-3}, "track": {"integrator": None}}, "; half of them: --step 0.5ms"),
    ({"run": {"step": 2e-3}, "track": {"integrator": None}}, "; half of them: --step 1ms --set track.step=0.5ms"),
    ({"run": {"step": 1e-3}, "track": {"step": 0.25e-3, "integrator": "hht"}},
     "; half of them: --step 0.5ms --set track.step=0.125ms"),
    ({"run": {"step": 1e-3}, "track": {"step": 2e-6, "integrator": "runge_kutta"}}, "; half of them: --step 0.5ms"),
    ({"run": {"step": 1e-3, "variable": {"tolerance": 0.5}}}, ""),
    ({"run": "straight"}, ""),
])  # fmt: skip
def test_an_open_balance_asks_for_half_of_the_steps(scene, options):
    run = RunData.__new__(RunData)
    run.scene = scene
    assert chain_checks.half_steps(run) == options


@pytest.mark.parametrize("name", scene_names())
def test_no_scene_of_the_gallery_has_steps_that_are_too_long(name):
    assert [*chain_checks.contact_steps_of_scene(load(name).resolved())] == []


@pytest.mark.parametrize(("ms", "long"), [(2.0, False), (2.2, True)])
def test_a_step_that_is_long_for_a_link_between_wheel_and_ground(ms, long):
    scene = load("settle", "rigid", [f"run.step={ms} ms", f"track.step={ms} ms", f"run.stop={100 * ms} ms"])
    entries = [*chain_checks.contact_steps_of_scene(scene.resolved())]
    assert [entry.place for entry in entries] == ["link"] * long
    if long:
        assert entries[0].value == pytest.approx(np.sqrt(4e6 / 18.02) * ms * 1e-3)
