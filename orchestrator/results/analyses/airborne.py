"""Intervals in which tracks are off the ground."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from orchestrator.log.time_series import Floats
from orchestrator.results.analyses.spells import Spells, spells
from orchestrator.results.run_data import BLOCK, EVER, RunData, Window


def off_ground(run: RunData, window: Window = EVER) -> Spells:
    """Intervals without ground contact of each track (``spells.py``), by the vertical ground force."""
    names = tuple(track for track in run.tracks if run.has(f"{track}.ground.force.z"))
    wanted = {topic: [column] for topic, column in (run.log.find(f"{track}.ground.force.z") for track in names)}

    def blocks() -> Iterator[tuple[Floats, Floats]]:
        for block in run.log.blocks(wanted, BLOCK, window=window) if wanted else ():
            count = min(len(series.t) for series in block.values())
            found = [series.rows(slice(count)) for series in block.values()]
            yield found[0].t, np.concatenate([series.values for series in found], axis=1)

    return run.once(f"tracks off the ground, {window}", lambda _: spells(names, blocks))
