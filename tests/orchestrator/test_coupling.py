"""Every coupling at every cut of two masses: order, stable step, energy; FMUs, scenes, variable steps."""

import inspect
import math
from contextlib import ExitStack
from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.linalg import expm

from orchestrator.cosim.component import Component
from orchestrator.cosim.coupling import COUPLINGS, coupling
from orchestrator.cosim.coupling.iterative import Coupling as Iterative
from orchestrator.cosim.coupling.iterative import anderson
from orchestrator.cosim.coupling.jacobi import Coupling as Jacobi
from orchestrator.cosim.coupling.scheme import CouplingFailed, require_states
from orchestrator.cosim.coupling.tracks_first import Coupling as TracksFirst
from orchestrator.cosim.coupling.variable_step import VariableStep
from orchestrator.cosim.graph import Connection, Instance, System, connect
from orchestrator.cosim.master import FixedStep, run
from orchestrator.execution import replay_model
from orchestrator.execution.loading import load_scene
from orchestrator.execution.prepared_run import PreparedRun
from orchestrator.execution.simulate import simulate
from orchestrator.fmi.slave import ComponentFailed
from orchestrator.log.reader import Log
from orchestrator.scene.assembly import assemble
from orchestrator.scene.scene import load
from orchestrator.scene.tables import CouplingTable
from orchestrator.studies.step_limits import amplification
from tests.validation import coupling as study
from tests.validation.coupling import DAMPED, FREE, MEMBERS, VARIANTS, couple, grows, predicted_limit, run_free
from tests.validation.slaves import coupled, whole


def hold(variant):
    return VARIANTS[variant][1].get("hold", "linear")


def test_every_coupling_is_a_variant():
    assert {scheme for scheme, _ in VARIANTS.values()} == set(COUPLINGS)


def test_options_of_a_coupling_are_those_of_its_class_and_of_the_scene():
    for name, options in COUPLINGS.items():
        assert {*inspect.signature(coupling(name)).parameters} == {"stages", "threads", *options}
    assert {option for options in COUPLINGS.values() for option in options} == {*CouplingTable.model_fields} - {
        "scheme"
    }


@pytest.mark.parametrize(("cut", "variant"), MEMBERS)
def test_order_is_the_declared_one(cut, variant):
    coarse, fine = run_free(variant, cut, 0.02)[0], run_free(variant, cut, 0.01)[0]
    declared = couple(variant, coupled(cut, FREE)[0]).ORDER
    assert math.log2(coarse / fine) == pytest.approx(declared, abs=0.1)


def test_a_mean_taken_for_a_value_costs_an_order():
    errors = []
    for h in (0.02, 0.01):
        stages, _, b = coupled("wrench", FREE)
        stages = tuple(
            tuple(m._replace(feeds=tuple(f._replace(carries="value", rates=None) for f in m.feeds)) for m in stage)
            for stage in stages
        )
        assert run(Jacobi(stages, threads=False), FixedStep(h, round(2 / h)), []).status == "ok"
        truth = expm(whole(FREE) * 2.0) @ FREE.start
        errors.append(abs(b.x[0] - truth[2]))
    assert math.log2(errors[0] / errors[1]) < 1.3


@pytest.mark.parametrize(("cut", "variant"), MEMBERS)
def test_the_code_does_what_the_matrix_says(cut, variant):
    h = 0.03
    stages, a, b = coupled(cut, DAMPED)
    scheme = couple(variant, stages)
    matrix = amplification(VARIANTS[variant][0], hold(variant), cut, DAMPED, h)

    def now():
        past = scheme.past.outputs
        return np.concatenate([a.x, b.x, a.y, b.y, past["a"], past["b"]])

    for k in range(4):
        scheme.advance(k * h, h)
    before = now()
    scheme.advance(4 * h, h)
    assert now() == pytest.approx(matrix @ before, abs=1e-8 if variant == "iterative" else 1e-12)


@pytest.mark.long
@pytest.mark.parametrize(("cut", "variant"), MEMBERS)
def test_stable_below_the_predicted_limit_and_not_above(cut, variant):
    limit = predicted_limit(variant, cut)
    if math.isinf(limit):
        assert not grows(variant, cut, 0.9 * study.MAX_STEP, steps=200)
        return
    assert not grows(variant, cut, 0.95 * limit)
    assert grows(variant, cut, 1.05 * limit)


