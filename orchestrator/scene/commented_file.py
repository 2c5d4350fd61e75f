"""Commented files of scenes and vehicles, to begin own ones with.

Every key of the source is a line of its own; the other keys that the file may have are comments with their defaults.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterator, Sequence
from itertools import groupby
from pathlib import Path
from typing import Any

from fmus.cache.files import replacing
from fmus.vehicles.tables import BadInput, path_text, value_text
from fmus.vehicles.vehicle import vehicle
from orchestrator.scene.keys import OVERRIDES, REQUIRED, Key, facts, scene_keys, table_of, vehicle_keys
from orchestrator.scene.scene import load, read_vehicle, read_with_files
from orchestrator.scene.settings import CHOSEN, NAMED, toml_text
from orchestrator.scene.tables import short_coupling
from orchestrator.scene.track_table import short_track

Table = dict[str, Any]  # raw table of a file
SCENE, VEHICLE = "straight", "m113"  # sources by default
HEAD = """# A {kind}, made from {source}. Lines that begin with '# ' hold the other keys with their defaults.
# 'cotrack keys' explains all. To let an editor complete and check them, run 'cotrack schema {kind} > {kind}.json',
# and make '#:schema {kind}.json' the first line.
"""


def new_file(kind: str, name: str, source: str | None = None) -> Path:
    """Write the "scene" or "vehicle" ``name``.toml into the current folder, made from a source; return its path.

    Raises BadInput, also if there is such a file, or a file of this name cannot be written.
    """
    stem = name.removesuffix(".toml")
    path = Path(f"{stem}.toml")
    if not re.fullmatch(r"[^/\\\x00-\x1f\ud800-\udfff]+", stem):
        raise BadInput(f"{value_text(name)} is no name of a file in the current folder")
    text = scene_text(source or SCENE) if kind == "scene" else vehicle_text(source or VEHICLE, stem)
    if os.path.lexists(path):
        raise BadInput(f"{path_text(path)} exists already, and is not replaced: give another name")
    try:
        with replacing(path) as fresh:
            fresh.write_text(text, encoding="utf-8")
    except OSError as error:
        raise BadInput(f"{path_text(path)} cannot be written: {error.strerror}") from None
    return path


def scene_text(source: str) -> str:
    """Commented scene file that resolves as a scene of the gallery or a file, save for its name; raises BadInput."""
    assembly = load(source).assembly
    _, table = read_with_files(source)
    table["track"] = short_track(table["track"])
    if "coupling" in table["run"]:
        table["run"]["coupling"] = short_coupling(table["run"]["coupling"])
    kinds = [key for key in scene_keys() if not key.assembly or assembly in key.assembly.split(", ")]
    own = [key for key in kinds if not key.key.startswith(("vehicle.", *NAMED))]
    about = {key.key: key for key in kinds}
    vehicle_lines = _verbatim(table, about["vehicle"], ()) if isinstance(table["vehicle"], dict) else ()
    lines = [*_lines(table, own), *vehicle_lines]
    for name in NAMED:
        inner = [key for key in kinds if key.key.startswith(f"{name}{CHOSEN}.") and key.meaning]
        lines += _verbatim(table, about[name.rstrip(".")], inner)
    return "\n".join([HEAD.format(kind="scene", source=path_text(source)), *lines, ""])


def vehicle_text(source: str, name: str) -> str:
    """Commented vehicle file, the packaged vehicle or the file ``source`` under another name; raises BadInput."""
    table = read_vehicle(source)
    vehicle(table, source)
    keys = vehicle_keys()
    seats = [key for key in keys if key.key.startswith("seat.")]
    about = next(key for key in keys if key.key == "seat")
    own = {**table, "name": name, "title": f"made from the {table['name']}"}
    lines = [*_lines(own, [key for key in keys if key not in seats])]
    lines += _verbatim(table, about, [key for key in seats if key.meaning])
    return "\n".join([HEAD.format(kind="vehicle", source=path_text(source)), *lines, ""])


def _lines(whole: Table, keys: Sequence[Key]) -> Iterator[str]:
    """Lines of all tables with these keys: a key that a table lacks is a comment, as is a table that is missing."""
    about = {key.key: key for key in keys}
    inner = {table_of(key) for key in keys}
    solved = tuple(f"{key.key}." for key in keys if key.solved)
    for name, group in groupby(keys, table_of):
        table, own = _inner(whole, name), list(group)
        lines = [_line(key, table) for key in own if _shown(key, table or {}, inner) and not key.key.startswith(solved)]
        if name and (lines or table is not None or all(key.key in inner for key in own)):
            yield f"\n{'' if table is not None else '# '}[{name}]  # {about[name].meaning}"
        yield from lines if table is not None or f"{name}." not in OVERRIDES else ()


def _inner(whole: Table, name: str) -> Table | None:
    """The table of a dotted name; None where the file has none."""
    table: Any = whole
    for part in filter(None, name.split(".")):
        table = table.get(part) if isinstance(table, dict) else None
    return table if isinstance(table, dict) else None


def _shown(key: Key, table: Table, inner: set[str]) -> bool:
    """Whether a key has a line in its table: tables have lines of their own, and what a run solves for has none."""
    name = key.key.rpartition(".")[2]
    if name in table:
        return not isinstance(table[name], dict)
    return not key.solved and key.key not in inner and key.allowed != "table"


def _line(key: Key, table: Table | None) -> str:
    name = key.key.rpartition(".")[2]
    unit = "" if key.unit in ("", "1") else f"{key.unit}: "
    choices = f" ({key.allowed})" if key.allowed.startswith('"') else ""
    comment = f"  # {unit}{key.meaning}{choices}"
    if table is not None and name in table:
        return f"{name} = {toml_text(table[name])}{comment}"
    return f"# {name} = {'' if key.default == REQUIRED else key.default}".rstrip() + comment


def _verbatim(whole: Table, about: Key, keys: Sequence[Key]) -> Iterator[str]:
    """A table as the source has it, below a list of the keys of its entries."""
    table = whole.get(about.key, {})
    yield f"\n{'' if table else '# '}[{about.key}]  # {about.meaning}"
    yield from (f"# {key.key.rpartition('.')[2]}: {facts(key)}: {key.meaning}" for key in keys)
    yield from (toml_text({key: value})[2:-2] for key, value in table.items())
