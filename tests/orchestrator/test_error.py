"""The error of a run: norm, own estimate and its coarser runs, cost of precision, study of error against run time."""

import json
import math
import re
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.linalg import expm
from short_runs import SHORT, last

from fmus.vehicles.tables import BadInput
from orchestrator.cli import run_commands
from orchestrator.execution import estimate as estimating
from orchestrator.execution import precision, summary
from orchestrator.execution import simulate as simulation
from orchestrator.execution.estimate import companions, estimate
from orchestrator.execution.interrupt import Interrupt
from orchestrator.execution.log_report import summary_of
from orchestrator.execution.manifest import decode_results
from orchestrator.execution.precision import Setting, cheapest, fraction, pareto_front
from orchestrator.execution.simulate import record_companion, simulate
from orchestrator.log.reader import Log
from orchestrator.results import difference as difference_module
from orchestrator.results.convergence_index import convergence_index
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
from orchestrator.results.validity.exceedance import FAILURE, Exceedance
from orchestrator.scene.scene import load
from orchestrator.studies import Case, Row, error_runtime
from orchestrator.studies.error_runtime import record
from orchestrator.studies.parameter_sweep import run_case

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


def test_the_mean_tension_is_the_integral_of_the_output_of_each_track():
    """100 N/s and a wave of 95 Hz, of which records every 10 ms would make one of 5 Hz; the last window has 0.6 s."""
    t = np.arange(0.0, 1.6001, 1e-3)
    run = SimpleNamespace(tracks=("a", "b"), signal=lambda name, _: (t, 1e3 * (2.0 if name[0] == "b" else 1.0) + rise))
    rise = 100.0 * t + 50.0 * np.sin(2.0 * np.pi * 95.0 * t)
    means = difference_module._mean_tension(run, 1)
    np.testing.assert_allclose(means.t, [1.0, 2.0])
    np.testing.assert_allclose(means.values, [[1050.0, 2050.0], [1130.0, 2130.0]], atol=1e-6)
    rise = 100.0 * t + 50.0 * np.sin(2.0 * np.pi * 95.5 * t)
    assert abs(difference_module._mean_tension(run, 1).values[0, 0] - 1050.0) > 0.1, "the twin: no whole periods"


@pytest.mark.long
def test_forces_do_not_depend_on_the_interval_of_records(tmp_path):
    """Joint forces are brought to one interval, 2.5 or 10 ms; of tensions the instants count that both logs have."""
    paths = [tmp_path / name for name in ("fine.mcap", "coarse.mcap", "tight.mcap")]
    for path, how in zip(
        paths, (("run.links=1",), ("run.links=4",), ("run.links=4", "rig.tension=10.3 kN")), strict=True
    ):
        simulate(load("rig", "rigid", ("run.step=2.5 ms", "run.stop=100 ms", *how)), path)
    names = ("joint_force", "joint_force_mean", "joint_force_rms", "tension_mean", "tension_rms")
    same, other = (differences_of_logs(path, paths[1]) for path in (paths[0], paths[2]))
    assert max(same[name].relative for name in names) < 1e-9
    assert min(other[name].relative for name in names) > 5e-3


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
def test_the_estimate_bounds_the_error(swings, step):
    with Log(swings[step]["log"]) as run, Log(swings[0.25]["log"]) as fine:
        true = differences(RunData(run), RunData(fine))
    own = swings[step]["error"]
    assert own["coupling"] == 0.0, "an uncoupled system has no coupling error"
    assert own["total"] == own["integration"]
    stated = {name: own["observables"][name]["total"] / one.relative for name, one in true.items()}
    factors = {"pins": 1.25, "tension": 1.25 * 3.0}  # both of order 2, and of forces it counts as 1
    assert stated == pytest.approx(factors, rel=0.07)
    assert own["total"] == max(one["total"] for one in own["observables"].values())
    pins = own["observables"]["pins"]
    assert (pins["safety"], pins["order"]) == (1.25, pytest.approx(2.0, abs=0.1)), "generalised-alpha is of order 2"


