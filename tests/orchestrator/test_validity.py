"""The validity ledger: every kind of entry at its limit, from made-up records, altered logs and runs."""

import html
import inspect
import json

import numpy as np
import pytest
from mcap.reader import make_reader

from fmus.ground.soils import named
from fmus.start import ground_level
from fmus.vehicles.tables import BadInput
from orchestrator.execution import summary
from orchestrator.execution.simulate import simulate
from orchestrator.log.container_reader import LogUnreadable
from orchestrator.log.reader import Log
from orchestrator.log.recorder import Recorder
from orchestrator.results import run_data, vehicle_measures
from orchestrator.results.analyses import validity
from orchestrator.results.analyses.catalogue import analyse
from orchestrator.results.page import heading
from orchestrator.results.page.evaluation import RunSummary, attempt, evaluate
from orchestrator.results.run_data import EVER, Missing, RunData
from orchestrator.results.validity import chain_checks
from orchestrator.results.validity.exceedance import recorded_entries
from orchestrator.results.validity.piece import LENGTH
from orchestrator.results.validity.sprocket_checks import jumps
from orchestrator.scene.scene import load, scene_names
from orchestrator.scene.values import implausible_numbers
from orchestrator.vocabulary import limits

TEETH, LINKS = 10, 64
EVERY = 5e-3  # s, between records of pins


def vehicle():
    return load("straight").vehicle.model_dump(mode="json")


def write(path, columns, t, scene, connections=()):
    """Write a log of signals "instance.variable", also of links, at times (m,)."""
    topics: dict[str, list[tuple[str, str]]] = {}
    for name in columns:
        instance, _, variable = name.partition(".")
        part = "links" if variable.startswith("joint[") else "out"
        topics.setdefault(f"/{instance}/{part}", []).append((variable, "1"))
    names = dict.fromkeys(name.partition(".")[0] for name in columns)
    system = {"instances": [{"name": name} for name in names], "connections": list(connections)}
    files = {"scene.json": json.dumps(scene).encode(), "system.json": json.dumps(system).encode()}
    with Recorder(path, topics, files, {}) as recorder:
        for k, at in enumerate(t):
            for topic, variables in topics.items():
                instance = topic.split("/")[1]
                row = np.array([columns[f"{instance}.{name}"][k] for name, _ in variables], float)
                recorder.write(topic, k, float(at), float(t[1] - t[0]), row)
        recorder.close("ok", "", len(t))
    return path


def entries_of(path):
    with Log(path) as log:
        return validity.of(RunData(log)).entries


# tooth jumps

SPROCKET = {
    "source": "left_track", "outputs": ["sprocket.force.x", "sprocket.torque.x"],
    "target": "left_drive", "inputs": ["sprocket.force.x", "sprocket.torque.x"],
}  # fmt: skip


def running(path, turned, off, turn=0.0, middle=(1.0, 2.0, 3.0)):
    """Log of a sprocket that has ``turned`` (m,) rad and a chain ``off`` (m,) teeth from its gaps."""
    table = vehicle()
    step = 2.0 * np.pi / TEETH
    radius = table["track"]["pitch"] / (2.0 * np.sin(np.pi / TEETH))
    t = EVERY * np.arange(len(turned))
    place = np.arange(LINKS) * step + turned[:, None] + off[:, None] * step
    place = (place + 0.5 * LINKS * step) % (LINKS * step) - 0.5 * LINKS * step  # along the loop, 0 at the front
    wrapped = np.abs(place) < 0.5 * np.pi
    angle = np.clip(place, -0.5 * np.pi, 0.5 * np.pi)
    behind = np.where(wrapped, 0.0, (np.abs(place) - 0.5 * np.pi) * radius)
    x, z = radius * np.cos(angle) - behind, -radius * np.sin(angle)
    c, s = np.cos(turn), np.sin(turn)  # about +y
    travel = table["track"]["pitch"] * (turned / step + off)
    columns = {"left_drive.angle": turned, "left_track.travel": travel}
    columns |= {
        f"left_drive.sprocket.position.{axis}": np.full(len(t), at) for axis, at in zip("xyz", middle, strict=True)
    }
    for j in range(LINKS):
        pin = c * x[:, j] + s * z[:, j], np.zeros(len(t)), c * z[:, j] - s * x[:, j]
        columns |= {
            f"left_track.joint[{j + 1}].position.{a}": p + m for a, p, m in zip("xyz", pin, middle, strict=True)
        }
    columns["left_track.sprocket.force.x"] = t
    return write(path, columns, t, {"assembly": "rig", "vehicle": table, "run": {"step": EVERY}}, [SPROCKET])


