"""``cotrack fit``: known numbers are found again, as sure as is said, in runs and in formulas instead of runs."""

import csv
import json
from pathlib import Path

import numpy as np
import pytest
from fit_formulas import EVERYWHERE, FORMULAS, NOISE, POINTS, START, Formula, S, formula, solved
from made_logs import made
from scipy.stats import chi2

from orchestrator.execution.simulate import simulate
from orchestrator.files.progress import Progress
from orchestrator.log.reader import Log
from orchestrator.results.measured_record import MeasuredSignal
from orchestrator.results.run_data import EVER, RunData
from orchestrator.scene.scene import load
from orchestrator.studies import fit as fitting
from orchestrator.studies import least_squares
from orchestrator.studies.free_numbers import FreeNumber
from orchestrator.studies.least_squares import Experiment, Objective, search
from orchestrator.studies.uncertainty import fitted_numbers

GALLERY = Path(__file__).resolve().parents[2] / "orchestrator" / "gallery"
SETTINGS = ("chain.links=8", "run.stop=0.05", "run.links=1", "track.start=displaced", "expect={}")
SIGNALS = {name: name for name in ("chain.tension.max", "chain.joint[4].position.z")}
SPAN, MASS = "chain.span=0.5:0.95", "vehicle.track.mass=10:40 kg"
TRUTH = {"chain.span": 0.72, "vehicle.track.mass": 17.0}
T = np.arange(0.0, 0.0501, 0.001)


def signals(folder, settings, scene="hanging_chain"):
    """Signals of a run at T by name."""
    simulate(load(scene, "rigid", settings), folder / "run.mcap")
    with Log(folder / "run.mcap") as log:
        run = RunData(log)
        return {name: np.interp(T, *run.signal(name, EVER)) for name in SIGNALS}


@pytest.fixture(scope="module")
def measured(tmp_path_factory):
    """Signals with the numbers TRUTH."""
    settings = [*SETTINGS, *(f"{key}={value}" for key, value in TRUTH.items())]
    return signals(tmp_path_factory.mktemp("truth"), settings)


@pytest.fixture(scope="module")
def noise(measured):
    """One per cent of the size of each signal."""
    return {name: 0.01 * float(np.sqrt(np.mean(values**2))) for name, values in measured.items()}


@pytest.fixture
def data(measured, noise, tmp_path):
    """Function that writes a file with noise of a seed; None: without."""

    def write(seed=None, of=measured, form="%.17g"):
        drawn = np.random.default_rng(seed).standard_normal((len(of), len(T))) if seed is not None else 0.0
        size = np.array(list(noise.values()))[:, None]
        values = np.array(list(of.values())) + size * drawn
        path = tmp_path / f"data{seed}.csv"
        np.savetxt(path, np.vstack([T, values]).T, form, ",", header=",".join(["t", *measured]), comments="")
        return path

    return write


def fitted(file, folder, free=(SPAN, MASS), more=(), **options):
    settings = [*SETTINGS, *more]
    return fitting.fit("hanging_chain", file, SIGNALS, free, folder, track="rigid", settings=settings, **options)


def deviations(found, factor=1.0):
    """Distance of each number from ``factor`` times the truth in standard errors."""
    true = [factor * TRUTH[record["key"]] for record in found.table.records()]
    return [(a - b) / e for a, b, e in zip(found.answer.numbers, true, found.answer.errors, strict=True)]


def test_exact_data_give_the_numbers_back(data, noise, tmp_path):
    found = fitted(data(), tmp_path / "fit", noise=noise)
    assert found.answer.numbers == pytest.approx(list(TRUTH.values()), rel=1e-5)
    assert found.answer.numbers != pytest.approx([1.02 * value for value in TRUTH.values()], rel=1e-5)
    assert not found.ok, "without noise, the stated noise is wrong"
    noisy = fitted(data(3), tmp_path / "fit", noise={name: 0.5 * size for name, size in noise.items()})
    assert not noisy.ok, "half of the noise is wrong, too"
    assert 3.0 < noisy.answer.chi2 < 5.0


@pytest.mark.long
def test_noisy_data_give_the_numbers_within_their_errors(data, noise, tmp_path):
    """Errors are those of the scatter: the sum of 10 squares in units of the errors is chi-squared."""
    found = [fitted(data(seed), tmp_path / "fit", noise=noise) for seed in range(5)]
    assert all(one.ok and one.verdict.startswith("fitted: ") for one in found), [one.verdict for one in found]
    squares, off = (float(np.sum(np.square([deviations(one, factor) for one in found]))) for factor in (1.0, 1.02))
    low, high = 2.16, 25.2  # 0.5 and 99.5 % of chi-squared with 10 degrees of freedom
    assert low < squares < high
    assert off > high, "numbers 2 per cent off would be noticed"


