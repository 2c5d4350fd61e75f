"""Chains on soil: links that sink, slide and hop; memory and rut in the state of the track."""

from __future__ import annotations

from math import exp, radians, tan

import numpy as np
import pytest
from m113 import MASS, VEHICLE, P

from fmus.model import InvalidParameter, StepFailed
from fmus.physics.chain import sums
from fmus.physics.chain.report import CONTACT, DISSIPATED, GRAVITY, KINETIC, LOST, REJECTED, STRAIN
from fmus.physics.contact.soil.memory import DEEPEST, INSIDE, PRESSURE
from fmus.physics.contact.soil.rut import FIRST, MADE
from fmus.track_flexible.model import Model as Flexible
from fmus.track_rigid.model import Model as Rigid

COMPACTED, SHEARED = (LOST + cause - sums.LOSSES for cause in (sums.GROUND_DAMPING, sums.GROUND_FRICTION))
WIDTH, FACE, G = VEHICLE["track"]["width"], VEHICLE["track"]["face"], 9.81
AREA, N = P * WIDTH, 4
SAND = {
    "kc": 0.99e3, "kphi": 1528.43e3, "n": 1.1, "cohesion": 1040.0, "friction_angle": radians(28.0),
    "shear_deformation_modulus": 0.025, "Au": 503e6,
}  # fmt: skip
STRENGTH = N * (AREA * SAND["cohesion"] + MASS * G * tan(SAND["friction_angle"]))
SINKAGE = (MASS * G / (AREA * (SAND["kc"] / WIDTH + SAND["kphi"]))) ** (1.0 / SAND["n"])
LEVEL = VEHICLE["road_wheel"]["z"] - VEHICLE["road_wheel"]["radius"] - 2.0 * FACE
KINDS = ["rigid", *(pytest.param(kind, marks=pytest.mark.long) for kind in ("planar", "cable", "beam"))]


def lying(kind="rigid", soil=SAND, **parameters):
    """A free chain of N links in equilibrium on soil."""
    config = {
        "links": N, "closed": False, "wheels": [], "ground": True, "gravity": G, "soil": soil,
        "ends": {"kind": "pulled", "first": [0.0, 0.0], "last": [0.0, 0.0]},
    }  # fmt: skip
    model = (Rigid if kind == "rigid" else Flexible)({"vehicle": VEHICLE, "track": config, "link_outputs": False})
    model.read(parameters if kind == "rigid" else {"element": kind, **parameters})
    model.settle(np.stack([P * np.arange(N + 1), np.full(N + 1, LEVEL + FACE)], axis=1), rest=True)
    model.begin_run()
    return model


def push(model, along, up):
    """Add a velocity, m/s, to all of the chain."""
    last = 1 if model.s.v.shape[1] == 8 else 2  # the height of a planar chain
    model.s.v[:, 0] += along
    model.s.v[:, last] += up


def energy(model):
    return model.report[[KINETIC, STRAIN, GRAVITY, CONTACT, DISSIPATED]].sum()


def run(model, steps, h=1e-3, start=0):
    for k in range(start, start + steps):
        model.advance(h * k, h)
    return model


@pytest.fixture(scope="module", params=KINDS)
def chain(request):
    model = lying(request.param)
    return model, model.state.copy()


def test_links_sink_as_a_plate(chain):
    model, start = chain
    model.state[:] = start
    memory = model.s.soil[model.s.soil[:, INSIDE] > 0.0]
    assert len(memory) in (2 * N, 4 * N)
    assert memory[:, DEEPEST] == pytest.approx(SINKAGE, rel=1e-6)
    assert memory[:, DEEPEST] != pytest.approx((1.0 / 1.01) * SINKAGE, rel=1e-6)
    assert memory[:, PRESSURE] == pytest.approx(MASS * G / AREA, rel=1e-6)
    assert model.pins()[:, 2] == pytest.approx(LEVEL + FACE - SINKAGE, rel=1e-6)
    assert model.report[[DISSIPATED, COMPACTED, SHEARED]] == pytest.approx(0.0)


