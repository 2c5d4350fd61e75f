"""A scene becomes a system: component configs, connections by connector, built FMUs."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

from fmus.build import build
from fmus.equilibrium import Track, equilibrium, stances, upright
from fmus.link_outputs import INTERVAL
from fmus.ports import wheel_state, wrench
from fmus.stance import Stance
from fmus.tensioning import tension_wheel
from orchestrator.cosim.graph import Connection, Instance, System
from orchestrator.scene.scene import BenchScene, ChainScene, RigScene, Scene, VehicleScene
from orchestrator.scene.tables import Drive, Driver, Equilibrium, Side, VehicleStart

TRACKS = {"flexible": "TrackFlexible", "rigid": "TrackRigid"}
SIDES: dict[Side, float] = {"left": 1.0, "right": -1.0}  # sign of y
AXLE: Sequence[float] = (0.0, 0.0, 0.0)  # of the sprocket in the vehicle frame
DRIVER, TRACK, DRIVE, CHASSIS = -1, 0, 1, 2  # stages: who demands, then force sides first
DIFFERENTIAL = "differential"
HHT = 0.5  # spectral radius of hht unless a scene asks for another: the strongest damping that it has
POSE = 7  # of a wheel's 13: position and orientation, then its rates

Parameters = dict[str, float | int | str]


class Part(NamedTuple):
    """A component before it is built."""

    name: str
    kind: str  # FMU kind, a key of the build
    config: dict[str, Any]  # what the build packs beside the model
    parameters: Parameters  # set before initialisation
    stage: int


class Assembly(NamedTuple):
    """What a scene consists of."""

    parts: tuple[Part, ...]
    connections: tuple[Connection, ...]


def placed(scene: Scene) -> Scene:
    """The scene with the idler where the chain carries its static tension, and the push that holds it there.

    A placed scene (from a log) stays as it is. Raises BadInput when the track cannot be laid round its wheels
    or cannot carry the tension.
    """
    if scene.placed:
        return scene
    update: dict[str, Any] = {"placed": True}
    match scene:
        case RigScene():
            x, _ = _tensioned(_rig_track(scene), scene.rig.tension, "rig")
            update["rig"] = scene.rig.model_copy(update={"axle_distance": -x})
        case VehicleScene():
            return _rested(_tight(scene).model_copy(update=update))
    return scene.model_copy(update=update)


def _tight(scene: VehicleScene) -> VehicleScene:
    """A vehicle with its idlers where tracks as drawn carry their tension, and the push that holds them there."""
    if not scene.tracks:
        return scene
    vehicle = scene.vehicle
    x, push = _tensioned(_vehicle_track(scene), vehicle.track.tension, "vehicle.track")
    idler = vehicle.idler.model_copy(update={"x": x})
    tensioner = vehicle.tensioner.model_copy(update={"preload": vehicle.tensioner.preload + push})
    changes = {"push": push, "vehicle": vehicle.model_copy(update={"idler": idler, "tensioner": tensioner})}
    return scene.model_copy(update=changes)


def _rested(scene: VehicleScene) -> VehicleScene:
    """A vehicle with tight tracks where it starts: in equilibrium, unless it starts as drawn."""
    if scene.start.state != "equilibrium":
        return scene
    parts = {part.name: part for part in _vehicle(scene.model_copy(update={"symmetric": False})).parts}
    tracks = {side: _carrying(scene, part) for side in SIDES if (part := parts.get(f"{side}_track"))}
    found = Equilibrium(**_settled(json.dumps([parts["chassis"].config, tracks]))._asdict())
    return scene.model_copy(update={"start": scene.start.model_copy(update={"equilibrium": found})})


def _carrying(scene: VehicleScene, part: Part) -> tuple[dict[str, Any], Parameters]:
    """A track as it takes part in the search; a closing spring as stiff as by default makes no difference (0.3 um)."""
    soft = scene.track.closure_stiffness is not None
    closure = {name: value for name, value in part.parameters.items() if soft and name.startswith("closure")}
    return {**part.config, "link_outputs": False}, closure


@cache
def _settled(asked: str) -> Any:
    """Solved once a process, as the idler's place."""
    chassis, tracks = json.loads(asked)
    return equilibrium(chassis, {side: Track(*track) for side, track in tracks.items()})


