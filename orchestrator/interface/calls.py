"""Run of a scene from Python, with the defaults of ``cotrack run``."""

from __future__ import annotations

import os
import sys
from collections.abc import Mapping, Sequence
from contextlib import nullcontext
from pathlib import Path
from typing import Any

from fmus.vehicles.tables import BadInput
from orchestrator.cosim.narration import Narration
from orchestrator.execution.simulate import simulate
from orchestrator.interface.recorded_run import Run
from orchestrator.scene.scene import with_settings
from orchestrator.scene.settings import pairs
from orchestrator.scene.ssp_scene import load_runnable
from orchestrator.scene.system_scene import SystemScene


def run(
    scene: str | os.PathLike[str] | SystemScene,
    settings: Mapping[str, Any] | Sequence[str] = (),
    *,
    track: str | None = None,
    stop: float | str | None = None,
    step: float | str | None = None,
    estimate: bool = True,
    native: bool = False,
    log: str | os.PathLike[str] | None = None,
    progress: bool = True,
) -> Run:
    """Run a scene, record it, evaluate its checks and estimate its error, as ``cotrack run`` does.

    :param scene: name in the gallery, TOML file, SSP archive, or a scene of ``cotrack.load``.
    :param settings: values by dotted key, ``{"vehicle.track.mass": 20, "run.stop": "3 s"}``; numbers are in SI
        units, texts may have others ("2 ms"). ``KEY=VALUE`` texts, as of ``--set``, are allowed too.
    :param track: "flexible" or "rigid", instead of the scene's.
    :param stop: end of the run, s.
    :param step: communication step, s.
    :param estimate: estimate the error by two coarser runs, in twice the run's time.
    :param native: use native FMUs; results have the same bits.
    :param log: path of the log, by default logs/SCENE-TRACK.mcap, with the settings behind TRACK; an older log there is
        replaced, unless it is of a run that ended well and this one fails.
    :param progress: print progress on stderr.
    :returns: the run, also if it failed: see ``Run.ok`` and ``Run.summary``.
    :raises BadInput: before the first step, as BuildFailed, ComponentFailed, CouplingFailed, LogFailed; no log then.
    """
    overrides = {"run.stop": stop, "run.step": step}
    changes = dict(pairs(settings)) | {key: value for key, value in overrides.items() if value is not None}
    if not isinstance(scene, SystemScene):
        resolved: SystemScene = load_runnable(os.fspath(scene), track, changes)
    elif track is None:
        resolved = with_settings(scene, changes) if changes else scene
    else:
        raise BadInput(f"track = '{track}': a scene that is loaded has its track model; cotrack.load takes another one")
    path = Path(log) if log is not None else Path("logs") / resolved.log_name
    with Narration(_write_progress) if progress else nullcontext() as narration:
        result = simulate(resolved, path, narration=narration, estimated=estimate, native=native)
    return Run(result["log"] or path, result)


def _write_progress(line: str) -> None:
    sys.stderr.write(f"... {line}\n")
    sys.stderr.flush()
