"""Least squares between runs and measured signals: r = (run - measured) / noise over all samples of all experiments.

The search is the trust-region method of Branch, Coleman and Li (SIAM J. Sci. Comput. 21, 1999, doi
10.1137/S1064827595289108) in scipy, which keeps bounds; variables count from the start in units of its size or of the
range. A run rounds (the place of an idler to 1e-8 m), and impacts and stick-slip are rough: a derivative is a
difference over the first of STEPS that agrees with that over twice the step. Before that, a search by differences over
COARSE crosses small valleys, as of ripples whose phase moves (implicit filtering: Gilmore and Kelley, SIAM J. Optim. 5,
1995, doi 10.1137/0805015; here with two scales). A scan looks for the valley in which the search begins, by a Latin
hypercube of the ranges.

A shift of a clock that is to be found is a free number, whose differences need no runs: a run counts with all its
records then. It begins with that of the run of the start and, where that is better, goes on from that of the run at
the end of the first search.
"""

from __future__ import annotations

import math
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

import numpy as np

from fmus.vehicles.tables import BadInput
from orchestrator.execution.replay_model import open_replay
from orchestrator.execution.simulate import simulate
from orchestrator.files.messages import PROGRESS
from orchestrator.log.angles import turn_of, turns_beside
from orchestrator.log.reader import Log
from orchestrator.log.time_series import Floats
from orchestrator.results.measured_difference import find_shift
from orchestrator.results.measured_record import MeasuredSignal
from orchestrator.results.run_data import EVER, RunData
from orchestrator.scene.kinds import Scene
from orchestrator.scene.scene import with_settings
from orchestrator.studies import Case, Row, pool
from orchestrator.studies.free_numbers import SMALL, FreeNumber

COARSE = 1e-1  # step of the differences of a first search, in units of a number's size
STEPS = SMALL, 1e-3, 1e-2  # of differences, in units of a number's size: the first that is not rough
ROUGH = 0.1  # change of a derivative with twice the step that is told
ROUNDS = 3  # of searches with an estimated noise
MAX_STEPS = 30  # of a search
RESOLVED = 1e-7  # change of the variables below which a search ends: what it makes in a signal is no residual
STILL, STANDS = 1e-4, 4  # part of the sum of squares, and UNFELT, by which so many in turn differ where it stands
UNFELT = 0.01  # rise of the sum of squares below which a number goes back to its start
SILENT = 0.1  # norm of a column below which its number stays: its error would be ten times its size


class _StandsStill(Exception):
    """The sum of squares does not change any more."""


class FitFailed(Exception):
    """A fit cannot begin or go on: a run fails."""


class RecordedPart(NamedTuple):
    """Component that is stepped alone, with the inputs that a log has of it."""

    log: Path
    component: str
    track: str | None  # another model than in the log
    digest: str  # of the log


class Experiment(NamedTuple):
    """Scene, or a part of one, and the signals that were measured in it."""

    scene: Scene
    part: RecordedPart | None = None
    native: bool = False
    signals: tuple[MeasuredSignal, ...] = ()  # on the clock of the run, without gaps
    files: tuple[str, ...] = ()  # of each signal

    def run(self, numbers: Mapping[str, float], path: Path) -> None:
        """Log a run with other numbers; raises BadInput, RuntimeError where it fails, KeyboardInterrupt."""
        if self.part is not None:
            settings = [f"{key}={number!r}" for key, number in numbers.items()]
            with open_replay(self.part.log, self.part.component, self.part.track, settings) as replay:
                if not replay.record(path):
                    raise BadInput(f"{self.part.log} holds no step of '{self.part.component}'")
            return
        scene = with_settings(self.scene, numbers) if numbers else self.scene
        result = simulate(scene, path, estimated=False, native=self.native, raise_faults=True)
        if result["status"] != "ok":
            raise RuntimeError(result["message"])


def run_signals(
    experiment: Experiment, numbers: Mapping[str, float], wanted: Sequence[tuple[str, tuple[float, ...]]]
) -> list[Row]:
    """Values of signals of a run at instants, s, linear between records; raises as ``Experiment.run``.

    Of a signal without instants: times and values of all records.
    """
    with tempfile.TemporaryDirectory(prefix="cotrack-") as folder:
        path = Path(folder) / "run.mcap"
        experiment.run(numbers, path)
        with Log(path) as log:
            run = RunData(log)
            records = [(t, run.signal(signal, EVER)) for signal, t in wanted]
            values = [np.interp(t, *each).tolist() if t else np.array(each).tolist() for t, each in records]
    return [Row("", "", {"values": values}, True)]