def _tensioned(config: dict[str, Any], tension: float, keys: str) -> tuple[float, float]:
    return _solved(json.dumps(config, sort_keys=True), tension, keys)


@cache
def _solved(config: str, tension: float, keys: str) -> tuple[float, float]:
    """Solved once a process: scenes and track models share their idler's place."""
    return tension_wheel(json.loads(config), "idler", tension, keys)


def assemble(scene: Scene) -> Assembly:
    """The parts and connections of a scene, wheels where it has them, nothing that it does not declare."""
    match scene:
        case ChainScene():
            return _chain(scene)
        case BenchScene():
            return _bench(scene)
        case RigScene():
            return _rig(scene)
        case VehicleScene():
            return _vehicle(scene)
    raise TypeError(f"no assembly for {type(scene).__name__}")


def system(assembly: Assembly, native: bool = False) -> System:
    """Build what the assembly needs (each distinct FMU once) and name it as a graph.

    ``native``: as machine code alone, an FMU for parts that differ by free parameters only.
    """
    files = build_parts(assembly.parts, native)
    instances = tuple(
        Instance(part.name, file, part.parameters, part.stage) for part, file in zip(assembly.parts, files, strict=True)
    )
    return System(instances, assembly.connections)


def build_parts(parts: Sequence[Part], native: bool) -> list[Path]:
    """The FMU of each part; ``native`` as in ``system``."""
    if not native:
        return build_all([(part.kind, part.config, None) for part in parts])
    from fmus.native.pack import held  # compilers, only for those who want them

    return build_native_all([(part.kind, held(part.kind, part.config, part.parameters), None) for part in parts])


Product = tuple[str, dict[str, Any], str | None]  # kind, config, name


def build_all(wanted: Sequence[Product], folder: Path | None = None) -> list[Path]:
    """Build ``(kind, config, name)`` in order, equal ones once, two at a time."""
    keys = [json.dumps(item, sort_keys=True) for item in wanted]
    distinct = dict(zip(keys, wanted, strict=True))
    with ThreadPoolExecutor(2) as pool:
        built = dict(
            zip(
                distinct,
                pool.map(lambda item: build(item[0], item[1], folder, item[2]), distinct.values()),
                strict=True,
            )
        )
    return [built[key] for key in keys]


def build_native_all(wanted: Sequence[Product], folder: Path | None = None, windows: bool = False) -> list[Path]:
    """The same as native FMUs, for ``windows`` too, one after the other: numba compiles in one thread."""
    from fmus.native.pack import build_native

    return [build_native(kind, config, folder, name, windows) for kind, config, name in wanted]


# --- assemblies ------------------------------------------------------------------------------------


def _chain(scene: ChainScene) -> Assembly:
    chain = scene.chain
    if chain.ends == "loop":
        config = _track_config(scene, links=chain.links, closed=True, wheels=[], gravity=0.0)
        part = _track(scene, "chain", config)
        moving: Parameters = {"start.spin": chain.spin, "start.ovalling": chain.ovalling}
        return Assembly((part._replace(parameters={**part.parameters, **moving}),), ())
    ends: dict[str, Any] = {"kind": chain.ends, "first": [0.0, 0.0]}
    if chain.span is not None:
        ends["last"] = [chain.span * chain.links * scene.vehicle.track.pitch, 0.0]
    config = _track_config(scene, links=chain.links, closed=False, wheels=[], ends=ends)
    return Assembly((_track(scene, "chain", config),), ())


def _bench(scene: BenchScene) -> Assembly:
    bench = scene.bench
    ends = {"kind": "pulled", "first": [-bench.upper, 0.0], "last": [-bench.lower, 0.0]}
    config = _track_config(
        scene,
        links=bench.links,
        closed=False,
        wheels=[_sprocket()],
        gravity=0.0,
        ends=ends,
        transverse_damping=bench.transverse_damping,
    )
    drive = _drive(scene, "drive", scene.drive, scene.vehicle.sprocket.spin_inertia, AXLE)
    return Assembly((_track(scene, "track", config), drive), _wheel("track", "sprocket", "drive", "sprocket"))