@pytest.mark.long
def test_two_files_with_one_set_of_numbers(data, noise, tmp_path):
    """The same file twice has the same best numbers, and errors that are less by the root of two."""
    file = data(3)
    again = tmp_path / "again.csv"
    again.write_bytes(file.read_bytes())
    once, twice = (fitted(one, tmp_path / "fit", noise=noise) for one in (file, [file, again]))
    assert twice.answer.numbers == pytest.approx(once.answer.numbers, rel=1e-6)
    assert np.multiply(twice.answer.errors, 2.0**0.5) == pytest.approx(once.answer.errors, rel=1e-3)
    assert twice.answer.errors != pytest.approx(once.answer.errors, rel=0.2)
    assert len(twice.residuals.records()) == 4


@pytest.mark.long
def test_a_shift_that_is_found_is_a_number_with_an_error(measured, tmp_path):
    """A file whose clock is 20 ms ahead: table, residuals and the fitted scene have the same shift."""
    file, name, noise = tmp_path / "late.csv", "chain.joint[4].position.z", 1e-6
    late = np.stack([T + 0.02, measured[name] + noise * np.random.default_rng(3).standard_normal(len(T))], axis=1)
    np.savetxt(file, late, "%.17g", ",", header=f"t,{name}", comments="")
    settings = [*SETTINGS, *(f"{key}={value}" for key, value in TRUTH.items()), "vehicle.gravity=9.5"]
    found = fitting.fit("hanging_chain", file, {name: name}, ["vehicle.gravity"], tmp_path / "fit", track="rigid",
                        settings=settings, noise={name: noise}, shift="find")  # fmt: skip
    assert found.ok, found.verdict
    shift = found.table.records()[1]
    assert (shift["key"], shift["unit"]) == (f"shift of {file}", "s")
    assert abs(shift["fitted"] + 0.02) < 4.0 * shift["error"] < 1e-3
    assert abs(found.answer.numbers[0] - 9.81) < 4.0 * found.answer.errors[0] < 1.0
    rows = list(csv.DictReader((tmp_path / "fit" / "residuals.csv").read_text().splitlines()))
    raw = float([*rows[-1].values()][2]) - shift["fitted"]
    assert abs(late[:, 0] - raw).min() < 1e-9
    assert f"{shift['fitted']:g} s added to its times" in (tmp_path / "fit" / "fitted_vehicle.toml").read_text()


@pytest.mark.long
def test_files_of_two_scenes_with_one_set_of_numbers(data, noise, tmp_path):
    """Each file is of its own scene: the same chain hangs on the Moon."""
    moon, earth = tmp_path / "moon.toml", data(3)
    text = (GALLERY / "hanging_chain.toml").read_text()
    moon.write_text(text.replace('"m113"', '{ base = "m113", gravity = "1.62 m/s^2" }'))
    there = signals(tmp_path, [*SETTINGS, *(f"{key}={value}" for key, value in TRUTH.items())], str(moon))
    file = data(4, there)
    found = fitted([earth, f"{moon}={file}"], tmp_path / "fit", noise=noise)
    assert found.ok, found.verdict
    assert max(map(abs, deviations(found))) < 4.0
    assert not fitted([earth, file], tmp_path / "fit", noise=noise).ok, "the Moon's file as one of the Earth"


@pytest.mark.long
def test_a_part_and_a_log_have_the_fit_of_the_whole(data, noise, tmp_path):
    """A hanging chain is one component without inputs, so both have the same runs; a log of the record is its CSV."""
    file, of = data(3), (SIGNALS, [MASS], tmp_path / "fit")
    simulate(load("hanging_chain", "rigid", [*SETTINGS, "chain.span=0.72"]), tmp_path / "run.mcap")
    whole = fitted(file, tmp_path / "fit", [MASS], ["chain.span=0.72"], noise=noise)
    part = fitting.fit(str(tmp_path / "run.mcap"), file, *of, part="chain", noise=noise)
    topics = {"/chain/out": [(name.removeprefix("chain."), "") for name in SIGNALS]}
    columns = np.loadtxt(file, delimiter=",", skiprows=1)[:, 1:]
    for factor in (1.0, 1.001):
        log = made(tmp_path / f"{factor}.mcap", topics, {"/chain/out": (T, factor * columns)}, None, ("chain",))
        logged = fitted(log, tmp_path / "fit", [MASS], ["chain.span=0.72"], noise=noise)
        assert (logged.answer.numbers == pytest.approx(whole.answer.numbers, rel=1e-12)) == (factor == 1.0)
    assert part.answer.numbers == whole.answer.numbers
    assert part.answer.errors == whole.answer.errors


