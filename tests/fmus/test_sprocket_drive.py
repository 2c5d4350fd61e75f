"""Sprocket drive: exact profiles and spins, points and engines, order, reactions on its mount."""

import numpy as np
import pytest
from drive_probe import MODES, PLACE, J, Probe, turning
from scipy.integrate import quad
from scipy.spatial.transform import Rotation

from fmus.drives.motor import motor_torque, speed_profile, speed_profile_slope
from fmus.drives.mount import WIDTH
from fmus.drives.shaft import ANGLE, INTEGRATED, RATE, ShaftStep, integrate_spin

RAMP = {"speed.end": 20.0, "ramp.start": 2.0, "ramp.end": 6.0}


def half_cosine(t):
    return 20.0 * 0.5 * (1 - np.cos(np.pi * np.clip((t - 2.0) / 4.0, 0.0, 1.0)))


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
    """A half cosine up from 2 s to 6 s and one down from 6.5 s to 6.7 s, in steps that end within or pass over them."""

    def speed(t):
        return half_cosine(t) - 10.0 * (1 - np.cos(np.pi * np.clip((t - 6.5) / 0.2, 0.0, 1.0)))

    probe = Probe(**RAMP, **{"start.angle": 0.3, "stop.start": 6.5, "stop.time": 0.2})
    for _ in range(round(7 / h)):
        probe.step(h)
        if probe.t % 0.5 < h:
            kinks = [p for p in (2.0, 6.0, 6.5, 6.7) if p < probe.t]
            turned = quad(speed, 0.0, probe.t, points=kinks or None, epsabs=1e-12)[0]
            assert probe["speed"] == pytest.approx(speed(probe.t), abs=1e-11)
            assert probe["angle"] == pytest.approx(0.3 + turned, abs=1e-10)
    assert probe["angle"] != pytest.approx(0.3 + 1.01 * turned, abs=1e-3)


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


COMMANDS = (0.125, 5.0), (0.5, 0.0), (0.75, -3.0)
HELD = {"speed.points": "; ".join(f"{t} {v}" for t, v in COMMANDS), "interpolation": "hold"}


def followed(t, lag):
    """Speed that follows COMMANDS, and its integral: the sum of the answers to steps (Duhamel)."""
    found = np.zeros(2)
    for (at, command), (_, before) in zip(COMMANDS, ((0.0, 0.0), *COMMANDS), strict=False):
        past = max(t - at, 0.0)
        rest = 1.0 - np.exp(-past / lag)
        found += (command - before) * np.array([rest, past - lag * rest])
    return found


def test_commands_hold_and_are_followed_exactly_at_any_step():
    """A first-order lag fed with steps; nothing before the first; a time constant 3 % longer shows."""
    for h in (1e-3, 0.05, 0.25):
        for time in (0.1, 0.4, 0.5, 0.65, 1.5):
            probe = Probe(**HELD, **{"demand.lag": 0.2}).run(time, h)
            speed, angle = followed(probe.t, 0.2)
            assert (probe["speed"], probe["angle"]) == pytest.approx((speed, angle), abs=1e-12)
    assert (probe["speed"], probe["angle"]) != pytest.approx(tuple(followed(probe.t, 0.206)), abs=1e-3)
    early = Probe(**HELD).run(0.12)
    assert (early["speed"], early["angle"], early["torque"]) == (0.0, 0.0, 0.0)
    p, d = probe.model.drive, 1e-6
    for t in (0.3, 0.6, 1.0):
        (before, _), (after, _) = speed_profile(p, t - d), speed_profile(p, t + d)
        assert speed_profile_slope(p, t) == pytest.approx((after - before) / (2.0 * d), rel=1e-6)


def test_held_points_turn_a_drive_as_the_same_demands_do():
    """Commands at the ends of steps, as points and through the input: the same speeds, by default with 0.1 s."""
    held, demanded = Probe(**HELD), Probe(demanded=True)
    for k in range(200):
        demanded.demand = [0.0, *(v for t, v in COMMANDS if t <= k * 5e-3 + 1e-9)][-1:]
        assert held.step(5e-3)["speed"] == pytest.approx(demanded.step(5e-3)["speed"], abs=1e-12)
    assert abs(held["speed"]) > 2.0


def test_torques_and_brakes_hold():
    """A torque from 0.5 s on: momentum is its integral; a brake that rises so stops the sprocket."""
    probe = Probe(mode="torque", **{"torque.points": "0.5 300", "interpolation": "hold"})
    probe.run(2.0)
    impulse = 300.0 * (1.5 - 0.1 * (1.0 - np.exp(-15.0)))
    assert probe["speed"] == pytest.approx(impulse / J, rel=1e-9)
    assert probe["speed"] != pytest.approx(300.0 * 1.5 / J, rel=0.05)
    braked = Probe(mode="torque", **{"speed.start": 4.0, "brake.points": "1 500", "interpolation": "hold"}).run(1.0)
    assert braked["speed"] == pytest.approx(4.0, abs=1e-12)
    assert abs(braked.run(1.0)["speed"]) < 1e-3