@dataclass
class Objective:
    """Sum of squares of the experiments as a function of the variables (k,) of free numbers."""

    experiments: tuple[Experiment, ...]
    free: tuple[FreeNumber, ...]
    noise: Mapping[str, float]  # by signal, in its unit; that of others is estimated
    workers: int = 1
    store: pool.Store | None = None
    runs: int = 0
    _values: dict[tuple[float, ...], list[Floats] | str] = field(default_factory=dict)

    @property
    def signals(self) -> list[MeasuredSignal]:
        """Measured signals of all experiments."""
        return [signal for experiment in self.experiments for signal in experiment.signals]

    @property
    def files(self) -> list[str]:
        """File of each of the ``signals``."""
        return [file for experiment in self.experiments for file in experiment.files]

    def values(self, points: Sequence[Floats]) -> list[list[Floats] | str]:
        """Signals of the runs with each of some variables (k,), or why a run fails, at the instants of the samples."""
        return [run if isinstance(run, str) else self._at_samples(u, run)
                for u, run in zip(points, self._runs(points), strict=True)]  # fmt: skip

    def _at_samples(self, u: Floats, run: Sequence[Floats]) -> list[Floats]:
        """Signals of a run at the instants of the samples, angles beside those measured."""
        found = [np.interp(t, *each) if each.ndim > 1 else each for t, each in zip(self.instants(u), run, strict=True)]
        turns = [turn_of(one.unit) for one in self.signals]
        return [v - turns_beside(one.values, v, turn) if turn else v
                for one, v, turn in zip(self.signals, found, turns, strict=True)]  # fmt: skip

    def instants(self, u: Floats) -> list[Floats]:
        """Instants of the samples of each signal, s, on the clock of the run."""
        starts, shifts = {one.file: one.start for one in self.free}, self.shifts(u)
        return [one.t + shifts[file] - starts[file] if file in shifts else one.t
                for one, file in zip(self.signals, self.files, strict=True)]  # fmt: skip

    def _runs(self, points: Sequence[Floats]) -> list[list[Floats] | str]:
        """Signals of runs as of ``run_signals``, or why a run fails; runs that are new in parallel."""
        of_scenes = [not one.file for one in self.free]
        keys = [tuple(point[of_scenes].tolist()) for point in points]
        cases: dict[tuple[float, ...], list[Case]] = {}
        for key, point in zip(keys, points, strict=True):
            if key not in self._values and key not in cases:
                cases[key] = [self._case(one, point) for one in self.experiments]
        rows = iter(pool.run([case for each in cases.values() for case in each], self.workers, None, self.store))
        for key, each in cases.items():
            ended = [(case, next(rows)) for case in each]
            self.runs += len(each)
            failed = [f"{case.name}: {row.note}" for case, row in ended if not row.ok]
            self._values[key] = failed[0] if failed else [np.array(v) for _, row in ended for v in row["values"]]
        return [self._values[key] for key in keys]

    def _case(self, experiment: Experiment, u: Floats) -> Case:
        numbers = self.of_scenes(u)
        name = ", ".join(f"{key}={number:.10g}" for key, number in numbers.items())
        shifted = {one.file for one in self.free}
        pairs = zip(experiment.signals, experiment.files, strict=True)
        wanted = [(one.signal, () if file in shifted else tuple(one.t.tolist())) for one, file in pairs]
        bare = experiment._replace(signals=(), files=())
        return Case(experiment.scene.name, name, run_signals, (bare, numbers, wanted), experiment.scene.run.stop)

    def numbers(self, u: Floats) -> list[float]:
        """Numbers of the scene for variables (k,), within their ranges."""
        return [
            float(np.clip(one.start + one.size * v, one.low, one.high)) for one, v in zip(self.free, u, strict=True)
        ]

    def of_scenes(self, u: Floats) -> dict[str, float]:
        """Numbers of the scene by their keys."""
        return {one.key: number for one, number in zip(self.free, self.numbers(u), strict=True) if not one.file}

    def shifts(self, u: Floats) -> dict[str, float]:
        """Fitted shifts, s, by the file to whose times each is added."""
        return {one.file: number for one, number in zip(self.free, self.numbers(u), strict=True) if one.file}

    def with_found_shifts(self, u: Floats) -> tuple[Floats, list[str]]:
        """Variables (k,) with the shifts of the least difference from their run, and doubts; raises FitFailed."""
        found, doubts = u.copy(), []
        for k, one in ((k, one) for k, one in enumerate(self.free) if one.file):
            (run,) = self._runs([u])
            if isinstance(run, str):
                raise FitFailed(run)
            every = zip(run, self.signals, self.files, strict=True)
            own = [(*each, signal.shifted(-one.start)) for each, signal, file in every if file == one.file]
            shift, doubt = find_shift(own)
            found[k] = (shift - one.start) / one.size
            doubts += [doubt] * bool(doubt)
        return found, doubts

    def difference(self, u: Floats) -> list[Floats]:
        """Run minus measured by signal; raises FitFailed."""
        (values,) = self.values([u])
        if isinstance(values, str):
            raise FitFailed(values)
        return [run - one.values for run, one in zip(values, self.signals, strict=True)]

    def sums(self, points: Sequence[Floats], noise: Sequence[float]) -> list[float]:
        """Sum of squares at each of some variables, with a noise by signal; NaN where a run fails."""
        found = []
        for u, values in zip(points, self.values(points), strict=True):
            known = not isinstance(values, str)
            found.append(sum(float(np.sum((d / s) ** 2)) for d, s in zip(self.difference(u), noise, strict=True))
                         if known else math.nan)  # fmt: skip
        return found

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
        return [np.stack([column[i] for column in columns], axis=1) for i in range(len(middle))]

    def bounds(self) -> tuple[Floats, Floats]:
        """Least and largest variables."""
        low, high = zip(
            *(((one.low - one.start) / one.size, (one.high - one.start) / one.size) for one in self.free), strict=True
        )
        return np.array(low), np.array(high)