@pytest.mark.long
def test_noise_is_estimated_and_that_is_said(data, noise, tmp_path):
    found = fitted(data(3), tmp_path / "fit")
    assert found.ok
    assert any("whether or not the model is right" in note for note in found.answer.notes)
    estimated = [record["noise"] for record in found.residuals.records()]
    assert estimated == pytest.approx(list(noise.values()), rel=0.3)
    assert max(map(abs, deviations(found))) < 4.0


@pytest.mark.long
def test_samples_of_the_window_and_of_the_run_count(data, measured, noise, tmp_path):
    """Of 51 samples to 0.05 s, 31 are up to 0.03 s, and all of a file that is twice as long."""
    file = tmp_path / "a=b.csv"
    whole = np.loadtxt(data(3), delimiter=",", skiprows=1)
    later = whole.copy()
    later[:, 0] += whole[-1, 0] + 0.001
    np.savetxt(file, np.vstack([whole, later]), "%.17g", ",", header=",".join(["t", *measured]), comments="")
    found = [fitted(file, tmp_path / "fit", [MASS], ["chain.span=0.72"], noise=noise, end=end) for end in (0.03, 9.0)]
    assert [one.residuals.records()[0]["samples"] for one in found] == [31, 51]


def test_an_entry_of_a_list_has_its_unit_and_no_signal_depends_on_it(data, noise, tmp_path):
    found = fitted(data(), tmp_path / "fit", ["vehicle.chassis.inertia[3]"], noise=noise)
    assert not found.ok
    assert [record["unit"] for record in found.table.records()] == ["kg m^2"]


WHOLE, ROUNDED = "%.17g", ["%.3f", "%.5g", "%.5g"]


@pytest.mark.long
@pytest.mark.parametrize(("form", "close"), [(WHOLE, 1e-9), (ROUNDED, 1e-4)])
def test_a_record_of_a_run_is_fitted_exactly(data, tmp_path, form, close):
    """With all digits or few of them: what is left is no model error, and errors are those of the precision."""
    found = fitted(data(form=form), tmp_path / "fit")
    assert found.ok, found.verdict
    assert found.verdict.endswith(", exact: residuals are at the precision of record and search")
    assert found.answer.numbers == pytest.approx(list(TRUTH.values()), rel=close)
    assert max(map(abs, deviations(found))) < 4.0
    assert min(found.answer.errors) > 1e-9 * TRUTH["chain.span"], "errors are below what can be told"


@pytest.mark.long
@pytest.mark.parametrize(("form", "size"), [(WHOLE, 1e-5), (ROUNDED, 5e-4)])
def test_a_smooth_rest_above_the_digits_is_no_exact_fit(data, measured, tmp_path, form, size):
    """The twins: what no number explains, 1e-5 of a signal, or 5e-4 of it where five digits are written."""
    off = {name: values * (1.0 + size * np.sin(300.0 * T)) for name, values in measured.items()}
    found = fitted(data(of=off, form=form), tmp_path / "fit")
    assert not found.ok
    assert "exact" not in found.verdict


