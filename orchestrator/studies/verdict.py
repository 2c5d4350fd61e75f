"""Verdict on one run, one of ``VERDICTS``, from its end, its ledger and one expectation."""

from __future__ import annotations

import math
import tempfile
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

from fmus.build import BuildFailed
from fmus.vehicle import BadInput
from orchestrator.cosim.component import ComponentFailed
from orchestrator.execution import summary
from orchestrator.execution.simulate import simulate
from orchestrator.log.reader import Log
from orchestrator.results.run_data import Missing, RunData
from orchestrator.results.validity.limits import ALLOWED
from orchestrator.scene.kinds import Scene
from orchestrator.studies.expectations import EXPECTATIONS
from orchestrator.studies.row import Row

RIGHT, WRONG, CLEAN, BLOWN, MUTE = VERDICTS = (
    "stable and right", "stable and wrong", "failed cleanly", "blown up", "no sentence"
)  # fmt: skip
REFUSED = (BadInput, BuildFailed, ComponentFailed)
WITHOUT_VERDICT = {
    "verdict": MUTE,
    "sensible": True,
    "asked": "an end",
    "seconds": 0.0,
}  # sentences for cases without one of their own


def with_verdict(row: Row, verdict: str, note: str) -> Row:
    """Set the verdict of a row: one that is not right needs a sentence; a realistic case must be right."""
    if not note and verdict != RIGHT:
        verdict = MUTE
    ok = verdict == RIGHT or (verdict != MUTE and not row.figures.get("sensible", True))
    return replace(row.with_figures(verdict=verdict), ok=ok, note=" ".join(note.split()))


def judged_run(scene: Scene, expectation: str, row: Row | None = None) -> Row:
    """Run a scene and judge it; only the row is kept, with its earlier figures."""
    began = time.perf_counter()
    row = (row or Row("", "")).with_figures(asked=EXPECTATIONS[expectation][1])
    with tempfile.TemporaryDirectory(prefix="cotrack-") as folder:
        row = _judged_log(scene, expectation, row, Path(folder) / "run.mcap")
    return row.with_figures(seconds=time.perf_counter() - began)


def _judged_log(scene: Scene, expectation: str, row: Row, path: Path) -> Row:
    try:
        run = scene.run.model_copy(update={"allow": ALLOWED})  # the question is what integrators bear
        result = simulate(scene.model_copy(update={"expect": {}, "run": run}), path)
    except REFUSED as refusal:
        return with_verdict(row, CLEAN, str(refusal))
    if result["communication_steps"]:
        with Log(path) as log:
            data = RunData(log)
            if not all(np.isfinite(log.read(f"/{name}/out").values).all() for name in data.instances):
                return with_verdict(row, BLOWN, result["message"] or "a recorded output is not finite")
            row = row.with_figures(open=(result["energy"] or {}).get("residual_relative", math.nan))
            if result["status"] == "ok":
                try:
                    value, expected, tolerance = EXPECTATIONS[expectation][0](data, scene)
                except Missing as missing:
                    return with_verdict(row, WRONG, str(missing))
                row = row.with_figures(found=value, expected=expected, tolerance=tolerance)
    if result["status"] != "ok":
        return with_verdict(row, CLEAN, result["message"])
    if abs(row["open"]) > summary.LARGEST_RESIDUAL:
        return with_verdict(row, BLOWN if abs(row["open"]) > 1.0 else WRONG, result["message"])
    if not abs(row["found"] - row["expected"]) <= row["tolerance"]:
        deviation = f"{row['found']:.4g} instead of {row['expected']:.4g} +- {row['tolerance']:.2g}"
        return with_verdict(row, WRONG, f"{row['asked'].split(':')[0]}: {deviation}")
    return with_verdict(row, RIGHT, result["message"])
