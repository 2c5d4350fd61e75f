"""Uncertainty of fitted numbers: errors and correlations of linear theory, and profiles that test it by runs.

Standard errors come from J'J of independent samples with the given noise. Without a given noise that of a signal is the
RMS of its residual, which makes chi2/n 1 and says nothing about the model; where that is at the precision of record and
search, the fit is exact there, and errors are those of that precision. A profile is the sum of squares along one
number, with the others where linear theory has their best: s standard errors away it rises by s^2 if that theory holds.
Where it is flat, the derivative was that of rounding or impacts: the profile is followed outwards until it rises, and
its width is the error.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from orchestrator.log.time_series import Floats
from orchestrator.studies.least_squares import MAX_STEPS, ROUGH, Objective, Search, rms

AT_BOUND = 1e-6  # of a range
MOVED = 1e-4  # of a number's size: a search that moved by less was at its end
EXACT = 2.0  # times the precision of record and search: a residual up to there is none
SMOOTH = 0.2  # correlation of neighbouring residuals, and RANDOM its standard errors, above which they are no noise
RANDOM = 4.0
UNKNOWN = 1.0  # standard error of a combination, in units of the numbers' sizes, that is no answer
CORRELATED = 0.5  # that is told
REFUSED = 1e-3  # share of right models that the test of chi2/n refuses
AGREES = 0.5, 2.0  # rise of a profile over that of linear theory
ALONG = -2.0, -1.0, 1.0, 2.0  # standard errors at which a profile has runs
FLAT = AGREES[0] * 4.0  # rise two errors away below which a profile is followed
NONE = 1e-12  # of the largest eigenvalue of J'J: a direction without information


class ErrorProfile(NamedTuple):
    """Rise of the sum of squares along a number."""

    numbers: Floats  # (m,) SI
    errors: Floats  # (m,) s, distance from the fit in standard errors
    rises: Floats  # (m,); s^2 in linear theory


class FittedNumbers(NamedTuple):
    """Fitted numbers with what is known about them."""

    numbers: tuple[float, ...]
    errors: tuple[float, ...]  # standard errors; infinite where nothing is known
    correlations: Floats  # (k, k)
    chi2: float  # sum of squares over samples minus numbers
    profiles: tuple[ErrorProfile, ...]  # empty ones where nothing is known
    problems: tuple[str, ...]  # why it is no success
    notes: tuple[str, ...]
    exact: bool  # every residual is at the precision of record and search


def fitted_numbers(task: Objective, end: Search) -> FittedNumbers:
    """Fitted numbers of a search; makes the runs of the profiles."""
    keys = [one.key for one in task.free]
    values, vectors = np.linalg.eigh(end.jacobian.T @ end.jacobian)
    none = values <= NONE * values[-1]
    blind = none | (values < 1.0 / UNKNOWN**2)
    silent = {key for key, column in zip(keys, end.jacobian.T, strict=True) if not column.any()}
    inverse = 1.0 / np.where(none, np.inf, values)
    covariance = (vectors * inverse) @ vectors.T
    deviation = np.where((vectors[:, none] ** 2 > NONE).any(axis=1), np.inf, np.sqrt(np.diag(covariance)))
    with np.errstate(divide="ignore", invalid="ignore"):
        correlations = covariance / np.sqrt(np.outer(np.diag(covariance), np.diag(covariance)))
    profiles = _profiles(task, end, covariance, deviation)
    wider = np.array([_width(profile) for profile in profiles])
    deviation = deviation * wider
    chi2 = end.cost[1] / max(sum(len(one.t) for one in task.signals) - len(keys), 1)
    problems = [
        *(f"no signal depends on {key}" for key in keys if key in silent),
        *_inseparable(keys, vectors.T[blind], silent), *_unfinished(task, end, profiles),
        *(f"{key} is not known: within its range, or 100 %, the sum of squares hardly rises"
          for key, width, far in zip(keys, wider, deviation, strict=True) if width > 1.0 and far > UNKNOWN),
    ]  # fmt: skip
    exact, loose = dict[str, None](), dict[str, None]()  # signals without a residual, with its precision; the others
    for one, residual, least in zip(task.signals, task.difference(end.u), end.precision, strict=True):
        if rms(residual) <= EXACT * least:
            exact[f"{one.signal} {least:.2g} {one.unit}".rstrip()] = None
            continue
        loose[one.signal] = None
        alike = _alike(residual)
        if alike > max(SMOOTH, RANDOM / math.sqrt(len(residual))):
            problems.append(
                f"the residuals of {one.signal} are no noise, neighbours are correlated by {alike:.2f}: the model is"
                " wrong there, or samples are not independent, so errors are too small"
            )
    problems += _not_the_noise(task, end, covariance)
    notes = []
    for j, key in enumerate(keys):
        notes += [f"{key} and {keys[k]} are correlated by {correlations[j, k]:.3f}" for k in range(j)
                  if abs(correlations[j, k]) > CORRELATED and not blind.any()]  # fmt: skip
        if end.rough[j] > ROUGH and key not in silent:
            notes.append(f"the derivative by {key} changes by {100.0 * end.rough[j]:.2g} % with twice the step:"
                         " impacts or stick-slip; its error is rough")  # fmt: skip
        s, rises = profiles[j].errors, profiles[j].rises
        if 1.0 < wider[j] < math.inf:
            notes.append(f"the error of {key} is {wider[j]:.2g} times that of its derivative, by the sum of squares")
        elif wider[j] == 1.0 and ((rises < AGREES[0] * s**2) | (rises > AGREES[1] * s**2)).any():
            at_points = ", ".join(f"{rise:.2g} at {e:+g}" for e, rise in zip(s, rises, strict=True))
            notes.append(
                f"the error of {key} is rough: the sum of squares rises by {at_points} standard errors, not by 1 and 4"
            )
    if exact:
        notes.append(
            f"residuals of {', '.join(exact)} are at the precision of record and search, an exact fit:"
            f" errors are {'partly ' * bool(loose)}of that precision, not of a measurement"
        )
    if guessed := [name for name in loose if name not in task.noise]:
        notes.append(
            f"noise of {', '.join(guessed)} is estimated from residuals: chi2/n is 1 whether or not the model is right"
        )
    errors = (np.array([one.size for one in task.free]) * deviation).tolist()
    rest = tuple(problems), tuple(notes), not loose
    return FittedNumbers(tuple(task.numbers(end.u)), tuple(errors), correlations, chi2, profiles, *rest)


def _not_the_noise(task: Objective, end: Search, covariance: Floats) -> Iterator[str]:
    """Sentences on signals, and all together, whose differences are not the stated noise: chi-squared tests."""
    from scipy.stats import chi2

    parts = np.split(end.jacobian, np.cumsum([len(one.t) for one in task.signals])[:-1])
    sums: dict[str, Floats] = {}  # sum of squares, samples, samples less the numbers that they tell
    for one, j, d, s in zip(task.signals, parts, task.difference(end.u), end.noise, strict=True):
        if one.signal in task.noise:
            sums_of_signal = np.array([np.sum((d / s) ** 2), len(d), len(d) - np.sum((j @ covariance) * j)])
            sums[one.signal] = sums.get(one.signal, np.zeros(3)) + sums_of_signal
    every = {"all signals": np.sum([*sums.values()], axis=0)} if len(sums) > 1 else {}
    for name, (size, samples, freedom) in (sums | every).items():
        low, high = chi2.ppf([0.5 * REFUSED, 1.0 - 0.5 * REFUSED], max(freedom, 1.0)) / samples
        if not low < size / samples < high:
            found = f"chi2/n of {name} is {size / samples:.3g} over {samples:.0f} samples"
            yield f"{found}, {low:.2g} to {high:.2g} would be the stated noise"


def _alike(residual: Floats) -> float:
    """Correlation of neighbouring values about 0; 0 for none (Durbin and Watson, Biometrika 37, 1950)."""
    size = float(residual @ residual)
    return float(residual[1:] @ residual[:-1]) / size if size else 0.0


def _inseparable(keys: list[str], directions: Floats, silent: set[str]) -> list[str]:
    """Sentences on combinations of numbers that change nothing that was measured."""
    found = []
    for vector in directions:
        parts = [(float(v), key) for v, key in zip(vector, keys, strict=True) if abs(v) > 0.1 and key not in silent]
        if len(parts) > 1:
            largest = max(parts, key=lambda part: abs(part[0]))[0]
            change = ", ".join(f"{key} {100.0 * v / largest:+.3g} %" for v, key in parts)
            found.append(f"cannot be told apart: {change} together change nothing that was measured")
        elif parts:
            found.append(f"{parts[0][1]} has an error above 100 %: these signals do not tell it")
    return found


def _unfinished(task: Objective, end: Search, profiles: tuple[ErrorProfile, ...]) -> list[str]:
    """Sentences on a search that did not end in a minimum inside of its ranges."""
    found = [] if end.converged else [f"the search has not converged after {MAX_STEPS} steps"]
    for one, v, a, b in zip(task.free, end.u, *task.bounds(), strict=True):
        if min(v - a, b - v) < AT_BOUND * (b - a) < math.inf:
            found.append(f"{one.key} ends at its bound, {one.low if v - a < b - v else one.high:g}")
    if not end.cost[1] < end.cost[0] * (1.0 - 1e-9) and np.abs(end.u - end.start).max() > MOVED:
        found.append("the fit is no better than its start")
    for one, profile in zip(task.free, profiles, strict=True):
        if len(profile.rises) and profile.rises.min() < -1.0:
            k = int(profile.rises.argmin())
            found.append(
                f"{one.key} = {profile.numbers[k]:.6g} is better, the sum of squares is {-profile.rises[k]:.3g} less"
            )
    return found


def _profiles(task: Objective, end: Search, covariance: Floats, deviation: Floats) -> tuple[ErrorProfile, ...]:
    """Profile of each number, followed up to 100 % where it is flat; numbers that are not known have empty ones."""
    known = deviation <= UNKNOWN
    directions = np.where(known, covariance / np.where(known, deviation, 1.0), 0.0)
    task.values([u for k in np.flatnonzero(known) for _, u in _inside(task, end.u, directions[:, k], ALONG)])  # at once
    found = []
    for k, error in enumerate(deviation):
        along: tuple[float, ...] = ALONG if known[k] else ()
        rows: list[tuple[float, float, float]] = []
        while along:
            points = _inside(task, end.u, directions[:, k], along)
            sums = task.sums([u for _, u in points], end.noise)
            new = [(task.numbers(u)[k], s, one - end.cost[1]) for (s, u), one in zip(points, sums, strict=True)]
            new = [row for row in new if not math.isnan(row[2])]
            rows += new
            far = 2.0 * along[-1]
            flat = new and min(rise for _, s, rise in new if abs(s) == along[-1]) < FLAT
            along = (-far, far) if flat and far * error <= UNKNOWN else ()
        found.append(ErrorProfile(*np.array(sorted(rows)).reshape(-1, 3).T))
    return tuple(found)


def _inside(task: Objective, u: Floats, direction: Floats, along: tuple[float, ...]) -> list[tuple[float, Floats]]:
    """Distances in errors, and the variables there, that are inside of all ranges."""
    low, high = task.bounds()
    return [(s, v) for s in along for v in [u + s * direction] if ((low <= v) & (v <= high)).all()]


def _width(profile: ErrorProfile) -> float:
    """Error by a profile over that by the derivative: 1 where it rises as soon; infinite where it never does."""
    outermost = np.abs(profile.errors) == np.abs(profile.errors).max(initial=0.0)
    rise = profile.rises[outermost].min(initial=math.inf)
    far = float(np.abs(profile.errors).max(initial=0.0))
    if rise < FLAT:
        return math.inf
    return far / math.sqrt(rise) if far > ALONG[-1] else 1.0
