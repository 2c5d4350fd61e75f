"""Sweep: runs of a scene with varied settings, a row of figures for each.

Its folder holds ``sweep.json`` (which sweep it is), the rows of finished cases (``pool.Store``), tables and a picture.
"""

from __future__ import annotations

import hashlib
import json
import math
import os
import tempfile
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar, Literal

from fmus.vehicles.tables import BadInput, path_text, value_text
from orchestrator.execution import summary
from orchestrator.execution.simulate import simulate
from orchestrator.execution.summary import Summary
from orchestrator.files.budget import DOCUMENT, read_file
from orchestrator.log.extra import NotInstalled, library
from orchestrator.results import output_files
from orchestrator.results.convergence_index import PARTS
from orchestrator.results.measures import OBSERVABLES
from orchestrator.results.output_files import atomic_write
from orchestrator.results.table import Column, Table
from orchestrator.scene.kinds import Scene
from orchestrator.scene.products import make_folder
from orchestrator.scene.scene import SHORT_KEYS, load
from orchestrator.scene.settings import pairs
from orchestrator.studies import Case, Row, pool
from orchestrator.studies.pool import Store
from orchestrator.studies.sweep_picture import draw
from orchestrator.studies.variations import Design
from orchestrator.studies.wanted_figures import WantedFigure, figures_of_log, recording_settings, wanted_figures

NOT_MET = "checks not met"
REPORTED = "distance", "speed", "settlement", "ground_force", "tension_max", "tension_mean", "pin_force"
MAX_REMARKS = 3  # of these are said of a case as it finishes, the first that it has
HIDDEN = ("log", "warnings", "wall_time", "estimated error of ")  # in the whole table alone
UNITS = {"wall_time": "s"} | {name: one.figure.unit for name, one in OBSERVABLES.items() if one.figure.unit != "1"}


def sweep(  # noqa: PLR0913, the options of the command
    scene: str,
    vary: Sequence[str] | Mapping[str, Iterable[Any]],
    output: str | os.PathLike[str],
    *,
    sample: int | None = None,
    seed: int = 0,
    track: str | None = None,
    settings: Sequence[str] | Mapping[str, Any] = (),
    native: bool = False,
    estimate: bool | Literal["parts"] = True,
    keep_logs: bool = False,
    workers: int = 1,
    scheduler: str | None = None,
    figures: Sequence[str] = (),
) -> Table:
    """Run a scene for all values of ``vary``; return the table that it writes into the folder ``output``.

    ``vary``: texts ``KEY=a:b:n`` or ``KEY=x,y,z``, or a table of values by key, ``{"drive.speed": [10, 15, 20]}``.

    An interrupted sweep of the same folder continues. ``sample``: number of points of a Latin hypercube over the ranges
    ``KEY=a:b``. Several ``workers`` are processes, for which a script needs ``if __name__ == "__main__":``;
    ``scheduler``: address of a Dask cluster. ``figures``: further ones, as above. A case that fails is a
    row whose note is the reason. Raises BadInput before the first run.
    """
    folder = Path(output)
    if isinstance(vary, Mapping):
        vary = [f"{key}={','.join(map(str, values))}" for key, values in vary.items()]
    design = Design.of(vary, sample, seed)
    planned = plan(design, scene, folder, track, settings, native, estimate, keep_logs, figures)
    rows = pool.run(planned.cases, workers, scheduler, Store(folder / "cases"))
    planned.write(folder, "sweep", rows, planned.TITLE)
    return planned.whole_table(rows)