def _rig(scene: RigScene) -> Assembly:
    rig, vehicle = scene.rig, scene.vehicle
    parts = (
        _track(scene, "track", _rig_track(scene)),
        _drive(scene, "drive", scene.drive, vehicle.sprocket.spin_inertia, AXLE),
        _drive(
            scene,
            "idler_drive",
            scene.idler_drive,
            vehicle.idler.spin_inertia,
            (-rig.axle_distance, 0.0, 0.0),
        ),
    )
    wiring = (
        *_wheel("track", "sprocket", "drive", "sprocket"),
        *_wheel("track", "idler", "idler_drive", "sprocket"),
    )
    return Assembly(parts, wiring)


def _rig_track(scene: RigScene) -> dict[str, Any]:
    rig = scene.rig
    wheels = [_sprocket(), _rim("idler", scene.vehicle.idler.radius, -rig.axle_distance, 0.0)]
    return _track_config(scene, links=rig.links, closed=True, wheels=wheels, gravity=0.0, tension=rig.tension)


def _vehicle(scene: VehicleScene) -> Assembly:
    vehicle, config = scene.vehicle, _vehicle_track(scene)
    hull = _chassis(scene)
    stands = stances(hull) if scene.start.equilibrium else {}
    rollers = [wheel["name"] for wheel in config["track"]["wheels"] if wheel["kind"] == "rim"]
    wiring: list[Connection] = []
    tracks, drives = [], []
    if scene.drive.steering is not None:
        drives.append(_differential(scene, scene.drive.steering, stands))
    sides = hull["chassis"]["sides"]
    for side in (side for side in scene.tracks if side in sides):
        track, lateral = f"{side}_track", SIDES[side] * vehicle.track.lateral
        tracks.append(_track(scene, track, _standing(scene, config, side, stands), lateral))
        if scene.drive.steering is None:
            inertia = vehicle.sprocket.spin_inertia
            mount = stands.get(f"{side}.sprocket", AXLE)
            drives.append(_drive(scene, f"{side}_drive", scene.drive.of(side), inertia, mount, lateral))
        drive, connector = _of_side(scene, side)
        wiring += _wheel(track, "sprocket", drive, f"{connector}sprocket")
        for roller in rollers:
            wiring += _wheel(track, roller, "chassis", f"{side}.{roller}")
        wiring += _wheel(drive, f"{connector}mount", "chassis", f"{side}.sprocket")
    chassis = Part("chassis", "Chassis", hull, _start(scene), CHASSIS)
    if scene.driver is None:
        return Assembly((*tracks, *drives, chassis), tuple(wiring))
    for part in drives:
        part.config["drive"]["demanded"] = True
    config = {"vehicle": vehicle.model_dump()}
    parameters = {"friction": vehicle.contact.ground.friction, **_driver_parameters(scene.driver)}
    driver = Part("driver", "Driver", config, {**_start(scene), **parameters}, DRIVER)
    return Assembly((*tracks, *drives, chassis, driver), (*wiring, *_driven(scene)))


def _chassis(scene: VehicleScene) -> dict[str, Any]:
    """Config of the chassis: its sides, where it starts, what it touches."""
    at = scene.start.equilibrium
    own: dict[str, Any] = {"sides": list(SIDES)[: 1 if scene.symmetric else 2], **_touching(scene)}
    own |= {"start": at.model_dump(mode="json")} if at else {}
    own |= {"push": scene.push} if scene.push and len(scene.tracks) == 1 else {}
    return {"vehicle": scene.vehicle.model_dump(), "chassis": own}


def _standing(scene: VehicleScene, config: dict[str, Any], side: str, stands: Mapping[str, Stance]) -> dict[str, Any]:
    """The config of a track with its wheels where they stand on this side of the vehicle."""
    at = scene.start.equilibrium
    if at is None:
        return config
    if at.roll:
        stands = {name: upright(place, at.pitch) for name, place in stands.items()}
    wheels = [{**wheel, "start": list(stands[f"{side}.{wheel['name']}"])} for wheel in config["track"]["wheels"]]
    return {**config, "track": {**config["track"], "wheels": wheels}}