@pytest.mark.parametrize("turn", [0.0, 2.5], ids=["in front", "behind"])
def test_pins_that_pass_regularly_do_not_jump(tmp_path, turn):
    """Pins that pass regularly are no jump, though they climb 0.4 pitch up their flanks."""
    turned = np.concatenate([np.linspace(0.0, 12.6, 1500), np.linspace(12.6, 6.3, 800)])
    climbing = 0.4 * np.sin(np.linspace(0.0, 40.0, len(turned)))
    assert entries_of(running(tmp_path / "log.mcap", turned, climbing, turn)) == ()


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


@pytest.mark.parametrize(("teeth", "jumps_"), [(1.1, True), (0.6, False)])
def test_travel_shows_a_jump_where_no_pins_were_recorded(tmp_path, teeth, jumps_):
    t = EVERY * np.arange(400)
    pitch, turned = 0.1524, 3.0 * t
    travel = -pitch * (turned * TEETH / (2.0 * np.pi) + teeth * np.clip((t - 1.0) / 0.05, 0.0, 1.0))
    columns = {
        "left_track.travel": travel, "left_drive.angle": turned, "left_track.sprocket.force.x": t,
        "left_drive.sprocket.position.x": t,
    }  # fmt: skip
    scene = {"assembly": "rig", "vehicle": vehicle(), "run": {"step": EVERY}}
    entries = entries_of(write(tmp_path / "log.mcap", columns, t, scene, [SPROCKET]))
    assert [(e.what, e.place) for e in entries] == [("tooth_jump", "sprocket")] * jumps_
    assert all(1.0 < entry.time <= 1.05 for entry in entries)


def test_a_chain_that_nobody_seats_jumps_nowhere():
    far = np.full((5, 4), 1.0)
    assert [*jumps(np.zeros((5, 4)), far, 0.5)] == []


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
    from orchestrator.results.validity.chain_checks import deepest, depths

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


def test_an_idler_beyond_its_travel(settled, scaled):
    with Log(settled) as log:
        x = log.signal("chassis.left.idler.position.x")[1][0]
        for moved, passes in ((0.09, False), (0.11, True)):
            scaled(log, "/chassis/out", "left.idler.position.x", 1.0 + moved / x)
            entries = validity.of(RunData(log)).entries
            assert [(e.what, e.place) for e in entries] == [("idler_travel", "left.idler")] * passes
            scaled(log, "/chassis/out", "left.idler.position.x", 1.0 / (1.0 + moved / x))


# limits at made-up records


def standing(tmp_path, drive=(), **changes):
    """Entries for a vehicle of one track at rest for 3 s; ``changes`` replace signals, ``drive``: its table."""
    t = 1e-2 * np.arange(301)
    still = np.zeros(len(t))
    columns = {
        "left_track.travel": still, "left_track.penetration.max": still, "left_track.tension.min": still + 1e4,
        "left_track.slip": still, "left_track.ground.force.x": still + 3e3, "left_track.ground.force.y": still,
        "left_track.ground.force.z": still + 2e4, "left_drive.speed": still, "left_drive.angle": still,
        "left_track.sprocket.force.x": still, "left_track.speed": still, "chassis.yaw": still,
        "chassis.chassis.angular_velocity.z": still, **{f"chassis.chassis.velocity.{axis}": still for axis in "xyz"},
    }  # fmt: skip
    columns |= {name.replace("__", "."): values for name, values in changes.items()}
    scene = {"assembly": "vehicle", "vehicle": vehicle(), "run": {"step": 1e-2, "variable": {"tolerance": 1e-3}}}
    scene["drive"] = dict(drive)
    return entries_of(write(tmp_path / "log.mcap", columns, t, scene, [SPROCKET]))


def test_a_vehicle_that_stands_passes_no_limit(tmp_path):
    assert standing(tmp_path) == ()


