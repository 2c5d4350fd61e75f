"""Fit: numbers of a scene with which its runs agree best with measured signals, and how sure they are.

Least squares of r = (run - measured) / noise over all samples, by the trust-region method of Branch, Coleman and Li
(SIAM J. Sci. Comput. 21, 1999, doi 10.1137/S1064827595289108) in scipy, which keeps bounds; variables count from the
start in units of its size or of the range. A run rounds (the place of an idler to 1e-8 m), and impacts and stick-slip
are rough: a derivative is a difference over the first of STEPS that agrees with that over twice the step.

Standard errors are those of linear theory, from J'J of independent samples with the given noise. Without a given noise
that of a signal is the RMS of its residual, which makes chi2/n 1 and says nothing about the model.
"""

from __future__ import annotations

import json
import math
import os
import tempfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from fmus.vehicles.tables import BadInput
from orchestrator.execution.interrupt import Interrupt
from orchestrator.execution.simulate import simulate
from orchestrator.log.reader import Log, NoSuchSignal
from orchestrator.log.time_series import Floats, within
from orchestrator.results import output_files
from orchestrator.results.measured_difference import read_shifted
from orchestrator.results.measured_record import MeasuredFile, MeasuredSignal
from orchestrator.results.output_files import Picture, new_figure
from orchestrator.results.run_data import EVER, RunData, Window
from orchestrator.results.table import Column, Table
from orchestrator.scene.keys import scene_keys
from orchestrator.scene.kinds import Scene
from orchestrator.scene.products import make_folder
from orchestrator.scene.scene import load, with_settings
from orchestrator.scene.settings import toml_text
from orchestrator.studies import Case, Row, pool

STEPS = 1e-4, 1e-3, 1e-2  # of differences, in units of a number's size: the first that is not rough
ROUGH = 0.1  # change of a derivative with twice the step that is told
AT_BOUND = 1e-6  # of a range
UNKNOWN = 1.0  # standard error of a combination, in units of the numbers' sizes, that is no answer
CORRELATED = 0.95
AGREES = 0.5, 2.0  # chi2/n of a model whose differences are noise
ROUNDS = 3  # of searches with an estimated noise
MOST_STEPS = 30  # of a search


class FreeNumber(NamedTuple):
    """Number of a scene that is fitted, in SI units."""

    key: str
    start: float
    low: float
    high: float
    size: float  # unit of its variable


def free_number(scene: Scene, text: str) -> FreeNumber:
    """Number by ``KEY`` or ``KEY=FROM:TO``, whose ends may have a unit; raises BadInput."""
    key, _, ends = (part.strip() for part in text.partition("="))
    start, (low, high) = number_at(scene, key), (-math.inf, math.inf)
    if ends:
        parts = [part.strip() for part in ends.split(":")]
        if len(parts) != 2 or not all(parts):
            raise BadInput(f"--free {text}: must be KEY or KEY=FROM:TO, for example vehicle.track.tension=10:20 kN")
        unit = parts[1].lstrip("+-.0123456789eE").strip()
        if unit and parts[0][-1:] in "0123456789.":
            parts[0] = f"{parts[0]} {unit}"
        low, high = (number_at(with_settings(scene, [f"{key}={part}"]), key) for part in parts)
        if not low < high:
            raise BadInput(f"--free {text}: FROM must be below TO")
        if not low <= start <= high:
            raise BadInput(
                f"--free {text}: the scene has {start:g}, outside of the range: --set {key}=... moves the start"
            )
    size = abs(start) or high - low
    if not 0.0 < size < math.inf:
        raise BadInput(f"--free {text}: the scene has 0, so a range KEY=FROM:TO must say how large it may be")
    try:
        with_settings(scene, {key: start + STEPS[0] * size * (1.0 if start + STEPS[0] * size <= high else -1.0)})
    except BadInput as error:  # a stop, for example, is a multiple of the step
        raise BadInput(f"--free {text}: cannot be changed a little: {error}") from None
    return FreeNumber(key, start, low, high, size)


def number_at(scene: Any, key: str, option: str = "--free") -> float:
    """Number of a dotted key of a scene, SI; raises BadInput where there is none."""
    place: Any = scene.resolved()
    for part in key.split("."):
        if isinstance(place, Mapping) and part in place:
            place = place[part]
        elif isinstance(place, list | tuple) and part.isdecimal() and int(part) < len(place):
            place = place[int(part)]
        else:
            raise BadInput(f"{option} {key}: {scene.where} has no such number ('{part}'); 'cotrack keys' lists all")
    if not isinstance(place, float):
        raise BadInput(f"{option} {key}: is {json.dumps(place)[:60]} in {scene.where}, and a real number is needed")
    return place


