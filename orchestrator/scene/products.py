"""Which FMUs scenes need, and what their files are called when they are built to be kept."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

from fmus.link_outputs import INTERVAL
from fmus.vehicle import BadInput
from orchestrator.scene import gallery
from orchestrator.scene.assembly import Product, assemble, build_all, build_native_all
from orchestrator.scene.parts import TRACKS, Part
from orchestrator.scene.placing import placed
from orchestrator.scene.scene import Scene, load

STANDARD = "straight"  # its components carry the plain names


def of_gallery(models: Sequence[str] = tuple(TRACKS), settings: Sequence[str] = ()) -> list[Product]:
    """Every distinct FMU of the gallery; the standard vehicle's come first and have no suffix."""
    ordered = [STANDARD, *(name for name in gallery.names() if name != STANDARD)]
    return of_scenes([load(name, model, settings) for name in ordered for model in models])


def of_scenes(scenes: Sequence[Scene]) -> list[Product]:
    """Every distinct FMU of some scenes, their parameters its defaults; of two sides, those of the left one.

    Variants carry the scene's name, and the component's if need be.
    """
    seen: set[str] = set()
    names: set[str] = set()
    products: list[Product] = []
    for scene in scenes:
        for part in sorted(assemble(placed(scene)).parts, key=_side):
            # in another tool means of links are those of its own communication step
            parameters = {name: value for name, value in part.parameters.items() if name != INTERVAL}
            config = part.config | {"parameters": parameters}
            mirrored = parameters | {"start.lateral": abs(_side(part))}  # one FMU serves both sides
            key = json.dumps([part.kind, part.config, mirrored], sort_keys=True)
            if key in seen:
                continue
            seen.add(key)
            name = part.kind if scene.name == STANDARD else f"{part.kind}-{scene.name}"
            if name in names:
                name = f"{part.kind}-{scene.name}-{part.name}"
            names.add(name)
            products.append((part.kind, config, name))
    return products


def _side(part: Part) -> float:
    """Left before right: how far to the right the part is made to stand, m."""
    return -float(part.parameters.get("start.lateral", 0.0))


def build_to(folder: Path, products: Sequence[Product], native: bool = False, windows: bool = False) -> list[Path]:
    """Build them into a folder, native ones for ``windows`` too; paths in order.

    Raises BadInput where there can be no such folder.
    """
    made(folder)
    return build_native_all(products, folder, windows) if native else build_all(products, folder)


def made(folder: Path) -> None:
    """Make a folder for what comes out; raises BadInput where there can be none."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise BadInput(f"the folder {folder} cannot be made: {error.strerror}") from None
