"""Comparison of scenes: runs of one scene may differ only in computation, recording, checks and FMUs of the user.

An FMU in place of a part is another model of that part of the same scene, as another track model is.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from typing import Any

from fmus.vehicles.tables import BadInput, value_text
from orchestrator.scene.scene import from_table
from orchestrator.scene.track_table import TrackModelTable

Table = Mapping[str, Any]

# Keys of name, computation, recording, checks and FMUs: runs that differ in these alone are runs of one scene.
COMPUTED = (
    "name", "title", "expect", "run", "planar", "symmetric", "fmu", "seats",
    "vehicle.name", "vehicle.title", "vehicle.tensioner.travel", "vehicle.seat", "vehicle.life",
    *(f"track.{key}" for key in TrackModelTable.model_fields if key != "start"),
    "start.state", "start.equilibrium", "push", "standing", "vehicle.track.tension",
)  # fmt: skip


def _searched(scene: Table) -> dict[str, float]:
    """Results of the search for the static tension, and their relative tolerances.

    Last digits differ between versions, of which earlier ones asked for another tension (``vehicle.track.tension``).
    Belts of rigid links, which do not stretch, have a standing vehicle of their own, with other results.
    """
    vehicle = scene["vehicle"] if isinstance(scene.get("vehicle"), Mapping) else {}
    moved = (vehicle.get("tensioner") or {}).get("wheel") or "idler"
    found = {f"{of}{moved}.{axis}": 1e-5 for of in ("", "wheel.") for axis in "xz"} | {"tensioner.preload": 1e-3}
    found |= {f"wheel.{name}.tensioner.preload": 1e-3 for name in vehicle.get("wheel") or ()}
    both = {f"vehicle.{right}{key}": tolerance for right in ("", "right.") for key, tolerance in found.items()}
    return {**both, "rig.axle_distance": 1e-5}


def require_same_scene(first: tuple[str, Table], second: tuple[str, Table], remedy: str = "") -> None:
    """Raise BadInput unless two runs, each given as place and logged scene, are of one scene.

    The message ends with ``remedy``.
    """
    for where, table in (first, second):
        if not table:
            raise BadInput(f"{where} does not say of which scene it is")
    if scene_difference(first[1], second[1]) and (
        difference := scene_difference(*_of_one_search(_with_current_keys(first[1]), _with_current_keys(second[1])))
    ):
        named = [f"{where} ({value_text(table.get('name'))})" for where, table in (first, second)]
        raise BadInput(f"{' and '.join(named)} are runs of different scenes: {difference}{remedy}")


def _with_current_keys(table: Table) -> Table:
    """A logged scene with the keys of this version; a log of an older one lacks later keys."""
    try:
        resolved: Table = json.loads(json.dumps(from_table(table, "scene.json", logged=True).resolved()))
        return resolved
    except BadInput:
        return table


def _of_one_search(first: Table, second: Table) -> tuple[Table, Table]:
    """Both scenes, the first with the idlers of the second if other links have standing vehicles of their own."""
    if not (first.get("standing") and second.get("standing")) or first["track"]["model"] == second["track"]["model"]:
        return first, second
    if first["vehicle"]["track"]["tension"] != second["vehicle"]["track"]["tension"]:
        return first, second
    changed = json.loads(json.dumps(first))
    for above, key in (name.rsplit(".", 1) for name in _searched(second)):
        source, target = second, changed
        for name in above.split("."):
            source, target = (table.get(name) or {} for table in (source, target))
        if key in source and key in target:
            target[key] = source[key]
    own, theirs = (table["vehicle"]["tensioner"]["preload"] - table["push"] for table in (first, second))
    changed["vehicle"]["tensioner"]["preload"] += own - theirs  # the user's, beside the push that was searched
    return changed, second


def scene_difference(first: Table, second: Table, above: str = "", searched: Table | None = None) -> str | None:
    """First difference of two resolved, placed scenes, "key = value and value"; None for one scene."""
    searched = _searched(first) if searched is None else searched
    for name in sorted({*first, *second}):
        key, a, b = f"{above}{name}", first.get(name), second.get(name)
        if key in COMPUTED or a == b or (key in searched and _close(a, b, searched[key])):
            continue
        if key == "vehicle.hitch" and None in (a, b):  # a log of an older version; a scene that tows has it
            continue
        if isinstance(a, Mapping) and isinstance(b, Mapping) and above.count(".") < 9:
            if a and b and a.keys().isdisjoint(b):
                return f"{key} says {', '.join(sorted(a))} and {', '.join(sorted(b))}"
            if (difference := scene_difference(a, b, f"{key}.", searched)) is not None:
                return difference
        else:
            return f"{key} = {' and '.join('not given' if value is None else value_text(value) for value in (a, b))}"
    return None


def _close(a: object, b: object, tolerance: float) -> bool:
    return isinstance(a, int | float) and isinstance(b, int | float) and math.isclose(a, b, rel_tol=tolerance)