def plan(
    design: Design,
    scene: str,
    folder: Path,
    track: str | None = None,
    settings: Sequence[str] | Mapping[str, Any] = (),
    native: bool = False,
    estimated: bool | Literal["parts"] = True,
    keep_logs: bool = False,
    figures: Sequence[str] = (),
) -> Sweep:
    """Load the scene of every case, then make the folder; raises BadInput, also for the folder of another sweep."""
    wanted = wanted_figures(figures)
    common = recording_settings(wanted, dict(pairs(settings)))
    fixed = {SHORT_KEYS.get(key, key) for key in common} | ({"track.model"} if track else set())
    for one in design.variations:
        if SHORT_KEYS.get(one.key, one.key) in fixed:
            raise BadInput(f"vary {one.text}: its key is set by another option")
    scenes = [load(scene, track, common | dict(pairs(design.settings(point)))) for point in design.points]
    identity = json.dumps([native, estimated, *figures, *(one.resolved() for one in scenes)])
    digest = hashlib.sha256(identity.encode()).hexdigest()
    stated = {"track": scenes[0].variant, "settings": {key: str(value) for key, value in sorted(common.items())}}
    options = {"native": native, "estimated": estimated, "for": [*figures]}
    _claim(folder, {"scene": scenes[0].name, **design.stated(), **stated, **options, "digest": digest})
    if keep_logs:
        make_folder(folder / "logs")
    cases = []
    for number, (loaded, point) in enumerate(zip(scenes, design.points, strict=True), 1):
        log = folder.absolute() / "logs" / f"{number}.mcap" if keep_logs else None
        name = ", ".join(design.settings(point))
        cases.append(
            Case(loaded.name, name, run_case, (loaded, native, estimated, log, wanted), loaded.run.stop, math.inf)
        )
    return Sweep(design, cases, tuple(one.text for one in wanted))


def _claim(folder: Path, definition: dict[str, Any]) -> None:
    """Make the folder of a sweep, with its definition; raises BadInput if it is that of another sweep."""
    file = folder / "sweep.json"
    try:
        held = json.loads(read_file(file, DOCUMENT))
        digest, about = held["digest"], f"of {held['scene']} over {value_text(held['vary'])}"
        other = _differences(held, definition)
    except (FileNotFoundError, NotADirectoryError):
        make_folder(folder)
        with atomic_write(file) as temporary:
            temporary.write_text(json.dumps(definition, indent=1), encoding="utf-8")
        return
    except (OSError, ValueError, LookupError, TypeError):
        raise BadInput(f"{path_text(file)} is not that of a sweep: choose another folder") from None
    if digest != definition["digest"]:
        raise BadInput(f"output {path_text(folder)}: holds another sweep, {about}: {other}: choose another folder")


def _differences(held: Mapping[str, Any], definition: Mapping[str, Any]) -> str:
    """Differences between two definitions of sweeps, as "track is 'rigid' there and 'flexible' here"."""
    compared = held.keys() & definition.keys() - {"settings", "digest"}
    pairs_of = [(name, held[name], definition[name]) for name in sorted(compared)]
    if isinstance(there := held.get("settings"), Mapping):
        here = definition["settings"]
        pairs_of += [(f"setting {key}", there.get(key, "not set"), here.get(key, "not set"))
                     for key in sorted({*there, *here})]  # fmt: skip
    found = [f"{name} is {value_text(a)} there and {value_text(b)} here" for name, a, b in pairs_of if a != b]
    return "; ".join(found) or "a setting, a file or cotrack itself has changed"


def run_case(
    scene: Scene,
    native: bool,
    estimated: bool | Literal["parts"],
    log: Path | None,
    wanted: Sequence[WantedFigure] = (),
) -> list[Row]:
    """Row of a run, whose log is deleted unless it has a path. Raises as ``simulate`` does."""
    with tempfile.TemporaryDirectory(prefix="cotrack-") as folder:
        path = log or Path(folder) / "run.mcap"
        result = simulate(scene, path, estimated=estimated, native=native, raise_faults=True)
        further, missing = figures_of_log(result["log"], wanted) if wanted and result["log"] else ({}, [])
    energy, error = result["energy"], result["error"] or {"message": ""}
    unknown = f"estimated error: not known, {error['message']}" if error["message"] else ""
    note = "; ".join(filter(None, (result["message"], unknown, *missing)))
    ok = result["status"] == "ok" and not summary.energy_warning(energy)
    known = _figures(result, energy, error)
    further = {key: value for key, value in further.items() if known.get(key.partition(",")[0]) != value}
    return [Row("", "", known | further | {"log": log and f"logs/{log.name}"}, ok, note)]