@pytest.mark.parametrize(
    ("slip", "share", "speed", "yaw", "creeps"),
    [
        (0.012, 0.5, 0.0, 0.0, True),
        (0.008, 0.5, 0.0, 0.0, False),  # too slow
        (0.02598, 0.28 / 0.3, 0.0, 0.0, True),  # on 28 % with a friction of 0.3, at the speed of friction's law
        (0.0999, 0.995, 0.0, 0.0, True),
        (0.0999, 1.005, 0.0, 0.0, False),  # friction does not hold it
        (0.06, 0.5, 0.0, 0.0, False),  # it really slides
        (0.012, 0.5, 0.2, 0.0, False),  # its sprocket turns
        (0.012, 0.5, 0.0, 0.05, False),  # it turns
    ],
)
@pytest.mark.parametrize("heading", [0.0, 0.5 * np.pi])
@pytest.mark.parametrize("sideways", [False, True])
def test_creep_is_sliding_where_friction_should_hold(tmp_path, slip, share, speed, yaw, creeps, heading, sideways):
    """In any heading, along the vehicle and across it."""
    whole, to = np.ones(301), heading + 0.5 * np.pi * sideways
    pull, ahead, across = share * 0.3 * 2e4 * whole, np.cos(to), np.sin(to)
    entries = standing(
        tmp_path,
        **{"chassis.yaw": heading * whole, "chassis.chassis.angular_velocity.z": yaw * whole},
        **{"left_track.ground.force.x": pull * ahead, "left_track.ground.force.y": pull * across},
        **{"chassis.chassis.velocity.x": -slip * ahead * whole, "chassis.chassis.velocity.y": -slip * across * whole},
        **{"left_track.slip": (0.0 if sideways else slip) * whole, "left_drive.speed": speed * whole},
    )
    assert [(e.what, round(e.value, 6)) for e in entries] == [("creep", slip)] * creeps


def test_a_vehicle_that_comes_to_a_stop_does_not_creep(tmp_path):
    """Friction at its limit slows it down: nothing pulls at it; without the slowing down something would."""
    t = 1e-2 * np.arange(301)
    slows = -0.015 + 0.005 * t
    push = {"left_track.ground.force.x": 0.005 / 9.81 * 2e4 * np.ones(301), "left_track.slip": -slows}
    assert standing(tmp_path, **push, **{"chassis.chassis.velocity.x": slows}) == ()
    pulled = push | {"left_track.ground.force.x": 0.5 * 0.3 * 2e4 * np.ones(301)}
    assert [e.what for e in standing(tmp_path, **pulled, **{"chassis.chassis.velocity.x": slows})] == ["creep"]


@pytest.mark.parametrize(
    ("drive", "turned", "warned"),
    [
        ({"brake": 2e4}, 0.018, True),  # a parking brake on 20 %
        ({"brake": 2e4}, -0.018, True),
        ({"brake": 2e4}, 0.0041, False),  # the chain runs at 1 mm/s for 0.004123 rad/s
        ({"brake": 2e4}, 0.0042, True),
        ({"brake": 2e4}, 0.12, False),  # it slips at its torque
        ({"brake": 2e4, "brake_speed": 0.01}, 0.018, False),
        ({"brake": 0.0}, 0.018, False),
        ({"brake": 0.0, "brake_points": [[0.0, 0.0], [1.0, 2e4]]}, 0.018, True),
        ({"brake": 0.0, "brake_points": [[0.0, 2e4], [1.9, 2e4], [2.0, 0.0]]}, 0.018, True),
        ({"brake": 0.0, "brake_points": [[0.0, 2e4], [0.9, 0.0]]}, 0.018, False),  # for less than a second
        ({"brake": 2e4, "right": {"brake": 2e4}, "left": {"brake": 0.0}}, 0.018, False),  # of the other side
        ({"brake": 0.0, "right": {"brake": 0.0}, "left": {"brake": 2e4}}, 0.018, True),
    ],
)
def test_a_brake_that_should_hold_turns(tmp_path, drive, turned, warned):
    entries = standing(tmp_path, drive, left_drive__speed=np.full(301, turned))
    radius = 10 * 0.1524 / (2.0 * np.pi)
    assert [(e.what, e.value) for e in entries] == [("brake", pytest.approx(abs(turned) * radius))] * warned


