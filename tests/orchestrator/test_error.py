"""The error of a run: norm, own estimate, cost of precision, study of error against run time."""

import json
import math
import re
import sys

import numpy as np
import pytest
from short_run import SHORT, last

from fmus.vehicles.tables import BadInput
from orchestrator.cli import common, main
from orchestrator.execution import precision
from orchestrator.execution.estimate import _NoEstimate, _with_differences, companions, estimate
from orchestrator.execution.log_report import summary_of
from orchestrator.execution.manifest import decode_results
from orchestrator.execution.precision import Setting, cheapest, fraction, pareto_front
from orchestrator.execution.simulate import simulate
from orchestrator.execution.summary_text import lines
from orchestrator.log.reader import Log, LogUnreadable
from orchestrator.results.difference import (
    Observable,
    ObservableDifference,
    ObservableSamples,
    aligned,
    difference,
    differences,
    differences_of_logs,
    worst,
)
from orchestrator.results.run_data import RunData
from orchestrator.scene.scene import load
from orchestrator.studies import Case, Row, error_runtime
from orchestrator.studies.runs import record

SWING = ("chain.links=8", "track.start=displaced", "run.stop=0.064 s", "run.links=1")
LINE = Observable("m", 0.1, lambda run: ObservableSamples(np.zeros(1), np.zeros((1, 1))))


def signal(step, function, mean=False):
    t = np.arange(0.0, 1.0 + step / 2, step)
    return ObservableSamples(t, function(t)[:, None], mean)


def test_the_norm_of_a_known_difference():
    run, reference = signal(0.01, lambda t: 2.02 + 0 * t), signal(0.01, lambda t: 2.0 + 0 * t)
    offset = difference(run, reference, LINE)
    assert offset.absolute == pytest.approx(0.02)
    assert offset.relative == pytest.approx(0.01)
    still = difference(signal(0.01, lambda t: 1e-3 + 0 * t), signal(0.01, lambda t: 0 * t), LINE)
    assert still.relative == pytest.approx(0.01), "a constant signal has no error relative to the floor"


def test_runs_of_other_steps_meet_at_the_instants_of_the_sparser():
    a, b = aligned(signal(0.02, lambda t: t), signal(0.005, lambda t: t))
    assert a.shape == b.shape == (51, 1)
    np.testing.assert_allclose(a, b, atol=1e-12)


def test_means_meet_as_means():
    """Means of t over steps of 20 and of 5 ms agree as means over 20 ms; instants taken for means do not."""
    coarse, fine = (signal(h, lambda t, h=h: t - h / 2, mean=True) for h in (0.02, 0.005))
    a, b = aligned(coarse, fine)
    np.testing.assert_allclose(a, b, atol=1e-12)
    a, b = aligned(coarse._replace(mean=False), fine._replace(mean=False))
    assert np.abs(a - b).max() > 5e-3


@pytest.mark.long
def test_joint_forces_do_not_depend_on_the_interval_of_their_means(tmp_path):
    """Joint forces do not depend on the interval of their means, 2.5 or 10 ms."""
    paths = [tmp_path / name for name in ("fine.mcap", "coarse.mcap", "tight.mcap")]
    for path, how in zip(
        paths, (("run.links=1",), ("run.links=4",), ("run.links=4", "rig.tension=10.3 kN")), strict=True
    ):
        simulate(load("rig", "rigid", ("run.step=2.5 ms", "run.stop=100 ms", *how)), path)
    names = ("joint_force", "joint_force_mean", "joint_force_rms")
    same, other = (differences_of_logs(path, paths[1]) for path in (paths[0], paths[2]))
    assert max(same[name].relative for name in names) < 1e-9
    assert min(other[name].relative for name in names) > 5e-3


def test_only_decisive_observables_decide():
    observables = {"a": ObservableDifference(1, 0.1, "m", True), "b": ObservableDifference(1, 0.5, "m", False)}
    assert worst(observables) == 0.1


@pytest.fixture(scope="module")
def swings(tmp_path_factory):
    """Return summaries and logs, by step in ms, of short swings of a chain, each with its own estimate."""
    folder, summaries = tmp_path_factory.mktemp("swings"), {}
    for step in (4.0, 2.0, 0.25):
        log = folder / f"{step}.mcap"
        settings = (*SWING, f"run.step={step} ms", f"track.step={step} ms")
        summaries[step] = simulate(load("hanging_chain", "flexible", settings), log, estimated=True)
        assert summaries[step]["status"] == "ok"
    return summaries


