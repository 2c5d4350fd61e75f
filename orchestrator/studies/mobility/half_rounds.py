"""Shock of half rounds over speed: largest upward acceleration of the first seat after a low pass of 30 Hz.

The limit of 2.5 g and the sizes of 4 to 12 inches are those of mobility models; a small vehicle meets smaller ones.
"""

from __future__ import annotations

from collections.abc import Sequence

from orchestrator.results.analyses import ride
from orchestrator.results.run_data import Window
from orchestrator.results.table import Column
from orchestrator.studies import Case, files
from orchestrator.studies.mobility import riding
from orchestrator.studies.mobility.finding import Finding
from orchestrator.studies.mobility.trial import run_up, vehicle_of
from orchestrator.studies.row import Row

NAME = "half_rounds"
TITLE = "Shock of half rounds"
INCH = 0.0254  # m
RADII = tuple(inches * INCH for inches in (4, 6, 8, 10, 12))
QUICK_RADII = RADII[:3:2]
FULL_SIZE = 1.5  # m of contact length; a shorter vehicle meets half rounds in proportion to its length
LIMIT = 2.5  # g
COLUMNS = (
    Column("radius", "radius, m", ".3f"),
    Column("speed", "speed, m/s", ".3g"),
    Column("peak", "largest upward, g", ".2f"),
    Column("down", "largest downward, g", ".2f"),
    Column("belly", "force on the belly, kN", ".3g"),
    Column("note", "note"),
)
NOTES = (f"First seat of the vehicle, after a low pass of {ride.SHOCK_POLES} poles at {ride.SHOCK_CORNER:g} Hz.",)


def cases(scene: str, quick: bool) -> list[Case]:
    """Cases: every radius at every speed."""
    radii = {f"radius {radius:g} m": radius for radius in (QUICK_RADII if quick else RADII)}
    return riding.cases(NAME, shock, scene, radii, quick)


def shock(scene: str, radius: float, factor: float) -> list[Row]:
    """Row of a run over a half round at constant speed."""
    vehicle = vehicle_of(scene)
    if vehicle.length < FULL_SIZE:
        radius *= vehicle.length / FULL_SIZE
    speed, unit = factor * vehicle.pace, vehicle.time
    ramp = run_up(vehicle, speed)
    place, begin = vehicle.front + speed * (0.5 * ramp + 2.0 * unit), ramp + unit
    window = Window(begin, begin + 3.0 * vehicle.length / speed + 4.0 * unit)
    half_round = {"half_round": {"x": [place], "radius": radius}}
    return riding.ridden(vehicle, "half round", speed, half_round, window, {"radius": radius, "speed": speed}, _peaks)


def _peaks(seat: ride.SeatRide) -> riding.Figures:
    up = seat.low_passed[:, ride.UP] / ride.G
    return {"peak": float(up.max()), "down": float(-up.min())}


def draw(rows: Sequence[Row]) -> files.Picture:
    """Peaks over speed, by radius."""
    figure = files.new_figure(7.0, 3.8, dpi=110)
    pane = figure.subplots()
    for radius, *curve in riding.curves(rows, "radius", "peak"):
        pane.plot(*curve, "o-", label=f"{1e3 * radius:.0f} mm")
    pane.axhline(LIMIT, color="0.3", ls="--")
    pane.set(xlabel="speed, m/s", ylabel="largest upward acceleration, g")
    pane.grid(alpha=0.3)
    pane.legend(fontsize=8)
    return figure


def find(rows: Sequence[Row]) -> list[Finding]:
    """Speed at which the peak reaches its limit, by radius."""
    return riding.limits(
        rows, "radius", "peak", LIMIT, lambda radius: f"speed at {LIMIT:g} g, half round of {1e3 * radius:.0f} mm"
    )