def test_torque_and_brake_of_points():
    """Torque that rises linearly gives a parabola of speed; a brake given by points stops the sprocket."""
    probe = Probe(mode="torque", **{"torque.points": "0 0; 1 300; 1.001 0"}).run(1.0)
    assert probe["speed"] == pytest.approx(150.0 / J, rel=1e-9)
    assert probe["energy.work"] == pytest.approx(0.5 * J * (150.0 / J) ** 2, rel=1e-9)
    braked = Probe(mode="torque", **{"speed.start": 4.0, "brake.points": "0 0; 1 0; 1.001 500"}).run(1.0)
    assert braked["speed"] == pytest.approx(4.0, abs=1e-12)
    assert abs(braked.run(1.0)["speed"]) < 1e-3


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


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize("h", [1e-3, 0.03])
def test_a_brake_stops_a_free_shaft_and_holds_it(sign, h):
    """J w' = -B until w = 0 at J w0 / B = 0.111 s, after the angle J w0^2 / (2 B), whatever the step."""
    probe = Probe(mode="torque", **{"brake.torque": 500.0, "speed.start": sign * 4.0})
    stop = 4.0 * J / 500.0
    for _ in range(round(0.15 / h)):
        probe.step(h)
        assert sign * probe["speed"] == pytest.approx(max(4.0 - 500.0 / J * probe.t, 0.0), abs=1e-12)
        if probe.t < stop:
            assert sign * probe["speed"] != pytest.approx(4.0 - 510.0 / J * probe.t, rel=1e-4)
    assert probe["speed"] == 0.0
    assert sign * probe["angle"] == pytest.approx(0.5 * 4.0 * stop, rel=1e-12)
    assert probe["energy.dissipated"] == pytest.approx(0.5 * J * 16.0, rel=1e-12)
    assert probe["energy.dissipated"] == pytest.approx(500.0 * abs(probe["angle"]), rel=1e-12)


@pytest.mark.parametrize(("load", "gained"), [(499.9, 0.0), (-499.9, 0.0), (510.0, 10.0), (-510.0, -10.0)])
@pytest.mark.parametrize("by", ["motor", "chain", "controller"])
def test_a_brake_holds_below_its_torque_and_slips_above_it(load, gained, by):
    """At rest 0 is held; beyond, J w = (load - B) t and the heat is B times the angle."""
    asked = {"mode": "torque", "torque.drive": load * (by == "motor")}
    if by == "controller":
        asked = {"mode": "controller", "torque.limit": abs(load), "speed.end": np.sign(load) * 1e3, "ramp.end": 0.0}
    probe = Probe(**asked, **{"brake.torque": 500.0})
    probe.t = 1.0  # after the ramp
    probe.run(0.5, chain=(0, load * (by == "chain"), 0))
    assert probe["speed"] == pytest.approx(gained * 0.5 / J, rel=1e-9, abs=1e-15)
    assert probe["energy.dissipated"] == pytest.approx(500.0 * abs(probe["angle"]), rel=1e-12)
    assert probe["energy.work"] + probe["port.work"] == pytest.approx(
        probe["energy.dissipated"] + probe["energy.kinetic"], rel=1e-12
    )
    if by == "motor":
        assert probe["torque"] == pytest.approx(load, rel=1e-12)


def test_a_brake_reverses_with_the_shaft():
    """From w0 against a larger torque: to rest by T + B, then back by T - B; exact in one step over both."""
    probe = Probe(mode="torque", **{"torque.drive": -800.0, "brake.torque": 500.0, "speed.start": 4.0}).run(0.1, h=0.1)
    stop = 4.0 * J / 1300.0
    assert probe["speed"] == pytest.approx(-300.0 / J * (0.1 - stop), rel=1e-12)
    assert probe["angle"] == pytest.approx(2.0 * stop - 150.0 / J * (0.1 - stop) ** 2, rel=1e-12)


def test_a_brake_that_fades_lets_go_where_the_load_exceeds_it():
    """B = 500 N m (1 - t / 1 s) under 300 N m: from 0.4 s on J w = 250 N m/s (t - 0.4 s)^2."""
    probe = Probe(mode="torque", **{"torque.drive": 300.0, "brake.points": "0 500; 1 0"}).run(0.4)
    assert (probe["speed"], probe["energy.dissipated"]) == (0.0, 0.0)
    probe.run(0.6)
    assert probe["speed"] == pytest.approx(250.0 * 0.36 / J, rel=1e-5)
    assert probe["energy.work"] == pytest.approx(probe["energy.dissipated"] + probe["energy.kinetic"], rel=1e-9)


