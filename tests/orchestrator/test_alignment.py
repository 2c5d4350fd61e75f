"""Runs aligned by time, by travel, by an event: the same motion later, or at another pace."""

import numpy as np
import pytest
from made_logs import made

from orchestrator.log.reader import Log
from orchestrator.results.difference import alignment, differences
from orchestrator.results.run_data import EVER, RunData, Window

H, STEPS = 0.005, 800
MOTION = [f"chassis.{what}.{axis}" for what in ("position", "velocity") for axis in "xyz"]
TOPICS = {
    "/chassis/out": [(name, "1") for name in (*MOTION, "speed", "pitch")],
    "/left_track/out": [("travel", "m"), ("tension.max", "N")],
}


def wrote(path, way, rate, scale=1.0):
    """Write a log of a vehicle at the place ``way(t)`` with a pitch by place, times ``scale``."""
    t = H * np.arange(STEPS + 1)
    x, v, none = np.array([way(each) for each in t]), np.array([rate(each) for each in t]), np.zeros(len(t))
    hull = np.stack([x, none, none, v, none, none, v, scale * 0.1 * np.sin(3.0 * x)], axis=1)
    rows = {"/chassis/out": (t, hull), "/left_track/out": (t, np.stack([x, none], axis=1))}
    return made(path, TOPICS, rows, instances=("chassis", "left_track"), step=H)


def apart(one, two, along, window=EVER):
    with Log(one) as a, Log(two) as b:
        return differences(RunData(a), RunData(b), window, alignment(along))


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    """Logs: reference, the same 0.3 s later, another pace, and that with 4 % more pitch."""
    folder = tmp_path_factory.mktemp("logs")
    later = lambda t: max(t - 0.3, 0.0)  # noqa: E731
    return {
        "reference": wrote(folder / "a.mcap", lambda t: t**2, lambda t: 2.0 * t),
        "later": wrote(folder / "b.mcap", lambda t: later(t) ** 2, lambda t: 2.0 * later(t)),
        "slower": wrote(folder / "c.mcap", lambda t: t**1.8, lambda t: 1.8 * t**0.8),
        "nods": wrote(folder / "d.mcap", lambda t: t**1.8, lambda t: 1.8 * t**0.8, 1.04),
    }


def test_what_comes_later_is_the_same_since_the_event(runs):
    by_time, by_event = (apart(runs["later"], runs["reference"], along) for along in ("time", "chassis.speed=1.5"))
    assert by_time["velocity"].relative > 0.1
    assert by_event["velocity"].relative < 1e-6
    assert by_event["position"].relative < 1e-4, "positions must count from the first common instant"
    assert apart(runs["slower"], runs["reference"], "chassis.speed=1.5")["velocity"].relative > 0.02


def test_the_same_way_at_another_pace_is_the_same_along_it(runs):
    assert apart(runs["slower"], runs["reference"], "time")["pitch"].relative > 0.1
    assert apart(runs["slower"], runs["reference"], "travel")["pitch"].relative < 2e-3
    assert apart(runs["nods"], runs["reference"], "travel")["pitch"].relative == pytest.approx(0.04, rel=0.1)


def test_windows_count_in_what_runs_are_compared_along(runs):
    errors = apart(runs["nods"], runs["reference"], "travel", Window(2.0, 4.0))
    x = np.linspace(2.0, 4.0, 1000)
    assert errors["pitch"].absolute == pytest.approx(0.004 * np.sqrt(np.mean(np.sin(3.0 * x) ** 2)), rel=0.05)
    with pytest.raises(LookupError):
        apart(runs["nods"], runs["reference"], "travel", Window(50.0, 60.0))
