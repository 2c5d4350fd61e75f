"""Ride of the first seat at constant speed, over a range of speeds."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from itertools import groupby
from typing import Any

from orchestrator.results.analyses import ride
from orchestrator.results.run_data import Window
from orchestrator.studies import Case
from orchestrator.studies.mobility.finding import Finding, limit_speed
from orchestrator.studies.mobility.trial import FIRM, Vehicle, recorded, run_up, trial
from orchestrator.studies.row import Row

SPEEDS = (0.5, 1, 2, 3, 4, 5, 6)  # of the pace
QUICK_SPEEDS = SPEEDS[2::2]
BELLY = "chassis.ground.force.z"
Figures = dict[str, Any]


def cases(
    name: str, function: Callable[..., list[Row]], scene: str, grounds: Mapping[str, Any], quick: bool
) -> list[Case]:
    """Cases of a trial: every ground, by its label, at every speed."""
    return [
        Case(name, f"{label}, {factor} x pace", function, (scene, ground, factor), 10.0 + factor)
        for label, ground in grounds.items()
        for factor in (QUICK_SPEEDS if quick else SPEEDS)
    ]


def ridden(
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
    drive = {"mode": "speed", "speed": vehicle.sprocket(speed), "ramp_start": 0.0, "ramp_time": run_up(vehicle, speed)}
    run_scene = trial(
        vehicle, title, window.end, friction=FIRM, ground={"hull": True, **ground}, drive=drive, seats=[vehicle.seat],
        run={"allow": ["penetration"]},
    )  # fmt: skip
    try:
        with recorded(run_scene) as run:
            (seat,) = ride.of(run, vehicle.seat, window).seats
            belly = 1e-3 * float(run.signal(BELLY)[1].max())
    except RuntimeError as failure:
        return [Row("", "", about, note=str(failure))]
    return [Row("", "", {**about, "belly": belly, **measured(seat)}, note=run.doubts)]


def curves(rows: Sequence[Row], by: str, figure: str) -> list[tuple[Any, list[float], list[float]]]:
    """Grounds by their figure ``by``, each with the rising speeds at which it has the ``figure``, and its values."""
    valid = sorted((row for row in rows if figure in row.figures), key=lambda row: (row[by], row["speed"]))
    found = [(ground, list(own)) for ground, own in groupby(valid, key=lambda row: row[by])]
    return [(ground, [row["speed"] for row in own], [row[figure] for row in own]) for ground, own in found]


def limits(rows: Sequence[Row], by: str, figure: str, limit: float, text: Callable[[Any], str]) -> list[Finding]:
    """Speed at which a figure reaches its limit, by ground; ``text`` names the measure."""
    return [limit_speed(text(ground), speeds, values, limit) for ground, speeds, values in curves(rows, by, figure)]
