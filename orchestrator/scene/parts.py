"""Components of a scene by its kind, before they are built: configs, parameters, connections."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import groupby
from typing import Any, NamedTuple

from fmus.fmi.terminals import CARRIES
from fmus.ground.refinement import LEVEL, refinement
from fmus.ground.tables import is_plane, is_terrain
from fmus.interface.ports import Port, motion_ports, wrench_ports
from fmus.rest.equilibrium import stances
from fmus.start import Stance
from fmus.track.choices import HHT, TRACKS
from fmus.track.link_outputs import INTERVAL
from fmus.vehicles.sides import ground_level, smooth_wheels
from fmus.vehicles.vehicle import VehicleTable
from orchestrator.cosim.graph import Connection
from orchestrator.scene.drive_tables import DriveTable
from orchestrator.scene.fmu_table import FmuTable
from orchestrator.scene.kinds import BenchScene, ChainScene, RigScene, Scene, VehicleScene
from orchestrator.scene.values import Parameters, Side

SIGN_OF_Y: dict[Side, float] = {"left": 1.0, "right": -1.0}
AXLE: Sequence[float] = (0.0, 0.0, 0.0)  # position of the sprocket in the vehicle frame
DRIVER, TRACK, DRIVE, CHASSIS = -1, 0, 1, 2  # stages in stepping order: driver, then force sides before motion sides
DIFFERENTIAL = "differential"
HHT_RADIUS = 0.5  # default spectral radius of hht, its strongest damping


class Part(NamedTuple):
    """Component before it is built."""

    name: str
    kind: str  # kind of FMU, a key of fmus.components.COMPONENT_KINDS; empty for an FMU of a free system
    config: dict[str, Any]  # packed into the FMU beside the model
    parameters: Parameters  # set before initialisation
    stage: int  # lower stages step first: DRIVER to CHASSIS
    fmu: FmuTable | None = None  # FMU of the user that runs in its place


class Assembly(NamedTuple):
    """Parts and connections of a scene."""

    parts: tuple[Part, ...]
    connections: tuple[Connection, ...]  # of our own parts, or of FMUs in their places
    user_connections: tuple[Connection, ...] = ()  # those that the scene adds from or to FMUs of the user


def own_parts(scene: Scene) -> Assembly:
    """Parts of a scene, all with the pose of its start, and connections, without what an FMU of the user adds."""
    match scene:
        case ChainScene():
            assembly = _chain(scene)
        case BenchScene():
            assembly = _bench(scene)
        case RigScene():
            assembly = _rig(scene)
        case VehicleScene():
            assembly = _vehicle(scene)
        case _:
            raise TypeError(f"no assembly for {type(scene).__name__}")
    pose = scene.start_pose
    parts = tuple(part._replace(parameters={**pose, **part.parameters}) for part in assembly.parts)
    return assembly._replace(parts=parts)


def _chain(scene: ChainScene) -> Assembly:
    chain, vehicle, outputs = scene.chain, scene.vehicle, scene.track.link_outputs
    if chain.ends == "loop":
        config = _track_config(vehicle, outputs, links=chain.links, closed=True, wheels=[], gravity=0.0)
        part = _track_part(scene, "chain", config)
        moving: Parameters = {"start.spin": chain.spin, "start.ovalling": chain.ovalling}
        return Assembly((part._replace(parameters={**part.parameters, **moving}),), ())
    if chain.ends == "lying":
        half = [0.5 * chain.pull, 0.0]  # x and z of the force on each end, N; ends that are held have places, m
        ends: dict[str, Any] = {"kind": "pulled", "first": half, "last": half}
        config = _track_config(vehicle, outputs, links=chain.links, closed=False, wheels=[], ground=True, ends=ends)
        if scene.ground and scene.ground.soil:
            config["track"]["soil"] = scene.ground.soil.model_dump(exclude={"name"})
        return Assembly((_track_part(scene, "chain", config),), ())
    ends = {"kind": chain.ends, "first": [0.0, 0.0]}
    if chain.span is not None:
        ends["last"] = [chain.span * chain.links * vehicle.track.pitch, 0.0]
    config = _track_config(vehicle, outputs, links=chain.links, closed=False, wheels=[], ends=ends)
    return Assembly((_track_part(scene, "chain", config),), ())


def _bench(scene: BenchScene) -> Assembly:
    bench = scene.bench
    # forces of the pulled ends, N; ends that are held have positions, m
    ends = {"kind": "pulled", "first": [-bench.upper, 0.0], "last": [-bench.lower, 0.0]}
    config = _track_config(
        scene.vehicle,
        scene.track.link_outputs,
        links=bench.links,
        closed=False,
        wheels=[_sprocket(scene.vehicle)],
        gravity=0.0,
        ends=ends,
        transverse_damping=bench.transverse_damping,
    )
    drive = _drive_part(scene.vehicle, "drive", scene.drive, scene.vehicle.sprocket.spin_inertia, AXLE)
    parts = _track_part(scene, "track", config), drive
    return Assembly(parts, _wheel_connections("track", "sprocket", "drive", "sprocket"))


def _rig(scene: RigScene) -> Assembly:
    rig, vehicle = scene.rig, scene.vehicle
    parts = (
        _track_part(scene, "track", closed_track_config(scene)),
        _drive_part(vehicle, "drive", scene.drive, vehicle.sprocket.spin_inertia, AXLE),
        _drive_part(
            vehicle, "idler_drive", scene.idler_drive, vehicle.idler.spin_inertia, (-rig.axle_distance, 0.0, 0.0)
        ),
    )
    wiring = (
        *_wheel_connections("track", "sprocket", "drive", "sprocket"),
        *_wheel_connections("track", "idler", "idler_drive", "sprocket"),
    )
    return Assembly(parts, wiring)


def _vehicle(scene: VehicleScene) -> Assembly:
    vehicle = scene.vehicle
    hull = _chassis_config(scene)
    stands = stances(hull) if scene.start.equilibrium else {}
    wiring: list[Connection] = []
    tracks, drives = [], []
    steering, rest = scene.drive.steering, scene.start.equilibrium
    at_rest: dict[str, Sequence[float]] = {  # wrenches on sprockets
        side: wrench for side, wrench in zip(SIGN_OF_Y, rest.sprockets if rest else (), strict=False)
    }
    if steering is not None:
        drives.append(_differential_part(vehicle, {"propulsion": scene.drive, "steering": steering}, stands, at_rest))
    sides = hull["chassis"]["sides"]
    for side in (side for side in scene.tracks if side in sides):
        track, lateral = f"{side}_track", SIGN_OF_Y[side] * vehicle.track.lateral
        config = closed_track_config(scene, side)
        rims = [wheel["name"] for wheel in config["track"]["wheels"] if wheel["kind"] == "rim"]
        tracks.append(_track_part(scene, track, _standing_track_config(config, side, stands), lateral))
        if steering is None:
            inertia = vehicle.sprocket.spin_inertia
            mount = stands.get(f"{side}.sprocket", AXLE)
            drive_part = _drive_part(vehicle, f"{side}_drive", scene.drive.of_side(side), inertia, mount, lateral)
            drive_part.config["drive"] |= {"wrench": list(at_rest[side])} if at_rest else {}
            drives.append(drive_part)
        drive, connector = _drive_of_side(side, steering is not None)
        wiring += _wheel_connections(track, "sprocket", drive, f"{connector}sprocket")
        for wheel in rims:
            wiring += _wheel_connections(track, wheel, "chassis", f"{side}.{wheel}")
        wiring += _wheel_connections(drive, f"{connector}mount", "chassis", f"{side}.sprocket")
    load = scene.hitch.parameters() if scene.hitch is not None else {}
    chassis = Part("chassis", "Chassis", hull, load, CHASSIS)
    if scene.driver is None:
        return Assembly((*tracks, *drives, chassis), tuple(wiring))
    for part in drives:
        part.config["drive"]["demanded"] = True
    config = {"vehicle": vehicle.model_dump()}
    parameters = {"friction": vehicle.contact.ground.friction, **scene.driver.parameters()}
    driver = Part("driver", "Driver", config, parameters, DRIVER)
    return Assembly((*tracks, *drives, chassis, driver), (*wiring, *_driven_connections(steering is not None)))


def _chassis_config(scene: VehicleScene) -> dict[str, Any]:
    """Config of the chassis: sides, start, contacts, hitch, seats."""
    equilibrium = scene.start.equilibrium
    chassis: dict[str, Any] = {"sides": list(SIGN_OF_Y)[: 1 if scene.symmetric else 2], **_ground_config(scene)}
    chassis |= {"start": equilibrium.model_dump(mode="json", exclude={"sprockets", "tracks"})} if equilibrium else {}
    chassis |= {"push": scene.push} if scene.push and len(scene.tracks) == 1 else {}
    chassis |= {"hitch": True} if scene.hitch is not None else {}
    chassis |= {"seats": list(scene.seats)} if scene.seats else {}
    return {"vehicle": scene.vehicle.model_dump(), "chassis": chassis}


def _standing_track_config(config: dict[str, Any], side: str, stands: Mapping[str, Stance]) -> dict[str, Any]:
    """Config of a track whose wheels stand at their equilibrium, if there is one, on this side of the vehicle."""
    if not stands:
        return config
    wheels = [{**wheel, "start": list(stands[f"{side}.{wheel['name']}"])} for wheel in config["track"]["wheels"]]
    return {**config, "track": {**config["track"], "wheels": wheels}}


def _drive_of_side(side: Side, joined: bool) -> tuple[str, str]:
    """Component that drives a side, of its own or of ``joined`` sides, and the prefix of its variables for it."""
    return (DIFFERENTIAL, f"{side}.") if joined else (f"{side}_drive", "")


def _driven_connections(joined: bool) -> tuple[Connection, ...]:
    """Connections from chassis to driver and from driver to drives."""
    return (
        *_connector("chassis", motion_ports("chassis", "output"), "driver", motion_ports("chassis", "input")),
        *(
            Connection("driver", (f"{side}.speed",), drive, (f"{connector}speed.demand",), "mean")
            for side in SIGN_OF_Y
            for drive, connector in [_drive_of_side(side, joined)]
        ),
    )


def _ground_config(scene: VehicleScene) -> dict[str, Any]:
    """Config of the contacts of the chassis itself: the hull if declared, wheels without a track."""
    trackless = [side for side in SIGN_OF_Y if side not in scene.tracks]
    if not trackless and not scene.ground.hull:
        return {}
    return {"ground": {"hull": scene.ground.hull, "bare": trackless, **_ground_shape(scene)}}


def _ground_shape(scene: VehicleScene) -> dict[str, Any]:
    """Ground as a config has it (``contacts.ground_shape``); a slope everywhere is level in the start's frame."""
    ground = scene.ground.model_dump(exclude_none=True, exclude={"hull", "soil", "refinement"})
    vehicle = scene.vehicle.model_dump()
    if is_terrain(ground) and not is_plane(ground):
        return {"terrain": {**ground, "level": scene.start.position[2] + ground_level(vehicle)}}
    return {"bump": ground["bump"]} if "bump" in ground else {}


