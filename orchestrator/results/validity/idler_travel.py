"""Entries for idlers that leave the travel of their tensioner."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from fmus.sides import of_side
from orchestrator.results.analyses import hull
from orchestrator.results.rotation import body_axis
from orchestrator.results.run_data import Missing, RunData
from orchestrator.results.validity.exceedance import WARNING, Exceedance, excess
from orchestrator.results.validity.piece import Piece
from orchestrator.results.validity.sprocket_pins import HULL

TRAVEL = 0.1  # m, for older vehicle tables without this key


def signals(run: RunData) -> Iterator[str]:
    """Signals: positions of the idlers, pose of the hull."""
    yield from (f"{HULL}.{part}" for part in "wxyz")
    for name in ("chassis.chassis.position", *_idlers(run)):
        yield from (f"{name}.{axis}" for axis in "xyz")


def find(piece: Piece) -> Iterator[Exceedance]:
    """Entries for idlers that are further from their start position than the travel; raises Missing."""
    run = piece.run
    try:
        travel = hull.vehicle_number(run, "tensioner", "travel")
    except Missing:
        travel = TRAVEL
    if "vehicle" not in run.scene:
        raise Missing("the log has no vehicle")
    for name in _idlers(run):
        vehicle = of_side(run.scene["vehicle"], name.split(".")[1])
        drawn = vehicle.get("idler", {}).get("x", np.nan)
        t, place = piece.vector(name)
        ahead = body_axis(piece.vector(HULL, "wxyz")[1], 0)
        x = np.einsum("mi,mi->m", place - piece.vector("chassis.chassis.position")[1], ahead)
        travelled = np.abs(x + run.scene["vehicle"]["chassis"]["centre"][0] - drawn)
        if (first_and_worst := excess(t, travelled, travel)) is not None:
            place_of = name.removeprefix("chassis.").removesuffix(".position")
            yield Exceedance(
                "idler_travel", "chassis", first_and_worst[0], place_of, first_and_worst[1], travel, WARNING
            )


def _idlers(run: RunData) -> list[str]:
    names = [f"chassis.{side}.idler.position" for side in ("left", "right")]
    return [name for name in names if run.has(f"{name}.x")]