def test_the_limit_belongs_to_the_spring():
    """A spring that is 20 % stiffer grows at the limit of the right one (twin)."""
    limit = predicted_limit("jacobi linear", "wrench")
    assert grows("jacobi linear", "wrench", 0.95 * limit, DAMPED._replace(k=1.2 * DAMPED.k))


def test_uneven_steps_keep_the_order():
    """Uneven steps (ratio 1 : 2 : 3) keep order two; a scheme that ignores them has order one."""
    for variant in ("jacobi linear", "gauss_seidel linear", "iterative"):
        errors = []
        for h in (0.02, 0.01):
            stages, a, b = coupled("wrench", FREE)
            scheme, t = couple(variant, stages), 0.0
            for k in range(round(3.0 / h / 2)):
                scheme.advance(t, h * (1 + k % 3))
                t += h * (1 + k % 3)
            truth = expm(whole(FREE) * t) @ FREE.start
            errors.append(np.hypot(a.x[0] - truth[0], b.x[0] - truth[2]))
        assert math.log2(errors[0] / errors[1]) == pytest.approx(2.0, abs=0.2), variant


def test_iteration_that_does_not_converge_says_so():
    stages, *_ = coupled("spring", DAMPED)
    outcome = run(Iterative(stages, 1e-12, 2, threads=False), FixedStep(0.3, 10), [])
    assert outcome.status == "failed"
    assert "a.v still changes by" in outcome.message
    assert "after 2 iterations at t = " in outcome.message


def test_acceleration_solves_what_repetition_does_not():
    matrix, rest = np.array([[3.0, 1.0], [-2.0, 4.0]]), np.array([1.0, -1.0])
    z, history = np.zeros(2), []
    for _ in range(4):
        history.append((z, matrix @ z + rest - z))
        z = anderson(history)
        assert len(history) > 1 or z == pytest.approx(rest), "the first step is a repetition"
    assert matrix @ z + rest == pytest.approx(z, abs=1e-9)


class NoWayBack:
    name, inputs, outputs, u, y = "poor", (), (), np.zeros(0), np.zeros(0)

    def save(self):
        raise ComponentFailed("poor: the FMU cannot save its state")


def test_components_without_states_are_refused():
    stages = connect(System((Instance("poor", None, {}, 0),), ()), {"poor": NoWayBack()})
    with pytest.raises(CouplingFailed, match="poor: the FMU cannot save its state, which coupling 'iterative' needs"):
        Iterative(stages)
    with pytest.raises(CouplingFailed, match="which a variable step needs"):
        require_states(Jacobi(stages), "a variable step")


# The master ---------------------------------------------------------------------------------------------------------


def test_observers_see_every_point_once_with_the_inputs_of_the_step_and_the_impulse_enters_the_other_side():
    stages, a, b = coupled("wrench", FREE)
    seen, before = [], []

    def watch(k, t, h):
        seen.append((k, t))
        if k:
            assert a.u.tolist() == before[-1], "inputs are not those of the step"
            assert b.u.tolist() == a.y[[a.outputs.index(name) for name in b.inputs]].tolist()
        before.append(b.y[[b.outputs.index(name) for name in a.inputs]].tolist())

    assert run(couple("tracks_first", stages), FixedStep(0.1, 5), [watch])[:3] == ("ok", "", 5)
    assert seen == [(k, k * 0.1) for k in range(6)]


def test_a_failure_ends_the_run_with_its_sentence_and_an_interruption_between_steps():
    stages, _, b = coupled("wrench", FREE)
    step, seen = b.step, []

    def failing(t, h):
        if t > 0.25:
            raise ComponentFailed("motion: no convergence at t = 0.3 s")
        step(t, h)

    b.step = failing
    outcome = run(couple("tracks_first", stages), FixedStep(0.1, 100), [lambda k, t, h: seen.append(k)])
    assert outcome[:3] == ("failed", "motion: no convergence at t = 0.3 s", 3)
    assert (outcome.time, seen) == (pytest.approx(0.3), [0, 1, 2, 3])
    scheme = couple("tracks_first", coupled("wrench", FREE)[0])
    seen.clear()
    outcome = run(scheme, FixedStep(0.1, 100), [lambda k, t, h: seen.append(k)], lambda: len(seen) > 4)
    assert (outcome.status, outcome.steps, seen) == ("interrupted", 4, [0, 1, 2, 3, 4])


# Real FMUs ----------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def pair(toy):
    """Two masses on springs, each pulled with 1 N/m by the position of the other."""
    with Component(toy, "one") as one, Component(toy, "two") as two:
        yield one, two


