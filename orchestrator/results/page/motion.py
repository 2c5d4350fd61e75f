"""Section with the motion of the hull or, without a hull, of the chain."""

from __future__ import annotations

import numpy as np

from orchestrator.results.analyses.curves import SignalCurve
from orchestrator.results.page.charts import Chart, Line, lines
from orchestrator.results.page.section import Pair, Section, figure
from orchestrator.results.page.study import attempt
from orchestrator.results.page.words import plain, quantity
from orchestrator.results.run_data import EVER
from orchestrator.results.thinned import Curve
from orchestrator.results.units import number

AT_REST = 1e-6  # m/s
DEGREES = 180.0 / np.pi
LEAST_WAY = 0.5  # m beside the straight line: a straighter way is not drawn from above


def motion(pair: Pair) -> Section | None:
    """Section with speed, way, angles and settlement; None without any of them."""
    study, charts, html = pair.run, {}, ""
    for key, title in (("speed", "Speed of the hull"), ("distance", "Way along the heading at the start")):
        signal = f"chassis.{key}"
        if drawn := pair.lines([(signal, key)]):
            charts[key] = pair.over_time(key, study.signals[signal].unit, drawn)
            html += figure(key, title, _range(study.signals[signal]))
    if angles := pair.lines([("chassis.pitch", "pitch"), ("chassis.roll", "roll")]):
        charts["pitch"] = pair.over_time("angle", "degrees", [line.times(DEGREES) for line in angles])
        html += figure("pitch", "Pitch and roll", "Nose down and right side down are positive.")
    if settled := pair.lines([("chassis.settlement", "settlement")]):
        charts["settlement"] = pair.over_time("down", "mm", [line.times(1e3) for line in settled])
        html += figure("settlement", "Settlement", "The hull's centre of mass below its drawn place.")
    if way := _way(pair):
        charts["way"] = way
        html += figure("way", "Way from above", "World axes; the centre of mass of the hull.")
    drawn = pair.lines([(f"{track}.speed", plain(track)) for track in study.run.tracks])
    if any(np.abs(line.curve.y).max() > AT_REST for line in drawn):
        charts["chain-speed"] = pair.over_time("speed", "m/s", drawn)
        html += figure("chain-speed", "Speed of the chain", "Along itself, seen from the vehicle.")
    if not charts:
        return None
    return Section("motion", "Motion", "How did it move?", f'<div class="grid">{html}</div>', charts)


def _range(signal: SignalCurve) -> str:
    unit = signal.unit
    return (
        f"From {quantity(signal.least.value, unit)} at {number(signal.least.t)} s"
        f" to {quantity(signal.most.value, unit)} at {number(signal.most.t)} s."
    )


def _way(pair: Pair) -> Chart | None:
    """Chart of the ways of both hulls from above; None if the run goes straight."""
    drawn = []
    for study, name in ((pair.run, "run"), (pair.reference, "reference")):
        if study is None or "chassis.chassis.position.x" not in study.signals:
            continue
        _, places = study.run.vectors("chassis", "out", "chassis.position", "xy", EVER)
        thinned = places[:: max(1, len(places) // 1000)]
        drawn.append(Line(name, Curve(thinned[:, 0], thinned[:, 1]), 0, reference=study is pair.reference))
    if not drawn:
        return None
    last = drawn[0].curve
    heading = float(attempt(lambda: pair.run.run.scene["start"]["heading"], []) or 0.0)
    beside = -np.sin(heading) * (last.t - last.t[0]) + np.cos(heading) * (last.y - last.y[0])
    if np.nanmax(np.abs(beside)) < LEAST_WAY:
        return None
    return lines("y", "m", drawn, x="x, m", timed=False) | {"equal": True}
