"""Ride of the first seat over a range of speeds, on rough ground of ISO 8608 and over half rounds.

On rough ground both tracks run over one profile. Its figures are the seat's acceleration, its weighted value and the
absorbed power, whose limit of 6 W is that of mobility models (``vibration``).

The shock of a half round is the largest upward acceleration after a low pass of 30 Hz. The limit of 2.5 g and the sizes
of 4 to 12 inches are those of mobility models; a small vehicle meets smaller ones.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from itertools import groupby
from typing import Any

import numpy as np

from orchestrator.results import output_files
from orchestrator.results.analyses import ride
from orchestrator.results.analyses.vibration import LIMIT
from orchestrator.results.run_data import Window
from orchestrator.results.table import Column
from orchestrator.studies import Row
from orchestrator.studies.mobility.trial import (
    FIRM,
    Finding,
    Trial,
    Vehicle,
    limit_speed,
    recorded,
    run_up,
    trial_scene,
    vehicle_of,
)

SPEEDS = (0.5, 1, 2, 3, 4, 5, 6)  # of the pace
BELLY = "chassis.ground.force.z"
Figures = dict[str, Any]


def _at_speeds(
    function: Callable[..., list[Row]], label: str, grounds: Sequence[Any], chosen: slice
) -> Callable[[bool], list[Any]]:
    """Runs of a trial: every ground, named by ``label``, at every speed; the ``chosen`` grounds of a quick study."""
    return lambda quick: [
        (f"{label.format(ground)}, {factor} x pace", function, (ground, factor), 10.0 + factor)
        for ground in (grounds[chosen] if quick else grounds)
        for factor in (SPEEDS[2::2] if quick else SPEEDS)
    ]


def _ridden(
    vehicle: Vehicle,
    title: str,
    speed: float,
    ground: Mapping[str, Any],
    window: Window,
    about: Figures,
    measured: Callable[[ride.SeatRide], Figures],
) -> list[Row]:
    """Row of a run over a ground at a ``speed``, m/s, on firm ground.

    ``about``: figures that name the run; ``measured`` gives those of its ride in the ``window``.
    """
    run_scene = trial_scene(
        vehicle, title, window.end, friction=FIRM, ground={"hull": True, **ground},
        drive=vehicle.drive(speed, run_up(vehicle, speed)), seats=[vehicle.seat], run={"allow": ["penetration"]},
    )  # fmt: skip
    try:
        with recorded(run_scene) as run:
            (seat,) = ride.of(run, vehicle.seat, window).seats
            belly = 1e-3 * float(run.signal(BELLY)[1].max())
    except RuntimeError as failure:
        return [Row("", "", about, note=str(failure))]
    return [Row("", "", {**about, "belly": belly, **measured(seat)}, note=run.doubts)]


def _curves(rows: Sequence[Row], by: str, figure: str) -> list[tuple[Any, list[float], list[float]]]:
    """Grounds by their figure ``by``, each with the rising speeds at which it has the ``figure``, and its values."""
    valid = sorted((row for row in rows if figure in row.figures), key=lambda row: (row[by], row["speed"]))
    found = [(ground, list(own)) for ground, own in groupby(valid, key=lambda row: row[by])]
    return [(ground, [row["speed"] for row in own], [row[figure] for row in own]) for ground, own in found]


def _limits(rows: Sequence[Row], by: str, figure: str, limit: float, text: Callable[[Any], str]) -> list[Finding]:
    """Speed at which a figure reaches its limit, by ground; ``text`` names the measure."""
    return [limit_speed(text(ground), speeds, values, limit) for ground, speeds, values in _curves(rows, by, figure)]


# --- rough ground ---

CLASSES = ("B", "C", "D", "E")
MEASURED = 16.0  # of the time scale: length of the window
SEED = 1


def vibration(scene: str, iso_class: str, factor: float) -> list[Row]:
    """Row of a run at constant speed."""
    vehicle = vehicle_of(scene)
    speed, unit = factor * vehicle.pace, vehicle.time
    begin = run_up(vehicle, speed) + 2.0 * unit
    start = vehicle.front + 0.2 * vehicle.length
    rough = {"rough": {"iso_class": iso_class, "seed": SEED, "correlated": True, "start": start}}
    window, about = Window(begin, begin + MEASURED * unit), {"iso_class": iso_class, "speed": speed}
    return _ridden(vehicle, "rough ground", speed, rough, window, about, _vibration)


def _vibration(seat: ride.SeatRide) -> Figures:
    up = ride.UP
    return {
        "rms": float(ride.rms(seat.acceleration)[up]),
        "weighted": float(seat.weighted_rms[up]),
        "total": seat.total,
        "power": seat.absorbed_power,
        "peak": float(np.abs(seat.low_passed[:, up]).max()) / ride.G,
    }


def _draw_vibration(rows: Sequence[Row]) -> output_files.Picture:
    """Weighted acceleration and absorbed power over speed, by class."""
    figure = output_files.new_figure(10.0, 3.8, dpi=110)
    panes = figure.subplots(1, 2)
    for pane, key in zip(panes, ("weighted", "power"), strict=True):
        for name, *curve in _curves(rows, "iso_class", key):
            pane.semilogy(*curve, "o-", label=f"class {name}")
        pane.grid(alpha=0.3)
    panes[0].set(xlabel="speed, m/s", ylabel="vertical acceleration weighted by Wk, m/s2")
    panes[1].set(xlabel="speed, m/s", ylabel="absorbed power, W")
    panes[1].axhline(LIMIT, color="0.3", ls="--")
    panes[0].legend(fontsize=8)
    return figure


# --- half rounds ---

INCH = 0.0254  # m
RADII = tuple(inches * INCH for inches in (4, 6, 8, 10, 12))
FULL_SIZE = 1.5  # m of contact length; a shorter vehicle meets half rounds in proportion to its length
SHOCK = 2.5  # g, the limit


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
    return _ridden(vehicle, "half round", speed, half_round, window, {"radius": radius, "speed": speed}, _peaks)


def _peaks(seat: ride.SeatRide) -> Figures:
    up = seat.low_passed[:, ride.UP] / ride.G
    return {"peak": float(up.max()), "down": float(-up.min())}


def _draw_shock(rows: Sequence[Row]) -> output_files.Picture:
    """Peaks over speed, by radius."""
    figure = output_files.new_figure(7.0, 3.8, dpi=110)
    pane = figure.subplots()
    for radius, *curve in _curves(rows, "radius", "peak"):
        pane.plot(*curve, "o-", label=f"{1e3 * radius:.0f} mm")
    pane.axhline(SHOCK, color="0.3", ls="--")
    pane.set(xlabel="speed, m/s", ylabel="largest upward acceleration, g")
    pane.grid(alpha=0.3)
    pane.legend(fontsize=8)
    return figure


ROUGHNESS = Trial(
    "roughness",
    "Ride on rough ground",
    (
        Column("iso_class", "class"),
        Column("speed", "speed, m/s", ".3g"),
        Column("rms", "vertical rms, m/s2", ".3f"),
        Column("weighted", "weighted by Wk, m/s2", ".3f"),
        Column("total", "vibration total value, m/s2", ".3f"),
        Column("power", "absorbed power, W", ".3f"),
        Column("peak", "largest, g", ".2f"),
        Column("note", "note"),
    ),
    (
        f"Seed {SEED}, both tracks on one profile, first seat of the vehicle. Wk and the total value are of ISO 2631-1;"
        " absorbed power is that of the rational filter.",
    ),
    _at_speeds(vibration, "class {}", CLASSES, slice(1, 3)),
    _draw_vibration,
    lambda rows: _limits(rows, "iso_class", "power", LIMIT, lambda name: f"speed at {LIMIT:g} W, class {name}"),
)

HALF_ROUNDS = Trial(
    "half_rounds",
    "Shock of half rounds",
    (
        Column("radius", "radius, m", ".3f"),
        Column("speed", "speed, m/s", ".3g"),
        Column("peak", "largest upward, g", ".2f"),
        Column("down", "largest downward, g", ".2f"),
        Column("belly", "force on the belly, kN", ".3g"),
        Column("note", "note"),
    ),
    (f"First seat of the vehicle, after a low pass of {ride.SHOCK_POLES} poles at {ride.SHOCK_CORNER:g} Hz.",),
    _at_speeds(shock, "radius {:g} m", RADII, slice(0, 3, 2)),
    _draw_shock,
    lambda rows: _limits(
        rows, "radius", "peak", SHOCK, lambda radius: f"speed at {SHOCK:g} g, half round of {1e3 * radius:.0f} mm"
    ),
)
