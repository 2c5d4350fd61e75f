"""Settings of all scenes: keys of every table, with values at and beyond their ranges, of other types, or odd."""

from __future__ import annotations

import json
import random
from functools import cache
from typing import Any

from fmus.vehicles.ranges import VEHICLE
from orchestrator.scene.scene import SCENE_KINDS, load, scene_names
from orchestrator.scene.settings import keys
from orchestrator.scene.values import SCENE_RANGES
from tests.fuzz import values

RUN = {"hanging_chain": ("flexible", "rigid")}  # scenes that are run, others are shown: their kernels are loaded
KERNELS = (
    "element", "axes", "joints", "coordinates", "formulation", "integrator", "closure", "elasticity", "planar",
    "model", "start",
)  # fmt: skip
SMALL = ("chain.links=8", "expect={}")


@cache
def _known(scene: str) -> tuple[tuple[str, ...], dict[str, Any]]:
    """Keys of a scene and its resolved table."""
    loaded = load(scene)
    return tuple(keys(SCENE_KINDS[loaded.assembly])), loaded.resolved()


@cache
def _ends() -> dict[str, tuple[float, ...]]:
    """Ends of the possible and plausible ranges, by key."""
    ranges = [(f"vehicle.{one.key}", one) for one in VEHICLE] + [(one.key, one) for one in SCENE_RANGES]
    return {key: (*one.plausible, *one.possible) for key, one in ranges}


def setting(draw: random.Random, scene: str) -> str:
    """A setting of a scene."""
    known, table = _known(scene)
    key = draw.choice(known)
    near: Any = table
    for part in key.split("."):
        near = near.get(part) if isinstance(near, dict) else None
    if isinstance(near, dict | list) and near and draw.random() < 0.7:
        near = json.loads(json.dumps(near))
        values.change(near, draw)
        drawn = near
    elif key in _ends() and draw.random() < 0.3:
        drawn = draw.choice(_ends()[key]) * draw.choice((1.0, 1.0, 1.0000001, 0.9999999, -1.0))
    else:
        drawn = values.value(draw, near)
    if draw.random() < 0.04:
        odd = key[:-1], key + ".x", "." + key, key + ".0", "", "\u00fc", key.replace(".", ".."), key.upper()
        key = draw.choice(odd)
    text = values.text(drawn)
    return f"{key}={text if draw.random() < 0.9 else text.strip(chr(34))}"


def takes_long(text: str) -> bool:
    """Whether a run with this setting may take long for a good reason, or compile other kernels."""
    key, _, value = text.partition("=")
    if key.rpartition(".")[2] in KERNELS:
        return True
    try:
        number = float(value)
    except ValueError:
        return key == "run.step" or key.startswith("run.variable") or key == "chain.links"
    few = {"run.stop": number > 0.05, "run.step": 1e-15 < number < 2e-4, "chain.links": 64 < number < 1e5}
    return few.get(key, key.startswith("run.variable"))


def draw(chance: random.Random) -> dict[str, Any]:
    """A case: a run of few steps, or the inventory of a scene."""
    scene = chance.choice(("hanging_chain", *scene_names()))
    settings = [setting(chance, scene) for _ in range(chance.choice((1, 1, 1, 2, 3)))]
    track = chance.choice(RUN.get(scene, ("flexible", "rigid")))
    if scene in RUN and not any(map(takes_long, settings)):
        settings = [*SMALL, *settings]
        ending = ["--no-estimate", "--json", "--log", "a.mcap"]
        if not any(text.startswith("run.st") for text in settings):
            ending += ["--stop", "0.004"]
        else:
            settings.insert(0, "run.stop=0.004")
        command = ["run", scene]
    else:
        command, ending = ["show", scene], []
    return {"arguments": [*command, "--track", track, *(x for text in settings for x in ("--set", text)), *ending]}
