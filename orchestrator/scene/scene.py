"""Scenes of the gallery and of files: read, completed, changed by settings, validated.

A scene file names a vehicle, or contains ``[vehicle]`` with a ``base`` and the differences from it.
"""

from __future__ import annotations

import math
import os
import tomllib
from collections.abc import Mapping, Sequence
from copy import deepcopy
from importlib import resources
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from fmus.vehicles.tables import LOGGED, BadInput, first_error, foremost, path_text, value_text
from fmus.vehicles.vehicle import read_table
from orchestrator.files.budget import read_toml
from orchestrator.scene import data_files
from orchestrator.scene.fmu_table import set_folder
from orchestrator.scene.height_files import locate_heights, read_heights
from orchestrator.scene.kinds import BenchScene, ChainScene, RigScene, Scene, VehicleScene
from orchestrator.scene.settings import hint, keys, merge_tables, near_keys, pairs, set_key
from orchestrator.scene.system_scene import FreeScene, SystemScene
from orchestrator.scene.tables import short_coupling
from orchestrator.scene.track_table import short_track

# Scenes of older versions without an FMU, and their assembly; the validation now checks these elements and joints.
OLD_SCENES = {"flexible_pendulum": "pendulum", "elastica": "cantilever", "l_frame": "frame", "sliding_mass": "slider"}
PLACE = "has no FMU and is validated in a clone of cotrack: python -m tests.validation mechanics --quick -o mechanics"


def scene_names() -> list[str]:
    """Names of the packaged scenes, from simple to complex physics."""
    folder = resources.files("orchestrator") / "gallery"
    packaged = {file.name.removesuffix(".toml") for file in folder.iterdir() if file.name.endswith(".toml")}
    order = [
        "hanging_chain", "sprocket_bench", "rig", "settle", "straight", "hard_stop",
        "released_chain", "folded_chain", "spinning_loop",
    ]  # fmt: skip
    return [name for name in order if name in packaged] + sorted(packaged.difference(order))


def read_scene(scene: str) -> tuple[str, dict[str, Any]]:
    """Name and raw table of a scene of the gallery or a TOML file; raises BadInput.

    The path of a vehicle's file in it, relative to the scene's folder, becomes one from the working folder.
    """
    path = Path(scene)
    if path.suffix == ".toml":
        table = read_file_table(path, "scene")
        owner, key = (table["vehicle"], "base") if isinstance(table.get("vehicle"), dict) else (table, "vehicle")
        if isinstance(owner.get(key), str) and Path(owner[key]).suffix == ".toml":
            owner[key] = str(path.parent / owner[key])
        return path.stem, table
    if path.suffix in NO_SCENES:
        raise BadInput(f"{path_text(path)}: {NO_SCENES[path.suffix]}; here a scene is needed, or its TOML file")
    if scene in scene_names():
        source = resources.files("orchestrator") / "gallery" / f"{scene}.toml"
        return scene, tomllib.loads(source.read_text(encoding="utf-8"))
    if scene in OLD_SCENES:
        raise BadInput(f"scene '{scene}' {PLACE}")
    if os.path.isfile(f"{scene}.toml"):
        raise BadInput(f"the gallery has no scene {value_text(scene)}: give the file, {path_text(f'{scene}.toml')}")
    raise BadInput(f"no scene {value_text(scene)}: {hint(scene, scene_names(), 'the gallery has')}")


def read_with_files(scene: str) -> tuple[str, dict[str, Any]]:
    """Name and raw table of a scene, with points and heights of the files that it names, and paths of FMUs.

    Raises BadInput.
    """
    name, table = _read_located(scene)
    read_heights(table, Path(), f"{name}.toml")
    data_files.set_interpolation(table, f"{name}.toml")
    return name, table