class Search(NamedTuple):
    """End of a search."""

    start: Floats  # (k,) variables
    u: Floats  # (k,) variables at the end
    noise: tuple[float, ...]  # by signal
    precision: tuple[float, ...]  # of record and search by signal, below which an estimated noise cannot be; 0: given
    cost: tuple[float, float]  # sum of squares at the start and at the end, with that noise
    jacobian: Floats  # (samples, k) over the noise
    steps: Floats  # (k,) of the differences
    rough: Floats  # (k,) change of each column with twice the step
    converged: bool


def search(task: Objective, scanned: int = 0) -> Search:
    """Search from the start, or from the best of it and ``scanned`` points.

    Raises FitFailed where a run fails from which it cannot turn back, BadInput for a scan without ranges.
    """
    signals = task.signals
    known = [one.signal in task.noise for one in signals]
    first = task.difference(np.zeros(len(task.free)))
    noise = [task.noise.get(one.signal) or _spread(one, d) for one, d in zip(signals, first, strict=True)]
    u = start = _best_start(task, scanned, noise)
    try:
        coarse = np.array([SMALL if one.file else COARSE for one in task.free])
        u, _ = _search_from(task, u, noise, coarse, 0.1 * COARSE)
        again, _ = task.with_found_shifts(u)
        u = u if task.sums([u], noise) <= task.sums([again], noise) else again
    except FitFailed as failure:
        PROGRESS.info(f"the first search, by differences over {100.0 * COARSE:g} % of a number, ends: {failure}")
    converged = False
    for _ in range(1 if all(known) else ROUNDS):
        steps, columns, _ = smooth_steps(task, u, noise)
        (u, converged), before = _search_from(task, u, noise, steps), noise
        precision = _precision(signals, columns, before, known)
        found_sizes = map(rms, task.difference(u))
        noise = [s if given else max(size, least) or s
                 for s, given, size, least in zip(before, known, found_sizes, precision, strict=True)]  # fmt: skip
        if all(abs(now / then - 1.0) < 0.01 for now, then in zip(noise, before, strict=True)):
            break
    alone = np.eye(len(u), dtype=bool)
    first_sum, last_sum, *without = task.sums([start, u, *np.where(alone, start, u)], noise)
    u = np.where(np.array(without) - last_sum < UNFELT, start, u)
    (last_sum,) = task.sums([u], noise)
    steps, columns, rough = smooth_steps(task, u, noise)
    return Search(start, u, tuple(noise), tuple(precision), (first_sum, last_sum), columns, steps, rough, converged)


