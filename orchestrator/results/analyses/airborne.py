"""Intervals in which tracks are off the ground."""

from __future__ import annotations

from orchestrator.results.analyses.common_steps import blocks
from orchestrator.results.analyses.unloaded import UnloadedIntervals, unloaded_intervals
from orchestrator.results.run_data import EVER, RunData, Window


def off_ground(run: RunData, window: Window = EVER) -> UnloadedIntervals:
    """Intervals without ground contact of each track (``unloaded.py``), by the vertical ground force."""
    names = tuple(track for track in run.tracks if run.has(f"{track}.ground.force.z"))
    signals = [f"{name}.ground.force.z" for name in names]
    return run.compute_once(
        f"tracks off the ground, {window}", lambda _: unloaded_intervals(names, lambda: blocks(run, signals, window))
    )