def test_without_a_run_at_four_times_the_step_the_factor_is_three(swings):
    """The difference of two runs, as of order 1, and the reason; a run of seven steps has no longer one."""
    scene, own, outcomes = load("hanging_chain", "flexible", SWING), swings[2.0], []

    def record(companion, path):
        outcomes.append(companion.run.step)
        return swings[4.0] if len(outcomes) % 2 else {"status": "failed", "message": "it blew up"}

    scene = scene.model_copy(update={"run": scene.run.model_copy(update={"step": 2e-3})})
    found = differences_of_logs(swings[4.0]["log"], own["log"])
    blown_up = estimate(scene, own["log"], own, record)
    assert blown_up["no_order"] == "the run at four times the step cannot be right: it blew up"
    for name, one in blown_up["observables"].items():
        assert (one["safety"], one["order"]) == (3.0, None)
        assert (one["total"], one["absolute"]) == pytest.approx((3 * found[name].relative, 3 * found[name].absolute))
    assert blown_up["total"] == pytest.approx(3.0 * worst(found))
    short = companions(scene, 2e-3, 7.0 * 2e-3, 1)
    assert short.four_times is None
    assert companions(scene, 2e-3, 8.0 * 2e-3, 1).four_times.run.step == 8e-3


def test_coarser_runs_are_recorded_at_instants_of_the_run():
    scene = load("rig", "rigid", ("run.links=10", "run.outputs=3", "run.step=1 ms"))
    found = companions(scene, 1e-3, 2.0, 5)
    strides = [(each.run.links * each.run.step, each.run.outputs * each.run.step) for each in found]
    np.testing.assert_allclose(strides, [(10e-3, 6e-3), (20e-3, 12e-3), (10e-3, 6e-3)])


@pytest.mark.parametrize("order", [0.6, 1.0, 2.0, 2.4])
def test_the_index_of_a_power_of_the_step_is_its_error_times_the_factor(order):
    """An error 7 h^p, h = 0.1."""
    error = [7.0 * (times * 0.1) ** order for times in (1, 2, 4)]
    differences = error[1] - error[0], error[2] - error[1]
    assert convergence_index(*differences, formal=2.5) == pytest.approx((1.25 * error[0], order, 1.25))
    cut = convergence_index(*differences, formal=1.0)
    assert cut == pytest.approx((1.25 * max(error[0], differences[0]), order, 1.25)), "no more than the formal order"


@pytest.mark.parametrize(("differences", "error", "order"), [
    ((1.0, 1.4), 3.0 * 1.4, 0.485),  # order below 0.5
    ((1.0, 0.6), 3.0, -0.737),  # divergence
    ((1.0, 5.7), 3.0 * 5.7, 2.511),  # above 2.5
    ((1.0,), 3.0, math.nan),  # no third run
    ((0.0, 2.0), 6.0, math.nan),
    ((0.0, 0.0), 0.0, math.nan),
])  # fmt: skip
def test_an_index_without_a_usable_order_is_thrice_the_larger_difference(differences, error, order):
    assert convergence_index(*differences) == pytest.approx((error, order, 3.0), nan_ok=True, abs=1e-3)
    assert convergence_index(1.0, 2.0, products=(-2.0, 1.9)) == (6.0, 1.0, 3.0), "averages that oscillate"
    assert convergence_index(1.0, 2.0, products=(-2.0, 2.1)) == (3.0, 1.0, 3.0), "averages that do not"
    assert convergence_index(1.0, 1.42).safety == convergence_index(1.0, 5.6).safety == 1.25, "the twin"


@pytest.mark.parametrize("order", [0.6, 1.0, 2.0])
def test_the_index_bounds_errors_that_alternate_or_have_nothing_in_common(order):
    """Oscillatory convergence, errors 1, -r, r^2; and errors at right angles, as of impacts with other phases."""
    ratio = 2.0**order
    assert convergence_index(1.0 + ratio, ratio + ratio**2, 2.0).error > 1.25
    assert convergence_index(math.hypot(1.0, ratio), math.hypot(ratio, ratio**2), 2.0).error > 1.25


