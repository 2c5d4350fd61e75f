"""Hitch and seats of a chassis: momentum, work, load over time and speed, accelerations of prescribed motions."""

import numpy as np
import pytest
from chassis_probe import TABLE, Probe, stir
from test_chassis_conservation import momenta

from fmus.chassis.model import Model
from fmus.interface.model import InvalidParameter

HITCH = np.array([TABLE["hitch"]["x"], 0.0, TABLE["hitch"]["z"]]) - TABLE["chassis"]["centre"]
SEAT = np.array(TABLE["seat"]["driver"]["position"]) - TABLE["chassis"]["centre"]
AT_ONCE = {"hitch.load.ramp.start": 0.0, "hitch.load.ramp.end": 0.0}


def fitted(changes=None, **parameters):
    """A chassis that tows and shows its driver's seat, in free air without gravity."""
    return Probe({"gravity": 0.0, **(changes or {})}, config={"hitch": True, "seats": ["driver"]}, **parameters)


# --- hitch ---


@pytest.mark.parametrize(("force", "torque", "reason"), [
    (15e3, 0.0, "because rest.* does not count the pull at its hitch"),
    (0.0, 9e3, "because rest.* does not count the torque of its drives"),
    (15e3, 9e3, "because rest.* does not count the pull at its hitch and the torque of its drives"),
    (100.0, 100.0, "because a number is another than that with which rest.* was found, or other tracks act on it"),
])  # fmt: skip
def test_a_start_without_equilibrium_names_the_loads_that_there_are(force, torque, reason):
    """Here the hull falls, for want of tracks."""
    arms = [0.0] * 6
    start = {"height": 0.0, "roll": 0.0, "pitch": 0.0, "left": arms, "right": arms}
    probe = Probe(config={"hitch": True, "seats": ["driver"], "start": start})
    probe["hitch.force.x"], probe["right.sprocket.torque.y"] = -force, -torque
    probe.run(2e-3, 1e-3)
    (warning,) = probe.model.warnings()
    assert warning.endswith(reason)


def test_a_force_on_the_hitch_changes_the_momenta_by_its_impulse_and_does_its_work():
    """A constant force accelerates the mass by F / M, turns it by its moment, and works F.d, whatever else moves."""
    probe = fitted()
    stir(probe.model)
    before, momentum, start = probe.energy, momenta(probe.model), probe["hitch.position"]
    force = np.array([3e4, -1e4, 2e4])
    for axis, each in zip("xyz", force, strict=True):
        probe[f"hitch.force.{axis}"] = each
    moment, h, steps = np.zeros(3), 1e-3, 200
    for k in range(steps):
        ends = 0.5 if k == 0 else 1.0
        moment += ends * h * np.cross(probe["hitch.position"], force)
        probe.run(h, h)
    moment += 0.5 * h * np.cross(probe["hitch.position"], force)
    gain = momenta(probe.model) - momentum
    np.testing.assert_allclose(gain[:3], 0.2 * force, rtol=1e-8)
    np.testing.assert_allclose(gain[3:], moment, rtol=1e-5)  # of the trapezoidal rule
    assert np.abs(gain[:3] - 0.2 * 1.01 * force).max() > 50.0
    work = force @ (probe["hitch.position"] - start)
    assert probe["energy.towed"] == pytest.approx(-work, rel=1e-8)
    assert probe["port.work"] == 0.0
    assert probe.energy + probe["energy.dissipated"] - before == pytest.approx(work, rel=1e-7)


@pytest.mark.parametrize("heading", [0.0, 2.0])
def test_a_constant_load_pulls_level_and_rearward(heading):
    """The load has no part up or across, also on a chassis that is pitched and turned."""
    probe = fitted(start__heading=heading, start__pitch=0.3, hitch__load__force=1e4, **AT_ONCE)
    probe.run(0.1)
    gain = momenta(probe.model)[:3]
    np.testing.assert_allclose(gain, -1e3 * np.array([np.cos(heading), np.sin(heading), 0.0]), atol=0.2)
    assert np.abs(gain[2]) < 1e-9 * 1e3
    assert probe["hitch.pull"] == 1e4


def test_a_load_follows_its_ramp_and_its_points():
    """The pull is the ramp's share of the constant force and the course over the speed of the hitch."""
    probe = fitted(
        hitch__load__force=500.0, hitch__load__points="-1 -100; 0 0; 2 4000; 3 4500",
        **{"hitch.load.ramp.start": 0.01, "hitch.load.ramp.end": 0.03},
    )  # fmt: skip
    probe.model.state[7] = 2.5
    for t, share in ((0.0, 0.0), (0.01, 0.0), (0.02, 0.5), (0.03, 1.0), (0.04, 1.0)):
        probe.run(t - probe.t)
        speed = probe["hitch.speed"]
        assert speed == pytest.approx(2.5, abs=0.1)
        over_speed = 4000.0 + 500.0 * (speed - 2.0)
        assert probe["hitch.pull"] == pytest.approx(share * (500.0 + over_speed), abs=1e-6)
    probe.model.state[7] = -7.0
    assert probe["hitch.pull"] == pytest.approx(500.0 - 100.0, abs=1e-6)


