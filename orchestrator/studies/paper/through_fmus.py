"""Adams' methods inside tracks that are FMUs: they begin anew at each communication step, which costs evaluations.

A vehicle that drives off at once, coupled as in its scene, by FMUs; the count of the paper is that of ``pieces``, where
one differential equation is integrated without a stop.
"""

from __future__ import annotations

import tempfile
from pathlib import Path

from fmus.vehicle import BadInput
from orchestrator.execution.simulate import simulate
from orchestrator.studies.paper.models import named, scene
from orchestrator.studies.tables import Row

TOLERANCE = 1e-6  # relative and absolute
DRIVE = "drive.ramp_start=0", "drive.ramp_time=0.5", "expect={}", "track.link_outputs=false"


def rows(name: str, stop: float) -> list[Row]:
    """Evaluations and restarts of both tracks a simulated second, over the first ``stop`` s."""
    label, common = named(name).label, {"model": name, "stop": stop}
    adams = "track.integrator=adams", f"track.rtol={TOLERANCE!r}", f"track.atol={TOLERANCE!r}"
    wanted = scene(named(name), *adams, *DRIVE, f"run.stop={stop!r}")
    if isinstance(wanted, str):
        return [Row("fmus", label, common, note=f"not there: {wanted}")]
    try:
        with tempfile.TemporaryDirectory() as folder:
            told = simulate(wanted, Path(folder) / "run.mcap")
    except (BadInput, RuntimeError) as failure:
        return [Row("fmus", label, common, note=f"not there: {failure}")]
    if told["status"] != "ok":
        return [Row("fmus", label, common, note=f"not there: {told['message']}")]
    tracks = [cost for part, cost in told["components"].items() if part.endswith("_track")]
    figures = {
        "evaluations": sum(cost["evaluations"] for cost in tracks) / stop,
        "restarts": len(tracks) * told["communication_steps"] / stop,
        "steps": sum(cost["steps"] for cost in tracks) / stop,
    }
    return [Row("fmus", label, {**common, **figures}, True)]