def _of_side(scene: VehicleScene, side: Side) -> tuple[str, str]:
    """The component that drives a side, and what its variables of that side begin with."""
    return (f"{side}_drive", "") if scene.drive.steering is None else (DIFFERENTIAL, f"{side}.")


def _driven(scene: VehicleScene) -> tuple[Connection, ...]:
    """What a driver sees, and what the drives are told."""
    shown, seen = _names(wheel_state("chassis", "output")), _names(wheel_state("chassis", "input"))
    return (
        Connection("chassis", shown[:POSE], "driver", seen[:POSE], "state"),
        Connection("chassis", shown[POSE:], "driver", seen[POSE:], "rate"),
        *(
            Connection("driver", (f"{side}.speed",), drive, (f"{connector}speed.demand",), "mean")
            for side in SIDES
            for drive, connector in [_of_side(scene, side)]
        ),
    )


def _driver_parameters(driver: Driver) -> Parameters:
    """What the scene says of a driver."""
    same = {"heading", "deceleration", "reach", "preview", "width", "friction", "grip"}
    own = driver.model_dump(include=same, exclude_none=True)
    ramp = {
        "speed.end": driver.speed,
        "ramp.start": driver.ramp_start,
        "ramp.end": driver.ramp_start + driver.ramp_time,
    }
    pairs = {"path.arcs": driver.arcs, "path.points": driver.points, "speed.points": driver.speed_points}
    if driver.lateral_acceleration is not None:
        own["acceleration.lateral"] = driver.lateral_acceleration
    return own | ramp | {name: _text(points) for name, points in pairs.items() if points is not None}


def _text(pairs: Sequence[tuple[float, float]]) -> str:
    """Pairs as a String parameter."""
    return "; ".join(f"{first!r} {second!r}" for first, second in pairs)


def _touching(scene: VehicleScene) -> dict[str, Any]:
    """Config of what the chassis itself touches: the hull where declared, wheels that have no track."""
    bare = [side for side in SIDES if side not in scene.tracks]
    if not bare and not scene.ground.hull:
        return {}
    return {"ground": {"hull": scene.ground.hull, "bare": bare, **_bump(scene)}}


def _bump(scene: VehicleScene) -> dict[str, Any]:
    bump = scene.ground.bump
    return {} if bump is None else {"bump": bump.model_dump()}


def _vehicle_track(scene: VehicleScene) -> dict[str, Any]:
    vehicle = scene.vehicle
    wheels = [
        _sprocket(),
        *(
            _rim(f"road_wheel[{i}]", vehicle.road_wheel.radius, x, vehicle.road_wheel.z)
            for i, x in enumerate(vehicle.road_wheel.x, 1)
        ),
        _rim("idler", vehicle.idler.radius, vehicle.idler.x, vehicle.idler.z),
    ]
    config = _track_config(
        scene,
        links=vehicle.track.links,
        closed=True,
        wheels=wheels,
        ground=True,
        tension=vehicle.track.tension,
    )
    config["track"] |= _bump(scene)
    return config


# --- parts -----------------------------------------------------------------------------------------


def _track_config(
    scene: Scene,
    *,
    links: int,
    closed: bool,
    wheels: list[dict[str, Any]],
    ground: bool = False,
    gravity: float | None = None,
    ends: dict[str, Any] | None = None,
    transverse_damping: float = 0.0,
    tension: float = 0.0,
) -> dict[str, Any]:
    return {
        "vehicle": scene.vehicle.model_dump(),
        "track": {
            "links": links,
            "closed": closed,
            "wheels": wheels,
            "ground": ground,
            "gravity": scene.vehicle.gravity if gravity is None else gravity,
            "ends": ends,
            "transverse_damping": transverse_damping,
            "tension": tension,
        },
        "link_outputs": scene.track.link_outputs,
    }


