"""Driver: paths in closed form, pure pursuit against linear theory, learnt slip, demands."""

import numpy as np
import pytest
from unicycle import H, Unicycle

from fmus.driver import path
from fmus.interface.profile import evaluate
from fmus.sprocket_drive.model import Model as SprocketDrive
from fmus.steering_differential.model import Model as SteeringDifferential

PLAIN = {"friction": 0.0, "drive.lag": 0.0, "yaw.gain": 0.0, "yaw.integral": 0.0, "preview": 0.0, "reach": 3.0,
         "speed.start": 2.0, "speed.end": 2.0}  # fmt: skip


def test_four_quarters_of_a_circle_close_and_points_beside_it_are_found():
    quarter = 0.5 * np.pi * 5.0
    circle = path.path_of_arcs("path.arcs", f"{quarter} 0.2; " * 4)
    assert np.allclose(path.point(circle, 0, circle.length)[:3], (0.0, 0.0, 2.0 * np.pi), atol=1e-12)
    for angle in np.linspace(0.1, 6.0, 13):
        for off in (-2.0, 0.0, 1.5):
            at = (5.0 - off) * np.sin(angle), 5.0 - (5.0 - off) * np.cos(angle)
            assert np.allclose(path.nearest(circle, 0, *at, 5.0 * angle - 0.8), (5.0 * angle, off), atol=1e-8)
    assert not np.allclose(path.path_of_arcs("", f"{quarter} 0.204; " * 4).heading[-1], circle.heading[-1], atol=1e-2)


def test_beyond_its_ends_a_path_is_straight():
    arc = path.path_of_arcs("path.arcs", "5 0.2")
    x, y, heading, _ = path.point(arc, 0, 5.0)
    assert np.allclose(path.point(arc, 0, 7.0), (x + 2 * np.cos(heading), y + 2 * np.sin(heading), 1.0, 0.0))
    assert np.allclose(path.point(arc, 0, -2.0), (-2.0, 0.0, 0.0, 0.0))


