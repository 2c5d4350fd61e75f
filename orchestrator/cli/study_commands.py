"""Commands of many runs, with tables and figures: ``study``, and ``sweep`` of a scene with many settings."""

from __future__ import annotations

import math
import sys
from collections.abc import Sequence
from inspect import signature
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Annotated, NoReturn

import typer

from fmus.vehicles.tables import BadInput
from orchestrator.cli.common import (
    ClockOption,
    EstimateOption,
    From,
    MapOption,
    NativeOption,
    PartsOption,
    SceneName,
    Settings,
    ShiftOption,
    To,
    TrackOption,
    VehicleOption,
    estimated,
    measured_file,
    with_vehicle,
)

if TYPE_CHECKING:
    from orchestrator.studies import Case
    from orchestrator.studies.parameter_sweep import Sweep

Output = Annotated[Path | None, typer.Option("-o", "--output", metavar="DIR", help="folder for tables and figures")]
Quick = Annotated[bool, typer.Option("--quick", help="fewer cases, below five minutes on two cores")]
Workers = Annotated[
    int | None, typer.Option("--workers", metavar="N", help="processes; default 2, or 1 if runs are timed", min=1)
]
Scheduler = Annotated[
    str | None, typer.Option("--scheduler", metavar="ADDRESS", help="Dask scheduler, instead of local processes")
]


def study(
    name: Annotated[str | None, typer.Argument(metavar="[NAME]", help="default: list the studies")] = None,
    output: Output = None,
    scene: Annotated[
        str | None, typer.Argument(metavar="[SCENE]", help="for studies of a scene; default straight")
    ] = None,
    quick: Quick = False,
    workers: Workers = None,
    scheduler: Scheduler = None,
) -> None:
    """Run many cases of a scene; write tables and figures.

    Exit 1 if a row misses its tolerance. Started again with the same folder, the study continues where it was
    interrupted.
    """
    from orchestrator import studies

    if name is None:
        for known, about in studies.STUDIES.items():
            print(f"{known:16} {about}")
        return
    module = studies.study_module(name)
    folder = folder_of(name, output)
    if scene is not None and "scene" not in signature(module.cases).parameters:
        raise BadInput(f"study {name} takes no scene")
    cases = module.cases(quick, scene) if scene is not None else module.cases(quick)
    timed = hasattr(module, "WORKERS")  # one run at a time
    conduct(name, module, cases, folder, workers or (1 if timed else 2), scheduler)


def folder_of(name: str, output: Path | None) -> Path:
    """Create the folder of a study's results; raises BadInput."""
    from orchestrator.scene.products import make_folder

    if output is None:
        raise BadInput(f"study {name}: -o DIR says where its tables and figures go")
    make_folder(output)
    return output


def conduct(
    name: str, module: ModuleType | Sweep, cases: Sequence[Case], output: Path, workers: int, scheduler: str | None
) -> NoReturn:
    """Run the cases of a study, write its files, print its table and exit; raises BadInput."""
    from orchestrator.studies import pool
    from orchestrator.studies.parameter_sweep import NOT_MET
    from orchestrator.studies.pool import Store, finished_cases

    try:
        done = finished_cases(len(cases), getattr(module, "remark", lambda rows: ""))
        rows = pool.run(cases, workers, scheduler, Store(output / "cases"), done)
        files = module.write(output, name, rows, module.TITLE)
    except OSError as error:
        raise BadInput(f"the folder {output} cannot be written: {error}") from None
    print(module.table(rows).markdown())
    for file in files:
        print(file)
    failures = [row for row in rows if row.ok is False]
    missed = sum(bool(row.figures.get(NOT_MET)) for row in rows)
    checks = f", {missed} miss checks of the scene" if missed else ""
    print(f"{len(rows)} rows, {len(failures)} not as they should be{checks}", file=sys.stderr)
    for row in failures:
        print(f"cotrack: {row.item}: {row.case}: {row.note or 'misses its tolerance'}", file=sys.stderr)
    sys.exit(1 if failures else 0)


