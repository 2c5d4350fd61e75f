"""Ride on rough ground of ISO 8608 over speed: acceleration of the first seat, its weighted value, absorbed power.

Both tracks run over one profile. The limit of 6 W of absorbed power is that of mobility models (``absorbed_power``).
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import groupby
from typing import Any

import numpy as np

from orchestrator.results.analyses import ride
from orchestrator.results.analyses.absorbed_power import LIMIT
from orchestrator.results.run_data import Window
from orchestrator.results.table import Column
from orchestrator.scene.scene import Scene
from orchestrator.studies import Case, files
from orchestrator.studies.mobility.finding import Finding
from orchestrator.studies.mobility.limit_speed import limit_speed
from orchestrator.studies.mobility.trial import FIRM, Vehicle, recorded, run_up, trial, vehicle_of
from orchestrator.studies.row import Row

NAME = "roughness"
TITLE = "Ride on rough ground"
CLASSES = ("B", "C", "D", "E")
SPEEDS = (0.5, 1, 2, 3, 4, 5, 6)  # of the pace
QUICK_CLASSES, QUICK_SPEEDS = ("C", "D"), SPEEDS[2::2]
MEASURED = 16.0  # of the time scale: length of the window
SEED = 1
COLUMNS = (
    Column("iso_class", "class"),
    Column("speed", "speed, m/s", ".3g"),
    Column("rms", "vertical rms, m/s2", ".3f"),
    Column("weighted", "weighted by Wk, m/s2", ".3f"),
    Column("total", "vibration total value, m/s2", ".3f"),
    Column("power", "absorbed power, W", ".3f"),
    Column("peak", "largest, g", ".2f"),
    Column("note", "note"),
)
NOTES = (
    f"Seed {SEED}, both tracks on one profile, first seat of the vehicle. Wk and the total value are of ISO 2631-1;"
    " absorbed power is that of the rational filter.",
)


def cases(scene: str, quick: bool) -> list[Case]:
    """Cases: every class at every speed."""
    classes, speeds = (QUICK_CLASSES, QUICK_SPEEDS) if quick else (CLASSES, SPEEDS)
    return [
        Case(NAME, f"class {iso_class}, {factor} x pace", vibration, (scene, iso_class, factor), 10.0 + factor)
        for iso_class in classes
        for factor in speeds
    ]


def vibration(scene: str, iso_class: str, factor: float) -> list[Row]:
    """Row of a run at constant speed."""
    vehicle = vehicle_of(scene)
    speed = factor * vehicle.pace
    begin = run_up(vehicle, speed) + 2.0 * vehicle.time
    window = Window(begin, begin + MEASURED * vehicle.time)
    rough = {"iso_class": iso_class, "seed": SEED, "correlated": True, "start": 0.4 * vehicle.length}
    figures: dict[str, Any] = {"iso_class": iso_class, "speed": speed}
    try:
        with recorded(_trial(vehicle, speed, window.end, rough)) as run:
            (seat,), note = ride.of(run, vehicle.seat, window).seats, run.doubts
    except RuntimeError as failure:
        return [Row("", "", figures, note=str(failure))]
    up = ride.UP
    figures |= {
        "rms": float(ride.rms(seat.acceleration)[up]),
        "weighted": float(seat.weighted_rms[up]),
        "total": seat.total,
        "power": seat.absorbed_power,
        "peak": float(np.abs(seat.low_passed[:, up]).max()) / ride.G,
    }
    return [Row("", "", figures, note=note)]


def _trial(vehicle: Vehicle, speed: float, end: float, rough: dict[str, object]) -> Scene:
    drive = {"mode": "speed", "speed": vehicle.sprocket(speed), "ramp_start": 0.0, "ramp_time": run_up(vehicle, speed)}
    ground = {"hull": True, "rough": rough}
    return trial(
        vehicle,
        "rough ground",
        end,
        friction=FIRM,
        ground=ground,
        drive=drive,
        seats=[vehicle.seat],
        run={"allow": ["penetration"]},
    )


def by_class(rows: Sequence[Row]) -> list[tuple[str, list[Row]]]:
    """Rows with a ride, by class, in order of speed."""
    valid = sorted((row for row in rows if "power" in row.figures), key=lambda row: (row["iso_class"], row["speed"]))
    return [(name, list(own)) for name, own in groupby(valid, key=lambda row: row["iso_class"])]


def draw(rows: Sequence[Row]) -> files.Picture:
    """Weighted acceleration and absorbed power over speed, by class."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(10.0, 3.8), layout="constrained", dpi=110)
    panes = figure.subplots(1, 2)
    for name, own in by_class(rows):
        for pane, key in zip(panes, ("weighted", "power"), strict=True):
            pane.semilogy([row["speed"] for row in own], [row[key] for row in own], "o-", label=f"class {name}")
    panes[0].set(xlabel="speed, m/s", ylabel="vertical acceleration weighted by Wk, m/s2")
    panes[1].set(xlabel="speed, m/s", ylabel="absorbed power, W")
    panes[1].axhline(LIMIT, color="0.3", ls="--")
    for pane in panes:
        pane.grid(alpha=0.3)
    panes[0].legend(fontsize=8)
    return figure


def find(rows: Sequence[Row]) -> list[Finding]:
    """Speed at which absorbed power reaches its limit, by class."""
    return [
        limit_speed(
            f"speed at {LIMIT:g} W, class {name}",
            [row["speed"] for row in own],
            [row["power"] for row in own],
            LIMIT,
        )
        for name, own in by_class(rows)
    ]