class FitFailed(Exception):
    """A fit cannot begin or go on: a run fails."""


def run_signals(scene: Scene, native: bool, wanted: Sequence[tuple[str, tuple[float, ...]]]) -> list[Row]:
    """Values of signals of a run at instants, s, linear between records; raises KeyboardInterrupt, RuntimeError."""
    interrupt = Interrupt()
    with tempfile.TemporaryDirectory(prefix="cotrack-") as folder:
        path = Path(folder) / "run.mcap"
        result = simulate(scene, path, estimated=False, native=native, interrupt=interrupt)
        if interrupt.requested:
            raise KeyboardInterrupt
        if result["status"] != "ok":
            raise RuntimeError(result["message"])
        with Log(path) as log:
            run = RunData(log)
            values = [np.interp(t, *run.signal(signal, EVER)).tolist() for signal, t in wanted]
    return [Row("", "", {"values": values}, True)]


@dataclass
class Fit:
    """Search for the numbers of a scene."""

    scene: Scene
    free: tuple[FreeNumber, ...]
    signals: tuple[MeasuredSignal, ...]  # on the clock of the run, without gaps
    noise: dict[str, float]  # by signal, in its unit; those that are missing are estimated
    native: bool = False
    workers: int = 1
    store: pool.Store | None = None
    told: Callable[[str], None] = lambda text: None
    runs: int = 0
    _values: dict[tuple[float, ...], list[Floats] | str] = field(default_factory=dict)

    def values(self, points: Sequence[Floats]) -> list[list[Floats] | str]:
        """Signals of the runs with each of some variables (k,), or why a run fails; runs that are new in parallel."""
        keys = [tuple(point.tolist()) for point in points]
        new = [key for key in dict.fromkeys(keys) if key not in self._values]
        wanted = [(one.signal, tuple(one.t.tolist())) for one in self.signals]
        cases = {}
        for key in new:
            numbers = dict(zip((one.key for one in self.free), self.numbers(np.array(key)), strict=True))
            name = ", ".join(f"{one}={number:.10g}" for one, number in numbers.items())
            try:
                scene = with_settings(self.scene, numbers)
            except BadInput as error:  # numbers that do not go together
                self._values[key] = f"{name}: {error}"
            else:
                arguments = scene, self.native, wanted
                cases[key] = Case(self.scene.name, name, run_signals, arguments, scene.run.stop)
        rows = pool.run([*cases.values()], self.workers, None, self.store)
        self.runs += len(cases)
        for (key, case), row in zip(cases.items(), rows, strict=True):
            self._values[key] = [np.array(v) for v in row["values"]] if row.ok else f"{case.name}: {row.note}"
        return [self._values[key] for key in keys]

    def numbers(self, u: Floats) -> list[float]:
        """Numbers of the scene for variables (k,), within their ranges."""
        return [
            float(np.clip(one.start + one.size * v, one.low, one.high)) for one, v in zip(self.free, u, strict=True)
        ]

    def difference(self, u: Floats) -> list[Floats]:
        """Run minus measured by signal; raises FitFailed."""
        (values,) = self.values([u])
        if isinstance(values, str):
            raise FitFailed(values)
        return [run - one.values for run, one in zip(values, self.signals, strict=True)]

    def jacobian(self, u: Floats, lengths: Floats) -> list[Floats]:
        """Derivatives (samples, k) of each signal with the variables, by steps (k,); raises FitFailed.

        Differences go up; where that leaves a range or the run fails, down.
        """
        highs = self.bounds()[1]
        steps = [-step if v + step > high else step for v, high, step in zip(u, highs, lengths, strict=True)]
        points = [u + s * e for s, e in zip(steps, np.eye(len(u)), strict=True)]
        middle, *sides = self.values([u, *points])
        if isinstance(middle, str):
            raise FitFailed(middle)
        columns = []
        for k, side in enumerate(sides):
            if isinstance(side, str):
                steps[k] = -steps[k]
                (side,) = self.values([u + steps[k] * np.eye(len(u))[k]])
                if isinstance(side, str):
                    raise FitFailed(side)
            columns.append([(a - b) / steps[k] for a, b in zip(side, middle, strict=True)])
        return [np.stack([column[i] for column in columns], axis=1) for i in range(len(self.signals))]

    def bounds(self) -> tuple[Floats, Floats]:
        """Least and largest variables."""
        low, high = zip(
            *(((one.low - one.start) / one.size, (one.high - one.start) / one.size) for one in self.free), strict=True
        )
        return np.array(low), np.array(high)


