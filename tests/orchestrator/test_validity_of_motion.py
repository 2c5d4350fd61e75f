"""Validity of a motion on its ground, from made-up records.

Creep, brakes, spin, sliding, compression, lift; hulls in the ground, lanes, ruts.
"""

import numpy as np
import pytest
from ledger_logs import SPROCKET, entries_of, vehicle
from made_logs import of_columns

from fmus.vehicles.sides import ground_level
from orchestrator.log.reader import Log
from orchestrator.results import vehicle_measures
from orchestrator.results.analyses import validity
from orchestrator.results.run_data import EVER, RunData

T = 1e-2 * np.arange(301)
YAW_RATE, VELOCITY = "chassis.chassis.angular_velocity.z", "chassis.chassis.velocity"


def standing(tmp_path, drive=(), start=(), **changes):
    """Entries for a vehicle of one track at rest for 3 s; ``changes`` replace signals, ``drive``, ``start``: tables."""
    still = "travel", "penetration.max", "slip", "ground.force.y", "sprocket.force.x", "speed"
    columns = {f"left_track.{name}": 0.0 * T for name in still}
    columns |= {"left_track.tension.min": 1e4, "left_track.ground.force.x": 3e3, "left_track.ground.force.z": 2e4}
    columns |= dict.fromkeys(("left_drive.speed", "left_drive.angle", "chassis.yaw"), 0.0)
    columns |= {f"chassis.chassis.velocity.{axis}": 0.0 for axis in "xyz"} | {YAW_RATE: 0.0}
    columns |= {name.replace("__", "."): values for name, values in changes.items()}
    columns = {name: values + 0.0 * T for name, values in columns.items()}
    scene = {"assembly": "vehicle", "vehicle": vehicle(), "run": {"step": 1e-2, "variable": {"tolerance": 1e-3}}}
    scene |= {"drive": dict(drive), "start": dict(start)}
    return entries_of(of_columns(tmp_path / "log.mcap", columns, T, scene, [SPROCKET]))


def test_a_vehicle_that_stands_passes_no_limit(tmp_path):
    assert standing(tmp_path) == ()


@pytest.mark.parametrize(("slip", "share", "speed", "yaw", "creeps"), [
    (0.012, 0.5, 0.0, 0.0, True),
    (0.008, 0.5, 0.0, 0.0, False),  # too slow
    (0.02598, 0.28 / 0.3, 0.0, 0.0, True),  # on 28 % with a friction of 0.3, at the speed of friction's law
    (0.0999, 0.995, 0.0, 0.0, True),
    (0.0999, 1.005, 0.0, 0.0, False),  # friction does not hold it
    (0.06, 0.5, 0.0, 0.0, False),  # it really slides
    (0.012, 0.5, 0.2, 0.0, False),  # its sprocket turns
    (0.012, 0.5, 0.0, 0.05, False),  # it turns
])  # fmt: skip
@pytest.mark.parametrize("heading", [0.0, 0.5 * np.pi])
@pytest.mark.parametrize("sideways", [False, True])
def test_creep_is_sliding_where_friction_should_hold(tmp_path, slip, share, speed, yaw, creeps, heading, sideways):
    """In any heading, along the vehicle and across it."""
    to, pull = heading + 0.5 * np.pi * sideways, share * 0.3 * 2e4
    entries = standing(
        tmp_path,
        **{"chassis.yaw": heading, YAW_RATE: yaw, "left_drive.speed": speed, "left_track.slip": slip * (not sideways)},
        **{"left_track.ground.force.x": pull * np.cos(to), "left_track.ground.force.y": pull * np.sin(to)},
        **{f"{VELOCITY}.x": -slip * np.cos(to), f"{VELOCITY}.y": -slip * np.sin(to)},
    )
    assert [(e.what, round(e.value, 6)) for e in entries] == [("creep", slip)] * creeps