def sweep(
    scene: SceneName,
    vary: Annotated[
        list[str],
        typer.Option(
            "--vary", metavar="KEY=VALUES", help="x,y,z: these; a:b:n: n from a to b; a:b: sampled; repeatable"
        ),
    ],
    output: Annotated[Path, typer.Option("-o", "--output", metavar="DIR", help="folder for tables and picture")],
    track: TrackOption = None,
    settings: Settings = None,
    vehicle: VehicleOption = None,
    sample: Annotated[
        int | None, typer.Option("--sample", metavar="N", help="points of a Latin hypercube over the ranges a:b")
    ] = None,
    seed: Annotated[int, typer.Option("--seed", metavar="S", help="of the Latin hypercube")] = 0,
    native: NativeOption = False,
    estimate: EstimateOption = True,
    estimate_parts: PartsOption = False,
    keep_logs: Annotated[bool, typer.Option("--keep-logs", help="keep the logs of all runs in DIR/logs")] = False,
    workers: Annotated[int, typer.Option("--workers", metavar="N", help="processes", min=1)] = 2,
    scheduler: Scheduler = None,
    figures: Annotated[
        list[str] | None,
        typer.Option("--for", metavar="FIGURE", help="a measure, an analysis, or max:SIGNAL, as columns; by commas"),
    ] = None,
) -> None:
    """Run a scene with every combination of varied settings; write a table with a row for each run, and a picture.

    Values may have units: 20:40:3 kN, or 20,30,40 kN. Started again with the same folder, the sweep continues where it
    was interrupted. Exit 1 if a run fails or leaves its energy balance open; checks that are not met are in the table.
    """
    from orchestrator.studies.parameter_sweep import plan
    from orchestrator.studies.variations import Design

    design = Design.of(vary, sample, seed)
    common = with_vehicle(vehicle, settings)
    planned = plan(
        design, scene, output, track, common, native, estimated(estimate, estimate_parts), keep_logs, figures or ()
    )
    conduct("sweep", planned, planned.cases, output, workers, scheduler)


def fit(
    scene: SceneName,
    data: Annotated[
        list[str],
        typer.Option(
            "--data",
            metavar="[SCENE=]FILE",
            help="measured signals, of this or another scene: .csv, .parquet, .mf4, .tdms, a bag, or a log; repeatable",
        ),
    ],
    mapped: MapOption,
    free: Annotated[
        list[str], typer.Option("--free", metavar="KEY[=FROM:TO]", help="number to fit, and its range; repeatable")
    ],
    output: Annotated[Path, typer.Option("-o", "--output", metavar="DIR", help="folder for tables, picture and scene")],
    track: TrackOption = None,
    settings: Settings = None,
    vehicle: VehicleOption = None,
    clock: ClockOption = "",
    shift: ShiftOption = "0",
    part: Annotated[
        str, typer.Option("--part", metavar="NAME", help="component to step alone; SCENE is the log with its inputs")
    ] = "",
    scan: Annotated[
        int, typer.Option("--scan", metavar="N", help="points of the ranges that are tried as starts", min=0)
    ] = 0,
    noise: Annotated[
        list[str] | None,
        typer.Option("--noise", metavar="SIGNAL=SIZE", help="standard deviation of a sample, in the signal's unit"),
    ] = None,
    start: From = -math.inf,
    end: To = math.inf,
    native: NativeOption = False,
    workers: Annotated[int, typer.Option("--workers", metavar="N", help="processes", min=1)] = 1,
) -> None:
    """Fit numbers of a scene so that its run agrees with measured signals; tell how sure they are.

    Exit 1 if the first line says "no fit". Started again with the same folder, it continues where it was interrupted.
    """
    from orchestrator.studies.fit import fit as fitted

    source = measured_file(Path(data[0]), mapped, clock, shift)
    assert source is not None
    found = fitted(
        scene, data, source.columns, free, output, track=track, settings=with_vehicle(vehicle, settings), part=part,
        clock=clock, shift=shift, noise=dict(map(_noise, noise or ())), scan=scan, start=start, end=end,
        native=native, workers=workers,
    )  # fmt: skip
    print(found.verdict)
    print(found.table.markdown())
    print(found.residuals.markdown())
    for path in found.files:
        print(path)
    sys.exit(0 if found.ok else 1)


def _noise(text: str) -> tuple[str, float]:
    signal, _, size = text.partition("=")
    try:
        number = float(size)
    except ValueError:
        number = math.nan
    if not signal or not 0.0 < number < math.inf:
        raise BadInput(f"--noise {text}: must be SIGNAL=SIZE, a size above 0 in the unit of the signal")
    return signal, number


def sensitivity(
    scene: SceneName,
    output: Annotated[Path, typer.Option("-o", "--output", metavar="DIR", help="folder for tables and picture")],
    keys: Annotated[
        list[str] | None, typer.Option("--of", metavar="KEY", help="number, repeatable; default all of the vehicle")
    ] = None,
    track: TrackOption = None,
    settings: Settings = None,
    vehicle: VehicleOption = None,
    native: NativeOption = False,
    workers: Annotated[int, typer.Option("--workers", metavar="N", help="processes", min=1)] = 2,
    figures: Annotated[
        list[str] | None,
        typer.Option("--for", metavar="FIGURE", help="a measure, an analysis, or max:SIGNAL, as of sweep; by commas"),
    ] = None,
) -> None:
    """Tell what one per cent of each number of a vehicle does to the figures of a run; write tables and a picture.

    Started again with the same folder, it continues where it was interrupted.
    """
    from orchestrator.studies import sensitivity as derivatives

    found, files = derivatives.sensitivity(
        scene, output, keys or (), track=track, settings=with_vehicle(vehicle, settings), figures=figures or (),
        native=native, workers=workers,
    )  # fmt: skip
    print(found.table().markdown())
    for path in files:
        print(path)
