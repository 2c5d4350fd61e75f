"""Section with torque, speed and power of the drives, and slip of the tracks."""

from __future__ import annotations

import numpy as np

from orchestrator.results.page.section import Pair, Section, figure
from orchestrator.results.page.words import plain, quantity
from orchestrator.results.units import number

CHARTS = (  # key, title, variable, note
    ("torque", "Torque of the drives", "torque", "Mean over each step."),
    ("sprocket-speed", "Speed of the drives", "speed", "Of a sprocket against its mount."),
    ("power", "Power of the motors", "power", "Negative where the chain turns the motor."),
)
SLIP = (
    "Rearward speed of the pads over the ground, weighted by their load. It may be below zero under a driven"
    " vehicle: wheels rock the loaded links forward about their pads, and the hull outruns the pin line."
)


def drive(pair: Pair) -> Section | None:
    """Section of the drives; None without any."""
    study, charts, html = pair.run, {}, ""
    for key, title, variable, note in CHARTS:
        signals = [found for each in study.drives if (found := study.signals.get(f"{each}{variable}"))]
        if signals:
            drawn = pair.lines([(f"{each}{variable}", plain(each.rstrip("."))) for each in study.drives])
            charts[key] = pair.over_time(variable, signals[0].unit, drawn)
            top = max(signals, key=lambda signal: abs(signal.largest.value)).largest
            html += figure(key, title, f"{note} Largest: {quantity(top.value, signals[0].unit)} at {number(top.t)} s.")
    slips = pair.lines([(f"{track}.slip", plain(track)) for track in study.run.tracks])
    if any(np.any(line.curve.y) for line in slips):
        charts["slip"] = pair.over_time("slip", "mm/s", [line.times(1e3) for line in slips])
        html += figure("slip", "Slip on the ground", SLIP)
    if not charts:
        return None
    return Section("drive", "Drive", "What did the drives do?", f'<div class="grid">{html}</div>', charts)
