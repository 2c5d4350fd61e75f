"""Error against run time: ways to run a scene, each held against the truth of its track model.

A case times one run of the scene on its own, compares it with the truth (``truth``) in the norm of ``difference``, and
asks the run for its own estimate, whose coarser companions are often other points of the study and not run again. Run
time is that of the steps, without start-up and without the estimate.
"""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Iterable, Iterator, Sequence
from functools import cache
from itertools import product
from pathlib import Path
from typing import Any, NamedTuple

from fmus.vehicle import BadInput
from orchestrator import precision
from orchestrator.difference import worst
from orchestrator.scene import ChainScene, Scene, TrackScene, load
from orchestrator.studies import Case
from orchestrator.studies.files import save
from orchestrator.studies.runs import Runs

TITLE = "Error against run time"
WORKERS = 1  # a timed run has the machine to itself
LEVELS = (1e-2, 1e-3, 1e-4)
FACTOR = 3.0  # an estimate within it of the true error is right
MODELS = ("flexible", "rigid")
MARKERS = "os^vDP*Xp"  # of the methods, in pictures
LINKS_EVERY = 0.01  # s between outputs per link
QUICK = {
    "chain": "run.stop=0.5 s",
    "vehicle": "run.stop=2.5 s",
    "rig": "run.stop=3 s",
    "bench": "run.stop=2 s",
}


class Row(NamedTuple):
    """A way to run a scene, what it costs and how wrong it is; the truth has no run time but an error of its own."""

    item: str  # scene
    case: str
    track: str
    method: str  # the curve it lies on
    settings: tuple[str, ...]
    wall_time: float  # s
    cpu_time: float  # s, of all threads
    error: float  # the largest relative error of the decisive observables
    estimate: float  # the run's own idea of it
    errors: dict[str, float]  # relative, by observable
    estimates: dict[str, float]
    absolute: dict[str, float]
    units: dict[str, str]
    ok: bool | None = None
    note: str = ""


class Method(NamedTuple):
    """A curve: common settings, and the steps (communication, internal) in ms of its points; 0: the stable one."""

    name: str
    settings: tuple[str, ...]
    steps: tuple[tuple[float, float], ...]

    def points(self) -> Iterator[tuple[str, tuple[str, ...]]]:
        """What sets each point apart, in words and as settings."""
        for step, internal in self.steps:
            own = f"{internal:g} ms" if internal else "the stable one"
            yield (
                f"H = {step:g} ms, h = {own}",
                (f"run.step={step} ms", *((f"track.step={internal} ms",) if internal else ())),
            )


class Variable(NamedTuple):
    """A curve of variable communication steps, in a scene that has them: common settings, and tolerances."""

    name: str
    settings: tuple[str, ...]
    tolerances: tuple[float, ...]

    def points(self) -> Iterator[tuple[str, tuple[str, ...]]]:
        """What sets each point apart, in words and as settings."""
        for tolerance in self.tolerances:
            yield f"tolerance {tolerance:g}", (f"run.variable.tolerance={tolerance}",)


def equal(*steps: float) -> tuple[tuple[float, float], ...]:
    """Communication and internal step alike, ms."""
    return tuple((h, h) for h in steps)


ALONE = (  # a component without any other
    Method("implicit", (), equal(10, 4, 2, 1, 0.5, 0.25, 0.125, 0.0625)),
    Method("Runge-Kutta", ("track.integrator=runge_kutta",), ((1, 0.008),)),
)
COUPLED = (
    Method("tracks first", (), equal(4, 2, 1, 0.5, 0.25, 0.125)),
    Method("tracks first, H = 2 h", (), ((4, 2), (2, 1), (1, 0.5), (0.5, 0.25))),
    Method("tracks first, H = 4 h", (), ((4, 1), (2, 0.5), (1, 0.25))),
    Method("Gauss-Seidel", ("run.coupling=gauss_seidel",), equal(1, 0.5, 0.25)),
    Method("Gauss-Seidel, H = 2 h", ("run.coupling=gauss_seidel",), ((4, 2), (2, 1), (1, 0.5), (0.5, 0.25))),
    Method("Gauss-Seidel, H = 4 h", ("run.coupling=gauss_seidel",), ((4, 1), (2, 0.5), (1, 0.25))),
    Method("Jacobi", ("run.coupling=jacobi",), equal(1, 0.5, 0.25)),
    Method("iterative", ("run.coupling=iterative",), equal(2, 1, 0.5)),
    Method("Runge-Kutta", ("track.integrator=runge_kutta",), ((0.25, 0),)),
)