def closed_track_config(scene: RigScene | VehicleScene, side: Side = "left") -> dict[str, Any]:
    """Config of the track of a rig, or of a side of a vehicle, round its wheels as drawn."""
    outputs = scene.track.link_outputs
    if isinstance(scene, RigScene):
        idler = scene.vehicle.idler.model_copy(update={"x": -scene.rig.axle_distance, "z": 0.0})
        tensioner = scene.vehicle.tensioner.model_copy(update={"angle": 0.0})
        vehicle = scene.vehicle.model_copy(update={"idler": idler, "tensioner": tensioner})
        wheels = [_sprocket(vehicle), {"name": "idler", "kind": "rim"}]
        return _track_config(vehicle, outputs, links=scene.rig.links, closed=True, wheels=wheels, gravity=0.0)
    vehicle = scene.vehicle.of_side(side)
    rims = [{"name": wheel["name"], "kind": "rim"} for wheel in smooth_wheels(vehicle.model_dump())]
    config = _track_config(
        vehicle, outputs, links=vehicle.track.links, closed=True, wheels=[_sprocket(vehicle), *rims], ground=True
    )
    config["track"] |= _ground_shape(scene)
    refined = refinement(scene.ground.model_dump(exclude_none=True), vehicle.track.model_dump(), scene.kept_heading)
    if refined != LEVEL:
        config["track"]["refinement"] = refined
    if scene.ground.soil is not None:
        config["track"]["soil"] = scene.ground.soil.model_dump(exclude={"name"})
    return config