def pulled(pair, variant, pace):
    """Sum of the errors of both positions at 0.4 s."""
    for component, x in zip(pair, (0.1, 0.0), strict=True):
        component.u[0] = 0.1 - x
        component.initialise({"start.x": x, "substeps": 40, "stiffness": 9.0, "damping": 0.0})
    links = [Connection(s, ("x",), t, ("force",), "value", ("v",)) for s, t in (("one", "two"), ("two", "one"))]
    system = System((Instance("one", None, {}, 0), Instance("two", None, {}, 1)), tuple(links))
    name, options = VARIANTS[variant]
    outcome = run(coupling(name)(connect(system, dict(zip(("one", "two"), pair, strict=True))), **options), pace, [])
    assert outcome.status == "ok", outcome.message
    A = np.array([[0, 1, 0, 0], [-9, 0, 1, 0], [0, 0, 0, 1], [1, 0, -9, 0]], dtype=float)
    truth = expm(A * outcome.time) @ [0.1, 0.0, 0.0, 0.0]
    return abs(pair[0].y[0] - truth[0]) + abs(pair[1].y[0] - truth[2])


@pytest.mark.parametrize("variant", VARIANTS)
def test_two_fmus(pair, variant):
    coarse, fine = (pulled(pair, variant, FixedStep(h, round(2.0 / h))) for h in (0.1, 0.05))
    declared = 1 if variant.endswith("constant") else 2
    assert math.log2(coarse / fine) == pytest.approx(declared, abs=0.35)


def test_two_fmus_in_variable_steps(pair):
    loose, tight = (pulled(pair, "tracks_first", VariableStep(2.0, 0.05, e, 1e-4, 0.5)) for e in (1e-3, 1e-5))
    assert tight < 0.2 * loose
    assert tight < 1e-5


# Variable steps -----------------------------------------------------------------------------------------------------


def test_variable_steps_land_on_the_end_and_show_every_point_as_it_was():
    stages, a, _ = coupled("wrench", DAMPED)
    seen = []
    pace = VariableStep(1.0, 0.5, 1e-4, 1e-5, 1.0)
    outcome = run(
        couple("gauss_seidel linear", stages), pace, [lambda k, t, h: seen.append((k, t, h, a.u.copy(), a.x))]
    )
    assert outcome.status == "ok"
    assert outcome.time == pytest.approx(1.0, abs=1e-12)
    assert pace.rejected_steps > 0
    assert pace.forced_steps == 0
    assert [k for k, *_ in seen] == list(range(len(seen)))
    assert all(after[1] == before[1] + after[2] for before, after in pairwise(seen))
    assert a.steps > len(seen), "rejected steps must count"
    stages, again, _ = coupled("wrench", DAMPED)  # side a alone with the recorded inputs
    for before, after in pairwise(seen):
        again.u[:] = after[3]
        again.step(before[1], after[2])
        assert np.array_equal(again.x, after[4])


def test_the_shortest_step_is_kept_and_counted():
    stages, *_ = coupled("wrench", DAMPED)
    pace = VariableStep(0.2, 0.01, 1e-12, 0.01, 0.01)
    assert run(couple("tracks_first", stages), pace, []).steps == 20
    assert (pace.rejected_steps, pace.forced_steps) == (0, 10)


def test_steps_that_are_kept_with_too_large_an_error_are_a_warning():
    run_table = SimpleNamespace(variable=SimpleNamespace(shortest=0.01))
    for tolerance, said in ((1e-12, ["10 steps of run.variable.shortest = 0.01 s have too large an error"]), (1.0, [])):
        pace = VariableStep(0.2, 0.01, tolerance, 0.01, 0.01)
        run(couple("tracks_first", coupled("wrench", DAMPED)[0]), pace, [])
        prepared = SimpleNamespace(step_control=pace, scene=SimpleNamespace(run=run_table))
        assert [warning["text"] for warning in PreparedRun.forced_steps(prepared)] == said


def test_the_last_two_pairs_of_variable_steps_are_even():
    """At most two pairs before the end share what remains, so that no step is far shorter than the others."""
    stages, *_ = coupled("wrench", DAMPED)
    lengths = []
    run(couple("tracks_first", stages), VariableStep(0.25, 0.05, 10.0, 1e-3, 0.05), [lambda k, t, h: lengths.append(h)])
    assert lengths[1:] == pytest.approx([0.05, 0.05, *[0.0375] * 4])


