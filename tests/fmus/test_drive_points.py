"""Sprocket drive with points over time, and with the torque curve of an engine."""

import numpy as np
import pytest
from drive_probe import RAMP, J, Probe, half_cosine

from fmus.interface.model import InvalidParameter

POINTS = "0.5 0; 1.5 8; 2.25 -4; 3 -4"


def test_speed_and_angle_of_points_are_exact_at_any_step():
    """Speed and angle of points are exact at any step; a point that is 0.01 s later shows.

    The exact areas are triangles and trapezoids.
    """
    areas = {1.0: 1.0, 1.5: 4.0, 2.0: 6.0, 3.5: 6.0 - 0.5 - 5.0}
    speeds = {1.0: 4.0, 1.5: 8.0, 2.0: 0.0, 3.5: -4.0}
    for h in (1e-3, 0.05, 0.25, 0.5):
        for time, area in areas.items():
            probe = Probe(**{"speed.points": POINTS}).run(time, h)
            assert probe["speed"] == pytest.approx(speeds[time], abs=1e-11)
            assert probe["angle"] == pytest.approx(area, abs=1e-11)
    twin = Probe(**{"speed.points": POINTS.replace("1.5", "1.51")}).run(2.0)
    assert abs(twin["angle"] - areas[2.0]) > 1e-2


def test_points_on_a_ramp_turn_as_the_ramp_does():
    times = np.linspace(2.0, 6.0, 401)
    points = "; ".join(f"{t!r} {v!r}" for t, v in zip(times.tolist(), half_cosine(times).tolist(), strict=True))
    probe, ramp = Probe(**{"speed.points": points}), Probe(**RAMP)
    for time in (3.0, 5.0, 7.0):
        assert probe.run(time - probe.t)["angle"] == pytest.approx(ramp.run(time - ramp.t)["angle"], rel=1e-4)
        assert probe["energy.work"] == pytest.approx(ramp["energy.work"], rel=1e-4)


def test_torque_and_brake_of_points():
    """Torque that rises linearly gives a parabola of speed; a brake given by points stops the sprocket."""
    probe = Probe(mode="torque", **{"torque.points": "0 0; 1 300; 1.001 0"}).run(1.0)
    assert probe["speed"] == pytest.approx(150.0 / J, rel=1e-9)
    assert probe["energy.work"] == pytest.approx(0.5 * J * (150.0 / J) ** 2, rel=1e-9)
    braked = Probe(mode="torque", **{"speed.start": 4.0, "brake.points": "0 0; 1 0; 1.001 500"}).run(1.0)
    assert braked["speed"] == pytest.approx(4.0, abs=1e-12)
    assert abs(braked.run(1.0)["speed"]) < 1e-3


@pytest.mark.parametrize(
    ("given", "sentence"),
    [
        ({"speed.points": "1 2; 1 3"}, "its times must rise"),
        ({"speed.points": "1 2 3"}, "must be 'time value; time value; ...'"),
        ({"speed.points": "fast"}, "must be 'time value; time value; ...'"),
        ({"torque.points": "0 nan"}, "must be finite numbers"),
        ({"brake.points": "0 -1"}, "must not be negative"),
        ({"speed.points": POINTS, "stop.start": 9.0}, "exclude each other"),
    ],
)
def test_points_that_are_none_are_a_sentence(given, sentence):
    with pytest.raises(InvalidParameter, match=sentence):
        Probe(**given)


@pytest.mark.parametrize(("ratio", "agrees"), [(4.0, True), (4.1, False)])
def test_an_engine_with_a_falling_curve_takes_the_sprocket_to_its_speed(ratio, agrees):
    """An engine with a linearly falling curve has the closed form w = w0/r (1 - exp(-t/tau)).

    T = r T0 (1 - r w / w0) and tau = J w0 / (r^2 T0).
    """
    full, top = 200.0, 100.0
    probe = Probe(
        mode="torque", **{"torque.drive": 1e6, "engine.points": f"0 {full}; {top} 0", "gear.ratio": ratio}
    ).run(0.3)
    tau = J * top / (16.0 * full)
    speed = top / 4.0 * (1.0 - np.exp(-0.3 / tau))
    assert (abs(probe["speed"] / speed - 1.0) < 1e-6) == agrees
    backwards = Probe(
        mode="torque", **{"torque.drive": -1e6, "engine.points": f"0 {full}; {top} 0", "gear.ratio": ratio}
    ).run(0.3)
    assert backwards["speed"] == -probe["speed"]
    assert probe["power"] == pytest.approx(probe["torque"] * probe["speed"], rel=2e-3)


def test_a_controller_has_no_more_than_its_engine():
    engine = {"engine.points": "0 50; 40 50; 80 0", "gear.ratio": 2.0}
    profile_ = {"speed.end": 30.0, "ramp.end": 0.01}
    probe = Probe(mode="controller", **profile_, **engine).run(1.0)
    assert probe["torque"] == pytest.approx(100.0, rel=1e-9)  # w < 20 rad/s: the constant part
    assert probe["speed"] == pytest.approx(100.0 / J, rel=1e-3)
    assert Probe(mode="controller", **profile_).run(1.0)["speed"] > 2.0 * probe["speed"]


@pytest.mark.parametrize(
    ("parameters", "said"),
    [
        ({"engine.points": "0 5"}, "engine.points needs mode 'torque' or 'controller'"),
        ({"engine.points": "0 -5", "mode": "torque"}, "engine.points = '0 -5' must not be negative"),
        ({"gear.ratio": 0.0}, "gear.ratio = 0: must be greater than 0"),
    ],
)
def test_an_engine_that_cannot_be_is_refused(parameters, said):
    with pytest.raises(InvalidParameter, match=said):
        Probe(**parameters)