PACED: Sequence[Method | Variable] = (  # where a scene has a variable step
    *(Method(method.name, ("run.variable=false",), method.steps) for method in COUPLED[:3]),
    Variable("power residual", ("run.variable.estimate=power",), (1e-3, 1e-4, 3e-5, 1e-5, 3e-6)),
    Variable(
        "step doubling",
        # the whole table anew: ``energy`` of a scene is no option of doubling; the tolerance is that of the point
        ("run.variable={estimate='doubling', tolerance=1, longest='7 ms'}",),
        (3e-3, 1e-3, 3e-4),
    ),
)


def cases(quick: bool, scene: str = "straight") -> list[Case]:
    """The truth of each track model, then every way to run the scene."""
    found = load(scene)
    if not isinstance(found, TrackScene):
        raise BadInput(
            f"study error-runtime: scene '{scene}' has no track, and its reference is in its checks"
        )
    base = (QUICK[found.assembly],) if quick else ()
    if isinstance(found, ChainScene) and found.chain.ends == "pinned" and found.track.start in (None, "rest"):
        base = (*base, "track.start=displaced")  # at rest there is nothing to be wrong about
    methods: Sequence[Method | Variable] = ALONE if isinstance(found, ChainScene) else COUPLED
    if found.run.variable is not None:
        methods = PACED
    wanted = []
    for model in MODELS[:1] if quick else MODELS:
        wanted.append(Case(scene, f"truth, {model}", own_error, (scene, model, base), 600.0, 7200.0))
        for method in methods:
            if quick and "Runge" in method.name and found.assembly != "chain":
                continue
            for words, own in list(method.points())[: 4 if quick else None]:
                arguments = (scene, model, method.name, (*base, *method.settings, *own), base)
                wanted.append(Case(scene, f"{model}, {method.name}, {words}", point, arguments, 30.0))
    return wanted


def measure(case: Case) -> list[Row]:
    """The row of a case."""
    return [row._replace(item=case.item, case=case.name) for row in case.function(*case.arguments)]


def _scene(scene: str, track: str, settings: Sequence[str]) -> Scene:
    found = load(scene, track, settings)
    every = max(1, round(LINKS_EVERY / found.run.step)) if found.run.variable is None else found.run.links
    return found.model_copy(update={"run": found.run.model_copy(update={"outputs": 1, "links": every})})


def own_error(scene: str, track: str, base: tuple[str, ...]) -> list[Row]:
    """The truth held against its own coarser half."""
    from orchestrator.truth import ORDER, apart, truth

    found = truth(load(scene, track, base))
    between = apart(found.coarse_log, found.log)
    share = 1.0 / (2.0**ORDER - 1.0)
    row = Row(
        "", "", track, "truth", base, found.wall_time, math.nan, share * worst(between), math.nan,
        {name: share * one.relative for name, one in between.items()}, {},
        {name: share * one.absolute for name, one in between.items()},
        {name: one.unit for name, one in between.items()},
        note=f"internal step {found.internal_step * 1e6:.3g} us",
    )  # fmt: skip
    return [row]


def point(scene: str, track: str, method: str, settings: tuple[str, ...], base: tuple[str, ...]) -> list[Row]:
    """One run, timed, against the truth, with its own estimate."""
    from orchestrator.estimate import estimate
    from orchestrator.truth import apart, truth

    exact = truth(load(scene, track, base))
    timed = _scene(scene, track, settings)
    told = _runs().record(timed)
    if told["status"] != "ok":
        return [failed(scene, "", told["message"])._replace(track=track, method=method, settings=settings)]
    log = Path(told["log"])
    off = apart(log, exact.log)
    own = estimate(timed, log, told, _runs().record)
    estimates = {name: one["total"] for name, one in own["observables"].items()}
    row = Row(
        "", "", track, method, settings, told["wall_time"], told["cpu_time"], worst(off),
        math.nan if own["total"] is None else own["total"],
        {name: one.relative for name, one in off.items()}, estimates,
        {name: one.absolute for name, one in off.items()},
        {name: one.unit for name, one in off.items()},
        note=own["message"],
    )  # fmt: skip
    return [row]


@cache
def _runs() -> Runs:
    """Those of this process."""
    return Runs()


def failed(item: str, case: str, reason: str) -> Row:
    """What is left of a case that ended with an error."""
    return Row(item, case, "", "", (), math.nan, math.nan, math.nan, math.nan, {}, {}, {}, {}, False, reason)