@pytest.mark.long
def test_the_command_writes_a_scene_that_runs(cotrack, data, noise, monkeypatch, tmp_path):
    """A second start has the same answer with the same runs; it does not replace a file that it reads."""
    mapped = [part for name in SIGNALS for part in ("--map", f"{name}={name}", "--noise", f"{name}={noise[name]!r}")]
    settings = [part for text in SETTINGS for part in ("--set", text)]
    free = "--free", SPAN, "--free", MASS
    asked = ["fit", "hanging_chain", "--track", "rigid", "--data", data(3), *mapped, *settings, *free, "-o", "f"]
    out = cotrack.done(*asked)
    result = json.loads(Path("f/fit.json").read_text())
    numbers = {record["key"]: record["fitted"] for record in result["numbers"]}
    assert result["ok"]
    fitted_files = {name: Path("f", name).read_bytes() for name in ("fitted.toml", "fitted_vehicle.toml")}
    for content in fitted_files.values():
        assert f"  # fitted to {tmp_path / 'data3.csv'}, 0 s added to its times; standard error ".encode() in content
    scene = load("f/fitted.toml")
    same = load("hanging_chain", "rigid", [*SETTINGS, *(f"{key}={value!r}" for key, value in numbers.items())])
    assert {**scene.resolved(), "name": ""} == {**same.resolved(), "name": ""}
    assert Path("f/fit.png").stat().st_size > 10_000
    samples = list(csv.DictReader(Path("f/residuals.csv").read_text().splitlines()))
    for one in result["signals"]:
        apart = [float(row["fitted run"]) - float(row["measured"]) for row in samples if row["signal"] == one["signal"]]
        assert len(apart) == one["samples"] == len(T)
        assert np.sqrt(np.mean(np.square(apart))) == pytest.approx(one["last"], rel=1e-12)
    runs = []

    def counted(*given, **named):
        runs.append(1)
        return simulate(*given, **named)

    monkeypatch.setattr(least_squares, "simulate", counted)
    assert (cotrack(*asked)[:2], len(runs)) == ((0, out), 1), "runs are made again, not only that which reads the units"
    assert {name: Path("f", name).read_bytes() for name in fitted_files} == fitted_files
    Path("f/residuals.csv").write_bytes(asked[5].read_bytes())
    Path("scene.toml").write_text(fitted_files["fitted.toml"].decode().replace("fitted_v", "f/fitted_v"))
    for place, own, name in (
        (1, "f/fitted.toml", "fitted.toml"), (5, "f/residuals.csv", "residuals.csv"),
        (1, "scene.toml", "fitted_vehicle.toml"),
    ):  # fmt: skip
        err = cotrack.refused(*asked[:place], own, *asked[place + 1 :])
        assert f"'f/{name}' cannot be written: it is a file that is read" in err
    assert {name: Path("f", name).read_bytes() for name in fitted_files} == fitted_files


# --- formulas instead of runs ---


@pytest.mark.parametrize("name", ["line", "parabola"])
def test_polynomials_have_the_errors_of_the_closed_form(name):
    """Gauss: covariance sigma^2 inv(A'A), and a profile is the parabola s^2."""
    task, found = formula(*FORMULAS[name]), solved(name)
    A = S[:, None] ** np.arange(len(found.numbers))
    covariance = NOISE**2 * np.linalg.inv(A.T @ A)
    errors = np.sqrt(np.diag(covariance))
    assert found.errors == pytest.approx(errors, rel=1e-9)
    assert found.correlations == pytest.approx(covariance / np.outer(errors, errors), rel=1e-9)
    best, squares = np.linalg.lstsq(A, task.signals[0].values)[:2]
    assert found.numbers == pytest.approx(best, rel=1e-9)
    assert found.chi2 == pytest.approx(squares[0] / NOISE**2 / (len(S) - len(best)), rel=1e-9)
    for number, error, profile in zip(found.numbers, found.errors, found.profiles, strict=True):
        assert profile.errors == pytest.approx([-2.0, -1.0, 1.0, 2.0])
        assert profile.numbers == pytest.approx(number + error * profile.errors, rel=1e-9)
        assert profile.rises == pytest.approx(profile.errors**2, rel=1e-6)
        assert profile.rises != pytest.approx((1.02 * profile.errors) ** 2, rel=1e-6)
    assert found.problems == ()


def test_a_search_from_the_end_of_a_range_and_from_its_own_end():
    """At the end of a range a difference must go down; what is found is no bound, and no other place is better."""
    model, truth, _ = FORMULAS["line"]
    task = formula(model, truth, [(5.0, 0.0, 5.0)] * 2)
    end = search(task)
    found = fitted_numbers(task, end)
    assert found.numbers == pytest.approx(truth, abs=4.0 * max(found.errors))
    again = formula(model, truth, [(number, *EVERYWHERE) for number in task.numbers(end.u)])
    assert found.problems == fitted_numbers(again, search(again)).problems == ()
    assert solved("bound").problems != ()
    task = formula(*FORMULAS["line"])
    end = search(task)
    off = end._replace(u=end.u + 0.2, cost=(end.cost[0], task.sums([end.u + 0.2], end.noise)[0]))
    assert any(" is better, the sum of squares is " in problem for problem in fitted_numbers(task, off).problems)