class Search(NamedTuple):
    """End of a search."""

    u: Floats  # (k,) variables
    noise: dict[str, float]  # by signal
    cost: tuple[float, float]  # sum of squares at the start and at the end, with that noise
    jacobian: Floats  # (samples, k) over the noise
    steps: Floats  # (k,) of the differences
    rough: Floats  # (k,) change of each column with twice the step
    converged: bool


def search(fit: Fit) -> Search:
    """Search from the start; raises FitFailed where a run fails from which it cannot turn back."""
    from scipy.optimize import least_squares

    u = np.zeros(len(fit.free))
    first = fit.difference(u)
    noise = {
        one.signal: fit.noise.get(one.signal) or _spread(one, d) for one, d in zip(fit.signals, first, strict=True)
    }
    estimated = [one.signal for one in fit.signals if one.signal not in fit.noise]
    for _ in range(ROUNDS if estimated else 1):
        weights = [1.0 / noise[one.signal] for one in fit.signals]

        def residual(v: Floats, weights: Sequence[float] = weights) -> Floats:
            try:
                difference = fit.difference(v)
            except FitFailed:  # a shorter step is tried
                return np.full(sum(len(one.t) for one in fit.signals), np.inf)
            r = np.concatenate([w * d for w, d in zip(weights, difference, strict=True)])
            fit.told(f"sum of squares {r @ r:.6g} at {', '.join(f'{x:.6g}' for x in fit.numbers(v))}")
            return r

        steps = _smooth_steps(fit, u, noise)[0]

        def jacobian(v: Floats, weights: Sequence[float] = weights, steps: Floats = steps) -> Floats:
            return np.concatenate([w * j for w, j in zip(weights, fit.jacobian(v, steps), strict=True)])

        found = least_squares(
            residual, u, jacobian, fit.bounds(), ftol=1e-6, xtol=1e-7, gtol=1e-10, max_nfev=MOST_STEPS
        )
        before, u = noise, found.x
        if not estimated:
            break
        last = fit.difference(u)
        residuals = {one.signal: _rms(d) for one, d in zip(fit.signals, last, strict=True)}
        noise = {signal: (residuals[signal] if signal in estimated else s) or s for signal, s in before.items()}
        if all(abs(noise[signal] / before[signal] - 1.0) < 0.01 for signal in estimated):
            break
    ends = []
    for v in (np.zeros(len(u)), u):
        difference = zip(fit.signals, fit.difference(v), strict=True)
        ends.append(sum(float(np.sum((d / noise[one.signal]) ** 2)) for one, d in difference))
    steps, columns, rough = _smooth_steps(fit, u, noise)
    return Search(u, noise, (ends[0], ends[1]), columns, steps, rough, found.status > 0)


def _smooth_steps(fit: Fit, u: Floats, noise: Mapping[str, float]) -> tuple[Floats, Floats, Floats]:
    """Steps (k,), derivatives over the noise (samples, k) by them, and their change (k,) with twice the step."""

    def columns(lengths: Floats) -> Floats:
        derivatives = fit.jacobian(u, lengths)
        return np.concatenate([j / noise[one.signal] for one, j in zip(fit.signals, derivatives, strict=True)])

    steps = np.full(len(u), STEPS[0])
    best, rough = columns(steps), np.full(len(u), np.inf)
    for step in STEPS:
        tried = np.where(rough > ROUGH, step, steps)
        once, twice = columns(tried), columns(2.0 * tried)
        size = np.linalg.norm(once, axis=0)
        changes = np.linalg.norm(twice - once, axis=0) / np.where(size > 0.0, size, 1.0)
        better = changes < rough
        steps, rough, best = (
            np.where(better, tried, steps), np.where(better, changes, rough), np.where(better, once, best),
        )  # fmt: skip
        rough = np.where(best.any(axis=0), rough, np.inf)  # a step too small to be felt
        if (rough <= ROUGH).all():
            break
    return steps, best, np.where(np.isfinite(rough), rough, 0.0)


def _rms(values: Floats) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


def _spread(one: MeasuredSignal, difference: Floats) -> float:
    """First weight of a signal whose noise is not known: its deviation, or the size of the difference."""
    return float(np.std(one.values)) or _rms(difference) or 1.0