@pytest.mark.parametrize(("theta", "order"), [(0.5, 2.0), (1.0, 1.0)])
def test_the_index_bounds_the_error_of_two_coupled_masses(theta, order):
    """Two unequal masses on three springs, by the theta method, beside their exact motion: 1.25 times the RMS error."""
    stiffness = np.array([[300.0, -100.0], [-100.0, 250.0]])
    system = np.block([[np.zeros((2, 2)), np.eye(2)], [-np.diag([1.0, 0.5]) @ stiffness, np.zeros((2, 2))]])
    start, coarsest = np.array([0.1, -0.05, 0.0, 0.0]), np.arange(0.0, 1.0 + 1e-9, 4e-3)

    def motion(h):
        step = np.linalg.solve(np.eye(4) - theta * h * system, np.eye(4) + (1.0 - theta) * h * system)
        states = [start]
        for _ in range(round(1.0 / h)):
            states.append(step @ states[-1])
        return np.array(states)[:: round(4e-3 / h), :2]

    def apart(a, b):
        return math.sqrt(np.mean((a - b) ** 2))

    runs = [motion(h) for h in (0.25e-3, 0.5e-3, 1e-3)]
    exact = np.array([(expm(system * t) @ start)[:2] for t in coarsest])
    index = convergence_index(apart(runs[1], runs[0]), apart(runs[2], runs[1]), formal=order)
    assert index.order == pytest.approx(order, abs=0.15)
    assert 1.0 < index.error / apart(runs[0], exact) < 1.5


def test_steps_that_were_halved_do_not_spoil_the_companions(tmp_path):
    """A track that took 12 steps more than 1000 was set to one per communication step: doubled, its step is 8 ms."""
    asked = []

    def record(scene, path):
        asked.append((scene.run.step, scene.track.step))
        return {"status": "failed", "message": "not run"}

    scene = load("straight", "flexible", ("run.step=4 ms", "track.step=4 ms", "run.stop=4 s"))
    for steps in (1012, 2012):
        costs = {"left_track": {"steps": steps}, "right_track": {"steps": 1000}, "chassis": {"steps": 0}}
        summary = {"components": costs, "simulated_time": 4.0, "communication_steps": 1000}
        assert estimate(scene, tmp_path / "no.mcap", summary, record)["total"] is None
    assert asked == [(0.008, 0.008), (0.008, 0.004)]
    explicit = load("straight", "flexible", ("track.integrator=runge_kutta",))
    alike = companions(explicit, 8e-6, 4.0, 5)
    assert alike.twice == alike.coupling, "its stable step cannot be doubled"
    soft = companions(explicit, explicit.track.step, 4.0, 5)
    assert soft.twice.track.step == 2.0 * soft.coupling.track.step, "the twin: the requested step can be doubled"
    assert soft.four_times.track.step == 2.0 * soft.twice.track.step


@pytest.mark.parametrize("integrator", ["adams", "dormand_prince"])
def test_an_integrator_that_chooses_its_steps_gets_looser_tolerances_and_longer_steps(integrator):
    chosen = f"track.integrator={integrator}", "track.rtol=1e-8", "track.step=5 ms", "run.step=10 ms"
    of_one, of_several = (companions(load("hanging_chain", "rigid", chosen), 5e-3, 2.0, n) for n in (1, 2))
    assert of_one.coupling is None
    assert of_several.coupling.track.rtol == 1e-8
    for found in (of_one, of_several):
        for times, coarser in ((10.0, found.twice), (100.0, found.four_times)):
            given = coarser.track.rtol, coarser.track.atol, coarser.track.step, coarser.run.step
            doubled = 2.0 ** math.log10(times)
            assert given == pytest.approx((times * 1e-8, times * 1e-6, doubled * 5e-3, doubled * 10e-3))


@pytest.mark.long
@pytest.mark.parametrize(("step", "known"), [("1 ms", False), ("1 us", True)])
def test_a_chain_at_its_stable_step_has_nothing_coarser_beside_it(tmp_path, step, known):
    """Explicit cables are stable to 3.6 us, whatever longer step is requested; a shorter one can be doubled."""
    explicit = ("chain.links=8", "track.start=displaced", "track.integrator=runge_kutta", f"track.step={step}")
    scene = load("hanging_chain", "flexible", (*explicit, "run.step=1 ms", "run.stop=10 ms", "run.links=1"))
    own = simulate(scene, tmp_path / "run.mcap", estimated=True)["error"]
    assert (own["total"] is not None) == known
    assert ("as long as stability allows" in own["message"]) != known


