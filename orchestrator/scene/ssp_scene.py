"""SSP archive as a scene: an archive of ours is stepped as its scene, with the FMUs in it."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from fmus.fmi.build import start_values
from fmus.vehicles.tables import BadInput, path_text, value_text
from orchestrator.files.budget import DOCUMENT, OverBudget, read_file
from orchestrator.files.messages import LOG
from orchestrator.scene.archive.structure import Structure, read_structure
from orchestrator.scene.assembly import assemble
from orchestrator.scene.fmu_table import Pair
from orchestrator.scene.kinds import Scene
from orchestrator.scene.parts import Assembly, Part
from orchestrator.scene.products import SCENE, product_config
from orchestrator.scene.scene import changed_scene, from_table, load_any
from orchestrator.scene.settings import hint, pairs
from orchestrator.scene.system_scene import FreeScene, SystemScene

ENDING = ".ssp"
OPEN = "run", "expect", "fmu", "title", "name"  # tables and keys of a scene that an archive leaves open
STEP = 1e-3  # s, longest communication step of a system that is not ours: an archive does not say one
ROUNDING = 1e-9  # of a number of steps


def load_runnable(scene: str, track: str | None, settings: Sequence[str] | Mapping[str, Any]) -> SystemScene:
    """Scene of the gallery, of a file, or of an SSP archive, with settings as of ``load_any``; raises BadInput."""
    return load_ssp(Path(scene), track, settings) if scene.endswith(ENDING) else load_any(scene, track, settings)


def load_ssp(file: Path, track: str | None, settings: Sequence[str] | Mapping[str, Any]) -> SystemScene:
    """Scene of an SSP archive, whose parts are the FMUs in the archive with the parameter values of its SSD.

    An archive of ours is stepped as the scene in it: with its order, steps and checks. Any other one is a free system.
    Settings change how it runs, its checks and the FMUs alone, because these have their numbers. Raises BadInput.
    """
    where = path_text(file)
    if track is not None:
        raise BadInput(f"{where}: track = '{track}': the FMUs of an archive are as they are")
    for key, _ in pairs(settings):
        if key.partition(".")[0] not in OPEN:
            raise BadInput(f"{where}: {key}: the FMUs of an archive are as they are: set {', '.join(OPEN[:3])} alone")
    structure = read_structure(file)
    for sentence in structure.ignored:
        LOG.warning("%s", sentence)
    if structure.stop is None and "run.stop" not in dict(pairs(settings)):
        raise BadInput(f"{where}: its DefaultExperiment has no stopTime: run.stop gives one")
    scene = _own_scene(structure, where)
    table = _free_table(structure) if scene is None else _with_times(scene.resolved(), structure)
    changed = changed_scene(table, settings, where)
    if isinstance(changed, FreeScene) and (more := changed.fmu.keys() - structure.fmus.keys()):
        name = min(more)
        raise BadInput(f"{where}: fmu.{name}: no such component: {hint(name, structure.fmus, 'the components are')}")
    return changed.read_from(where, dict(pairs(settings)))


def _with_times(table: dict[str, Any], structure: Structure) -> dict[str, Any]:
    """Table of a scene of ours with the times of the archive's DefaultExperiment, which may have been edited."""
    times = {"start": structure.start}
    if structure.stop is not None:
        times["stop"] = structure.stop - structure.start
    return {**table, "run": {**table["run"], **times}}


def _free_table(structure: Structure) -> dict[str, Any]:
    run = {"step": STEP}
    if structure.start:
        run["start"] = structure.start
    if structure.stop is not None:
        duration = structure.stop - structure.start
        run |= {"stop": duration, "step": duration / math.ceil(duration / STEP * (1.0 - ROUNDING))}
    return {
        "name": structure.name,
        "title": structure.title,
        "assembly": "fmus",
        "run": run,
        "fmu": {
            name: {"file": str(file), "parameters": structure.values[name]} for name, file in structure.fmus.items()
        },
        "connections": [*map(str, structure.connections)],
    }


def _own_scene(structure: Structure, where: str) -> Scene | None:
    """Scene in an archive, if its parts and connections are those of the archive."""
    file = structure.folder / SCENE
    if not file.is_file():
        return None
    try:
        table = json.loads(read_file(file, DOCUMENT))
    except (OSError, OverBudget, ValueError, RecursionError) as error:
        raise BadInput(f"{where}: {SCENE} cannot be read: {error}") from None
    if not isinstance(table, dict):
        raise BadInput(f"{where}: {SCENE} = {value_text(table)}: must be a table")
    scene = from_table(table, f"{where}: {SCENE}")
    if not scene.placed:
        raise BadInput(f"{where}: {SCENE} is not placed")
    assembly = assemble(scene)  # its FMUs are replaced by those of the archive, never files elsewhere
    if _is_that(structure, assembly):
        return from_table({**table, "fmu": _fmus(structure, scene, assembly)}, where)
    sentence = "%s: parts or connections are not those of its scene: it runs as a free system"
    LOG.warning(sentence, where)
    return None


def _is_that(structure: Structure, assembly: Assembly) -> bool:
    pairs_of_assembly = {
        Pair(connection.source, output, connection.target, into)
        for connection in (*assembly.connections, *assembly.user_connections)
        for output, into in zip(connection.outputs, connection.inputs, strict=True)
    }
    parts = {part.name for part in assembly.parts}
    return structure.fmus.keys() == parts and set(structure.connections) == pairs_of_assembly


def _fmus(structure: Structure, scene: Scene, assembly: Assembly) -> dict[str, Any]:
    """Tables of the FMUs; parameter values that the scene's FMUs have as well follow the scene, if that is changed."""

    def changed(part: Part) -> dict[str, Any]:
        own = start_values(part.kind, product_config(scene, part)).parameters if part.kind else part.parameters
        return {name: value for name, value in structure.values[part.name].items() if own.get(name) != value}

    return {part.name: {"file": str(structure.fmus[part.name]), "parameters": changed(part)} for part in assembly.parts}
