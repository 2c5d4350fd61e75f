"""Gradeability: the steepest slope that the vehicle climbs at a steady crawl, on hard ground and on soils.

On hard ground the vehicle starts on the slope and moves up it at the end. On soil the slope begins ahead of it, and it
gets both tracks onto the slope in the time of fourteen contact lengths of chain.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from fmus.soils import law_of
from orchestrator.results.run_data import RunData, Window
from orchestrator.results.table import Column
from orchestrator.studies import Case, files
from orchestrator.studies.mobility import theory
from orchestrator.studies.mobility.drawbar import SOILS
from orchestrator.studies.mobility.finding import Finding, Limit, bisect, draw_limits, limit_found
from orchestrator.studies.mobility.trial import Trial, Vehicle, failure_of, trial, vehicle_of
from orchestrator.studies.row import Row

NAME = "grade"
TITLE = "Gradeability"
FRICTIONS = (0.3, 0.6, 0.8)
MOVES = 0.1  # of the chain's speed: a vehicle that is slower at the end does not climb
HALVINGS = 5
CRAWL = 0.5  # of the pace
BEND = 4.0  # contact lengths over which level soil turns into the slope
COLUMNS = (
    Column("case", "ground"),
    Column("climbed", "climbed, %", ".1f"),
    Column("failed", "not climbed, %", ".1f"),
    Column("low", "theory from, %", ".1f"),
    Column("high", "to, %", ".1f"),
    Column("runs", "runs"),
    Column("ok", "ok"),
    Column("note", "why not"),
)
NOTES = (
    "Theory: the friction on hard ground; on soil the thrust of the tracks at full slip under the weight normal to the"
    " slope, less compaction. The least value is that of links which shear alone at a slip of 90 %.",
    "A hull in the soil has no force; it is warned of.",
)


def cases(scene: str, quick: bool) -> list[Case]:
    """Cases: hard ground of each friction, and each soil."""
    halvings = HALVINGS - 2 if quick else HALVINGS
    hard = [Case(NAME, f"friction {mu:g}", on_hard_ground, (scene, mu, halvings), 40.0) for mu in FRICTIONS]
    soft = [Case(NAME, soil, on_soil, (scene, soil, halvings), 60.0) for soil in SOILS]
    return [*hard[: 1 if quick else None], *soft[: 1 if quick else None]]


def on_hard_ground(scene: str, friction: float, halvings: int) -> list[Row]:
    """Row of the limit on hard ground of a friction."""
    vehicle = vehicle_of(scene)
    unit, speed = vehicle.time, CRAWL * vehicle.pace

    def passes(slope: float) -> str:
        ramp = 20.0 * unit if slope > 0.9 * friction else 8.0 * unit  # little friction is left to accelerate
        drive = {"mode": "speed", "speed": vehicle.sprocket(speed), "ramp_time": ramp}
        end = ramp + 8.0 * unit
        run_scene = trial(
            vehicle, f"grade of {slope:.4g}", end, friction=friction, ground={"grade": slope}, drive=drive
        )

        def judged(run: RunData) -> str:
            t, x = run.signal("chassis.distance", Window(end - 2.0 * unit, end))
            climbed, chain = float((x[-1] - x[0]) / (t[-1] - t[0])), f"its chain at {speed:.2g} m/s"
            return "" if climbed > MOVES * speed else f"at the end it moves at {climbed:.2g} m/s, {chain}"

        return failure_of(run_scene, judged)

    return [_row(bisect(passes, 0.7 * friction, 1.06 * friction, halvings), theory.Bracket(0.9 * friction, friction))]


def on_soil(scene: str, soil: str, halvings: int) -> list[Row]:
    """Row of the limit on a soil."""
    vehicle = vehicle_of(scene)
    unit, speed, length = vehicle.time, vehicle.pace, vehicle.length
    bracket = _bracket(vehicle, soil)
    start, ramp = vehicle.front + 0.1 * length, 4.0 * unit
    end, warned = ramp + (BEND + 10.0) * length / speed, dict[float, str]()

    def passes(slope: float) -> str:
        ground = {"soil": {"name": soil}, "grade": slope, "incline_start": start, "incline_length": BEND * length}
        drive = {"mode": "speed", "speed": vehicle.sprocket(speed), "ramp_time": ramp}

        def judged(run: Trial) -> str:
            warned[slope] = run.doubts
            short = start + (BEND + 0.5) * length - float(run.signal("chassis.chassis.position.x")[1][-1])
            return f"at the end its middle is {short:.2f} m short of the slope" if short > 0.0 else ""

        title, allowed = f"grade of {slope:.4g} on {soil}", {"allow": ["belly"]}  # a hull in the soil has no force
        return failure_of(trial(vehicle, title, end, ground=ground, drive=drive, run=allowed), judged)

    limit = bisect(passes, 0.25 * bracket.high, 1.1 * bracket.high, halvings)
    return [_row(limit, bracket, warned.get(limit.passed, ""))]


def _bracket(vehicle: Vehicle, soil: str) -> theory.Bracket:
    """Slopes at which theory's least and largest pull at full slip equal the weight's component."""
    track = vehicle.table.track
    law = law_of(soil, track.pitch, track.width)

    def slope(slip: float, largest: bool) -> float:
        angle = 0.0
        for _ in range(50):  # pull = weight sin(angle), with the load weight cos(angle)
            pull = theory.drawbar(vehicle.table, law, vehicle.weight * math.cos(angle), slip)
            angle = math.asin(min((pull.high if largest else pull.low) / vehicle.weight, 1.0))
        return math.tan(angle)

    return theory.Bracket(slope(0.9, False), slope(1.0, True))


def _row(limit: Limit, bracket: theory.Bracket, warned: str = "") -> Row:
    figures = {
        "climbed": 100.0 * limit.passed,
        "failed": 100.0 * limit.failed,
        "low": 100.0 * bracket.low,
        "high": 100.0 * bracket.high,
        "runs": limit.runs,
    }
    note = "; ".join(filter(None, [limit.reason, f"climbed with {warned}" if warned else ""]))
    return Row("", "", figures, limit.failed >= bracket.low and limit.passed <= bracket.high, note)


def draw(rows: Sequence[Row]) -> files.Picture:
    """Steepest slope by ground."""
    return draw_limits(rows, "climbed", "slope, %")


def find(rows: Sequence[Row]) -> list[Finding]:
    """Steepest slope by ground."""
    return [limit_found(f"gradeability, {row.case}", row, "climbed", "%") for row in rows]
