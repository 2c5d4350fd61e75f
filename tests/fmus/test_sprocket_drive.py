"""Sprocket drive: exact profiles and spins, order, start, errors."""

import numpy as np
import pytest
from drive_probe import MODES, PLACE, RAMP, J, Probe, half_cosine, turning
from scipy.integrate import quad
from scipy.spatial.transform import Rotation

from fmus.drives.motor import motor_torque, speed_profile, speed_profile_slope
from fmus.drives.mount import WIDTH
from fmus.drives.shaft import ANGLE, INTEGRATED, RATE, integrate_spin
from fmus.interface.model import InvalidParameter, StepFailed


@pytest.mark.parametrize("t", [1.0, 2.5, 4.0, 5.9, 6.5, 7.001, 7.02, 7.04, 7.1])
def test_angle_speed_and_slope_of_a_profile_are_derivatives(t):
    """Speed and slope of a profile are derivatives, in the ramp, between, in the stop and after it.

    With a stop that is 3 % longer they are not.
    """
    stop = {"stop.start": 7.0, "stop.time": 0.05}
    p, d = Probe(**RAMP, **stop).model.drive, 1e-5
    (before, early), (after, late) = speed_profile(p, t - d), speed_profile(p, t + d)
    assert speed_profile(p, t)[0] == pytest.approx((late - early) / (2 * d), abs=2e-5)
    assert speed_profile_slope(p, t) == pytest.approx((after - before) / (2 * d), abs=2e-3)
    if 7.0 < t < 7.05:
        assert speed_profile_slope(p._replace(stop_time=0.0515), t) != pytest.approx(speed_profile_slope(p, t), abs=0.5)


# --- exact solutions ---


@pytest.mark.parametrize("h", [1e-3, 0.1, 0.7])
def test_prescribed_speed_and_angle_are_exact_at_any_step(h):
    probe = Probe(**RAMP, **{"start.angle": 0.3})
    for _ in range(round(7 / h)):
        probe.step(h)
        if probe.t % 0.5 < h:
            turned = quad(half_cosine, 0.0, probe.t, points=[p for p in (2.0, 6.0) if p < probe.t], epsabs=1e-12)[0]
            assert probe["speed"] == pytest.approx(half_cosine(probe.t), abs=1e-11)
            assert probe["angle"] == pytest.approx(0.3 + turned, abs=1e-10)
    x_axis = Rotation.from_quat(probe["sprocket.orientation"], scalar_first=True).apply([1, 0, 0])
    assert np.allclose(x_axis, [np.cos(probe["angle"]), 0, -np.sin(probe["angle"])], rtol=0, atol=1e-9)
    assert np.allclose(probe["sprocket.angular_velocity"], [0, 20, 0], rtol=0, atol=1e-12)
    assert probe["angle"] != pytest.approx(0.3 + 1.01 * turned, abs=1e-3)


def test_a_stop_is_a_half_cosine_too():
    """A stop is a half cosine; speed and angle are exact at steps that end within it or pass over it."""

    def end(time, h):
        probe = Probe(**RAMP, **{"stop.start": 6.5, "stop.time": 0.2})
        return probe.run(time, h)["speed"], probe["angle"]

    way = 20.0 * (0.5 * 4.0 + 0.5)
    assert end(6.6, 0.1) == pytest.approx((10.0, way + 20.0 * (0.05 + 0.1 / np.pi)), rel=1e-9)
    assert end(7.5, 0.5) == pytest.approx((0.0, way + 20.0 * 0.1), rel=1e-9, abs=1e-12)
    assert end(7.5, 0.5)[1] != pytest.approx(way + 20.0 * 0.11, rel=1e-3)
    with pytest.raises(InvalidParameter, match="must not be before"):
        Probe(**RAMP, **{"stop.start": 5.0})


def test_prescribed_speed_needs_the_torque_that_the_chain_takes_and_the_spin_keeps():
    probe = Probe(**RAMP).run(4.0)
    speeds = half_cosine(np.array([3.999, 4.0]))
    assert probe["torque"] == pytest.approx(J * np.diff(speeds)[0] / 1e-3, rel=1e-9)
    assert probe["torque"] == pytest.approx(J * 20 * np.pi / 8, rel=1e-6)
    probe.step(1e-3, chain=(0, -7000.0, 0))
    assert probe["torque"] == pytest.approx(7000 + J * 20 * np.pi / 8, rel=1e-6)
    assert probe["mount.torque"][1] == pytest.approx(-7000 - J * 20 * np.pi / 8, rel=1e-6)


