"""The flexible chain: counts, statics, momentum, energy, orders, invariance, failures."""

from __future__ import annotations

from math import pi, sin, tan

import numpy as np
import pytest
from flexible_track import LINKS, PITCH, TABLE, at_rest, carrier, hanging, make, second_steps, wheels
from named_ports import parameters

import fmus.track_rigid.model as track_rigid
from fmus.interface.model import InvalidParameter, StepFailed
from fmus.interface.sentences import GAPS, Sentence, format_sentence
from fmus.physics.chain.flexible.cables import LAYOUT
from fmus.physics.chain.report import EVALUATIONS, KINETIC, REJECTED, REPORT, SPEED, STEPS, STRAIN, T_MAX, TRAVEL
from fmus.physics.wheels import read_states
from fmus.track.failures import HALVED, WARNING_TEXTS
from fmus.track.steps import warn_of_halvings
from fmus.track_flexible.model import Model


def spinning(links: int = 64, omega: float = 5.0) -> Model:
    """A free loop as a regular polygon that spins about its centre, stretched to its steady state."""
    model = make({"links": links, "wheels": wheels(), "gravity": 0.0}, start="polygon")
    model.contacts = model.contacts._replace(radius=np.zeros(0), teeth=np.zeros(0, dtype=np.int64))
    model.rows, model.environment = np.zeros((0, 15)), model.environment._replace(mount=-1)
    model.work = model.work._replace(wheels=np.zeros((0, 15)), flat=np.zeros((0, 15)))
    angle = 2 * pi * np.arange(links) / links
    radius = PITCH / (2 * sin(pi / links))
    model.settle_pins(radius * np.stack([np.cos(angle), -np.sin(angle)], axis=1))
    spin = np.array([[0, omega], [-omega, 0]])  # about +y: x -> -z
    for place in ([0, 2], [3, 4], [5, 6]):
        model.s.v[:, place] = model.s.q[:, place] @ spin.T
    return model


def test_coordinates_of_a_track():
    """A track has 64 x 12 less 64 x 4 coordinates; an open chain keeps the slopes of its ends."""
    assert carrier().s.q.size == 512
    open_chain = hanging()
    assert open_chain.s.q.size - 2 * 2 == 516  # no link ends at the first pin, and none begins at the last
    assert len(LAYOUT.outer) == 8


def test_hanging_chain_is_a_catenary():
    """A hanging chain is the polygon of rigid links; its end tension is that of the catenary."""
    model = hanging()
    w = TABLE["track"]["mass"] / PITCH * 9.81
    assert -model.s.q[:, 2].min() == pytest.approx(2.589308, abs=2e-5)
    force = np.linalg.norm(model.work.residual[0, 0])
    assert force == pytest.approx(w * np.hypot(3.298471, LINKS * PITCH / 2), rel=1e-3)
    assert force != pytest.approx(1.03 * w * np.hypot(3.298471, LINKS * PITCH / 2), rel=1e-3)
    before = model.s.q.copy()
    for k in range(50):
        model.step(k * 1e-3, 1e-3, np.zeros(0))
    assert abs(model.s.q - before).max() < 1e-7
    assert model.counters[2] == 50  # one iteration per step


def test_the_start_is_at_rest_on_its_wheels():
    model = carrier()
    u = at_rest(model)
    first = model.s.q.copy()
    for k in range(20):
        model.step(k * 1e-3, 1e-3, u)
    assert abs(model.s.v).max() < 1e-6
    assert abs(model.s.q - first).max() < 1e-8
    model.step(0.02, 1e-3, at_rest(model, lift=1e-4))  # twin: a tenth of a millimetre shows
    assert abs(model.s.v[:, :3]).max() > 1e-4


