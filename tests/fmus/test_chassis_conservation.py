"""Chassis: conserved quantities, order of convergence, symmetries."""

import numpy as np
import pytest
from chassis_probe import LEAVES, TABLE, Probe, stir
from scipy.spatial.transform import Rotation

from fmus.chassis.dynamics import ROOT, energies

UNDAMPED = {"suspension.damping": 0.0, "tensioner.damping": 0.0}
FLOATING = {**UNDAMPED, "gravity": 0.0}


# --- conserved quantities ---


def momenta(model):
    """Linear momentum and angular momentum about the world's origin, body by body from the table."""
    x, n, table = model.state, LEAVES, TABLE
    A = Rotation.from_quat(x[3:7], scalar_first=True).as_matrix()
    v, w = x[7:10], A @ x[10:13]
    P, L = np.zeros(3), np.zeros(3)

    def add(mass, r, J, omega):
        nonlocal P, L
        velocity = v + np.cross(w, r) if not isinstance(r, tuple) else r[1]
        r = r if not isinstance(r, tuple) else r[0]
        P = P + mass * velocity
        L = L + mass * np.cross(x[:3] + r, velocity) + J @ omega

    centre = np.array(table["chassis"]["centre"])
    add(table["chassis"]["mass"], np.zeros(3), A @ np.diag(table["chassis"]["inertia"]) @ A.T, w)
    for side, sign in enumerate((1, -1)):
        lateral = sign * table["track"]["lateral"]
        s = table["sprocket"]
        J = A @ np.diag([s["transverse_inertia"], 0, s["transverse_inertia"]]) @ A.T
        add(s["mass"], A @ (np.array([0, lateral, 0]) - centre), J, w)
        for i in range(6):
            k = 6 * side + i
            d, rate, spin = x[ROOT + k], x[ROOT + 2 * n + k], x[ROOT + 3 * n + k]
            part = table["idler"] if i == 5 else table["road_wheel"]
            J = A @ np.diag([part["transverse_inertia"], part["spin_inertia"], part["transverse_inertia"]]) @ A.T
            w_wheel = w + (spin - w @ A[:, 1]) * A[:, 1]
            if i == 5:
                r = A @ (np.array([part["x"] + d, lateral, part["z"]]) - centre)
                add(part["mass"], (r, v + np.cross(w, r) + rate * A[:, 0]), J, w_wheel)
                continue
            arm = table["road_arm"]
            pin = A @ (np.array([part["x"][i] + 0.288, lateral, part["z"] + 0.134]) - centre)
            R, w_arm = A @ Rotation.from_rotvec([0, d, 0]).as_matrix(), w + rate * A[:, 1]
            to_wheel = np.array([-0.288, 0, -0.134])
            e = R @ to_wheel / np.linalg.norm(to_wheel)
            J_arm = arm["pin_inertia"] * np.eye(3) - (arm["pin_inertia"] - arm["long_inertia"]) * np.outer(e, e)
            for mass, share, J_part, turn in ((arm["mass"], 0.5, J_arm, w_arm), (part["mass"], 1.0, J, w_wheel)):
                r = R @ to_wheel * share
                add(mass, (pin + r, v + np.cross(w, pin) + np.cross(w_arm, r)), J_part, turn)
    return np.concatenate([P, L])


def drift(h, changes=FLOATING, what=momenta, time=0.4):
    probe = Probe(changes, step=h)
    stir(probe.model)
    before = what(probe.model)
    probe.run(time, h)
    return np.abs(what(probe.model) - before).max() / np.abs(before).max()


def total_energy(model):
    return np.array([sum(energies(model.tree, model.state))])


@pytest.mark.parametrize("what", [momenta, total_energy])
def test_free_flight_conserves(what):
    """Momentum and energy are conserved in free flight: the drift falls with the integrator's order.

    Springs oscillate and wheels spin; at 1 ms the drift is below 1e-8.
    """
    coarse, fine = drift(4e-3, what=what), drift(2e-3, what=what)
    assert drift(1e-3, what=what) < 1e-8
    assert 3.6 < np.log2(coarse / fine) < 5.4
    if what is total_energy:
        assert drift(1e-3, changes={**FLOATING, "suspension.damping": 1.0}, what=what) > 1e-7