class Answer(NamedTuple):
    """Fitted numbers with what is known about them."""

    numbers: tuple[float, ...]
    errors: tuple[float, ...]  # standard errors; infinite where nothing is known
    correlations: Floats  # (k, k)
    chi2: float  # sum of squares over samples minus numbers
    problems: tuple[str, ...]  # why it is no success
    notes: tuple[str, ...]


def answer(fit: Fit, end: Search) -> Answer:
    """Answer of a search."""
    keys = [one.key for one in fit.free]
    numbers, sizes = fit.numbers(end.u), np.array([one.size for one in fit.free])
    fisher = end.jacobian.T @ end.jacobian
    values, vectors = np.linalg.eigh(fisher)
    values = np.maximum(values, 0.0)
    blind = values < max(1.0 / UNKNOWN**2, 1e-12 * values[-1])
    problems, notes = [], []
    silent = [key for key, column in zip(keys, end.jacobian.T, strict=True) if not column.any()]
    problems += [f"no signal depends on {key}" for key in silent]
    for vector in vectors.T[blind]:
        parts = [(float(v), key) for v, key in zip(vector, keys, strict=True) if abs(v) > 0.1 and key not in silent]
        if len(parts) > 1:
            largest = max(parts, key=lambda part: abs(part[0]))[0]
            change = ", ".join(f"{key} {100.0 * v / largest:+.3g} %" for v, key in parts)
            problems.append(f"cannot be told apart: {change} together change nothing that was measured")
        elif parts:
            problems.append(f"{parts[0][1]} is not known to 100 % by these signals")
    with np.errstate(divide="ignore", invalid="ignore"):
        inverse = np.where(blind, np.inf, 1.0 / values)
        variance = np.array(
            [sum(i * v**2 for i, v in zip(inverse, row, strict=True) if v**2 > 1e-12) for row in vectors]
        )
        covariance = (vectors * np.where(blind, 0.0, inverse)) @ vectors.T
        deviation = np.sqrt(np.diag(covariance))
        correlations = covariance / np.outer(deviation, deviation)
    if not end.converged:
        problems.append(f"the search has not converged after {MOST_STEPS} steps")
    low, high = fit.bounds()
    for one, v, a, b in zip(fit.free, end.u, low, high, strict=True):
        if min(v - a, b - v) < AT_BOUND * (b - a) < math.inf:
            problems.append(f"{one.key} ends at its bound, {one.low if v - a < b - v else one.high:g}")
    if not end.cost[1] < end.cost[0] * (1.0 - 1e-9) and np.abs(end.u).max() > 0.0:
        problems.append("the fit is no better than its start")
    count = sum(len(one.t) for one in fit.signals)
    chi2 = end.cost[1] / max(count - len(keys), 1)
    if fit.noise and not AGREES[0] < chi2 < AGREES[1]:
        problems.append(f"chi2/n is {chi2:.3g}: the differences are not the stated noise")
    for j, key in enumerate(keys):
        notes += [f"{key} and {keys[k]} are correlated by {correlations[j, k]:.3f}" for k in range(j)
                  if abs(correlations[j, k]) > CORRELATED and not blind.any()]  # fmt: skip
        if end.rough[j] > ROUGH and key not in silent:
            notes.append(f"the derivative by {key} changes by {100.0 * end.rough[j]:.2g} % with twice the step:"
                         " impacts or stick-slip; its error is rough")  # fmt: skip
    if len(fit.noise) < len(fit.signals):
        notes.append("noise is estimated from the residuals, so chi2/n is 1 whether or not the model is right")
    errors = tuple((sizes * np.sqrt(variance)).tolist())
    return Answer(tuple(numbers), errors, correlations, chi2, tuple(problems), tuple(notes))


# --- the whole of it -------------------------------------------------------------------------------

COLUMNS = (
    Column("key", "number"), Column("unit", "unit"), Column("start", "start", ".8g"), Column("fitted", "fitted", ".8g"),
    Column("error", "standard error", ".3g"), Column("relative", "of the number, %", ".3g"),
    Column("step", "relative step", ".0e"), Column("rough", "change of the derivative with twice the step, %", ".2g"),
)  # fmt: skip
RESIDUALS = (
    Column("signal", "signal"), Column("unit", "unit"), Column("samples", "samples"), Column("noise", "noise", ".4g"),
    Column("first", "RMS of the first run", ".4g"), Column("last", "RMS of the fitted run", ".4g"),
)  # fmt: skip