def test_a_spinning_loop_carries_its_centrifugal_force():
    """A spinning loop has the tension T = m w^2 Rc / (2 sin(pi / N)) of rigid links.

    The steel loop oscillates about it by its own stretch.
    """
    links, omega = 64, 5.0
    model = spinning(links, omega)
    mass = model.link.element.rhoA * PITCH
    expected = mass * omega**2 * PITCH / (2 * tan(pi / links)) / (2 * sin(pi / links))
    tensions = []
    for k in range(400):
        model.advance(k * 1e-3, 1e-3)
        tensions.append(np.linalg.norm(model.work.residual[:, 0, :], axis=1).mean())
    assert np.mean(tensions[100:]) == pytest.approx(expected, rel=2e-3)
    assert np.mean(tensions[100:]) != pytest.approx(1.03 * expected, rel=2e-3)


def test_a_free_loop_keeps_energy_and_angular_momentum():
    model = spinning()

    def angular() -> float:
        total, M = 0.0, model.work.mass
        for i in range(LINKS):
            j = (i + 1) % LINKS
            e = np.array([model.s.q[i, :3], model.s.q[i, [5, 7, 6]], model.s.q[j, :3], model.s.q[j, [3, 7, 4]]])
            v = np.array([model.s.v[i, :3], model.s.v[i, [5, 7, 6]], model.s.v[j, :3], model.s.v[j, [3, 7, 4]]])
            total += np.einsum("ab,ai,bi", M, np.cross(e, [0, 1.0, 0]), v)
        return -total

    model.advance(0.0, 1e-3)
    e0, l0 = model.report[KINETIC] + model.report[STRAIN], angular()
    for k in range(300):
        model.advance(k * 1e-3, 1e-3)
    assert model.report[KINETIC] + model.report[STRAIN] == pytest.approx(e0, rel=1e-3)
    assert angular() == pytest.approx(l0, rel=1e-4)
    assert abs(l0) > 1e4


@pytest.fixture(scope="module")
def swinging():
    """Return ``off`` (below) for a soft hanging chain that is released from a displaced shape."""
    soft = {
        "material.youngs_modulus": 2e6,
        "material.relaxation_time": 0.0,
        "start": "displaced",
        "spectral_radius": 0.9,
    }

    def state(integrator: str, step: float, **more) -> tuple[np.ndarray, np.ndarray]:
        model = hanging(links=8, integrator=integrator, step=step, tolerance=1e-13, **soft, **more)
        assert integrator != "runge_kutta" or model.stable_step > step
        path = []
        for k in range(10):
            model.step(k * 0.016, 0.016, np.zeros(0))
            path.append(model.s.q[:, :3].copy())
        return np.array(path), model.counters.copy()

    truth, _ = state("runge_kutta", 2e-5)

    def off(integrator: str, step: float, **more) -> tuple[float, np.ndarray]:
        """Root mean square error of the pins' paths, m, and the counters."""
        path, counters = state(integrator, step, **more)
        return float(np.sqrt(np.mean((path - truth) ** 2))), counters

    return off


@pytest.mark.long
@pytest.mark.parametrize(("integrator", "order", "steps"), [("generalized_alpha", 2, (4e-4, 2e-4, 1e-4)),
                                                            ("hht", 2, (4e-4, 2e-4, 1e-4)),
                                                            ("runge_kutta", 4, (1e-3, 5e-4, 2.5e-4))])  # fmt: skip
def test_order_of_the_integrators(swinging, integrator, order, steps):
    """The integrators have their orders, against Runge-Kutta with a much smaller step."""
    errors = [swinging(integrator, step)[0] for step in steps]
    rates = np.log2(np.array(errors[:-1]) / errors[1:])
    assert abs(rates - order).max() < 0.3, rates


@pytest.mark.long
def test_adams_keeps_tolerances_with_fewer_evaluations_than_runge_kutta(swinging):
    for tolerance in (1e-5, 1e-7, 1e-9):
        error, counters = swinging("adams", 1.0, **{"adams.rtol": tolerance, "adams.atol": tolerance})
        assert 1e-5 < error / tolerance < 1e-2, tolerance  # errors of positions; velocities limit the steps
        assert counters[EVALUATIONS] == 2 * counters[STEPS] + counters[REJECTED] + 10, "it restarts at each step"
    other, equal = swinging("runge_kutta", 2.5e-4)
    assert error < other
    assert 2 * counters[EVALUATIONS] < equal[EVALUATIONS]


