"""Inventory of a scene for ``cotrack show``: parts, contact pairs, outputs, modules, omissions."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from math import isclose
from typing import Any

import numpy as np

from fmus.ground.refinement import LEVEL, gaps, sections
from fmus.precompile import loaded_contents
from fmus.track.choices import TRACKS
from fmus.vehicles.sides import SIDES, beams, of_side, smooth_wheels
from fmus.vehicles.tables import BadInput
from orchestrator.execution import summary, summary_text
from orchestrator.scene.assembly import assemble
from orchestrator.scene.fmu_table import ARROW, FmuTable
from orchestrator.scene.kinds import Scene, VehicleScene
from orchestrator.scene.parts import DRIVE, DRIVER, TRACK, Assembly, Part
from orchestrator.scene.placing import placed
from orchestrator.scene.system_scene import SystemScene

SUSPENSION = {  # elements, by key of the table
    "spring": "springs by a table",
    "gas_spring": "gas springs",
    "damper": "dampers by a table",
    "torsion_bar": "torsion bars",
    "rotary_damper": "rotary dampers",
    "bump_stop": "bump stops",
    "rebound_stop": "rebound stops",
    "recoil": "recoil springs",
}
CHASSIS_PARTS = "the chassis with its suspension, road wheels and tensioners"
OVER_TIME = ("speed.points", "torque.points", "brake.points")
CONTACTS = ("contact with wheels and teeth", "contact with the ground")


def lines(scene: SystemScene) -> Iterator[str]:
    """Yield the lines of the inventory; raises BuildFailed if a component cannot start."""
    if not isinstance(scene, Scene):
        yield from _free_system(scene)
        return
    yield from describe(scene)
    yield from _parameters(scene)
    assembly = assemble(scene)
    if any(part.fmu is None for part in assembly.parts):
        yield from evaluated(scene, assembly)


def _free_system(scene: SystemScene) -> Iterator[str]:
    """Yield lines about the FMUs of a free system, their parameters and connections."""
    assembly = assemble(scene)
    yield from _run(scene)
    files = ((part, part.fmu.file) for part in assembly.parts if part.fmu is not None)
    yield from _section("in", (f"{_sized(assembly, part, file)}, stage {part.stage}" for part, file in files))
    yield from _parameters(scene)
    yield from _section("connections", _connectors(assembly))
    yield from _checks(scene)


def _connectors(assembly: Assembly) -> Iterator[str]:
    """Yield a line for the connections of two groups of variables, "a.wheel.force.{x,y,z} -> b.load.{x,y,z}"."""
    groups: dict[tuple[str, str], list[tuple[str, str]]] = {}
    for connection in (*assembly.connections, *assembly.user_connections):
        for output, into in zip(connection.outputs, connection.inputs, strict=True):
            (before, dot, last), (before_input, dot_input, last_input) = output.rpartition("."), into.rpartition(".")
            ends = f"{connection.source}.{before}{dot}", f"{connection.target}.{before_input}{dot_input}"
            groups.setdefault(ends, []).append((last, last_input))
    for (source, target), pairs_of_names in groups.items():
        outputs, inputs = (",".join(names) for names in zip(*pairs_of_names, strict=True))
        braces = "{{{}}}" if len(pairs_of_names) > 1 else "{}"
        yield f"{source}{braces.format(outputs)} {ARROW} {target}{braces.format(inputs)}"


def _parameters(scene: SystemScene) -> Iterator[str]:
    """Yield the section of parameters of FMUs of the user by their tables."""
    tables: Mapping[str, FmuTable] = getattr(scene, "fmu", None) or {}
    given = [f"{name}.{key} = {value}" for name, table in tables.items() for key, value in table.parameters.items()]
    if given:
        yield from _section("parameters of FMUs of yours", given)


def describe(scene: Scene) -> Iterator[str]:
    """Yield lines about the parts of a scene with their sizes, and about parts that are left out."""
    yield from _run(scene)
    yield f"  recorded: inputs every step, outputs every {scene.run.outputs}, links every {scene.links_every}"
    yield from _height_map(scene)
    yield from _track_tension(scene)
    present, absent = _parts(scene)
    yield from _section("in", present)
    yield from _section("left out", absent)
    yield from _checks(scene)


def _run(scene: SystemScene) -> Iterator[str]:
    run = scene.run
    yield f"{scene.name}: {scene.title}"
    if run.variable is None:
        yield f"  {run.stop:g} s in {run.steps} steps of {run.step * 1e3:g} ms, {run.coupling}"
    else:
        yield f"  {run.stop:g} s in variable steps ({run.variable}), {run.coupling}"
    if scene.shortened:
        yield f"  {scene.shortened}"


def _height_map(scene: Scene) -> Iterator[str]:
    """Yield a line about the map of heights of the ground, if it has one."""
    table = scene.resolved().get("ground", {}).get("heightmap")
    if table:
        heights = np.array(table["heights"])
        places = zip("xy", table["corner"], table["spacing"], heights.shape, strict=True)
        ends = (f"{name} {low:g} to {low + step * (count - 1):g} m" for name, low, step, count in places)
        size = f"{heights.shape[0]} x {heights.shape[1]} heights of {heights.min():g} to {heights.max():g} m"
        yield f"  height map: {', '.join(ends)}; {size}, and beyond it those of its edges"


def _track_tension(scene: Scene) -> Iterator[str]:
    """Yield lines about the tracks of a vehicle at rest, or why it cannot start."""
    if isinstance(scene, VehicleScene) and scene.tracks:
        try:
            rest = placed(scene)
            yield from summary_text.track_tension(summary.track_tension(rest.resolved()))
            places = dict.fromkeys(_moved_wheel(rest, side) for side in scene.tracks)
            yield f"  {rest.vehicle.tensioner.wheel} at {' and '.join(places)}, moved there for this tension"
        except BadInput as error:
            yield f"  track tension: {error}"


def _moved_wheel(scene: Scene, side: str) -> str:
    """Return the place of the wheel of a side that is moved for the tension."""
    wheels = {wheel["name"]: wheel for wheel in smooth_wheels(of_side(scene.vehicle.model_dump(), side))}
    return "x = {x:.5g} m, z = {z:.5g} m".format_map(wheels[scene.vehicle.tensioner.wheel])


def _section(title: str, within: Iterable[str]) -> Iterator[str]:
    yield title
    for line in within:
        yield f"  {line}"


def _checks(scene: SystemScene) -> Iterator[str]:
    """Yield the section of expected values, if there are any."""
    lines = []
    for name, check in scene.expect.items():
        allowed = f"{check.tolerance * 100:g} %" if check.relative else f"{check.tolerance:g}"
        lines.append(f"{name}: {check.expected:g} +- {allowed} ({check.signal or check.measure})")
    if lines:
        yield from _section("expected", lines)


def _parts(scene: Scene) -> tuple[list[str], list[str]]:
    """Return lines for present parts and lines for absent ones."""
    assembly = assemble(scene)
    return [_sized(assembly, part, _size(scene, part)) for part in assembly.parts], _absent_parts(scene, assembly)


def _sized(assembly: Assembly, part: Part, size: str) -> str:
    """Return the line about a part: name, kind, size, connected values."""
    wide = max(len(_kind(part)) for part in assembly.parts)
    connections = (*assembly.connections, *assembly.user_connections)
    n_inputs = sum(len(c.inputs) for c in connections if c.target == part.name)
    n_outputs = sum(len(c.outputs) for c in connections if c.source == part.name)
    return f"{part.name:12} {_kind(part):{wide}} {size}; {n_inputs} values in, {n_outputs} out a step"


def _kind(part: Part) -> str:
    return part.kind if part.fmu is None else "FMU"


def _size(scene: Scene, part: Part) -> str:
    if part.fmu is not None:
        return part.fmu.file
    if part.stage == TRACK:
        track = part.config["track"]
        links, pins = track["links"], track["links"] - (0 if track["closed"] else 1)
        pins -= bool(track["closed"] and scene.track.closure == "spring")
        size = scene.track.kind.size({**scene.track.kind.defaults, **part.parameters}, links, pins)
        bushed = ", bushes in the pins" if part.config["vehicle"]["track"].get("bushing") else ""
        count = len(track["wheels"])
        wheels = "1 wheel" if count == 1 else f"{count} wheels"
        return f"{size}{bushed}, {wheels}, {'ground' if track['ground'] else 'no ground'}"
    if part.stage == DRIVE:
        joined = " a side, joined" * (part.kind == "SteeringDifferential")
        return f"spin inertia {part.config['drive']['inertia']:g} kg m2{joined}{_points(part)}"
    if part.stage == DRIVER:
        path = {"path.arcs", "path.points"} & {*part.parameters}
        return f"{'pure pursuit of a path' if path else 'holds a heading'}{_points(part)}"
    vehicle = part.config["vehicle"]
    count, arms = len(vehicle["road_wheel"]["x"]), vehicle["road_arm"]
    axles = ("arms of bogies" if beams(arms, count) else "arms with wheels") if arms else "wheels on axles"
    sides = len(part.config["chassis"]["sides"])
    mirrored = ", their mirror images" if sides == 1 else ""
    rollers = f"{len(roller['x']) * sides} return rollers, " if (roller := vehicle["return_roller"]) else ""
    rollers += f"{len(further) * sides} further wheels, " if (further := vehicle["wheel"]) else ""
    elements = "".join(f", {SUSPENSION[key]}" for key in _suspension(vehicle))
    return f"1 hull, {count * sides} {axles}, {sides} idlers, {rollers}{sides} mounts{elements}{mirrored}"


def _points(part: Part) -> str:
    """Return how the points over time of a part go on, by their names."""
    text = ""
    for name in sorted(part.parameters):
        motor, dot, what = name.removesuffix(".points").rpartition(".")
        if name.endswith(OVER_TIME):
            held = part.parameters[f"{motor}{dot}interpolation"] == "hold"
            text += f", {motor}{dot}{what} {'holds from point to point' if held else 'is linear between points'}"
    return text


def _suspension(vehicle: Mapping[str, Any]) -> list[str]:
    """Return the elements of ``SUSPENSION`` that any side of a vehicle has."""
    having: set[str] = set()
    for table in (of_side(vehicle, side) for side in SIDES):
        having |= {key for given in (table["suspension"] or {}, table["tensioner"]) for key in given if given[key]}
    return [key for key in SUSPENSION if key in having]


def _absent_parts(scene: Scene, assembly: Assembly) -> list[str]:
    kinds = {part.kind for part in assembly.parts}
    links = [part for part in assembly.parts if part.stage == TRACK and part.fmu is None]
    tracks = [part.config["track"] for part in assembly.parts if part.stage == TRACK]
    wheels = max((len(track["wheels"]) for track in tracks), default=0)
    mirrored = isinstance(scene, VehicleScene) and scene.symmetric
    chassis = [part.config["vehicle"] for part in assembly.parts if part.kind == "Chassis" and part.fmu is None]
    elements = [what for key, what in SUSPENSION.items() if not any(key in _suspension(vehicle) for vehicle in chassis)]
    absent = {
        **{f"the {name} track model ({kind.fmu})": kind != scene.track.kind for name, kind in TRACKS.items()},
        CHASSIS_PARTS: "Chassis" not in kinds,
        f"of the suspension: {', '.join(elements)}": chassis and elements,
        "drives": not kinds & {"SprocketDrive", "SteeringDifferential"},
        "a steering differential": "SteeringDifferential" not in kinds,
        "a driver": "Driver" not in kinds,
        "bushes in the pins": links and not any(part.config["vehicle"]["track"].get("bushing") for part in links),
        CONTACTS[0]: wheels == 0,
        "contact with wheels other than the sprocket": wheels == 1,
        CONTACTS[1]: not any(track["ground"] for track in tracks),
        "gravity": tracks and all(isclose(track["gravity"], 0.0) for track in tracks),
        "the right track, drive and ports: the right half mirrors the left": mirrored,
        "a second track": len(tracks) == 1 and not mirrored,
        "lateral dofs of the chain: y of pins, lateral slopes, lateral parts of the contact laws": scene.planar,
        "outputs per link": not scene.track.link_outputs,
    }
    return [what for what, is_absent in absent.items() if is_absent]


def evaluated(scene: Scene, assembly: Assembly) -> Iterator[str]:
    """Yield what a step evaluates: contact pairs, numbers of outputs and of states."""
    own = [part for part in assembly.parts if part.fmu is None]
    loaded = loaded_contents([(part.kind, part.config, part.parameters) for part in own])
    pairs = [f"{part.name:12} {pair}" for part in own for pair in contact_pairs(scene, part)]
    yield from _section("contact pairs", pairs or ["none: no contact law is loaded"])
    yield "outputs"
    sizes = zip(own, loaded.outputs, loaded.link_outputs, loaded.state, strict=True)
    for part, outputs, links, state in sizes:
        every = f" and {links} of links every {scene.links_every} steps" if links else ""
        yield f"  {part.name:12} {outputs} a step{every}; {state} numbers of state"
    n_modules = len(loaded.modules) + len(loaded.left_out)
    yield from _section(f"modules of fmus: {len(loaded.modules)} of {n_modules} in", _by_folder(loaded.modules))
    yield from _section(f"modules of fmus: {len(loaded.left_out)} left out", _by_folder(loaded.left_out))


def contact_pairs(scene: Scene, part: Part) -> list[str]:
    """Return the contact pairs that a component evaluates."""
    if part.stage != TRACK:
        ground: dict[str, Any] = part.config.get("chassis", {}).get("ground", {})
        points = len(part.config["vehicle"]["chassis"].get("hull", ())) if ground.get("hull") else 0
        wheels = [f"wheels of the {side} side on the ground" for side in ground.get("bare", ())]
        return ([f"{points} points of the hull on the ground"] if points else []) + wheels
    track = part.config["track"]
    links, kinds = track["links"], [wheel["kind"] for wheel in track["wheels"]]
    lugs = part.config["vehicle"]["sprocket"].get("pins_per_gap") or 1
    pins = (links - 1) // lugs + 1 if track["closed"] else links // lugs + 1
    rims = len(kinds) - (kinds.count("teeth") if lugs == 1 else 0)
    wide = scene.track.kind.wide(scene.track.choices())
    points = 4 if wide else 2  # two pairs of points across a link
    vehicle, refined = part.config["vehicle"], track.get("refinement", LEVEL)
    on_ground = points // 2 * len(sections(vehicle["track"], refined if wide else (refined[0], 1), hard=True))
    apart = _gaps_of_points(part, refined, wide) if track["ground"] else ""
    possible_pairs = {
        f"teeth: {kinds.count('teeth')} sprocket x {pins} pins": "teeth" in kinds,
        f"rims: {rims} wheels x {links} links, {points} points where they touch": rims,
        f"guides: {rims} wheels x {links} links": rims and wide,
        f"ground: {links} links, {on_ground} points each{apart}": track["ground"],
    }
    return [pair for pair, is_there in possible_pairs.items() if is_there]


def _gaps_of_points(part: Part, refined: tuple[int, int], wide: bool) -> str:
    """Distances of the points of a link on the ground, in mm."""
    along, across = gaps(part.config["vehicle"]["track"], refined)
    return f", up to {1e3 * along:.3g} mm apart along it" + (f" and {1e3 * across:.3g} mm across" if wide else "")


def _by_folder(modules: Iterable[str]) -> Iterator[str]:
    """Yield one line per folder with its modules."""
    folders: dict[str, list[str]] = {}
    for module in modules:
        folder, _, name = module.rpartition(".")
        folders.setdefault(folder, []).append(name)
    for folder, names in sorted(folders.items()):
        yield f"{folder}: {', '.join(sorted(names))}"