@pytest.mark.long
def test_a_coupled_track_at_its_stable_step_knows_its_coupling_alone(tmp_path):
    scene = load("rig", "rigid", ("track.integrator=runge_kutta", "run.step=1 ms", "run.stop=20 ms", "run.links=1"))
    own = simulate(scene, tmp_path / "run.mcap", estimated="parts")["error"]
    assert own["integration"] is None
    assert own["total"] == own["coupling"] > 0.0


@pytest.mark.long
@pytest.mark.parametrize(("groups", "without"), [("['tension']", ["pins"]), ("['tension','position']", [])])
def test_observables_without_an_estimate_are_named(cotrack, groups, without):
    own = last(cotrack.done(*SHORT, "--set", f"track.link_outputs={groups}"))["error"]
    assert own["without"] == without
    assert set(own["observables"]) == {"tension", "pins"} - set(without)


@pytest.mark.parametrize(("lost", "known"), [(["tension"], True), (["tension", "pins"], False)])
def test_a_difference_that_is_no_number_is_no_estimate(swings, monkeypatch, lost, known):
    """Where one of two observables is infinite, the other one decides; alone there is no estimate."""

    def broken(run, reference):
        found = differences(run, reference)
        return {name: one._replace(relative=math.inf) if name in lost else one for name, one in found.items()}

    monkeypatch.setattr(estimating, "differences", broken)
    scene = load("hanging_chain", "flexible", (*SWING, "run.step=2 ms", "track.step=2 ms"))
    own = estimate(scene, swings[2.0]["log"], swings[2.0], lambda *_: swings[4.0])
    assert (own["total"] is not None, [*own["observables"]]) == (known, ["pins"] * known)
    assert own["without"] == lost * known
    observables = {"a": ObservableDifference(1, 0.1, "m", True), "b": ObservableDifference(1, 0.5, "m", False)}
    assert worst(observables) == 0.1, "only decisive ones decide"


def test_a_study_makes_no_run_twice():
    scene, other = (load("hanging_chain", "flexible", (*SWING, f"run.step={h} ms")) for h in (4, 2))
    first, again, second = record(scene), record(scene.model_copy()), record(other)
    assert again is first
    assert second["log"] != first["log"]
    assert second["communication_steps"] == 2 * first["communication_steps"]


def test_the_log_closes_with_error_and_cost(swings):
    run = swings[2.0]
    with Log(run["log"]) as log:
        texts = log.closing["results"]
    results = {name: json.loads(text) for name, text in texts.items()}
    assert (results["error"], results["wall_time"]) == (run["error"], run["wall_time"])
    assert results["energy_residual"] == run["energy"]["residual_relative"]
    opened = summary_of(run["log"])
    assert {key for key, value in run.items() if opened[key] != value} == set()
    assert decode_results(texts) == decode_results(texts | {"validity": "nonsense"})
    earlier = decode_results({name: text for name, text in texts.items() if name in ("wall_time", "error")})
    assert (earlier["wall_time"], earlier["error"]) == (run["wall_time"], run["error"])
    for odd in ({"error": "1"}, {"error": texts["error"].replace("true", "false")}, {"wall_time": "["}):
        assert decode_results(texts | odd) == decode_results({})


# --- its coarser runs ---------------------------------------------------------------------------------


def short(*settings):
    return load("hanging_chain", "flexible", (*SWING, "run.stop=0.032 s", *settings))


def test_companions_have_the_bits_of_single_runs(tmp_path):
    outcomes = []
    for step in (1, 2):
        scene, path = short(f"run.step={step} ms"), tmp_path / f"{step}.mcap"
        outcomes.append(record_companion(Interrupt(), scene, path)[0])
        single = simulate(scene, tmp_path / "single.mcap")
        same = ("status", "message", "communication_steps", "energy", "validity")
        assert {name: outcomes[-1][name] for name in same} == {name: single[name] for name in same}
        with Log(path) as log, Log(single["log"]) as other:
            assert log.digest() == other.digest()
    assert outcomes[0]["communication_steps"] == 2 * outcomes[1]["communication_steps"] == 32


