"""Checks of the hull: in the ground, its idlers beyond their travel, beside or askew to a ground's lanes."""

from __future__ import annotations

from collections.abc import Iterator
from math import cos
from typing import Any

import numpy as np

from fmus.vehicles.sides import SIDES, ground_wheels, of_side, smooth_wheels
from orchestrator.log.reader import Missing
from orchestrator.log.time_series import Floats
from orchestrator.results.analyses import hull
from orchestrator.results.ground_surface import gives_way, ground, on_terrain
from orchestrator.results.ground_under_vehicle import POSE
from orchestrator.results.rotation import body_axis, matrices
from orchestrator.results.run_data import RunData
from orchestrator.results.validity.exceedance import FAILURE, WARNING, Exceedance, exceedance
from orchestrator.results.validity.piece import Piece
from orchestrator.results.validity.sprocket_checks import HULL
from orchestrator.vocabulary import limits

PLACE = "chassis.chassis.position"
FORCE = "chassis.ground.force"


def belly_signals(run: RunData) -> Iterator[str]:
    """Signals: pose of the hull of a vehicle, force of the ground on it."""
    if run.scene.get("assembly") == "vehicle":
        yield from (f"{HULL}.{part}" for part in "wxyz")
        yield from (f"{name}.{axis}" for name in (PLACE, FORCE) for axis in "xyz")


NO_POINTS = "the vehicle has no hull points (chassis.hull)"


def belly(piece: Piece) -> Iterator[Exceedance]:
    """Entry for the deepest corner of the hull below the undeformed ground; raises Missing."""
    scene = piece.run.scene
    soft, chassis = gives_way(scene), (scene.get("vehicle") or {}).get("chassis") or {}
    if scene.get("assembly") != "vehicle" or not (soft or on_terrain(scene) or chassis.get("hull")):
        return
    if not chassis.get("hull"):
        raise Missing(NO_POINTS)
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
    yield from exceedance(kind, "chassis", "", t, depth, limit, severity)


def depths(run: RunData, places: Floats, orientation: Floats) -> Floats:
    """Depths (m, corners), m, of the corners of a hull at ``places`` (m, 3) with these quaternions (m, 4)."""
    chassis, surface = run.scene["vehicle"]["chassis"], run.compute_once("ground", lambda _: ground(run.scene))
    if surface is None:
        raise Missing("the scene has no ground")
    arms = np.array(chassis["hull"]) - chassis["centre"]
    corners = places[:, None] + np.einsum("mij,kj->mki", matrices(orientation), arms)
    return np.asarray(surface.height_under(corners) - corners[..., 2])


TRAVEL = 0.1  # m, for older vehicle tables without this key


def idler_travel_signals(run: RunData) -> Iterator[str]:
    """Signals: positions of the wheels that slide, pose of the hull."""
    yield from (f"{HULL}.{part}" for part in "wxyz")
    for name in (PLACE, *(f"chassis.{name}.position" for name in _sliding(run))):
        yield from (f"{name}.{axis}" for axis in "xyz")


def idler_travel(piece: Piece) -> Iterator[Exceedance]:
    """Entries for idlers that are further from their start position than the travel; raises Missing."""
    if "vehicle" not in piece.run.scene:
        raise Missing("the log has no vehicle")
    for name, wheel in _sliding(piece.run).items():
        t, place = piece.vector(f"chassis.{name}.position")
        ahead, slide = body_axis(piece.vector(HULL, "wxyz")[1], 0), wheel["tensioner"]
        x = np.einsum("mi,mi->m", place - piece.vector(PLACE)[1], ahead)
        way = np.abs(x + piece.run.scene["vehicle"]["chassis"]["centre"][0] - wheel["x"]) / cos(slide.get("angle", 0.0))
        yield from exceedance("idler_travel", "chassis", name, t, way, slide.get("travel", TRAVEL))


def _sliding(run: RunData) -> dict[str, dict[str, Any]]:
    """Numbers of the wheels that slide on springs and whose motion was recorded, by name, "left.idler"."""
    try:
        tables = {side: of_side(run.scene.get("vehicle") or {}, side) for side in SIDES}
        found = {f"{side}.{wheel['name']}": wheel for side, table in tables.items() for wheel in smooth_wheels(table)}
    except (AttributeError, TypeError, ValueError):  # a table of another version
        return {}
    return {name: found[name] for name in found if found[name]["tensioner"] and run.has(f"chassis.{name}.position.x")}


def lanes_signals(run: RunData) -> Iterator[str]:
    """Signals: heading and place of the hull."""
    yield from POSE if on_terrain(run.scene) else ()


def lanes(piece: Piece) -> Iterator[Exceedance]:
    """Entries for a vehicle askew on roughness along x, and for one whose tracks leave their lanes; raises Missing."""
    run, scene = piece.run, piece.run.scene
    rough, waves = ((scene.get("ground") or {}).get(key) or {} for key in ("rough", "washboard"))
    rough = {} if rough.get("isotropic") else rough
    apart = (rough, not rough.get("correlated")), (waves, waves.get("phase"))
    lanes = [ground["start"] for ground, two in apart if ground and two]
    if not rough and not lanes:
        return
    t, pose = piece.columns([*POSE])
    reach = max(abs(wheel["x"] - scene["vehicle"]["chassis"]["centre"][0]) for wheel in ground_wheels(scene["vehicle"]))
    askew, y, x = np.abs(np.sin(pose[:, 0])), np.abs(pose[:, 2]), pose[:, 1] + reach  # x of the foremost wheels along x
    found = []
    if rough:
        found.append(("askew", np.where(x > rough["start"], 1.0 - np.sqrt(1.0 - askew * askew), 0.0), limits.ASKEW))
    if lanes:
        from fmus.ground.terrain import BLEND  # loads the kernels of a terrain

        inner = hull.vehicle_number(run, "track", "lateral") - 0.5 * hull.vehicle_number(run, "track", "width")
        found.append(("lanes", np.where(x > min(lanes), y + reach * askew + BLEND - inner, 0.0), limits.LANE))
    for kind, values, limit in found:
        yield from exceedance(kind, "chassis", "", t, values, limit)
