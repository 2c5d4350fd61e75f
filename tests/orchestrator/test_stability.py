"""The study of stability: limits against closed forms, verdicts on fast cases, table and map."""

import csv
import io
import math

import numpy as np
import pytest
from scipy.linalg import expm

from fmus.vehicles.tables import BadInput
from orchestrator.fmi.slave import ComponentFailed
from orchestrator.scene.scene import load
from orchestrator.studies import Row, stability, step_limits, verdict
from orchestrator.studies.step_limits import Oscillator, amplification
from orchestrator.studies.verdict import BLOWN, CLEAN, MUTE, RIGHT, WRONG, with_verdict

# --- limits ---


def step_of(pair, h):
    """Matrix (4, 4) of one step: position and velocity of the chain, then of the wheel."""
    step = amplification("tracks_first", "linear", "wrench", pair, h)
    return np.hstack([step[:4, :2], step[:4, 2:4] + step[:4, 5:7]])


def test_a_wheel_on_a_chain_that_stands_still():
    """A wheel on a fixed chain is unstable above k h^2 / 2 m + c h / m = 2.

    The mean force is k (x + v h / 2) + c v.
    """
    k, c, m = 5.4e6, 1.35e4, 430.0
    exact = (-c + math.sqrt(c * c + 4.0 * k * m)) / k
    pair = Oscillator(k, c, 1.0, m, k1=1e13, c1=1e5, k2=0.0)
    assert step_limits.coupling_limit(pair) == pytest.approx(exact, rel=1e-3)
    assert step_limits.coupling_limit(pair._replace(k=1.05 * k)) != pytest.approx(exact, rel=1e-2)
    undamped = pair._replace(c=0.0)
    assert step_limits.coupling_limit(undamped) == pytest.approx(2.0 * math.sqrt(m / k), rel=1e-3)


def test_two_free_masses_keep_their_momentum_across_the_cut():
    pair = Oscillator(1e5, 300.0, 20.0, 50.0, k1=0.0, k2=0.0)
    weights = np.array([0.0, pair.m1, 0.0, pair.m2])
    np.testing.assert_allclose(weights @ step_of(pair, 3e-3), weights, rtol=1e-9, atol=1e-6)


def test_short_steps_follow_the_exact_motion():
    """Short steps follow the exact motion with order 2: half the step, a quarter of the error."""
    p = Oscillator(1e5, 0.0, 20.0, 50.0, k1=1e4, k2=2e4)
    K = np.array([[p.k + p.k1, -p.k], [-p.k, p.k + p.k2]])
    A = np.zeros((4, 4))
    A[0, 1] = A[2, 3] = 1.0
    A[1, ::2], A[3, ::2] = -K[0] / p.m1, -K[1] / p.m2
    exact = expm(A * 0.05)

    def error(steps):
        made = np.linalg.matrix_power(step_of(p, 0.05 / steps), steps)
        return np.linalg.norm(made - exact)

    assert 1.8 < math.log2(error(50) / error(100)) < 2.2


@pytest.mark.parametrize(("frequency", "relaxation"), [(3e5, 0.0), (3e5, 1e-6), (3e5, 1e-5), (10.0, 0.3)])
def test_explicit_limit_is_where_the_method_begins_to_grow(frequency, relaxation):
    """The explicit limit is where the method begins to grow on the damped oscillator."""
    A = np.array([[0.0, 1.0], [-(frequency**2), -relaxation * frequency**2]])

    def radius(h):
        z = A * h
        step = np.eye(2) + z @ (np.eye(2) + z / 2 @ (np.eye(2) + z / 3 @ (np.eye(2) + z / 4)))
        return abs(np.linalg.eigvals(step)).max()

    limit = step_limits.explicit_limit(frequency, relaxation)
    assert radius(0.99 * limit) < 1.0 < radius(1.01 * limit)


@pytest.mark.long
def test_margins_fall_with_stiffness_and_friction():
    calm = step_limits.predicted(load("settle"))
    assert calm[1] == "idler in its bend"
    stiff = [f"vehicle.contact.wheel.stiffness={2e8}"]
    assert step_limits.predicted(load("settle", None, stiff))[0] < 0.2 * calm[0]
    sticky = ["vehicle.contact.wheel.friction_velocity=1e-4"]
    limit, cause = step_limits.predicted(load("settle", None, sticky))
    assert (limit < 0.1 * calm[0], cause) == (True, "friction that spins a road wheel")
    assert math.isnan(step_limits.predicted(load("hanging_chain"))[0])