@pytest.mark.parametrize("end", ["no file", "not valid", "a signal"])
def test_a_companion_that_fails_is_a_status(tmp_path, monkeypatch, end):
    interrupt, path = Interrupt(), tmp_path / "a.mcap"
    interrupt.requested = end == "a signal"
    if end == "no file":
        (tmp_path / "file").touch()
        path = tmp_path / "file" / "a.mcap"
    if end == "not valid":
        found = Exceedance("penetration", "chain", 0.01, "", 0.2, 0.1, FAILURE)
        monkeypatch.setattr(summary, "balance", lambda run: {"energy": None, "validity": [found._asdict()]})
    outcome, log_failure = record_companion(interrupt, short("run.step=1 ms"), path)
    assert outcome["status"] == ("interrupted" if end == "a signal" else "failed")
    assert outcome["message"]
    assert log_failure == outcome["message"] * (end == "no file")
    assert not interrupt.deferring, "a signal in what follows would not end it"


@pytest.mark.study
def test_the_estimate_of_a_native_run_is_native_and_the_same(tmp_path, monkeypatch):
    natives, errors, load_scene = [], [], simulation.load_scene

    def loaded(*given, **named):
        natives.append(given[3])
        return load_scene(*given, **named)

    monkeypatch.setattr(simulation, "load_scene", loaded)
    scene = load("sprocket_bench", "rigid", ["run.stop=0.02 s", "run.step=1 ms", "expect={}"])
    for native in (False, True):
        own = simulate(scene, tmp_path / "run.mcap", estimated=True, native=native)["error"]
        errors.append({name: value for name, value in own.items() if name != "wall_time"})
    assert errors[0] == errors[1]
    assert errors[0]["total"] > 0.0
    assert natives == [False] * 3 + [True] * 3
    parts = simulate(scene, tmp_path / "run.mcap", estimated="parts", native=True)["error"]
    assert len(natives) == 10
    assert errors[0]["coupling"] is errors[0]["integration"] is None
    assert parts["total"] == errors[0]["total"]
    for one in (parts, *parts["observables"].values()):  # the whole is no longer than both parts, each than the others
        sides = sorted(one[key] for key in ("coupling", "integration", "total"))
        assert 0.0 < sides[2] < 1.001 * (sides[0] + sides[1])
    (row,) = run_case(scene, True, "parts", None)
    assert row["estimated error of coupling"] == parts["coupling"]


def test_parts_change_no_total():
    """Also where the run of twice the communication step has another size, to which its difference is relative."""
    whole = {"finer": ObservableDifference(1.0, 0.1, "m", True), "coarser": ObservableDifference(2.0, 0.19, "m", True)}
    parts = whole | {"coupling": ObservableDifference(0.5, 0.06, "m", True)}
    totals = [estimating._observable_error(found, False)["total"] for found in (whole, parts)]
    assert totals[0] == totals[1] == pytest.approx(0.125)  # 1.25 x 1 / (2^1 - 1), relative


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
    with pytest.raises(BadInput, match=r"study error-runtime own\.toml -o"):
        cheapest("own", "flexible", 0.01, "own.toml")
    for scene in ("swing", "swung"):  # none is as right; unknown
        with pytest.raises(BadInput):
            cheapest(scene, "flexible", 0.01)
    assert fraction("1%") == fraction("0.01") == 0.01
    for text in ("", "x%", "0", "-1%", "150%"):
        with pytest.raises(BadInput):
            fraction(text)


