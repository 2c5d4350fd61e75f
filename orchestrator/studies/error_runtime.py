"""Error against run time: settings of a scene, compared with the truth of its track model.

A case times one run of the scene, compares it with the truth (``truth``) in the norm of ``difference``, and stores
the run's own error estimate, whose coarser companions are often other points of the study and run once. Run time is
that of the steps, without start-up and estimate. Its files are a table with the Pareto front, a picture and sentences.
"""

from __future__ import annotations

import json
import math
import tempfile
from collections.abc import Iterable, Mapping, Sequence
from functools import cache
from operator import itemgetter
from pathlib import Path
from typing import Any, NamedTuple

from fmus.cache.files import reporting_errors
from fmus.fmi.build import BuildFailed
from fmus.track.choices import TRACKS
from orchestrator.cosim.coupling.scheme import CouplingFailed
from orchestrator.execution import precision
from orchestrator.execution.estimate import estimate
from orchestrator.execution.simulate import simulate
from orchestrator.execution.truth import ORDER, require_known, truth
from orchestrator.fmi.slave import ComponentFailed
from orchestrator.log.log_file import LogFailed
from orchestrator.results import output_files
from orchestrator.results.difference import INTERVAL, differences_of_logs, worst
from orchestrator.results.table import Column, Table
from orchestrator.scene.kinds import ChainScene, Scene
from orchestrator.scene.scene import load
from orchestrator.studies import Case, Row

__all__ = ["TITLE", "WORKERS", "cases", "table", "write"]
TITLE = "Error against run time"
WORKERS = 1  # timed runs need the machine for themselves
QUICK = {
    "chain": "run.stop=0.5 s",
    "vehicle": "run.stop=2.5 s",
    "rig": "run.stop=3 s",
    "bench": "run.stop=2 s",
}


class MethodCurve(NamedTuple):
    """Curve of the study: common settings, and points with a label and settings of their own."""

    name: str
    settings: tuple[str, ...]
    points: tuple[tuple[str, tuple[str, ...]], ...]


def fixed(name: str, settings: tuple[str, ...], steps: tuple[tuple[float, float], ...]) -> MethodCurve:
    """Curve over (communication, internal) steps in ms; 0: stable step."""
    points = tuple(
        (f"H = {step:g} ms, h = {internal:g} ms", (f"run.step={step} ms", f"track.step={internal} ms"))
        if internal
        else (f"H = {step:g} ms, h = the stable one", (f"run.step={step} ms",))
        for step, internal in steps
    )
    return MethodCurve(name, settings, points)


def variable(name: str, settings: tuple[str, ...], tolerances: tuple[float, ...]) -> MethodCurve:
    """Curve over tolerances of variable communication steps, for scenes that have them."""
    points = tuple((f"tolerance {tolerance:g}", (f"run.variable.tolerance={tolerance}",)) for tolerance in tolerances)
    return MethodCurve(name, settings, points)


def equal(*steps: float) -> tuple[tuple[float, float], ...]:
    """Pairs of equal communication and internal steps, ms."""
    return tuple((h, h) for h in steps)