def _track(scene: Scene, name: str, config: dict[str, Any], lateral: float = 0.0) -> Part:
    parameters = {**_start(scene), "start.lateral": lateral, **scene.track.parameters()}
    if scene.track.integrator == "hht":
        parameters.setdefault("spectral_radius", HHT)
    if scene.planar:
        parameters["element"] = "planar"
    if scene.track.link_outputs:
        parameters[INTERVAL] = float(scene.links_every)
    return Part(name, TRACKS[scene.track.model], config, parameters, TRACK)


def _drive(
    scene: Scene,
    name: str,
    drive: Drive,
    inertia: float,
    mount: Sequence[float],
    lateral: float = 0.0,
) -> Part:
    config = {"vehicle": scene.vehicle.model_dump(), "drive": {"inertia": inertia, "mount": list(mount)}}
    parameters = {**_start(scene), "start.lateral": lateral, **_drive_parameters(drive)}
    return Part(name, "SprocketDrive", config, parameters, DRIVE)


def _differential(scene: VehicleScene, steering: Drive, stands: Mapping[str, Stance]) -> Part:
    vehicle = scene.vehicle
    own: dict[str, Any] = {"inertia": vehicle.sprocket.spin_inertia}
    for (side, sign), key in zip(SIDES.items(), ("mount", "right"), strict=True):
        x, y, *rest = stands.get(f"{side}.sprocket", AXLE)
        own[key] = [x, y + sign * vehicle.track.lateral, *rest]
    config = {"vehicle": vehicle.model_dump(), "drive": own}
    parameters = _start(scene)
    for shaft, drive in (("propulsion", scene.drive), ("steering", steering)):
        parameters |= {f"{shaft}.{name}": value for name, value in _drive_parameters(drive).items()}
    return Part(DIFFERENTIAL, "SteeringDifferential", config, parameters, DRIVE)


def _drive_parameters(drive: Drive) -> Parameters:
    parameters: Parameters = {
        "mode": drive.mode,
        "speed.end": drive.speed,
        "ramp.start": drive.ramp_start,
        "ramp.end": drive.ramp_start + drive.ramp_time,
        "torque.drive": drive.torque,
        "brake.torque": drive.brake,
    }
    if drive.stop is not None:
        parameters |= {"stop.start": drive.stop, "stop.time": drive.stop_time}
    for name in ("speed", "torque", "brake", "engine"):
        if (points := getattr(drive, f"{name}_points")) is not None:
            parameters[f"{name}.points"] = _text(points)
    if drive.gear_ratio is not None:
        parameters["gear.ratio"] = drive.gear_ratio
    if drive.torque_limit is not None:
        parameters["torque.limit"] = drive.torque_limit
    return parameters


def _start(scene: Scene) -> Parameters:
    x, y, z = scene.start.position
    pose: Parameters = {"start.position.x": x, "start.position.y": y, "start.position.z": z}
    pose["start.heading"] = scene.start.heading
    if isinstance(scene.start, VehicleStart):
        heading, pitch = scene.start.turned()
        pose |= {"start.heading": heading, "start.height": scene.start.height, "start.pitch": pitch}
    return pose


def _sprocket() -> dict[str, Any]:
    return {"name": "sprocket", "kind": "teeth", "position": [0.0, 0.0]}


def _rim(name: str, radius: float, x: float, z: float) -> dict[str, Any]:
    return {"name": name, "kind": "rim", "radius": radius, "position": [x, z]}


def _wheel(giver: str, connector: str, taker: str, taken: str) -> tuple[Connection, ...]:
    """Pose and rates from the taker to the giver, mean wrench from the giver to the taker: a power bond."""
    shown, seen = _names(wheel_state(taken, "output")), _names(wheel_state(connector, "input"))
    given, felt = _names(wrench(connector, "output")), _names(wrench(taken, "input"))
    bond = f"{giver}.{connector}"
    return (
        Connection(taker, shown[:POSE], giver, seen[:POSE], "state"),
        Connection(taker, shown[POSE:], giver, seen[POSE:], "rate", bond=bond),
        Connection(giver, given, taker, felt, "mean", bond=bond),
    )


def _names(ports: Sequence[Any]) -> tuple[str, ...]:
    return tuple(port.name for port in ports)
