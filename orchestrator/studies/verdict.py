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


class Row(NamedTuple):
    """What became of a case."""

    item: str  # family
    case: str
    value: float  # of the family's parameter
    verdict: str
    sensible: bool  # whether somebody could mean it
    asked: str  # expectation
    found: float = math.nan
    expected: float = math.nan
    tolerance: float = math.nan
    open: float = math.nan  # energy that the ledger leaves open, of the largest of work, change and dissipated
    step: float = math.nan  # used, s: communication step, or internal step of an explicit integrator
    predicted: float = math.nan  # longest step, s
    cause: str = ""  # what limits it
    observed: float = math.nan  # longest step that was right, s
    seconds: float = 0.0
    note: str = ""  # what happened where

    @property
    def margin(self) -> float:
        """Predicted limit over used step."""
        return self.predicted / self.step


def judged(scene: TrackScene, asked: str) -> Row:
    """Run a scene and judge it; nothing but the row is kept."""
    began = time.perf_counter()
    row = Row("", "", math.nan, MUTE, True, ASKED[asked][1], step=scene.run.step)
    with tempfile.TemporaryDirectory(prefix="cotrack-") as folder:
        path = Path(folder) / "run.mcap"
        try:
            told = simulate(scene.model_copy(update={"expect": {}}), path)
        except REFUSED as refusal:
            return _ended(row, CLEAN, str(refusal), began)
        if told["communication_steps"]:
            with Log(path) as log:
                run = RunData(log)
                if not _finite(run):
                    return _ended(row, BLOWN, told["message"] or "a recorded output is not finite", began)
                row = row._replace(open=(told["energy"] or {}).get("residual_relative", math.nan))
                if told["status"] == "ok":
                    try:
                        value, expected, tolerance = ASKED[asked][0](run, scene)
                    except Missing as missing:
                        return _ended(row, WRONG, str(missing), began)
                    row = row._replace(found=value, expected=expected, tolerance=tolerance)
    if told["status"] != "ok":
        return _ended(row, CLEAN, told["message"], began)
    if abs(row.open) > 1.0:
        return _ended(row, BLOWN, told["message"], began)
    if abs(row.open) > summary.OPEN:
        return _ended(row, WRONG, told["message"], began)
    if not abs(row.found - row.expected) <= row.tolerance:
        apart = f"{row.found:.4g} instead of {row.expected:.4g} +- {row.tolerance:.2g}"
        return _ended(row, WRONG, f"{ASKED[asked][1].split(':')[0]}: {apart}", began)
    return _ended(row, RIGHT, told["message"], began)


def _ended(row: Row, verdict: str, note: str, began: float) -> Row:
    if not note and verdict != RIGHT:
        verdict = MUTE
    return row._replace(verdict=verdict, note=" ".join(note.split()), seconds=time.perf_counter() - began)


def _finite(run: RunData) -> bool:
    return all(bool(np.isfinite(run.log.read(f"/{name}/out").values).all()) for name in run.instances)
