"""Drawbar pull and motion resistance over slip on soils.

The sprockets run at constant speed; a load on the hitch that grows steeply with the speed sets the slip. Resistance is
the power of compaction over the speed of the chain: a link that comes down on its slope presses the soil at this speed,
however far the vehicle gets.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from scipy.optimize import brentq

from fmus.soils import law_of, named
from orchestrator.results import measures
from orchestrator.results.run_data import RunData, Window
from orchestrator.results.table import Column
from orchestrator.studies import Case, files
from orchestrator.studies.mobility import theory
from orchestrator.studies.mobility.finding import Finding
from orchestrator.studies.mobility.trial import Vehicle, recorded, trial, vehicle_of
from orchestrator.studies.row import Row

NAME = "drawbar"
TITLE = "Drawbar pull and motion resistance over slip"
SOILS = ("dry_sand", "lete_sand", "sandy_loam_15", "clayey_soil_38")
SLIPS = (0.02, 0.05, 0.1, 0.2, 0.35, 0.5, 0.7, 0.9)
QUICK = SLIPS[1::2]
RAMP, SETTLED, END = 4.0, 8.0, 12.0  # of the time scale: the sprockets' ramp, the steady state, the end
STEEP = 0.1  # of the speed, over which the load grows to the weight
USUAL = 0.2  # slip at which pulls are compared
COLUMNS = (
    Column("case", "soil and aim"),
    Column("slip", "slip", ".4f"),
    Column("pull", "drawbar pull, kN", ".4g"),
    Column("low", "theory from, kN", ".4g"),
    Column("high", "to, kN", ".4g"),
    Column("resistance", "resistance, kN", ".4g"),
    Column("length", "shear length, m", ".3g"),
    Column("efficiency", "tractive efficiency", ".3f"),
    Column("settlement", "settlement, m", ".3g"),
    Column("ok", "ok"),
    Column("note", "note"),
)
NOTES = (
    "Slip is 1 - v/V, V a pitch a tooth. Theory: (A c + W tan phi)(1 - K/(i L) (1 - exp(-i L/K))) less compaction, for"
    " L and A of one link under each wheel, to those between the outer wheels.",
    "Shear length: the L with which the thrust is pull and resistance. Shear begins anew under each wheel.",
)


def cases(scene: str, quick: bool) -> list[Case]:
    """Cases: every soil at every slip."""
    return [
        Case(NAME, f"{soil}, slip {slip:g}", pull, (scene, soil, slip), 10.0)
        for soil in SOILS
        for slip in (QUICK if quick else SLIPS)
    ]


def pull(scene: str, soil: str, aim: float) -> list[Row]:
    """Row of a run near a slip."""
    vehicle = vehicle_of(scene)
    speed, unit = vehicle.pace, vehicle.time
    slowest = max((1.0 - aim - 0.02) * speed, 0.0)
    load = [(slowest, 0.0), (slowest + STEEP * speed, vehicle.weight)]
    run_scene = trial(
        vehicle, f"drawbar pull on {soil}", END * unit,
        ground={"soil": {"name": soil}},
        drive={"mode": "speed", "speed": vehicle.sprocket(speed), "ramp_time": RAMP * unit},
        hitch={"drag_points": load, "ramp_start": 0.5 * RAMP * unit, "ramp_time": 0.5 * RAMP * unit},
    )  # fmt: skip
    with recorded(run_scene) as run:
        return [_row(vehicle, soil, run, Window(SETTLED * unit, END * unit), speed)]


def _row(vehicle: Vehicle, name: str, run: RunData, window: Window, speed: float) -> Row:
    track = vehicle.table.track
    soil = law_of(name, track.pitch, track.width)
    slip, towed = measures.slip(run, "", window), run.mean("chassis.hitch.pull", window)
    compacted = sum(
        run.copies(part) * _rate(run, f"{part}.energy.dissipated.ground_damping", window) for part in run.tracks
    )
    driven = sum(
        run.copies(run.tracks[k]) * _rate(run, f"{run.drive(side)}.energy.work", window)
        for k, side in enumerate(run.sides)
    )
    resistance = compacted / speed
    area = 2.0 * vehicle.length * soil.width
    thrust, bracket = towed + resistance, theory.drawbar(vehicle.table, soil, vehicle.weight, slip)
    limit = soil.cohesion * area + vehicle.weight * soil.tan
    figures = {
        "soil": name,
        "slip": slip,
        "pull": 1e-3 * towed,
        "low": 1e-3 * bracket.low,
        "high": 1e-3 * bracket.high,
        "resistance": 1e-3 * resistance,
        "length": _shear_length(thrust / limit, slip, soil.K),
        "efficiency": towed * run.mean("chassis.speed", window) / driven,
        "settlement": run.mean("chassis.settlement", window),
        "weight": 1e-3 * vehicle.weight,
    }
    return Row("", "", figures, bracket.holds(towed))


def _rate(run: RunData, signal: str, window: Window) -> float:
    """Mean rate of a signal."""
    t, values = run.signal(signal, window)
    return float((values[-1] - values[0]) / (t[-1] - t[0]))


def _shear_length(mobilised: float, slip: float, modulus: float) -> float:
    """Length of a track, m, that mobilises this part of the strength; NaN if none does."""
    if not 0.0 < mobilised < 1.0 or slip <= 0.0:
        return math.nan
    return float(brentq(lambda length: theory.shear_fraction(slip, length, modulus) - mobilised, 1e-6, 1e6))


def draw(rows: Sequence[Row]) -> files.Picture:
    """Pull over slip of each soil, inside its bracket, and the resistance."""
    soils = list(dict.fromkeys(row["soil"] for row in rows))
    figure = files.new_figure(10.0, 3.6 * math.ceil(len(soils) / 2), dpi=110)
    for pane, soil in zip(figure.subplots(math.ceil(len(soils) / 2), 2, squeeze=False).flat, soils, strict=False):
        own = sorted((row for row in rows if row["soil"] == soil), key=lambda row: row["slip"])
        slip = np.array([row["slip"] for row in own])
        column = {key: np.array([row[key] for row in own]) for key in ("pull", "low", "high", "resistance")}
        pane.fill_between(slip, column["low"], column["high"], color="0.9", label="theory")
        pane.plot(slip, column["pull"], "o-", color="C0", label="drawbar pull")
        pane.plot(slip, column["resistance"], "s--", color="C3", label="motion resistance")
        pane.set(title=named()[soil]["title"], xlabel="slip", ylabel="kN", xlim=(0.0, 1.0))
        pane.grid(alpha=0.3)
    figure.axes[0].legend(loc="lower right", fontsize=8)
    return figure


def find(rows: Sequence[Row]) -> list[Finding]:
    """Pull at the usual slip, also over the weight, and the mean resistance."""
    findings = []
    for soil in dict.fromkeys(row["soil"] for row in rows):
        own = sorted((row for row in rows if row["soil"] == soil), key=lambda row: row["slip"])
        slip = [row["slip"] for row in own]
        if slip[0] <= USUAL <= slip[-1]:
            usual, low, high = (
                float(np.interp(USUAL, slip, [row[key] for row in own])) for key in ("pull", "low", "high")
            )
            of_weight = f"{usual / own[0]['weight']:.2f} of the weight"
            findings.append(Finding(f"pull at slip {USUAL:g}, {soil}", usual, "kN", low, high, of_weight))
        findings.append(Finding(f"motion resistance, {soil}", float(np.mean([row["resistance"] for row in own])), "kN"))
    return findings