@pytest.mark.parametrize("truth", [0.6, 1.7, 3.0])
def test_small_valleys_are_crossed(truth, monkeypatch):
    """A ripple whose phase moves has derivatives fifty times those of the line; the twin follows them."""
    free = [(1.0, 0.1, 9.0)]
    task = formula(lambda a: a * (1.0 + S) + 0.05 * np.sin(1e3 * a - 40.0 * S), [truth], free)
    line = NOISE / np.linalg.norm(1.0 + S)
    assert task.numbers(search(task).u) == pytest.approx([truth], abs=4.0 * line)
    monkeypatch.setattr(least_squares, "COARSE", least_squares.SMALL)
    assert task.numbers(search(task).u) != pytest.approx([truth], abs=20.0 * line)


def test_a_first_search_whose_runs_fail_is_told_and_the_second_goes_on(monkeypatch):
    """Runs fail farther from the start than the second search goes, and nearer than the differences of the first."""
    task = formula(lambda a: a * S, [1.02], [START], None)
    values = task.values
    monkeypatch.setattr(task, "values", lambda at: ["no rest" if abs(u[0]) > 0.05 else values([u])[0] for u in at])
    with Progress("fit", (told := []).append):
        assert task.numbers(search(task).u) == pytest.approx([1.02], abs=1e-9)
    assert told[0] == "the first search, by differences over 10 % of a number, ends: no rest"


def test_an_error_above_the_number_is_no_success():
    found = solved("weak")
    assert found.errors[0] == pytest.approx(NOISE / (0.01 * np.linalg.norm(S)), rel=1e-9)
    assert found.problems != ()


def test_an_error_that_is_not_linear_has_its_profile():
    """Of an exponential with an error of 0.36: ((exp(0.36 s) - 1) / 0.36)^2 is 2.0 at -2 errors and 8.6 at +2."""
    (profile,) = solved("exponential").profiles
    assert profile.rises == pytest.approx(((np.exp(0.36 * profile.errors) - 1.0) / 0.36) ** 2, rel=0.02)


def test_a_profile_that_is_flat_gives_the_error():
    """A ripple below the noise makes the derivative, a line the rise of the sum of squares; with no line, nothing."""
    task = formula(*FORMULAS["ripple"])
    end, line = search(task), NOISE / (0.05 * np.linalg.norm(S))
    found = fitted_numbers(task, end._replace(jacobian=np.full((len(S), 1), 1e-3 * 2e4 * 1.1 / NOISE)))
    assert found.errors[0] == pytest.approx(line, rel=0.1)
    assert found.errors[0] != pytest.approx(1.25 * line, rel=0.1)
    assert any(note.endswith(" times that of its derivative, by the sum of squares") for note in found.notes)
    assert solved("flat").errors == (np.inf,)


def test_springs_in_series_cannot_be_told_apart():
    """1/k1 + 1/k2 alone is measured, so k1^2 of the one goes with -k2^2 of the other."""
    found = solved("springs")
    (sentence,) = (problem for problem in found.problems if problem.startswith("cannot be told apart"))
    first, second = (float(part.split()[1]) for part in sentence.partition(": ")[2].split(", "))
    k1, k2 = found.numbers
    assert first / second == pytest.approx(-((k1 / k2) ** 2), rel=0.01)
    assert first / second != pytest.approx(-1.02 * (k1 / k2) ** 2, rel=0.01)
    assert min(found.errors) > 1.9


def test_a_scan_finds_the_valley():
    """A cosine has a valley at each number of waves."""
    task = formula(*FORMULAS["wave"])
    alone, scanned = search(task), search(task, 40)
    assert task.numbers(scanned.u) == pytest.approx([31.0], abs=0.2)
    assert scanned.cost[1] < 0.1 * alone.cost[1]
    assert fitted_numbers(task, alone).problems != ()
    assert fitted_numbers(task, scanned).problems == ()


def test_a_number_that_is_not_felt_goes_back_to_its_start():
    """One acts on nothing; a ripple of rounding drives another, but over its way the sum of squares stays."""
    idle = solved("idle")
    assert (idle.numbers[1], idle.errors[1], idle.problems != ()) == (1.0, np.inf, True)
    start = [START, (1.3, *EVERYWHERE)]
    task = formula(lambda a, b: a + 1e-5 * np.sin(2e5 * b) * S, [2.0, 1.0], start)
    assert task.numbers(search(task).u) == pytest.approx([2.0, 1.3], abs=0.05)
    assert task.numbers(search(task).u)[1] == 1.3