class Fitted(NamedTuple):
    """Result of ``fit``."""

    verdict: str  # first line: "fitted: ...", or "no fit: ..." with the reasons
    ok: bool
    table: Table
    residuals: Table
    answer: Answer
    files: tuple[Path, ...]
    scene: Scene  # with the fitted numbers


def fit(  # noqa: PLR0913, the options of the command
    scene: str,
    data: str | os.PathLike[str],
    columns: Mapping[str, str],
    free: Sequence[str],
    output: str | os.PathLike[str],
    *,
    track: str | None = None,
    settings: Sequence[str] | Mapping[str, Any] = (),
    clock: str = "",
    shift: float | str = 0.0,
    noise: Mapping[str, float] | None = None,
    start: float = -math.inf,
    end: float = math.inf,
    native: bool = False,
    workers: int = 1,
    told: Callable[[str], None] = lambda text: None,
) -> Fitted:
    """Fit numbers of a scene to measured signals; write tables, picture and the fitted scene into the folder.

    ``columns``: column of the file ``data`` by signal, with ``clock`` and ``shift`` as of ``compare``. ``free``:
    texts ``KEY`` or ``KEY=FROM:TO``. ``noise``: standard deviation of a sample by signal, in its unit; it is estimated
    where it is missing. ``start``, ``end``: window, s. ``told`` gets a line at each step of the search.

    An interrupted fit of the same folder continues. Several ``workers`` are processes, for which a script needs
    ``if __name__ == "__main__":``. Raises BadInput, also where a run fails; KeyboardInterrupt.
    """
    source, window = MeasuredFile(data, columns, clock, shift), Window(start, end)
    return _fit(load(scene, track, settings), source, free, Path(output), noise or {}, window, native, workers, told)


def _fit(
    scene: Scene,
    data: MeasuredFile,
    free: Sequence[str],
    output: Path,
    noise: Mapping[str, float],
    window: Window,
    native: bool,
    workers: int,
    told: Callable[[str], None],
) -> Fitted:
    if not free:
        raise BadInput("--free KEY: a fit needs a number to fit")
    numbers = tuple(free_number(scene, text) for text in free)
    if len({one.key for one in numbers}) < len(numbers):
        raise BadInput(f"--free {numbers[-1].key}: is given twice")
    for signal in noise:
        if signal not in data.columns:
            raise BadInput(f"--noise {signal}: no --map gives this signal a column")
    signals, shift, notes = _measured(scene, data, window, native)
    make_folder(output)
    task = Fit(scene, numbers, signals, dict(noise), native, workers, pool.Store(output / "cases"), told)
    try:
        end = search(task)
    except FitFailed as failure:
        raise BadInput(f"a run fails, so nothing is fitted: {failure}") from None
    found = answer(task, end)
    count = sum(len(one.t) for one in signals)
    samples = f"{count} samples of {len(signals)} signals"
    about = f"{len(numbers)} numbers by {samples}, chi2/n {found.chi2:.4g}, {task.runs} runs"
    verdict = f"no fit: {'; '.join(found.problems)} ({about})" if found.problems else f"fitted: {about}"
    units = {key.key: key.unit for key in scene_keys()}
    records = [
        {"key": one.key, "unit": units.get(one.key, ""), "start": one.start, "fitted": number, "error": error,
         "relative": 100.0 * error / abs(number) if number else math.inf, "step": step, "rough": 100.0 * rough}
        for one, number, error, step, rough in zip(
            numbers, found.numbers, found.errors, end.steps, end.rough, strict=True)
    ]  # fmt: skip
    first, last = task.difference(np.zeros(len(numbers))), task.difference(end.u)
    sizes = [
        {"signal": one.signal, "unit": one.unit, "samples": len(one.t), "noise": end.noise[one.signal],
         "first": _rms(a), "last": _rms(b)}
        for one, a, b in zip(signals, first, last, strict=True)
    ]  # fmt: skip
    changed = with_settings(scene, dict(zip((one.key for one in numbers), found.numbers, strict=True)))
    assert isinstance(changed, Scene)
    origin = f"fitted to {data.path}, {shift:g} s added to its times"
    origins = {
        one.key: f"{origin}; standard error {error:.3g}" for one, error in zip(numbers, found.errors, strict=True)
    }
    table = Table.of_records(f"Fit of {scene.name}", COLUMNS, records, (*notes, *found.notes))
    residuals = Table.of_records("Residuals", RESIDUALS, sizes)
    result = {
        "verdict": verdict, "ok": not found.problems, "numbers": records, "signals": sizes, "chi2_n": found.chi2,
        "correlations": found.correlations.tolist(), "problems": found.problems, "notes": [*notes, *found.notes],
    }  # fmt: skip
    more = {"fit.json": json.dumps(_finite(result), indent=1), "residuals.csv": residuals.csv()} | _scene_files(
        changed, origins
    )
    files = output_files.save_results(output, "fit", table, _draw(task, end, scene.name), more)
    return Fitted(verdict, not found.problems, table, residuals, found, tuple(files), changed)