def test_links_that_slide_stop_where_shear_has_taken_their_energy(chain):
    """Within 0.5 %: shear acts below the pins, so links lean forward a little and press the soil."""
    model, start = chain
    model.state[:] = start
    push(model, 0.1, 0.0)
    first, place, before = model.pins()[:, 0].mean(), 0.0, None
    for k in range(200):
        run(model, 1, 5e-4, k)
        if before is None:
            before = energy(model)
        assert energy(model) == pytest.approx(before, abs=1e-4 * 0.5 * N * MASS * 0.1**2)
        if model.pins()[:, 0].mean() - first < place:
            break
        place = model.pins()[:, 0].mean() - first
    low, high, K = 0.0, 0.1, SAND["shear_deformation_modulus"]
    for _ in range(60):
        way = 0.5 * (low + high)
        work = STRENGTH * (way - K * (1.0 - exp(-way / K)))
        low, high = (way, high) if work < 0.5 * N * MASS * 0.1**2 else (low, way)
    assert place == pytest.approx(way, rel=5e-3)
    assert place != pytest.approx(1.02 * way, rel=5e-3)
    assert model.report[SHEARED] > 0.0
    assert model.report[DISSIPATED] == pytest.approx(model.report[[COMPACTED, SHEARED]].sum(), rel=1e-3)


def hop(model, k=0):
    """Throw the chain up and let it land; return the energy that compaction takes."""
    before = model.report[COMPACTED]
    push(model, 0.0, 1.0)
    run(model, 260, start=k)
    return model.report[COMPACTED] - before


def test_links_that_land_in_their_rut_press_it_less(chain):
    """A second hop at the same speed hardly compacts; a rut that is forgotten is new ground."""
    model, start = chain
    model.state[:] = start
    first = hop(model)
    assert first > 0.2 * 0.5 * N * MASS
    assert model.s.rut[MADE] > 0.0
    landed = model.state.copy()
    second = hop(model)
    assert second < 0.2 * first
    model.state[:] = landed
    model.s.rut[FIRST:] = 0.0
    push(model, 0.0, 1.0)
    run(model, 20)
    model.s.rut[FIRST:] = 0.0  # what was pressed as the links left
    before = model.report[COMPACTED]
    run(model, 240, start=20)
    assert model.report[COMPACTED] - before > 2.0 * second


def test_a_saved_state_goes_on_to_the_bit(chain):
    """In the air over the rut and on the ground: memory and rut are in the state."""
    model, start = chain
    for k in (0, 100, 215):  # on the ground, in the air, after landing
        model.state[:] = start
        push(model, 0.2, 1.0)
        run(model, k)
        saved = model.state.copy()
        ends = []
        for _ in range(2):
            model.state[:] = saved
            run(model, 60, start=k)
            ends.append(model.state.copy())
        assert (ends[0] == ends[1]).all()
        if k == 100:
            assert model.s.rut[MADE] > 0.0
            assert not model.s.soil.any()
            model.state[:] = saved
            model.s.rut[FIRST:] = 0.0
            run(model, 60, start=k)
            assert (model.state != ends[0]).any()


def test_a_step_that_fails_leaves_no_trace():
    """Newton fails at a tolerance of 0: steps are halved and rejected, and the soil remembers none of them."""
    model = lying()
    push(model, 0.1, -0.5)
    run(model, 3)
    memory, rut = model.s.soil.copy(), model.s.rut.copy()
    model.method = model.method._replace(tolerance=0.0)
    model.begin_run()
    rejected = model.counters[REJECTED]
    with pytest.raises(StepFailed):
        run(model, 1, start=3)
    assert model.counters[REJECTED] > rejected + 3
    assert (model.s.soil == memory).all()
    assert (model.s.rut == rut).all()


def test_what_soil_needs_is_said():
    with pytest.raises(InvalidParameter, match="soil remembers accepted steps and needs an implicit integrator"):
        lying(integrator="runge_kutta")
    with pytest.raises(InvalidParameter, match=r"ground\.soil\.k0 = 0 and Au = 0"):
        lying(soil=SAND | {"Au": 0.0})


def test_hard_ground_remembers_nothing():
    config = {"links": N, "closed": False, "wheels": [], "ground": True, "gravity": G}
    config["ends"] = {"kind": "pulled", "first": [0.0, 0.0], "last": [0.0, 0.0]}
    model = Rigid({"vehicle": VEHICLE, "track": config, "link_outputs": False})
    assert model.s.soil.size == model.s.rut.size == 0
    assert len(model.warning_sentences) == 2
    assert any(port.name == "contact.ground.friction" for port in model.ports)