@pytest.mark.parametrize("step", [4.0, 2.0])
def test_the_estimate_is_within_a_factor_of_three(swings, step):
    with Log(swings[step]["log"]) as run, Log(swings[0.25]["log"]) as fine:
        true = differences(RunData(run), RunData(fine))
    own = swings[step]["error"]
    assert own["coupling"] == 0.0, "an uncoupled system has no coupling error"
    assert own["total"] == own["integration"]
    for name, one in true.items():
        assert 1 / 3 < own["observables"][name]["total"] / one.relative < 3, name
    assert own["total"] / worst(true) < 3


@pytest.mark.long
def test_steps_that_were_halved_do_not_spoil_the_companions(tmp_path):
    """Halved steps do not spoil the companion runs of the estimate.

    A track that took 12 steps more than 1000 was set to one per communication step: doubled, its step is 8 ms.
    """
    asked = []

    def record(scene, path):
        asked.append((scene.run.step, scene.track.step))
        return {"status": "failed", "message": "not run"}

    scene = load("straight", "flexible", ("run.step=4 ms", "track.step=4 ms", "run.stop=4 s"))
    costs = {"left_track": {"steps": 1012}, "right_track": {"steps": 1000}, "chassis": {"steps": 0}}
    summary = {"components": costs, "simulated_time": 4.0, "communication_steps": 1000}
    assert estimate(scene, tmp_path / "no.mcap", summary, record)["total"] is None
    summary["components"]["left_track"]["steps"] = 2012
    estimate(scene, tmp_path / "no.mcap", summary, record)
    assert asked == [(0.008, 0.004), (0.008, 0.002)]
    explicit = load("straight", "flexible", ("track.integrator=runge_kutta",))
    alike = companions(explicit, 8e-6, 4.0, 5)
    assert alike.total == alike.coupling, "its stable step cannot be doubled"
    soft = companions(explicit, explicit.track.step, 4.0, 5)
    assert soft.total.track.step == 2.0 * soft.coupling.track.step, "the twin: the requested step can be doubled"


@pytest.mark.parametrize("integrator", ["adams", "dormand_prince"])
def test_an_integrator_that_chooses_its_steps_gets_looser_tolerances_and_longer_steps(integrator):
    chosen = f"track.integrator={integrator}", "track.rtol=1e-8", "track.step=5 ms", "run.step=10 ms"
    of_one, of_several = (companions(load("hanging_chain", "rigid", chosen), 5e-3, 2.0, n) for n in (1, 2))
    assert of_one.coupling is None
    assert of_several.coupling.track.rtol == 1e-8
    for total in (of_one.total, of_several.total):
        given = total.track.rtol, total.track.atol, total.track.step, total.run.step
        assert given == pytest.approx((1e-7, 1e-5, 10e-3, 20e-3))


@pytest.mark.long
@pytest.mark.parametrize(("step", "known"), [("1 ms", False), ("1 us", True)])
def test_a_chain_at_its_stable_step_has_nothing_coarser_beside_it(tmp_path, step, known):
    """A chain at its stable step has no coarser companion.

    Explicit cables are stable to 3.6 us, whatever longer step is requested; a shorter one can be doubled.
    """
    explicit = ("chain.links=8", "track.start=displaced", "track.integrator=runge_kutta", f"track.step={step}")
    scene = load("hanging_chain", "flexible", (*explicit, "run.step=1 ms", "run.stop=10 ms", "run.links=1"))
    own = simulate(scene, tmp_path / "run.mcap", estimated=True)["error"]
    assert (own["total"] is not None) == known
    assert ("as long as stability allows" in own["message"]) != known


@pytest.mark.long
def test_a_coupled_track_at_its_stable_step_knows_its_coupling_alone(tmp_path, capsys):
    scene = load("rig", "rigid", ("track.integrator=runge_kutta", "run.step=1 ms", "run.stop=20 ms", "run.links=1"))
    summary = simulate(scene, tmp_path / "run.mcap", estimated=True)
    own = summary["error"]
    assert own["integration"] is None
    assert own["total"] == own["coupling"] > 0.0
    common.summary(summary)
    assert "integration not known" in capsys.readouterr().out


def test_a_companion_that_cannot_be_right_estimates_nothing(tmp_path):
    def record(scene, path):
        open_ledger = {"residual_relative": 0.4, "integration_relative": {}}
        return {"status": "ok", "message": "40 % open", "energy": open_ledger, "log": str(path)}

    scene = load("straight", "flexible", ())
    summary = {"components": {"left_track": {"steps": 8000}}, "simulated_time": 8.0, "communication_steps": 8000}
    entry = estimate(scene, tmp_path / "no.mcap", summary, record)
    assert entry["total"] is None
    assert "cannot be right: 40 % open" in entry["message"]