def swings_of_tension(model: Model) -> float:
    """Largest change of a link's tension over the first 3 ms of a swing, over the largest tension."""
    shown = np.zeros(model.link_ports)
    model.link_outputs(shown)
    tension = shown[: model.links_count]
    first, size = tension.copy(), 0.0
    for k in range(15):
        model.step(k * 2e-4, 2e-4, np.zeros(0))
        model.link_outputs(shown)
        size = max(size, np.abs(tension - first).max())
    return size / np.abs(first).max()


@pytest.mark.long
def test_a_chain_let_go_carries_the_tension_of_that_instant(monkeypatch):
    """A released chain starts with the tension of rigid links; one released unstretched rings."""
    model = hanging(links=16, start="displaced", integrator="runge_kutta")
    rigid = track_rigid.Model({"vehicle": TABLE, "track": model.config, "link_outputs": True})
    rigid.initialise(parameters(rigid, start="displaced"))
    pair = []
    for one in (model, rigid):
        shown = np.zeros(one.link_ports)
        one.link_outputs(shown)
        pair.append(shown[:16])
    np.testing.assert_allclose(*pair, rtol=1e-3)
    assert swings_of_tension(model) < 1e-3
    monkeypatch.setattr(Model, "tighten", lambda self: None)
    assert swings_of_tension(hanging(links=16, start="displaced", integrator="runge_kutta")) > 0.5


@pytest.mark.long
def test_explicit_and_implicit_agree():
    positions = []
    for integrator, step in (("generalized_alpha", 2e-5), ("runge_kutta", 1.0)):
        model = hanging(links=16, start="displaced", integrator=integrator, step=step)
        for k in range(20):
            model.step(k * 1e-3, 1e-3, np.zeros(0))
        positions.append(model.s.q[:, :3].copy())
    assert np.abs(positions[0] - positions[1]).max() < 1e-6


def test_any_place_and_heading_is_the_same():
    """Any place and heading gives the same motion in the track's frame; the wheels' rates turn along."""
    one = carrier()
    other = carrier(
        **{"start.position.x": 40.0, "start.position.y": -7.0, "start.position.z": 1.0, "start.heading": 0.6}
    )
    u, w = at_rest(one), at_rest(other)
    c, s = np.cos(0.6), np.sin(0.6)
    for k in range(len(one.wheel_list)):
        u[13 * k + 7], u[13 * k + 11] = 1.0, 4.0
        w[13 * k + 7 : 13 * k + 9] = c, s
        w[13 * k + 10 : 13 * k + 12] = -4.0 * s, 4.0 * c
    rows, turned = np.zeros_like(one.rows), np.zeros_like(other.rows)
    read_states(u, one.frame, rows)
    read_states(w, other.frame, turned)
    np.testing.assert_allclose(rows, turned, atol=1e-12)
    for k in range(5):
        one.step(k * 1e-3, 1e-3, u)
        other.step(k * 1e-3, 1e-3, w)
    np.testing.assert_allclose(one.s.q, other.s.q, atol=1e-10)
    y, z = np.zeros(42 + REPORT), np.zeros(42 + REPORT)
    one.outputs(y)
    other.outputs(z)
    np.testing.assert_allclose(np.hypot(y[0:42:6], y[1:42:6]), np.hypot(z[0:42:6], z[1:42:6]), rtol=1e-6, atol=1e-3)
    assert abs(y[0] - z[0]) > 1.0  # in world axes they differ


def test_a_copied_state_goes_on_bit_for_bit():
    after, again = second_steps(carrier())
    assert again == after


def test_speed_and_travel_of_a_spinning_loop():
    model = spinning(64, 5.0)
    for k in range(100):
        model.advance(k * 1e-3, 1e-3)
    around = 64 * PITCH * 5.0 / (2 * pi)  # number of pins that pass, times the pitch
    assert model.report[SPEED] == pytest.approx(around, rel=2e-3)
    assert model.report[TRAVEL] == pytest.approx(0.1 * around, rel=2e-2)
    assert model.report[T_MAX] > 0.0


