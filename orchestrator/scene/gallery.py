"""The gallery of scenes in the package, and the reading of scene files."""

from __future__ import annotations

import tomllib
from collections.abc import Collection
from difflib import get_close_matches
from importlib import resources
from pathlib import Path
from textwrap import shorten
from typing import Any

from fmus.vehicle import BadInput, path_text, read_table, value_text
from orchestrator.files.budget import read_toml

# Scenes of older versions without an FMU, and their assembly; the validation now checks these elements and joints.
MOVED = {"flexible_pendulum": "pendulum", "elastica": "cantilever", "l_frame": "frame", "sliding_mass": "slider"}
PLACE = "has no FMU and is validated in a clone of cotrack: python -m tests.validation mechanics --quick -o mechanics"


def names() -> list[str]:
    """Names of the packaged scenes, from simple to complex physics."""
    folder = resources.files("orchestrator") / "gallery"
    packaged = {file.name.removesuffix(".toml") for file in folder.iterdir() if file.name.endswith(".toml")}
    order = [
        "hanging_chain", "sprocket_bench", "rig", "settle", "straight", "hard_stop",
        "released_chain", "folded_chain", "spinning_loop",
    ]  # fmt: skip
    return [name for name in order if name in packaged] + sorted(packaged.difference(order))


def hint(name: str, known: Collection[str], introduction: str) -> str:
    """Suggestion for an unknown name: the nearest known one, or all of them."""
    near = get_close_matches(name, known, n=1)
    return (
        f"did you mean '{near[0]}'?" if near else f"{introduction} {shorten(', '.join(known), 250, placeholder=' ...')}"
    )


def read(scene: str) -> tuple[str, dict[str, Any]]:
    """Name and raw table of a scene of the gallery or a TOML file; raises BadInput.

    The path of a vehicle's file in it, relative to the scene's folder, becomes one from the working folder.
    """
    path = Path(scene)
    if path.suffix == ".toml":
        table = _read_file(path, "scene")
        owner, key = (table["vehicle"], "base") if isinstance(table.get("vehicle"), dict) else (table, "vehicle")
        if isinstance(owner.get(key), str) and Path(owner[key]).suffix == ".toml":
            owner[key] = str(path.parent / owner[key])
        return path.stem, table
    if path.suffix == ".ssp":
        raise BadInput(f"{path_text(path)}: an SSP archive can be run and shown; here a scene is needed")
    if scene in names():
        source = resources.files("orchestrator") / "gallery" / f"{scene}.toml"
        return scene, tomllib.loads(source.read_text(encoding="utf-8"))
    if scene in MOVED:
        raise BadInput(f"scene '{scene}' {PLACE}")
    raise BadInput(f"no scene {value_text(scene)}: {hint(scene, names(), 'the gallery has')}")


def read_vehicle(name: str) -> dict[str, Any]:
    """Raw table of a packaged vehicle or of a TOML file; raises BadInput."""
    path = Path(name)
    return _read_file(path, "vehicle") if path.suffix == ".toml" else read_table(name)[0]


def _read_file(path: Path, kind: str) -> dict[str, Any]:
    try:
        return read_toml(path)
    except FileNotFoundError:
        raise BadInput(f"no {kind} file {path_text(path)}") from None
    except (OSError, ValueError, RecursionError) as error:
        reason = error.strerror if isinstance(error, OSError) else error
        raise BadInput(f"{path_text(path)}: not a readable TOML file: {reason}") from None
