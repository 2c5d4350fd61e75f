"""Rigid tracks in both formulations, with both closures, behind the ports of a track."""

from __future__ import annotations

import numpy as np
import pytest
from free_chains import HOLD, P, made
from vehicle_in_process import InProcess

from fmus.monolith.model import Monolith
from fmus.physics.chain.report import CONTACT, COUNTERS, DISSIPATED, KINETIC, STRAIN
from fmus.physics.chain.rigid.closing import gap_and_rate
from fmus.physics.chain.rigid.dynamics import LIMIT
from fmus.track_rigid.model import Model as Rigid
from orchestrator.execution import monolithic
from orchestrator.scene.assembly import assemble
from orchestrator.scene.placing import placed
from orchestrator.scene.scene import load

NONE = np.zeros(0)
EXPLICIT = {"integrator": "runge_kutta", "step": LIMIT}  # s
RECURSIVE = {**EXPLICIT, "formulation": "recursive"}
LONG_STEPS = {"integrator": "dormand_prince", "formulation": "recursive", "step": 1.0}
SPRING = {"closure": "spring"}
OVAL = {"start.spin": 3.0, "start.ovalling": 2.0}
PINNED = {"kind": "pinned", "first": [0.0, 0.0], "last": [0.8 * 8 * P, 0.0]}


def gap(model) -> float:
    return float(np.linalg.norm(gap_and_rate(model.rigid, model.s, model.work)[0]))


def energy(model) -> float:
    return float(model.report[KINETIC : CONTACT + 1].sum())


# Formulations --------------------------------------------------------------------------------------------------


def advance_two_seconds(model):
    for k in range(8):
        model.step(0.25 * k, 0.25, NONE)


@pytest.mark.long
@pytest.mark.parametrize(
    ("links", "ends", "start", "grown"),
    [
        (8, PINNED, {"start": "displaced"}, 1e-12),
        pytest.param(2, HOLD, {"start": "straight"}, 1e-12, marks=pytest.mark.study),
        pytest.param(8, HOLD, {"start": "straight"}, 1e-10, marks=pytest.mark.study),
        pytest.param(64, HOLD, {"start": "straight"}, 1e-9, marks=pytest.mark.study),
        pytest.param(16, None, OVAL, 1e-11, marks=pytest.mark.study),
        pytest.param(16, None, OVAL | SPRING, 1e-10, marks=pytest.mark.study),
    ],
)
def test_two_seconds_are_the_same_to_rounding(links, ends, start, grown):
    """Both formulations agree after 2 s to grown rounding, also for whips of 40 rad/s.

    Method and step are the same; ``grown`` is in m.
    """
    models = [made(Rigid, links, ends, **given, **start) for given in (EXPLICIT, RECURSIVE)]
    before = models[0].pins()
    for model in models:
        advance_two_seconds(model)
    one, other = (model.pins() for model in models)
    assert np.abs(one - other).max() < grown
    assert np.abs(one - before).max() > 1e-3
    coarse = made(Rigid, links, ends, gravity=9.81 * (1.0 + 1e-9), **RECURSIVE, **start)
    advance_two_seconds(coarse)
    if ends:
        assert np.abs(coarse.pins() - one).max() > grown, "a twin with gravity off by 1e-9 agrees"


@pytest.mark.long
def test_the_method_of_dormand_and_prince_keeps_its_tolerance_in_long_steps():
    """A loop in joint coordinates, in communication steps of several lengths, against 4,000 short steps of Runge-Kutta.

    Its state holds the next step.
    """
    exact = made(Rigid, 16, **RECURSIVE, **OVAL)
    start = energy(exact)
    exact.step(0.0, 0.2, NONE)
    assert abs(energy(exact) - start) < 1e-9 * abs(start)
    for tolerance in (1e-5, 1e-7, 1e-9):
        model = made(Rigid, 16, **LONG_STEPS, **OVAL, **{"adams.rtol": tolerance, "adams.atol": tolerance})
        for t, h in ((0.0, 0.02), (0.02, 0.03), (0.05, 0.15)):
            before, past = model.state.copy(), model.counters.copy()
            model.step(t, h, NONE)
        assert np.abs(model.pins() - exact.pins()).max() < tolerance
        assert gap(model) < 1e-11
    assert np.abs(made(Rigid, 16, **LONG_STEPS, **OVAL).pins() - exact.pins()).max() > 0.1
    steps, evaluations, _, rejected = (model.counters - past).tolist()
    assert evaluations == 12 * steps + 11 * rejected
    assert evaluations < 0.05 * 4 * 0.15 / LIMIT
    after = model.state.copy()
    model.state[:], model.s.lengths[:] = before, 0.0
    model.step(0.05, 0.15, NONE)
    assert not np.array_equal(model.state, after), "the state does not hold the next step"


# Closures ------------------------------------------------------------------------------------------------------


