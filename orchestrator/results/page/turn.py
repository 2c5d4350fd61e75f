"""Section of a vehicle that turns: yaw rate, radius, steering moment, thrust, and means by side."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from orchestrator.results import turning
from orchestrator.results.analyses.phases import HELD, Phase, phase_name
from orchestrator.results.analyses.turn_curves import GROUND_SPEED, MOMENT, YAW_RATE, radius
from orchestrator.results.page.charts import Chart, Trace, lines
from orchestrator.results.page.evaluation import Evaluation, attempt
from orchestrator.results.page.section import Content, PageSection, Pair, table
from orchestrator.results.page.words import quantity, side, text
from orchestrator.results.run_data import RunData, Window
from orchestrator.results.units import number

Measure = Callable[[RunData, str, Window], float]
PATH = "driver.path.lateral_error"
NOTE = (
    "Means over the phases in which the vehicle turns. To the left is positive, for moment and yaw rate"
    " anticlockwise from above. The centre of rotation is where the hull has no lateral velocity."
)
HEAD = ("Phase", "From, s", "To, s", "Steering moment", "Centre ahead", "", "Thrust", "Slip", "Power")


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
            note += f" Largest: {quantity(known.largest.value, known.unit)} at {number(known.largest.t)} s."
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
    content.html += f"<h3>By side</h3><p class='muted'>{NOTE}</p>{_by_side(evaluation)}"
    return PageSection("turn", "Turn", "How did it turn?", content.html, content.charts)


def _window(evaluation: Evaluation) -> float:
    """Time of the means in a radius, s."""
    return max(HELD, evaluation.ripple.window)


def _radius(pair: Pair) -> Chart | None:
    """Chart of the radius over time; None without the motion of the hull."""
    drawn = []
    for evaluation, name in ((pair.run, "run"), (pair.reference, "reference")):
        if evaluation and {GROUND_SPEED, YAW_RATE} <= evaluation.signals.keys():
            signals = evaluation.signals
            curve = radius(signals[GROUND_SPEED], signals[YAW_RATE], _window(pair.run))
            drawn.append(Trace(name, curve, 0, reference=evaluation is pair.reference))
    if not any(np.isfinite(trace.curve.y).any() for trace in drawn):
        return None
    return lines("radius", "m", drawn) | {"log": True}


def _by_side(evaluation: Evaluation) -> str:
    """Table of means by phase and side, HTML."""
    return table(HEAD, [_row(evaluation, phase) for phase in evaluation.turns], "phases")


def _row(evaluation: Evaluation, phase: Phase) -> tuple[str, ...]:
    run, window = evaluation.run, Window(phase.start, phase.end)

    def mean(measure: Measure, of: str, unit: str) -> str:
        value = attempt(lambda: measure(run, of, window), [])
        return "" if value is None else quantity(value, unit)

    def sides(measure: Measure, unit: str) -> str:
        return "<br>".join(mean(measure, of, unit) for of in turning.SIGN)

    return (
        f"<b>{text(phase_name(phase))}</b>", number(phase.start), number(phase.end),
        mean(turning.steering_moment, "", "N.m"), mean(turning.rotation_centre, "", "m"),
        "<br>".join(turning.SIGN), sides(turning.propulsion, "N"), sides(turning.track_slip, "m/s"),
        sides(turning.drive_power, "W"),
    )  # fmt: skip