@pytest.mark.parametrize(
    ("chain", "pads", "yaw", "what", "value"),
    [
        (2.0, 1.04, 0.0, "spin", 0.52),
        (2.0, 0.96, 0.0, "", 0.0),
        (2.0, 1.04, 0.05, "", 0.0),  # it turns
        (2.0, 2.0, 0.0, "spin", 1.0),  # it does not move
        (0.1, 0.1, 0.0, "", 0.0),  # too slow to matter
        (0.0, 3.8, 0.0, "slide", 3.8),  # locked
        (0.0, 0.19, 0.0, "", 0.0),
        (2.0, -2.1, 0.0, "slide", 2.1),
        (2.0, -1.9, 0.0, "", 0.0),
        (21.0, 0.0, 0.0, "fast", 21.0),  # ten walking paces of the m113 are 20.46 m/s
        (20.0, 0.0, 0.0, "", 0.0),
        (20.0, -1.0, 0.0, "fast", 21.0),
        (21.0, 15.0, 0.0, "spin", 15.0 / 21.0),  # one warning
    ],
)
@pytest.mark.parametrize("way", [1.0, -1.0])
def test_tracks_that_spin_or_slide(tmp_path, chain, pads, yaw, what, value, way):
    """Either way, for longer than a second."""
    whole, short = np.ones(301), 1e-2 * np.arange(301) % 1.5 < 0.9
    changed = {
        "left_drive.speed": 9.0 * whole, "chassis.chassis.angular_velocity.z": yaw * whole,
        "left_track.travel": 0.0 * whole, "left_track.speed": way * chain * whole,
    }  # fmt: skip
    entries = standing(tmp_path, **changed, **{"left_track.slip": way * pads * whole})
    assert [(e.what, e.value) for e in entries] == [(what, pytest.approx(value))] * bool(what)
    if value == 0.52:
        assert standing(tmp_path, **changed, **{"left_track.slip": way * pads * short}) == ()


@pytest.mark.parametrize(("force", "time", "pushes"), [(7e3, 0.04, True), (6e3, 0.04, False), (7e3, 0.01, False)])
def test_links_that_push_longer_than_a_peak(tmp_path, force, time, pushes):
    """Links in compression longer than a peak are reported.

    The limit is 6.45 kN, by the arch of links between two wheels.
    """
    t = 1e-2 * np.arange(301)
    tension = np.where((t > 0.999) & (t < 0.999 + time), -force, 1e4)
    entries = standing(tmp_path, left_track__tension__min=tension)
    assert [e.what for e in entries] == ["compression"] * pushes
    if pushes:
        assert entries[0].limit == pytest.approx(18.02 * 9.81 / 0.1524 * 0.667**2 / 0.08, rel=1e-6)


@pytest.mark.parametrize(("time", "off"), [(0.3, True), (0.15, False)])
def test_a_track_that_leaves_the_ground(tmp_path, time, off):
    t = 1e-2 * np.arange(301)
    load_ = np.where((t > 0.999) & (t < 0.999 + time), 0.0, 2e4)
    entries = standing(tmp_path, left_track__ground__force__z=load_)
    assert [(e.what, e.component) for e in entries] == [("lift", "left_track")] * off


def sinking(tmp_path, ground, allow=(), force=None, until=3.0):
    """Entries for a hull of two corners that goes down at 0.1 m/s, from 0.1 m over the ground on, pitched about the
    first one; the rear one is 20 mm lower. ``force`` of the ground on it, by default that of a link's spring at the
    rear corner."""
    t = 1e-2 * np.arange(round(100.0 * until) + 1)
    table = load("straight").vehicle.model_dump()
    level, (x, y, z) = ground_level(table), table["chassis"]["centre"]
    table["chassis"]["hull"] = [[x, y, z], [x - 2.0, y, z]]
    turn, z = 0.5 * np.arcsin(0.01), level + 0.1 - 0.1 * t
    numbers = dict(zip("wxyz", (np.cos(turn), 0.0, -np.sin(turn), 0.0), strict=True))
    columns = {f"chassis.chassis.orientation.{part}": number + 0.0 * t for part, number in numbers.items()}
    columns |= {f"chassis.chassis.position.{axis}": place for axis, place in zip("xyz", (0 * t, 0 * t, z), strict=True)}
    if ground.get("hull"):
        spring = table["contact"]["ground"]["stiffness"] * np.maximum(level + 0.02 - z, 0.0)
        forces = 0.0 * t, 0.0 * t, spring if force is None else force + 0.0 * t
        columns |= {f"chassis.ground.force.{axis}": each for axis, each in zip("xyz", forces, strict=True)}
    scene = {"assembly": "vehicle", "vehicle": table, "run": {"step": 1e-2, "allow": list(allow)}, "ground": ground}
    scene["start"] = {"position": [0.0, 0.0, 0.0], "heading": 0.0}
    return [e for e in entries_of(write(tmp_path / "log.mcap", columns, t, scene)) if e.what in ("belly", "hull")]