def _read_located(scene: str) -> tuple[str, dict[str, Any]]:
    """Name and raw table of a scene, with points of the files that it names; all paths are of the working folder."""
    name, table = read_scene(scene)
    data_files.read_files(table, Path(scene).parent, f"{name}.toml")
    locate_heights(table, Path(scene).parent)
    set_folder(table, Path(scene).parent)
    return name, table


def read_vehicle(name: str) -> dict[str, Any]:
    """Raw table of a packaged vehicle or of a TOML file; raises BadInput."""
    path = Path(name)
    return read_file_table(path, "vehicle") if path.suffix == ".toml" else read_table(name)[0]


def read_file_table(path: Path, kind: str) -> dict[str, Any]:
    """Raw table of a TOML file, named ``kind`` in messages; raises BadInput."""
    try:
        table = read_toml(path)
    except FileNotFoundError:
        raise BadInput(f"no {kind} file {path_text(path)}") from None
    except (OSError, ValueError, RecursionError) as error:
        reason = error.strerror if isinstance(error, OSError) else error
        raise BadInput(f"{path_text(path)}: not a readable TOML file: {reason}") from None
    course = isinstance(table.get("run"), list)
    found = "course" if course else "vehicle" if "chassis" in table else "scene" if "assembly" in table else kind
    if found != kind:
        raise BadInput(f"{path_text(path)}: is the file of a {found}, not of a {kind}: {READERS[found]}")
    return table


NO_SCENES = {  # files by their endings
    ".ssp": "an SSP archive can be run and shown",
    ".fmu": "'cotrack check' examines an FMU, and 'cotrack run SCENE --replace NAME=FMU' runs it in place of a part",
    ".mcap": "'cotrack resume' continues the run of a log, 'cotrack replay' repeats a part of it, and 'cotrack report'"
    " shows it",
}
READERS = {  # what takes a file of this kind
    "scene": "'cotrack run' runs it",
    "vehicle": "a scene names it, vehicle = 'FILE.toml', or the option --vehicle of 'cotrack run'",
    "course": "'cotrack life' takes it",
}
NEAREST = 3  # most keys that a message suggests
# keys that may stand for one of their own, unless their value is a table
SHORT_KEYS = {"track": "track.model", "run.coupling": "run.coupling.scheme"}

SCENE_KINDS: dict[str, type[SystemScene]] = {
    "chain": ChainScene,
    "bench": BenchScene,
    "rig": RigScene,
    "vehicle": VehicleScene,
    "fmus": FreeScene,
}


def load(scene: str, track: str | None = None, settings: Sequence[str] | Mapping[str, Any] = ()) -> Scene:
    """Load a scene with a track, as of ``load_any``; raises BadInput."""
    return with_track(load_any(scene, track, settings))


def with_track(scene: SystemScene) -> Scene:
    """The scene, if it has a track; else raises BadInput."""
    if not isinstance(scene, Scene):
        raise BadInput(
            f"{scene.where}: assembly = '{scene.assembly}' can be run and shown; here a scene with a track is needed"
        )
    return scene


def load_any(scene: str, track: str | None = None, settings: Sequence[str] | Mapping[str, Any] = ()) -> SystemScene:
    """Load a scene of the gallery or a file, with track model and settings; raises BadInput.

    Settings are ``KEY=VALUE`` texts as of ``--set``, or a table as ``{"vehicle.track.mass": 20, "run.stop": "3 s"}``.
    """
    name, table = _read_located(scene)
    changes = pairs(settings)
    kind = _kind(table, f"{name}.toml")
    if track is not None and not issubclass(kind, Scene):
        raise BadInput(f"{name}.toml: track = {value_text(track)}: assembly = '{table['assembly']}' has no track")
    vehicle_file = _complete_table(table, f"{name}.toml", track, changes) if issubclass(kind, Scene) else ""
    _change(kind, table, changes)
    data_files.read_files(table, Path(), f"{name}.toml")
    data_files.set_interpolation(table, f"{name}.toml")
    read_heights(table, Path(), f"{name}.toml")  # settings may place the map
    loaded = _new_scene({"name": name, **table}, f"{name}.toml", vehicle_file)
    loaded._unused = tuple(data_files.points_behind(table, loaded.run.stop))
    return _with_suitable_step(loaded.read_from("", dict(pairs(settings))))


