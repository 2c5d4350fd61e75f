"""Entries for hulls that sink into soil, which bears tracks only."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from orchestrator.log.time_series import Floats
from orchestrator.results.ground_surface import gives_way, ground
from orchestrator.results.rotation import matrices
from orchestrator.results.run_data import Missing, RunData
from orchestrator.results.validity import limits
from orchestrator.results.validity.exceedance import FAILURE, Exceedance, excess
from orchestrator.results.validity.piece import Piece
from orchestrator.results.validity.sprocket_pins import HULL

PLACE = "chassis.chassis.position"


def signals(run: RunData) -> Iterator[str]:
    """Signals: pose of the hull, where there is soil."""
    if gives_way(run.scene):
        yield from (f"{HULL}.{part}" for part in "wxyz")
        yield from (f"{PLACE}.{axis}" for axis in "xyz")


def find(piece: Piece) -> Iterator[Exceedance]:
    """Entry for the deepest corner of the hull below the undeformed ground; raises Missing."""
    if gives_way(piece.run.scene):
        t, places = piece.vector(PLACE)
        depth = depths(piece.run, places, piece.vector(HULL, "wxyz")[1]).max(axis=1)
        if (first_and_worst := excess(t, depth, limits.BELLY)) is not None:
            first, worst, _ = first_and_worst
            yield Exceedance("belly", "chassis", first, "", worst, limits.BELLY, FAILURE)


def depths(run: RunData, places: Floats, orientation: Floats) -> Floats:
    """Depths (m, corners), m, of the corners of a hull at ``places`` (m, 3) with these quaternions (m, 4)."""
    hull, surface = run.scene["vehicle"]["chassis"], ground(run.scene)
    if surface is None or not hull["hull"]:
        raise Missing("the vehicle's hull has no corners")
    arms = np.array(hull["hull"]) - hull["centre"]
    corners = places[:, None] + np.einsum("mij,kj->mki", matrices(orientation), arms)
    return np.asarray(surface.height_under(corners) - corners[..., 2])
