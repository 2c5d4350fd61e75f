"""Fit: numbers of scenes with which their runs agree best with measured signals, and how sure they are.

``least_squares`` searches, ``uncertainty`` tells the errors; here are data, tables, the picture and the fitted scene.
"""

from __future__ import annotations

import json
import math
import os
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from fmus.vehicles.tables import BadInput
from orchestrator.files.command import command_scope
from orchestrator.files.messages import LOG
from orchestrator.log.reader import Log, Missing
from orchestrator.log.time_series import within
from orchestrator.results import output_files
from orchestrator.results.measured_difference import read_shifted
from orchestrator.results.measured_record import FIND, MeasuredFile, MeasuredSignal
from orchestrator.results.output_files import Picture, new_figure
from orchestrator.results.run_data import EVER, RunData, Window
from orchestrator.results.table import Column, Table
from orchestrator.scene.keys import scene_keys
from orchestrator.scene.kinds import Scene
from orchestrator.scene.products import make_folder
from orchestrator.scene.scene import any_from_table, load, with_settings, with_track
from orchestrator.scene.settings import toml_text
from orchestrator.studies import pool
from orchestrator.studies.free_numbers import FreeNumber, free_numbers
from orchestrator.studies.least_squares import Experiment, FitFailed, Objective, RecordedPart, Search, rms, search
from orchestrator.studies.uncertainty import FittedNumbers, fitted_numbers

COLUMNS = (
    Column("key", "number"), Column("unit", "unit"), Column("start", "start", ".8g"), Column("fitted", "fitted", ".8g"),
    Column("error", "standard error", ".3g"), Column("relative", "of the number, %", ".3g"),
    Column("step", "relative step", ".0e"), Column("rough", "change of the derivative with twice the step, %", ".2g"),
)  # fmt: skip
RESIDUALS = (
    Column("data", "data"), Column("signal", "signal"), Column("unit", "unit"), Column("samples", "samples"),
    Column("noise", "noise", ".4g"), Column("first", "RMS of the first run", ".4g"),
    Column("last", "RMS of the fitted run", ".4g"), Column("chi2", "chi2/n", ".3g"),
)  # fmt: skip

SAMPLES = (("data", ""), ("signal", ""), ("t", "s"), ("measured", ""), ("first run", ""), ("fitted run", ""))

FILES = (
    "fit.csv", "fit.md", "fit.png", "fit.svg", "fit.json", "fitted.toml", "fitted_vehicle.toml", "signals.csv",
    "signals.md", "residuals.csv",
)  # fmt: skip


class Fitted(NamedTuple):
    """Result of ``fit``."""

    verdict: str  # first line: "fitted: ...", or "no fit: ..." with the reasons
    ok: bool
    table: Table
    residuals: Table
    answer: FittedNumbers
    files: tuple[Path, ...]
    scene: Scene  # with the fitted numbers
    runs: int


