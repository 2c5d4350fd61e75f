"""The baseline: is this tree the one that the baseline was made of, to rounding?

(a) Residuals, iteration matrices, wrenches and outputs of chains of every kind of link on thousands of states of all
    scenes and extreme cases (``gathering``), each group as one number a state (``projections``): equal to TOLERANCE.
(b) Whole runs, which may come apart as they do when one number is changed by its last bit, times a factor (``growth``).
(c) Errors of default runs against their truths, which must not be larger (``true_errors``).

``python -m orchestrator.studies.baseline COMMIT`` makes the file anew of the tree as it stands; with ``--add`` it
puts in the runs of (b) that the file lacks, and leaves the rest as it was.
"""

from __future__ import annotations

import argparse
import multiprocessing
import re
import sys
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from importlib.metadata import version
from pathlib import Path
from platform import python_version
from typing import Any

import numpy as np
from llvmlite import binding
from numpy.typing import NDArray

from fmus.physics.arrays import Floats
from fmus.vehicle import BadInput
from orchestrator.studies import Case, baseline_file, files, growth
from orchestrator.studies.baseline_file import FILE, Baseline, Grown
from orchestrator.studies.compared import checked, series, table
from orchestrator.studies.evaluations import KINDS
from orchestrator.studies.gathering import Gathered, Source, gather, sources
from orchestrator.studies.growth import RUNS, Pair, changed, grown, ratios, trajectory
from orchestrator.studies.progress import watched
from orchestrator.studies.projections import GROUPS, numbers, shown
from orchestrator.studies.tables import Row
from orchestrator.studies.true_errors import WINDOWS, Window, errors

__all__ = ["TITLE", "cases", "make", "table", "write"]


TITLE = "Baseline: this tree against the one that the baseline names"
TOLERANCE = 1e-11  # (a), relative to the size of a group
FACTOR = 30.0  # (b), over the growth of one ulp; a tree compiled with other roundings comes to 3
MORE = 0.02  # (c), of the error that was; two windows hardly ever err alike to more
LEAST = 1e-9  # (c), errors below are rounding
BRIEF = 4  # states of a run in the quick form
STATES = 5000  # in all, at least


def cases(quick: bool, file: Path | None = None) -> list[Case]:
    """All kinds of links, the runs, and, unless it is to be quick, the errors. Raises BadInput without a baseline."""
    file = file or baseline_file.FILE
    commit = baseline_file.load(file).made["commit"]
    known = (str(file), commit, file.stat().st_mtime_ns, quick)
    windows = () if quick else WINDOWS
    return [
        *(Case("a", kind, one_kind, (kind, *known), 20.0) for kind in KINDS),
        *(Case("b", pair.name, one_run, (k, *known), 10.0) for k, pair in enumerate(RUNS)),
        *(Case("c", w.name, one_error, (k, *known), w.seconds) for k, w in enumerate(windows)),
    ]


# --- comparing -------------------------------------------------------------------------------------


def one_kind(kind: str, file: str, commit: str, made: int, quick: bool) -> list[Row]:
    """(a) of a kind of link."""
    known = baseline_file.load(Path(file))
    apart, places = deviations(kind, known, BRIEF if quick else None)
    rows = []
    for group, column in zip(GROUPS[kind], apart.T, strict=True):
        worst = int(np.argmax(column))
        name, k = places[worst]
        note = f"{len(places)} states of {commit[:9]}; farthest in '{name}', state {k}"
        rows.append(checked("", f"{kind}: {group}, relative", column[worst], 0.0, TOLERANCE, column[worst], note=note))
    return rows


def deviations(
    kind: str, known: Baseline, brief: int | None = None, every: int = 1
) -> tuple[Floats, list[tuple[str, int]]]:
    """How far the numbers of this tree are from the known ones, over their sizes (S, groups), and where each row is.

    ``brief``: so many states of a run; ``every``: one run in so many. A number that is none any more is infinitely far.
    """
    found, places = [], []
    runs = list(enumerate(zip(known.runs, known.numbers[kind], known.most[kind], strict=True)))
    for i, (run, before, most) in runs[::every]:
        chosen = _chosen(len(before), i, brief)
        now, sizes = numbers(kind, run, run.completed(), chosen, most)
        apart = abs(now - before[chosen]) / sizes
        touches_nothing = np.isnan(before[chosen])
        found.append(np.where(touches_nothing, 0.0, np.where(np.isnan(apart), np.inf, apart)))
        places += [(run.name, int(k)) for k in chosen]
    return np.concatenate(found), places


