"""Command ``check``: examine FMUs."""

from __future__ import annotations

import json
import sys
from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from fmus.vehicle import BadInput
from orchestrator.cli import common
from orchestrator.cli.common import narration

if TYPE_CHECKING:
    from orchestrator.fmu_check.instance import Verdict


def check(
    fmus: Annotated[list[Path], typer.Argument(metavar="FMU...", help="FMUs of FMI 2.0 or 3.0 for co-simulation")],
    step: Annotated[
        float | None,
        typer.Option("--step", metavar="H", help="communication step, s; default the FMU's own, else 1 ms"),
    ] = None,
    limit: Annotated[
        float, typer.Option("--limit", metavar="T", help="time limit of a check, s; 1.2 T for all that hang")
    ] = 100.0,
    as_json: Annotated[bool, typer.Option("--json", help="the last line on stdout is one JSON object")] = False,
) -> None:
    """Check any co-simulation FMUs of FMI 2.0 or 3.0: description, units, dependencies, states, steps,
    calls, memory, and what they leave behind in their process.

    Each check runs in a process of its own, so a crash or a hang of the FMU is a finding. The code of the FMU is run.
    The exit status is 1 if something is wrong.
    """
    from orchestrator.fmu_check import runner

    for name, value in (("--step", step), ("--limit", limit)):
        if value is not None and not 0.0 < value < float("inf"):
            raise BadInput(f"{name} {value:g}: must be a finite number greater than 0")
    for fmu in fmus:
        runner.require_fmu(fmu)
    results = {}
    for fmu in fmus:
        results[fmu] = runner.verdicts(fmu, step, limit, partial(_begin, fmu.name))
        if not as_json:
            _print_table(fmu, results[fmu])
    if as_json:
        print(json.dumps({"fmus": [_as_json(fmu, verdicts) for fmu, verdicts in results.items()]}))
    sys.exit(int(any(verdict.faults for verdicts in results.values() for verdict in verdicts.values())))


def _begin(fmu: str, name: str) -> None:
    narration.set_task(f"{fmu}: {name}")


def _print_table(fmu: Path, verdicts: Mapping[str, Verdict]) -> None:
    wrong = sum(bool(verdict.faults) for verdict in verdicts.values())
    print(f"{fmu}: " + (f"something is wrong in {wrong} of {len(verdicts)} checks" if wrong else "nothing is wrong"))
    for name, verdict in verdicts.items():
        print(f"  {name:{max(map(len, verdicts))}}  {verdict.result:14}  {common.plain(verdict.detail)}")


def _as_json(fmu: Path, verdicts: Mapping[str, Verdict]) -> dict[str, object]:
    checks = {
        name: {"result": verdict.result, "detail": verdict.detail, "faults": verdict.faults}
        for name, verdict in verdicts.items()
    }
    return {"file": str(fmu), "ok": not any(verdict.faults for verdict in verdicts.values()), "checks": checks}