@pytest.mark.parametrize(
    ("torque", "chain", "holds"), [(1000.0, 40.0, True), (45.0, 40.0, True), (45.0, -40.0, False), (10.0, 40.0, False)]
)
def test_a_braked_sprocket_on_a_mount_that_turns_is_a_locked_one(torque, chain, holds):
    """Motion and reactions are those of the prescribed speed 0; the load is the chain's less J a.w', 11 N m at last."""

    def swaying(t):
        turned = Rotation.from_rotvec([0.0, 2.0 / 3.0 * t**3, 0.0])
        return np.array(PLACE), turned, np.zeros(3), np.array([0.0, 2.0 * t * t, 0.0])

    braked, locked = Probe(mode="torque", **{"brake.torque": torque}), Probe()
    for _ in range(200):
        for probe in (braked, locked):
            probe.step(1e-3, chain=(5.0, chain, 0.0), mount=swaying)
    equal = [
        np.allclose(braked[name], locked[name], rtol=1e-9, atol=1e-9)
        for name in ("speed", "angle", "mount.torque", "sprocket.angular_velocity", "energy.kinetic")
    ]
    assert equal == [holds] * 5
    assert not holds or abs(braked["speed"]) < 1e-15


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
    probe = Probe(mode="torque", **asked, **{"torque.limit": limit, "brake.torque": 100.0})
    for _ in range(100):
        probe.step(1e-3)
    assert (probe["torque"] == pytest.approx(-400.0, rel=1e-12)) == agrees
    assert (probe["speed"] == pytest.approx(-300.0 * 0.1 / J, rel=1e-9)) == agrees
    assert len(probe.model.warnings()) == (limit < 900.0)


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
    """With a brake that slips one way: an engine whose torque falls with the speed, or a controller."""
    probe = Probe(
        mode=mode, **{"torque.drive": 900.0, "brake.torque": 100.0, "speed.start": 5.0, "speed.end": 9.0},
        **{"controller.proportional": 200.0, "controller.integral": 900.0},
        **({"engine.points": "0 900; 30 0"} if mode == "torque" else {}),
    )  # fmt: skip

    def end(steps):
        x = np.zeros(WIDTH)
        x[RATE] = 12.0
        integrate_spin(probe.model.drive, x, ShaftStep(0.0, 0.4, steps, -30.0, 0.2, -0.1))
        return x[:INTEGRATED].copy()

    exact = end(2048)
    errors = [np.linalg.norm(end(n) - exact) for n in (32, 64, 128)]
    slopes = np.log2(np.divide(errors[:-1], errors[1:]))
    assert np.all(np.abs(slopes - 4.0) < 0.25), slopes


def test_a_jump_of_the_clock_is_no_jump_of_the_speed():
    """A drive whose first step is at t = 5 s begins with the profile's speed there, without an impulse."""
    probe = Probe(**RAMP)
    probe.t = 5.0
    probe.step(1e-3)
    assert probe["torque"] == pytest.approx(J * np.diff(half_cosine(np.array([5.0, 5.001])))[0] / 1e-3, rel=1e-9)
    assert probe.model.state[RATE] == pytest.approx(half_cosine(5.001))
    assert probe.model.state[ANGLE] < 0.1


# --- its mount ---


@pytest.mark.parametrize("extrapolation", ["velocity", "acceleration"])
@pytest.mark.parametrize("mode", MODES)
def test_third_law(mode, extrapolation):
    """Impulse of the chain less impulse to the mount = change of J Omega a, to rounding, in any motion."""
    rng, h = np.random.default_rng(1), 1e-3
    probe = Probe(**MODES[mode], extrapolation=extrapolation)

    def mount(t):
        """Motion with random rates that do not match its poses."""
        turn = Rotation.from_rotvec([0.3 * np.sin(9 * t), 0.5 * t, 0.2 * np.cos(7 * t)])
        return rng.normal(size=3), turn, rng.normal(size=3), rng.normal(size=3)

    def momentum():
        w = probe["sprocket.angular_velocity"]
        return J * (w @ probe.axis) * probe.axis

    probe.step(h, mount=mount, chain=rng.normal(size=3))
    before, kept, size = momentum(), np.zeros(3), 0.0
    for _ in range(200):
        torque, force = 5e3 * rng.normal(size=3), 1e4 * rng.normal(size=3)
        probe.step(h, mount=mount, chain=torque, force=force)
        assert np.array_equal(probe["mount.force"], force)
        kept += (torque - probe["mount.torque"]) * h
        size += np.linalg.norm(torque) * h
    assert np.allclose(kept, momentum() - before, rtol=0, atol=1e-11 * size)
    assert not np.allclose(kept, 1.02 * momentum() - before, rtol=0, atol=1e-3)


@pytest.mark.parametrize("mode", MODES)
def test_ledger_closes_on_a_turning_mount(mode):
    probe = Probe(**MODES[mode])
    mount = turning([0.3, -0.5, 0.8], velocity=(1.0, 0.2, 0.0))
    probe.step(1e-3, mount=mount)

    def residual(inertia=1.0):
        return (
            probe["energy.work"] + probe["port.work"] - probe["energy.dissipated"] - inertia * probe["energy.kinetic"]
        )

    before, heavier = residual(), residual(1.02)
    probe.run(0.3, mount=mount, chain=(40.0, -350.0, 90.0))
    size = abs(probe["energy.work"]) + abs(probe["port.work"])
    assert size > 500
    assert abs(residual() - before) < 1e-6 * size
    assert abs(residual(1.02) - heavier) > 1e-5 * size