def test_motor_work_in_prescribed_speed():
    probe = Probe(**RAMP).run(8.0, chain=(0, -525.0, 0))
    turned = 20 * 2.0 + 20 * 2.0
    assert probe["energy.work"] == pytest.approx(525 * turned + 0.5 * J * 20**2, rel=1e-9)
    assert probe["energy.kinetic"] == pytest.approx(0.5 * J * 20**2, rel=1e-12)


def test_constant_torque_spins_up_linearly():
    probe = Probe(mode="torque", **{"torque.drive": 300.0}).run(0.5, chain=(0, -20.0, 0))
    rate = 280.0 / J
    assert probe["speed"] == pytest.approx(rate * 0.5, rel=1e-12)
    assert probe["angle"] == pytest.approx(rate * 0.125, rel=1e-12)
    assert probe["torque"] == pytest.approx(300.0, rel=1e-14)
    assert probe["energy.work"] == pytest.approx(300 * rate * 0.125, rel=1e-12)
    twin = Probe(1.02 * J, mode="torque", **{"torque.drive": 300.0}).run(0.5, chain=(0, -20.0, 0))
    assert twin["speed"] != pytest.approx(rate * 0.5, rel=1e-2)


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize("fade", [0.1, 1e-3])
def test_brake_against_its_closed_form(sign, fade):
    """The brake follows its closed form: J w' = -B w / sqrt(w^2 + e^2).

    Its integral is sqrt(w^2 + e^2) - e asinh(e / w).
    """
    brake = {"mode": "torque", "brake.torque": 500.0, "brake.speed": fade, "speed.start": sign * 4.0}
    probe = Probe(**brake)
    probe.model.initialise(brake)

    def integral(w):
        return np.hypot(w, fade) - fade * np.arcsinh(fade / abs(w))

    for _ in range(4):
        probe.run(0.025)
        assert sign * probe["speed"] > 0
        assert integral(4.0) - integral(probe["speed"]) == pytest.approx(500 / J * probe.t, rel=1e-6)
        assert integral(4.0) - integral(probe["speed"]) != pytest.approx(510 / J * probe.t, rel=1e-2)
    probe.run(1.0)
    assert abs(probe["speed"]) < 1e-6  # it stops and does not oscillate
    assert probe["energy.dissipated"] == pytest.approx(0.5 * J * 16, rel=1e-6)


def test_driven_against_the_brake_it_creeps_at_the_speed_that_fades_it():
    probe = Probe(mode="torque", **{"torque.drive": 300.0, "brake.torque": 500.0}).run(1.0)
    assert probe["speed"] == pytest.approx(0.1 * 0.6 / 0.8, rel=1e-9)  # w / sqrt(w^2 + e^2) = 300 / 500


def test_controller_under_a_load_is_a_damped_oscillator():
    """The controller under a constant chain torque is a damped oscillator, J w' = c - P w - I theta."""
    P, K, c = 60.0, 900.0, -100.0
    gains = {"controller.proportional": P, "controller.integral": K}
    probe = Probe(mode="controller", **gains).run(0.3, chain=(0, c, 0))
    decay = P / (2 * J)
    wave = np.sqrt(K / J - decay**2)
    assert probe["speed"] == pytest.approx(c / (J * wave) * np.exp(-decay * 0.3) * np.sin(wave * 0.3), rel=1e-6)
    settled = probe.run(8.0, chain=(0, c, 0))
    assert settled["torque"] == pytest.approx(100.0, rel=1e-6)
    assert settled["angle"] == pytest.approx(c / K, rel=1e-6)
    twin = Probe(mode="controller", **{**gains, "controller.integral": 1.03 * K}).run(0.3, chain=(0, c, 0))
    assert twin["speed"] != pytest.approx(c / (J * wave) * np.exp(-decay * 0.3) * np.sin(wave * 0.3), rel=1e-3)


def test_controller_keeps_its_limit_and_does_not_wind_up():
    jump = {"mode": "controller", "speed.end": 30.0, "ramp.end": 0.0, "torque.limit": 400.0}
    gains = {"controller.proportional": 300.0, "controller.integral": 600.0}
    probe, speeds, torques = Probe(**jump, **gains), [], []
    for _ in range(4000):
        probe.step(1e-3)
        speeds.append(probe["speed"])
        torques.append(probe["torque"])
    assert max(np.abs(torques)) <= 400.0 * (1 + 1e-12)
    assert speeds[500] == pytest.approx(400 / J * 0.501, rel=1e-2)  # at the torque limit
    assert speeds[-1] == pytest.approx(30.0, abs=1e-2)
    # an integral without anti-windup would hold 30/2 rad s x 600 = 9 kN m at 1 s and overshoot the target
    assert max(speeds) < 30.0 * 1.1