def _track_config(
    vehicle: VehicleTable,
    link_outputs: Sequence[str],
    *,
    links: int,
    closed: bool,
    wheels: list[dict[str, Any]],
    ground: bool = False,
    gravity: float | None = None,
    ends: dict[str, Any] | None = None,
    transverse_damping: float = 0.0,
) -> dict[str, Any]:
    """Config of a track: vehicle, groups of link outputs, wheels, ends and ground."""
    return {
        "vehicle": vehicle.model_dump(),
        "track": {
            "links": links,
            "closed": closed,
            "wheels": wheels,
            "ground": ground,
            "gravity": vehicle.gravity if gravity is None else gravity,
            "ends": ends,
            "transverse_damping": transverse_damping,
        },
        "link_outputs": link_outputs,
    }


def _track_part(scene: Scene, name: str, config: dict[str, Any], lateral: float = 0.0) -> Part:
    """Track with its parameters, ``lateral`` m to the left of the middle."""
    parameters: Parameters = {"start.lateral": lateral, **scene.track.parameters()}
    if scene.track.integrator == HHT:
        parameters.setdefault("spectral_radius", HHT_RADIUS)
    if scene.planar:
        parameters["element"] = "planar"
    if scene.track.link_outputs:
        parameters[INTERVAL] = float(scene.links_every)
    return Part(name, TRACKS[scene.track.model].fmu, config, parameters, TRACK)


