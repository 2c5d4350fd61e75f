"""Start of a scene: idlers where chains carry their static tension, a vehicle in equilibrium."""

from __future__ import annotations

import json
from functools import cache
from typing import Any

from fmus.rest.equilibrium import FlexibleTrack, equilibrium
from fmus.rest.tensioning import CABLES, Links, tension_wheel
from fmus.start import hull_clearance
from fmus.vehicles.tables import BadInput
from fmus.vehicles.vehicle import RightIdlerTable, RightTensionerTable, VehicleTable
from orchestrator.scene.ground_tables import Footing
from orchestrator.scene.kinds import RigScene, Scene, VehicleScene
from orchestrator.scene.parts import Parameters, Part, closed_track_config, own_parts
from orchestrator.scene.tables import EquilibriumTable
from orchestrator.scene.values import SIDES, Side
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
            x, _ = _idler_position(scene, scene.rig.tension, "rig")
            scene = scene.model_copy(update={"rig": scene.rig.model_copy(update={"axle_distance": -x})})
        case VehicleScene():
            tensioned = _tensioned_scene(scene)
            scene = _scene_at_rest(tensioned)
    return scene.model_copy(update={"placed": True})


def _tensioned_scene(scene: VehicleScene) -> VehicleScene:
    """Vehicle with idlers where tracks as drawn carry their tension, and with the balancing preload."""
    if not scene.tracks:
        return scene
    vehicle = scene.vehicle
    x, push = _idler_position(scene, vehicle.track.tension, "vehicle.track")
    idler = vehicle.idler.model_copy(update={"x": x})
    tensioner = vehicle.tensioner.model_copy(update={"preload": vehicle.tensioner.preload + push})
    update: dict[str, Any] = {"idler": idler, "tensioner": tensioner}
    if vehicle.right is not None:
        right = vehicle.of_side("right")
        x, right_push = right.idler.x, push  # without a track the tensioner lacks the push
        if "right" in scene.tracks:
            x, right_push = _idler_position(scene, vehicle.track.tension, "vehicle.right.track", "right")
        preload = right.tensioner.preload + right_push
        moved = {"idler": RightIdlerTable(x=x), "tensioner": RightTensionerTable(preload=preload)}
        update["right"] = vehicle.right.model_copy(update=moved)
    return scene.model_copy(update={"push": push, "vehicle": vehicle.model_copy(update=update)})


def _scene_at_rest(scene: VehicleScene) -> VehicleScene:
    """Vehicle with tensioned tracks in its equilibrium, unless it starts as drawn."""
    if scene.start.state != "equilibrium":
        return scene
    parts = {part.name: part for part in own_parts(scene.model_copy(update={"symmetric": False})).parts}
    under, chassis = scene.footing, parts["chassis"].config
    hull = {**chassis, "chassis": _standing_chassis(scene.name, chassis["chassis"], under)}
    soft = scene.track.closure_stiffness is not None
    tracks = {
        side: _equilibrium_track(part, soft, under.uneven) for side in SIDES if (part := parts.get(f"{side}_track"))
    }
    pose = parts["chassis"].parameters
    slope = pose.get("start.slope.pitch", 0.0), pose.get("start.slope.roll", 0.0)
    problem = json.dumps([hull, tracks, slope])
    solution = EquilibriumTable(**_solved_equilibrium(problem)._asdict())
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


def _standing_chassis(name: str, chassis: dict[str, Any], under: Footing) -> dict[str, Any]:
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


@cache
def _solved_equilibrium(problem: str) -> Any:
    """Equilibrium, solved once per process."""
    chassis, tracks, slope = json.loads(problem)
    return equilibrium(chassis, {side: FlexibleTrack(*track) for side, track in tracks.items()}, tuple(slope))


def _idler_position(
    scene: RigScene | VehicleScene, tension: float, keys: str, side: Side = "left"
) -> tuple[float, float]:
    """Place of the idler of a track, m, and push of its tensioner, N, for a tension, N; ``keys``: its table."""
    config = closed_track_config(scene, side)
    level = {key: value for key, value in config["track"].items() if key != "terrain"}
    problem = json.dumps([{**config, "track": level}, _links_that_start(scene)], sort_keys=True)
    return _solved_idler_position(problem, tension, keys)


def _links_that_start(scene: Scene) -> Links:
    """Links of a scene that starts on wheels as drawn, with the asked tension; else cables, from which it settles."""
    table, start = scene.track, getattr(scene.start, "state", "drawn")
    if start == "equilibrium" or table.start not in (None, "rest"):
        return CABLES
    mechanics = {one.name for one in table.fmu_parameters().values() if not one.method} - {"start"}
    parameters = {name: value for name, value in table.parameters().items() if name in mechanics}
    return table.kind.fmu, {**parameters, "element": "planar"} if scene.planar else parameters


@cache
def _solved_idler_position(problem: str, tension: float, keys: str) -> tuple[float, float]:
    """Idler position and push, solved once per process: scenes and track models share them."""
    config, (kind, parameters) = json.loads(problem)
    return tension_wheel(config, "idler", tension, keys, (kind, parameters))