def missed(rows: Sequence[Row]) -> list[Row]:
    """A run that fails at a long step is a result; a truth that fails is not."""
    return [row for row in rows if row.ok is False and (row.method == "truth" or not row.method)]


# --- what the rows say -----------------------------------------------------------------------------


def runs(rows: Iterable[Row]) -> list[Row]:
    """Those that ended well."""
    return [row for row in rows if row.method not in ("truth", "") and math.isfinite(row.error)]


def pareto(rows: Iterable[Row], error: Any = lambda row: row.error) -> list[Row]:
    """Rows that no other beats in both run time and error."""
    best: list[Row] = []
    for row in sorted(runs(rows), key=lambda row: (row.wall_time, error(row))):
        if not best or error(row) < error(best[-1]):
            best.append(row)
    return best


def cheapest(rows: Iterable[Row], level: float, observable: str = "") -> Row | None:
    """The fastest run within an error: of one observable, or the largest of all decisive ones."""
    found = [
        row
        for row in runs(rows)
        if (row.errors.get(observable, math.inf) if observable else row.error) <= level
    ]
    return min(found, key=lambda row: row.wall_time, default=None)


def ratios(rows: Iterable[Row]) -> list[float]:
    """Own estimate over true error, of every observable of every run."""
    return [
        row.estimates[name] / error
        for row in runs(rows)
        for name, error in row.errors.items()
        if error > 0.0 and row.estimates.get(name)
    ]


def sentences(rows: Sequence[Row]) -> list[str]:
    """What a reader should take away."""
    said = []
    for scene, track in dict.fromkeys((row.item, row.track) for row in runs(rows)):
        of = [row for row in rows if (row.item, row.track) == (scene, track)]
        for level in LEVELS:
            row = cheapest(of, level)
            if row is None:
                best = min(runs(of), key=lambda row: row.error)
                said.append(
                    f"{scene}, {track}: no setting reaches {level:.2%}; the best, "
                    f"{best.error:.2%} in {best.wall_time:.3g} s, is {best.case}"
                )
            else:
                said.append(
                    f"{scene}, {track}: {level:.2%} costs {row.wall_time:.3g} s (error {row.error:.2g}): {row.case}"
                )
    whole = [row.estimate / row.error for row in runs(rows) if row.error > 0.0 and row.estimate > 0.0]
    for what, found in (("of whole runs", whole), ("by observable", ratios(rows))):
        if found:
            right = sum(1.0 / FACTOR <= ratio <= FACTOR for ratio in found)
            said.append(
                f"own estimates {what} within a factor of {FACTOR:g} of the true error: {right} of {len(found)}"
                f" ({right / len(found):.0%}); median ratio {sorted(found)[len(found) // 2]:.2f}"
            )
    return said


# --- tables and picture ----------------------------------------------------------------------------


def to_csv(rows: Sequence[Row]) -> str:
    """One line a row; errors and estimates of observables in columns of their own."""
    names = list(dict.fromkeys(name for row in rows for name in row.errors))
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(
        ["scene", "case", "track", "method", "settings", "wall time, s", "CPU time, s", "error", "estimate"]
        + [f"{name} ({kind})" for name in names for kind in ("relative", "absolute", "estimate")]
        + ["note"]
    )
    for row in rows:
        figures = [
            found.get(name, "") for name in names for found in (row.errors, row.absolute, row.estimates)
        ]
        head = [row.item, row.case, row.track, row.method, " ".join(f"'{s}'" for s in row.settings)]
        writer.writerow([*head, row.wall_time, row.cpu_time, row.error, row.estimate, *figures, row.note])
    return out.getvalue()


def to_markdown(rows: Sequence[Row]) -> str:
    """A table for people: relative errors by observable, * on the Pareto front; then what it says."""
    names = list(dict.fromkeys(name for row in rows for name in row.errors))
    head = ["scene", "case", "run time, s", "CPU, s", "error", "own estimate", *names, "note"]
    front = {id(row) for key in {(r.item, r.track) for r in rows} for row in
             pareto(r for r in rows if (r.item, r.track) == key)}  # fmt: skip
    lines = ["| " + " | ".join(head) + " |", "|" + " --- |" * len(head)]
    for row in rows:
        cells = [
            row.item, row.case + (" *" if id(row) in front else ""), f"{row.wall_time:.3g}",
            "" if math.isnan(row.cpu_time) else f"{row.cpu_time:.3g}", f"{row.error:.2e}",
            "" if math.isnan(row.estimate) else f"{row.estimate:.2e}",
            *(f"{row.errors[name]:.1e}" if name in row.errors else "" for name in names), row.note,
        ]  # fmt: skip
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join([*lines, "", *(f"- {said}" for said in sentences(rows))]) + "\n"