def _drive_part(
    vehicle: VehicleTable,
    name: str,
    drive: DriveTable,
    inertia: float,
    mount: Sequence[float],
    lateral: float = 0.0,
) -> Part:
    """Sprocket drive on its mount, ``lateral`` m to the left of the middle."""
    config = {"vehicle": vehicle.model_dump(), "drive": {"inertia": inertia, "mount": list(mount), **_demanded(drive)}}
    return Part(name, "SprocketDrive", config, {"start.lateral": lateral, **drive.parameters()}, DRIVE)


def _differential_part(
    vehicle: VehicleTable,
    shafts: Mapping[str, DriveTable],
    stands: Mapping[str, Stance],
    at_rest: Mapping[str, Sequence[float]],
) -> Part:
    """Steering differential between both sprockets, with the drives of its shafts."""
    differential: dict[str, Any] = {"inertia": vehicle.sprocket.spin_inertia}
    for (side, sign), key in zip(SIGN_OF_Y.items(), ("mount", "right"), strict=True):  # keys of its config
        x, y, *rest = stands.get(f"{side}.sprocket", AXLE)
        differential[key] = [x, y + sign * vehicle.track.lateral, *rest]
    if at_rest:
        differential["wrench"] = [number for side in SIGN_OF_Y for number in at_rest[side]]
    if following := [f"{shaft}." for shaft, drive in shafts.items() if drive.demand]:
        differential["demanded"] = following
    config = {"vehicle": vehicle.model_dump(), "drive": differential}
    parameters: Parameters = {}
    for shaft, drive in shafts.items():
        for name, value in drive.parameters().items():
            parameters[name if name == "demand.lag" else f"{shaft}.{name}"] = value
    return Part(DIFFERENTIAL, "SteeringDifferential", config, parameters, DRIVE)


def _demanded(drive: DriveTable) -> dict[str, Any]:
    """Entry of a drive's config with inputs for demands."""
    return {"demanded": [""]} if drive.demand else {}


def _sprocket(vehicle: VehicleTable) -> dict[str, Any]:
    return {"name": "sprocket", "kind": "teeth" if vehicle.sprocket.teeth else "driving"}  # in the config of a track


def _wheel_connections(giver: str, connector: str, taker: str, taker_connector: str) -> tuple[Connection, ...]:
    """Power bond of a wheel: pose and rates from taker to giver, mean wrench from giver to taker."""
    bond = f"{giver}.{connector}"
    return (
        *_connector(taker, motion_ports(taker_connector, "output"), giver, motion_ports(connector, "input"), bond),
        *_connector(giver, wrench_ports(connector, "output"), taker, wrench_ports(taker_connector, "input"), bond),
    )


def _connector(
    source: str, outputs: Sequence[Port], target: str, inputs: Sequence[Port], bond: str = ""
) -> Iterator[Connection]:
    """Connections of a motion or a wrench, one for what its members carry; a state has no power and no ``bond``."""
    pairs = [(output.name, into.name) for output, into in zip(outputs, inputs, strict=True)]
    for carries, group in groupby(pairs, lambda pair: CARRIES[pair[0].split(".")[-2]]):
        given, taken = zip(*group, strict=True)
        yield Connection(source, given, target, taken, carries, bond="" if carries == "state" else bond)