@command_scope()
def fit(  # noqa: PLR0913, the options of the command
    scene: str,
    data: str | os.PathLike[str] | Sequence[str | os.PathLike[str]],
    columns: Mapping[str, str],
    free: Sequence[str],
    output: str | os.PathLike[str],
    *,
    track: str | None = None,
    settings: Sequence[str] | Mapping[str, Any] = (),
    part: str = "",
    clock: str = "",
    shift: float | str = 0.0,
    noise: Mapping[str, float] | None = None,
    scan: int = 0,
    start: float = -math.inf,
    end: float = math.inf,
    native: bool = False,
    workers: int = 1,
) -> Fitted:
    """Fit numbers of a scene to measured signals; write tables, picture and the fitted scene into the folder.

    ``data``: file, or several, which get one set of numbers; "SCENE=FILE" was measured in another scene. ``columns``:
    column of each file by signal, with ``clock`` and ``shift`` as of ``compare``. ``free``: texts ``KEY`` or
    ``KEY=FROM:TO``. ``noise``: standard deviation of a sample by signal, in its unit; it is estimated where it is
    missing. ``scan``: points of the ranges that are tried as starts. ``start``, ``end``: window, s.

    ``part``: component that is stepped alone with the inputs that the log ``scene`` has of it.

    An interrupted fit of the same folder continues. Several ``workers`` are processes, for which a script needs
    ``if __name__ == "__main__":``. Raises BadInput, also where a run fails; KeyboardInterrupt.
    """
    wanted: list[tuple[Experiment, list[MeasuredFile]]] = []  # files of a scene share its runs
    for file in [data] if isinstance(data, str | os.PathLike) else data:
        other, mark, path = os.fspath(file).rpartition("=")
        if Path(file).exists() or not mark:
            other, path = scene, os.fspath(file)
        one = _of_part(other, part, track, settings) if part else Experiment(load(other, track, settings), None, native)
        sources = next((sources for known, sources in wanted if known == one), None)
        if sources is None:
            wanted.append((one, sources := []))
        if any(Path(known.path).resolve() == Path(path).resolve() for known in sources):
            raise BadInput(f"data {path}: is given twice, which would make errors too small")
        sources.append(MeasuredFile(path, columns, clock, shift))
    if part and native:
        raise BadInput("native: a part is stepped as its log tells")
    for signal in noise or {}:
        if signal not in columns:
            raise BadInput(f"noise {signal}: this signal is given no column")
    numbers = free_numbers([one.scene for one, _ in wanted], free)
    measured = [_measured(*pair, Window(start, end)) for pair in wanted]
    folder = Path(output)
    results = [folder / name for name in FILES]
    output_files.check_unread(*results)
    if earlier := [path.name for path in results if path.exists()]:
        LOG.warning("in %s are replaced: %s", folder, ", ".join(earlier))
    make_folder(folder)
    experiments = tuple(one for one, _, _ in measured)
    clocks = {one.file: one for _, each, _ in measured for one in each}
    numbers += tuple(one for one in clocks.values() if one.low < one.high)
    task = Objective(experiments, numbers, dict(noise or {}), workers, pool.Store(folder / "cases"))
    notes = [text for *_, each in measured for text in each]
    try:
        found = search(task, scan)
        shifts = {file: one.start for file, one in clocks.items()} | task.shifts(found.u)
        origin = " and ".join(f"{file}, {shift:g} s added to its times" for file, shift in shifts.items())
        return _save(
            task, found, fitted_numbers(task, found), folder, origin, notes + task.with_found_shifts(found.u)[1]
        )
    except FitFailed as failure:
        raise BadInput(f"a run fails, so nothing is fitted: {failure}") from None


def _of_part(file: str, name: str, track: str | None, settings: Sequence[str] | Mapping[str, Any]) -> Experiment:
    """Component of the log of a run; raises BadInput for settings, LogUnreadable."""
    if settings:
        raise BadInput("settings: a part has the scene of its log, and only free numbers change it")
    with Log(file) as log:
        if "scene.json" not in log.attachments:
            raise BadInput(f"part {name}: {file} does not say of which scene it is")
        scene = with_track(any_from_table(log.table("scene.json"), f"{file}: scene.json", logged=True))
        if track is not None:
            scene = scene.model_copy(update={"planar": False, "track": scene.track.of_model(track)}).with_axes()
        return Experiment(scene, RecordedPart(Path(file), name, track, log.digest()))


def _measured(
    experiment: Experiment, sources: Sequence[MeasuredFile], window: Window
) -> tuple[Experiment, list[FreeNumber], list[str]]:
    """Experiment with its signals, without gaps, in the window and the time of a run; shifts of files; notes."""
    about = f"a run of {experiment.scene.name}"
    signals: list[MeasuredSignal] = []
    files: list[str] = []
    clocks: list[FreeNumber] = []
    notes: list[str] = []
    with tempfile.TemporaryDirectory(prefix="cotrack-") as folder:
        path = Path(folder) / "run.mcap"
        try:
            experiment.run({}, path)
        except RuntimeError as error:
            raise BadInput(f"the run of the start fails, so nothing is fitted: {error}") from None
        with Log(path) as log:
            log.require_window(*window)
            run = RunData(log)
            for data in sources:
                try:
                    record = read_shifted(run, data, window)
                except Missing as error:  # the path of the log says nothing to a user
                    raise BadInput(str(error).replace(str(path), about)) from None
                spans = [Window(*run.signal(one.signal, EVER)[0][[0, -1]]) for one in record.signals]
                inside = [_inside(*pair, window, str(data.path)) for pair in zip(record.signals, spans, strict=True)]
                ends = (record.shift, record.shift)
                if data.shift == FIND:
                    _check_found(run, inside, data)
                    ends = (-math.inf, math.inf)
                signals += inside
                files += [str(data.path)] * len(inside)
                size = 0.1 * max(float(np.ptp(one.t)) for one in inside) or 1.0
                clocks.append(FreeNumber(f"shift of {data.path}", record.shift, *ends, size, str(data.path)))
                notes += record._replace(
                    doubts=record.doubts[data.shift == FIND :]
                ).notes  # that of the fitted run is told
                whole, used = (sum(len(one.t) for one in each) for each in (record.signals, inside))
                if used < whole:
                    notes.append(f"{data.path}: {used} of {whole} samples have a number and are in window and run")
    return experiment._replace(signals=tuple(signals), files=tuple(files)), clocks, notes


