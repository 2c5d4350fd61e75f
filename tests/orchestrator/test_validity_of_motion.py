"""Validity of a motion, from made-up records: creep, brakes, spin, sliding, compression, lift."""

import numpy as np
import pytest
from ledger_logs import SPROCKET, entries_of, vehicle
from made_logs import of_columns


def standing(tmp_path, drive=(), start=(), **changes):
    """Entries for a vehicle of one track at rest for 3 s; ``changes`` replace signals, ``drive``, ``start``: tables."""
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
    scene |= {"drive": dict(drive), "start": dict(start)}
    return entries_of(of_columns(tmp_path / "log.mcap", columns, t, scene, [SPROCKET]))


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


@pytest.mark.parametrize(("state", "raised", "in_air", "found"), [
    ("equilibrium", 0.0, 0.0, [1]), ("drawn", 0.0, 0.0, [1]),
    ("equilibrium", 0.05, 0.0, [1, 2]),  # the twin: with 5 % of a mean load at rest
    ("drawn", 0.0, 0.5, [0, 1, 2, 3]),  # falls to the ground, and no wheel is at rest before; 0 is the track
])  # fmt: skip
def test_a_wheel_that_carries_nothing_at_rest_is_no_news(tmp_path, state, raised, in_air, found):
    """A raised end wheel that touches for a while, and a wheel that loses its load for 0.3 s."""
    t = 1e-2 * np.arange(301)
    down = (t >= in_air) * 1e4
    loads = np.where((t > 0.999) & (t < 1.299), 0.0, down), np.where(t < 0.05, raised, (t > 1.995) & (t < 2.5)) * down
    changed = {f"left_track.road_wheel[{k}].force.{axis}": 0.0 * t for k in (1, 2, 3) for axis in "xyz"}
    changed |= {f"left_track.road_wheel[{k}].force.z": load for k, load in enumerate((*loads, down), 1)}
    changed["left_track.ground.force.z"] = 2.0 * down
    entries = standing(tmp_path, **changed, start={"state": state})
    assert sorted({int((e.place or "[0]").partition("[")[2][:-1]) for e in entries if e.what == "lift"}) == found


@pytest.mark.parametrize(("time", "off"), [(0.3, True), (0.15, False)])
def test_a_track_that_leaves_the_ground(tmp_path, time, off):
    t = 1e-2 * np.arange(301)
    load_ = np.where((t > 0.999) & (t < 0.999 + time), 0.0, 2e4)
    entries = standing(tmp_path, left_track__ground__force__z=load_)
    assert [(e.what, e.component) for e in entries] == [("lift", "left_track")] * off