def test_tracks_that_cannot_be_are_refused():
    with pytest.raises(InvalidParameter, match=r"64 links of 0.1524 m make 9.7536 m, the belt round the wheels 1\d"):
        make({"wheels": wheels(idler=-5.0), "ground": True})
    with pytest.raises(InvalidParameter, match="cannot reach"):
        hanging(span=1.2)
    with pytest.raises(InvalidParameter, match="youngs_modulus"):
        hanging(**{"material.youngs_modulus": -1.0})
    with pytest.raises(InvalidParameter, match="step"):
        hanging(step=0.0)
    with pytest.raises(InvalidParameter, match=r"tolerance = 1: must be greater than 0 and 1e-05 at most"):
        hanging(tolerance=1.0)


@pytest.mark.parametrize("young", [2e6, 2e13])
def test_soft_and_hard_chains_find_their_rest(young):
    """The tensions at the ends of a chain carry its weight for any stiffness; 1 % more weight would show."""
    model = hanging(**{"material.youngs_modulus": young})
    ends = [model.work.residual[0, 0], -model.work.residual[-1, 2]]
    weight = 64 * model.link.element.rhoA * model.pitch * 9.81
    assert ends[0][2] - ends[1][2] == pytest.approx(weight, rel=1e-6)
    assert ends[0][2] - ends[1][2] != pytest.approx(1.01 * weight, rel=1e-3)


@pytest.mark.parametrize(("halved", "said"), [(5, 0), (6, 1)])
def test_a_step_halved_again_and_again_is_told_once(halved, said):
    messages, given_warnings, sentence = np.zeros((3, GAPS + 1)), np.zeros(4), Sentence(WARNING_TEXTS[HALVED])
    warn_of_halvings(given_warnings, messages, 0.5, halved)
    assert messages[1 + HALVED, 0] == given_warnings[HALVED] == said
    assert not said or "halved 6 times from t = 0.5 s on" in format_sentence(sentence, messages[1 + HALVED, 1:])
    messages[1 + HALVED, 0] = 0.0
    warn_of_halvings(given_warnings, messages, 0.6, halved)
    assert messages[1 + HALVED, 0] == 0.0


def test_a_cable_warns_once_when_it_is_turned_out_of_its_plane():
    model = carrier()
    u = at_rest(model)
    model.step(0.0, 1e-3, u)
    assert model.warnings() == []
    u[13 + 3], u[13 + 6] = np.cos(0.01), np.sin(0.01)
    model.step(1e-3, 1e-3, u)
    assert "degrees off the pin axis" in model.warnings()[0]
    model.step(2e-3, 1e-3, u)
    assert model.warnings() == []
    u[13 + 3], u[13 + 6] = np.cos(0.05), np.sin(0.05)
    with pytest.raises(StepFailed, match=r"5\.7 degrees off the pin axis: cables with axes = 'fixed' stay"):
        model.step(3e-3, 1e-3, u)


@pytest.mark.parametrize("kind", ["cable", "rigid"])
def test_sharp_friction_halves_no_step(kind):
    """Sharp friction halves no step: locked wheels rock the track, friction saturates within 0.1 mm/s."""
    base = {"links": LINKS, "closed": True, "wheels": wheels(), "ground": True, "gravity": 9.81, "ends": None}
    maker = track_rigid.Model if kind == "rigid" else Model
    model = maker({"vehicle": TABLE, "track": base, "link_outputs": False})
    sharp = {f"contact.{pair}.friction_velocity": 1e-4 for pair in ("sprocket", "wheel", "ground")}
    model.initialise(parameters(model, **sharp))
    rest, way, omega = at_rest(model), 4e-4, 120.0
    for k in range(60):
        u = rest.reshape(-1, 13).copy()
        u[:, 0] += way * np.sin(omega * 1e-3 * k)
        u[:, 7] = way * omega * np.cos(omega * 1e-3 * k)
        model.step(1e-3 * k, 1e-3, u.ravel())
    steps, evaluations, iterations, rejected = model.counters
    assert (steps, rejected) == (60, 0)
    assert iterations <= evaluations < 15 * steps