@pytest.mark.parametrize(("ground", "allow", "severity"), [
    ({"soil": {"n": 1.0}}, [], "failure"), ({"soil": {"n": 1.0}}, ["belly"], "warning"),
    ({"soil": {"n": 1.0}, "incline_start": 1e3, "grade": 0.1}, [], "failure"),  # a terrain
])  # fmt: skip
def test_a_hull_that_soil_does_not_bear(tmp_path, ground, allow, severity):
    (entry,) = sinking(tmp_path, ground, allow)
    assert (entry.what, entry.severity) == ("belly", severity)
    assert entry.time == pytest.approx(0.8, abs=0.011)
    assert entry.value == pytest.approx(0.22, rel=1e-9)
    assert "bears tracks only: 220 mm, limit 0 mm" in entry.sentence


@pytest.mark.parametrize("more", [{}, {"incline_start": 1e3, "grade": 0.1}])
def test_a_hull_in_hard_ground(tmp_path, more):
    """The limit is that of a link, 29 mm, where springs hold the hull; nothing, where none does."""
    (entry,) = sinking(tmp_path, {"hull": True, **more})
    assert (entry.what, entry.component, entry.severity) == ("hull", "chassis", "warning")
    assert (entry.value, entry.limit) == (pytest.approx(0.22, rel=1e-9), pytest.approx(0.029))
    assert entry.time == pytest.approx(1.1, abs=0.011)
    assert entry.sentence.endswith("220 mm, limit 29 mm")
    assert sinking(tmp_path, {"hull": True, **more}, until=1.08) == []  # 28 mm
    (entry,) = sinking(tmp_path, more)
    assert (entry.what, entry.limit) == ("hull", 0.0)
    assert entry.time == pytest.approx(0.8, abs=0.011)
    assert sinking(tmp_path, more, until=0.79) == []


def test_a_corner_beside_a_wall_is_no_deeper_than_its_force(tmp_path):
    """A bow that touches a wall is under the height of its top; a spring of 2e6 N/m pushes by 58 kN at 29 mm."""
    assert sinking(tmp_path, {"hull": True}, force=57e3) == []
    (entry,) = sinking(tmp_path, {"hull": True}, force=60e3)
    assert entry.value == pytest.approx(0.03, rel=1e-9)


LANES = {"iso_class": "D", "correlated": False, "start": 2.0}
WAVES = {"amplitude": 0.02, "wavelength": 1.0, "start": 2.0}


def kinds_at(tmp_path, ground, x, y, degrees):
    """Kinds and worst values of entries of lanes for a vehicle at a place with a heading."""
    still = np.zeros(11)
    columns = {"chassis.yaw": still + np.radians(degrees)}
    columns |= {f"chassis.chassis.position.{axis}": still + place for axis, place in (("x", x), ("y", y))}
    scene = {
        "assembly": "vehicle",
        "vehicle": load("straight").vehicle.model_dump(),
        "ground": ground,
        "run": {"step": 0.1},
    }
    found = entries_of(write(tmp_path / "log.mcap", columns, 0.1 * np.arange(11), scene))
    return {entry.what: entry.value for entry in found if entry.what in ("lanes", "askew")}


@pytest.mark.parametrize(
    ("ground", "x", "y", "degrees", "kinds"),
    [
        ({"rough": LANES}, 5.0, 0.0, 0.0, {}),
        ({"rough": LANES}, 5.0, 0.38, 0.0, {}),  # the track's inner edge is 0.3905 m from its lane's
        ({"rough": LANES}, 5.0, 0.40, 0.0, {"lanes": 0.0095}),
        ({"rough": LANES}, 5.0, -5.0, 180.0, {"lanes": 4.6095}),
        ({"rough": LANES}, 0.0, -5.0, 0.0, {}),  # before it: its foremost wheels are 1.35 m ahead
        ({"rough": LANES}, 1.0, -5.0, 0.0, {"lanes": 4.6095}),
        ({"rough": LANES}, 5.0, 0.0, 20.0, {"lanes": None}),
        ({"rough": LANES}, 5.0, 0.0, 90.0, {"lanes": None, "askew": 1.0}),
        ({"rough": LANES | {"correlated": True}}, 5.0, 5.0, 25.0, {}),
        ({"rough": LANES | {"correlated": True}}, 5.0, 5.0, -27.0, {"askew": 0.10899}),
        ({"rough": LANES | {"isotropic": True}}, 5.0, 5.0, 90.0, {}),
        ({"washboard": WAVES | {"phase": 0.0}}, 5.0, 5.0, 90.0, {}),  # an obstacle across x
        ({"washboard": WAVES | {"phase": 3.0}}, 5.0, 0.0, 0.0, {}),
        ({"washboard": WAVES | {"phase": 3.0}}, 5.0, 2.0, 0.0, {"lanes": 1.6095}),
    ],
)
def test_tracks_outside_of_their_lanes(tmp_path, ground, x, y, degrees, kinds):
    found = kinds_at(tmp_path, ground, x, y, degrees)
    assert found.keys() == kinds.keys()
    for kind, value in kinds.items():
        assert value is None or found[kind] == pytest.approx(value, abs=1e-5)


