"""cotrack from Python: run scenes, read and analyse their logs.

>>> import cotrack
>>> run = cotrack.run("turn", track="rigid", stop=3)
>>> run
>>> run["chassis.speed"].values
>>> run.plot("left_track.tension.max").save("tension.png")

A name is imported when it is first used, so ``import cotrack`` takes no time.
"""

from typing import TYPE_CHECKING, Any

import orchestrator
from orchestrator import OFFERED, __version__

if TYPE_CHECKING:
    from orchestrator.execution.course import life
    from orchestrator.execution.log_report import report
    from orchestrator.log.export import export, to_arrow, to_pandas, to_polars, to_xarray
    from orchestrator.log.reader import Log
    from orchestrator.recorded_run import Run, run
    from orchestrator.results.analyses.catalogue import analyse
    from orchestrator.results.difference import differences_of_logs as compare
    from orchestrator.scene.scene import load
    from orchestrator.scene.scene import scene_names as scenes
    from orchestrator.studies.fit import fit
    from orchestrator.studies.parameter_sweep import sweep

__all__ = [
    "Log", "Run", "__version__", "analyse", "compare", "export", "fit", "life", "load", "report", "run", "scenes",
    "sweep", "to_arrow", "to_pandas", "to_polars", "to_xarray",
]  # fmt: skip


def __getattr__(name: str) -> Any:
    if name not in OFFERED:
        raise AttributeError(f"module 'cotrack' has no attribute '{name}'")
    return getattr(orchestrator, name)


def __dir__() -> list[str]:
    return sorted(__all__)