@pytest.mark.parametrize(("push", "creeps"), [(0.005 / 9.81, False), (0.5 * 0.3, True)])
def test_a_vehicle_that_comes_to_a_stop_does_not_creep(tmp_path, push, creeps):
    """Friction at its limit slows it down: nothing pulls at it; without the slowing down something would."""
    slows = -0.015 + 0.005 * T
    moved = {"left_track.ground.force.x": push * 2e4, "left_track.slip": -slows, f"{VELOCITY}.x": slows}
    assert [e.what for e in standing(tmp_path, **moved)] == ["creep"] * creeps


@pytest.mark.parametrize(("chain", "pads", "yaw", "what", "value"), [
    (2.0, 1.04, 0.0, "spin", 0.52), (2.0, 0.96, 0.0, "", 0.0),
    (2.0, 1.04, 0.05, "", 0.0),  # it turns
    (2.0, 2.0, 0.0, "spin", 1.0),  # it does not move
    (0.1, 0.1, 0.0, "", 0.0),  # too slow to matter
    (0.0, 3.8, 0.0, "slide", 3.8), (0.0, 0.19, 0.0, "", 0.0),  # locked
    (2.0, -2.1, 0.0, "slide", 2.1), (2.0, -1.9, 0.0, "", 0.0),
    (21.0, 0.0, 0.0, "fast", 21.0), (20.0, 0.0, 0.0, "", 0.0),  # ten walking paces of the m113 are 20.46 m/s
    (20.0, -1.0, 0.0, "fast", 21.0),
    (21.0, 15.0, 0.0, "spin", 15.0 / 21.0),  # one warning
])  # fmt: skip
@pytest.mark.parametrize("way", [1.0, -1.0])
def test_tracks_that_spin_or_slide(tmp_path, chain, pads, yaw, what, value, way):
    """Either way, for longer than a second."""
    changed = {"left_drive.speed": 9.0, YAW_RATE: yaw, "left_track.speed": way * chain}
    entries = standing(tmp_path, **changed, **{"left_track.slip": way * pads})
    assert [(e.what, e.value) for e in entries] == [(what, pytest.approx(value))] * bool(what)
    if value == 0.52:
        assert standing(tmp_path, **changed, **{"left_track.slip": way * pads * (T % 1.5 < 0.9)}) == ()


@pytest.mark.parametrize(("force", "time", "pushes"), [(7e3, 0.04, True), (6e3, 0.04, False), (7e3, 0.01, False)])
def test_links_that_push_longer_than_a_peak(tmp_path, force, time, pushes):
    """The limit is 6.45 kN, by the arch of links between two wheels."""
    entries = standing(tmp_path, left_track__tension__min=np.where((T > 0.999) & (0.999 + time > T), -force, 1e4))
    limit = pytest.approx(18.02 * 9.81 / 0.1524 * 0.667**2 / 0.08, rel=1e-6)
    assert [(e.what, e.limit) for e in entries] == [("compression", limit)] * pushes


@pytest.mark.parametrize(("state", "raised", "in_air", "found"), [
    ("equilibrium", 0.0, 0.0, [1]), ("drawn", 0.0, 0.0, [1]),
    ("equilibrium", 0.05, 0.0, [1, 2]),  # the twin: with 5 % of a mean load at rest
    ("drawn", 0.0, 0.5, [0, 1, 2, 3]),  # falls to the ground, and no wheel is at rest before; 0 is the track
])  # fmt: skip
def test_a_wheel_that_carries_nothing_at_rest_is_no_news(tmp_path, state, raised, in_air, found):
    """A raised end wheel that touches for a while, and a wheel that loses its load for 0.3 s."""
    down = (in_air <= T) * 1e4
    loads = np.where((T > 0.999) & (T < 1.299), 0.0, down), np.where(T < 0.05, raised, (T > 1.995) & (T < 2.5)) * down
    changed = {f"left_track.road_wheel[{k}].force.{axis}": 0.0 for k in (1, 2, 3) for axis in "xyz"}
    changed |= {f"left_track.road_wheel[{k}].force.z": load for k, load in enumerate((*loads, down), 1)}
    changed["left_track.ground.force.z"] = 2.0 * down
    entries = standing(tmp_path, **changed, start={"state": state})
    assert sorted({int((e.place or "[0]").partition("[")[2][:-1]) for e in entries if e.what == "lift"}) == found


