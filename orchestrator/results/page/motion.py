"""Sections with the motion of hull and chain, phases, turns, and drives."""

from __future__ import annotations

import numpy as np

from orchestrator.results import turning
from orchestrator.results.analyses.curves import GROUND_SPEED, MOMENT, YAW_RATE, radius
from orchestrator.results.analyses.phases import CHANGING, HELD, Phase, phase_name, rounded
from orchestrator.results.approximations import Curve
from orchestrator.results.ground_surface import on_terrain
from orchestrator.results.measures import FIGURES, OBSERVABLES
from orchestrator.results.page.embedded import at_time, instance, quantity, side, text
from orchestrator.results.page.evaluation import Evaluation, attempt
from orchestrator.results.page.section import Chart, Content, PageSection, Pair, Trace, lines, table
from orchestrator.results.run_data import EVER, Window
from orchestrator.results.table import without_rounding
from orchestrator.results.units import number

AT_REST = 1e-6  # m/s
DEGREES = 180.0 / np.pi
DRIVES = (  # key, title, variable, note
    ("torque", "Torque of the drives", "torque", "Mean over each step."),
    ("sprocket-speed", "Speed of the drives", "speed", "Of a sprocket against its mount."),
    ("power", "Power of the motors", "power", "Negative where the chain turns the motor."),
)
SLIP = (
    "Rearward speed of the pads over the ground, weighted by their load. It may be below zero under a driven"
    " vehicle: wheels rock the loaded links forward about their pads, and the hull outruns the pin line."
)
SETTLEMENT = {
    False: "The hull's centre of mass below its drawn place.",
    True: "The hull's centre of mass below its drawn place, along the normal of the ground at the start.",
}
LEAST_WAY = 0.5  # m beside the straight line: a straighter way is not drawn from above


def motion(pair: Pair) -> PageSection | None:
    """Section with speed, way, angles and settlement; None without any of them."""
    evaluation, content = pair.run, Content()
    for key, title in (("speed", "Speed of the hull"), ("distance", "Way along the heading at the start")):
        signal = f"chassis.{key}"
        if drawn := pair.lines([(signal, key)]):
            known = evaluation.signals[signal]
            chart = pair.over_time(key, known.unit, drawn)
            note = f"From {at_time(known.least, known.unit)} to {at_time(known.most, known.unit)}."
            content.add_figure(key, chart, title, note)
    if angles := pair.lines([("chassis.pitch", "pitch"), ("chassis.roll", "roll")]):
        chart = pair.over_time("angle", "degrees", [line.scaled_by(DEGREES) for line in angles])
        content.add_figure("pitch", chart, "Pitch and roll", "Nose down and right side down are positive.")
    if settled := pair.lines([("chassis.settlement", "settlement")]):
        chart = pair.over_time("down", "mm", [line.scaled_by(1e3) for line in settled])
        content.add_figure("settlement", chart, "Settlement", SETTLEMENT[on_terrain(evaluation.run.scene)])
    if way := _way(pair):
        content.add_figure("way", way, "Way from above", "World axes; the centre of mass of the hull.")
    drawn = pair.lines([(f"{track}.speed", side(track)) for track in evaluation.run.tracks])
    if any(np.abs(line.curve.y).max() > AT_REST for line in drawn):
        chart = pair.over_time("speed", "m/s", drawn)
        content.add_figure("chain-speed", chart, "Speed of the chain", "Along itself, seen from the vehicle.")
    return content.as_section("motion", "Motion", "How did it move?")