def _inside(one: MeasuredSignal, span: Window, window: Window, file: str) -> MeasuredSignal:
    """Samples of a signal with a number in the window and a run's span; raises BadInput for none, or one of many."""
    common, known = Window(max(window.start, span.start), min(window.end, span.end)), ~np.isnan(one.values)
    inside = within(one.t, common) & known
    if inside.sum() < min(known.sum(), 2) or not inside.any():
        count = f"one sample of {known.sum()}" if inside.any() else "no sample"
        time = f"the time that is fitted, {common.start:g} to {common.end:g} s"
        raise BadInput(f"{file}: '{one.column}' has {count} in {time}")
    return one._replace(t=one.t[inside], values=one.values[inside])


def _check_found(run: RunData, signals: Sequence[MeasuredSignal], data: MeasuredFile) -> None:
    """Raise BadInput if the run of the start differs from the signals by more than they vary: any shift is a guess."""
    ratios = [rms(np.interp(one.t, *run.signal(one.signal, EVER)) - one.values) / np.std(one.values)
              for one in signals if np.std(one.values) > 0.0]  # fmt: skip
    if ratios and (ratio := rms(np.array(ratios))) > 1.0:
        raise BadInput(
            f"shift find: the run of the start differs from {data.path} by {100.0 * ratio:.3g} % of what the signals"
            " vary, so its clock cannot be told: give the shift in s, or map signals that are alike from the start"
        )


def _save(task: Objective, end: Search, found: FittedNumbers, folder: Path, origin: str, read: Sequence[str]) -> Fitted:
    """Write the result; ``origin``: files of the data; ``read``: notes on them."""
    about = f"{len(task.free)} numbers by {sum(len(one.t) for one in task.signals)} samples of"
    about += f" {len(task.signals)} signals, chi2/n {found.chi2:.4g}, {task.runs} runs"
    about += ", exact: residuals are at the precision of record and search" if found.exact else ""
    verdict = f"no fit: {'; '.join(found.problems)} ({about})" if found.problems else f"fitted: {about}"
    known = {key.key: key.unit for key in scene_keys()}
    units = {one.key: "s" if one.file else known.get(one.key.partition("[")[0], "") for one in task.free}
    records = [
        {"key": one.key, "unit": units[one.key], "start": begun, "fitted": number, "error": error,
         "relative": 100.0 * error / abs(number) if number else math.inf, "step": step, "rough": 100.0 * rough}
        for one, begun, number, error, step, rough in zip(
            task.free, task.numbers(end.start), found.numbers, found.errors, end.steps, end.rough, strict=True)
    ]  # fmt: skip
    apart = [*zip(task.difference(end.start), task.difference(end.u), strict=True)]
    names, instants = task.files, task.instants(end.u)
    samples = [
        (name, one.signal, *sample)
        for name, one, t, (a, b) in zip(names, task.signals, instants, apart, strict=True)
        for sample in zip(t, one.values, one.values + a, one.values + b, strict=True)
    ]
    sizes = [
        {"data": name, "signal": one.signal, "unit": one.unit, "samples": len(one.t), "noise": noise, "first": rms(a),
         "last": rms(b), "chi2": (rms(b) / noise) ** 2}
        for name, one, noise, (a, b) in zip(names, task.signals, end.noise, apart, strict=True)
    ]  # fmt: skip
    first = task.experiments[0].scene
    notes = (*dict.fromkeys(read), *found.notes)
    table = Table.of_records(f"Fit of {first.name}: {verdict}", COLUMNS, records, notes)
    residuals = Table.of_records("Residuals", RESIDUALS, sizes)
    profiles = {one.key: each._asdict() for one, each in zip(task.free, found.profiles, strict=True)}
    result = {
        "verdict": verdict, "ok": not found.problems, "numbers": records, "signals": sizes, "chi2_n": found.chi2,
        "correlations": found.correlations, "profiles": profiles, "problems": found.problems, "notes": notes,
    }  # fmt: skip
    origins = {
        one.key: f"fitted to {origin}; standard error {error:.3g}"
        for one, error in zip(task.free, found.errors, strict=True)
        if not one.file
    }
    changed = with_track(with_settings(first, task.of_scenes(end.u)))
    more = {"fit.json": json.dumps(_finite(result), indent=1), "signals.csv": residuals.csv()}
    more["signals.md"] = residuals.markdown("#")
    more["residuals.csv"] = Table.of("", SAMPLES, samples).csv()
    more |= _scene_files(changed, origins)
    saved = output_files.save_results(folder, "fit", table, _draw(task, end, found, names, units), more)
    return Fitted(verdict, not found.problems, table, residuals, found, tuple(saved), changed, task.runs)