@pytest.mark.parametrize(("ground", "until", "lift", "crosses"), [
    ({"soil": {"n": 1.0}}, 12.0, 0.0, True), ({}, 12.0, 0.0, False),
    ({"soil": {"n": 1.0}}, 7.9, 0.0, False), ({"soil": {"n": 1.0}}, 12.0, 0.11, False),
])  # fmt: skip
def test_a_track_in_the_rut_of_the_other_one(tmp_path, ground, until, lift, crosses):
    """Three links on the right go left at 0.2 m/s into the rut of those on the left, which have left it by a metre."""
    t, table = 1e-2 * np.arange(round(100.0 * until) + 1), load("straight").vehicle.model_dump()
    pitch, width = table["track"]["pitch"], table["track"]["width"]
    low = ground_level(table) + table["track"]["face"]
    columns = {}
    for side, x, y, depth in (("left", 0.125 * t, 1.0, 0.08), ("right", 0.0 * t, 0.2 * t - 1.0, 0.1 - lift)):
        columns[f"{side}_track.travel"] = 0.0 * t
        for j in range(3):
            z = low - depth if j < 2 else low + pitch  # the last link goes up, the third one back
            place = x + min(j, 1) * pitch, y + 0.0 * t, z + 0.0 * t
            columns |= {f"{side}_track.joint[{j + 1}].position.{axis}": p for axis, p in zip("xyz", place, strict=True)}
    scene = {"assembly": "vehicle", "vehicle": table, "run": {"step": 1e-2}, "ground": ground}
    scene["start"] = {"position": [0.0, 0.0, 0.0], "heading": 0.0}
    path = write(tmp_path / "log.mcap", columns, t, scene)
    if ground:
        with Log(path) as log:
            for side, deepest in (("", max(0.08, 0.1 - lift)), ("left", 0.08)):
                assert vehicle_measures.rut_depth(RunData(log), side, EVER) == pytest.approx(deepest, rel=1e-9)
    entries = [e for e in entries_of(path) if e.what == "crossed_rut"]
    assert [(entry.component, entry.severity) for entry in entries] == [("right_track", "warning")] * crosses
    for entry in entries:  # cells are half a link wide
        assert entry.time == pytest.approx((2.0 - 0.8 * width) / 0.2, abs=0.5 * pitch / 0.2)
        assert entry.value == pytest.approx(0.08, rel=1e-9)


# known before the run


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


# faults


@pytest.mark.parametrize("error", [NameError("n"), AttributeError("n"), KeyError("n"), TypeError("n"), IndexError("n")])
def test_a_kind_that_breaks_is_counted_and_fails_a_test(tmp_path, monkeypatch, error):
    """A fault of ours is counted, also in the summary of a run; what a log does not hold is no fault."""
    path = running(tmp_path / "a.mcap", np.linspace(0.0, 1.0, 20), np.zeros(20))
    with Log(path) as log:
        whole = validity.of(RunData(log))

    def broken(piece):
        raise error
        yield

    monkeypatch.setitem(validity.CHECKS, "creep", validity.CHECKS["creep"]._replace(find=broken))
    with Log(path) as log, pytest.raises(type(error)):
        validity.of(RunData(log))
    monkeypatch.setattr(run_data, "FAULTS_RAISE", False)
    said = f"1 of {len(validity.CHECKS)} kinds of validity not looked at: creep: {type(error).__name__}: {error}"
    with Log(path) as log:
        found = validity.of(RunData(log))
        assert summary.balance(RunData(log))["passed_over"] == [said]
    assert (found.passed_over, found.entries) == ([said], whole.entries)
    assert f"not looked at, creep: {type(error).__name__}: {error}" in found.table().notes
    error = Missing("the log has no 'speed'")
    with Log(path) as log:
        lacking = validity.of(RunData(log))
    assert (lacking.passed_over, lacking.unchecked["creep"]) == ([], "the log has no 'speed'")


