"""Reactions of a sprocket drive on its mount: third law, gyroscopic moment, energy."""

import numpy as np
import pytest
from drive_probe import MODES, PLACE, J, Probe, turning
from scipy.spatial.transform import Rotation


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


def test_gyroscopic_moment_of_a_turning_mount():
    """A turning mount gets the mean moment -d(J Omega a)/dt of each step; a yawing one J Omega psi'."""
    psi, omega, h = 0.4, 12.0, 1e-3
    probe = Probe(mode="speed", **{"speed.start": omega, "speed.end": omega})
    mount = turning([0, 0, psi], start=(0, 0, 0))
    probe.run(0.5, h, mount=mount)
    axes = [mount(t)[1].apply([0, 1, 0]) for t in (probe.t - h, probe.t)]
    assert np.allclose(probe["mount.torque"], -J * omega * (axes[1] - axes[0]) / h, rtol=0, atol=1e-9)
    assert np.linalg.norm(probe["mount.torque"]) == pytest.approx(J * omega * psi, rel=1e-6)
    assert np.linalg.norm(probe["mount.torque"]) != pytest.approx(1.02 * J * omega * psi, rel=1e-2)
    # turning left, a wheel that rolls forward presses the right side of the mount down
    assert mount(probe.t)[1].inv().apply(probe["mount.torque"])[0] > 0


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


def test_the_sprocket_rides_on_its_mount():
    probe = Probe(**MODES["speed"], **{"start.angle": -0.2})
    mount = turning([0.3, -0.5, 0.8], velocity=(1.0, 0.2, 0.0))
    probe.run(0.4, mount=mount)
    position, rotation, velocity, omega = mount(probe.t)
    lateral = rotation.apply([0, 1, 0])
    pose = rotation * Rotation.from_rotvec([0, probe["angle"], 0])
    assert np.allclose(probe["sprocket.position"], position, rtol=0, atol=1e-12)
    assert np.allclose(probe["sprocket.velocity"], velocity, rtol=0, atol=1e-12)
    assert np.allclose(
        Rotation.from_quat(probe["sprocket.orientation"], scalar_first=True).as_matrix(), pose.as_matrix(), atol=1e-11
    )
    assert np.allclose(probe["sprocket.angular_velocity"], omega + probe["speed"] * lateral, rtol=0, atol=1e-11)


def test_acceleration_extrapolation_removes_the_lag():
    def braking(t):
        v = np.array([5.0 - 3.0 * t, 0, 0])
        return np.array([5 * t - 1.5 * t * t, *PLACE[1:]]), Rotation.identity(), v, np.zeros(3)

    errors = {}
    for extrapolation in ("velocity", "acceleration"):
        probe = Probe(extrapolation=extrapolation).run(0.1, 1e-2, mount=braking)
        errors[extrapolation] = (
            abs(probe["sprocket.position"][0] - braking(probe.t)[0][0]),
            abs(probe["sprocket.velocity"][0] - braking(probe.t)[2][0]),
        )
    assert errors["velocity"] == pytest.approx((1.5e-4, 3e-2), rel=1e-6)
    assert max(errors["acceleration"]) < 1e-12
