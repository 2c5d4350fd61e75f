"""Phases of runs with known speed and yaw rate: bounds to one step, figures by hand, ringing ignored."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from motion_logs import CORNERS, STEP, TOP, motion_log, phases_of, times, trapezoid

from orchestrator.execution.summary import empty
from orchestrator.execution.summary_text import lines
from orchestrator.results.analyses import motion_states, phases
from orchestrator.results.approximations import breaks
from orchestrator.results.run_data import Window

PHASES = ["rest", "acceleration", "steady", "braking", "rest"]


def bounds(of):
    assert [one.start for one in of[1:]] == [one.end for one in of[:-1]], "there are gaps"
    return np.array([one.end for one in of])


@pytest.mark.parametrize("even", [True, False])
@pytest.mark.parametrize("by", [0.0, -0.27, 0.31])
def test_bounds_of_a_trapezoid_are_found_to_a_step(tmp_path, even, by):
    """Each bound follows its corner in both directions."""
    t, corners = times(CORNERS[-1], even), np.add(CORNERS, [by, 0.0, -by, 0.0, 0.0])
    longest = float(np.diff(t).max())
    of = phases_of(motion_log(tmp_path / "t.mcap", t, trapezoid(t, corners=corners)))
    assert [one.kind for one in of] == PHASES
    off = bounds(of) - corners
    assert np.abs(off).max() <= 1.01 * longest
    assert np.abs(off + 3.0 * longest).max() > 1.01 * longest, "the twin, three steps off, must differ"


def test_ringing_makes_no_phases(tmp_path):
    """Ringing makes no phases: teeth at 30 Hz, and a hull that nods at 1.2 Hz after start and stop."""
    t = times(CORNERS[-1])
    v = trapezoid(t) + 0.05 * np.sin(2 * np.pi * 30.0 * t)
    for begin, size in ((CORNERS[1], 0.35), (CORNERS[3], -0.3)):
        since = np.maximum(t - begin, 0.0)
        v += size * np.exp(-1.5 * since) * np.sin(2 * np.pi * 1.2 * since)
    of = phases_of(motion_log(tmp_path / "r.mcap", t, v))
    assert [one.kind for one in of] == PHASES
    np.testing.assert_allclose(bounds(of), CORNERS, atol=0.25)
    assert of[2].speed == pytest.approx(TOP, rel=0.01)
    harder = v + (trapezoid(t, 0.5 * TOP, (4.0, 4.2, 5.0, 5.2)))
    assert len(phases_of(motion_log(tmp_path / "h.mcap", t, harder))) > len(PHASES), "the twin: 1.5 times is no ringing"


@pytest.mark.parametrize(("swing", "kind"), [(0.2, "steady"), (0.0, "braking")])
def test_a_phase_that_begins_at_a_crest_of_ringing_is_steady(tmp_path, swing, kind):
    """After a start the hull nods until a turn begins; the twin loses the same speed for good."""
    t = times(6.0)
    since = np.maximum(t - 2.15, 0.0)
    fall = 0.0 if swing else 0.22 * np.minimum(since / 1.25, 1.0)
    v = np.interp(t, [0.65, 2.15], [0.0, 1.96 + (swing or 0.22)]) - fall
    v -= swing * (1.0 - np.exp(-0.3 * since) * np.cos(2.0 * np.pi * 1.2 * since))
    of = phases_of(motion_log(tmp_path / "n.mcap", t, v, np.where(t > 3.4, -0.25, 0.0)))
    assert [one.kind for one in of] == ["rest", "acceleration", kind, "turn"]


def test_turns_are_found_to_a_step_and_through_zero(tmp_path):
    """Turns are found to a step, also a change from right to left through zero, at constant speed."""
    t = times(8.0)
    corners = [1.03, 1.53, 3.01, 4.01, 5.53, 6.13]
    yaw_rate = np.interp(t, corners, [0.0, -0.3, -0.3, 0.3, 0.3, 0.0])
    of = phases_of(motion_log(tmp_path / "s.mcap", t, np.full(len(t), 3.0), yaw_rate))
    assert [(one.kind, one.turning) for one in of] == [
        ("steady", ""), ("turn", "right"), ("turn", "left"), ("steady", ""),
    ]  # fmt: skip
    np.testing.assert_allclose(bounds(of), [1.03, 3.51, 6.13, 8.0], atol=1.01 * STEP)
    right, left = of[1:3]
    heading = 0.3 * (0.25 + 1.48 + 0.25)
    assert right.yaw_rate == pytest.approx(-heading / (3.51 - 1.03), rel=2e-3)
    assert right.yaw_rate_most == pytest.approx(-0.3, rel=1e-9)
    assert left.yaw_rate_most == pytest.approx(0.3, rel=1e-9)
    assert right.radius == pytest.approx(3.0 * (3.51 - 1.03) / heading, rel=2e-3)
    assert right.radius != pytest.approx(3.0 * (3.51 - 1.03) / (1.03 * heading), rel=2e-3)
    assert of[0].radius != of[0].radius, "without a turn the radius is NaN"
    assert [len(phases.Phases(tuple(some)).table().notes) for some in (of, of[:1])] == [1, 0]


def test_the_begin_of_a_slow_turn_is_straight(tmp_path):
    """The beginning of a slow turn counts as straight.

    The vehicle still accelerates when the yaw rate begins to grow: 0.015 rad/s on average until the speed is constant.
    """
    t = times(7.0)
    yaw_rate = np.interp(t, [2.0, 6.0], [0.0, 0.2])
    of = phases_of(motion_log(tmp_path / "b.mcap", t, np.interp(t, [1.0, 2.6], [0.0, 3.0]), yaw_rate))
    assert [(one.kind, one.turning) for one in of] == [("rest", ""), ("acceleration", ""), ("turn", "left")]
    assert of[1].end == pytest.approx(2.6, abs=2.01 * STEP)
    sharper = phases_of(motion_log(tmp_path / "c.mcap", t, np.interp(t, [1.0, 2.6], [0.0, 3.0]), 1.4 * yaw_rate))
    assert [one.turning for one in sharper] == ["", "", "left", "left"]


@pytest.mark.parametrize(("corners", "speeds", "kinds", "ends"), [
    ([1.0, 3.0, 4.0, 4.3], [0.0, 3.0, 3.0, 0.0], PHASES, [1.0, 3.0, 4.0, 4.3, 7.0]),  # a quick stop is braking
    ([1.0, 2.0, 3.0, 5.0], [0.0, 3.0, 3.0, -2.0],  # a vehicle that reverses stops on the way
     ["rest", "acceleration", "steady", "braking", "acceleration", "steady"], [1.0, 2.0, 3.0, 4.2, 5.0, 7.0]),
])  # fmt: skip
def test_quick_stops_and_reversals_are_braking(tmp_path, corners, speeds, kinds, ends):
    t = times(7.0)
    of = phases_of(motion_log(tmp_path / "b.mcap", t, np.interp(t, corners, speeds)))
    assert [one.kind for one in of] == kinds
    np.testing.assert_allclose(bounds(of), ends, atol=2.01 * STEP)
    assert of[-1].speed == pytest.approx(speeds[-1])
    assert of[-1].way == pytest.approx(abs(speeds[-1]) * (7.0 - ends[-2]), rel=2e-3)


def test_a_pivot_is_a_turn_and_a_crawl_is_no_rest(tmp_path):
    t = times(4.0)
    yaw_rate = np.interp(t, [1.0, 1.5], [0.0, 1.5])
    of = phases_of(motion_log(tmp_path / "p.mcap", t, 0.0 * t, yaw_rate))
    assert [phases.phase_name(one) for one in of] == ["rest", "turn left"]
    assert of[1].radius == 0.0
    assert [one.kind for one in phases_of(motion_log(tmp_path / "c.mcap", t, 0.05 + 0.0 * t))] == ["steady"]
    assert [one.kind for one in phases_of(motion_log(tmp_path / "r.mcap", t, 0.02 + 0.0 * t))] == ["rest"]


def stairs(t, size=1.0):
    """Speed of a vehicle on stairs: 0.42 m/s, with ramps of 0.1 m/s in 0.2 s and 0.084 m each, of one size."""
    ramps = np.arange(1.5, 3.6, 0.2)
    return size * np.interp(t, [1.0, *ramps, 4.0], [0.0, *(0.42 + 0.05 * (-1.0) ** np.arange(len(ramps))), 0.42])


def test_short_pieces_of_one_way_are_no_rest(tmp_path):
    """A vehicle whose speed changes before it has gone 0.1 m drives on; one that rocks to and fro rests.

    So does one that has gained its speed before a stretch of 0.095 m; a wait of the same length is a rest.
    """
    t = times(4.5)

    def kinds(name, v, *more):
        return [one.kind for one in phases_of(motion_log(tmp_path / f"{name}.mcap", t, v, *more))]

    of = phases_of(motion_log(tmp_path / "s.mcap", t[t < 4.0], stairs(t[t < 4.0])))
    assert [one.kind for one in of] == ["rest", "acceleration", "steady"]
    assert (of[2].speed, of[2].way) == (pytest.approx(0.42, rel=0.02), pytest.approx(0.42 * 2.5, rel=0.03))
    turning = np.where((t > 2.0) & (t < 2.8), 0.3 * np.sign(np.sin(5 * np.pi * t)), 0.0)  # yaw rate cuts pieces, too
    assert {*kinds("y", stairs(t), turning)[2:]} <= {"steady", "turn"}
    rocking = np.interp(t, np.arange(1.0, 4.01, 0.2), 0.05 * (-1.0) ** np.arange(16)) * (t >= 1.0) * (t < 4.0)
    assert kinds("r", rocking) == ["rest"], "the twin"
    corners = [1.0, 1.4, 1.78, 2.18]
    of = phases_of(motion_log(tmp_path / "o.mcap", t, np.interp(t, corners, [0.0, 0.25, 0.25, 0.0])))
    assert [one.kind for one in of] == PHASES
    assert of[2].speed == pytest.approx(0.25, rel=0.02)
    assert of[2].way < motion_states.STAYS
    between = np.interp(t, corners, [0.25, 0.0, 0.0, 0.25])
    assert kinds("b", between) == ["steady", "braking", "rest", "acceleration", "steady"], "the twin"


@pytest.mark.parametrize(("size", "kind"), [(1.0, "rest"), (0.18, "steady"), (0.3, "rest")])
def test_thresholds_scale_with_the_vehicle(tmp_path, size, kind):
    """A crawl of 10 mm/s: rest for a track of 9.8 m, motion for one of 1.8 m, whose limit is 8.5 mm/s (Froude)."""
    t = times(4.0)
    track = {"pitch": size * motion_states.TRACK / 64, "links": 64}
    scene = {"vehicle": {"track": track}}
    (of,) = phases_of(motion_log(tmp_path / "c.mcap", t, 0.01 + 0.0 * t, scene=scene))
    assert of.kind == kind
    assert (motion_states.STANDS * size**0.5 < 0.01) == (kind == "steady")
    again = phases_of(motion_log(tmp_path / "d.mcap", t, stairs(t, size**0.5), scene=scene))
    assert [one.kind for one in again] == ["rest", "acceleration", "steady"], "the same motion of another size"


def test_both_at_once(tmp_path):
    """A turn during acceleration: one phase for each pair of states."""
    t = times(6.0)
    yaw_rate = np.interp(t, [2.0, 2.4], [0.0, 0.4])
    of = phases_of(motion_log(tmp_path / "b.mcap", t, np.interp(t, [1.0, 3.5], [0.0, 5.0]), yaw_rate))
    called = ["rest", "acceleration", "acceleration, turning left", "turn left"]
    assert [phases.phase_name(one) for one in of] == called
    np.testing.assert_allclose(bounds(of), [1.0, 2.0, 3.5, 6.0], atol=1.01 * STEP)
    short = np.interp(t, [2.0, 2.1, 2.4, 2.5], [0.0, 0.4, 0.4, 0.0])
    of = phases_of(motion_log(tmp_path / "s.mcap", t, np.interp(t, [1.0, 3.5], [0.0, 5.0]), short))
    assert [phases.phase_name(one) for one in of] == [*called[:3], "acceleration", "steady"], "1 m/s in 0.5 s of it"


@pytest.mark.parametrize(
    ("power", "kind"), [((5.0, 2.0), "slowing"), ((5.0, 0.0), "braking"), ((-5.0, -2.0), "braking")]
)
def test_a_vehicle_that_its_drives_push_on_does_not_brake(tmp_path, power, kind):
    """The twins: drives that stop pushing before the middle of the phase, and some that take energy out."""
    t = times(CORNERS[-1])
    begin, end = CORNERS[2:4]
    work = np.interp(t, [begin, begin + 0.4 * (end - begin), end], np.cumsum([9.0, *power]))
    of = phases_of(motion_log(tmp_path / "w.mcap", t, trapezoid(t), work=work))
    assert [one.kind for one in of] == [*PHASES[:3], kind, PHASES[4]]
    (row,) = (line for line in lines(empty("a", None) | {"phases": [of[3]._asdict()]}) if kind in line)
    assert " 4.00 to 0.00 " in row


@pytest.mark.parametrize("even", [True, False])
def test_figures_are_those_of_the_records(tmp_path, even):
    t = times(CORNERS[-1], even)
    v = trapezoid(t)
    slip, work, tension = 0.01 * v + 0.002 * np.sin(50.0 * t), 1e4 * t**2, 1e4 + 3e3 * np.sin(9.0 * t)
    path = motion_log(tmp_path / "f.mcap", t, v, None, slip, tension, work)
    of = phases_of(path)
    for one in of:
        a, b = np.searchsorted(t, [one.start, one.end])
        length, own = t[b] - t[a], np.diff(t[a : b + 1])
        assert one.way == pytest.approx(np.sum(0.5 * (v[a + 1 : b + 1] + v[a:b]) * own), abs=1e-9)
        assert one.speed == pytest.approx(one.way / length, abs=1e-9)
        assert (one.speed_start, one.speed_end) == pytest.approx((v[a], v[b]), abs=3.0 * TOP * STEP)
        assert one.power == pytest.approx((work[b] - work[a]) / length, rel=1e-9)
        assert one.slip_left == pytest.approx(np.sum(slip[a + 1 : b + 1] * own) / length, rel=2e-3, abs=1e-5)
        assert one.slip_right == pytest.approx(2.0 * one.slip_left)
        inside = slice(a + (a > 0), b + 1)
        assert (one.tension, one.tension_track) == (tension[inside].max(), "left_track")
        assert one.tension_t == t[inside][tension[inside].argmax()]
    assert sum(one.way for one in of) == pytest.approx(np.trapezoid(v, t), rel=1e-12)
    assert max(one.tension for one in of) == tension.max()
    exact = 0.5 * TOP * (CORNERS[2] - CORNERS[1] + CORNERS[3] - CORNERS[0])
    assert sum(one.way for one in of) == pytest.approx(exact, rel=1e-4)
    inner = phases_of(path, Window(3.5, 5.5))
    assert [one.kind for one in inner] == ["steady"]
    assert inner[0].end - inner[0].start == pytest.approx(2.0, abs=2.0 * STEP)


SPEEDS = st.lists(st.tuples(st.floats(0.05, 1.5), st.floats(-1.0, 1.0) | st.sampled_from([0.0, 1.0])), min_size=2)


def contradicts(kind, first, last, top):
    """Whether a state contradicts speeds, as printed, at both ends of a phase of a vehicle with tracks of TRACK."""
    change = round(abs(float(phases.rounded(last))) - abs(float(phases.rounded(first))), 2)
    least = max(motion_states.LARGE * top, 0.1)
    if kind in ("acceleration", "braking"):
        return change <= 0.0 if kind == "acceleration" else change >= 0.0
    return abs(change) > least + 0.01 or (kind == "rest" and max(abs(first), abs(last)) > least)


@pytest.mark.long
@given(SPEEDS, st.lists(st.sampled_from([-0.3, 0.0, 0.0, 0.3]), min_size=5, max_size=5),
       st.floats(0.2, 5.0), st.floats(0.0, 0.6), st.floats(0.2, 5.0))  # fmt: skip
def test_no_state_contradicts_the_speeds_at_its_ends(corners, yaw_rates, top, ringing, frequency):
    """Of any motion: ramps, jumps and stops of any length, ringing, turns that begin and end anywhere."""
    at = np.cumsum([length for length, _ in corners])
    t = np.arange(0.0, at[-1] + 0.3, 5.0 * STEP)
    v = top * (np.interp(t, at, [speed for _, speed in corners]) + ringing * np.sin(2 * np.pi * frequency * t))
    yaw_rate = np.interp(t, np.linspace(0.0, t[-1], 5), yaw_rates)
    yaw = np.cumsum(yaw_rate) * 5.0 * STEP
    parts = motion_states.parts_of(t, v, yaw_rate, yaw, 1.0)
    assert [part[0] for part, _ in parts[1:]] == [part[1] for part, _ in parts[:-1]]
    for (_, _, (kind, _)), ends in parts:
        assert not contradicts(kind, *ends, np.abs(v).max()), (kind, ends)


def test_a_slow_ramp_is_no_steady_motion(tmp_path):
    """From 0 to 4 m/s in a minute, slower than RATE, or by short steps; the twins change too little for it."""
    t = np.arange(0.0, 60.0, 0.01)
    steps = np.arange(0.0, 6.0, 0.5)
    stairs = np.interp(t[:600], steps, np.repeat(np.linspace(0.0, 1.0, 6), 2))
    for shape, high in ((t / 60.0, 3.2), (stairs, 3.7)):
        for start, kind in ((0.0, "acceleration"), (high, "steady")):
            v = start + (4.0 - start) * shape
            of = phases_of(motion_log(tmp_path / f"{start}.mcap", t[: len(v)], v))
            assert {one.kind for one in of} - {"rest"} == {kind}


def test_what_a_log_does_not_hold_is_left_out(tmp_path):
    t = times(2.0)
    alone = phases_of(motion_log(tmp_path / "a.mcap", t, trapezoid(t), tracks=("left_track",)))[0]
    assert alone.slip_left == 0.0
    assert alone.slip_right != alone.slip_right
    bare = phases_of(motion_log(tmp_path / "b.mcap", t, trapezoid(t), tracks=()))[0]
    assert bare.tension_track == ""
    assert not any("tension" in line for line in lines(empty("a", None) | {"phases": [bare._asdict()]}))
    broken = trapezoid(t)
    broken[700:] = np.nan
    assert phases_of(motion_log(tmp_path / "n.mcap", t, broken))[-1].end == t[699], (
        "the last phase ends with the last number"
    )


def test_a_broken_line_of_many_breaks_is_found(tmp_path):
    """A broken line of many breaks is found: a saw of twenty teeth, each corner to a record."""
    t = np.arange(20001) * 1e-3
    corners = np.arange(21.0) + 0.013 * np.sin(np.arange(21.0))
    y = np.interp(t, corners, np.arange(21) % 2)
    edges, _ = breaks(t, y, 0.02)
    assert len(edges) == 21
    np.testing.assert_allclose(t[edges[1:-1]], corners[1:-1], atol=2.01e-3)