def _finite(value: Any) -> Any:
    """Plain data with None for numbers that JSON has not."""
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, Mapping):
        return {key: _finite(one) for key, one in value.items()}
    return [_finite(one) for one in value] if isinstance(value, list | tuple) else value


def _measured(
    scene: Scene, data: MeasuredFile, window: Window, native: bool
) -> tuple[tuple[MeasuredSignal, ...], float, tuple[str, ...]]:
    """Measured signals without gaps in the window and the time of a run, their shift, and notes."""
    with tempfile.TemporaryDirectory(prefix="cotrack-") as folder:
        path = Path(folder) / "run.mcap"
        result = simulate(scene, path, estimated=False, native=native)
        if result["status"] != "ok":
            raise BadInput(f"the run of the start fails, so nothing is fitted: {result['message']}")
        with Log(path) as log:
            run = RunData(log)
            try:
                record = read_shifted(run, data, window)
            except NoSuchSignal as error:  # the path of the log says nothing to a user
                raise BadInput(str(error).replace(str(path), f"a run of {scene.name}")) from None
            spans = [run.signal(one.signal, EVER)[0][[0, -1]] for one in record.signals]
    signals = []
    for one, (begin, stop) in zip(record.signals, spans, strict=True):
        inside = within(one.t, window) & (one.t >= begin) & (one.t <= stop) & ~np.isnan(one.values)
        if not inside.any():
            raise BadInput(
                f"{record.file}: '{one.column}' has no sample in the time of the run, {begin:g} to {stop:g} s"
            )
        signals.append(one._replace(t=one.t[inside], values=one.values[inside]))
    return tuple(signals), record.shift, record.notes


def _draw(task: Fit, end: Search, title: str) -> Picture:
    """Data, first run and fitted run of each signal."""
    figure = new_figure(9.0, 2.2 * len(task.signals) + 0.6)
    panes = figure.subplots(len(task.signals), 1, squeeze=False, sharex=True)[:, 0]
    first, last = task.difference(np.zeros(len(task.free))), task.difference(end.u)
    for pane, one, a, b in zip(panes, task.signals, first, last, strict=True):
        pane.plot(one.t, one.values, ".", ms=2, color="0.6", label="measured")
        pane.plot(one.t, one.values + a, lw=0.8, ls="--", label="start")
        pane.plot(one.t, one.values + b, lw=1.0, label="fitted")
        pane.set_ylabel(f"{one.signal}, {one.unit}", fontsize=7)
    panes[0].legend(fontsize=7)
    panes[-1].set_xlabel("t, s")
    figure.suptitle(f"Fit of {title}", fontsize=11)
    return figure


def _scene_files(scene: Scene, origins: Mapping[str, str]) -> dict[str, str]:
    """Texts of the whole fitted scene and its vehicle, files that ``run`` takes, with the origin of each number."""
    resolved = scene.resolved()
    vehicle = resolved.pop("vehicle")
    resolved.pop("name", None)
    of_vehicle = {key.removeprefix("vehicle."): text for key, text in origins.items() if key.startswith("vehicle.")}
    others = {key: text for key, text in origins.items() if not key.startswith("vehicle.")}
    return {
        "fitted.toml": "\n".join(_toml_lines({"vehicle": "fitted_vehicle.toml", **resolved}, others)) + "\n",
        "fitted_vehicle.toml": "\n".join(_toml_lines(vehicle, of_vehicle)) + "\n",
    }


def _toml_lines(table: Mapping[str, Any], origins: Mapping[str, str], above: str = "") -> list[str]:
    """Lines of a table of TOML and of its tables, with a comment behind each number that has an origin."""
    lines, tables = [], []
    for name, value in table.items():
        key = f"{above}{name}"
        if isinstance(value, Mapping):
            tables += ["", f"[{key}]", *_toml_lines(value, origins, f"{key}.")]
        else:
            told = [text for one, text in origins.items() if one == key or one.startswith(f"{key}.")]
            lines.append(f"{name} = {toml_text(value)}" + (f"  # {told[0]}" if told else ""))
    return [*lines, *tables]
