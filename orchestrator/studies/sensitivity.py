"""Sensitivity: how the figures of a run change with each number of a scene, by differences.

A number p is raised by h p and by 2 h p. Where both differences of a figure over h agree to AGREE, the first is its
derivative by ln p, told as the change of the figure for one per cent of the number; else the next of STEPS is tried.
Where none agrees, a switch, an impact or the rounding of a run is larger than what the number does: there is no
derivative. Where raising is refused, the number is lowered.
"""

from __future__ import annotations

import math
import os
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from fmus.vehicles.tables import BadInput
from orchestrator.files.messages import PROGRESS
from orchestrator.log.time_series import Floats
from orchestrator.results import output_files
from orchestrator.results.measures import OBSERVABLES
from orchestrator.results.output_files import Picture, new_figure
from orchestrator.results.table import Column, Table
from orchestrator.scene.kinds import Scene
from orchestrator.scene.products import make_folder
from orchestrator.scene.scene import load, with_settings
from orchestrator.scene.settings import pairs
from orchestrator.studies import Case, Row, pool
from orchestrator.studies.free_numbers import number_at
from orchestrator.studies.parameter_sweep import figure_column, run_case
from orchestrator.studies.wanted_figures import WantedFigure, recording_settings, wanted_figures

STEPS = 1e-4, 1e-3, 1e-2  # h
AGREE = 0.05  # of the derivative
FELT = 1e-10  # of a figure: a smaller change is none
LEFT_OUT = "vehicle.life"  # a table that no run depends on
ROUGH = "rough"  # cell without a derivative


class Sensitivity(NamedTuple):
    """Derivatives of figures by ln of numbers; k numbers, m figures."""

    scene: str
    numbers: dict[str, float]  # by key, SI
    figures: dict[str, float]  # by name, as it is
    derivatives: Floats  # (k, m) by ln of the number, in the figure's unit; NaN: none
    steps: Floats  # (k, m) relative step of the difference; NaN without a derivative
    notes: tuple[str, ...]

    def table(self) -> Table:
        """Table of the change of each figure by one per cent of each number."""
        columns = [Column("key", "+ 1 % of"), Column("value", "value, SI", ".6g")]
        columns += [figure_column(name, ".3g") for name in self.figures]
        records = [{"key": "as it is", **self.figures}]
        for (key, value), row in zip(self.numbers.items(), self.derivatives.tolist(), strict=True):
            shown = (ROUGH if math.isnan(one) else 0.01 * one for one in row)
            records.append({"key": key, "value": value, **dict(zip(self.figures, shown, strict=True))})
        return Table.of_records(f"Sensitivity of {self.scene}", columns, records, self.notes)


def sensitivity(
    scene: str,
    output: str | os.PathLike[str],
    keys: Sequence[str] = (),
    *,
    track: str | None = None,
    settings: Sequence[str] | Mapping[str, Any] = (),
    figures: Sequence[str] = (),
    native: bool = False,
    workers: int = 1,
) -> tuple[Sensitivity, list[Path]]:
    """Derivatives of the figures of a scene by its numbers; write tables and a picture into the folder ``output``.

    ``keys``: numbers, by default all of the vehicle that are not 0. ``figures``: instead of the observables, as of
    ``sweep``. An interrupted call with the same folder continues. Several ``workers`` are processes, for which a script
    needs ``if __name__ == "__main__":``. Raises BadInput, KeyboardInterrupt.
    """
    wanted = wanted_figures(figures)
    loaded = load(scene, track, recording_settings(wanted, dict(pairs(settings))))
    found, folder = numbers_of(loaded, keys), Path(output)
    make_folder(folder)
    store = pool.Store(folder / "cases")
    result = _derivatives(loaded, found, wanted, native, workers, store)
    exact = result.table()
    derivatives = Table.of_records(
        "", [Column("key", "key"), *map(figure_column, result.figures)],
        [{"key": key, **dict(zip(result.figures, row, strict=True))}
         for key, row in zip(result.numbers, result.derivatives.tolist(), strict=True)],
    )  # fmt: skip
    more = {"derivatives.csv": derivatives.csv()}
    return result, output_files.save_results(folder, "sensitivity", exact, _draw(result), more)


def numbers_of(scene: Scene, keys: Sequence[str]) -> dict[str, float]:
    """Numbers by key, SI; raises BadInput for others."""
    found = {key: number_at(scene, key, "--of") for key in keys}
    for key, value in found.items():
        if not value:
            raise BadInput(f"--of {key}: is 0 in {scene.where}, and one per cent of it is 0: --set gives it a value")
    every = _of_table(scene.resolved()["vehicle"], "vehicle")
    return found or {key: value for key, value in every if value and not key.startswith(LEFT_OUT)}


def _of_table(table: Any, above: str) -> Iterator[tuple[str, float]]:
    for name, value in table.items() if isinstance(table, Mapping) else enumerate(table):
        key = f"{above}.{name}"
        if isinstance(value, float):
            yield key, value
        elif isinstance(value, Mapping | list | tuple):
            yield from _of_table(value, key)


