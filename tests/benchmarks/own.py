"""Our components without FMI: the model of a part."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from fmus.components import model_of
from orchestrator.scene.assembly import assemble
from orchestrator.scene.kinds import Scene
from orchestrator.scene.parts import Part
from orchestrator.scene.placing import placed
from orchestrator.scene.scene import load


def scene(name: str, track: str, settings: Sequence[str]) -> Scene:
    """Scene with its idler in place."""
    loaded_scene = load(name, track, settings)
    assert isinstance(loaded_scene, Scene)
    return placed(loaded_scene)


def part(of: Scene, name: str) -> Part:
    """Component of a scene before it is built."""
    return next(each for each in assemble(of).parts if each.name == name)


def started(of: Part, **changes: float | str) -> Any:
    """Initialised model."""
    model = model_of(of.kind)(of.config)
    known = {port.name: port.start for port in model.ports if port.causality == "parameter"}
    model.initialise({**known, **_known(of.parameters, known), **changes})
    return model


def _known(parameters: Mapping[str, Any], known: Mapping[str, Any]) -> dict[str, Any]:
    unknown = sorted(set(parameters) - set(known))
    if unknown:
        raise KeyError(f"no parameter '{unknown[0]}'")
    return dict(parameters)
