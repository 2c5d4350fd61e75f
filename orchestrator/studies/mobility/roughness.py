"""Ride on rough ground of ISO 8608 over speed: acceleration of the first seat, its weighted value, absorbed power.

Both tracks run over one profile. The limit of 6 W of absorbed power is that of mobility models (``absorbed_power``).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from orchestrator.results.analyses import ride
from orchestrator.results.analyses.vibration import LIMIT
from orchestrator.results.run_data import Window
from orchestrator.results.table import Column
from orchestrator.studies import Case, files
from orchestrator.studies.mobility import riding
from orchestrator.studies.mobility.finding import Finding
from orchestrator.studies.mobility.trial import run_up, vehicle_of
from orchestrator.studies.row import Row

NAME = "roughness"
TITLE = "Ride on rough ground"
CLASSES = ("B", "C", "D", "E")
QUICK_CLASSES = ("C", "D")
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
    classes = {f"class {name}": name for name in (QUICK_CLASSES if quick else CLASSES)}
    return riding.cases(NAME, vibration, scene, classes, quick)


def vibration(scene: str, iso_class: str, factor: float) -> list[Row]:
    """Row of a run at constant speed."""
    vehicle = vehicle_of(scene)
    speed, unit = factor * vehicle.pace, vehicle.time
    begin = run_up(vehicle, speed) + 2.0 * unit
    start = vehicle.front + 0.2 * vehicle.length
    rough = {"rough": {"iso_class": iso_class, "seed": SEED, "correlated": True, "start": start}}
    window, about = Window(begin, begin + MEASURED * unit), {"iso_class": iso_class, "speed": speed}
    return riding.ridden(vehicle, "rough ground", speed, rough, window, about, _vibration)


def _vibration(seat: ride.SeatRide) -> riding.Figures:
    up = ride.UP
    return {
        "rms": float(ride.rms(seat.acceleration)[up]),
        "weighted": float(seat.weighted_rms[up]),
        "total": seat.total,
        "power": seat.absorbed_power,
        "peak": float(np.abs(seat.low_passed[:, up]).max()) / ride.G,
    }


def draw(rows: Sequence[Row]) -> files.Picture:
    """Weighted acceleration and absorbed power over speed, by class."""
    figure = files.new_figure(10.0, 3.8, dpi=110)
    panes = figure.subplots(1, 2)
    for pane, key in zip(panes, ("weighted", "power"), strict=True):
        for name, *curve in riding.curves(rows, "iso_class", key):
            pane.semilogy(*curve, "o-", label=f"class {name}")
        pane.grid(alpha=0.3)
    panes[0].set(xlabel="speed, m/s", ylabel="vertical acceleration weighted by Wk, m/s2")
    panes[1].set(xlabel="speed, m/s", ylabel="absorbed power, W")
    panes[1].axhline(LIMIT, color="0.3", ls="--")
    panes[0].legend(fontsize=8)
    return figure


def find(rows: Sequence[Row]) -> list[Finding]:
    """Speed at which absorbed power reaches its limit, by class."""
    return riding.limits(rows, "iso_class", "power", LIMIT, lambda name: f"speed at {LIMIT:g} W, class {name}")
