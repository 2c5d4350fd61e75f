"""Mean maximum pressure: the mean over time of the largest pressures under the road wheels.

As Rowland defined it (Proceedings of the 4th Conference of the ISTVS, Stockholm, 1972) and Wong measured it (Journal of
Terramechanics 31(3), 1994, 197-213), found from the forces on links, not by an empirical formula. Pressure is the force
of the ground on a link over pitch and width. Cone index figures are not given: they are regressions over vehicles.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from orchestrator.results.analyses import circuit
from orchestrator.results.analyses.contact import SIGNAL, pad_area, pressure
from orchestrator.results.run_data import RunData, Window
from orchestrator.results.table import Column
from orchestrator.studies import Case, files
from orchestrator.studies.mobility.drawbar import SOILS
from orchestrator.studies.mobility.finding import Finding
from orchestrator.studies.mobility.trial import Vehicle, recorded, trial, vehicle_of
from orchestrator.studies.row import Row

NAME = "pressure"
TITLE = "Mean maximum pressure on the ground"
HARD = "hard ground"
GROUNDS = (HARD, *SOILS)
RAMP, SETTLED, END = 4.0, 6.0, 10.0  # of the time scale
EVERY = 8  # steps over which forces on links are averaged
COLUMNS = (
    Column("case", "ground"),
    Column("mean_maximum", "mean maximum pressure, kPa", ".4g"),
    Column("nominal", "nominal pressure, kPa", ".4g"),
    Column("single", "one link under each wheel, kPa", ".4g"),
    Column("peak", "largest pressure, kPa", ".4g"),
    Column("wheels", "under each wheel from the front, kPa"),
    Column("ok", "ok"),
)
NOTES = ("Nominal: the weight over both tracks between the outer wheels.",)


def cases(scene: str, quick: bool) -> list[Case]:
    """Cases: every ground."""
    return [Case(NAME, ground, maxima, (scene, ground), 15.0) for ground in (GROUNDS[:2] if quick else GROUNDS)]


def maxima(scene: str, ground: str) -> list[Row]:
    """Row of a run at constant speed."""
    vehicle = vehicle_of(scene)
    unit = vehicle.time
    run_scene = trial(
        vehicle, f"pressure on {ground}", END * unit,
        ground={} if ground == HARD else {"soil": {"name": ground}},
        drive={"mode": "speed", "speed": vehicle.sprocket(vehicle.pace), "ramp_time": RAMP * unit},
        track={"link_outputs": ["position", "ground"]},
        run={"links": EVERY},
    )  # fmt: skip
    with recorded(run_scene) as run:
        return [_row(vehicle, run, Window(SETTLED * unit, END * unit))]


def _row(vehicle: Vehicle, run: RunData, window: Window) -> Row:
    area, wheels = pad_area(run), sorted(vehicle.table.road_wheel.x, reverse=True)
    edges = np.array([np.inf, *(0.5 * (a + b) for a, b in pairwise(wheels)), -np.inf])
    found, peak = [], 0.0
    for block in circuit.records(run, run.tracks[0], window, SIGNAL):
        under, ahead = pressure(block.pins, block.axes, block.values[0], area), block.centres[..., 0]
        stations = [np.where((ahead <= front) & (ahead > back), under, 0.0) for front, back in pairwise(edges)]
        found.append(np.stack([station.max(axis=1) for station in stations], axis=1))
        peak = max(peak, float(under.max()))
    by_wheel = np.concatenate(found).mean(axis=0)
    track = vehicle.table.track
    nominal = vehicle.weight / (2.0 * track.width * vehicle.length)
    single = vehicle.weight / (2.0 * len(wheels) * area)
    figures = {
        "mean_maximum": 1e-3 * float(by_wheel.mean()),
        "nominal": 1e-3 * nominal,
        "single": 1e-3 * single,
        "peak": 1e-3 * peak,
        "wheels": ", ".join(f"{1e-3 * p:.3g}" for p in by_wheel),
    }
    return Row("", "", figures, nominal <= float(by_wheel.mean()) <= 1.05 * single)


def draw(rows: Sequence[Row]) -> files.Picture:
    """Bars of the mean maximum pressure by ground, beside the nominal one."""
    figure = files.new_figure(8.0, 3.6, dpi=110)
    pane = figure.subplots()
    pane.bar([row.case for row in rows], [row["mean_maximum"] for row in rows], color="C0", width=0.6)
    pane.axhline(rows[0]["nominal"], color="C3", ls="--", label="nominal: weight over both tracks")
    pane.axhline(rows[0]["single"], color="0.4", ls=":", label="one link under each wheel")
    pane.set(ylabel="mean maximum pressure, kPa")
    pane.legend(fontsize=8)
    return figure


def find(rows: Sequence[Row]) -> list[Finding]:
    """Mean maximum pressure by ground."""
    return [
        Finding(f"mean maximum pressure, {row.case}", row["mean_maximum"], "kPa", row["nominal"], row["single"])
        for row in rows
    ]