@pytest.mark.parametrize("off", [False, True])
def test_chi_squared_is_judged_by_samples_and_signals(off):
    """A noise 1.35 times the stated one has chi2/n 1.8, which 101 samples refuse; that signal is named."""
    rng = np.random.default_rng(5)
    signals = tuple(
        MeasuredSignal(name, name, "1", POINTS, 2.0 + 3.0 * S + factor * NOISE * rng.standard_normal(101), False, {})
        for name, factor in (("y", 1.0), ("z", 1.35 if off else 1.0))
    )
    numbers = tuple(FreeNumber(f"p{k}", *START, 1.0) for k in range(2))
    task = Formula((Experiment(load("hanging_chain"), signals=signals),), numbers, {"y": NOISE, "z": NOISE})
    task.values = lambda points: [[a + b * S] * 2 for a, b in map(task.numbers, points)]
    found = fitted_numbers(task, search(task)).problems
    assert [problem.partition(" is ")[0] for problem in found] == ["chi2/n of z", "chi2/n of all signals"] * off
    for problem, n in zip(found, (101, 202), strict=False):
        low, high = chi2.ppf([0.0005, 0.9995], n - n // 101) / n
        assert f" over {n} samples, {low:.2g} to {high:.2g} would be the stated noise" in problem


@pytest.mark.parametrize("stands", [least_squares.STANDS, 99])
def test_a_search_stops_where_the_sum_of_squares_stands_still(stands, monkeypatch):
    """Runs round by far more than steps of derivatives do: without the rule the search goes on."""
    monkeypatch.setattr(least_squares, "STANDS", stands)
    task = formula(lambda a, b: a + b * S + 1e-5 * np.sin(1e8 * (a + b * S)), [2.0, 3.0], [START] * 2)
    with Progress("fit", (told := []).append):
        end = search(task)
    assert end.converged
    assert (len(told) < 10) == (stands != 99)


GRID = np.linspace(-1.0, 2.0, 6001)


def pulse(t, a):
    return a * np.exp(-20.0 * (t - 0.5) ** 2)


class Clocked(Formula):
    """Objective whose runs are pulses, on a clock by which that of the file is to be shifted."""

    def _runs(self, points):
        return [[np.array([GRID, pulse(GRID, *self.of_scenes(u).values())])] for u in points]

    values = Objective.values


@pytest.mark.parametrize(("fixed", "agrees"), [(False, True), (True, False)])
def test_a_shift_is_fitted_with_the_numbers(fixed, agrees):
    """From a shift 30 ms off: numbers and their errors are those of linear theory with both; or the fit is refused."""
    true, squares, refused = 0.25, 0.0, 0
    a = 2.0
    J = np.stack([pulse(S, 1.0), pulse(S, a) * -40.0 * (S - 0.5)], axis=1) / NOISE
    errors = np.sqrt(np.diag(np.linalg.inv(J.T @ J)))
    for seed in range(10):
        drawn = NOISE * np.random.default_rng(seed).standard_normal(len(S))
        start = true - 0.03
        signal = MeasuredSignal("y", "y", "1", POINTS - true + start, pulse(S, a) + drawn, False, {})
        ends = (start, start) if fixed else EVERYWHERE
        free = FreeNumber("p", *START, 1.0), FreeNumber("shift of f", start, *ends, 0.01, "f")
        task = Clocked(
            (Experiment(load("hanging_chain"), signals=(signal,), files=("f",)),), free[: 2 - fixed], {"y": NOISE}
        )
        end = search(task)
        found = fitted_numbers(task, end)
        refused += bool(found.problems)
        if not fixed:
            assert found.errors == pytest.approx(errors, rel=0.1)
            assert task.shifts(end.u)["f"] == found.numbers[1]
        squares += sum(((n - t) / e) ** 2 for n, t, e in zip(found.numbers, (a, true), errors, strict=False))
    low, high = 7.43, 40.0  # 0.5 and 99.5 % of chi-squared with 20 degrees of freedom
    assert (low < squares < high and refused == 0) == agrees
    assert refused == 10 * fixed


def test_residuals_that_follow_each_other_are_no_success():
    """A line through a parabola of the size of the noise: chi2/n is near 1, and neighbours are alike."""
    task = formula(*FORMULAS["bent"])
    line = Formula(task.experiments, task.free[:2], {"y": NOISE}, model=FORMULAS["line"][0])
    found = fitted_numbers(line, search(line))
    assert found.chi2 < 4.0
    assert any("the residuals of y are no noise" in problem for problem in found.problems)
    assert fitted_numbers(task, search(task)).problems == ()