def _chosen(count: int, run: int, brief: int | None) -> NDArray[np.int64]:
    """Numbers of states: all, or some all over the run that differ from run to run."""
    if brief is None or brief >= count:
        return np.arange(count)
    return np.unique((np.linspace(0, count, brief, endpoint=False).astype(int) + 5 * run) % count)


def one_run(k: int, file: str, commit: str, made: int, quick: bool) -> list[Row]:
    """(b) of a run."""
    pair = RUNS[k]
    known = {one.name: one for one in baseline_file.load(Path(file)).grown}[pair.name]
    stop = pair.brief if quick else pair.stop
    _, values = trajectory(pair, stop)
    found = ratios(known, values)
    rows = []
    for name, column, apart in zip(known.signals, found.T, abs(values - known.values[: len(values)]).T, strict=True):
        worst = int(np.argmax(np.where(np.isfinite(column), column, np.inf)))
        note = f"to {stop:g} s; farthest at {known.t[worst]:.3g} s, by {apart[worst]:.2g}"
        case = f"{pair.name}: {name}, over the growth of one ulp"
        of_time = tuple((float(t), float(ratio)) for t, ratio in zip(known.t[1:], column[1:], strict=False))
        rows.append(checked("", case, column[worst], 0.0, FACTOR, column[worst], note, over="time, s", series=of_time))
    return rows


def one_error(k: int, file: str, commit: str, made: int, quick: bool) -> list[Row]:
    """(c) of a window."""
    window = WINDOWS[k]
    before, rows = baseline_file.load(Path(file)).errors[window.name], []
    for name, now in errors(window).items():
        was = before[name]
        allowed = MORE + (LEAST + was["doubt"] + now["doubt"]) / max(was["error"], LEAST)
        more = now["error"] / max(was["error"], LEAST) - 1.0
        rows.append(checked("", f"{window.name}: {name}, relative error", now["error"], was["error"], allowed, more))
    return rows


# --- making ----------------------------------------------------------------------------------------

Task = tuple[str, Callable[..., Any], tuple[Any, ...]]  # in words, function, arguments


def make(
    commit: str,
    file: Path = FILE,
    workers: int = 2,
    wanted: Sequence[Source] | None = None,
    pairs: Sequence[Pair] = RUNS,
    windows: Sequence[Window] = WINDOWS,
) -> Baseline:
    """Make the baseline of this tree; with shorter lists, a part. Raises BadInput, OSError, or what a run raises."""
    _check(commit)
    ways = _ways(pairs)
    tasks: list[Task] = [(window.name, errors, (window,)) for window in windows]
    tasks += ways
    tasks += [(source.name, gather, (source,)) for source in (sources() if wanted is None else wanted)]
    done = _all("runs", tasks, workers)
    of_windows, of_ways = done[: len(windows)], done[len(windows) :][: len(ways)]
    gathered = [one for one in done if isinstance(one, Gathered)]
    states = sum(len(run.kept.stretch) for run in gathered)
    if wanted is None and states < STATES:
        raise BadInput(f"the runs have {states} states in all: {STATES} are needed")
    refused = [one for one in done if isinstance(one, str)]
    tasks = [(f"{kind}, {run.name}", _numbers, (kind, run)) for kind in KINDS for run in gathered]
    done = _all("states", tasks, workers)
    n = len(gathered)
    of_kinds = {kind: done[k * n : (k + 1) * n] for k, kind in enumerate(KINDS)}
    baseline = Baseline(
        {
            "commit": commit,
            "python": python_version(),
            **{package: version(package) for package in ("numpy", "scipy", "numba", "llvmlite")},
            "processor": binding.get_host_cpu_name(),
            "without states": "; ".join(refused),
        },
        gathered,
        {kind: [values for values, _ in found] for kind, found in of_kinds.items()},
        {kind: [most for _, most in found] for kind, found in of_kinds.items()},
        _grown(pairs, of_ways),
        {window.name: found for window, found in zip(windows, of_windows, strict=True)},
    )
    baseline_file.save(file, baseline)
    return baseline


def add(commit: str, file: Path = FILE, workers: int = 2, pairs: Sequence[Pair] = RUNS) -> Baseline:
    """Put the runs of (b) that the file lacks into it. Raises BadInput, OSError, or what a run raises."""
    _check(commit)
    known = baseline_file.load(file)
    lacking = [pair for pair in pairs if pair.name not in {one.name for one in known.grown}]
    more = _grown(lacking, _all("runs", _ways(lacking), workers))
    made = {**known.made, **{one.name: commit for one in more}}
    baseline = known._replace(made=made, grown=[*known.grown, *more])
    baseline_file.save(file, baseline)
    return baseline