def _figures(result: Summary, energy: dict[str, Any] | None, error: dict[str, Any]) -> dict[str, Any]:
    """Figures of a summary by column, in their order."""
    checks, errors = result["checks"], error.get("observables", {})
    not_met = summary.missed_checks(result)
    return {
        "status": result["status"],
        "checks": "; ".join(summary.check_counts(result)),
        NOT_MET: ", ".join(not_met),
        **result["observables"],
        **{f"check {name}": check["value"] for name, check in checks.items()},
        **({"estimated error": error["total"]} if "total" in error else {}),
        **{f"estimated error of {part}": error[part] for part in PARTS if error.get(part) is not None},
        **{f"estimated error of {name}": one["total"] for name, one in errors.items()},
        **{f"estimated error of {name}, {one['unit']}": one["absolute"] for name, one in errors.items()},
        "energy residual": energy and energy["residual_relative"],
        "warnings": len(result["warnings"]) + len(result["validity"]) + len(result["passed_over"]),
        "wall_time": result["wall_time"],
    }


@dataclass(frozen=True)
class Sweep:
    """Cases of a sweep, and what is made of their rows."""

    TITLE: ClassVar[str] = "Sweep"
    design: Design
    cases: list[Case]
    asked: tuple[str, ...] = ()  # figures that the picture and the printed table are limited to

    def remark(self, rows: Sequence[Row]) -> str:
        """Text about a case as it finishes: its first figures, or why it failed."""
        (row,) = rows
        if row.figures.get("status") != "ok":
            return f": failed: {row.note}"
        values = {name: row.figures.get(name) for name in REPORTED}
        known = [name for name, value in values.items() if isinstance(value, float) and math.isfinite(value)]
        shown = known[:MAX_REMARKS]
        return ": " + ", ".join(f"{name.replace('_', ' ')} {values[name]:.5g} {UNITS[name]}" for name in shown)

    def table(self, rows: Sequence[Row], title: str = "") -> Table:
        """Table of varied keys, outcome, observables, values of checks, estimated error and energy residual."""
        missed = any(row.figures.get(NOT_MET) for row in rows)
        return self._table(rows, title, HIDDEN if missed else (*HIDDEN, NOT_MET))

    def whole_table(self, rows: Sequence[Row]) -> Table:
        """Table of all figures, SI units; errors by observable are RMS over time, relative and absolute."""
        return self._table(rows, "", ())

    def _table(self, rows: Sequence[Row], title: str, without: tuple[str, ...]) -> Table:
        """Table of all columns but those whose keys begin with one of the texts ``without``."""
        fullest_first = sorted(rows, key=lambda row: -len(row.figures))  # a case that was refused has no figures
        keys = dict.fromkeys(["status", *(key for row in fullest_first for key in row.figures), "note"])
        only = ("status", "checks", "note", *self.asked) if self.asked and without else ""
        columns = [Column(one.key, one.head, unit=one.unit) for one in self.design.variations]
        columns += [figure_column(key) for key in keys if key.startswith(only) and not key.startswith(without)]
        records = [
            {one.key: value.shown for one, value in zip(self.design.variations, point, strict=True)}
            | {"status": "failed", **row.cells()}
            for point, row in zip(self.design.points, rows, strict=True)
        ]
        sampled = f"Latin hypercube of {self.design.sample} points, seed {self.design.seed}"
        return Table.of_records(title, columns, records, (sampled,) if self.design.sample else ())

    def write(self, folder: Path, name: str, rows: Sequence[Row], title: str) -> list[Path]:
        """Write tables and picture, Parquet if pyarrow is installed; raises OSError, BadInput."""
        title, whole = f"{title} of {self.cases[0].item}", self.whole_table(rows)
        picture = draw(self.design, self._table(rows, "", HIDDEN), title)
        written = output_files.save_results(
            folder, name, self.table(rows, title), picture, {f"{name}.csv": whole.csv()}
        )
        with suppress(NotInstalled):
            content, parquet = whole.arrow(), folder / f"{name}.parquet"
            with atomic_write(parquet) as temporary:
                library("pyarrow.parquet").write_table(content, temporary)
            written.append(parquet)
        return written


def figure_column(key: str, form: str = "") -> Column:
    """Column of a figure; the key of an absolute error ends with its unit, as headings do."""
    unit, form = UNITS.get(key, ""), form or (".2g" if key in ("estimated error", "energy residual") else ".6g")
    return Column(key, f"{key}, {unit}" if unit else key, form, unit=unit or key.partition(", ")[2])
