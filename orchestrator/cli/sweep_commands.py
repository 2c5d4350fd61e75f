"""Command ``sweep``: a scene with many settings, as a table and pictures."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from orchestrator.cli.common import SceneName, Settings, TrackOption, VehicleOption, with_vehicle
from orchestrator.cli.study_commands import Scheduler, conduct


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
    native: Annotated[bool, typer.Option("--native", help="use native FMUs; results have the same bits")] = False,
    estimate: Annotated[
        bool, typer.Option(help="estimate the errors by two coarser runs, in twice the time of the runs")
    ] = True,
    keep_logs: Annotated[bool, typer.Option("--keep-logs", help="keep the logs of all runs in DIR/logs")] = False,
    workers: Annotated[int, typer.Option("--workers", metavar="N", help="processes", min=1)] = 2,
    scheduler: Scheduler = None,
) -> None:
    """Run a scene with every combination of varied settings; write a table with a row for each run, and a picture.

    Values may have units: 20:40:3 kN. Started again with the same folder, the sweep continues where it was
    interrupted. Exit 1 if a run fails or leaves its energy balance open; checks that are not met are in the table.
    """
    from orchestrator.studies.parameter_sweep import plan
    from orchestrator.studies.variations import Design

    design = Design.of(vary, sample, seed)
    planned = plan(design, scene, output, track, with_vehicle(vehicle, settings), native, estimate, keep_logs)
    conduct("sweep", planned, planned.cases, output, workers, scheduler)
