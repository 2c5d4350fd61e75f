"""Validity of a vehicle on its ground, from made-up records: hulls in it, lanes, ruts."""

import numpy as np
import pytest
from ledger_logs import entries_of
from made_logs import of_columns

from fmus.start import ground_level
from orchestrator.log.reader import Log
from orchestrator.results import vehicle_measures
from orchestrator.results.analyses import validity
from orchestrator.results.run_data import EVER, RunData
from orchestrator.scene.scene import load


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
    return [e for e in entries_of(of_columns(tmp_path / "log.mcap", columns, t, scene)) if e.what in ("belly", "hull")]


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


@pytest.mark.parametrize(("ground", "says"), [
    ({"soil": {"n": 1.0}}, True), ({"incline_start": 1e3, "grade": 0.1}, True), ({}, False),  # level and hard
])  # fmt: skip
@pytest.mark.parametrize("points", [[], [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]]])
def test_a_belly_that_nothing_checks_is_told(tmp_path, ground, says, points):
    """The belly of a vehicle without hull points; the twin has some."""
    table = load("straight").vehicle.model_dump()
    table["chassis"]["hull"] = points
    scene = {"assembly": "vehicle", "vehicle": table, "run": {"step": 0.1}, "ground": ground}
    still = np.zeros(11)
    columns = {f"chassis.chassis.orientation.{part}": still + (part == "w") for part in "wxyz"}
    columns |= {f"chassis.chassis.position.{axis}": still + 9.0 for axis in "xyz"}
    scene["start"] = {"position": [0.0, 0.0, 0.0], "heading": 0.0}
    with Log(of_columns(tmp_path / "log.mcap", columns, 0.1 * np.arange(11), scene)) as log:
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
    found = entries_of(of_columns(tmp_path / "log.mcap", columns, 0.1 * np.arange(11), scene))
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
    path = of_columns(tmp_path / "log.mcap", columns, t, scene)
    if ground:
        with Log(path) as log:
            for side, deepest in (("", max(0.08, 0.1 - lift)), ("left", 0.08)):
                assert vehicle_measures.rut_depth(RunData(log), side, EVER) == pytest.approx(deepest, rel=1e-9)
    entries = [e for e in entries_of(path) if e.what == "crossed_rut"]
    assert [(entry.component, entry.severity) for entry in entries] == [("right_track", "warning")] * crosses
    for entry in entries:  # cells are half a link wide
        assert entry.time == pytest.approx((2.0 - 0.8 * width) / 0.2, abs=0.5 * pitch / 0.2)
        assert entry.value == pytest.approx(0.08, rel=1e-9)
