"""Largest step and gap that the vehicle crosses at a crawl, with a friction that grips.

It has crossed when its hull is beyond the obstacle at the end.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from orchestrator.results.run_data import RunData
from orchestrator.results.table import Column
from orchestrator.studies import Case, files
from orchestrator.studies.mobility import theory
from orchestrator.studies.mobility.bisection import bisect
from orchestrator.studies.mobility.finding import Finding
from orchestrator.studies.mobility.trial import Vehicle, recorded, trial, vehicle_of
from orchestrator.studies.row import Row

NAME = "step_and_gap"
TITLE = "Largest step and gap"
FRICTION = 1.0  # of tracks that grip the edge
SPEED = 0.35  # of the pace
HALVINGS = 5
AHEAD = 0.4  # of the contact length: the obstacle's distance from the sprocket axle
COLUMNS = (
    Column("case", "obstacle"),
    Column("passed", "crossed, m", ".3f"),
    Column("failed", "not crossed, m", ".3f"),
    Column("low", "theory from, m", ".3f"),
    Column("high", "to, m", ".3f"),
    Column("runs", "runs"),
    Column("ok", "ok"),
    Column("note", "why not"),
)
NOTES = (
    f"Friction {FRICTION:g}. Theory: statics of a rigid body that stands on its outer road wheels, or on the wheels at"
    " the ends of its tracks. Wider gaps are crossed if friction pulls a vehicle out whose nose has dropped.",
)


def cases(scene: str, quick: bool) -> list[Case]:
    """Cases: step and gap."""
    halvings = HALVINGS - 2 if quick else HALVINGS
    return [Case(NAME, name, largest, (scene, name, halvings), 60.0) for name in ("step", "gap")]


def largest(scene: str, obstacle: str, halvings: int) -> list[Row]:
    """Row of the limit of an obstacle."""
    vehicle = vehicle_of(scene)
    bracket = (theory.largest_step if obstacle == "step" else theory.largest_gap)(vehicle.table)
    start = AHEAD * vehicle.length

    def passes(size: float) -> str:
        shape: dict[str, Any] = {"step": {"x": [start], "rise": size}}
        if obstacle == "gap":
            shape = {"trench": {"start": start, "width": size, "depth": 0.5 * vehicle.length}}
        return _failure(vehicle, shape, start + (size if obstacle == "gap" else 0.0), f"{obstacle} of {size:.3g} m")

    limit = bisect(passes, 0.7 * bracket.low, 1.3 * bracket.high, halvings)
    figures = {
        "passed": limit.passed,
        "failed": limit.failed,
        "low": bracket.low,
        "high": bracket.high,
        "runs": limit.runs,
    }
    within = limit.failed >= 0.9 * bracket.low and (obstacle == "gap" or limit.passed <= 1.1 * bracket.high)
    return [Row("", "", figures, within, limit.reason)]


def _failure(vehicle: Vehicle, shape: dict[str, Any], beyond: float, title: str) -> str:
    """Reason why a vehicle does not cross; empty if it does."""
    speed, unit = SPEED * vehicle.pace, vehicle.time
    way = beyond + 2.0 * vehicle.length  # of the sprocket axle
    drive = {"mode": "speed", "speed": vehicle.sprocket(speed), "ramp_time": unit}
    end = 1.3 * way / speed + 2.0 * unit
    ground, allowed = {"hull": True, **shape}, {"allow": ["penetration"]}
    run_scene = trial(vehicle, title, end, friction=FRICTION, ground=ground, drive=drive, run=allowed)
    try:
        with recorded(run_scene) as run:
            place, pitch = _last(run, "chassis.chassis.position.x"), _last(run, "chassis.pitch")
    except RuntimeError as failure:
        return str(failure)
    if place > beyond + 0.2 * vehicle.length:
        return ""
    return f"at the end its hull is {place - beyond:.2f} m beyond the edge, at a pitch of {pitch:.2f} rad"


def _last(run: RunData, signal: str) -> float:
    return float(run.signal(signal)[1][-1])


def draw(rows: Sequence[Row]) -> files.Picture:
    """Bars of the limits, with theory's brackets."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(6.0, 3.6), layout="constrained", dpi=110)
    pane = figure.subplots()
    pane.bar([row.case for row in rows], [row["passed"] for row in rows], color="C0", width=0.5)
    for k, row in enumerate(rows):
        pane.plot([k, k], [row["low"], row["high"]], color="0.2", marker="_", ms=14, label="theory" if k == 0 else None)
    pane.set(ylabel="largest that is crossed, m")
    pane.legend(fontsize=8)
    return figure


def find(rows: Sequence[Row]) -> list[Finding]:
    """Largest step and gap."""
    return [
        Finding(f"largest {row.case}", row["passed"], "m", row["low"], row["high"], f"not {row['failed']:.2f} m")
        for row in rows
    ]