def _changed(scene: Scene, key: str, value: float, h: float) -> tuple[float, Scene] | None:
    """Relative change and the scene with a raised number, or a lowered one; None where both are refused."""
    for change in (h, -h):
        try:
            changed = with_settings(scene, {key: value * (1.0 + change)})
        except BadInput:
            continue
        assert isinstance(changed, Scene)
        return change, changed
    return None


def _derivatives(
    scene: Scene, numbers: dict[str, float], wanted: tuple[WantedFigure, ...], native: bool, workers: int,
    store: pool.Store,
) -> Sensitivity:  # fmt: skip
    def case(name: str, one: Scene) -> Case:
        return Case(scene.name, name, run_case, (one, native, False, None, wanted), one.run.stop, math.inf)

    (base,) = pool.run([case("as it is", scene)], 1, None, store)
    if base.figures.get("status") != "ok":
        raise BadInput(f"the run of the scene as it is fails: {base.note}")
    names = [name for name in _names(base, wanted) if isinstance(base.figures[name], float)]
    middle = np.array([base.figures[name] for name in names])
    derivatives, steps = np.full((2, len(numbers), len(names)), np.nan)
    refused, failed = set(), set()
    for h in STEPS:
        open_keys = [key for k, key in enumerate(numbers) if np.isnan(derivatives[k]).any()]
        cases, changes = [], []
        for key in open_keys:
            pair = [_changed(scene, key, numbers[key], times * h) for times in (1.0, 2.0)]
            if None in pair:
                refused.add(key)
                continue
            for change, one in filter(None, pair):
                changes.append((key, change))
                cases.append(case(f"{key} {100.0 * change:+g} %", one))
        PROGRESS.info("steps of %g %%: %d runs", 100.0 * h, len(cases))
        rows = dict(zip(changes, pool.run(cases, workers, None, store), strict=True))
        for (key, once), (_, twice) in zip(changes[::2], changes[1::2], strict=True):
            both = [_slopes(rows[key, change], names, middle, change) for change in (once, twice)]
            failed |= {key} if np.isnan(both).all() else set()
            k, (first, second) = list(numbers).index(key), both
            felt = np.abs(first) * h > FELT * np.abs(middle)
            agree = np.abs(first - second) <= AGREE * np.maximum(np.abs(first), np.abs(second))
            known = np.isnan(derivatives[k]) & (agree | (~felt & (h == STEPS[-1])))
            derivatives[k] = np.where(known, np.where(felt, first, 0.0), derivatives[k])
            steps[k] = np.where(known, h, steps[k])
    count = int(np.isnan(derivatives).sum())
    about = f"{ROUGH}: no derivative ({count} of {derivatives.size}), because a switch, an impact or rounding is larger"
    notes = [f"change of each figure for one per cent of a number; {about}"]
    notes += [f"{key}: neither a larger nor a smaller value is allowed" for key in sorted(refused)]
    notes += [f"{key}: its runs fail" for key in sorted(failed)]
    return Sensitivity(
        scene.name, numbers, dict(zip(names, middle.tolist(), strict=True)), derivatives, steps, tuple(notes)
    )


def _names(base: Row, wanted: Sequence[WantedFigure]) -> Iterator[str]:
    for name in base.figures:
        if name.startswith(tuple(one.text for one in wanted)) if wanted else name in OBSERVABLES:
            yield name


def _slopes(row: Row, names: Sequence[str], middle: Floats, change: float) -> Floats:
    """Differences of the figures over the relative change; NaN where the run fails or lacks them."""
    values = [row.figures.get(name) if row.figures.get("status") == "ok" else None for name in names]
    return (np.array([math.nan if value is None else value for value in values]) - middle) / change


def _draw(result: Sensitivity) -> Picture:
    """Map of per cent of a figure for one per cent of a number; grey where there is no derivative."""
    figures = np.array(list(result.figures.values()))
    with np.errstate(divide="ignore", invalid="ignore"):
        relative = np.where(figures != 0.0, result.derivatives / np.abs(figures), np.nan)
    felt = np.nan_to_num(np.abs(relative)).max(axis=1) > 1e-3
    keys = [key for key, shown in zip(result.numbers, felt, strict=True) if shown]
    figure = new_figure(4.5 + 0.42 * len(figures), 1.8 + 0.2 * max(len(keys), 1))
    pane = figure.subplots()
    pane.set_facecolor("0.8")
    shown = pane.imshow(relative[felt] if keys else [[math.nan]], cmap="RdBu_r", vmin=-2.0, vmax=2.0, aspect="auto")
    pane.set_yticks(range(len(keys)), [key.removeprefix("vehicle.") for key in keys], fontsize=7)
    pane.set_xticks(range(len(figures)), list(result.figures), rotation=90, fontsize=7)
    figure.colorbar(shown, label="% for 1 %\n(grey: none)")
    figure.suptitle(f"Sensitivity of {result.scene}", fontsize=11)
    return figure
