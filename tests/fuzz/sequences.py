"""Random sequences of FMI calls on FMUs of two scenes (``calls``)."""

from __future__ import annotations

import random
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

from fmus.build import build
from orchestrator.cosim.component import Component
from orchestrator.scene.products import scene_products
from orchestrator.scene.scene import load
from tests.fuzz.calls import sequence

FMUS = {"TrackRigid": ("hanging_chain", ("chain.links=8",)), "SprocketDrive": ("rig", ())}


@cache
def _fmu(kind: str) -> Path:
    """FMU of a kind, whose kernels this process has loaded."""
    scene, settings = FMUS[kind]
    products = scene_products([load(scene, "rigid", settings)])
    fmu = next(build(part, config) for part, config, _ in products if part == kind)
    with Component(fmu, "warm") as component:
        component.initialise({})
        component.step(0.0, 1e-4)
    return fmu


def prepare() -> None:
    """Build the FMUs and load their kernels."""
    for kind in FMUS:
        _fmu(kind)


def draw(chance: random.Random) -> dict[str, Any]:
    """A sequence by its seed."""
    return {"fmu": chance.choice(list(FMUS)), "seed": chance.randrange(10**9), "length": 30}


def act(case: dict[str, Any]) -> Callable[[], None]:
    """Action of a case: make the sequence."""
    fmu = _fmu(case["fmu"])

    def made() -> None:
        sequence(fmu, case["seed"], case["length"])

    return made