def test_convergence_rate_is_four():
    def end(h):
        probe = Probe(step=h)
        stir(probe.model)
        probe["left.sprocket.force.x"], probe["right.road_wheel[2].torque.x"] = 3e4, 1e4
        return probe.run(0.16, 0.16).model.state.copy()

    exact = end(1.25e-4)
    errors = [np.linalg.norm(end(h) - exact) for h in (4e-3, 2e-3, 1e-3)]
    slopes = np.log2(np.divide(errors[:-1], errors[1:]))
    assert np.all(np.abs(slopes - 4.0) < 0.25), slopes


def test_energy_ledger_closes():
    """The energy balance closes with all parts in motion.

    Kinetic + gravity + spring + dissipated energy - work of the wrenches stays constant.
    """

    def residual(work=1.0):
        probe = Probe()
        stir(probe.model)
        before = probe.energy
        probe["left.road_wheel[1].force.z"], probe["right.idler.force.x"] = 2e4, 1e4
        probe["left.sprocket.torque.y"], probe["right.road_wheel[5].torque.x"] = -5e3, 4e3
        probe.run(0.3)
        assert probe["energy.dissipated"] > 100.0
        return probe.energy + probe["energy.dissipated"] - before - work * probe["port.work"], probe["port.work"]

    rest, work = residual()
    assert abs(rest) < 1e-7 * abs(work)
    assert abs(residual(1.01)[0]) > 1e-3 * abs(work)


# --- symmetries ---


def test_heading_changes_nothing():
    def driven(heading):
        probe = Probe(**{"start.heading": heading, "start.position.x": 2.0})
        c, s = np.cos(heading), np.sin(heading)
        for name, (fx, fy, fz) in {"left.sprocket": (2e4, 500, 100), "right.road_wheel[3]": (0, -900, 4e4)}.items():
            probe[f"{name}.force.x"], probe[f"{name}.force.y"] = c * fx - s * fy, s * fx + c * fy
            probe[f"{name}.force.z"] = fz
        probe.run(0.3)
        return np.array([probe[k] for k in ("distance", "speed", "settlement", "pitch", "roll")]), probe["yaw"]

    straight, turned = driven(0.0), driven(np.radians(37))
    assert np.allclose(straight[0], turned[0], rtol=1e-11, atol=1e-13)
    assert turned[1] - straight[1] == pytest.approx(np.radians(37), abs=1e-12)


def test_mirrored_wrenches_mirror_the_motion():
    def driven(side, other, mirror):
        probe = Probe()
        probe[f"{side}.road_wheel[2].force.z"], probe[f"{side}.road_wheel[2].force.y"] = 3e4, mirror * 2e3
        probe[f"{side}.idler.torque.x"], probe[f"{other}.sprocket.force.x"] = mirror * 500.0, 1e4
        return probe.run(0.2)

    a, b = driven("left", "right", 1), driven("right", "left", -1)
    assert np.allclose(a["chassis.position"], b["chassis.position"] * [1, -1, 1], rtol=0, atol=1e-13)
    for name, sign in (("roll", -1), ("yaw", -1), ("pitch", 1), ("settlement", 1)):
        assert a[name] == pytest.approx(sign * b[name], abs=1e-13)
    assert a["left.road_arm[2].angle"] == pytest.approx(b["right.road_arm[2].angle"], abs=1e-13)
    assert abs(a["roll"]) > 1e-4


def test_left_side_alone_runs_as_both_sides_driven_alike():
    def driven(sides):
        probe = Probe(sides=sides)
        for side in sides:
            sign = 1 if side == "left" else -1
            probe[f"{side}.road_wheel[4].force.z"], probe[f"{side}.sprocket.force.x"] = 3e4, 2e4
            probe[f"{side}.road_wheel[4].force.y"], probe[f"{side}.road_wheel[4].torque.z"] = (sign * 900, sign * 300)
        return probe.run(0.2)

    half, whole = driven(["left"]), driven(["left", "right"])
    assert len(half.inputs) == 42
    assert not [name for name in half.names if name.startswith("right")]
    assert np.allclose(half.model.integrated, whole.model.integrated, rtol=1e-12, atol=1e-12)
