"""Assembly of a scene into a system: its parts, FMUs of the user, connections, built FMUs."""

from __future__ import annotations

from collections.abc import Sequence
from difflib import get_close_matches
from pathlib import Path
from typing import NamedTuple

from fmus.fmi.build import Product, build_shapes, start_values
from fmus.precompile import component_ports
from fmus.vehicles.tables import BadInput
from orchestrator.cosim.graph import Connection, Instance, System
from orchestrator.scene.fmu_table import Pair, joined, pair_of, require_free_inputs
from orchestrator.scene.kinds import Scene, VehicleScene
from orchestrator.scene.parts import DRIVE, Assembly, Part, own_parts
from orchestrator.scene.replacement import DEMANDS, conversions, ends_of, replacements, staged, typed, user_instance
from orchestrator.scene.settings import hint
from orchestrator.scene.system_scene import FreeScene, SystemScene
from orchestrator.scene.values import Parameters

HITCH_FORCE = [("chassis", f"hitch.force.{axis}") for axis in "xyz"]  # inputs of parts that FMUs of the user may feed


def assemble(scene: SystemScene) -> Assembly:
    """Assemble a scene: its parts and connections, and nothing that it does not declare.

    Raises BadInput if the scene has an FMU for a part that it has not.
    """
    assert isinstance(scene, Scene | FreeScene)
    pairs = [pair_of(text) for text in scene.connections or ()]
    if isinstance(scene, FreeScene):
        free, added = [Part(name, "", {}, {}, 0, table) for name, table in scene.fmu.items()], joined(pairs)
        ends = ends_of(free, {each.part.name: each for each in replacements(scene.where, free)})
        stages = {name: table.stage for name, table in scene.fmu.items()}
        return Assembly(staged(free, added, ends, stages), (), added)
    assembly, fmus = own_parts(scene), scene.fmu or {}
    names = [part.name for part in assembly.parts]
    connected = {name for pair in pairs for name in (pair.source, pair.target)}
    for name in fmus:
        if name not in names and name not in connected:
            parts = hint(name, names, "the parts are")
            raise BadInput(f"{scene.where}: fmu.{name}: no such part, and no connection names it: {parts}")
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
        part = next(part for part in assembly.parts if part.name == pair.target)
        demanded, inputs = part.config.get("drive", {}).get("demanded"), _open_inputs(part)
        if pair.into.endswith(DEMANDS) and part.config.get("drive") and demanded in (None, True):
            raise BadInput(f"{about}: {pair.target} has this input only with drive.demand = true")
        if pair.source not in fmus or pair.into not in inputs:
            near = get_close_matches(pair.into, inputs, 1)
            raise BadInput(
                f"{about}: '{pair.target}' is no FMU of the user; of our parts, only chassis.hitch.force.{{x,y,z}}, and"
                " speed.demand and torque.demand of drives get a connection, and from an FMU of the user"
                + (f": did you mean '{near[0]}'?" if near and near[0] != pair.into else "")
            )
        if pair.into.endswith(DEMANDS):
            continue
        if isinstance(scene, VehicleScene) and scene.symmetric and pair.into == "hitch.force.y":
            raise BadInput(f"{about}: symmetric = true has no lateral force: the right half mirrors the left")
        if isinstance(scene, VehicleScene) and scene.hitch is None:
            raise BadInput(f"{about}: the chassis has a hitch only with the table [hitch], which may be empty")
    return joined(pairs)


def _open_inputs(part: Part) -> list[str]:
    """Inputs of a part of ours that FMUs of the user may feed."""
    demands = [port.name for port in component_ports(part.kind, part.config) if port.name.endswith(DEMANDS)] if (
        part.config.get("drive", {}).get("demanded") not in (None, True)) else []  # fmt: skip
    return [*demands, *(into for name, into in HITCH_FORCE if name == part.name)]


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
            conversions(part.name, ends.get(part.name, {}), {}, ends, added),
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
