"""Work and precision of timed runs: Pareto front, table, picture and sentences."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from itertools import cycle, product
from operator import itemgetter
from pathlib import Path
from typing import Any, NamedTuple

from fmus.cache import reporting_errors
from orchestrator.execution import precision
from orchestrator.results.table import Column, Table
from orchestrator.studies import files
from orchestrator.studies.row import Row

LEVELS = (1e-2, 1e-3, 1e-4)
FACTOR = 3.0  # an estimate within this factor of the true error is right
MARKERS = "os^vDP*Xp"  # by method, in pictures


def runs(rows: Iterable[Row]) -> list[Row]:
    """Rows of runs that ended well."""
    return [row for row in rows if row["method"] != "truth" and math.isfinite(row["error"])]


def pareto_front(rows: Iterable[Row], error: Callable[[Row], float] = itemgetter("error")) -> list[Row]:
    """Pareto front in run time and error of the runs that ended well."""
    return precision.pareto_front(runs(rows), itemgetter("wall_time"), error)


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
    written = files.save(folder, stem, table(rows, title), draw(rows, title), more)
    settings = [
        precision.Setting(row.item, row["track"], method_settings(row), row["error"], row["wall_time"])
        for row in runs(rows)
    ]
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


def draw(rows: Sequence[Row], title: str) -> files.Picture:
    """Draw one pane for the whole error and one per observable; a curve per method, Pareto front shaded."""
    good = runs(rows)
    names = ["", *_observables(good)]
    across = min(3, len(names))
    down = -(-len(names) // across)
    figure = files.new_figure(5.2 * across, 4.2 * down + 1.4)
    axes = figure.subplots(down, across, squeeze=False).ravel()
    curves = _curve_styles(good)
    for pane, name in zip(axes, names, strict=False):
        _draw_pane(pane, rows, good, name, curves)
    for pane in axes[len(names) :]:
        pane.set_axis_off()
    _draw_legend(figure, curves)
    figure.suptitle(f"{title} (rings: Pareto front of a track model)", fontsize=12)
    return figure


class _CurveStyles(NamedTuple):
    """How the curves of a picture are drawn."""

    methods: dict[str, dict[str, Any]]  # colour and marker
    tracks: dict[str, Any]  # line style


def _curve_styles(good: Sequence[Row]) -> _CurveStyles:
    from matplotlib import colormaps

    methods = dict.fromkeys(row["method"] for row in good)
    tracks = dict.fromkeys(row["track"] for row in good)
    styles = {
        method: {"color": colormaps["tab10"](k % 10), "marker": MARKERS[k % len(MARKERS)]}
        for k, method in enumerate(methods)
    }
    return _CurveStyles(styles, dict(zip(tracks, cycle(("-", "--", ":", "-.")), strict=False)))


def _draw_pane(pane: Any, rows: Sequence[Row], good: Sequence[Row], name: str, curves: _CurveStyles) -> None:
    """Draw the curves and Pareto fronts of an observable; ``name`` is empty for the whole error."""

    def error(row: Row) -> float:
        return row["errors"].get(name, math.nan) if name else row["error"]

    for track, method in product(curves.tracks, curves.methods):
        points = [(row["wall_time"], error(row)) for row in good if (row["track"], row["method"]) == (track, method)]
        if points:
            style = {"markersize": 4, "linewidth": 1, "linestyle": curves.tracks[track], **curves.methods[method]}
            pane.loglog(*zip(*points, strict=True), **style)
    for track in curves.tracks:
        best = pareto_front((row for row in good if row["track"] == track), error)
        pane.loglog(
            [row["wall_time"] for row in best], [error(row) for row in best], linestyle="none", marker="o",
            markersize=10, markerfacecolor="none", markeredgecolor="0.3",
        )  # fmt: skip
    truth_errors = [error(row) for row in rows if row["method"] == "truth"]
    if truth_errors and max(truth_errors) > 0.0:
        corner = {"ha": "right", "va": "top", "transform": pane.transAxes, "fontsize": 7}
        pane.text(0.98, 0.97, f"truth: {max(truth_errors):.0e}", **corner)
    pane.set_title(name.replace("_", " ") or "largest of the decisive ones", fontsize=9, loc="left")
    _draw_axes(pane)


def _draw_axes(pane: Any) -> None:
    from matplotlib.ticker import LogLocator, NullFormatter

    pane.set_xlabel("run time, s", fontsize=8)
    pane.set_ylabel("relative error", fontsize=8)
    low, high = pane.get_xlim()
    if high < 100.0 * low:  # decades alone would give one or two labels
        pane.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        pane.xaxis.set_major_formatter("{x:g}")
    pane.xaxis.set_minor_formatter(NullFormatter())
    pane.yaxis.set_minor_formatter(NullFormatter())
    pane.grid(True, which="both", color="0.93")


def _draw_legend(figure: Any, curves: _CurveStyles) -> None:
    from matplotlib.lines import Line2D

    keys = [
        *(Line2D([], [], label=method, **style) for method, style in curves.methods.items()),
        *(Line2D([], [], color="0.3", linestyle=line, label=f"{track} links") for track, line in curves.tracks.items()),
    ]
    figure.legend(handles=keys, loc="outside lower center", ncols=min(4, len(keys)), fontsize=10)
