"""The flexible chain: counts, statics, momentum, energy, orders, invariance, failures."""

from __future__ import annotations

from functools import partial

import numpy as np
import pytest
from flexible_track import LINKS, TABLE, at_rest, carrier, hanging, wheels
from named_ports import outputs, parameters
from rigid_track import rolling

import fmus.track_rigid.model as track_rigid
from fmus.interface.model import StepFailed
from fmus.interface.sentences import GAPS
from fmus.physics.chain.flexible import beams, cables, planar
from fmus.physics.chain.report import EVALUATIONS, REJECTED, STEPS
from fmus.track.choices import ELEMENTS
from fmus.track.failures import HALVED
from fmus.track.steps import warn_of_halvings
from fmus.track_flexible.model import Model


def rods():
    model = rolling()
    model.initialise(parameters(model))
    return model


def test_the_table_of_elements_is_that_of_their_modules():
    for name, kit in {"cable": cables, "planar": planar, "beam": beams}.items():
        element = ELEMENTS[name]
        assert (np.prod(kit.ELEMENT), len(kit.LAYOUT.shared), tuple(kit.AXES)) == (*element[:2], element.axes)
        assert element.dofs - element.shared == kit.NODE


BEGUN = {"cable": carrier, "rigid": rods} | {each: partial(carrier, element=each) for each in ("planar", "beam")}


@pytest.mark.parametrize("kind", [pytest.param(k, marks=[pytest.mark.long] * (k in ("planar", "beam"))) for k in BEGUN])
def test_the_start_is_at_rest_on_its_wheels(kind):
    """The ground and the wheels carry the weight; a wheel that is a tenth of a millimetre higher shows (twin)."""
    model = BEGUN[kind]()
    u, first, before = at_rest(model), model.s.q.copy(), outputs(model)
    lifted = sum(before[f"{wheel['name']}.force.z"] for wheel in model.wheel_list)
    weight = LINKS * TABLE["track"]["mass"] * 9.81
    assert before["ground.force.z"] - lifted == pytest.approx(weight, abs=1e-4 if kind == "rigid" else 1e-3)
    assert before["ground.force.z"] - lifted != pytest.approx(1.000001 * weight, abs=1e-3)
    assert before["tension.min"] > 5e3
    for k in range(20):
        model.step(k * 1e-3, 1e-3, u)
    assert abs(model.s.v).max() < 1e-5
    assert abs(model.s.q - first).max() < 1e-8
    assert outputs(model)["tension.mean"] == pytest.approx(before["tension.mean"], rel=1e-6)
    model.step(0.02, 1e-3, at_rest(model, lift=1e-4))
    assert abs(model.s.v[:, :3]).max() > 1e-4


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


@pytest.mark.parametrize(("halved", "said"), [(5, 0), (6, 1)])
def test_a_step_halved_again_and_again_is_told_once(halved, said):
    messages, given_warnings = np.zeros((3, GAPS + 1)), np.zeros(4)
    warn_of_halvings(given_warnings, messages, 0.5, halved)
    assert messages[1 + HALVED, 0] == given_warnings[HALVED] == said
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
    with pytest.raises(StepFailed, match="pin axis"):
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