SINGLE_COMPONENT = (  # a component on its own
    fixed("implicit", (), equal(10, 4, 2, 1, 0.5, 0.25, 0.125, 0.0625)),
    fixed("Runge-Kutta", ("track.integrator=runge_kutta",), ((1, 0.008),)),
)
JOINT_COORDINATES = ("track.formulation=recursive",)
SMOOTH_STEP = ("run.step=10 ms", "track.step=10 ms")
RIGID_ALONE = (  # rigid links besides
    fixed("joint coordinates, Runge-Kutta", (*JOINT_COORDINATES, "track.integrator=runge_kutta"), equal(10, 5, 2, 1)),
    MethodCurve(
        "joint coordinates, Dormand-Prince",
        (*JOINT_COORDINATES, *SMOOTH_STEP, "track.integrator=dormand_prince"),
        tuple(
            (f"tolerance {each:g}", (f"track.rtol={each}", f"track.atol={each}")) for each in (1e-4, 1e-6, 1e-8, 1e-10)
        ),
    ),
)
COUPLED = (
    fixed("tracks first", (), equal(4, 2, 1, 0.5, 0.25, 0.125)),
    fixed("tracks first, H = 2 h", (), ((4, 2), (2, 1), (1.25, 0.625), (1, 0.5), (0.5, 0.25))),
    fixed("tracks first, H = 4 h", (), ((4, 1), (2, 0.5), (1, 0.25))),
    fixed("Gauss-Seidel", ("run.coupling=gauss_seidel",), equal(1, 0.5, 0.25)),
    fixed("Gauss-Seidel, H = 2 h", ("run.coupling=gauss_seidel",), ((4, 2), (2, 1), (1, 0.5), (0.5, 0.25))),
    fixed("Gauss-Seidel, H = 4 h", ("run.coupling=gauss_seidel",), ((4, 1), (2, 0.5), (1, 0.25))),
    fixed("Jacobi", ("run.coupling=jacobi",), equal(1, 0.5, 0.25)),
    fixed("iterative", ("run.coupling=iterative",), equal(2, 1, 0.5)),
    fixed("Runge-Kutta", ("track.integrator=runge_kutta",), ((0.25, 0),)),
)


PACED: Sequence[MethodCurve] = (  # for scenes with a variable step
    *(method._replace(settings=("run.variable=false",)) for method in COUPLED[:3]),
    variable("power residual", ("run.variable.estimate=power",), (1e-3, 1e-4, 3e-5, 1e-5, 3e-6)),
    variable(
        "step doubling",
        # Replaces the whole table: ``energy`` of a scene is no option of doubling; each point sets its tolerance.
        ("run.variable={estimate='doubling', tolerance=1, longest='7 ms'}",),
        (3e-3, 1e-3, 3e-4),
    ),
)


def cases(quick: bool, scene: str = "straight") -> list[Case]:
    """Cases: the truth of each track model, then all methods."""
    loaded = load(scene)
    require_known(loaded)
    base = (QUICK[loaded.assembly],) if quick else ()
    if isinstance(loaded, ChainScene) and loaded.chain.ends == "pinned" and loaded.track.start in (None, "rest"):
        base = (*base, "track.start=displaced")  # a scene at rest has no error
    curves: Sequence[MethodCurve] = SINGLE_COMPONENT if isinstance(loaded, ChainScene) else COUPLED
    if loaded.run.variable is not None:
        curves = PACED
    all_cases = []
    for model in [*TRACKS][: 1 if quick else None]:
        all_cases.append(Case(scene, f"truth, {model}", truth_error, (scene, model, base), 600.0, 7200.0))
        more = RIGID_ALONE if curves is SINGLE_COMPONENT and model == "rigid" else ()
        for curve in (*curves, *more):
            if quick and "Runge" in curve.name and loaded.assembly != "chain":
                continue
            for label, point_settings in curve.points[: 4 if quick else None]:
                arguments = (scene, model, curve.name, (*base, *curve.settings, *point_settings), base)
                all_cases.append(Case(scene, f"{model}, {curve.name}, {label}", point, arguments, 30.0))
    return all_cases


def truth_error(scene: str, track: str, base: tuple[str, ...]) -> list[Row]:
    """Difference of the truth from its coarser run."""
    converged = truth(load(scene, track, base))
    share = 1.0 / (2.0**ORDER - 1.0)
    figures = {
        "track": track,
        "method": "truth",
        "settings": base,
        "wall_time": converged.wall_time,  # s; the truth has an error estimate of its own
        "error": share * worst(converged.difference),
        "errors": {name: share * difference.relative for name, difference in converged.difference.items()},
        "absolute": {name: share * difference.absolute for name, difference in converged.difference.items()},
    }
    return [Row("", "", figures, note=f"internal step {converged.internal_step * 1e6:.3g} us")]