def test_a_companion_that_ends_early_estimates_nothing(tmp_path):
    def record(scene, path):
        ended = share * scene.run.stop
        return {"status": "ok", "message": "", "energy": None, "simulated_time": ended, "log": "no.mcap"}

    scene, costs = load("straight", "flexible", ()), {"left_track": {"steps": 8000}, "chassis": {"steps": 0}}
    summary = {"components": costs, "simulated_time": 8.0, "communication_steps": 8000}
    share = 0.5
    entry = estimate(scene, tmp_path / "no.mcap", summary, record)
    assert (entry["total"], entry["message"]) == (None, "the run at twice the step ends at 4 s")
    share = 1.0
    with pytest.raises(LogUnreadable, match=r"no\.mcap"):  # the twin: it goes on to the logs
        estimate(scene, tmp_path / "no.mcap", summary, record)


@pytest.mark.parametrize(("groups", "without"), [("['tension']", ["pins"]), ("['tension','position']", [])])
def test_observables_without_an_estimate_are_named(cotrack, groups, without):
    status, out, err = cotrack(*SHORT, "--set", f"track.link_outputs={groups}")
    result = last(out)
    assert status == 0, err
    assert result["error"]["without"] == without
    assert set(result["error"]["observables"]) == {"tension", "pins"} - set(without)
    assert (", not known of pins (coupling" in "\n".join(lines(summary_of(result["log"])))) == bool(without)


def test_a_difference_that_is_no_number_is_no_estimate():
    """Of two observables one is infinite in one part: the other one decides; alone there is no estimate."""
    good, bad = (ObservableDifference(1.0, share, "m", decisive=True) for share in (0.1, math.inf))
    parts = {"coupling": {}, "integration": {"a": good, "b": bad}, "total": {"a": good, "b": good}}
    found, without = _with_differences(parts, ["a", "b", "c"])
    assert (found["total"], found["coupling"], without) == ({"a": good}, {}, ["b", "c"])
    with pytest.raises(_NoEstimate, match="no observable has a finite difference"):
        _with_differences(parts, ["b", "c"])


def test_a_study_makes_no_run_twice():
    scene, other = (load("hanging_chain", "flexible", (*SWING, f"run.step={h} ms")) for h in (4, 2))
    first, again, second = record(scene), record(scene.model_copy()), record(other)
    assert again is first
    assert second["log"] != first["log"]
    assert second["communication_steps"] == 2 * first["communication_steps"]


def test_the_log_closes_with_error_and_cost(swings):
    with Log(swings[2.0]["log"]) as log:
        results = {name: json.loads(text) for name, text in log.closing["results"].items()}
    assert results["error"] == swings[2.0]["error"]
    assert results["wall_time"] == swings[2.0]["wall_time"]
    assert results["energy_residual"] == swings[2.0]["energy"]["residual_relative"]
    opened = summary_of(swings[2.0]["log"])
    assert {key for key, value in swings[2.0].items() if opened[key] != value} == set()
    assert "\n  estimated error: " in "\n".join(lines(opened))
    with Log(swings[2.0]["log"]) as log:
        texts = log.closing["results"]
    assert decode_results(texts) == decode_results(texts | {"validity": "nonsense"})
    earlier = decode_results({name: text for name, text in texts.items() if name in ("wall_time", "error")})
    assert (earlier["wall_time"], earlier["error"]) == (swings[2.0]["wall_time"], swings[2.0]["error"])
    for odd in ({"error": "1"}, {"error": texts["error"].replace("true", "false")}, {"wall_time": "["}):
        assert decode_results(texts | odd) == decode_results({})


def test_a_run_too_short_says_so(tmp_path):
    settings = ("chain.links=8", "run.stop=0.002 s")
    summary = simulate(load("hanging_chain", "flexible", settings), tmp_path / "a.mcap", estimated=True)["error"]
    assert summary["total"] is None
    assert "too short" in summary["message"]


def test_compare_and_version(swings, monkeypatch, capsys):
    def call(*arguments):
        monkeypatch.setattr(sys, "argv", ["cotrack", *map(str, arguments)])
        with pytest.raises(SystemExit) as ended:
            main()
        return ended.value.code or 0, capsys.readouterr()

    status, said = call("compare", swings[4.0]["log"], swings[2.0]["log"])
    assert status == 0, said.err
    assert [line.split()[0] for line in said.out.splitlines()] == ["run", "reference", "observable", "pins", "tension"]
    status, said = call("compare", swings[4.0]["log"], "nothing.mcap")
    assert status == 2
    assert len(said.err.splitlines()) == 1
    status, said = call("--version")
    assert (status, said.out.split()[0]) == (0, "cotrack")


# --- the cost of precision --------------------------------------------------------------------------

