"""The gallery of scenes in the package, and the reading of scene files."""

from __future__ import annotations

import tomllib
from collections.abc import Collection
from difflib import get_close_matches
from importlib import resources
from pathlib import Path
from typing import Any

from fmus.vehicle import BadInput

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
    return f"did you mean '{near[0]}'?" if near else f"{introduction} {', '.join(known)}"


def read(scene: str) -> tuple[str, dict[str, Any]]:
    """Name and raw table of a scene of the gallery or a TOML file; raises BadInput."""
    path = Path(scene)
    if path.suffix == ".toml":
        source: Any = path
    elif scene in names():
        source = resources.files("orchestrator") / "gallery" / f"{scene}.toml"
    elif scene in MOVED:
        raise BadInput(f"scene '{scene}' {PLACE}")
    else:
        raise BadInput(f"no scene '{scene}': {hint(scene, names(), 'the gallery has')}")
    try:
        return path.stem, tomllib.loads(source.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise BadInput(f"no scene file '{scene}'") from None
    except (OSError, ValueError, RecursionError) as error:
        raise BadInput(f"{scene!r}: not a readable TOML file: {error}") from None