def _finite(value: Any) -> Any:
    """Plain data with None for numbers that JSON has not."""
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, Mapping):
        return {key: _finite(one) for key, one in value.items()}
    if isinstance(value, np.ndarray):
        return _finite(value.tolist())
    return [_finite(one) for one in value] if isinstance(value, list | tuple) else value


PROFILES = 4  # in a row of the picture


def _draw(
    task: Objective, end: Search, found: FittedNumbers, names: Sequence[str], units: Mapping[str, str]
) -> Picture:
    """Data, first and fitted run of each signal; below, the profile of each number and the parabola of its error."""
    signals, rows = task.signals, -(-len(task.free) // PROFILES)
    heights = [2.2 * len(signals) + 0.6, 2.0 * rows]
    figure = new_figure(9.0, sum(heights))
    grid = figure.add_gridspec(2, 1, height_ratios=heights)
    above, below = figure.add_subfigure(grid[0]), figure.add_subfigure(grid[1])
    panes = above.subplots(len(signals), 1, squeeze=False, sharex=len(task.experiments) == 1)[:, 0]
    apart = zip(task.difference(end.start), task.difference(end.u), strict=True)
    for pane, name, one, (a, b) in zip(panes, names, signals, apart, strict=True):
        pane.plot(one.t, one.values, ".", ms=2, color="0.6", label="measured")
        pane.plot(one.t, one.values + a, lw=0.8, ls="--", label="start")
        pane.plot(one.t, one.values + b, lw=1.0, label="fitted")
        pane.set_ylabel(f"{one.signal}, {one.unit}", fontsize=7)
        if len(set(names)) > 1:
            pane.set_title(name, fontsize=7, parse_math=False)
    panes[0].legend(fontsize=7)
    panes[-1].set_xlabel("t, s")
    cells = iter(below.subplots(rows, min(len(task.free), PROFILES), squeeze=False).flat)
    for free, number, error, profile, cell in zip(
        task.free, found.numbers, found.errors, found.profiles, cells, strict=False
    ):
        cell.plot([number, *profile.numbers], [0.0, *profile.rises], "o", ms=4, label="runs")
        if math.isfinite(error):
            s = np.linspace(-2.2, 2.2, 45)
            cell.plot(number + error * s, s**2, lw=0.8, color="0.5", label="by the standard error")
        cell.set_xlabel(f"{free.key}, {units[free.key] or 1}", fontsize=7)
        cell.ticklabel_format(useOffset=False)
        cell.locator_params(axis="x", nbins=4)
        cell.tick_params(labelsize=6)
    for cell in cells:
        cell.set_visible(False)
    below.axes[0].set_ylabel("rise of the sum of squares", fontsize=7)
    below.axes[0].legend(fontsize=6, loc="upper center")
    figure.suptitle(f"Fit of {task.experiments[0].scene.name}", fontsize=11)
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
            origin = [text for one, text in origins.items() if one == key or one.startswith(f"{key}.")]
            lines.append(f"{name} = {toml_text(value)}" + (f"  # {origin[0]}" if origin else ""))
    return [*lines, *tables]