def test_the_error_of_another_vehicle_or_of_a_scene_of_that_name_is_not_claimed(tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("COTRACK_CACHE", str(tmp_path))
    said = []
    for changes in ([], ["vehicle.chassis.mass=5 t"]):
        scene = run_commands._scene_to_run("straight", None, changes, "1%", ())
        assert scene.run.step == 1.25e-3
        said.append(capsys.readouterr().err)
    assert [("unknown with the settings given here" in text, "measured error 0." in text) for text in said] == [
        (False, True), (True, True),
    ]  # fmt: skip
    own = tmp_path / "straight.toml"
    own.write_bytes((precision.SHIPPED.parent / "straight.toml").read_bytes())
    with pytest.raises(BadInput, match=r"no error of 'straight' on flexible links has been measured"):
        run_commands._scene_to_run(str(own), None, [], "1%", ())


def test_shipped_settings_are_sound():
    """Every shipped setting loads, and its scene is one of the gallery."""
    assert re.fullmatch("[0-9a-f]{40}", json.loads(precision.SHIPPED.read_text())["commit"])
    shipped = precision.read(precision.SHIPPED)
    assert {row.scene for row in shipped} >= {"hanging_chain", "rig", "straight"}
    for row in shipped:
        assert load(row.scene, row.track, row.settings).track.model == row.track
        assert 0.0 < row.error < 1.0


# --- the study -------------------------------------------------------------------------------------


@pytest.mark.long
def test_a_study_of_a_small_swing(cotrack, tmp_path, fresh_cache, monkeypatch):
    """A study runs from the command to its table, its picture and the settings that ``--error`` uses."""
    names = [case.name for case in error_runtime.cases(False, "rig")]
    assert len({*names}) == len(names)
    steps, finer = ("track.step=2 ms", "run.step=2 ms"), ("track.step=0.5 ms", "run.step=0.5 ms")
    cases = [Case("hanging_chain", "truth", error_runtime.truth_error, ("hanging_chain", "flexible", SWING))]
    for name, settings in (("coarse", steps), ("fine", finer)):
        of = ("hanging_chain", "flexible", "implicit", (*SWING, *settings), SWING)
        cases.append(Case("hanging_chain", name, error_runtime.point, of))
    monkeypatch.setattr(error_runtime, "cases", lambda quick, scene: cases)
    assert "costs" in cotrack.done("study", "error-runtime", "hanging_chain", "-o", "found")
    rows = [Row(**json.loads(file.read_text())["rows"][0]) for file in (tmp_path / "found" / "cases").iterdir()]
    by_case = {row.case: row for row in rows}
    assert by_case["truth"]["error"] < 1e-6 < by_case["fine"]["error"] < by_case["coarse"]["error"]
    rate = math.log(by_case["coarse"]["errors"]["pins"] / by_case["fine"]["errors"]["pins"], 4)
    assert abs(rate - 2.0) < 0.3, "generalised-alpha is of order 2"
    assert (tmp_path / "found" / "error-runtime-hanging_chain.png").read_bytes()[:4] == b"\x89PNG"
    found = precision.read(tmp_path / "found" / "precision.json")
    assert {tuple(one.settings)[-1] for one in found} <= {"run.step=2 ms", "run.step=0.5 ms"}
    assert len(error_runtime.ratios(rows)) >= 4


def test_a_picture_names_the_steps_of_the_best_settings():
    """A line for any number of track models; of three settings, the one that is slower and worse is on no line."""
    rows = [
        precision.Setting("swing", model, settings, error, time)
        for model in ("flexible", "rigid", "toy")
        for settings, error, time in (
            (("run.step=4 ms", "track.step=2 ms"), 0.1, 1.0),
            (("run.coupling=gauss_seidel", "run.step=1 ms", "track.step=1 ms"), 0.01, 2.0),
            (("track.integrator=runge_kutta", "run.step=0.25 ms"), 0.05, 3.0),
        )
    ]
    (pane,) = error_runtime.draw(rows, "").axes
    assert [text.get_text() for text in pane.get_legend().get_texts()] == [
        "flexible links", "rigid links", "toy links",
    ]  # fmt: skip
    assert [text.get_text() for text in pane.texts] == ["4, 2 ms", "1 ms gauss-seidel"] * 3
    assert [[*line.get_xdata()] for line in pane.lines] == [[1.0, 2.0, 3.0], [1.0, 2.0]] * 3
    assert error_runtime.label(("run.variable.tolerance=0.001",)) == "tolerance 0.001"
