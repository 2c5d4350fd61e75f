"""Random sequences of FMI calls (``calls``), and altered states (``states``), on FMUs of two scenes."""

from __future__ import annotations

import random
from collections.abc import Callable
from functools import cache, partial
from pathlib import Path
from typing import Any

from fmus.fmi.build import build
from fmus.native.pack import build_native
from orchestrator.cosim.component import Component
from orchestrator.scene.products import scene_products
from orchestrator.scene.scene import load
from tests.fuzz import states
from tests.fuzz.calls import sequence

FMUS: dict[str, tuple[str, tuple[str, ...], Callable[..., Path]]] = {
    "TrackRigid": ("hanging_chain", ("chain.links=8",), build),
    "SprocketDrive": ("rig", (), build),
    "native SprocketDrive": ("rig", (), build_native),
    "FMI 3.0 SprocketDrive": ("rig", (), partial(build_native, fmi=3)),
}


@cache
def _fmu(name: str) -> Path:
    """FMU of a name, whose kernels this process has loaded."""
    scene, settings, make = FMUS[name]
    products = scene_products([load(scene, "rigid", settings)])
    fmu = next(make(part, config) for part, config, _ in products if part == name.split()[-1])
    if make is build:  # kernels that this process has to load
        with Component(fmu, "warm") as component:
            component.initialise({})
            component.step(0.0, 1e-4)
    return fmu


def prepare() -> None:
    """Build the FMUs and load their kernels."""
    for name in FMUS:
        _fmu(name)


def draw(chance: random.Random) -> dict[str, Any]:
    """A sequence by its seed."""
    return {"fmu": chance.choice(list(FMUS)), "seed": chance.randrange(10**9), "length": 30}


def draw_states(chance: random.Random) -> dict[str, Any]:
    """Altered states by their seed."""
    return {"fmu": chance.choice(list(FMUS)), "seed": chance.randrange(10**9), "states": 10}


def act(case: dict[str, Any]) -> Callable[[], None]:
    """Action of a case: make the sequence, or restore the altered states."""
    fmu = _fmu(case["fmu"])

    def made() -> None:
        if "states" in case:
            states.run(fmu, case["seed"], case["states"])
        else:
            sequence(fmu, case["seed"], case["length"])

    return made