def _with_suitable_step(scene: SystemScene) -> SystemScene:
    """The scene with a step that suits its vehicle, unless a setting chose the step: a whole part of its own."""
    if not isinstance(scene, VehicleScene) or scene._settings.keys() & {"run", "run.step"}:
        return scene
    longest = scene.vehicle.longest_step
    if longest is None or scene.run.step <= longest:
        return scene
    step, variable = scene.run.step / math.ceil(scene.run.step / longest - 1e-9), scene.run.variable
    if variable is not None:
        variable = variable.model_copy(update={"longest": min(variable.longest, longest)})
    suited = scene.model_copy(update={"run": scene.run.model_copy(update={"step": step, "variable": variable})})
    suited._shortened = (
        f"run.step is {1e3 * step:.4g} ms instead of {1e3 * scene.run.step:.4g} ms: vehicle"
        f" '{suited.vehicle.name}' has longest_step = {1e3 * longest:.4g} ms"
    )
    return suited


def _change(kind: type[SystemScene], table: dict[str, Any], changes: Sequence[tuple[str, Any]]) -> None:
    """Apply settings to a table; what it had and what by them does not count any more, such as a speed, goes."""
    before = {*kind.inactive(table)}
    for key, value in changes:
        set_key(table, key, value)
    for key in {*kind.inactive(table)} - before:
        if not any(f"{key}.".startswith(f"{changed}.") for changed, _ in changes):
            _remove(table, key)


def _remove(table: dict[str, Any], key: str) -> None:
    """Remove a dotted key."""
    *path, last = key.split(".")
    for part in path:
        table = table[part]
    del table[last]


def _kind(table: Mapping[str, Any], where: str) -> type[SystemScene]:
    """Class of scene that a table describes; raises BadInput."""
    assembly = table.get("assembly")
    if isinstance(assembly, str) and assembly in SCENE_KINDS:
        return SCENE_KINDS[assembly]
    if assembly in OLD_SCENES.values():
        raise BadInput(f"{where}: assembly = {value_text(assembly)}: {PLACE}")
    raise BadInput(f"{where}: assembly = {value_text(assembly)}: must be one of {', '.join(SCENE_KINDS)}")


def _complete_table(table: dict[str, Any], where: str, track: str | None, changes: list[tuple[str, Any]]) -> str:
    """Complete a raw table with its whole vehicle; ``changes`` gain the track model and lose the vehicle.

    Returns the name of the vehicle's file, empty for a vehicle of the package.
    """
    if track is not None:
        changes.insert(0, ("track.model", track))
    table["track"] = short_track(table.get("track", {}))
    if isinstance(table.get("run"), dict):
        table["run"]["coupling"] = short_coupling(table["run"].get("coupling", {}))
    for key, value in changes:
        if key == "vehicle":
            table["vehicle"] = value
    vehicle = table.get("vehicle")
    table["vehicle"] = _whole_vehicle(vehicle, where)
    changes[:] = [(_full_key(key, value), value) for key, value in changes if key != "vehicle"]
    source = vehicle.get("base", "") if isinstance(vehicle, dict) else str(vehicle)
    return source if source.endswith(".toml") else ""


def _full_key(key: str, value: object) -> str:
    """Key that a setting sets."""
    return key if isinstance(value, dict) else SHORT_KEYS.get(key, key)


def from_table(table: Mapping[str, Any], where: str, logged: bool = False) -> Scene:
    """Validate a scene with a track, as of ``any_from_table``; raises BadInput."""
    return with_track(any_from_table(table, where, logged=logged))


