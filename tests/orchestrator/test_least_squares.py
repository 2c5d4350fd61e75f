"""Search and uncertainty of a fit on formulas instead of runs: closed forms, several valleys, springs in series."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pytest

from fmus.vehicles.tables import BadInput
from orchestrator.results.measured_record import MeasuredSignal
from orchestrator.scene.scene import load
from orchestrator.studies.free_numbers import FreeNumber
from orchestrator.studies.least_squares import Experiment, Objective, search
from orchestrator.studies.uncertainty import answer

T = np.linspace(0.0, 1.0, 101)
NOISE = 0.1


@dataclass
class Formula(Objective):
    """Objective whose run is a formula of the numbers."""

    model: Callable = None

    def values(self, points):
        return [[self.model(*self.numbers(u))] for u in points]


def formula(model, truth, free, seed=1):
    """Objective of measured values of a model, with noise of a seed; ``free``: start, low and high of each number."""
    drawn = NOISE * np.random.default_rng(seed).standard_normal(len(T)) if seed is not None else 0.0
    signal = MeasuredSignal("y", "y", "1", T, model(*truth) + drawn, False, {})
    experiment = Experiment(load("hanging_chain"), signals=(signal,))
    numbers = tuple(FreeNumber(f"p{k}", *one, abs(one[0])) for k, one in enumerate(free))
    return Formula((experiment,), numbers, {"y": NOISE}, model=model)


EVERYWHERE = -np.inf, np.inf
LINE = (lambda a, b: a + b * T), (2.0, 3.0), [(1.0, *EVERYWHERE), (1.0, *EVERYWHERE)]
CURVE = (lambda a, b, c: a + b * T + c * T**2), (2.0, 3.0, 1.5), [(1.0, *EVERYWHERE)] * 3


@pytest.mark.parametrize("case", [LINE, CURVE], ids=["line", "parabola"])
def test_polynomials_have_the_errors_of_the_closed_form(case):
    """Gauss: covariance sigma^2 inv(A'A), and a profile is the parabola s^2."""
    task = formula(*case)
    found = answer(task, search(task))
    A = T[:, None] ** np.arange(len(case[1]))
    covariance = NOISE**2 * np.linalg.inv(A.T @ A)
    deviations = np.sqrt(np.diag(covariance))
    assert found.errors == pytest.approx(deviations, rel=1e-9)
    assert found.correlations == pytest.approx(covariance / np.outer(deviations, deviations), rel=1e-9)
    best, squares = np.linalg.lstsq(A, task.signals[0].values)[:2]
    assert found.numbers == pytest.approx(best, rel=1e-9)
    assert found.chi2 == pytest.approx(squares[0] / NOISE**2 / (len(T) - len(best)), rel=1e-9)
    for number, error, profile in zip(found.numbers, found.errors, found.profiles, strict=True):
        assert profile.errors == pytest.approx([-2.0, -1.0, 1.0, 2.0])
        assert profile.numbers == pytest.approx(number + error * profile.errors, rel=1e-9)
        assert profile.rises == pytest.approx(profile.errors**2, rel=1e-6)
        assert profile.rises != pytest.approx((1.02 * profile.errors) ** 2, rel=1e-6)
    assert found.problems == ()
    assert all(" are correlated by " in note for note in found.notes)


def test_a_search_from_the_end_of_a_range():
    """There a difference must go down."""
    task = formula(*LINE[:2], [(5.0, 0.0, 5.0), (5.0, 0.0, 5.0)])
    found = answer(task, search(task))
    assert found.numbers == pytest.approx(LINE[1], abs=4.0 * max(found.errors))
    assert found.problems == ()


def test_an_error_above_the_number_is_no_success():
    task = formula(lambda a: 0.01 * a * T, [1.0], [(1.0, *EVERYWHERE)])
    found = answer(task, search(task))
    assert found.errors[0] == pytest.approx(NOISE / (0.01 * np.linalg.norm(T)), rel=1e-9)
    assert found.problems == ("p0 has an error above 100 %: these signals do not tell it",)


def test_an_error_that_is_not_linear_is_told():
    """Of an exponential with an error of 0.36: ((exp(0.36 s) - 1) / 0.36)^2 is 2.0 at -2 errors and 8.6 at +2."""
    task = formula(lambda a: 0.0176 * np.exp(a) * T, [1.0], [(1.1, *EVERYWHERE)], seed=None)
    (note,) = answer(task, search(task)).notes
    assert note.startswith("the error of p0 is rough: the sum of squares rises by 2 at -2, 0.7")
    assert ", 8.6 at +2 standard errors" in note


def test_a_profile_that_is_flat_gives_the_error():
    """A ripple below the noise makes the derivative, a line the rise of the sum of squares."""
    task = formula(lambda a: 1e-3 * np.sin(2e4 * a) + 0.05 * a * T, [1.0], [(1.1, *EVERYWHERE)])
    end, line = search(task), NOISE / (0.05 * np.linalg.norm(T))
    ripple = np.full((len(T), 1), 1e-3 * 2e4 * 1.1 / NOISE)
    found = answer(task, end._replace(jacobian=ripple))
    assert found.errors[0] == pytest.approx(line, rel=0.1)
    assert found.errors[0] != pytest.approx(1.25 * line, rel=0.1)
    assert any(note.endswith(" times that of its derivative, by the sum of squares") for note in found.notes)


def test_a_number_whose_profile_stays_flat_is_not_known():
    task = formula(lambda a: 1e-3 * np.sin(2e5 * a) + 0.5 * T, [1.0], [(1.1, *EVERYWHERE)])
    found = answer(task, search(task))
    assert found.errors == (np.inf,)
    assert "p0 is not known: within its range, or 100 %, the sum of squares hardly rises" in found.problems


def test_springs_in_series_cannot_be_told_apart():
    """1/k1 + 1/k2 alone is measured, so k1^2 of the one goes with -k2^2 of the other."""
    start = (1.9, *EVERYWHERE)
    task = formula(lambda k1, k2: 10.0 * T / (1.0 / k1 + 1.0 / k2), [2.0, 3.0], [start, start])
    found = answer(task, search(task))
    (sentence,) = (problem for problem in found.problems if problem.startswith("cannot be told apart"))
    first, second = (float(part.split()[1]) for part in sentence.partition(": ")[2].split(", "))
    k1, k2 = found.numbers
    assert first / second == pytest.approx(-((k1 / k2) ** 2), rel=0.01)
    assert first / second != pytest.approx(-1.02 * (k1 / k2) ** 2, rel=0.01)
    assert min(found.errors) > 1.9


WAVE = (lambda a: np.cos(a * T)), [31.0], [(8.0, 1.0, 50.0)]


def test_a_scan_finds_the_valley():
    """A cosine has a valley at each number of waves."""
    task = formula(*WAVE)
    alone, scanned = search(task), search(task, 40)
    assert task.numbers(scanned.u) == pytest.approx([31.0], abs=0.2)
    assert scanned.cost[1] < 0.1 * alone.cost[1]
    assert answer(task, alone).problems != ()
    assert answer(task, scanned).problems == ()


def test_a_scan_needs_ranges():
    with pytest.raises(BadInput, match=r"^scan 5: p0 has no range: free p0=FROM:TO has one$"):
        search(formula(*LINE), 5)


def test_a_better_place_on_a_profile_is_no_success():
    task = formula(*LINE)
    end = search(task)
    off = end._replace(u=end.u + 0.2, cost=(end.cost[0], task.sums([end.u + 0.2], end.noise)[0]))
    assert any(" is better, the sum of squares is " in problem for problem in answer(task, off).problems)


def test_a_number_that_acts_on_nothing_stays():
    task = formula(lambda a, b, c: a + 0.0 * b + c * T, [2.0, 1.0, 3.0], [(1.0, *EVERYWHERE)] * 3)
    found = answer(task, search(task))
    assert found.numbers[1] == 1.0
    assert found.problems == ("no signal depends on p1",)


def test_a_number_that_is_not_felt_goes_back_to_its_start():
    """A ripple of rounding drives it; over its whole way the sum of squares does not change."""
    task = formula(lambda a, b: a + 1e-5 * np.sin(2e5 * b) * T, [2.0, 1.0], [(1.0, *EVERYWHERE), (1.3, *EVERYWHERE)])
    end = search(task)
    assert task.numbers(end.u)[1] == 1.3
    assert task.numbers(end.u)[0] == pytest.approx(2.0, abs=0.05)


def test_residuals_that_follow_each_other_are_no_success():
    """A line through a parabola of the size of the noise: chi2/n is near 1, and neighbours are alike."""
    task = formula(lambda a, b, c: a + b * T + c * T**2, [2.0, 3.0, 2.0], CURVE[2])
    line = Formula(task.experiments, task.free[:2], {"y": NOISE}, model=LINE[0])
    found = answer(line, search(line))
    assert found.chi2 < 4.0
    assert any("the residuals of y are no noise" in problem for problem in found.problems)
    assert answer(task, search(task)).problems == ()


def test_a_search_that_starts_at_its_end_is_a_success():
    task = formula(*LINE)
    best = task.numbers(search(task).u)
    again = formula(*LINE[:2], [(number, *EVERYWHERE) for number in best])
    assert answer(again, search(again)).problems == ()
