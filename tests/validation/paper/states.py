"""States of components from a log's checkpoints, models of components, and the monolith of a scene."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from fmus.fmi.saved import from_bytes
from fmus.monolith.model import MAX_STEP, Monolith, initialised_model
from orchestrator.cosim import checkpoint
from orchestrator.execution.monolithic import parts_of
from orchestrator.log.log_metadata import CHECKPOINT, checkpoint_step
from orchestrator.log.reader import Log
from orchestrator.log.time_series import Floats
from orchestrator.scene.assembly import assemble
from orchestrator.scene.kinds import Scene
from orchestrator.scene.placing import placed

__all__ = ["MAX_STEP", "model", "saved", "whole"]


def saved(log: Log) -> Iterator[tuple[float, dict[str, Floats]]]:
    """Yield time, s, and states by component of all checkpoints in order."""
    numbers = sorted(k for name in log.attachments if (k := checkpoint_step(name)) is not None)
    for number in numbers:
        t, states = checkpoint.states(log.attachment(f"{CHECKPOINT}{number}"))
        yield t, {name: from_bytes(state).state for name, state in states.items()}


def model(scene: Scene, name: str) -> Any:
    """Model of a component of a scene, at its start; raises InvalidParameter or StepFailed."""
    part = next(part for part in assemble(placed(scene)).parts if part.name == name)
    return initialised_model(part.kind, part.config, part.parameters)


def whole(scene: Scene, **integration: Any) -> Monolith:
    """Scene as one differential equation, at its start; ``integration`` and errors as of ``Monolith``."""
    assembly = assemble(placed(scene))
    return Monolith(parts_of(assembly), assembly.connections, **integration)