def test_a_section_that_breaks_fails_a_test(monkeypatch):
    """The same of the report: a fault of ours is among what is missing, an error of the log's reader is none."""
    missing = []
    with pytest.raises(ZeroDivisionError):
        attempt(lambda: 1 / 0, missing)
    monkeypatch.setattr(run_data, "FAULTS_RAISE", False)
    attempt(lambda: 1 / 0, missing)
    attempt(lambda: [][0], missing)
    assert missing == ["ZeroDivisionError: division by zero", "IndexError: list index out of range"]
    with pytest.raises(LogUnreadable):
        attempt(lambda: (_ for _ in ()).throw(LogUnreadable("damaged")), missing)


# messages of a run


def said_on_page(path):
    with Log(path) as log:
        return heading.verdict(evaluate(RunData(log), RunSummary({}, {})))


@pytest.fixture(scope="module")
def pressed():
    """Settings of a rig whose sprocket jumps to 30 rad/s: pins 76 mm in the teeth, a tooth jump."""
    return ("run.stop=40 ms", "run.step=0.25 ms", "track.step=0.25 ms", "drive.ramp_time=0", "drive.speed=30")


@pytest.mark.long
def test_a_run_that_is_not_valid_fails_and_says_so_everywhere(cotrack, pressed, tmp_path):
    changes = [part for each in pressed for part in ("--set", each)]
    status, out, err = cotrack("run", "rig", "--track", "rigid", "--no-estimate", "--json", *changes)
    result = json.loads(out.splitlines()[-1])
    assert (status, result["status"]) == (1, "failed")
    assert result["message"].startswith("not valid from 0.0")
    assert result["message"] in err
    entries = result["validity"]
    assert [set(entry) for entry in entries] == [
        {"what", "component", "time", "place", "value", "limit", "severity"}
    ] * len(entries)
    failures = [entry for entry in entries if entry["severity"] == "failure"]
    assert {entry["what"] for entry in failures} == {"penetration", "tooth_jump"}
    assert all(entry["value"] > entry["limit"] >= 0.0 for entry in failures)
    with Log(result["log"]) as log:
        assert log.closing["status"] == "failed"
        assert log.closing["message"] == result["message"]
        assert recorded_entries(log.closing["results"]) == entries
    with open(result["log"], "rb") as file:
        messages = [json.loads(message.data) for _, _, message in make_reader(file).iter_messages("/events")]
    assert len([one for one in messages if one["kind"] == "validity"]) == len(entries)
    assert [entry._asdict() for entry in analyse(result["log"], "validity").entries] == entries, (
        "the log gives other entries"
    )
    assert "validity, failure: track from" in cotrack("log", "info", result["log"])[1]
    assert "penetration" in cotrack("analyse", result["log"], "validity")[1]
    verdict = said_on_page(result["log"])
    assert (verdict.word, result["message"] in html.unescape(verdict.sentence)) == ("Not valid", True)
    assert verdict.sentence.startswith("The run went on to its end at 0.04 s: ")


def test_a_scene_allows_what_it_names(pressed, tmp_path):
    result = simulate(
        load("rig", "rigid", (*pressed, 'run.allow=["penetration", "tooth_jump"]')), tmp_path / "allowed.mcap"
    )
    assert (result["status"], result["message"]) == ("ok", "")
    assert {entry["severity"] for entry in result["validity"]} == {"warning"}
    assert "penetration" in {entry["what"] for entry in result["validity"]}
    with Log(result["log"]) as log:
        assert log.closing["status"] == "ok"
    assert f"; {len(result['validity'])} limits of validity passed" in said_on_page(result["log"]).sentence


@pytest.mark.parametrize("allow", ["run.allow=tooth_jump", 'run.allow=["penetration", "tooth_jump"]', "run.allow=[]"])
def test_kinds_of_failures_may_be_named(allow):
    assert set(load("settle", None, [allow]).run.allow) <= set(limits.ALLOWED)


@pytest.mark.parametrize("allow", ["run.allow=everything", 'run.allow=["creep"]', "run.allow=1"])
def test_other_names_are_refused(allow):
    with pytest.raises(BadInput, match=r"settle.toml: run.allow.* must be a list of penetration, tooth_jump"):
        load("settle", None, [allow])


def test_kinds_are_siblings():
    for name, check in validity.CHECKS.items():
        assert [*inspect.signature(check.find).parameters] == ["piece"], name
        assert [*inspect.signature(check.signals).parameters] == ["run"], name
        assert check.find.__doc__
    assert set(limits.ALLOWED) < set(limits.KINDS)


