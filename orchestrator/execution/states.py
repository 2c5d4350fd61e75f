"""States of all parts of a scene at one time of its co-simulation, cached: start of other runs.

An explicit method takes half a million evaluations for a second of steel links. It therefore integrates a short
interval of a drive only, and implicit co-simulation computes the seconds before.
"""

from __future__ import annotations

import hashlib
import io
import json
import tempfile
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fmus.build import identity
from fmus.cache import cache_folder, private_folder, read_checked, write_checked
from fmus.saved import from_bytes
from fmus.vehicle import BadInput
from orchestrator.cosim import checkpoint
from orchestrator.cosim.component import ComponentFailed
from orchestrator.cosim.narration import Narration
from orchestrator.execution.simulate import simulate
from orchestrator.log.log_metadata import CHECKPOINT
from orchestrator.log.reader import Log
from orchestrator.scene.assembly import assemble, system
from orchestrator.scene.kinds import Scene
from orchestrator.scene.placing import placed


class States(NamedTuple):
    """Model states of all parts at one time."""

    time: float  # s
    parts: dict[str, NDArray[np.float64]]  # part -> flat state


def states_at(scene: Scene, time: float, narration: Narration | None = None) -> States:
    """Find the states of a scene at ``time``, s, or compute them by co-simulation.

    The scene's stop is ignored. Raises BadInput if ``time`` is not a multiple of the communication step, and the
    errors of ``simulate``.
    """
    scene.require_own_parts("states of models are those of")
    run = scene.run.model_copy(update={"stop": time, "checkpoints": time})
    steps = run.steps
    if not steps or abs(time / run.step - steps) > 1e-6:
        raise BadInput(f"states at {time:g} s: that must be a multiple of run.step = {run.step:g} s")
    target = scene.model_copy(update={"run": run, "expect": {}})
    place = private_folder(cache_folder() / "states" / _key(target)) / "states.npz"
    content = read_checked(place)
    if content is None:
        content = _computed_states(target, steps, narration)
        write_checked(place, content)
    with np.load(io.BytesIO(content), allow_pickle=False) as archive:
        return States(time, {name: archive[name] for name in archive})


def _key(scene: Scene) -> str:
    """Hash of the scene and of its FMUs."""
    fmus = [identity(instance.fmu) for instance in system(assemble(placed(scene))).instances if instance.fmu]
    return hashlib.sha256(json.dumps([scene.resolved(), fmus], sort_keys=True).encode()).hexdigest()[:24]


def _computed_states(scene: Scene, steps: int, narration: Narration | None) -> bytes:
    """Run to the step and extract the states from its checkpoint."""
    with tempfile.TemporaryDirectory(prefix="cotrack-") as folder:
        summary = simulate(scene, Path(folder) / "run.mcap", narration=narration)
        if summary["status"] != "ok":
            raise ComponentFailed(f"{scene.name}: {summary['message']}")
        with Log(Path(summary["log"])) as log:
            _, saved = checkpoint.states(log.attachment(f"{CHECKPOINT}{steps}"))
    states = {name: from_bytes(state).state for name, state in saved.items()}
    content = io.BytesIO()
    np.savez(content, allow_pickle=False, **states)  # type: ignore[arg-type]
    return content.getvalue()
