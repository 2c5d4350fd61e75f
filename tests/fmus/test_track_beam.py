"""The flexible track of beams: pins that turn with the vehicle; forces, equilibria, energies, ports."""

from __future__ import annotations

import numpy as np
import pytest
from flexible_track import (
    LINKS,
    PITCH,
    TABLE,
    at_rest,
    carrier,
    coordinates,
    correction,
    hanging,
    make,
    scattered,
    wheels,
)
from named_ports import parameters

from fmus.physics.chain.flexible.state import Motion
from fmus.physics.chain.report import DISSIPATED, KINETIC, STRAIN
from fmus.physics.chain.rolling import evaluate_contacts
from fmus.physics.contact.ground import bumpy_ground
from tests.validation.ancf import joints, torsion

pytestmark = pytest.mark.long  # kernels of their own


def newton(model, count: int, mass: float = 0.0) -> None:
    """Make ``count`` Newton corrections to equilibrium; ``mass`` (1/s2) enters the matrix only."""
    for _ in range(count):
        correction(model, mass)
    model.evaluate(Motion(model.s.q, np.zeros_like(model.s.q), np.zeros_like(model.s.q), model.s.axes))


def test_pins_leave_the_motion_of_their_joint_free():
    """Six coordinates of a pin are shared by its links: joint (3) of the library has as many equations."""
    closed = make({"links": LINKS, "wheels": wheels()}, start="polygon", element="beam")
    assert closed.s.q.size == LINKS * 24 - LINKS * 6
    e = coordinates(closed, np.random.default_rng(1).standard_normal(closed.s.q.shape))
    pin = joints.pin_beam(np.array([0.0, 1.0, 0.0]))
    for before, after in zip(e, np.roll(e, -1, axis=0), strict=True):
        one, other = before[4:].ravel(), after[:4].ravel()
        rest = other - pin.transfer @ one  # the motion that joint (3) leaves free
        assert abs(rest - pin.free_directions @ (pin.free_directions.T @ rest)).max() < 1e-14
    assert pin.equations == 6


def test_sideways_a_chain_of_pins_is_one_beam():
    """Laterally a chain with pins is one Timoshenko beam: F = 12 EI d / (L^3 (1 + phi)).

    Its pins clamp both ends; one end is moved aside.
    """
    n, aside = 16, 1e-3
    model = hanging(links=n, element="beam", start="polygon")
    model.settle_pins(np.column_stack([PITCH * np.arange(n + 1), np.zeros(n + 1)]))
    model.environment = model.environment._replace(gravity=(0.0, 0.0, 0.0))
    model.s.q[-1, 1] += aside
    newton(model, 12, mass=1.0)  # a little mass stabilises the straight chain, which can fold up and down
    force = model.work.residual[-1, 4, 1]
    c, L, area = model.link.element, n * PITCH, TABLE["section"]["area"]
    EI = model.link.young * TABLE["section"]["lateral_bending"]
    phi = 12 * EI / (c.shear * 0.5 * model.link.young / (1 + c.nu) * area * L**2)
    expected = 12 * EI * aside / (L**3 * (1 + phi))
    assert force == pytest.approx(expected, rel=1e-2)
    assert force != pytest.approx(1.03 * expected, rel=1e-2)
    assert force != pytest.approx(expected * (1 + phi), rel=1e-2)


def test_a_chain_twists_as_its_section_says():
    """A chain twists by torque = G J angle / length, J = section.torsion, for any bending."""
    n, angle, section = 4, 1e-3, TABLE["section"]
    assert section["torsion"] == pytest.approx(torsion.constant(0.378, 0.0401), rel=1e-3)

    def torque(**changes):
        ends = {"kind": "pinned", "first": [0.0, 0.0], "last": [0.8 * n * PITCH, 0.0]}
        track = {"links": n, "closed": False, "ends": ends, "gravity": 0.0}
        model = make(track, TABLE | {"section": section | changes}, element="beam", start="polygon")
        model.settle_pins(np.column_stack([PITCH * np.arange(n + 1), np.zeros(n + 1)]))
        model.s.q[-1, 4:6] = np.cos(angle), np.sin(angle)
        newton(model, 12, mass=1.0)
        assert abs(model.work.right_side).max() < 1e-3
        return np.cross(model.s.q[-1, 3:6], model.work.residual[-1, 6])[0]

    expected = TABLE["material"]["shear_modulus"] * section["torsion"] * angle / (n * PITCH)
    assert torque() == pytest.approx(expected, rel=2e-3)
    assert torque(torsion=1.03 * section["torsion"]) == pytest.approx(1.03 * expected, rel=2e-3)
    assert torque(bending=1.03 * section["bending"]) == pytest.approx(expected, rel=2e-3)
    assert torque(lateral_bending=0.97 * section["lateral_bending"]) == pytest.approx(expected, rel=2e-3)