def _way(pair: Pair) -> Chart | None:
    """Chart of the ways of both hulls from above; None if the run goes straight."""
    drawn = []
    for evaluation, name in pair.named:
        if "chassis.chassis.position.x" not in evaluation.signals:
            continue
        _, places = evaluation.run.vectors("chassis", "out", "chassis.position", "xy", EVER)
        thinned = places[:: max(1, len(places) // 1000)]
        drawn.append(Trace(name, Curve(thinned[:, 0], thinned[:, 1]), 0, reference=evaluation is pair.reference))
    if not drawn:
        return None
    last = drawn[0].curve
    heading = float(attempt(lambda: pair.run.run.scene["start"]["heading"], []) or 0.0)
    lateral = -np.sin(heading) * (last.t - last.t[0]) + np.cos(heading) * (last.y - last.y[0])
    if np.nanmax(np.abs(lateral)) < LEAST_WAY:
        return None
    return lines("y", "m", drawn, x="x, m", timed=False) | {"equal": True}


def drive(pair: Pair) -> PageSection | None:
    """Section of the drives; None without any."""
    evaluation, content = pair.run, Content()
    for key, title, variable, note in DRIVES:
        signals = [signal for prefix in evaluation.drives if (signal := evaluation.signals.get(f"{prefix}{variable}"))]
        if signals:
            drawn = pair.lines([(f"{prefix}{variable}", side(prefix.rstrip("."))) for prefix in evaluation.drives])
            chart = pair.over_time(variable, signals[0].unit, drawn)
            top = max(signals, key=lambda signal: abs(signal.largest.value)).largest
            content.add_figure(key, chart, title, f"{note} Largest: {at_time(top, signals[0].unit)}.")
    slips = pair.lines([(f"{track}.slip", side(track)) for track in evaluation.run.tracks])
    if any(np.any(line.curve.y) for line in slips):
        chart = pair.over_time("slip", "mm/s", [line.scaled_by(1e3) for line in slips])
        content.add_figure("slip", chart, "Slip on the ground", SLIP)
    return content.as_section("drive", "Drive", "What did the drives do?")


PHASES_NOTE = (
    "Found from speed and yaw rate of the hull. Speed, power of the drives, slip of the links on the ground and yaw"
    f" rate are means over the phase, in brackets the largest yaw rate, over {HELD:g} s. To the left is positive."
)
PHASES_HEAD = (
    "Phase", "From, s", "To, s", "Way, m", "Speed, m/s", "Yaw rate, rad/s", "Radius, m", "Power, kW",
    "Slip left / right, m/s", OBSERVABLES["tension_max"].shown.title,
)  # fmt: skip


def phases(pair: Pair) -> PageSection | None:
    """Section with the phases of the run and its reference; None without the motion of a hull."""
    if not pair.run.phases:
        return None
    html = f"<p class='muted'>{PHASES_NOTE}</p>{_phases_table(pair.run)}"
    if pair.reference and pair.reference.phases:
        html += f"<h3>Of the reference</h3>{_phases_table(pair.reference)}"
    return PageSection("phases", "Phases", "What did it do, and when?", html, {})


def _phases_table(evaluation: Evaluation) -> str:
    return table(PHASES_HEAD, [_phase_row(phase) for phase in evaluation.phases], "phases")


def _phase_row(phase: Phase) -> tuple[str, ...]:
    speed = f"{phase.speed:.3f}"
    if phase.kind in CHANGING:
        speed += f"<br><span class='muted'>{rounded(phase.speed_start)} to {rounded(phase.speed_end)}</span>"
    slips = " / ".join(f"{slip:.3f}" for slip in (phase.slip_left, phase.slip_right) if slip == slip)
    tension = f"{quantity(phase.tension, 'N')}<br><span class='muted'>{instance(phase.tension_track)}, at"
    tension += f" {number(phase.tension_t)} s</span>"
    name, _, turning = phase_name(phase).partition(", ")
    cells = (
        f"<b>{text(name)}</b>" + (f"<br><span class='muted'>{text(turning)}</span>" if turning else ""),
        number(phase.start),
        number(phase.end),
        f"{phase.way:.2f}",
        speed,
        f"{phase.yaw_rate:.3f} ({phase.yaw_rate_most:.3f})" if phase.turning else "",
        number(phase.radius, 3) if phase.turning else "",
        number(without_rounding(phase.power / 1e3, "kW"), 3) if phase.power == phase.power else "",
        slips,
        tension if phase.tension_track else "",
    )
    return tuple(cell.replace("-0.000", "0.000").replace("-", "\N{MINUS SIGN}") for cell in cells)


PATH = "driver.path.lateral_error"
SIDES_NOTE = (
    "Means over the phases in which the vehicle turns. To the left is positive, for moment and yaw rate"
    " anticlockwise from above. The centre of rotation is where the hull has no lateral velocity."
)
SIDES_HEAD = ("Phase", "From, s", "To, s", "Steering moment", "Centre ahead", "", "Thrust", "Slip", "Power")


def turn(pair: Pair) -> PageSection | None:
    """Section of the turns; None if the run goes straight."""
    evaluation, content = pair.run, Content()
    if not evaluation.turns:
        return None
    for key, signal, quantity_name, title, note in (
        ("yaw-rate", YAW_RATE, "yaw rate", "Yaw rate", "Of the hull, about the vertical."),
        ("moment", MOMENT, "moment", "Steering moment", "Half the track distance times the difference of thrusts."),
    ):
        if drawn := pair.lines([(signal, quantity_name)]):
            known = evaluation.signals[signal]
            note += f" Largest: {at_time(known.largest, known.unit)}."
            content.add_figure(key, pair.over_time(quantity_name, known.unit, drawn), title, note)
    if chart := _radius(pair):
        note = f"Way over change of heading in {number(_window(evaluation))} s, while the vehicle turns."
        content.add_figure("radius", chart, "Radius", note)
    if thrusts := pair.lines([(f"{track}.thrust", side(track)) for track in evaluation.run.tracks]):
        chart = pair.over_time("thrust", "N", thrusts)
        content.add_figure(
            "thrust", chart, "Thrust of the tracks", "Force of the ground on each, ahead along the hull."
        )
    if drawn := pair.lines([(PATH, "distance")]):
        chart = pair.over_time("to the left", evaluation.signals[PATH].unit, drawn)
        content.add_figure("path", chart, "Distance from the driver's path", "To the left is positive.")
    content.as_grid()
    content.html += f"<h3>By side</h3><p class='muted'>{SIDES_NOTE}</p>"
    content.html += table(SIDES_HEAD, [_sides_row(evaluation, phase) for phase in evaluation.turns], "phases")
    return PageSection("turn", "Turn", "How did it turn?", content.html, content.charts)


def _window(evaluation: Evaluation) -> float:
    """Time of the means in a radius, s."""
    return max(HELD, evaluation.ripple.window)


def _radius(pair: Pair) -> Chart | None:
    """Chart of the radius over time; None without the motion of the hull."""
    drawn = []
    for evaluation, name in pair.named:
        if {GROUND_SPEED, YAW_RATE} <= evaluation.signals.keys():
            signals = evaluation.signals
            curve = radius(signals[GROUND_SPEED], signals[YAW_RATE], _window(pair.run))
            drawn.append(Trace(name, curve, 0, reference=evaluation is pair.reference))
    if not any(np.isfinite(trace.curve.y).any() for trace in drawn):
        return None
    return lines("radius", "m", drawn) | {"log": True}


def _sides_row(evaluation: Evaluation, phase: Phase) -> tuple[str, ...]:
    run, window = evaluation.run, Window(phase.start, phase.end)

    def mean(name: str, of: str = "") -> str:
        value = attempt(lambda: FIGURES[name](run, of, window), [])
        return "" if value is None else quantity(value, FIGURES[name].unit)

    def sides(name: str) -> str:
        return "<br>".join(mean(name, of) for of in turning.SIGN)

    return (
        f"<b>{text(phase_name(phase))}</b>", number(phase.start), number(phase.end), mean("steering_moment"),
        mean("rotation_centre"), "<br>".join(turning.SIGN), *map(sides, ("propulsion", "track_slip", "drive_power")),
    )  # fmt: skip