# ranges


@pytest.mark.parametrize(
    ("setting", "said"),
    [
        ("vehicle.chassis.mass=1e300", "chassis.mass = 1e+300 kg: must be 0.001 to 1e+08 kg"),
        ("vehicle.contact.ground.friction=1e3", "contact.ground.friction = 1000: must be 0 to 100"),
        ("drive.speed=1e6", "drive.speed = 1e+06 rad/s: must be -100000 to 100000 rad/s"),
    ],
)
def test_the_impossible_is_refused(setting, said):
    with pytest.raises(BadInput) as refused:
        load("settle", None, [setting])
    assert str(refused.value).startswith("settle.toml: ")
    assert said in str(refused.value)


def test_the_implausible_is_said_everywhere(cotrack, caplog):
    changes = ("--set", "drive.speed=250", "--set", "drive.ramp_start=5", "--stop", "10 ms")
    status, out, _ = cotrack("run", "settle", "--track", "rigid", "--no-estimate", "--json", *changes)
    result = json.loads(out.splitlines()[-1])
    (warning,) = (each for each in result["warnings"] if each["component"] == "scene")
    assert (status, warning["count"]) == (0, 1)
    text = "settle.toml: drive.speed = 250 rad/s: plausible is -200 to 200 rad/s (a sprocket of 0.25 m"
    assert warning["text"].startswith(text)
    assert text in caplog.text
    with Log(result["log"]) as log:
        assert warning in log.closing["warnings"]


SIX = "vehicle.road_wheel.x=[-0.655, -1.19, -1.725, -2.26, -2.79, -3.322]"


@pytest.mark.parametrize(
    ("settings", "said"),
    [
        (
            (SIX,),
            "own.toml: vehicle.road_wheel.x.3 = -2.26 m and vehicle.road_wheel.x.4 = -2.79 m: these wheels overlap,"
            " 0.53 m apart; plausible is at least 0.61 m, vehicle.road_wheel.radius + vehicle.road_wheel.radius",
        ),
        ((SIX, "vehicle.road_wheel.radius=0.265"), None),
        ((SIX, "vehicle.road_wheel.radius=0.266"), "0.53 m apart; plausible is at least 0.532 m"),
        (("vehicle.road_wheel.x.4=-3.5",), "vehicle.road_wheel.x.4 = -3.5 m and vehicle.idler.x = -4 m: these wheels"),
        (("vehicle.section.outer_fibre=0.0116",), None),  # a section of two thin flanges, 2.04e-6 m^4
        (
            ("vehicle.section.outer_fibre=0.0115",),
            "own.toml: vehicle.section.bending = 2.03e-06 m^4: is more than any section of area = 0.01516 m^2 within"
            " outer_fibre = 0.0115 m has, area x outer_fibre^2 = 2.005e-06 m^4",
        ),
        (("vehicle.road_wheel.x.0=-0.4",), "the sprocket's place = 0 m and vehicle.road_wheel.x.0 = -0.4 m: these"),
        (
            ("vehicle.right={road_wheel={x=[-0.655, -1.322, -1.989, -2.656, -3.5]}}",),
            "vehicle.right.road_wheel.x.4 = -3.5 m and vehicle.right.idler.x = -4 m: these wheels",
        ),
    ],
)
def test_wheels_that_overlap_are_told(settings, said):
    warnings = implausible_numbers(load("straight", "rigid", settings).resolved(), "own.toml")
    assert [said in each for each in warnings] == ([True] if said else [])


@pytest.mark.parametrize("name", scene_names())
def test_the_gallery_is_plausible(name):
    assert implausible_numbers(load(name).resolved(), name) == []


def test_named_soils_are_plausible_and_forgotten_kilonewtons_are_not():
    for name in named():
        assert implausible_numbers(load("soft_ground", None, [f"ground.soil.name='{name}'"]).resolved(), name) == []
    kilo = load("soft_ground", None, ["ground.soil.kphi=1528.43"])
    said = "own.toml: ground.soil.kphi = 1528.43 N/m^(n+2): plausible is 10000 to 1e+08 N/m^(n+2) (tables in kN say"
    assert [each[: len(said)] for each in implausible_numbers(kilo.resolved(), "own.toml")] == [said]
    with pytest.raises(BadInput, match=r"soft_ground\.toml: ground\.soil\.k0 = 1e\+16 Pa/m: must be 0 to 1e\+15 Pa/m"):
        load("soft_ground", None, ["ground.soil.k0=1e16"])