def test_a_free_loop_keeps_energy_and_angular_momentum_about_every_axis():
    """It spins and yaws; of cables only the part about the pins stays (``test_chain_benchmarks``)."""
    model = make({"wheels": wheels(), "gravity": 0.0}, start="polygon", element="beam")
    model.contacts, model.environment = None, model.environment._replace(mount=-1)
    model.rows, model.work = np.zeros((0, 15)), model.work._replace(wheels=np.zeros((0, 15)), flat=np.zeros((0, 15)))
    angle = 2 * np.pi * np.arange(LINKS) / LINKS
    radius = PITCH / (2 * np.sin(np.pi / LINKS))
    model.settle_pins(radius * np.stack([np.cos(angle), -np.sin(angle)], axis=1))
    model.s.v[:] = np.cross([0.0, 2.0, 1.0], model.s.q.reshape(-1, 6, 3)).reshape(model.s.q.shape)

    def kept() -> tuple[np.ndarray, float]:
        momenta = np.einsum("ab,nbj->naj", model.work.mass, coordinates(model, model.s.v))
        return np.cross(coordinates(model), momenta).sum((0, 1)), model.report[[KINETIC, STRAIN, DISSIPATED]].sum()

    model.advance(0.0, 1e-3)
    start, energy = kept()
    for k in range(1, 100):
        model.advance(k * 1e-3, 1e-3)
    end, still = kept()
    assert abs(end - start).max() < 1e-5 * abs(start).max()
    assert still == pytest.approx(energy, rel=1e-3)
    assert abs(start[2]) > 0.1 * abs(start[1])


def test_one_component_takes_either_element():
    model, fresh = hanging(links=8, element="beam"), hanging(links=8)
    size = model.state.size
    model.initialise(parameters(model))
    assert model.state.tobytes() == fresh.state.tobytes()
    model.initialise(parameters(model, element="beam"))
    assert model.state.size == size > fresh.state.size


# --- on wheels ---


def rolled(model, q, v, by_rate: float, tangent: bool, contacts) -> None:
    w = model.work
    evaluate_contacts(model.link, contacts, Motion(q, v, v), w, w.wheels, by_rate, tangent)


@pytest.mark.parametrize("yaw", [0.0, 0.05])
def test_contacts_give_the_chain_what_the_wheels_get(yaw):
    """Contacts of a skewed chain give it the opposite of the wheels' and the ground's force and moment.

    Rims, teeth and guides are checked by the work of rigid motions.
    """
    model, rng = carrier(element="beam"), np.random.default_rng(4)
    model.s.q[:, 1] += 0.02  # more than the clearance of the guides
    model.s.q[:] += 1e-3 * rng.standard_normal(model.s.q.shape)
    model.s.v[:] = 0.1 * rng.standard_normal(model.s.v.shape)
    rows, w = model.start_rows.copy(), model.work
    rows[:, 9:12], rows[:, 12:15] = [-np.sin(yaw), np.cos(yaw), 0.0], [np.cos(yaw), np.sin(yaw), 0.0]

    def given(ground: int) -> tuple[np.ndarray, np.ndarray]:
        """Force (N) and moment about the origin (N m) of all contacts; fills ``w.wrench`` of the wheels."""
        rolled(model, model.s.q, model.s.v, 0.0, False, model.contacts._replace(ground=ground))
        on_links = np.where(w.touched[:, None, None], -w.load, 0.0)
        on_pins, pins = -w.right_side.reshape(LINKS, 2, 3), model.s.q.reshape(LINKS, 6, 3)[:, :2]
        force = on_links[:, [0, 4]].sum((0, 1)) + on_pins[:, 0].sum(0)
        moments = np.cross(coordinates(model), on_links), np.cross(pins, on_pins)
        assert abs(moments[0][:, [1, 2, 3, 5, 6, 7]]).max() > 1.0  # the part of the section
        assert abs(moments[1][:, 1]).max() > 1.0  # and the part of the pins' ends
        return force, sum(moment.sum((0, 1)) for moment in moments)

    w.wheels[:] = rows
    for ground in (0, 1):
        w.right_side[:], w.sums[:], w.wrench[:] = 0.0, 0.0, 0.0
        force, moment = given(ground)
        wheel, largest = w.wrench[:-1], abs(w.wrench).max()
        assert abs(force + w.wrench[:, :3].sum(0)).max() < 1e-12 * largest
        assert (abs(w.wrench[-1]).max() > 100.0) == bool(ground)
        if not ground:
            about = wheel[:, 3:].sum(0) + np.cross(rows[:, :3], wheel[:, :3]).sum(0)
            assert abs(moment + about).max() < 1e-12 * largest
            assert abs(moment + 1.03 * about).max() > 1e-3 * largest
    assert abs(wheel[:, 1]).max() > 10.0  # the guides carry load


