"""Our components without FMI: model and slave of a part, through the class of its FMU."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from importlib import import_module
from pathlib import Path
from typing import Any

from fmus.fmi.build import KINDS, build
from orchestrator.cosim.fmu_files import unpack
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


def shell(kind: str) -> Any:
    """Class of an FMU; its ``model`` is the model."""
    return getattr(import_module(".".join(("fmus", *Path(KINDS[kind]).with_suffix("").parts))), kind)


def started(of: Part, **changes: float | str) -> Any:
    """Initialised model."""
    model = shell(of.kind).model(of.config)
    known = {port.name: port.start for port in model.ports if port.causality == "parameter"}
    model.initialise({**known, **_known(of.parameters, known), **changes})
    return model


def slave(of: Part) -> Any:
    """Slave at the end of its initialisation, called from Python."""
    resources = unpack(build(of.kind, of.config)) / "resources"
    made = shell(of.kind)(instance_name=of.name, resources=str(resources))
    put = {float: made.set_real, int: made.set_integer, str: made.set_string}
    for k, port in enumerate(made.variables):
        if port.causality == "parameter" and port.name in of.parameters:
            put[type(port.start)]([k], [of.parameters[port.name]])
    made.setup_experiment(0.0)
    made.enter_initialization_mode()
    made.exit_initialization_mode()
    return made


def _known(parameters: Mapping[str, Any], known: Mapping[str, Any]) -> dict[str, Any]:
    unknown = sorted(set(parameters) - set(known))
    if unknown:
        raise KeyError(f"no parameter '{unknown[0]}'")
    return dict(parameters)
