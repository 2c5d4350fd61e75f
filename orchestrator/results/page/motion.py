"""Sections with the motion of hull and chain, and with the drives."""

from __future__ import annotations

import numpy as np

from orchestrator.results.analyses.curves import SignalCurve
from orchestrator.results.ground_surface import on_terrain
from orchestrator.results.page.charts import Chart, Trace, lines
from orchestrator.results.page.evaluation import attempt
from orchestrator.results.page.section import Content, PageSection, Pair
from orchestrator.results.page.words import quantity, side
from orchestrator.results.run_data import EVER
from orchestrator.results.thinned import Curve
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
            chart = pair.over_time(key, evaluation.signals[signal].unit, drawn)
            content.add_figure(key, chart, title, _range(evaluation.signals[signal]))
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


def _range(signal: SignalCurve) -> str:
    unit = signal.unit
    return (
        f"From {quantity(signal.least.value, unit)} at {number(signal.least.t)} s"
        f" to {quantity(signal.most.value, unit)} at {number(signal.most.t)} s."
    )


def _way(pair: Pair) -> Chart | None:
    """Chart of the ways of both hulls from above; None if the run goes straight."""
    drawn = []
    for evaluation, name in ((pair.run, "run"), (pair.reference, "reference")):
        if evaluation is None or "chassis.chassis.position.x" not in evaluation.signals:
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
            largest = f"Largest: {quantity(top.value, signals[0].unit)} at {number(top.t)} s."
            content.add_figure(key, chart, title, f"{note} {largest}")
    slips = pair.lines([(f"{track}.slip", side(track)) for track in evaluation.run.tracks])
    if any(np.any(line.curve.y) for line in slips):
        chart = pair.over_time("slip", "mm/s", [line.scaled_by(1e3) for line in slips])
        content.add_figure("slip", chart, "Slip on the ground", SLIP)
    return content.as_section("drive", "Drive", "What did the drives do?")