@pytest.mark.parametrize(("time", "off"), [(0.3, True), (0.15, False)])
def test_a_track_that_leaves_the_ground(tmp_path, time, off):
    load = np.where((T > 0.999) & (0.999 + time > T), 0.0, 2e4)
    entries = standing(tmp_path, left_track__ground__force__z=load)
    assert [(e.what, e.component) for e in entries] == [("lift", "left_track")] * off


# hulls, lanes and ruts


def placed(path, t, ground, columns, table=None, allow=()):
    """Log of a vehicle on a ground with these signals, numbers or (m,)."""
    scene = {"assembly": "vehicle", "vehicle": table or vehicle(), "ground": ground}
    scene |= {"run": {"step": float(t[1] - t[0]), "allow": list(allow)}}
    scene["start"] = {"position": [0.0, 0.0, 0.0], "heading": 0.0}
    return of_columns(path, {name: value + 0.0 * t for name, value in columns.items()}, t, scene)


def sinking(tmp_path, ground, allow=(), force=None, until=3.0):
    """Entries for a hull of two corners that goes down at 0.1 m/s, from 0.1 m over the ground on, pitched about the
    first one; the rear one is 20 mm lower. ``force`` of the ground on it, by default that of a link's spring at the
    rear corner."""
    t, table = 1e-2 * np.arange(round(100.0 * until) + 1), vehicle()
    level, (x, y, z) = ground_level(table), table["chassis"]["centre"]
    table["chassis"]["hull"] = [[x, y, z], [x - 2.0, y, z]]
    turn, z = 0.5 * np.arcsin(0.01), level + 0.1 - 0.1 * t
    numbers = dict(zip("wxyz", (np.cos(turn), 0.0, -np.sin(turn), 0.0), strict=True))
    columns = {f"chassis.chassis.orientation.{part}": number for part, number in numbers.items()}
    columns |= {f"chassis.chassis.position.{axis}": place for axis, place in zip("xyz", (0.0, 0.0, z), strict=True)}
    if ground.get("hull"):
        spring = table["contact"]["ground"]["stiffness"] * np.maximum(level + 0.02 - z, 0.0)
        forces = 0.0, 0.0, spring if force is None else force
        columns |= {f"chassis.ground.force.{axis}": each for axis, each in zip("xyz", forces, strict=True)}
    path = placed(tmp_path / "log.mcap", t, ground, columns, table, allow)
    return [e for e in entries_of(path) if e.what in ("belly", "hull")]


@pytest.mark.parametrize(("ground", "allow", "severity"), [
    ({"soil": {"n": 1.0}}, [], "failure"), ({"soil": {"n": 1.0}}, ["belly"], "warning"),
    ({"soil": {"n": 1.0}, "incline_start": 1e3, "grade": 0.1}, [], "failure"),  # a terrain
])  # fmt: skip
def test_a_hull_that_soil_does_not_bear(tmp_path, ground, allow, severity):
    (entry,) = sinking(tmp_path, ground, allow)
    assert (entry.what, entry.severity) == ("belly", severity)
    assert entry.time == pytest.approx(0.8, abs=0.011)
    assert entry.value == pytest.approx(0.22, rel=1e-9)