def any_from_table(table: Mapping[str, Any], where: str, vehicle_file: str = "", logged: bool = False) -> SystemScene:
    """Validate a scene whose vehicle is a whole table; raises BadInput with one sentence.

    The sentence begins with ``where``, about the vehicle also with ``vehicle_file``. One that is ``logged`` may have
    what a new run is refused for: an earlier version took keys that do not count, which are left out.
    """
    kind, own = _kind(table, where), dict(table)
    inactive = [*kind.inactive(own)] if logged else []
    own = deepcopy(own) if inactive else own
    for key in inactive:
        _remove(own, key)
    try:
        return kind.model_validate(own, context=LOGGED if logged else None)
    except ValidationError as error:
        in_vehicle = vehicle_file and foremost(error)["loc"][:1] == ("vehicle",)
        where = f"{where} with vehicle {path_text(vehicle_file)}" if in_vehicle else where
        raise BadInput(_validation_sentence(error, where, kind)) from None


def with_settings(scene: SystemScene, settings: Sequence[str] | Mapping[str, Any]) -> SystemScene:
    """The scene with other values, as of ``load``; its defaults are kept. Raises BadInput."""
    changed = changed_scene(scene.resolved(), settings, scene.where)
    return changed.read_from(scene._archive, {**scene._settings, **dict(pairs(settings))})


def changed_scene(
    resolved: dict[str, Any], settings: Sequence[str] | Mapping[str, Any], where: str, logged: bool = False
) -> SystemScene:
    """Apply settings, as of ``load``, to a resolved scene, which is modified; reads no file.

    ``logged``: it is of a log, see ``any_from_table``. Raises BadInput, with a message that begins with ``where``.
    """
    _change(_kind(resolved, where), resolved, [(_full_key(key, value), value) for key, value in pairs(settings)])
    return _new_scene(resolved, where, logged=logged)


def _new_scene(table: Mapping[str, Any], where: str, vehicle_file: str = "", logged: bool = False) -> SystemScene:
    """Scene as of ``any_from_table`` whose checks have no fault; those in logs of earlier versions may have one."""
    scene = any_from_table(table, where, vehicle_file, logged=logged)
    for name, check in scene.expect.items():
        if check.fault:
            raise BadInput(f"{where}: expect.{name}.{check.fault}")
    return scene


def _whole_vehicle(vehicle: object, where: str) -> dict[str, Any]:
    """Raw vehicle table: read by name, or a table merged over its ``base``."""
    if isinstance(vehicle, str):
        return read_vehicle(vehicle)
    if not isinstance(vehicle, dict):
        raise BadInput(f"{where}: vehicle must be a name, a .toml file or a table with 'base'")
    if "base" not in vehicle:
        return dict(vehicle)
    changes = dict(vehicle)
    base = changes.pop("base")
    if not isinstance(base, str):
        raise BadInput(f"{where}: vehicle.base = {value_text(base)}: must be a name or a .toml file")
    return merge_tables(read_vehicle(base), changes)


def _validation_sentence(error: ValidationError, where: str, model: type[SystemScene]) -> str:
    """One sentence for a validation error, with the nearest known keys for an unknown one."""
    from orchestrator.scene.keys import scene_schema  # with the ranges; keys reads scenes

    schema = scene_schema()
    first = foremost(error)
    text = first_error(error, where, {**schema, **schema["$defs"][model.__name__]})
    if first["type"] != "extra_forbidden":
        return text
    key = ".".join(map(str, first["loc"]))
    if key.endswith(".brake_speed"):  # of scenes and logs of former versions
        return f"{text}: a brake holds below its torque and fades at no speed, leave the key out"
    if others := [name for name, kind in SCENE_KINDS.items() if key in keys(kind)]:
        return f"{text}: it needs assembly = {' or '.join(map(repr, others))}"
    near = near_keys(key, keys(model))[:NEAREST]
    return f"{text}: did you mean {' or '.join(map(repr, near))}?" if near else text
