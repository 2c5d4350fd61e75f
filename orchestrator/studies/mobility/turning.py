"""Turning on soils beside hard ground: rate, radius, steering moment and power at sprocket speeds of 0.8 to 1.2."""

from __future__ import annotations

from collections.abc import Sequence

from orchestrator.results import turning
from orchestrator.results.run_data import Window
from orchestrator.results.table import Column
from orchestrator.studies import Case, files
from orchestrator.studies.mobility.finding import Finding
from orchestrator.studies.mobility.pressure import GROUNDS, HARD
from orchestrator.studies.mobility.trial import recorded, trial, vehicle_of
from orchestrator.studies.row import Row

NAME = "turning"
TITLE = "Turning on soil"
DIFFERENCE = 0.2  # of the speed, either way
RAMP, SETTLED, END = 4.0, 8.0, 14.0  # of the time scale
COLUMNS = (
    Column("case", "ground"),
    Column("rate", "yaw rate, rad/s", ".4f"),
    Column("radius", "radius, m", ".2f"),
    Column("kinematic", "radius without slip, m", ".2f"),
    Column("moment", "steering moment, kN m", ".4g"),
    Column("inner", "inner sprocket, kW", ".4g"),
    Column("outer", "outer sprocket, kW", ".4g"),
    Column("ok", "ok"),
    Column("note", "note"),
)
NOTES = (
    f"Left turn with sprockets at {1 - DIFFERENCE:g} and {1 + DIFFERENCE:g} of the pace. Each track knows its own rut;"
    " soil that it pushes aside does not resist (no bulldozing).",
)


def cases(scene: str, quick: bool) -> list[Case]:
    """Cases: every ground."""
    return [Case(NAME, ground, turn, (scene, ground), 40.0) for ground in (GROUNDS[:2] if quick else GROUNDS)]


def turn(scene: str, ground: str) -> list[Row]:
    """Row of a turn."""
    vehicle = vehicle_of(scene)
    speed, unit = vehicle.pace, vehicle.time
    sides = {
        side: {"speed": vehicle.sprocket((1.0 + sign * DIFFERENCE) * speed)} for side, sign in turning.SIGN.items()
    }
    run_scene = trial(
        vehicle, f"turn on {ground}", END * unit, whole=True,
        ground={} if ground == HARD else {"soil": {"name": ground}},
        drive={"mode": "speed", "ramp_time": RAMP * unit, **sides},
    )  # fmt: skip
    kinematic = vehicle.table.track.lateral / DIFFERENCE
    window = Window(SETTLED * unit, END * unit)
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


def draw(rows: Sequence[Row]) -> files.Picture:
    """Bars of radius and steering moment by ground."""
    figure = files.new_figure(10.0, 3.6, dpi=110)
    panes = figure.subplots(1, 2)
    for pane, key, label in zip(panes, ("radius", "moment"), ("radius, m", "steering moment, kN m"), strict=True):
        pane.bar([row.case for row in rows], [row[key] for row in rows], color="C0", width=0.6)
        pane.set(ylabel=label)
        pane.tick_params(axis="x", labelsize=8)
    panes[0].axhline(rows[0]["kinematic"], color="C3", ls="--", label="without slip")
    panes[0].legend(fontsize=8)
    return figure


def find(rows: Sequence[Row]) -> list[Finding]:
    """Radius by ground."""
    return [Finding(f"radius of the turn, {row.case}", row["radius"], "m", row["kinematic"]) for row in rows]