def test_a_path_through_points_of_a_circle_is_that_circle():
    """A path through points of a circle is that circle to the third order of their distance.

    The ends are excluded, where a natural spline has no curvature.
    """
    worst = []
    for n in (41, 81):
        angle = np.linspace(0.0, 3.0, n)
        text = "; ".join(f"{8 * np.sin(a)} {8 - 8 * np.cos(a)}" for a in angle)
        curve = path.path_through_points("path.points", text)
        middle = slice(len(curve.s) // 4, 3 * len(curve.s) // 4)
        assert np.allclose(curve.curvature[middle], 0.125, atol=1e-4)
        worst.append(abs(np.hypot(curve.x, curve.y - 8.0)[middle] - 8.0).max())
        assert curve.length == pytest.approx(24.0, rel=1e-4)
    assert worst[0] < 1e-5
    assert worst[1] < worst[0] / 8.0


@pytest.mark.long
@pytest.mark.parametrize(("reach", "agrees"), [(3.0, True), (3.2, False)])
def test_a_small_error_decays_as_the_linear_theory_says(reach, agrees):
    """A small error decays as the linear theory says: e'' + 2 a e' + a^2 e = 0, a = v/L.

    Its solution is e = e0 exp(-a t) (1 + a t).
    """
    run = Unicycle(left=0.01, **{**PLAIN, "path.arcs": "100 0", "reach": reach}).run(4.0)
    at = 2.0 / 3.0 * H * (np.arange(len(run.shown)) - 0.5)  # demands belong to the middle of a step
    theory = 0.01 * np.exp(-at) * (1.0 + at)
    assert (abs(run["path.lateral_error"] - theory)[1:].max() < 5e-5) == agrees


def test_slip_is_learnt():
    """A vehicle that turns by 0.77 of its demand follows a curve only with the integral part."""
    settings = {**PLAIN, "path.arcs": "60 0.1"}
    assert abs(Unicycle(1.3, **settings).run(12.0)["path.lateral_error"][-1]) > 0.05
    learnt = Unicycle(1.3, **{**settings, "yaw.gain": 1.0, "yaw.integral": 1.0}).run(14.0)
    assert abs(learnt["path.lateral_error"][-1]) < 3e-3


@pytest.mark.parametrize(("gain", "agrees"), [(1.0, True), (1.03, False)])
def test_a_heading_is_held(gain, agrees):
    run = Unicycle(**{**PLAIN, "heading": 0.1, "heading.gain": gain}).run(3.0)
    theory = -0.1 * np.exp(-H * (np.arange(len(run.shown)) - 0.5))
    assert (abs(run["path.heading_error"] - theory)[1:].max() < 3e-4) == agrees


@pytest.mark.parametrize("off", [1.0, -3.0])
def test_it_comes_back_from_afar_and_says_how_far_it_was(off):
    settings = {"friction": 0.0, "path.arcs": "200 0", "speed.start": 3.0, "speed.end": 3.0}
    run = Unicycle(left=1.01 * off, **settings).run(12.0)
    assert run["path.lateral_error"][0] == 0.0  # from the hull at rest, before the first motion
    assert abs(run["path.lateral_error"][1]) == pytest.approx(abs(1.01 * off), rel=1e-2)
    assert abs(run["path.lateral_error"][-1]) < 5e-3
    assert [len(run.model.warnings()) for _ in range(2)] == [1, 0]


def test_a_path_is_approached_along_a_line_through_its_beginning():
    """A vehicle behind a path approaches its beginning along a line; exactly behind it the error is 0."""
    way = path.path_of_arcs("path.arcs", "5 0")
    for left in (4.0, -4.0, 1e-17, 0.0):
        assert path.nearest(way, 0, -3.0, left, 1.0) == (0.0, left)
    settings = {**PLAIN, "yaw.gain": 1.0, "reach": 2.0}
    run = Unicycle(**{**settings, "path.points": "8 0; 40 0"}).run(3.0)
    assert abs(run["path.lateral_error"]).max() < 1e-9
    assert abs(Unicycle(left=0.01, **{**settings, "path.points": "8 0; 40 0"}).run(3.0)["yaw_rate.demand"]).max() > 1e-4


def test_a_path_goes_back_along_its_arcs_and_turns_on_the_spot():
    there = path.path_of_arcs("path.arcs", "5 0.2; -5 0.2; 0 0.5; -2 0")
    assert there.first.tolist() == [0, 1, 2, 3, 4]
    assert there.length == pytest.approx(12.0)
    assert np.allclose(path.point(there, 1, 10.0)[:3], (0.0, 0.0, 0.0), atol=1e-12)
    assert np.allclose(path.point(there, 1, 5.0), path.point(there, 0, 5.0), atol=1e-12)
    assert np.allclose(path.point(there, 3, 12.0)[:3], (-2.0 * np.cos(0.5), -2.0 * np.sin(0.5), 0.5), atol=1e-12)
    way, left = path.nearest(there, 3, -np.cos(0.5) - np.sin(0.5), np.cos(0.5) - np.sin(0.5), 10.0)
    assert (way, left) == (pytest.approx(11.0), pytest.approx(1.0))


@pytest.mark.parametrize("angle", [3.0, -3.0])
def test_a_turn_on_the_spot_keeps_both_tracks_to_the_speed(angle):
    run = Unicycle(**{**PLAIN, "path.arcs": f"0 {angle}", "speed.start": 0.2, "speed.end": 0.2}).run(4.0)
    most = abs(run["yaw_rate.demand"]).max()
    assert most == pytest.approx(2.0 * 0.2 / run.width, rel=1e-9)


@pytest.mark.parametrize(
    ("way", "speeds"), [("hold", (0.0, 0.0, 3.0, 3.0, 1.0)), ("linear", (3.0, 3.0, 3.0, 2.0, 1.0))]
)
def test_speeds_that_are_commands_jump(way, speeds):
    """Of the time of a command its speed counts already, and the one before just before it."""
    run = Unicycle(**{**PLAIN, "speed.points": "0.5 3; 1.5 1", "interpolation": way})
    law = run.model.parts.law.speeds
    assert [evaluate(law, t)[0] for t in (0.0, 0.5 - 1e-9, 0.5, 1.0, 1.5)] == pytest.approx(speeds, abs=1e-6)


def demanded(mode="speed", inputs=True, **parameters):
    drive = {"inertia": 13.87, "mount": [0.0, 1.0795, 0.0], "demanded": inputs}
    model = SprocketDrive({"drive": drive})
    model.initialise({"mode": mode, **parameters})
    return model


@pytest.mark.parametrize(("lag", "agrees"), [(0.1, True), (0.103, False)])
def test_the_speed_of_a_drive_follows_its_demand_at_any_step(lag, agrees):
    names = [port.name for port in demanded().ports if port.causality == "output"]
    speed = names.index("speed")
    for h in (1e-3, 4e-3, 20e-3):
        model, y = demanded(**{"demand.lag": lag}), np.zeros(27)
        u = np.array([port.start for port in model.ports if port.causality == "input"])
        assert [port.name for port in model.ports][len(u) - 1] == "speed.demand"
        u[-1] = 7.0
        for k in range(round(0.2 / h)):
            model.step(k * h, h, u)
        model.outputs(y)
        assert (abs(y[speed] - 7.0 * (1.0 - np.exp(-2.0))) < 1e-12) == agrees


@pytest.mark.parametrize(("lag", "agrees"), [(0.1, True), (0.103, False)])
def test_the_torque_of_a_drive_follows_its_demand(lag, agrees):
    """T (1 - exp(-t / lag)) at any step, on a rotor without a brake; never beyond the limit."""
    for h, wanted, torque in ((1e-3, 700.0, 700.0), (4e-3, 700.0, 700.0), (4e-3, -9e9, -1000.0)):
        model, y = demanded("torque", [""], **{"demand.lag": lag, "torque.limit": 1000.0}), np.zeros(27)
        ports = [port.name for port in model.ports if port.causality == "input"]
        assert ports[-2:] == ["speed.demand", "torque.demand"]
        u = np.array([port.start for port in model.ports if port.causality == "input"])
        u[-2:] = 50.0, wanted
        n = round(0.2 / h)
        for k in range(n):
            model.step(k * h, h, u)
        model.outputs(y)
        assert len(model.warnings()) == (wanted < 0.0)
        ends = torque * (1.0 - np.exp(-np.arange(n + 1) * h / 0.1))
        impulse = 0.5 * h * (ends[1:] + ends[:-1]).sum()
        assert (abs(y[21] / (0.5 * (ends[-2] + ends[-1])) - 1.0) < 1e-12) == agrees
        assert (abs(y[19] / (impulse / 13.87) - 1.0) < 1e-12) == agrees


def test_a_differential_follows_torques():
    """The steering motor alone turns the sprockets against each other, propulsion alone both alike."""
    config = {"inertia": 13.87, "mount": [0.0, 1.0795, 0.0], "demanded": ["propulsion.", "steering."]}
    for demand, of_sides in (("propulsion", [1.0, 1.0]), ("steering", [-1.0, 1.0])):
        model = SteeringDifferential({"drive": config})
        model.initialise({"propulsion.mode": "torque", "steering.mode": "torque"})
        names = [port.name for port in model.ports]
        outputs = [port.name for port in model.ports if port.causality == "output" and isinstance(port.start, float)]
        u, y = np.array([port.start for port in model.ports[: model.inputs]]), np.zeros(len(outputs))
        u[names.index(f"{demand}.torque.demand")] = 500.0
        for k in range(100):
            model.step(k * 1e-3, 1e-3, u)
        model.outputs(y)
        speeds = np.array([y[outputs.index(f"{side}.speed")] for side in ("left", "right")])
        assert speeds / speeds[1] == pytest.approx(of_sides, rel=1e-12)
        assert y[outputs.index(f"{demand}.work")] == pytest.approx(13.87 * speeds[1] ** 2, rel=1e-5)