def point(scene: str, track: str, method: str, settings: tuple[str, ...], base: tuple[str, ...]) -> list[Row]:
    """Timed run, compared with the truth, with its own error estimate."""
    exact = truth(load(scene, track, base))
    timed = sampled(load(scene, track, settings))
    summary = record(timed)
    curve = {"track": track, "method": method, "settings": settings}  # curve, and settings of the run
    if summary["status"] != "ok":
        return [Row("", "", curve, note=summary["message"])]  # a long step may fail: that is a result
    log = Path(summary["log"])
    differences = differences_of_logs(log, exact.log)
    estimated = estimate(timed, log, summary, lambda scene, _: record(scene))
    figures = {
        "wall_time": summary["wall_time"],  # s
        "cpu_time": summary["cpu_time"],  # s, all threads
        "error": worst(differences),  # largest relative error of the decisive observables
        "estimate": math.nan if estimated["total"] is None else estimated["total"],  # the run's own estimate
        "errors": {name: observable.relative for name, observable in differences.items()},
        "estimates": {name: observable["total"] for name, observable in estimated["observables"].items()},
        "absolute": {name: observable.absolute for name, observable in differences.items()},
    }
    return [Row("", "", curve | figures, note=estimated["message"])]


def sampled(scene: Scene) -> Scene:
    """The scene with all outputs recorded, those of links every INTERVAL s (variable steps: unchanged)."""
    every = max(1, round(INTERVAL / scene.run.step)) if scene.run.variable is None else scene.links_every
    return scene.model_copy(update={"run": scene.run.model_copy(update={"outputs": 1, "links": every})})


@cache
def _folder() -> tempfile.TemporaryDirectory[str]:
    """Folder of the logs of this process, deleted with it."""
    return tempfile.TemporaryDirectory(prefix="cotrack-runs-")


_summaries: dict[str, Mapping[str, Any]] = {}  # summaries by scene


def record(scene: Scene) -> Mapping[str, Any]:
    """Summary of a run, done once in this process; raises KeyboardInterrupt."""
    key = json.dumps(scene.resolved(), sort_keys=True)
    if key not in _summaries:
        try:
            _summaries[key] = simulate(scene, Path(_folder().name) / f"{len(_summaries)}.mcap", raise_faults=True)
        except (BuildFailed, ComponentFailed, CouplingFailed, LogFailed) as failure:
            _summaries[key] = {"status": "failed", "message": str(failure), "wall_time": 0.0}
    return _summaries[key]


LEVELS = (1e-2, 1e-3, 1e-4)
FACTOR = 3.0  # an estimate within this factor of the true error is right
MARKERS = "os^vDP*Xp"  # by track model, in pictures
NAMED = 0.75  # ratio of errors from one named point of a picture to the next


def runs(rows: Iterable[Row]) -> list[Row]:
    """Rows of runs that ended well."""
    return [row for row in rows if row["method"] != "truth" and math.isfinite(row["error"])]


def pareto_front(rows: Iterable[Row]) -> list[Row]:
    """Pareto front in run time and error of the runs that ended well."""
    return precision.pareto_front(runs(rows), itemgetter("wall_time"), itemgetter("error"))


def cheapest(rows: Iterable[Row], level: float) -> Row | None:
    """Fastest run whose largest decisive error is below a level."""
    return min((row for row in runs(rows) if row["error"] <= level), key=itemgetter("wall_time"), default=None)


def ratios(rows: Iterable[Row]) -> list[float]:
    """Estimated over true error, of every observable of every run."""
    return [
        row["estimates"][name] / error
        for row in runs(rows)
        for name, error in row["errors"].items()
        if error > 0.0 and row["estimates"].get(name)
    ]


