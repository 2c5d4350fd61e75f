"""Largest step and gap that the vehicle crosses at a crawl, with a friction that grips.

It has crossed when its hull is beyond the obstacle at the end; a gap also without a touch of the hull, and, as another
limit, with it.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from orchestrator.results.run_data import RunData
from orchestrator.results.table import Column
from orchestrator.scene.scene import Scene
from orchestrator.studies import Case, files
from orchestrator.studies.mobility import theory
from orchestrator.studies.mobility.finding import Finding, bisect, draw_limits, limit_found
from orchestrator.studies.mobility.trial import Trial, Vehicle, failure_of, trial, vehicle_of
from orchestrator.studies.row import Row

NAME = "step_and_gap"
TITLE = "Largest step and gap"
FRICTION = 1.0  # of tracks that grip the edge
SPEED = 0.35  # of the pace
HALVINGS = 6
STEP, GAP, ON_HULL = OBSTACLES = "step", "gap", "gap, on the hull"
ALLOWED = {"allow": ["penetration", "tooth_jump"]}  # of edges under single links; reported as notes
AHEAD = 0.3  # of the contact length: the obstacle's distance from the tracks
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
    " the ends of its tracks. Springs and chain give way over an edge, and friction pulls a vehicle out whose nose has"
    " dropped: it may cross more.",
)


def cases(scene: str, quick: bool) -> list[Case]:
    """Cases: step and gap."""
    halvings = HALVINGS - 2 if quick else HALVINGS
    return [Case(NAME, name, largest, (scene, name, halvings), 60.0) for name in OBSTACLES]


def largest(scene: str, obstacle: str, halvings: int) -> list[Row]:
    """Row of the limit of an obstacle."""
    vehicle = vehicle_of(scene)
    bracket = (theory.largest_step if obstacle == STEP else theory.largest_gap)(vehicle.table)
    warned: dict[float, str] = {}

    def passes(size: float) -> str:
        def judged(run: Trial) -> str:
            warned[size] = run.doubts
            return _failure(run, vehicle, obstacle, size)

        return failure_of(_crossing(vehicle, obstacle, size), judged)

    limit = bisect(passes, 0.7 * bracket.low, 2.0 * bracket.high, halvings)
    figures = {
        "passed": limit.passed,
        "failed": limit.failed,
        "low": bracket.low,
        "high": bracket.high,
        "runs": limit.runs,
    }
    crossed = f"crossed: {warned[limit.passed]}" if warned.get(limit.passed) else ""
    reached = not limit.failed < 0.9 * bracket.low  # the limit is between the value that passed and that which failed
    return [Row("", "", figures, reached, "; ".join(filter(None, [limit.reason, crossed])))]


def _far_edge(vehicle: Vehicle, obstacle: str, size: float) -> float:
    """Place of the far edge, m."""
    return vehicle.front + AHEAD * vehicle.length + (0.0 if obstacle == STEP else size)


def _crossing(vehicle: Vehicle, obstacle: str, size: float) -> Scene:
    """Scene of a trial with an obstacle of a size."""
    speed, unit = SPEED * vehicle.pace, vehicle.time
    edge = _far_edge(vehicle, obstacle, size)
    shape: dict[str, Any] = {"step": {"x": [edge], "rise": size}}
    if obstacle != STEP:
        shape = {"trench": {"start": edge - size, "width": size, "depth": 0.5 * vehicle.length}}
    way = edge + 2.0 * vehicle.length
    drive = {"mode": "speed", "speed": vehicle.sprocket(speed), "ramp_time": unit}
    return trial(
        vehicle, f"{obstacle} of {size:.3g} m", 1.3 * way / speed + 2.0 * unit, friction=FRICTION,
        ground={"hull": True, **shape}, drive=drive, run=ALLOWED,
    )  # fmt: skip


def _failure(run: RunData, vehicle: Vehicle, obstacle: str, size: float) -> str:
    """Reason why a vehicle does not cross; empty if it does."""
    beyond = _last(run, "chassis.chassis.position.x") - _far_edge(vehicle, obstacle, size)
    if beyond < 0.2 * vehicle.length:
        pitch = _last(run, "chassis.pitch")
        return f"at the end its hull is {beyond:.2f} m beyond the edge, at a pitch of {pitch:.2f} rad"
    touching = float(run.signal("chassis.ground.force.z")[1].max())
    return f"its hull touches an edge with {1e-3 * touching:.3g} kN" if obstacle == GAP and touching > 0.0 else ""


def _last(run: RunData, signal: str) -> float:
    return float(run.signal(signal)[1][-1])


def draw(rows: Sequence[Row]) -> files.Picture:
    """Largest step and gap."""
    return draw_limits(rows, "passed", "largest that is crossed, m", width=6.0)


def find(rows: Sequence[Row]) -> list[Finding]:
    """Largest step and gap."""
    return [limit_found(f"largest {row.case}", row, "passed", "m") for row in rows]