# --- verdicts ---

CHAIN = ("chain.links=8", "run.stop=0.05 s", "run.links=1")


def test_a_right_run_and_a_wrong_one(monkeypatch):
    scene = load("hanging_chain", "flexible", CHAIN)
    row = verdict.judged_run(scene, "sag")
    assert row["verdict"] == RIGHT, row.note
    assert row["found"] == pytest.approx(row["expected"], rel=1e-4)
    shorter = load("hanging_chain", "flexible", [*CHAIN, "chain.span=0.81"])
    expects = verdict.EXPECTATIONS["sag"]
    monkeypatch.setitem(verdict.EXPECTATIONS, "sag", (lambda run, _: expects[0](run, shorter), expects[1]))
    assert verdict.judged_run(scene, "sag")["verdict"] == WRONG


def outcome(monkeypatch, **result):
    def fake(scene, path, raise_faults):
        for value in result.values():
            if isinstance(value, Exception):
                raise value
        return {"status": "failed", "message": "", "communication_steps": 0, "energy": None} | result

    monkeypatch.setattr(verdict, "simulate", fake)
    return verdict.judged_run(load("hanging_chain", "flexible", CHAIN), "ledger")


def test_ends_that_are_not_right(monkeypatch):
    assert outcome(monkeypatch, refused=BadInput("no"))["verdict"] == CLEAN
    assert outcome(monkeypatch, refused=ComponentFailed("left_track: lost"))["verdict"] == CLEAN
    assert outcome(monkeypatch, message="Newton at t = 1 s")["verdict"] == CLEAN
    assert outcome(monkeypatch, message="")["verdict"] == MUTE
    with pytest.raises(ZeroDivisionError):  # the pool turns it into a row, and the test looks for that row
        outcome(monkeypatch, refused=ZeroDivisionError("bug"))


@pytest.mark.long
def test_an_explicit_step_beyond_its_limit_fails_with_a_sentence():
    settings = [*CHAIN, "track.start=displaced", "track.integrator=runge_kutta"]
    damped = load("hanging_chain", "flexible", [*settings, "vehicle.material.relaxation_time=1e-5 s"])
    assert step_limits.predicted(damped)[0] < 4e-6
    row = verdict.judged_run(damped, "ledger")
    assert (row["verdict"], "take half of the step" in row.note) == (CLEAN, True), row


def case(family, name, value, verdict, sensible, note="", **figures):
    known = {"value": value, "verdict": verdict, "sensible": sensible, "asked": "x"}
    return Row(family, name, known | figures, note=note)


CLOSE = {"expected": 1.0, "tolerance": 0.1, "step": 1e-3}
ROWS = [
    case("a, m", "1", 1.0, RIGHT, True, found=1.0, predicted=1e-2, cause="idler", **CLOSE),
    case("a, m", "2", 2.0, WRONG, False, "x | y", found=2.0, predicted=1e-3, **CLOSE),
    case("b", "1", 1.0, CLEAN, False, "Newton"),
    case("b", "2", 2.0, CLEAN, True, "Newton"),
    case("b", "3", 3.0, BLOWN, False),
    Row("c", "1", ok=False, note="took longer than 600 s"),
]


def test_table_and_map(tmp_path):
    graded = [with_verdict(row, row["verdict"], row.note or "a sentence") for row in ROWS[:-1]]
    assert [row.ok for row in graded] == [True, True, True, False, True]
    silent = with_verdict(graded[-1], BLOWN, "")
    assert (silent["verdict"], silent.ok, silent.note) == (MUTE, False, "")
    last = stability.table(ROWS).markdown().splitlines()[-1]
    assert last == "6 cases: 1 stable and right, 1 stable and wrong, 2 failed cleanly, 1 blown up, 1 no sentence."
    read = list(csv.DictReader(io.StringIO(stability.table(ROWS).csv())))
    assert (read[0]["margin"], read[2]["margin"], read[5]["what happened"]) == ("10.0", "", "took longer than 600 s")
    made = stability.write(tmp_path, "stability", ROWS, stability.TITLE)
    assert [file.suffix for file in made] == [".csv", ".md", ".png", ".svg"]
    assert all(file.stat().st_size > 300 for file in made)