@pytest.mark.parametrize(("ground", "says"), [
    ({"soil": {"n": 1.0}}, True), ({"incline_start": 1e3, "grade": 0.1}, True), ({}, False),  # level and hard
])  # fmt: skip
@pytest.mark.parametrize("points", [[], [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]]])
def test_a_belly_that_nothing_checks_is_told(tmp_path, ground, says, points):
    """The belly of a vehicle without hull points; the twin has some."""
    table = vehicle()
    table["chassis"]["hull"] = points
    columns = {f"chassis.chassis.orientation.{part}": part == "w" for part in "wxyz"}
    columns |= {f"chassis.chassis.position.{axis}": 9.0 for axis in "xyz"}
    with Log(placed(tmp_path / "log.mcap", 0.1 * np.arange(11), ground, columns, table)) as log:
        found = validity.of(RunData(log))
    told = "belly: the vehicle has no hull points (chassis.hull)"
    lacks = says and not points
    assert found.passed_over == [f"1 of {len(validity.CHECKS)} kinds of validity not looked at: {told}"] * lacks
    assert (f"not looked at, {told}" in found.table().notes) is lacks


@pytest.mark.parametrize("more", [{}, {"incline_start": 1e3, "grade": 0.1}])
def test_a_hull_in_hard_ground(tmp_path, more):
    """The limit is that of a link, 29 mm, where springs hold the hull; nothing, where none does."""
    (entry,) = sinking(tmp_path, {"hull": True, **more})
    assert (entry.what, entry.component, entry.severity) == ("hull", "chassis", "warning")
    assert (entry.value, entry.limit) == (pytest.approx(0.22, rel=1e-9), pytest.approx(0.029))
    assert entry.time == pytest.approx(1.1, abs=0.011)
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


@pytest.mark.parametrize(("ground", "x", "y", "degrees", "kinds"), [
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
])  # fmt: skip
def test_tracks_outside_of_their_lanes(tmp_path, ground, x, y, degrees, kinds):
    columns = {"chassis.yaw": np.radians(degrees), "chassis.chassis.position.x": x, "chassis.chassis.position.y": y}
    entries = entries_of(placed(tmp_path / "log.mcap", 0.1 * np.arange(11), ground, columns))
    found = {entry.what: entry.value for entry in entries if entry.what in ("lanes", "askew")}
    assert found == {k: found.get(k) if v is None else pytest.approx(v, abs=1e-5) for k, v in kinds.items()}


@pytest.mark.parametrize(("ground", "until", "lift", "crosses"), [
    ({"soil": {"n": 1.0}}, 12.0, 0.0, True), ({}, 12.0, 0.0, False),
    ({"soil": {"n": 1.0}}, 7.9, 0.0, False), ({"soil": {"n": 1.0}}, 12.0, 0.11, False),
])  # fmt: skip
def test_a_track_in_the_rut_of_the_other_one(tmp_path, ground, until, lift, crosses):
    """Three links on the right go left at 0.2 m/s into the rut of those on the left, which have left it by a metre."""
    t, table = 1e-2 * np.arange(round(100.0 * until) + 1), vehicle()
    pitch, width = table["track"]["pitch"], table["track"]["width"]
    low = ground_level(table) + table["track"]["face"]
    columns = {}
    for side, x, y, depth in (("left", 0.125 * t, 1.0, 0.08), ("right", 0.0 * t, 0.2 * t - 1.0, 0.1 - lift)):
        columns[f"{side}_track.travel"] = 0.0
        for j in range(3):
            z = low - depth if j < 2 else low + pitch  # the last link goes up, the third one back
            place = x + min(j, 1) * pitch, y, z
            columns |= {f"{side}_track.joint[{j + 1}].position.{axis}": p for axis, p in zip("xyz", place, strict=True)}
    path = placed(tmp_path / "log.mcap", t, ground, columns)
    if ground:
        with Log(path) as log:
            for side, deepest in (("", max(0.08, 0.1 - lift)), ("left", 0.08)):
                assert vehicle_measures.rut_depth(RunData(log), side, EVER) == pytest.approx(deepest, rel=1e-9)
    entries = [e for e in entries_of(path) if e.what == "crossed_rut"]
    assert [(entry.component, entry.severity) for entry in entries] == [("right_track", "warning")] * crosses
    for entry in entries:  # cells are half a link wide
        assert entry.time == pytest.approx((2.0 - 0.8 * width) / 0.2, abs=0.5 * pitch / 0.2)
        assert entry.value == pytest.approx(0.08, rel=1e-9)
