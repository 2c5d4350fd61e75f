"""Chassis: conserved quantities, impulses on its hitch, order of convergence, a side alone."""

import numpy as np
import pytest
from chassis_by_constraints import assemble
from chassis_probe import ROLLERS, TABLE, Probe, stir

from fmus.chassis.dynamics import energies

UNDAMPED = {"suspension.damping": 0.0, "tensioner.damping": 0.0}
FLOATING = {**UNDAMPED, "gravity": 0.0}


# --- conserved quantities ---


def momenta(model):
    """Linear momentum and angular momentum about the world's origin, body by body from the table."""
    bodies = assemble(TABLE, model.state).bodies
    mass, place, velocity = (np.array(part) for part in (bodies.mass, bodies.place, bodies.velocity))
    linear = mass[:, None] * velocity
    spins = np.einsum("nij,nj->ni", bodies.inertia, bodies.omega)
    return np.concatenate([linear.sum(0), (np.cross(place, linear) + spins).sum(0)])


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
    """Kinetic + gravity + spring + dissipated energy - work of the wrenches is constant with all parts in motion."""

    def residual(work=1.0):
        probe = Probe({"return_roller": ROLLERS}, step=5e-4)
        stir(probe.model)
        before = probe.energy
        probe["left.return_roller[2].torque.y"], probe["right.return_roller[3].force.z"] = 7.0, 2e4
        probe["left.road_wheel[1].force.z"], probe["right.idler.force.x"] = 2e4, 1e4
        probe["left.sprocket.torque.y"], probe["right.road_wheel[5].torque.x"] = -5e3, 4e3
        probe.run(0.3)
        assert probe["energy.dissipated"] > 100.0
        return probe.energy + probe["energy.dissipated"] - before - work * probe["port.work"], probe["port.work"]

    rest, work = residual()
    assert abs(rest) < 1e-7 * abs(work)
    assert abs(residual(1.01)[0]) > 1e-3 * abs(work)


# --- hitch ---


def towing(**parameters):
    return Probe({"gravity": 0.0}, config={"hitch": True}, **parameters)


def test_a_force_on_the_hitch_changes_the_momenta_by_its_impulse_and_does_its_work():
    """A constant force accelerates the mass by F / M, turns it by its moment, and works F.d, whatever else moves."""
    probe, force = towing(), np.array([3e4, -1e4, 2e4])
    stir(probe.model)
    before, momentum, start = probe.energy, momenta(probe.model), probe["hitch.position"]
    probe.give("hitch.force", force)
    moments, h = [np.cross(start, force)], 1e-3
    for _ in range(200):
        moments.append(np.cross(probe.run(h, h)["hitch.position"], force))
    gain = momenta(probe.model) - momentum
    np.testing.assert_allclose(gain[:3], 0.2 * force, rtol=1e-8)
    np.testing.assert_allclose(gain[3:], np.trapezoid(moments, dx=h, axis=0), rtol=1e-5)
    assert np.abs(gain[:3] - 0.2 * 1.01 * force).max() > 50.0
    work = force @ (probe["hitch.position"] - start)
    assert probe["energy.towed"] == pytest.approx(-work, rel=1e-8)
    assert probe["port.work"] == 0.0
    assert probe.energy + probe["energy.dissipated"] - before == pytest.approx(work, rel=1e-7)


@pytest.mark.parametrize("heading", [0.0, 2.0])
def test_a_constant_load_pulls_level_and_rearward(heading):
    """The load has no part up or across, also on a chassis that is pitched and turned."""
    at_once = {"hitch.load.ramp.start": 0.0, "hitch.load.ramp.end": 0.0}
    probe = towing(start__heading=heading, start__pitch=0.3, hitch__load__force=1e4, **at_once).run(0.1)
    gain = momenta(probe.model)[:3]
    np.testing.assert_allclose(gain, -1e3 * np.array([np.cos(heading), np.sin(heading), 0.0]), atol=0.2)
    assert np.abs(gain[2]) < 1e-9 * 1e3


# --- a side alone ---


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
