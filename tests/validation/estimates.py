"""Coverage of the error estimate: the error that runs state of themselves beside that from a run in short steps.

A run with an eighth of the scene's steps stands for the truth; its own error, as of order 1, is added to differences.
Each scene runs at its own steps, at twice and at half of these. ``CALIBRATION`` has the scenes by which the rules of
the estimate were chosen, ``HELD_OUT`` others: scenes, vehicles, soils, speeds, links.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from orchestrator.execution.estimate import companions, estimate
from orchestrator.results import output_files
from orchestrator.results.difference import differences_of_logs
from orchestrator.results.table import Column, Table
from orchestrator.scene.kinds import Scene
from orchestrator.scene.scene import load
from orchestrator.studies import Case, Row
from orchestrator.studies.error_runtime import record

__all__ = ["TITLE", "cases", "table", "write"]

TITLE = "Stated errors beside true ones"
LASTS = "a quarter of an hour of two cores"

FINER = 8  # times shorter are the steps of the truth
MAX_RATIO = 3.0  # true/stated
SOON = ("drive.ramp_start=0.1", "drive.ramp_time=0.6")
CALIBRATION = (  # scene, links, end in s, settings
    ("released_chain", "flexible", 0.4),
    ("straight", "rigid", 3.0),
    ("turn", "rigid", 1.5, *SOON),
    ("soft_ground", "rigid", 2.0),
    ("brake_turn", "rigid", 1.6),
)
SHORT = ("drive.ramp_start=0.05", "drive.ramp_time=0.5")
HALF = ("symmetric=true", *SHORT)
HELD_OUT = (
    ("straight", "rigid", 0.8, *HALF, "drive.speed=5", "vehicle.contact.ground.friction=0.3"),
    ("straight", "flexible", 0.8, *HALF, "drive.speed=-6"),
    ("crawler", "rigid", 0.8, *HALF, "drive.speed=-2", "vehicle.contact.ground.friction=0.4"),
    ("robot", "rigid", 0.8, "vehicle.contact.ground.friction=0.4",
     "drive.left.speed_points=[[0.05,0],[0.6,8]]", "drive.right.speed_points=[[0.05,0],[0.6,5]]"),
    ("straight", "rigid", 0.8, *HALF, "vehicle=leopard2", "drive.speed=6"),
    ("released_chain", "rigid", 0.4, "vehicle.track.mass=30"),
    ("straight", "rigid", 0.8, *HALF, "vehicle.track.tension=25 kN", "vehicle.track.mass=25", "drive.speed=9"),
    ("tank", "rigid", 0.8, *HALF, "drive.speed=-5", "vehicle.contact.ground.friction=0.35"),
    ("turn", "rigid", 0.8, *SHORT, "drive.left.speed=5", "drive.right.speed=7", "vehicle.contact.ground.friction=0.4"),
    ("straight", "rigid", 0.8, *HALF, "vehicle=robot", "drive.speed=8", "run.step=0.5 ms", "track.step=0.5 ms"),
    ("soft_ground", "rigid", 0.8, *SHORT, "drive.speed=5"),
    ("marder", "rigid", 0.8,
     "drive.left.speed_points=[[0.05,0],[0.6,4]]", "drive.right.speed_points=[[0.05,0],[0.6,4]]"),
    ("spinning_loop", "rigid", 0.3),
    ("straight", "flexible", 0.8, *HALF, "drive.speed=9", "vehicle.track.tension=20 kN"),
    ("robot", "rigid", 1.6),
    ("tank", "rigid", 1.6, "drive.ramp_start=0.1", "drive.ramp_time=0.8"),
    ("crawler", "rigid", 1.6, *SOON),
)  # fmt: skip


def cases(quick: bool) -> list[Case]:
    """Cases: a scene each, with both of its steps."""
    sets = (("calibration", CALIBRATION), ("held out", HELD_OUT))
    return [
        Case(f"{scene}, {links}", ", ".join((part, *settings)), covered, (part, scene, links, stop, settings), 60.0)
        for part, entries in sets
        for scene, links, stop, *settings in entries[: 1 if quick else None]
    ]


def covered(part: str, scene: str, links: str, stop: float, settings: Sequence[str]) -> list[Row]:
    """Rows of a scene at twice its steps and at its own; a run without an estimate has a note."""
    loaded = load(scene, links, [*settings, f"run.stop={stop}", "expect={}"])
    internal = min(loaded.track.step or loaded.run.step, loaded.run.step)
    own, finer, finest = (_with_steps(loaded, internal, times) for times in (1, 1 / 2, 1 / FINER))
    truth, coarse = Path(record(finest)["log"]), companions(own, internal, stop, 2).twice
    return [_row(part, run, truth, times) for times, run in ((2, coarse), (1, own), (1 / 2, finer))]


def _with_steps(scene: Scene, internal: float, times: float) -> Scene:
    """The scene with so many times its steps, and records of links at the same instants."""
    run = {"step": times * scene.run.step, "outputs": 1, "links": round(scene.links_every / times)}
    track = scene.track.model_copy(update={"step": times * internal})
    return scene.model_copy(update={"run": scene.run.model_copy(update=run), "track": track})


def _row(part: str, scene: Scene, truth: Path, times: float) -> Row:
    case = f"H = {scene.run.step * 1e3:g} ms"
    figures: dict[str, Any] = {"part": part, "step": scene.run.step, "ratios": {}, "before": {}}
    summary = record(scene)
    log = Path(str(summary.get("log")))
    made: list[Path] = []

    def coarser(companion: Scene, _: Path) -> Mapping[str, Any]:
        outcome = record(companion)
        made.append(Path(str(outcome.get("log"))))
        return outcome

    stated = estimate(scene, log, summary, coarser) if summary["status"] == "ok" else {"total": None, **summary}
    if stated["total"] is None:
        return Row("", case, figures, None, stated["message"])
    raised = 1.0 / (1.0 - 1.0 / (FINER * times))
    true = {name: raised * one.relative for name, one in differences_of_logs(log, truth).items() if one.decisive}
    earlier = {name: one.relative / math.sqrt(3.0) for name, one in differences_of_logs(made[0], log).items()}
    known = [name for name in true if name in stated["observables"] and stated["observables"][name]["total"] > 0.0]
    figures |= {
        "true": max(true.values()),
        "stated": stated["total"],
        "ratio": max(true.values()) / stated["total"],
        "ratio_before": max(true.values()) / max(earlier[name] for name in true),
        "ratios": {name: true[name] / stated["observables"][name]["total"] for name in known},
        "before": {name: true[name] / earlier[name] for name in known},
    }
    worst = max(figures["ratios"], key=lambda name: figures["ratios"][name])
    figures |= {"worst": worst, "worst_ratio": figures["ratios"][worst]}
    return Row("", case, figures, max(figures["ratio"], figures["worst_ratio"]) <= MAX_RATIO)


def coverage(ratios: Iterable[float]) -> str:
    """Sentence on true over stated errors."""
    values = np.array([ratio for ratio in ratios if math.isfinite(ratio)])
    if not len(values):
        return "none"
    over = np.quantile(1.0 / values[values > 0.0], (0.5, 0.9))
    return (
        f"{len(values)}: true/stated at most 1 in {np.mean(values <= 1.0):.0%}, largest {values.max():.2f};"
        f" stated/true median {over[0]:.1f}, 90 % below {over[1]:.1f}"
    )


def table(rows: Sequence[Row], title: str = "") -> Table:
    """Table of the rows, and the coverage of both sets, before and now, by run and by observable."""
    columns = (
        Column("item", "scene"),
        Column("case", "case"),
        Column("part", "set"),
        Column("true", "true", ".2e"),
        Column("stated", "stated", ".2e"),
        Column("ratio", "true/stated", ".2f"),
        Column("ratio_before", "before", ".2f"),
        Column("worst", "observable with the largest"),
        Column("worst_ratio", "true/stated", ".2f"),
        Column("note", "note"),
    )
    notes = []
    for part in dict.fromkeys(row["part"] for row in rows if "part" in row.figures):
        mine = [row for row in rows if row.figures.get("part") == part]
        for when, run, each in (("before", "ratio_before", "before"), ("now", "ratio", "ratios")):
            notes.append(f"- {part}, {when}, runs: {coverage(row.figures.get(run, math.nan) for row in mine)}")
            notes.append(f"- {part}, {when}, observables: {coverage(r for row in mine for r in row[each].values())}")
    return Table.of_records(title, columns, [row.cells() for row in rows], tuple(notes))


def write(folder: Path, name: str, rows: Sequence[Row], title: str) -> list[Path]:
    """Write the table."""
    return output_files.save_results(folder, name, table(rows, title))
