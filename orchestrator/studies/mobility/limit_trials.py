"""Largest slope, step and gap that the vehicle passes, found by bisection.

Gradeability: the steepest slope that it climbs at a steady crawl, on hard ground and on soils. On hard ground it starts
on the slope and moves up it at the end. On soil the slope begins ahead of it, and it gets both tracks onto the slope in
the time of fourteen contact lengths of chain.

Steps and gaps are crossed at a crawl, with a friction that grips, if the hull is beyond the obstacle at the end; a gap
also without a touch of the hull, and, as another limit, with it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

from fmus.ground.soils import law_of
from orchestrator.results import output_files
from orchestrator.results.run_data import RunData, Window
from orchestrator.results.table import Column
from orchestrator.scene.kinds import Scene
from orchestrator.studies import Row
from orchestrator.studies.mobility import theory
from orchestrator.studies.mobility.soil_trials import SOILS
from orchestrator.studies.mobility.trial import (
    Finding,
    Limit,
    Trial,
    TrialRun,
    Vehicle,
    search,
    trial_scene,
    vehicle_of,
)

Attempt = tuple[Scene, Callable[[TrialRun], str]]  # a scene, and why its run is no success

# --- slopes ---

FRICTIONS = (0.3, 0.6, 0.8)
MOVES = 0.1  # of the chain's speed: a vehicle that is slower at the end does not climb
CRAWL = 0.5  # of the pace
BEND = 4.0  # contact lengths over which level soil turns into the slope


def on_hard_ground(scene: str, friction: float, halvings: int) -> list[Row]:
    """Row of the steepest slope on hard ground of a friction."""
    vehicle = vehicle_of(scene)
    unit, speed = vehicle.time, CRAWL * vehicle.pace

    def attempt(slope: float) -> Attempt:
        ramp = 20.0 * unit if slope > 0.9 * friction else 8.0 * unit  # little friction is left to accelerate
        end = ramp + 8.0 * unit

        def judged(run: RunData) -> str:
            t, x = run.signal("chassis.distance", Window(end - 2.0 * unit, end))
            climbed, chain = float((x[-1] - x[0]) / (t[-1] - t[0])), f"its chain at {speed:.2g} m/s"
            return "" if climbed > MOVES * speed else f"at the end it moves at {climbed:.2g} m/s, {chain}"

        title, drive = f"grade of {slope:.4g}", vehicle.drive(speed, ramp)
        return trial_scene(vehicle, title, end, friction=friction, ground={"grade": slope}, drive=drive), judged

    limit = search(attempt, 0.7 * friction, 1.06 * friction, halvings)
    return _slope(limit._replace(doubts=""), theory.Bracket(0.9 * friction, friction))


def on_soil(scene: str, soil: str, halvings: int) -> list[Row]:
    """Row of the steepest slope of a soil."""
    vehicle = vehicle_of(scene)
    speed, length, ramp = vehicle.pace, vehicle.length, 4.0 * vehicle.time
    start, end = vehicle.front + 0.1 * length, ramp + (BEND + 10.0) * length / speed

    def judged(run: RunData) -> str:
        short = start + (BEND + 0.5) * length - _last(run, "chassis.chassis.position.x")
        return f"at the end its middle is {short:.2f} m short of the slope" if short > 0.0 else ""

    def attempt(slope: float) -> Attempt:
        ground = {"soil": {"name": soil}, "grade": slope, "incline_start": start, "incline_length": BEND * length}
        title, allowed = f"grade of {slope:.4g} on {soil}", {"allow": ["belly"]}  # a hull in the soil has no force
        return trial_scene(vehicle, title, end, ground=ground, drive=vehicle.drive(speed, ramp), run=allowed), judged

    bracket = slopes(vehicle, soil)
    return _slope(search(attempt, 0.25 * bracket.high, 1.1 * bracket.high, halvings), bracket)


def slopes(vehicle: Vehicle, soil: str) -> theory.Bracket:
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


def _slope(limit: Limit, bracket: theory.Bracket) -> list[Row]:
    ok = limit.failed >= bracket.low and limit.passed <= bracket.high
    return _row("climbed", limit, bracket, 100.0, ok, f"climbed with {limit.doubts}")


# --- steps and gaps ---

FRICTION = 1.0  # of tracks that grip the edge
SPEED = 0.35  # of the pace
OBSTACLES = STEP, GAP, ON_HULL = "step", "gap", "gap, on the hull"
ALLOWED = {"allow": ["penetration", "tooth_jump"]}  # of edges under single links; reported as notes
AHEAD = 0.3  # of the contact length: the obstacle's distance from the tracks


def crossed(scene: str, obstacle: str, halvings: int) -> list[Row]:
    """Row of the largest obstacle that is crossed."""
    vehicle = vehicle_of(scene)
    bracket = (theory.largest_step if obstacle == STEP else theory.largest_gap)(vehicle.table)

    def attempt(size: float) -> Attempt:
        return _obstacle(vehicle, obstacle, size), lambda run: _failure(run, vehicle, obstacle, size)

    limit = search(attempt, 0.7 * bracket.low, 2.0 * bracket.high, halvings)
    reached = not limit.failed < 0.9 * bracket.low  # the limit is between the value that passed and that which failed
    return _row("passed", limit, bracket, 1.0, reached, f"crossed: {limit.doubts}")


def _far_edge(vehicle: Vehicle, obstacle: str, size: float) -> float:
    """Place of the far edge, m."""
    return vehicle.front + AHEAD * vehicle.length + (0.0 if obstacle == STEP else size)


def _obstacle(vehicle: Vehicle, obstacle: str, size: float) -> Scene:
    """Scene of a trial with an obstacle of a size."""
    speed, unit = SPEED * vehicle.pace, vehicle.time
    edge = _far_edge(vehicle, obstacle, size)
    shape: dict[str, Any] = {"step": {"x": [edge], "rise": size}}
    if obstacle != STEP:
        shape = {"trench": {"start": edge - size, "width": size, "depth": 0.5 * vehicle.length}}
    way = edge + 2.0 * vehicle.length
    return trial_scene(
        vehicle, f"{obstacle} of {size:.3g} m", 1.3 * way / speed + 2.0 * unit, friction=FRICTION,
        ground={"hull": True, **shape}, drive=vehicle.drive(speed, unit), run=ALLOWED,
    )  # fmt: skip


def _failure(run: RunData, vehicle: Vehicle, obstacle: str, size: float) -> str:
    """Reason why a vehicle does not cross; empty if it does."""
    beyond = _last(run, "chassis.chassis.position.x") - _far_edge(vehicle, obstacle, size)
    if beyond < 0.2 * vehicle.length:
        pitch = _last(run, "chassis.pitch")
        return f"at the end its hull is {beyond:.2f} m beyond the edge, at a pitch of {pitch:.2f} rad"
    touching = float(run.signal("chassis.ground.force.z")[1].max())
    return f"its hull touches an edge with {1e-3 * touching:.3g} kN" if obstacle == GAP and touching > 0.0 else ""


# --- both ---


def _last(run: RunData, signal: str) -> float:
    return float(run.signal(signal)[1][-1])


def _row(passed: str, limit: Limit, bracket: theory.Bracket, factor: float, ok: bool, doubted: str) -> list[Row]:
    """Row of a limit beside theory's; ``passed``: key of the passed value; ``doubted``: note if that has doubts."""
    named: dict[str, float] = {passed: limit.passed, "failed": limit.failed, "low": bracket.low, "high": bracket.high}
    figures = {**{key: factor * value for key, value in named.items()}, "runs": limit.runs}
    return [Row("", "", figures, ok, "; ".join(filter(None, [limit.reason, doubted if limit.doubts else ""])))]


