"""What becomes of one run: its end, its ledger and one expectation make one of ``VERDICTS``."""

from __future__ import annotations

import math
import tempfile
import time
from pathlib import Path
from typing import NamedTuple

import numpy as np

from fmus.build import BuildFailed
from fmus.vehicle import BadInput
from orchestrator.cosim.component import ComponentFailed
from orchestrator.execution import summary
from orchestrator.execution.simulate import simulate
from orchestrator.log.reader import Log
from orchestrator.results.run_data import Missing, RunData
from orchestrator.scene.scene import TrackScene
from orchestrator.studies.expectations import ASKED

RIGHT, WRONG, CLEAN, BLOWN, MUTE = VERDICTS = (
    "stable and right", "stable and wrong", "failed cleanly", "blown up", "no sentence"
)  # fmt: skip
REFUSED = (BadInput, BuildFailed, ComponentFailed)


class Judged(NamedTuple):
    """What became of a case."""

    item: str  # family; empty: that of the case
    case: str
    value: float = math.nan  # of the family's parameter
    verdict: str = MUTE
    sensible: bool = True  # whether somebody could mean it
    asked: str = "an end"  # expectation
    found: float = math.nan
    expected: float = math.nan
    tolerance: float = math.nan
    open: float = math.nan  # energy that the ledger leaves open, of the largest of work, change and dissipated
    step: float = math.nan  # used, s: communication step, or internal step of an explicit integrator
    predicted: float = math.nan  # longest step, s
    cause: str = ""  # what limits it
    observed: float = math.nan  # longest step that was right, s
    seconds: float = 0.0
    ok: bool | None = None  # it has an end and a sentence; and what somebody could mean is right
    note: str = ""  # what happened where

    @property
    def margin(self) -> float:
        """Predicted limit over used step."""
        return self.predicted / self.step

    def ended(self, verdict: str, note: str) -> Judged:
        """The row with its end; one that is not right needs a sentence."""
        if not note and verdict != RIGHT:
            verdict = MUTE
        ok = verdict == RIGHT or (verdict != MUTE and not self.sensible)
        return self._replace(verdict=verdict, ok=ok, note=" ".join(note.split()))


def judged(scene: TrackScene, asked: str, row: Judged | None = None) -> Judged:
    """Run a scene and judge it; nothing but the row is kept, with what it has already."""
    began = time.perf_counter()
    row = row or Judged("", "")
    with tempfile.TemporaryDirectory(prefix="cotrack-") as folder:
        ended = _judged(scene, asked, row._replace(asked=ASKED[asked][1]), Path(folder) / "run.mcap")
    return ended._replace(seconds=time.perf_counter() - began)


def _judged(scene: TrackScene, asked: str, row: Judged, path: Path) -> Judged:
    try:
        told = simulate(scene.model_copy(update={"expect": {}}), path)
    except REFUSED as refusal:
        return row.ended(CLEAN, str(refusal))
    if told["communication_steps"]:
        with Log(path) as log:
            run = RunData(log)
            if not _finite(run):
                return row.ended(BLOWN, told["message"] or "a recorded output is not finite")
            row = row._replace(open=(told["energy"] or {}).get("residual_relative", math.nan))
            if told["status"] == "ok":
                try:
                    value, expected, tolerance = ASKED[asked][0](run, scene)
                except Missing as missing:
                    return row.ended(WRONG, str(missing))
                row = row._replace(found=value, expected=expected, tolerance=tolerance)
    if told["status"] != "ok":
        return row.ended(CLEAN, told["message"])
    if abs(row.open) > summary.OPEN:
        return row.ended(BLOWN if abs(row.open) > 1.0 else WRONG, told["message"])
    if not abs(row.found - row.expected) <= row.tolerance:
        apart = f"{row.found:.4g} instead of {row.expected:.4g} +- {row.tolerance:.2g}"
        return row.ended(WRONG, f"{row.asked.split(':')[0]}: {apart}")
    return row.ended(RIGHT, told["message"])


def _finite(run: RunData) -> bool:
    return all(bool(np.isfinite(run.log.read(f"/{name}/out").values).all()) for name in run.instances)