def sentences(rows: Sequence[Row]) -> list[str]:
    """Conclusions as sentences."""
    texts = []
    for scene, track in dict.fromkeys((row.item, row["track"]) for row in runs(rows)):
        scene_rows = [row for row in rows if (row.item, row["track"]) == (scene, track)]
        for level in LEVELS:
            row = cheapest(scene_rows, level)
            if row is None:
                best = min(runs(scene_rows), key=itemgetter("error"))
                texts.append(
                    f"{scene}, {track}: no setting reaches {level:.2%}; the best, "
                    f"{best['error']:.2%} in {best['wall_time']:.3g} s, is {best.case}"
                )
            else:
                texts.append(
                    f"{scene}, {track}: {level:.2%} costs {row['wall_time']:.3g} s"
                    f" (error {row['error']:.2g}): {row.case}"
                )
    run_ratios = [row["estimate"] / row["error"] for row in runs(rows) if row["error"] > 0.0 and row["estimate"] > 0.0]
    for scope, values in (("of whole runs", run_ratios), ("by observable", ratios(rows))):
        if values:
            right = sum(1.0 / FACTOR <= ratio <= FACTOR for ratio in values)
            texts.append(
                f"own estimates {scope} within a factor of {FACTOR:g} of the true error: {right} of {len(values)}"
                f" ({right / len(values):.0%}); median ratio {sorted(values)[len(values) // 2]:.2f}"
            )
    return texts


# --- tables and picture ----------------------------------------------------------------------------


def _observables(rows: Iterable[Row]) -> list[str]:
    return list(dict.fromkeys(name for row in rows for name in row.figures.get("errors", {})))


def table(rows: Sequence[Row], title: str = "") -> Table:
    """Table of relative errors by observable, with * on the Pareto front, and conclusions."""
    best = {id(row) for key in {(r.item, r["track"]) for r in rows} for row in
             pareto_front(r for r in rows if (r.item, r["track"]) == key)}  # fmt: skip
    columns = (
        Column("item", "scene"),
        Column("case", "case"),
        Column("wall_time", "run time, s", ".3g"),
        Column("cpu_time", "CPU, s", ".3g"),
        Column("error", "error", ".2e"),
        Column("estimate", "own estimate", ".2e"),
        *(Column(f"{name} (relative)", name, ".1e") for name in _observables(rows)),
        Column("note", "note"),
    )
    cells = [{**_figures(row), "case": row.case + (" *" if id(row) in best else "")} for row in rows]
    return Table.of_records(title, columns, cells, tuple(f"- {sentence}" for sentence in sentences(rows)))


def whole_table(rows: Sequence[Row]) -> Table:
    """Table with errors and estimates of each observable in its own columns."""
    names = [f"{name} ({kind})" for name in _observables(rows) for kind in ("relative", "absolute", "estimate")]
    columns = (
        Column("item", "scene"),
        *(Column(key, key) for key in ("case", "track", "method", "settings")),
        Column("wall_time", "wall time, s"),
        Column("cpu_time", "CPU time, s"),
        *(Column(key, key) for key in ("error", "estimate", *names, "note")),
    )
    return Table.of_records("", columns, [_figures(row) for row in rows])


def _figures(row: Row) -> dict[str, Any]:
    """Cells of a row for both tables."""
    kinds = (("relative", "errors"), ("absolute", "absolute"), ("estimate", "estimates"))
    by_observable = {
        f"{name} ({kind})": figure for kind, key in kinds for name, figure in row.figures.get(key, {}).items()
    }
    return {**row.cells(), "settings": " ".join(f"'{s}'" for s in row.figures.get("settings", ())), **by_observable}


