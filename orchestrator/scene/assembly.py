"""Assembly of a scene into a system: component configs, connections by connector, built FMUs."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

from fmus.fmi.build import Product, build_shapes, start_values
from fmus.rest.equilibrium import stances
from fmus.vehicles.tables import BadInput
from orchestrator.cosim.graph import Connection, Instance, System
from orchestrator.scene.fmu_table import Pair, joined, pair_of, require_free_inputs
from orchestrator.scene.kinds import BenchScene, ChainScene, RigScene, Scene, VehicleScene
from orchestrator.scene.parts import (
    AXLE,
    CHASSIS,
    DRIVE,
    DRIVER,
    SIGN_OF_Y,
    SPROCKET,
    Parameters,
    Part,
    chassis_config,
    chassis_parameters,
    differential_part,
    drive_of_side,
    drive_part,
    driven_connections,
    driver_parameters,
    rig_track_config,
    standing_track_config,
    start_parameters,
    track_config,
    track_part,
    vehicle_track_config,
    wheel_connections,
)
from orchestrator.scene.replacement import (
    ends_of,
    input_conversions,
    replacements,
    require_fit,
    require_pairs,
    typed,
    user_instance,
)
from orchestrator.scene.scene import with_track
from orchestrator.scene.settings import hint
from orchestrator.scene.system_scene import FreeScene, SystemScene

HITCH_FORCE = [("chassis", f"hitch.force.{axis}") for axis in "xyz"]  # input of a part that an FMU of the user may feed


class Assembly(NamedTuple):
    """Parts and connections of a scene."""

    parts: tuple[Part, ...]
    connections: tuple[Connection, ...]  # of our own parts, or of FMUs in their places
    user_connections: tuple[Connection, ...] = ()  # those that the scene adds from or to FMUs of the user


def assemble(scene: SystemScene) -> Assembly:
    """Assemble a scene: its parts and connections, and nothing that it does not declare.

    Raises BadInput if the scene has an FMU for a part that it has not.
    """
    if isinstance(scene, FreeScene):
        given = tuple(Part(name, "", {}, {}, table.stage, table) for name, table in scene.fmu.items())
        return Assembly(given, (), joined(scene.pairs()))
    scene = with_track(scene)
    assembly, fmus = _assembled(scene), scene.fmu or {}
    names = [part.name for part in assembly.parts]
    pairs = [pair_of(text) for text in scene.connections or ()]
    connected = {name for pair in pairs for name in (pair.source, pair.target)}
    for name in fmus:
        if name not in names and name not in connected:
            raise BadInput(f"{scene.where}: fmu.{name}: no such part: {hint(name, names, 'the parts are')}")
    own = tuple(part._replace(fmu=fmus.get(part.name)) for part in assembly.parts)
    # A further FMU steps before the chassis, as what acts on it does.
    further = tuple(Part(name, "", {}, {}, DRIVE, table) for name, table in fmus.items() if name not in names)
    assembly = assembly._replace(parts=(*own, *further))
    return assembly._replace(user_connections=_user_connections(scene, assembly, pairs))


def _user_connections(scene: Scene, assembly: Assembly, pairs: Sequence[Pair]) -> tuple[Connection, ...]:
    """Connections that a scene adds; raises BadInput if an input is not free, or not one that gets a connection."""
    names = [part.name for part in assembly.parts]
    taken = {(connection.target, into) for connection in assembly.connections for into in connection.inputs}
    try:
        require_free_inputs(pairs, names, taken)
    except ValueError as error:
        raise BadInput(f"{scene.where}: {error}") from None
    fmus = scene.fmu or {}
    for pair in pairs:
        about = f"{scene.where}: connections: '{pair}'"
        if pair.target in fmus:
            continue
        if pair.source not in fmus or (pair.target, pair.into) not in HITCH_FORCE:
            raise BadInput(
                f"{about}: '{pair.target}' is no FMU of the user; of our parts, only chassis.hitch.force.{{x,y,z}} get"
                " a connection, and from an FMU of the user"
            )
        if isinstance(scene, VehicleScene) and scene.symmetric and pair.into == "hitch.force.y":
            raise BadInput(f"{about}: symmetric = true has no lateral force: the right half mirrors the left")
        if isinstance(scene, VehicleScene) and scene.hitch is None:
            raise BadInput(f"{about}: the chassis has a hitch only with the table [hitch], which may be empty")
    return joined(pairs)


def unfit(scene: SystemScene, assembly: Assembly) -> list[tuple[str, str]]:
    """Warnings about FMUs of the user, as part and sentence; raises BadInput if one does not fit its connections."""
    where, variable_steps = scene.where, scene.run.variable is not None
    found = replacements(where, assembly.parts)
    warnings = [warning for each in found for warning in require_fit(each, assembly.connections, variable_steps)]
    by_name = {each.part.name: each for each in found}
    return [*warnings, *require_pairs(where, assembly.parts, by_name, assembly.user_connections)]


def _assembled(scene: Scene) -> Assembly:
    """Assembly of our own parts."""
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
    """Build the FMUs of an assembly, each distinct one once, and return it as a graph; FMUs of the user are as given.

    ``native``: build native FMUs; parts of a shape share one.
    """
    own = [part for part in assembly.parts if part.fmu is None]
    files = dict(zip((part.name for part in own), build_parts(own, native), strict=True))
    added = assembly.user_connections
    fmus = {each.part.name: each for each in replacements("scene", assembly.parts)}
    ends = ends_of(assembly.parts, fmus) if added else {}
    instances = tuple(
        user_instance(fmus[part.name], ends, added)
        if part.name in fmus
        else Instance(
            part.name,
            files[part.name].fmu,
            files[part.name].parameters,
            part.stage,
            input_conversions(part.name, ends, added),
            resources=files[part.name].resources,
            starts=files[part.name].starts,
        )
        for part in assembly.parts
    )
    return System(instances, (*assembly.connections, *typed(added, ends)))


class BuiltPart(NamedTuple):
    """FMU of a part, and what makes an instance of it this part."""

    fmu: Path
    parameters: Parameters  # its numbers, where they are parameters, and what the scene sets
    starts: Sequence[float]  # start values of its Reals, inputs first
    resources: Path | None = None  # folder with its numbers, where they are no parameters


def build_parts(parts: Sequence[Part], native: bool) -> list[BuiltPart]:
    """FMUs of the parts; ``native`` as in ``system``."""
    if not native:
        files = build_shapes([(part.kind, part.config, None) for part in parts])
        values = [start_values(part.kind, part.config) for part in parts]
        return [
            BuiltPart(file, {**own.parameters, **part.parameters}, own.inputs)
            for part, file, own in zip(parts, files, values, strict=True)
        ]
    from fmus.native.pack import build_native_shape, with_constants  # loads compilers, which only native builds need

    configs = [with_constants(part.kind, part.config, part.parameters) for part in parts]
    built = [build_native_shape(part.kind, config) for part, config in zip(parts, configs, strict=True)]
    return [
        BuiltPart(own.fmu, part.parameters, own.starts, own.resources) for part, own in zip(parts, built, strict=True)
    ]


def build_native_all(
    products: Sequence[Product], folder: Path | None = None, windows: bool = False, fmi: int = 2
) -> list[Path]:
    """Build native FMUs one after another, because numba compiles in one thread.

    ``windows`` and ``fmi``: see ``fmus.native.pack.build_native``.
    """
    from fmus.native.pack import build_native

    return [build_native(kind, config, folder, name, windows, fmi) for kind, config, name in products]


# --- assemblies ------------------------------------------------------------------------------------


def _chain(scene: ChainScene) -> Assembly:
    chain = scene.chain
    if chain.ends == "loop":
        config = track_config(scene, links=chain.links, closed=True, wheels=[], gravity=0.0)
        part = track_part(scene, "chain", config)
        moving: Parameters = {"start.spin": chain.spin, "start.ovalling": chain.ovalling}
        return Assembly((part._replace(parameters={**part.parameters, **moving}),), ())
    if chain.ends == "lying":
        pull = [0.5 * chain.pull, 0.0]
        ends: dict[str, Any] = {"kind": "pulled", "first": pull, "last": pull}
        config = track_config(scene, links=chain.links, closed=False, wheels=[], ground=True, ends=ends)
        if scene.ground and scene.ground.soil:
            config["track"]["soil"] = scene.ground.soil.model_dump()
        return Assembly((track_part(scene, "chain", config),), ())
    ends = {"kind": chain.ends, "first": [0.0, 0.0]}
    if chain.span is not None:
        ends["last"] = [chain.span * chain.links * scene.vehicle.track.pitch, 0.0]
    config = track_config(scene, links=chain.links, closed=False, wheels=[], ends=ends)
    return Assembly((track_part(scene, "chain", config),), ())


def _bench(scene: BenchScene) -> Assembly:
    bench = scene.bench
    # forces of the pulled ends, N; ends that are held have positions, m
    ends = {"kind": "pulled", "first": [-bench.upper, 0.0], "last": [-bench.lower, 0.0]}
    config = track_config(
        scene,
        links=bench.links,
        closed=False,
        wheels=[SPROCKET],
        gravity=0.0,
        ends=ends,
        transverse_damping=bench.transverse_damping,
    )
    drive = drive_part(scene, "drive", scene.drive, scene.vehicle.sprocket.spin_inertia, AXLE)
    return Assembly(
        (track_part(scene, "track", config), drive), wheel_connections("track", "sprocket", "drive", "sprocket")
    )


def _rig(scene: RigScene) -> Assembly:
    rig, vehicle = scene.rig, scene.vehicle
    parts = (
        track_part(scene, "track", rig_track_config(scene)),
        drive_part(scene, "drive", scene.drive, vehicle.sprocket.spin_inertia, AXLE),
        drive_part(
            scene,
            "idler_drive",
            scene.idler_drive,
            vehicle.idler.spin_inertia,
            (-rig.axle_distance, 0.0, 0.0),
        ),
    )
    wiring = (
        *wheel_connections("track", "sprocket", "drive", "sprocket"),
        *wheel_connections("track", "idler", "idler_drive", "sprocket"),
    )
    return Assembly(parts, wiring)


def _vehicle(scene: VehicleScene) -> Assembly:
    vehicle = scene.vehicle
    hull = chassis_config(scene)
    stands = stances(hull) if scene.start.equilibrium else {}
    wiring: list[Connection] = []
    tracks, drives = [], []
    if scene.drive.steering is not None:
        drives.append(differential_part(scene, scene.drive.steering, stands))
    sides = hull["chassis"]["sides"]
    for side in (side for side in scene.tracks if side in sides):
        track, lateral = f"{side}_track", SIGN_OF_Y[side] * vehicle.track.lateral
        config = vehicle_track_config(scene, side)
        rims = [wheel["name"] for wheel in config["track"]["wheels"] if wheel["kind"] == "rim"]
        tracks.append(track_part(scene, track, standing_track_config(scene, config, side, stands), lateral))
        if scene.drive.steering is None:
            inertia = vehicle.sprocket.spin_inertia
            mount = stands.get(f"{side}.sprocket", AXLE)
            drives.append(drive_part(scene, f"{side}_drive", scene.drive.of_side(side), inertia, mount, lateral))
        drive, connector = drive_of_side(scene, side)
        wiring += wheel_connections(track, "sprocket", drive, f"{connector}sprocket")
        for rim in rims:
            wiring += wheel_connections(track, rim, "chassis", f"{side}.{rim}")
        wiring += wheel_connections(drive, f"{connector}mount", "chassis", f"{side}.sprocket")
    chassis = Part("chassis", "Chassis", hull, chassis_parameters(scene), CHASSIS)
    if scene.driver is None:
        return Assembly((*tracks, *drives, chassis), tuple(wiring))
    for part in drives:
        part.config["drive"]["demanded"] = True
    config = {"vehicle": vehicle.model_dump()}
    parameters = {"friction": vehicle.contact.ground.friction, **driver_parameters(scene.driver)}
    driver = Part("driver", "Driver", config, {**start_parameters(scene), **parameters}, DRIVER)
    return Assembly((*tracks, *drives, chassis, driver), (*wiring, *driven_connections(scene)))


# --- parts -----------------------------------------------------------------------------------------
