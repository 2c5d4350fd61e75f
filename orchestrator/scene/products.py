"""FMUs of scenes for use in other tools, and their file names."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from fmus.build import Product, build_all
from fmus.defaults import EXPERIMENT, KEY
from fmus.link_outputs import INTERVAL
from fmus.track_choices import TRACKS
from fmus.vehicle import BadInput
from orchestrator.scene import gallery
from orchestrator.scene.assembly import assemble, build_native_all
from orchestrator.scene.parts import Part
from orchestrator.scene.placing import placed
from orchestrator.scene.scene import Scene, load

STANDARD = "straight"  # its FMUs have names without suffix


def gallery_products(models: Sequence[str] = tuple(TRACKS), settings: Sequence[str] = ()) -> list[Product]:
    """Every distinct FMU of the gallery; those of the standard vehicle come first and have no suffix."""
    ordered = [STANDARD, *(name for name in gallery.names() if name != STANDARD)]
    return scene_products([load(name, model, settings) for name in ordered for model in models])


def scene_products(scenes: Sequence[Scene]) -> list[Product]:
    """Every distinct FMU of some scenes, with parameters as defaults; of two sides, the left one's.

    Variants carry the scene's name, and the component's and the links' where needed.
    """
    keys: set[str] = set()
    names: set[str] = set()
    products: list[Product] = []
    for scene in scenes:
        scene.require_own_parts("cotrack build makes")
        for part in sorted(assemble(placed(scene)).parts, key=_side):
            config = product_config(scene, part)
            mirrored = config[KEY] | {"start.lateral": abs(_side(part))}  # one FMU serves both sides
            key = json.dumps([part.kind, part.config, mirrored], sort_keys=True)
            if key in keys:
                continue
            keys.add(key)
            name = part.kind if scene.name == STANDARD else f"{part.kind}-{scene.name}"
            if name in names:
                name = f"{part.kind}-{scene.name}-{part.name}"
            if name in names:  # a place that depends on the links
                name += f"-{scene.track.model}"
            names.add(name)
            products.append((part.kind, config, name))
    return products


def product_config(scene: Scene, part: Part) -> dict[str, Any]:
    """Config of the FMU of a part for another tool: the part's parameters are its defaults."""
    # Another tool takes link means over its own communication step.
    parameters = {name: value for name, value in part.parameters.items() if name != INTERVAL}
    return part.config | {KEY: parameters, EXPERIMENT: {"stop": scene.run.stop, "step": scene.run.step}}


def _side(part: Part) -> float:
    """Lateral distance of the part to the right, m; sorts left before right."""
    return -float(part.parameters.get("start.lateral", 0.0))


def build_to(
    folder: Path, products: Sequence[Product], native: bool = False, windows: bool = False, fmi: int = 2
) -> list[Path]:
    """Build FMUs into a folder; return their paths in order.

    ``windows`` adds libraries to native ones, which may be of FMI 2.0 or 3.0 (``fmi``: 2 or 3). Raises BadInput if the
    folder cannot be created.
    """
    make_folder(folder)
    return build_native_all(products, folder, windows, fmi) if native else build_all(products, folder)


def make_folder(folder: Path) -> None:
    """Create a folder for results; raises BadInput."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise BadInput(f"the folder {folder} cannot be made: {error.strerror}") from None