@pytest.mark.parametrize(("limit", "agrees"), [(400.0, True), (412.0, False), (1e4, False)])
@pytest.mark.parametrize("asked", [{"torque.drive": -900.0}, {"torque.points": "0 -900; 1 -900"}])
def test_a_limit_bounds_the_torque_that_the_motor_gives(asked, limit, agrees):
    """J w = (T + brake) t with a brake that is no part of the limit; what is cut is told once."""
    probe = Probe(mode="torque", **asked, **{"torque.limit": limit, "brake.torque": 100.0, "brake.speed": 1e-3})
    for _ in range(100):
        probe.step(1e-3)
    assert (probe["torque"] == pytest.approx(-400.0, rel=1e-12)) == agrees
    assert (probe["speed"] == pytest.approx(-300.0 * 0.1 / J, rel=1e-3)) == agrees
    said = ["the torque -900 N m of the motor is beyond torque.limit = " in text for text in probe.model.warnings()]
    assert said == [True] * (limit < 900.0)


@pytest.mark.parametrize(
    ("error", "integral", "torque", "rate"),
    [(1.0, 1.0, 400.0, 0.0), (-1.0, 2.0, 400.0, -1.0), (1.0, -2.0, -400.0, 1.0), (0.1, 0.1, 90.0, 0.1)],
)
def test_a_limited_controller_stops_integrating_only_what_would_exceed_the_limit(error, integral, torque, rate):
    """At the limit the integral stands still while the error would raise it, and follows an error that lowers it."""
    gains = {"controller.proportional": 300.0, "controller.integral": 600.0}
    drive = Probe(mode="controller", **{"speed.end": 30.0, "ramp.end": 0.0, "torque.limit": 400.0}, **gains).model.drive
    assert motor_torque(drive, 1.0, 30.0 - error, integral) == pytest.approx((torque, rate))


@pytest.mark.parametrize("mode", ["torque", "controller"])
def test_spin_converges_at_order_four(mode):
    probe = Probe(
        mode=mode, **{"torque.drive": 400.0, "brake.torque": 300.0, "brake.speed": 2.0, "speed.end": 9.0},
        **{"controller.proportional": 200.0, "controller.integral": 900.0},
    )  # fmt: skip

    def end(steps):
        x = np.zeros(WIDTH)
        integrate_spin(probe.model.drive, x, 0.0, 0.4, steps, -30.0, 0.2, -0.1)
        return x[:INTEGRATED].copy()

    exact = end(2048)
    errors = [np.linalg.norm(end(n) - exact) for n in (32, 64, 128)]
    slopes = np.log2(np.divide(errors[:-1], errors[1:]))
    assert np.all(np.abs(slopes - 4.0) < 0.25), slopes


# --- start and manners ---

POSE = {"start.heading": 0.7, "start.position.x": 3.0, "start.position.z": 0.5}
AT_POSE = Rotation.from_rotvec([0, 0, 0.7]).apply(PLACE) + np.array([3.0, 0.0, 0.5])


def test_start_comes_from_parameters_never_from_inputs():
    probe = Probe(**POSE, **{"start.angle": 0.4, "speed.start": 2.0})
    probe.u[:3] = 9.0
    pose = Rotation.from_rotvec([0, 0, 0.7]) * Rotation.from_rotvec([0, 0.4, 0])
    assert np.allclose(probe["sprocket.position"], AT_POSE, rtol=0, atol=1e-15)
    assert np.allclose(probe["sprocket.orientation"], pose.as_quat(scalar_first=True), rtol=0, atol=1e-15)
    assert np.allclose(probe["sprocket.angular_velocity"], 2 * probe.axis, rtol=0, atol=1e-14)
    assert probe["speed"] == 2.0
    assert probe["angle"] == 0.4
    assert not np.any(probe["mount.torque"])


def test_an_unconnected_mount_stands_still_at_the_start_pose():
    probe = Probe(**POSE, **RAMP).run(0.01)
    assert np.allclose(probe["sprocket.position"], AT_POSE, rtol=0, atol=1e-15)
    starts = {port.name: port.start for port in probe.model.ports}
    assert [starts[f"mount.position.{axis}"] for axis in "xyz"] == list(PLACE)