@pytest.mark.parametrize("rise", [0.0, 0.03])
def test_the_matrices_of_contacts_are_their_derivatives(rise):
    """The matrices of contacts are their derivatives: ground, level or with a bump, teeth and guides.

    Their contact points do not move as a rim rolls.
    """
    model, rng, by_rate = carrier(element="beam"), np.random.default_rng(6), 300.0
    model.s.q[:, 1] += 0.02
    model.s.q[:] += 1e-3 * rng.standard_normal(model.s.q.shape)
    model.s.q[:, 2] -= 2e-3
    model.s.v[:] = 0.1 * rng.standard_normal(model.s.v.shape)
    if rise:
        bump = bumpy_ground(model.contacts.shape.height, -3.0, rise, 0.05, 0.5, 0.1)
        model.contacts = model.contacts._replace(shape=bump)
    w, q, v = model.work, model.s.q.copy(), model.s.v.copy()
    w.wheels[:] = model.start_rows
    w.wheels[1:, 2] += 5.0  # road wheels and idler without contact

    def load(d: np.ndarray) -> np.ndarray:
        w.right_side[:], w.sums[:], w.wrench[:], w.diagonal[:] = 0.0, 0.0, 0.0, 0.0
        rolled(model, q + d, v + by_rate * d, by_rate, True, model.contacts)
        return scattered(model, np.where(w.touched[:, None, None], w.load, 0.0)) + np.pad(
            w.right_side, ((0, 0), (0, 12))
        )

    d, step = rng.standard_normal(q.shape), 1e-8
    numeric = (load(step * d) - load(-step * d)) / (2 * step)
    load(np.zeros_like(q))
    K = np.where(w.touched[:, None, None], w.stiffening, 0.0)
    assert (w.wrench[-1, 2] < -2e5) == bool(rise)
    product = scattered(model, np.einsum("nab,nb->na", K, coordinates(model, d).reshape(LINKS, 24)).reshape(-1, 8, 3))
    on_pins = np.einsum("nab,nb->na", w.diagonal, d[:, :6])
    product[:, :6] += on_pins
    assert w.touched.sum() > 15
    assert abs(on_pins).max() > 1e3
    guided = np.linalg.norm(q[:, [0, 2]], axis=1) < 0.5  # a guide's share of a link changes at the edge of the disc
    assert abs(product - numeric)[~guided].max() < 1e-5 * abs(numeric).max()
    assert abs(product - numeric)[guided].max() < 0.05 * abs(numeric).max()
    assert abs(1.03 * product - numeric)[~guided].max() > 1e-3 * abs(numeric).max()


def turned_wheels(model, t: float, angle: float, time: float) -> np.ndarray:
    """Inputs of wheels that yaw by ``angle`` rad about the track's middle within ``time`` s."""
    s = min(t / time, 1.0)
    yaw, rate = 0.5 * angle * (1 - np.cos(np.pi * s)), 0.5 * angle * np.pi / time * np.sin(np.pi * s)
    middle, u = np.array([-2.0, 0.0]), at_rest(model).reshape(-1, 13)
    c, sn = np.cos(yaw), np.sin(yaw)
    arm = u[:, :2] - middle
    u[:, 0], u[:, 1] = middle[0] + c * arm[:, 0] - sn * arm[:, 1], middle[1] + sn * arm[:, 0] + c * arm[:, 1]
    u[:, 3], u[:, 6] = np.cos(yaw / 2), np.sin(yaw / 2)
    u[:, 7], u[:, 8] = -rate * (u[:, 1] - middle[1]), rate * (u[:, 0] - middle[0])
    u[:, 12] = rate
    return u.ravel()


def yaw_moment(model) -> float:
    """Yaw moment of the chain on its wheels about the middle of the track, N m."""
    force, arm = model.s.mean[:-1, :3], model.rows[:, :2] - [-2.0, 0.0]
    return float((arm[:, 0] * force[:, 1] - arm[:, 1] * force[:, 0]).sum() + model.s.mean[:-1, 5].sum())


def suspended(element: str):
    return make({"wheels": wheels()}, element=element, **{"start.lateral": 0.0})


def test_a_quarter_turn():
    """A chain of beams follows wheels that yaw by 90 degrees in 0.8 s: its pins lie along the axles."""
    model, h = suspended("beam"), 2e-3
    before = model.report[3]
    for k in range(450):
        model.step(k * h, h, turned_wheels(model, k * h, np.pi / 2, 0.8))
    assert model.warnings() == []
    axis = np.array([-1.0, 0.0, 0.0])  # lateral axis of the wheels after the turn: y has become -x
    along = model.s.q[:, 3:6] @ axis
    assert along == pytest.approx(np.ones(LINKS), abs=1e-3)
    assert abs((model.s.q[:, :3] - [-2.0, 0.0, 0.0]) @ axis).max() < 0.015  # within the clearance of the guides
    e = coordinates(model)
    assert np.array_equal(e[:, [4, 6]], np.roll(e, -1, axis=0)[:, [0, 2]])  # position and axis of each pin are shared
    assert model.report[3] == pytest.approx(before, rel=0.05)
    assert abs(yaw_moment(model)) < 500.0


def test_a_cable_resists_where_a_beam_follows():
    """Cables resist a yaw of 0.5 degrees with 4.7e6 N m/rad and a warning; beams follow."""
    moments = {}
    for element in ("cable", "beam"):
        model, h, angle = suspended(element), 1e-3, np.radians(0.5)
        said = []
        for k in range(100):
            model.step(k * h, h, turned_wheels(model, k * h, angle, 0.08))
            said += model.warnings()
        moments[element] = abs(yaw_moment(model))
        assert bool(said) == (element == "cable")
    assert moments["cable"] > 50 * moments["beam"], moments