def test_a_failing_step_is_tried_shorter():
    stages, a, _ = coupled("wrench", DAMPED)
    step = a.step

    def fussy(t, h):
        if h > 0.015:
            raise ComponentFailed(f"a: no convergence at t = {t:g} s")
        step(t, h)

    a.step = fussy
    pace = VariableStep(0.3, 0.1, 1e-2, 1e-3, 0.1)
    assert run(couple("tracks_first", stages), pace, []).status == "ok"
    assert pace.rejected_steps > 0
    stages, a, _ = coupled("wrench", DAMPED)
    a.step = lambda t, h: (_ for _ in ()).throw(ComponentFailed("a: never"))
    assert run(couple("tracks_first", stages), pace, [])[:3] == ("failed", "a: never", 0)


@pytest.mark.long
def test_variable_steps_cost_no_more_than_fixed_ones_of_the_same_error():
    for row in study.steps_at_equal_error((study.TOLERANCES[2],)):
        assert row.ok, row


# Scenes -------------------------------------------------------------------------------------------------------------

BRIEF = ("run.stop=12 ms", "run.links=1", "drive.ramp_time=0.01 s")
WAYS = {  # those that FMUs of the user do not have in runs of theirs
    "iterative": ("run.coupling=iterative",),
    "held": ("run.coupling={scheme='jacobi', hold='constant'}",),
    "power": ("run.variable.estimate=power", "run.variable.tolerance=1e-4", "run.variable.longest=4 ms"),
}


@pytest.mark.long
@pytest.mark.parametrize("way", WAYS)
def test_a_rig_runs_and_replays_with_every_coupling(way, tmp_path):
    path = tmp_path / "rig.mcap"
    result = simulate(load("rig", "rigid", (*BRIEF, *WAYS[way])), path)
    assert result["status"] == "ok"
    assert ("energy ledger leaves" in result["message"]) == (way == "held"), "only held inputs warn"
    assert result["simulated_time"] == pytest.approx(0.012)
    with Log(path) as log:
        named = {"held": "jacobi (hold = constant)", "power": "tracks_first"}
        assert log.metadata["run"]["coupling"] == named.get(way, way)
        h = log.read("/track/in").h
        assert (np.ptp(h) > 0.0) == (way == "power")
        assert log.read("/track/in").t + h == pytest.approx(log.read("/track/out").t[1:], abs=1e-15)
    for name in ("track", "drive"):
        with replay_model.open_replay(path, name, None) as again:
            verdict = again.verify()
        assert verdict.difference is None, verdict.sentence


# Masters that copy the latest outputs before each step: claims of fmus/in_your_tool.md ------------------------------

STEP, STOP, WINDOW = 2e-3, 3.5, 0.5  # s
SETTINGS = ("run.step=2 ms", "run.stop=3.5 s", "drive.ramp_start=0 s", "drive.ramp_time=3 s")


class Latest(TracksFirst):
    """Master that gives each component the latest outputs of the others."""

    def rule(self, feed, source_stepped):
        return "end" if source_stepped else "start"


def mean_tension(coupling, order):
    """Mean link tension of the left track at 4.9 m/s, N; ``order``: stages of track, drive and chassis."""
    stages = dict(zip(("track", "drive", "chassis"), order, strict=True))
    with ExitStack() as stack:
        scene = load("straight", "rigid", SETTINGS)
        _, graph, components = load_scene(scene, assemble(scene), stack, None)
        instances = (each._replace(stage=stages[each.name.split("_")[-1]]) for each in graph.instances)
        track, chassis, samples = components["left_track"], components["chassis"], []
        with coupling(connect(graph._replace(instances=tuple(instances)), components)) as scheme:
            for k in range(round(STOP / STEP)):
                scheme.advance(k * STEP, STEP)
                if (k + 1) * STEP > STOP - WINDOW:
                    samples.append(track.y[track.outputs.index("tension.mean")])
        assert chassis.y[chassis.outputs.index("speed")] == pytest.approx(4.9, abs=0.1)
    return sum(samples) / len(samples)


@pytest.mark.study
def test_a_track_must_see_its_wheels_at_one_instant():
    right = mean_tension(TracksFirst, (0, 1, 2))
    assert mean_tension(Latest, (0, 1, 2)) == right
    assert mean_tension(Latest, (0, 0, 0)) == pytest.approx(right, rel=2e-3)
    for wrong in ((1, 0, 2), (2, 1, 0)):  # drives before tracks
        assert mean_tension(Latest, wrong) / right == pytest.approx(1.17, abs=0.02), wrong