def _search_from(
    task: Objective, u: Floats, noise: Sequence[float], steps: Floats, end: float = RESOLVED
) -> tuple[Floats, bool]:
    """End (k,) of a search from ``u`` (k,) with ``steps`` (k,), and whether its last move was below ``end``."""
    from scipy.optimize import least_squares

    sums: list[tuple[float, Floats]] = []
    columns = _columns(task, u, noise, steps)
    # A row each: scipy 1.17.1 moves variables whose column is 0 (findings/scipy_zero_column.sh).
    stays = np.where(np.linalg.norm(columns, axis=0) < SILENT, 1.0, 0.0)

    def residual(v: Floats) -> Floats:
        try:
            difference = task.difference(v)
        except FitFailed:  # a shorter step is tried
            return np.full(len(columns) + len(u), np.inf)
        r = np.concatenate([d / s for d, s in zip(difference, noise, strict=True)])
        PROGRESS.info(f"sum of squares {r @ r:.6g} at {', '.join(f'{x:.8g}' for x in task.numbers(v))}")
        sums.append((float(r @ r), v))
        last = [size for size, _ in sums[-STANDS:]]
        if len(last) == STANDS and max(last) - min(last) < min(STILL * min(last), UNFELT):
            raise _StandsStill
        return np.concatenate([r, stays * (v - u)])

    def jacobian(v: Floats) -> Floats:
        return np.concatenate([_columns(task, v, noise, steps) * (1.0 - stays), np.diag(stays)])

    # From 1: scipy's first step is as long as the variables, and 0 on a bound is its end (scipy_start_on_bound.sh).
    low, high = task.bounds()
    try:
        found = least_squares(
            lambda x: residual(x - 1.0), u + 1.0, lambda x: jacobian(x - 1.0), (low + 1.0, high + 1.0),
            ftol=1e-6, xtol=end, gtol=1e-10, max_nfev=MAX_STEPS,
        )  # fmt: skip
    except _StandsStill:
        return min(sums, key=lambda each: each[0])[1], True
    return found.x - 1.0, found.status > 0


def _best_start(task: Objective, scanned: int, noise: Sequence[float]) -> Floats:
    """Variables of the least sum of squares among the start and the points of a scan."""
    points = [np.zeros(len(task.free))]
    if scanned:
        from scipy.stats import qmc

        of_scenes, (low, high) = np.array([not one.file for one in task.free]), task.bounds()
        for one, a, b in zip(task.free, low, high, strict=True):
            if not (one.file or b - a < math.inf):
                raise BadInput(f"scan {scanned}: {one.key} has no range: free {one.key}=FROM:TO has one")
        low, high, drawn = low[of_scenes], high[of_scenes], np.zeros((scanned, len(of_scenes)))
        unit = qmc.LatinHypercube(len(low), seed=np.random.default_rng(0)).random(scanned)
        drawn[:, of_scenes] = qmc.scale(unit, low, high)
        points += [*drawn]
    sums = task.sums(points, noise)
    best = int(np.nanargmin(sums))
    if scanned:
        place = ", ".join(f"{x:.6g}" for x in task.numbers(points[best])) if best else "the start"
        failed = f"{int(np.isnan(sums).sum())} runs fail"
        PROGRESS.info(f"scan of {scanned} points: {failed}, the least sum of squares {sums[best]:.6g} is at {place}")
    return points[best]


def _columns(task: Objective, u: Floats, noise: Sequence[float], steps: Floats) -> Floats:
    """Derivatives over the noise (samples, k) by differences over ``steps`` (k,); raises FitFailed."""
    return np.concatenate([j / s for j, s in zip(task.jacobian(u, steps), noise, strict=True)])


def smooth_steps(task: Objective, u: Floats, noise: Sequence[float]) -> tuple[Floats, Floats, Floats]:
    """Steps (k,), derivatives over the noise (samples, k) by them, and their change (k,) with twice the step."""
    steps = np.full(len(u), STEPS[0])
    best, rough = _columns(task, u, noise, steps), np.full(len(u), np.inf)
    for step in STEPS:
        tried = np.where(rough > ROUGH, step, steps)
        once, twice = (_columns(task, u, noise, factor * tried) for factor in (1.0, 2.0))
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


def _precision(
    signals: Sequence[MeasuredSignal], columns: Floats, noise: Sequence[float], known: Sequence[bool]
) -> list[float]:
    """Least residual of each signal that says anything: rounding of its record, and what RESOLVED makes in it."""
    parts = np.split(columns, np.cumsum([len(one.t) for one in signals])[:-1])
    return [
        0.0 if given else max(one.rounding, RESOLVED * s * rms(np.linalg.norm(part, axis=1)))
        for one, part, s, given in zip(signals, parts, noise, known, strict=True)
    ]


def rms(values: Floats) -> float:
    """Root of the mean square."""
    return float(np.sqrt(np.mean(np.square(values))))


def _spread(one: MeasuredSignal, difference: Floats) -> float:
    """First weight of a signal whose noise is not known: its deviation, or the size of the difference."""
    return float(np.std(one.values)) or rms(difference) or 1.0
