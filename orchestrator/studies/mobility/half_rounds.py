"""Shock of half rounds over speed: largest upward acceleration of the first seat after a low pass of 30 Hz.

The limit of 2.5 g and the sizes of 4 to 12 inches are those of mobility models; a small vehicle meets smaller ones.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import groupby

from orchestrator.results.analyses import ride
from orchestrator.results.run_data import Window
from orchestrator.results.table import Column
from orchestrator.studies import Case, files
from orchestrator.studies.mobility.finding import Finding
from orchestrator.studies.mobility.limit_speed import limit_speed
from orchestrator.studies.mobility.trial import FIRM, recorded, run_up, trial, vehicle_of
from orchestrator.studies.row import Row

NAME = "half_rounds"
TITLE = "Shock of half rounds"
INCH = 0.0254  # m
RADII = tuple(inches * INCH for inches in (4, 6, 8, 10, 12))
FULL_SIZE = 1.5  # m of contact length; a shorter vehicle meets half rounds in proportion to its length
SPEEDS = (0.5, 1, 2, 3, 4, 5, 6)  # of the pace
QUICK_RADII, QUICK_SPEEDS = RADII[:3:2], SPEEDS[2::2]
LIMIT = 2.5  # g
COLUMNS = (
    Column("radius", "radius, m", ".3f"),
    Column("speed", "speed, m/s", ".3g"),
    Column("peak", "largest upward, g", ".2f"),
    Column("down", "largest downward, g", ".2f"),
    Column("belly", "force on the belly, kN", ".1f"),
    Column("note", "note"),
)
NOTES = (f"First seat of the vehicle, after a low pass of {ride.SHOCK_POLES} poles at {ride.SHOCK_CORNER:g} Hz.",)


def cases(scene: str, quick: bool) -> list[Case]:
    """Cases: every radius at every speed."""
    radii, speeds = (QUICK_RADII, QUICK_SPEEDS) if quick else (RADII, SPEEDS)
    return [
        Case(NAME, f"radius {radius:g} m, {factor} x pace", shock, (scene, radius, factor), 8.0 + factor)
        for radius in radii
        for factor in speeds
    ]


def shock(scene: str, radius: float, factor: float) -> list[Row]:
    """Row of a run over a half round at constant speed."""
    vehicle = vehicle_of(scene)
    if vehicle.length < FULL_SIZE:
        radius *= vehicle.length / FULL_SIZE
    speed, ramp = factor * vehicle.pace, run_up(vehicle, factor * vehicle.pace)
    begin = ramp + vehicle.time
    place = speed * (0.5 * ramp + 2.0 * vehicle.time)
    end = begin + 3.0 * vehicle.length / speed + 4.0 * vehicle.time
    drive = {"mode": "speed", "speed": vehicle.sprocket(speed), "ramp_start": 0.0, "ramp_time": ramp}
    ground = {"hull": True, "half_round": {"x": [place], "radius": radius}}
    run_scene = trial(
        vehicle,
        "half round",
        end,
        friction=FIRM,
        ground=ground,
        drive=drive,
        seats=[vehicle.seat],
        run={"allow": ["penetration"]},
    )
    figures: dict[str, float] = {"radius": radius, "speed": speed}
    try:
        with recorded(run_scene) as run:
            (seat,) = ride.of(run, vehicle.seat, Window(begin, end)).seats
            figures["belly"], note = 1e-3 * float(run.signal("chassis.ground.force.z")[1].max()), run.doubts
    except RuntimeError as failure:
        return [Row("", "", figures, note=str(failure))]
    up = seat.low_passed[:, ride.UP] / ride.G
    return [Row("", "", {**figures, "peak": float(up.max()), "down": float(-up.min())}, note=note)]


def _by_radius(rows: Sequence[Row]) -> list[tuple[float, list[Row]]]:
    valid = sorted((row for row in rows if "peak" in row.figures), key=lambda row: (row["radius"], row["speed"]))
    return [(radius, list(own)) for radius, own in groupby(valid, key=lambda row: row["radius"])]


def draw(rows: Sequence[Row]) -> files.Picture:
    """Peaks over speed, by radius."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7.0, 3.8), layout="constrained", dpi=110)
    pane = figure.subplots()
    for radius, own in _by_radius(rows):
        pane.plot([row["speed"] for row in own], [row["peak"] for row in own], "o-", label=f"{1e3 * radius:.0f} mm")
    pane.axhline(LIMIT, color="0.3", ls="--")
    pane.set(xlabel="speed, m/s", ylabel="largest upward acceleration, g")
    pane.grid(alpha=0.3)
    pane.legend(fontsize=8)
    return figure


def find(rows: Sequence[Row]) -> list[Finding]:
    """Speed at which the peak reaches its limit, by radius."""
    return [
        limit_speed(
            f"speed at {LIMIT:g} g, half round of {1e3 * radius:.0f} mm",
            [row["speed"] for row in own],
            [row["peak"] for row in own],
            LIMIT,
        )
        for radius, own in _by_radius(rows)
    ]
