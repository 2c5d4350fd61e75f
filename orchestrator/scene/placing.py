"""Start of a scene: idlers where chains carry their static tension, a vehicle in equilibrium."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from functools import cache
from typing import Any

from fmus.ground.tables import GroundTable
from fmus.rest.equilibrium import FlexibleTrack, VehicleEquilibrium, equilibrium
from fmus.rest.standing import DoesNotStand, Places, StandingVehicle, standing_vehicle, with_idlers
from fmus.rest.tensioning import Links, WheelPlace, tension_wheel
from fmus.start import hull_clearance
from fmus.vehicles.tables import BadInput
from fmus.vehicles.vehicle import VehicleTable
from orchestrator.scene.ground_plane import GroundPlane
from orchestrator.scene.kinds import RigScene, Scene, VehicleScene
from orchestrator.scene.parts import Part, closed_track_config, own_parts
from orchestrator.scene.tables import EquilibriumTable, StandingTable, VehicleStartTable
from orchestrator.scene.values import SIDES, Parameters, Side
from orchestrator.vocabulary.limits import BELLY


def placed(scene: Scene) -> Scene:
    """The scene with idlers where chains carry their static tension, and in equilibrium.

    A placed scene (from a log) is returned as it is. Raises BadInput if the track cannot be laid round its wheels or
    cannot carry the tension.
    """
    if scene.placed:
        return scene
    match scene:
        case RigScene():
            x = _laid_idler(scene, scene.rig.tension, "rig").x
            scene = scene.model_copy(update={"rig": scene.rig.model_copy(update={"axle_distance": -x})})
        case VehicleScene():
            scene = _scene_at_rest(_tensioned_scene(scene))
    return scene.model_copy(update={"placed": True})


def _tensioned_scene(scene: VehicleScene) -> VehicleScene:
    """Vehicle with idlers where the tracks of the standing vehicle carry their tension, and with the balancing preload.

    Without gravity nothing stands, and a vehicle that tips over does not: its tracks carry their tension as drawn.
    """
    if not scene.tracks:
        return scene
    tension, why = scene.vehicle.track.tension, "without gravity"
    if scene.vehicle.gravity:
        try:
            found = _standing_vehicle(scene)
        except DoesNotStand as error:
            if scene.start.state == "equilibrium":
                raise BadInput(
                    "the vehicle's equilibrium was not found, start.state = 'drawn' needs none: on level, hard ground,"
                    f" where its tracks are to carry {tension:.6g} N, {error}"
                ) from None
            why = str(error)
        else:
            rest = _numbers(found.rest)
            standing = StandingTable(drawn=tuple(found.drawn), height=rest["height"], tracks=rest["tracks"])
            return _with_idlers(scene, found.places, found.pushes, standing)
    laid = [_laid_idler(scene, tension, "vehicle.track")]
    if scene.vehicle.right is not None:
        laid.append(_laid_idler(scene, tension, "vehicle.right.track", "right"))
    standing = StandingTable(drawn=tuple(each.tension for each in laid), why=why)
    return _with_idlers(scene, [each[:2] for each in laid], [each.pushes for each in laid], standing)


def _with_idlers(
    scene: VehicleScene, places: Places, pushes: Sequence[Mapping[str, float]], standing: StandingTable
) -> VehicleScene:
    """The scene with idlers at ``places`` x, z, m, and ``pushes``, N, of tensioners that balance tracks as drawn."""
    bare = [side for side in SIDES if side not in scene.tracks]
    vehicle = VehicleTable.model_validate(with_idlers(scene.vehicle.model_dump(), places, pushes, bare))
    return scene.model_copy(update={"push": pushes[0]["idler"], "standing": standing, "vehicle": vehicle})


def _standing_vehicle(scene: VehicleScene) -> StandingVehicle:
    """Vehicle of a scene, with its kind of links, standing on level, hard ground; raises as ``standing_vehicle``."""
    start, alone = VehicleStartTable(), dict.fromkeys(("hitch", "driver"))
    level = scene.model_copy(
        update={"ground": GroundTable(), "start": start, "tracks": SIDES, "symmetric": False, "seats": (), **alone}
    )
    parts = {part.name: part for part in own_parts(level).parts}
    tracks = {side: _equilibrium_track(parts[f"{side}_track"], _is_soft(scene), False) for side in SIDES}
    problem = json.dumps([parts["chassis"].config, tracks, scene.vehicle.track.tension, _is_rigid(scene)])
    return _solved_standing(problem)


def _numbers(rest: VehicleEquilibrium) -> dict[str, Any]:
    """Equilibrium as a table."""
    return {**rest._asdict(), "tracks": tuple(track._asdict() for track in rest.tracks)}


def _is_rigid(scene: Scene) -> bool:
    return not scene.track.kind.stressed


def _is_soft(scene: Scene) -> bool:
    """Whether the closing spring of a track has a stiffness of its own."""
    return scene.track.closure_stiffness is not None


def _scene_at_rest(scene: VehicleScene) -> VehicleScene:
    """Vehicle with tensioned tracks in its equilibrium, unless it starts as drawn."""
    if scene.start.state != "equilibrium":
        return scene
    parts = {part.name: part for part in own_parts(scene.model_copy(update={"symmetric": False})).parts}
    under, chassis = scene.ground_plane, parts["chassis"].config
    hull = {**chassis, "chassis": _standing_chassis(scene.name, chassis["chassis"], under)}
    if under.uneven and scene.ground.one_sided(scene.start.position, scene.start.heading):
        hull["chassis"] = hull["chassis"] | {"one_sided": True}
    tracks = {
        side: _equilibrium_track(part, _is_soft(scene), under.uneven)
        for side in SIDES
        if (part := parts.get(f"{side}_track"))
    }
    pose = parts["chassis"].parameters
    slope = pose.get("start.slope.pitch", 0.0), pose.get("start.slope.roll", 0.0)
    problem = json.dumps([hull, tracks, slope, _is_rigid(scene)])
    solution = EquilibriumTable(**_numbers(_solved_equilibrium(problem)))
    if scene.ground.soil is not None and "belly" not in scene.run.allow:
        _refuse_belly(scene.name, scene.vehicle, solution)
    return scene.model_copy(update={"start": scene.start.model_copy(update={"equilibrium": solution})})


def _refuse_belly(name: str, vehicle: VehicleTable, rest: EquilibriumTable) -> None:
    """Raise BadInput for a hull that is in the soil at rest, see ``vocabulary.limits.BELLY``."""
    depth = -hull_clearance(vehicle.model_dump(), rest.height, rest.roll, rest.pitch)
    if depth > BELLY:
        raise BadInput(
            f"{name}.toml: ground.soil: at rest the hull is {1e3 * depth:.0f} mm in the soil, which bears tracks"
            ' only; run.allow = ["belly"] runs it all the same'
        )


def _standing_chassis(name: str, chassis: dict[str, Any], under: GroundPlane) -> dict[str, Any]:
    """Config of the chassis for the search of the equilibrium: hull and bare wheels on a plane, or on nothing.

    Raises BadInput for bare wheels on uneven ground.
    """
    ground = chassis.get("ground", {})
    if "terrain" not in ground:
        return chassis
    if not under.uneven:
        return {**chassis, "ground": {key: value for key, value in ground.items() if key != "terrain"}}
    if ground["bare"]:
        raise BadInput(
            f"{name}.toml: a vehicle without a track on the {ground['bare'][0]} stands on uneven ground: its"
            " equilibrium is not known, take start.state = 'drawn' or begin where the ground is a plane"
        )
    return {key: value for key, value in chassis.items() if key != "ground"}


def _equilibrium_track(part: Part, soft: bool, uneven: bool) -> tuple[dict[str, Any], Parameters]:
    """Track config and closure parameters for the search of the equilibrium, on uneven ground or on a plane.

    ``soft``: its closing spring has a stiffness of its own. One of default stiffness changes the result by 0.3 um only,
    so it is left out.
    """
    values = {name: value for name, value in part.parameters.items() if soft and name.startswith("closure")}
    config, parameters = {**part.config, "link_outputs": False}, part.parameters
    if not uneven:
        config["track"] = {key: value for key, value in config["track"].items() if key != "terrain"}
    if "start.slope.pitch" in parameters or uneven:
        values |= {name: value for name, value in parameters.items() if name.startswith("start.")}
    return config, values


# Solved once per process: scenes and track models share them.


@cache
def _solved_equilibrium(problem: str) -> VehicleEquilibrium:
    chassis, tracks, slope, rigid = json.loads(problem)
    return equilibrium(chassis, _flexible_tracks(tracks), tuple(slope), rigid)


@cache
def _solved_standing(problem: str) -> StandingVehicle:
    chassis, tracks, tension, rigid = json.loads(problem)
    return standing_vehicle(chassis, _flexible_tracks(tracks), tension, rigid)


def _flexible_tracks(tracks: Mapping[str, Any]) -> dict[str, FlexibleTrack]:
    return {side: FlexibleTrack(*track) for side, track in tracks.items()}


def _laid_idler(scene: RigScene | VehicleScene, tension: float, keys: str, side: Side = "left") -> WheelPlace:
    """Place of the idler of a track as drawn for a tension, N; ``keys``: its table. Raises BadInput."""
    config = closed_track_config(scene, side)
    level = {key: value for key, value in config["track"].items() if key != "terrain"}
    moved = scene.vehicle.tensioner.wheel if isinstance(scene, VehicleScene) else "idler"
    problem = json.dumps([{**config, "track": level}, moved, _links_that_start(scene)], sort_keys=True)
    place = _solved_idler(problem, tension, keys)
    if place.missed:
        raise BadInput(
            f"{keys}.tension = {tension:.6g} N: {place.missed}; the nearest tension is {place.tension:.6g} N"
        )
    return place


def _links_that_start(scene: Scene) -> Links:
    """Links of a scene and their mechanics."""
    table = scene.track
    mechanics = {one.name for one in table.fmu_parameters().values() if not one.method} - {"start"}
    parameters = {name: value for name, value in table.parameters().items() if name in mechanics}
    return table.kind.fmu, {**parameters, "element": "planar"} if scene.planar else parameters


@cache
def _solved_idler(problem: str, tension: float, keys: str) -> WheelPlace:
    config, name, (kind, parameters) = json.loads(problem)
    return tension_wheel(config, name, tension, keys, (kind, parameters))
