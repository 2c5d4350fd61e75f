"""Entries for hulls that sink into soil, which bears tracks only, or deep into hard ground."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from orchestrator.log.time_series import Floats
from orchestrator.results.analyses import hull
from orchestrator.results.ground_surface import gives_way, ground
from orchestrator.results.rotation import matrices
from orchestrator.results.run_data import Missing, RunData
from orchestrator.results.validity import limits
from orchestrator.results.validity.exceedance import FAILURE, WARNING, Exceedance, excess
from orchestrator.results.validity.piece import Piece
from orchestrator.results.validity.sprocket_pins import HULL

PLACE = "chassis.chassis.position"
FORCE = "chassis.ground.force"


def signals(run: RunData) -> Iterator[str]:
    """Signals: pose of the hull of a vehicle, force of the ground on it."""
    if run.scene.get("assembly") == "vehicle":
        yield from (f"{HULL}.{part}" for part in "wxyz")
        yield from (f"{name}.{axis}" for name in (PLACE, FORCE) for axis in "xyz")


def find(piece: Piece) -> Iterator[Exceedance]:
    """Entry for the deepest corner of the hull below the undeformed ground; raises Missing."""
    scene = piece.run.scene
    soft, chassis = gives_way(scene), (scene.get("vehicle") or {}).get("chassis") or {}
    if scene.get("assembly") != "vehicle" or not (soft or chassis.get("hull")):
        return
    t, places = piece.vector(PLACE)
    depth = depths(piece.run, places, piece.vector(HULL, "wxyz")[1]).max(axis=1)
    if soft:
        kind, limit, severity = "belly", limits.BELLY, FAILURE
    elif (scene.get("ground") or {}).get("hull"):
        kind, limit, severity = "hull", limits.HULL * hull.vehicle_number(piece.run, "track", "face"), WARNING
        # a corner beside a wall is less deep than the wall is high: the force bounds the depth, too
        force = np.linalg.norm(piece.vector(FORCE)[1], axis=1)
        depth = np.minimum(depth, force / hull.vehicle_number(piece.run, "contact", "ground", "stiffness"))
    else:
        kind, limit, severity = "hull", 0.0, WARNING
    if (first_and_worst := excess(t, depth, limit)) is not None:
        first, worst, _ = first_and_worst
        yield Exceedance(kind, "chassis", first, "", worst, limit, severity)


def depths(run: RunData, places: Floats, orientation: Floats) -> Floats:
    """Depths (m, corners), m, of the corners of a hull at ``places`` (m, 3) with these quaternions (m, 4)."""
    chassis, surface = run.scene["vehicle"]["chassis"], run.compute_once("ground", lambda _: ground(run.scene))
    if surface is None or not chassis["hull"]:
        raise Missing("the vehicle's hull has no corners")
    arms = np.array(chassis["hull"]) - chassis["centre"]
    corners = places[:, None] + np.einsum("mij,kj->mki", matrices(orientation), arms)
    return np.asarray(surface.height_under(corners) - corners[..., 2])