def test_work_on_a_load_is_its_pull_over_the_way():
    probe = fitted(hitch__load__points="0 0; 2 4000", **AT_ONCE)
    probe.model.state[7] = 1.0
    before, place, work = probe.energy, probe["hitch.position"][0], 0.0
    for _ in range(100):
        pull = probe["hitch.pull"]
        probe.run(1e-3)
        work += 0.5 * (pull + probe["hitch.pull"]) * (probe["hitch.position"][0] - place)
        place = probe["hitch.position"][0]
    assert probe["energy.towed"] == pytest.approx(work, rel=1e-5)
    assert work > 100.0
    assert probe.energy + probe["energy.dissipated"] - before == pytest.approx(-probe["energy.towed"], rel=1e-7)


def test_a_hitch_moves_as_its_point_of_the_hull():
    probe = fitted()
    x = stir(probe.model)
    A = probe.model.tree.rotation
    probe["hitch.speed"]  # computes the rotation
    np.testing.assert_allclose(probe["hitch.position"], x[:3] + A @ HITCH, rtol=1e-12)
    np.testing.assert_allclose(probe["hitch.velocity"], x[7:10] + A @ np.cross(x[10:13], HITCH), rtol=1e-12)
    assert probe["hitch.speed"] == pytest.approx(probe["hitch.velocity"] @ A[:, 0], rel=1e-12)


# --- seats ---

HEAVY = {"chassis.mass": 1e14, "chassis.inertia": (1e16, 1e16, 1e16)}  # wheels and arms do not disturb it


@pytest.mark.parametrize("axis", [(0.0, 0.0, 3.0), (0.0, -2.0, 0.0), (1.0, 2.0, -2.0)])
def test_a_seat_of_a_body_that_turns_is_accelerated_to_its_axis(axis):
    """The mean acceleration over a step is w x (w x r) in its middle, times sin(w h / 2) / (w h / 2)."""
    probe, w, h = fitted(HEAVY), np.array(axis), 0.02
    probe.model.state[10:13] = w
    probe.run(0.1, h)
    rate = np.linalg.norm(w)
    before, after = (_turned(w, rate * (probe.t - back)) for back in (h, 0.0))
    middle = _turned(w, rate * (probe.t - 0.5 * h)) @ SEAT
    expected = np.cross(w, np.cross(w, middle)) * np.sin(0.5 * rate * h) / (0.5 * rate * h)
    np.testing.assert_allclose(probe["seat.driver.acceleration"], expected, rtol=1e-7, atol=1e-7)
    np.testing.assert_allclose((after - before) @ SEAT @ w, 0.0, atol=1e-12)
    assert np.linalg.norm(np.cross(w, np.cross(w, middle)) - expected) > 1e-5  # the end of a step would differ
    np.testing.assert_allclose(probe["seat.driver.velocity"], np.cross(w, after @ SEAT), rtol=1e-7, atol=1e-7)


def _turned(w, angle):
    from scipy.spatial.transform import Rotation

    return Rotation.from_rotvec(w / np.linalg.norm(w) * angle).as_matrix()


def test_a_seat_in_free_fall_is_accelerated_by_gravity():
    probe = fitted({"gravity": 9.81})
    np.testing.assert_array_equal(probe["seat.driver.acceleration"], 0.0)  # at the start
    probe.run(0.01)
    np.testing.assert_allclose(probe["seat.driver.acceleration"], [0.0, 0.0, -9.81], atol=1e-9)


# --- refused ---


@pytest.mark.parametrize(
    ("config", "parameters", "said"),
    [
        ({"seats": ["gunner"]}, {}, "chassis.seats names 'gunner': the vehicle has driver"),
        ({"hitch": True}, {"hitch.load.ramp.start": 2.0}, "hitch.load.ramp.end = 1 s must not be before"),
        ({"hitch": True}, {"hitch.load.points": "1 2; 1 3"}, "its speeds must rise"),
        ({"hitch": True}, {"hitch.load.points": "1 2 3"}, "must be 'speed force; speed force; ...'"),
    ],
)
def test_what_cannot_be_is_refused(config, parameters, said):
    model = Model({"vehicle": TABLE, "chassis": {"sides": ["left", "right"], **config}})
    with pytest.raises(InvalidParameter, match=said.replace("(", r"\(")):
        model.initialise(parameters)


def test_a_vehicle_without_a_hitch_tows_nothing():
    with pytest.raises(InvalidParameter, match="the vehicle has no table hitch"):
        Model({"vehicle": {**TABLE, "hitch": None}, "chassis": {"sides": ["left", "right"], "hitch": True}})