def test_heading_changes_nothing():
    def driven(heading):
        turn = Rotation.from_rotvec([0, 0, heading])
        probe = Probe(**MODES["controller"], **{"start.heading": heading})
        wobble = turning(turn.apply([0.3, -0.5, 0.1]), start=(0, 0, heading))
        probe.run(0.2, mount=wobble, chain=turn.apply([30.0, -350.0, 90.0]))
        return [probe["speed"], probe["torque"], probe["energy.work"], *turn.inv().apply(probe["mount.torque"])]

    assert np.allclose(driven(0.0), driven(np.radians(37)), rtol=1e-11, atol=1e-9)


def test_both_directions_are_alike():
    def driven(sign):
        parameters = {**MODES["torque"], "torque.drive": sign * 700.0, "speed.start": sign * 3.0}
        return Probe(**parameters).run(0.2, chain=(0, -sign * 350.0, 0))

    forward, back = driven(1), driven(-1)
    assert forward["speed"] == -back["speed"]
    assert forward["energy.work"] == back["energy.work"]


def test_saving_is_copying_the_state():
    probe = Probe(**MODES["controller"], extrapolation="acceleration")
    mount = turning([0.3, -0.5, 0.8])
    probe.run(0.05, mount=mount, chain=(0, -90.0, 5.0))
    saved, t = probe.model.state.copy(), probe.t
    first = probe.run(0.05, mount=mount, chain=(0, -90.0, 5.0)).model.state.copy()
    probe.model.state[:], probe.t = saved, t
    assert np.array_equal(probe.run(0.05, mount=mount, chain=(0, -90.0, 5.0)).model.state, first)


def test_cost_in_evaluations():
    probe = Probe(mode="torque", **{"brake.torque": 500.0, "brake.speed": 0.01}).run(0.01)
    steps = int(np.ceil(2 * 1e-3 * 500 / (0.01 * J)))  # each step is half a time constant of the brake
    assert list(probe.model.counters) == [10 * steps, 40 * steps]


@pytest.mark.parametrize(
    ("parameters", "words"),
    [
        ({"mode": "fast"}, "mode = 'fast': must be one of speed, torque, controller"),
        ({"extrapolation": "none"}, "extrapolation"),
        ({"brake.torque": -1.0}, "brake.torque"),
        ({"brake.speed": 0.0}, "brake.speed"),
        ({"torque.limit": -5.0}, "torque.limit"),
        ({"ramp.start": 2.0, "ramp.end": 1.0}, "ramp.end"),
        ({"speed.end": np.nan}, "speed.end"),
    ],
)
def test_bad_parameters_are_refused(parameters, words):
    with pytest.raises(InvalidParameter, match=words):
        Probe(**parameters)


def test_a_drive_needs_inertia():
    with pytest.raises(InvalidParameter, match="inertia"):
        Probe(0.0)


@pytest.mark.parametrize(
    ("index", "value", "words"),
    [(13, np.nan, "sprocket.force.x"), (2, np.inf, "mount.position.z"), (slice(3, 7), 0.0, "mount.orientation")],
)
def test_absurd_inputs_fail_with_a_sentence(index, value, words):
    probe = Probe(mode="torque")
    probe.run(0.01)
    before = probe.model.state.copy()
    probe.u[index] = value
    with pytest.raises(StepFailed, match=f"t = 0.01 s.*{words}"):
        probe.model.step(probe.t, 1e-3, probe.u)
    assert np.array_equal(probe.model.state, before)


def test_a_brake_too_sharp_is_refused():
    probe = Probe(mode="torque", **{"brake.torque": 1e6, "brake.speed": 1e-6})
    with pytest.raises(StepFailed, match=r"brake\.speed"):
        probe.step(1e-3)


def test_a_jump_of_the_clock_is_no_jump_of_the_speed():
    """A drive whose first step is at t = 5 s begins with the profile's speed there, without an impulse."""
    probe = Probe(**RAMP)
    probe.t = 5.0
    probe.step(1e-3)
    assert probe["torque"] == pytest.approx(J * np.diff(half_cosine(np.array([5.0, 5.001])))[0] / 1e-3, rel=1e-9)
    assert probe.model.state[RATE] == pytest.approx(half_cosine(5.001))
    assert probe.model.state[ANGLE] < 0.1
