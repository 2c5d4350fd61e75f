"""``python -m tests.mutation -o DIR``: plant faults one at a time in a copy and run its tests.

The nearest tests run first, then the default suite, then the long ones. Results are kept in ``DIR/faults.json`` and not
repeated.
"""

from __future__ import annotations

import json
import os
import random
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Annotated, Any

import typer

from fmus.vehicles.tables import BadInput
from orchestrator.cli import main
from orchestrator.results.table import Column, Table
from tests.mutation.areas import AREAS, ROOT, Area, known_faults, nearest
from tests.mutation.operators import Fault, faults

STAGES = {"nearest": ("-m", "not study and not benchmark"), "default": (), "long": ("-m", "long or study")}
SURVIVED = "survived"
COLUMNS = (Column("area", "area"), Column("place", "place"), Column("new", "fault"), Column("found", "found by"))
LIMIT = 3600.0  # s per stage: a fault that makes tests hang is noticed too


def chosen(count: int, seed: int) -> list[dict[str, Any]]:
    """Draw faults by area with a seed; faults that once survived come first."""
    draw = random.Random(seed)
    entries = [_entry(_area_of(file), file, fault) for file, fault in known_faults()]
    for area in AREAS:
        every = [(file, fault) for file in area.files() for fault in faults((ROOT / file).read_text(encoding="utf-8"))]
        entries += [_entry(area, *one) for one in draw.sample(every, max(1, round(area.share * count / 100)))]
    return entries


def _area_of(file: Path) -> Area:
    return next(area for area in AREAS if file in area.files())


def _entry(area: Area, file: Path, fault: Fault) -> dict[str, Any]:
    place = f"{file.as_posix()}:{fault.line}"
    return {"area": area.name, "file": file.as_posix(), "place": place, **fault._asdict(), "found": "", "stages": []}


def noticed(checkout: Path, entry: dict[str, Any], stages: tuple[str, ...]) -> None:
    """Plant a fault, run the stages that it has not survived yet, and restore the source."""
    place = checkout / entry["file"]
    source = place.read_text(encoding="utf-8")
    lines = source.splitlines(keepends=True)
    if lines[entry["line"] - 1].rstrip("\n") != entry["old"]:
        raise BadInput(f"{entry['place']} has changed: begin anew in another folder")
    lines[entry["line"] - 1] = f"{entry['new']}\n"
    place.write_text("".join(lines), encoding="utf-8")
    try:
        for stage in (stage for stage in stages if stage not in entry["stages"] and not entry["found"]):
            area = next(area for area in AREAS if area.name == entry["area"])
            which = nearest(Path(entry["file"]), area) if stage == "nearest" else []
            if _fails(checkout, [*STAGES[stage], *which]):
                entry["found"] = stage
            entry["stages"].append(stage)
    finally:
        place.write_text(source, encoding="utf-8")


def _fails(checkout: Path, arguments: list[str]) -> bool:
    command = [sys.executable, "-m", "pytest", "-x", "-p", "no:cacheprovider", *arguments]
    environment = {**os.environ, "PYTHONPATH": str(checkout)}
    try:
        done = subprocess.run(command, cwd=checkout, env=environment, capture_output=True, timeout=LIMIT)
    except subprocess.TimeoutExpired:
        return True
    return done.returncode not in (0, 5)  # 5: no test has these markers


def mutate(
    output: Annotated[Path, typer.Option("-o", "--output", metavar="DIR", help="the copy and what was found")],
    count: Annotated[int, typer.Option("--count", help="faults besides those that once survived", min=1)] = 100,
    seed: Annotated[int, typer.Option("--seed", help="of the draw")] = 1,
    area: Annotated[str, typer.Option("--area", metavar="TEXT", help="areas whose name has this in it")] = "",
    stage: Annotated[str, typer.Option("--until", metavar="STAGE", help="nearest, default or long")] = "long",
) -> None:
    """Plant faults and run the tests; exit 1 if a fault survives all stages."""
    if stage not in STAGES:
        raise BadInput(f"--until {stage}: must be one of {', '.join(STAGES)}")
    stages = tuple(STAGES)[: list(STAGES).index(stage) + 1]
    kept, checkout = output / "faults.json", output / "checkout"
    if kept.exists():
        entries = json.loads(kept.read_text(encoding="utf-8"))
    else:
        entries = chosen(count, seed)
        checkout.mkdir(parents=True)
        listed = subprocess.run(["git", "ls-files"], cwd=ROOT, capture_output=True, text=True, check=True).stdout
        for name in listed.splitlines():
            (checkout / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(ROOT / name, checkout / name)
    for k, entry in enumerate(entries, 1):
        if area in entry["area"] and not entry["found"] and set(stages) - {*entry["stages"]}:
            print(f"{k}/{len(entries)} {entry['place']}: {entry['new'].strip()}", file=sys.stderr, flush=True)
            noticed(checkout, entry, stages)
        kept.write_text(json.dumps(entries, indent=1), encoding="utf-8")
    asked = [entry for entry in entries if area in entry["area"]]
    rows = [{**one, "new": f"`{one['new'].strip()}`", "found": one["found"] or SURVIVED} for one in asked]
    print(Table.of_records("", COLUMNS, rows).markdown())
    left = sum(not one["found"] for one in asked)
    print(f"{len(asked)} faults, {left} survived {', '.join(stages)}", file=sys.stderr)
    sys.exit(1 if left else 0)


app = typer.Typer(add_completion=False, pretty_exceptions_enable=False, rich_markup_mode=None)
app.command()(mutate)

if __name__ == "__main__":
    main(app)