def write(folder: Path, name: str, rows: Sequence[Row], title: str) -> list[Path]:
    """Tables, picture, and the settings for ``cotrack run SCENE --error``."""
    scenes = "-".join(dict.fromkeys(row.item for row in rows))
    stem = f"{name}-{scenes}"
    texts = {f"{stem}.csv": to_csv(rows), f"{stem}.md": f"# {title}: {scenes}\n\n{to_markdown(rows)}"}
    files = save(folder, texts, stem, lambda files: draw(rows, files, f"{title}: {scenes}"))
    settings = [
        precision.Setting(row.item, row.track, means(row), row.error, row.wall_time) for row in runs(rows)
    ]
    tables = [folder / "precision.json"]
    if not any(setting.startswith("run.stop") for row in rows for setting in row.settings):
        tables.append(precision.own())  # only what was found over the whole scene
    for table in tables:
        precision.write(settings, table)
    return [*files, *tables]


def means(row: Row) -> tuple[str, ...]:
    """Of a row's settings, how the scene is run; what it is stays with the scene."""
    return tuple(s for s in row.settings if not s.startswith(("run.stop", "track.start", "chain.")))


def draw(rows: Sequence[Row], files: Sequence[Path], title: str) -> None:
    """A pane for the error as a whole and one for each observable; a curve a method, the Pareto front shaded."""
    from matplotlib import colormaps
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D
    from matplotlib.ticker import NullFormatter

    shown = runs(rows)
    names = ["", *dict.fromkeys(name for row in shown for name in row.errors)]
    across = min(3, len(names))
    down = -(-len(names) // across)
    figure = Figure(figsize=(5.2 * across, 4.2 * down + 1.4), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots(down, across, squeeze=False).ravel()
    methods = list(dict.fromkeys(row.method for row in shown))
    tracks = list(dict.fromkeys(row.track for row in shown))
    lines: dict[str, Any] = dict(zip(tracks, ("-", "--"), strict=False))
    for pane, name in zip(axes, names, strict=False):

        def error(row: Row, name: str = name) -> float:
            return row.errors.get(name, math.nan) if name else row.error

        for track, (k, method) in product(tracks, enumerate(methods)):
            points = [
                (row.wall_time, error(row)) for row in shown if (row.track, row.method) == (track, method)
            ]
            if not points:
                continue
            pane.loglog(
                *zip(*points, strict=True), marker=MARKERS[k % len(MARKERS)], markersize=4, linewidth=1,
                linestyle=lines[track], color=colormaps["tab10"](k % 10),
            )  # fmt: skip
        for track in tracks:
            best = pareto((row for row in shown if row.track == track), error)
            pane.loglog(
                [row.wall_time for row in best], [error(row) for row in best], linestyle="none", marker="o",
                markersize=10, markerfacecolor="none", markeredgecolor="0.3",
            )  # fmt: skip
        own = [error(row) for row in rows if row.method == "truth"]
        if own and max(own) > 0.0:
            corner = {"ha": "right", "va": "top", "transform": pane.transAxes, "fontsize": 7}
            pane.text(0.98, 0.97, f"truth: {max(own):.0e}", **corner)
        pane.set_title(name.replace("_", " ") or "largest of the decisive ones", fontsize=9, loc="left")
        pane.set_xlabel("run time, s", fontsize=8)
        pane.set_ylabel("relative error", fontsize=8)
        low, high = pane.get_xlim()
        pane.xaxis.set_minor_formatter("{x:g}" if high < 10.0 * low else NullFormatter())
        pane.yaxis.set_minor_formatter(NullFormatter())
        pane.grid(True, which="both", color="0.93")
    for pane in axes[len(names) :]:
        pane.set_axis_off()
    keys = [
        Line2D([], [], color=colormaps["tab10"](k % 10), marker=MARKERS[k % len(MARKERS)], label=method)
        for k, method in enumerate(methods)
    ]
    keys += [
        Line2D([], [], color="0.3", linestyle=line, label=f"{track} links") for track, line in lines.items()
    ]
    figure.legend(handles=keys, loc="outside lower center", ncols=min(4, len(keys)), fontsize=10)
    figure.suptitle(f"{title} (rings: Pareto front of a track model)", fontsize=12)
    for file in files:
        figure.savefig(file, dpi=100)