def write(folder: Path, name: str, rows: Sequence[Row], title: str) -> list[Path]:
    """Write tables, picture, and the settings for ``cotrack run SCENE --error``."""
    scenes = "-".join(dict.fromkeys(row.item for row in rows))
    stem = f"{name}-{scenes}"
    title = f"{title}: {scenes}"
    more = {f"{stem}.csv": whole_table(rows).csv()}
    settings = [
        precision.Setting(row.item, row["track"], method_settings(row), row["error"], row["wall_time"])
        for row in runs(rows)
    ]
    written = output_files.save_results(folder, stem, table(rows, title), draw(settings, title), more)
    written.append(folder / "precision.json")
    precision.write(settings, written[-1])
    if not any(setting.startswith("run.stop") for row in runs(rows) for setting in row["settings"]):
        with reporting_errors():
            precision.write(settings, precision.local_file())  # only results of whole scenes
            written.append(precision.local_file())
    return written


def method_settings(row: Row) -> tuple[str, ...]:
    """Settings of a row that say how the scene is run, without those of the scene itself."""
    return tuple(s for s in row["settings"] if not s.startswith(("run.stop", "track.start", "chain.")))


def label(settings: Sequence[str]) -> str:
    """Short name of a setting for a picture: its steps H and h, its tolerance, its coupling or integrator."""
    values = {key: value for key, _, value in (setting.partition("=") for setting in settings)}
    names = [values[key].replace("_", "-") for key in ("run.coupling", "track.integrator") if key in values]
    if "run.variable.tolerance" in values:
        steps = [f"tolerance {values['run.variable.tolerance']}"]
    elif "track.rtol" in values:
        steps = [f"tolerance {values['track.rtol']}"]
    else:
        pair = [values[key].removesuffix(" ms") for key in ("run.step", "track.step") if key in values]
        steps = [f"{', '.join(dict.fromkeys(pair))} ms"] if pair else []
    return " ".join([*steps, *names])


def draw(settings: Sequence[precision.Setting], title: str) -> output_files.Picture:
    """Draw error over run time in one pane: all settings, and the Pareto front of each track model with its steps.

    A front names a point where the error has fallen to ``NAMED`` of that of the last named one.
    """
    figure = output_files.new_figure(8.0, 5.6)
    pane = figure.subplots()
    for k, track in enumerate(dict.fromkeys(setting.track for setting in settings)):
        own = [setting for setting in settings if setting.track == track]
        front = precision.pareto_front(own)
        style: dict[str, Any] = {"color": f"C{k}"}
        pane.loglog(*_places(own), linestyle="none", marker=".", markersize=4, alpha=0.4, **style)
        marker = MARKERS[k % len(MARKERS)]
        pane.loglog(*_places(front), marker=marker, markersize=5, label=f"{track} links", **style)
        last = math.inf
        style |= {"ha": "left", "xytext": (6, 4)} if k else {"ha": "right", "xytext": (-6, -8)}
        for point in front:
            if point.error <= NAMED * last:
                last, place = point.error, (point.wall_time, point.error)
                pane.annotate(label(point.settings), place, textcoords="offset points", fontsize=8, **style)
    pane.margins(0.12)
    pane.set_title(title, fontsize=10, loc="left")
    if settings:
        pane.legend(fontsize=9, title="beside the points:\ncommunication step, internal step", title_fontsize=8)
    _draw_axes(pane)
    return figure


def _places(settings: Sequence[precision.Setting]) -> tuple[list[float], list[float]]:
    return [setting.wall_time for setting in settings], [setting.error for setting in settings]


def _draw_axes(pane: Any) -> None:
    from matplotlib.ticker import LogLocator, NullFormatter

    pane.set_xlabel("run time, s", fontsize=8)
    pane.set_ylabel("largest relative error of the decisive observables", fontsize=8)
    low, high = pane.get_xlim()
    if high < 100.0 * low:  # decades alone would give one or two labels
        pane.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        pane.xaxis.set_major_formatter("{x:g}")
    pane.xaxis.set_minor_formatter(NullFormatter())
    pane.yaxis.set_minor_formatter(NullFormatter())
    pane.grid(True, which="both", color="0.93")