def _draw(rows: Sequence[Row], passed: str, label: str, width: float = 8.0) -> output_files.Picture:
    """Bar of the passed value of each row, and its bracket."""
    figure = output_files.new_figure(width, 3.6, dpi=110)
    pane = figure.subplots()
    pane.bar([row.case for row in rows], [row[passed] for row in rows], color="C0", width=0.5)
    for k, row in enumerate(rows):
        pane.plot([k, k], [row["low"], row["high"]], color="0.2", marker="_", ms=14, label="" if k else "theory")
    pane.set(ylabel=label)
    pane.tick_params(axis="x", labelsize=8)
    pane.legend(fontsize=8)
    return figure


def _findings(rows: Sequence[Row], measure: str, passed: str, unit: str) -> list[Finding]:
    """Limit of each row, with the least value that failed; ``measure`` names the row by ``{}``."""
    return [
        Finding(
            measure.format(row.case), row[passed], unit, row["low"], row["high"],
            "all that were tried are passed" if math.isnan(row["failed"]) else f"not {row['failed']:.3g} {unit}",
        )
        for row in rows
    ]  # fmt: skip


def _columns(item: str, passed: str, unit: str, form: str) -> tuple[Column, ...]:
    """Columns of limits; ``passed``: key and word of what is passed."""
    return (
        Column("case", item),
        Column("climbed" if passed == "climbed" else "passed", f"{passed}, {unit}", form),
        Column("failed", f"not {passed}, {unit}", form),
        Column("low", f"theory from, {unit}", form),
        Column("high", f"to, {unit}", form),
        Column("runs", "runs"),
        Column("ok", "ok"),
        Column("note", "why not"),
    )


def _slope_runs(quick: bool) -> list[tuple[str, Callable[..., list[Row]], tuple[Any, ...], float]]:
    """Hard ground of each friction, and each soil."""
    count, halvings = (1, 3) if quick else (None, 5)
    return [
        *((f"friction {mu:g}", on_hard_ground, (mu, halvings), 40.0) for mu in FRICTIONS[:count]),
        *((soil, on_soil, (soil, halvings), 60.0) for soil in SOILS[:count]),
    ]


GRADE = Trial(
    "grade",
    "Gradeability",
    _columns("ground", "climbed", "%", ".1f"),
    (
        "Theory: the friction on hard ground; on soil the thrust of the tracks at full slip under the weight normal to"
        " the slope, less compaction. The least value is that of links which shear alone at a slip of 90 %.",
        "A hull in the soil has no force; it is warned of.",
    ),
    _slope_runs,
    lambda rows: _draw(rows, "climbed", "slope, %"),
    lambda rows: _findings(rows, "gradeability, {}", "climbed", "%"),
)
STEP_AND_GAP = Trial(
    "step_and_gap",
    "Largest step and gap",
    _columns("obstacle", "crossed", "m", ".3f"),
    (
        f"Friction {FRICTION:g}. Theory: statics of a rigid body that stands on its outer road wheels, or on the wheels"
        " at the ends of its tracks. Springs and chain give way over an edge, and friction pulls a vehicle out whose"
        " nose has dropped: it may cross more.",
    ),
    lambda quick: [(name, crossed, (name, 4 if quick else 6), 60.0) for name in OBSTACLES],
    lambda rows: _draw(rows, "passed", "largest that is crossed, m", width=6.0),
    lambda rows: _findings(rows, "largest {}", "passed", "m"),
)