@pytest.mark.long
@pytest.mark.parametrize("given", [{}, EXPLICIT, RECURSIVE])
def test_a_spring_goes_to_the_pin_as_its_stiffness_grows(given):
    """Error and gap of a spring closure fall as 1/k; the energy is kept but for the damper's loss."""
    pin = made(Rigid, 16, **given, **OVAL)
    pin.step(0.0, 0.1, NONE)
    off, gaps = [], []
    for k in (1e7, 1e8, 1e9):
        model = made(Rigid, 16, **given, **OVAL, **SPRING, **{"closure.stiffness": k, "closure.damping": 1e3})
        start = energy(model)
        model.step(0.0, 0.1, NONE)
        off.append(np.abs(model.pins() - pin.pins()).max())
        gaps.append(gap(model))
        pull = np.linalg.norm(model.s.lam[0, :3])
        assert gaps[-1] * k == pytest.approx(pull, rel=1e-3)
        assert pull == pytest.approx(np.linalg.norm(pin.s.lam[0, :3]), rel=1e-3)
        assert model.report[STRAIN] == pytest.approx(0.5 * pull * gaps[-1], rel=1e-3)
        assert not model.s.lam[0, 3:].any()
        if given:
            assert abs(energy(model) + model.report[DISSIPATED] - start) < 1e-9 * start
    orders = np.log10(np.array([off, gaps])[:, :-1] / np.array([off, gaps])[:, 1:])
    assert np.abs(orders - 1.0).max() < 0.02


@pytest.mark.long
def test_a_soft_spring_swings_and_loses_what_its_damper_takes():
    """A soft spring closure converges at the orders of both integrators, and the energy balance closes."""
    soft = {**OVAL, **SPRING, "closure.stiffness": 1e3, "closure.damping": 50.0}
    exact = made(Rigid, 8, **RECURSIVE, **soft)
    start = energy(exact)
    exact.step(0.0, 0.2, NONE)
    lost = exact.report[DISSIPATED]
    assert lost > 3e-4 * start
    assert abs(energy(exact) + lost - start) < 1e-8 * start
    assert abs(energy(exact) + 1.02 * lost - start) > 5e-6 * start
    off, open_ = [], []
    for h in (1e-3, 5e-4, 2.5e-4):
        model = made(Rigid, 8, **soft, step=h)
        model.step(0.0, 0.2, NONE)
        off.append(np.abs(model.pins() - exact.pins()).max())
        open_.append(abs(energy(model) + model.report[DISSIPATED] - start))
    for errors in (off, open_):
        assert np.abs(np.log2(np.array(errors[:-1]) / errors[1:]) - 2.0).max() < 0.3, errors


@pytest.mark.long
def test_a_stiffer_spring_takes_shorter_explicit_steps():
    steps = [
        made(Rigid, 8, **RECURSIVE, **SPRING, start="polygon", **{"closure.stiffness": k}).stable_step
        for k in (1e11, 1e13)
    ]
    assert steps[0] / steps[1] == pytest.approx(10.0, rel=0.05)
    free = made(Rigid, 8, **RECURSIVE | {"step": 0.02}, start="polygon")
    assert free.longest_step == 0.02 > free.stable_step, "nothing but its own motion bounds the steps of a free loop"


# Vehicles ------------------------------------------------------------------------------------------------------


def driven(*settings):
    scene = load("straight", "rigid", ["placed=true", "drive.ramp_start=0", "drive.ramp_time=0.1", *settings])
    return InProcess(scene)


SIDES = ("left", "right")
TRACK = ("track.integrator=runge_kutta", "track.formulation=recursive")


@pytest.mark.long
@pytest.mark.parametrize("closure", ["pin", "spring"])
def test_a_vehicle_on_joint_coordinates(closure):
    """A vehicle from rest moves as in the augmented formulation."""
    ends = []
    for settings in (TRACK, TRACK[:1]):
        vehicle = driven(*settings, f"track.closure={closure}")
        track = vehicle["left_track"]
        rest = track.model.pins().copy()
        vehicle.run(0.01)
        ends.append((track.y.copy(), track.model.pins().copy()))
        if settings is TRACK:
            assert track.model.counters[:COUNTERS][3] == 0
    (one, place), (other, there) = ends
    assert np.abs(place - there).max() < 1e-10
    assert np.abs(one - other).max() < 1e-6 * np.abs(one).max()
    assert 1e-5 < np.abs(place - rest).max() < 1e-2


# Monolith ------------------------------------------------------------------------------------------------------


@pytest.mark.study
@pytest.mark.parametrize("closure", ["pin", "spring"])
def test_a_vehicle_as_monolith(closure):
    """A vehicle as monolith has the same motion and forces in both formulations, mirrored side included."""
    shown = []
    for formulation in ("recursive", "augmented"):
        settings = ["drive.ramp_start=0", "drive.ramp_time=0.5", *TRACK[:1], f"track.closure={closure}"]
        assembly = assemble(placed(load("straight", "rigid", [*settings, f"track.formulation={formulation}"])))
        whole = Monolith(monolithic.parts_of(assembly), assembly.connections)
        for k in range(10):
            whole.advance(k * 1e-3, 1e-3)
        shown.append([(whole.models[f"{side}_track"].pins(), whole.models[f"{side}_track"].report) for side in SIDES])
    for (one, report), (other, theirs) in zip(*shown, strict=True):
        assert np.abs(one - other).max() < 1e-10
        assert np.abs(report - theirs).max() < 1e-6 * np.abs(report).max()