def _check(commit: str) -> None:
    if not re.fullmatch("[0-9a-f]{7,40}", commit):
        raise BadInput(f"COMMIT = {commit}: must be the hash of the commit that this tree is, 7 to 40 of 0-9, a-f")


def _ways(pairs: Sequence[Pair]) -> list[Task]:
    """Each run as it is, and with each number changed by an ulp."""
    ways = [(pair, way) for pair in pairs for way in ((), *(changed(pair, key) for key in growth.CHANGED))]
    return [(f"{pair.name} {' '.join(way)}", _signals, (pair, way)) for pair, way in ways]


def _grown(pairs: Sequence[Pair], done: Sequence[Floats]) -> list[Grown]:
    """What came of ``_ways``."""
    m = 1 + len(growth.CHANGED)
    return [grown(pair, done[m * k : m * (k + 1)]) for k, pair in enumerate(pairs)]


def _signals(pair: Pair, settings: Sequence[str]) -> Floats:
    return trajectory(pair, pair.stop, settings)[1]


def _numbers(kind: str, run: Gathered) -> tuple[Floats, Floats]:
    """Numbers of all states of a run, and what its outputs are relative to."""
    states = run.completed()
    most = shown(kind, run, states)
    values, _ = numbers(kind, run, states, np.arange(len(states.step)), most)
    return values, most


def _all(title: str, tasks: Sequence[Task], workers: int) -> list[Any]:
    """Results of the tasks in their order; one worker is this process. Raises what a task raises."""
    if workers == 1:
        return [function(*arguments) for _, function, arguments in tasks]
    spawn = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(workers, mp_context=spawn) as pool, watched(title, len(tasks)) as done:
        waiting = {pool.submit(function, *arguments): name for name, function, arguments in tasks}
        try:
            for future in as_completed(waiting):
                future.result()
                done(Case("", waiting[future], future.result))
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            raise
        return [future.result() for future in waiting]


# --- tables ----------------------------------------------------------------------------------------


def draw(rows: Sequence[Row], title: str) -> files.Picture:
    """Differences of states by group, and how far runs come apart over the growth of one ulp."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(14.0, 7.0), layout="constrained")
    bars, lines = figure.subplots(1, 2)
    of_states = [row for row in rows if row.item == "a" and np.isfinite(row["value"])]
    smallest = 1e-17
    bars.barh([row.case for row in of_states], [max(row["value"], smallest) for row in of_states], left=0.0)
    bars.axvline(TOLERANCE, color="tab:red", linewidth=1)
    bars.set_xscale("log")
    bars.set_xlim(smallest, None)
    bars.tick_params(axis="y", labelsize=6)
    bars.set_xlabel("largest difference over the size of the group")
    for row in rows:
        points = [(t, ratio) for t, ratio in series(row) if ratio > 0.0]
        if points:
            lines.plot(*zip(*points, strict=True), linewidth=0.7)
    lines.axhline(FACTOR, color="tab:red", linewidth=1)
    lines.set_yscale("log")
    if not lines.lines[1:]:
        lines.set_ylim(0.01, 10.0 * FACTOR)
        lines.set_title("equal to the last bit, or no runs")
    lines.set_xlabel("time, s")
    lines.set_ylabel("difference of runs over the growth of one ulp")
    figure.suptitle(title, fontsize=11)
    return figure


def write(folder: Path, name: str, rows: Sequence[Row], title: str) -> list[Path]:
    """Table and picture; raises OSError when the folder cannot be written."""
    return files.save(folder, name, table(rows, title), draw(rows, title))


def _main() -> None:
    parser = argparse.ArgumentParser(prog="python -m orchestrator.studies.baseline", description=make.__doc__)
    parser.add_argument("commit", metavar="COMMIT", help="hash of the commit that this tree is")
    parser.add_argument("-o", "--output", type=Path, default=FILE, metavar="FILE", help=f"default {FILE.name} here")
    parser.add_argument("--workers", type=int, default=2, metavar="N", help="processes; default 2")
    parser.add_argument("--add", action="store_true", help="put in the runs that FILE lacks, leave the rest as it is")
    chosen = parser.parse_args()
    try:
        made = (add if chosen.add else make)(chosen.commit, chosen.output, chosen.workers)
    except (BadInput, OSError, RuntimeError) as error:
        sys.exit(f"cotrack: {error}")
    size = chosen.output.stat().st_size / 1e6
    sys.stderr.write(f"{chosen.output}: {made.states} states of {len(made.runs)} runs, {size:.2f} MB\n")


if __name__ == "__main__":
    _main()