ROWS = [
    Setting("swing", "flexible", ("run.step=4 ms",), 0.1, 1.0),
    Setting("swing", "flexible", ("run.step=2 ms",), 0.02, 2.0),
    Setting("swing", "flexible", ("run.step=3 ms",), 0.2, 1.5),
    Setting("swing", "rigid", ("run.step=1 ms",), 0.001, 9.0),
]


def test_the_cheapest_setting_within_an_error(tmp_path, monkeypatch):
    monkeypatch.setenv("COTRACK_CACHE", str(tmp_path))
    assert [row.wall_time for row in pareto_front(ROWS[:3])] == [1.0, 2.0]
    precision.write(ROWS, precision.local_file())
    precision.write([ROWS[3]._replace(wall_time=8.0)], precision.local_file())
    assert cheapest("swing", "flexible", 0.15).wall_time == 1.0
    assert cheapest("swing", "flexible", 0.05).wall_time == 2.0
    assert cheapest("swing", "rigid", 0.05).wall_time == 8.0, "the newer study of a track model counts"
    with pytest.raises(BadInput, match=r"the best has an error of 0\.02"):
        cheapest("swing", "flexible", 0.01)
    with pytest.raises(BadInput, match="study error-runtime swung"):
        cheapest("swung", "flexible", 0.01)


def test_fractions():
    assert fraction("1%") == fraction("0.01") == 0.01
    for text in ("", "x%", "0", "-1%", "150%"):
        with pytest.raises(BadInput, match="between 0 and 100 %"):
            fraction(text)


def test_shipped_settings_are_sound():
    """Every shipped setting loads, and its scene is one of the gallery."""
    assert re.fullmatch("[0-9a-f]{40}", json.loads(precision.SHIPPED.read_text())["commit"])
    shipped = precision.read(precision.SHIPPED)
    assert {row.scene for row in shipped} >= {"hanging_chain", "rig", "straight"}
    for row in shipped:
        assert load(row.scene, row.track, row.settings).track.model == row.track
        assert 0.0 < row.error < 1.0


def test_cases_of_the_study_have_names_of_their_own():
    assert len({case.name for case in error_runtime.cases(False, "rig")}) == len(error_runtime.cases(False, "rig"))


# --- the study -------------------------------------------------------------------------------------


@pytest.mark.long
def test_a_study_of_a_small_swing(tmp_path, monkeypatch, capsys):
    """A study runs from the command to its table, its picture and the settings that ``--error`` uses."""
    monkeypatch.setenv("COTRACK_CACHE", str(tmp_path / "cache"))
    base, steps, finer = SWING, ("track.step=2 ms", "run.step=2 ms"), ("track.step=0.5 ms", "run.step=0.5 ms")
    cases = [
        Case("hanging_chain", "truth", error_runtime.truth_error, ("hanging_chain", "flexible", base)),
        *(
            Case("hanging_chain", name, error_runtime.point,
                 ("hanging_chain", "flexible", "implicit", (*base, *settings), base))
            for name, settings in (("coarse", steps), ("fine", finer))
        ),
    ]  # fmt: skip
    monkeypatch.setattr(error_runtime, "cases", lambda quick, scene: cases)
    monkeypatch.setattr(
        sys, "argv", ["cotrack", "study", "error-runtime", "hanging_chain", "-o", str(tmp_path / "found")]
    )
    with pytest.raises(SystemExit) as ended:
        main()
    said = capsys.readouterr()
    assert ended.value.code == 0, said.err
    assert "costs" in said.out
    rows = [Row(**json.loads(file.read_text())["rows"][0]) for file in (tmp_path / "found" / "cases").iterdir()]
    by_case = {row.case: row for row in rows}
    assert by_case["truth"]["error"] < 1e-6 < by_case["fine"]["error"] < by_case["coarse"]["error"]
    rate = math.log(by_case["coarse"]["errors"]["pins"] / by_case["fine"]["errors"]["pins"], 4)
    assert abs(rate - 2.0) < 0.3, "generalised-alpha is of order 2"
    assert (tmp_path / "found" / "error-runtime-hanging_chain.png").read_bytes()[:4] == b"\x89PNG"
    assert {tuple(s.settings)[-1] for s in precision.read(tmp_path / "found" / "precision.json")} <= {
        "run.step=2 ms", "run.step=0.5 ms",
    }  # fmt: skip
    assert len(error_runtime.ratios(rows)) >= 4


def test_a_picture_has_a_line_for_any_number_of_track_models():
    figures = {"method": "m", "error": 0.1, "estimate": 0.1, "wall_time": 1.0, "errors": {}, "estimates": {}}
    rows = [Row("swing", model, {**figures, "track": model}) for model in ("flexible", "rigid", "toy")]
    legend = error_runtime.draw(rows, "").legends[0]
    assert [text.get_text() for text in legend.get_texts()] == ["m", "flexible links", "rigid links", "toy links"]
