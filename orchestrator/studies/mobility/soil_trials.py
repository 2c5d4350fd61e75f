"""Trials at constant speeds of the sprockets, on hard ground and on soils: drawbar pull, pressure, turning.

Drawbar pull and motion resistance over slip: a load on the hitch that grows steeply with the speed sets the slip.
Resistance is the power of compaction over the speed of the chain: a link that comes down on its slope presses the soil
at this speed, however far the vehicle gets.

Mean maximum pressure: the mean over time of the largest pressures under the road wheels, as Rowland defined it
(Proceedings of the 4th Conference of the ISTVS, Stockholm, 1972) and Wong measured it (Journal of Terramechanics 31(3),
1994, 197-213), found from the forces on links, not by an empirical formula. Pressure is the force of the ground on a
link over pitch and width. Cone index figures are not given: they are regressions over vehicles.

Turning: rate, radius, steering moment and power at sprocket speeds of 0.8 to 1.2 of the pace.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import Any

import numpy as np
from scipy.optimize import brentq

from fmus.ground.soils import law_of, named
from fmus.vehicles.sides import ground_wheels
from orchestrator.results import output_files, turning, vehicle_measures
from orchestrator.results.analyses import circuit
from orchestrator.results.analyses.ground_pressure import SIGNAL, pad_area, pressure
from orchestrator.results.run_data import RunData, Window
from orchestrator.results.table import Column
from orchestrator.studies import Row
from orchestrator.studies.mobility import theory
from orchestrator.studies.mobility.trial import Finding, Trial, Vehicle, recorded, trial_scene, vehicle_of

SOILS = ("dry_sand", "lete_sand", "sandy_loam_15", "clayey_soil_38")
HARD = "hard ground"
RAMP = 4.0  # of the time scale: the sprockets' ramp


def _ground(name: str) -> dict[str, Any]:
    """Table of a ground of the trials."""
    return {} if name == HARD else {"soil": {"name": name}}


def _on_grounds(function: Callable[..., list[Row]], seconds: float) -> Callable[[bool], list[Any]]:
    """Runs of a trial on hard ground and on every soil."""
    grounds = (HARD, *SOILS)
    return lambda quick: [(ground, function, (ground,), seconds) for ground in grounds[: 2 if quick else None]]


def _bars(pane: Any, rows: Sequence[Row], key: str, label: str) -> None:
    """Bars of a figure by ground."""
    pane.bar([row.case for row in rows], [row[key] for row in rows], color="C0", width=0.6)
    pane.set(ylabel=label)


# --- drawbar pull ---

SLIPS = (0.02, 0.05, 0.1, 0.2, 0.35, 0.5, 0.7, 0.9)
STEEP = 0.1  # of the speed, over which the load grows to the weight
USUAL = 0.2  # slip at which pulls are compared


def pull(scene: str, soil: str, aim: float) -> list[Row]:
    """Row of a run near a slip."""
    vehicle = vehicle_of(scene)
    speed, unit = vehicle.pace, vehicle.time
    slowest = max((1.0 - aim - 0.02) * speed, 0.0)
    load = [(slowest, 0.0), (slowest + STEEP * speed, vehicle.weight)]
    run_scene = trial_scene(
        vehicle, f"drawbar pull on {soil}", 12.0 * unit,
        ground=_ground(soil), drive=vehicle.drive(speed, RAMP * unit),
        hitch={"drag_points": load, "ramp_start": 0.5 * RAMP * unit, "ramp_time": 0.5 * RAMP * unit},
    )  # fmt: skip
    with recorded(run_scene) as run:
        return [_pull_row(vehicle, soil, run, Window(8.0 * unit, 12.0 * unit), speed)]


def _pull_row(vehicle: Vehicle, name: str, run: RunData, window: Window, speed: float) -> Row:
    track = vehicle.table.track
    soil = law_of(name, track.pitch, track.width)
    slip, towed = vehicle_measures.slip(run, "", window), run.mean("chassis.hitch.pull", window)
    compacted = sum(
        run.copies(part) * run.rate(f"{part}.energy.dissipated.ground_damping", window) for part in run.tracks
    )
    driven = sum(
        run.copies(run.tracks[k]) * run.rate(f"{run.drive(side)}.energy.work", window)
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


def _shear_length(mobilised: float, slip: float, modulus: float) -> float:
    """Length of a track, m, that mobilises this part of the strength; NaN if none does."""
    if not 0.0 < mobilised < 1.0 or slip <= 0.0:
        return math.nan
    return float(brentq(lambda length: theory.shear_fraction(slip, length, modulus) - mobilised, 1e-6, 1e6))


def _draw_pull(rows: Sequence[Row]) -> output_files.Picture:
    """Pull over slip of each soil, inside its bracket, and the resistance."""
    soils = list(dict.fromkeys(row["soil"] for row in rows))
    figure = output_files.new_figure(10.0, 3.6 * math.ceil(len(soils) / 2), dpi=110)
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


def _pulls(rows: Sequence[Row]) -> list[Finding]:
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


# --- pressure on the ground ---

EVERY = 8  # steps over which forces on links are averaged


def maxima(scene: str, ground: str) -> list[Row]:
    """Row of a run at constant speed."""
    vehicle = vehicle_of(scene)
    unit = vehicle.time
    run_scene = trial_scene(
        vehicle, f"pressure on {ground}", 10.0 * unit,
        ground=_ground(ground), drive=vehicle.drive(vehicle.pace, RAMP * unit),
        track={"link_outputs": ["position", "ground"]},
        run={"links": EVERY},
    )  # fmt: skip
    with recorded(run_scene) as run:
        return [_pressure_row(vehicle, run, Window(6.0 * unit, 10.0 * unit))]


def _pressure_row(vehicle: Vehicle, run: RunData, window: Window) -> Row:
    area, wheels = pad_area(run), [wheel["x"] for wheel in ground_wheels(vehicle.table.model_dump())]
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


def _draw_pressure(rows: Sequence[Row]) -> output_files.Picture:
    """Bars of the mean maximum pressure by ground, beside the nominal one."""
    figure = output_files.new_figure(8.0, 3.6, dpi=110)
    pane = figure.subplots()
    _bars(pane, rows, "mean_maximum", "mean maximum pressure, kPa")
    pane.axhline(rows[0]["nominal"], color="C3", ls="--", label="nominal: weight over both tracks")
    pane.axhline(rows[0]["single"], color="0.4", ls=":", label="one link under each wheel")
    pane.legend(fontsize=8)
    return figure


# --- turning ---

DIFFERENCE = 0.2  # of the speed, either way


def turn(scene: str, ground: str) -> list[Row]:
    """Row of a turn."""
    vehicle = vehicle_of(scene)
    speed, unit = vehicle.pace, vehicle.time
    sides = {
        side: {"speed": vehicle.sprocket((1.0 + sign * DIFFERENCE) * speed)} for side, sign in turning.SIGN.items()
    }
    run_scene = trial_scene(
        vehicle, f"turn on {ground}", 14.0 * unit, whole=True,
        ground=_ground(ground),
        drive={"mode": "speed", "ramp_time": RAMP * unit, **sides},
    )  # fmt: skip
    kinematic = vehicle.table.track.lateral / DIFFERENCE
    window = Window(8.0 * unit, 14.0 * unit)
    with recorded(run_scene) as run:
        figures = {
            "rate": turning.yaw_rate(run, "", window),
            "radius": turning.turn_radius(run, "", window),
            "kinematic": kinematic,
            "moment": 1e-3 * turning.steering_moment(run, "", window),
            "inner": 1e-3 * turning.drive_power(run, "left", window),
            "outer": 1e-3 * turning.drive_power(run, "right", window),
        }
    return [Row("", "", figures, bool(figures["radius"] > kinematic and figures["moment"] > 0.0))]


def _draw_turn(rows: Sequence[Row]) -> output_files.Picture:
    """Bars of radius and steering moment by ground."""
    figure = output_files.new_figure(10.0, 3.6, dpi=110)
    panes = figure.subplots(1, 2)
    for pane, key, label in zip(panes, ("radius", "moment"), ("radius, m", "steering moment, kN m"), strict=True):
        _bars(pane, rows, key, label)
        pane.tick_params(axis="x", labelsize=8)
    panes[0].axhline(rows[0]["kinematic"], color="C3", ls="--", label="without slip")
    panes[0].legend(fontsize=8)
    return figure


DRAWBAR = Trial(
    "drawbar",
    "Drawbar pull and motion resistance over slip",
    (
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
    ),
    (
        "Slip is 1 - v/V, V a pitch a pin. Theory: (A c + W tan phi)(1 - K/(i L) (1 - exp(-i L/K))) less compaction,"
        " for L and A of one link under each wheel, to those between the outer wheels.",
        "Shear length: the L with which the thrust is pull and resistance. Shear begins anew under each wheel.",
    ),
    lambda quick: [
        (f"{soil}, slip {slip:g}", pull, (soil, slip), 10.0) for soil in SOILS for slip in SLIPS[1::2] * quick or SLIPS
    ],
    _draw_pull,
    _pulls,
)

PRESSURE = Trial(
    "pressure",
    "Mean maximum pressure on the ground",
    (
        Column("case", "ground"),
        Column("mean_maximum", "mean maximum pressure, kPa", ".4g"),
        Column("nominal", "nominal pressure, kPa", ".4g"),
        Column("single", "one link under each wheel, kPa", ".4g"),
        Column("peak", "largest pressure, kPa", ".4g"),
        Column("wheels", "under each wheel from the front, kPa"),
        Column("ok", "ok"),
    ),
    ("Nominal: the weight over both tracks between the outer wheels.",),
    _on_grounds(maxima, 15.0),
    _draw_pressure,
    lambda rows: [
        Finding(f"mean maximum pressure, {row.case}", row["mean_maximum"], "kPa", row["nominal"], row["single"])
        for row in rows
    ],
)

TURNING = Trial(
    "turning",
    "Turning on soil",
    (
        Column("case", "ground"),
        Column("rate", "yaw rate, rad/s", ".4f"),
        Column("radius", "radius, m", ".2f"),
        Column("kinematic", "radius without slip, m", ".2f"),
        Column("moment", "steering moment, kN m", ".4g"),
        Column("inner", "inner sprocket, kW", ".4g"),
        Column("outer", "outer sprocket, kW", ".4g"),
        Column("ok", "ok"),
        Column("note", "note"),
    ),
    (
        f"Left turn with sprockets at {1 - DIFFERENCE:g} and {1 + DIFFERENCE:g} of the pace. Each track knows its own"
        " rut; soil that it pushes aside does not resist (no bulldozing).",
    ),
    _on_grounds(turn, 40.0),
    _draw_turn,
    lambda rows: [Finding(f"radius of the turn, {row.case}", row["radius"], "m", row["kinematic"]) for row in rows],
)
