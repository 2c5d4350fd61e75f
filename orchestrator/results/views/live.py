"""Live view of a run in Rerun: new records of its log are sent periodically until the run ends."""

from __future__ import annotations

import time
from collections.abc import Iterator
from pathlib import Path

from fmus.vehicle import BadInput
from orchestrator.log.container_writer import growing_log
from orchestrator.log.reader import Log, LogUnreadable
from orchestrator.results.run_data import RunData
from orchestrator.results.views import rerun_scene
from orchestrator.results.views.bodies import Bodies, NoInstant
from orchestrator.results.views.plots import plots
from orchestrator.results.views.solids import Reach

PERIOD = 0.25  # s: longest time between writes of a recorder
PATIENCE = 60.0  # s, for the first records: a run may have to compile before it starts
AFTER = 1e-6  # s: least time after the last sent record that counts as new
MARGIN = 1.5  # colour scale over the largest value of the first records


def follow(path: Path, output: Path | None = None, colour: str | None = None) -> None:
    """Show a log that is being written, in the viewer or as a file of Rerun, from its start on.

    A finished log is shown once, whole. Raises BadInput if no records arrive, or if the log cannot be drawn or the file
    cannot be written, and NotInstalled.
    """
    with rerun_scene.opened(path, output) as scene:
        sent, reach, scale, started = float("-inf"), Reach(), (0.0, 1.0), False
        for log, end in _grown(path):
            if end <= sent:
                continue
            run = RunData(log)
            side_plots = plots(run)
            try:
                bodies = Bodies(run, rerun_scene.RATE, colour, (sent + AFTER, end))
            except NoInstant:  # there are steps, but no link record yet
                if log.being_written:
                    continue
                if not started:
                    raise
                scene.send_curves(run, side_plots, (sent + AFTER, end))
                continue
            if not started:
                low, high = bodies.colour_range()
                scale, started = (low, MARGIN * high), True
                scene.start(bodies, side_plots, scale)
            grown = reach.with_bodies(bodies)
            scene.send_shapes(bodies, grown, before=reach if sent >= 0.0 else None)
            scene.send_poses(bodies, scale)
            scene.send_curves(run, side_plots, (sent + AFTER, end))
            sent, reach = end, grown


def _grown(path: Path) -> Iterator[tuple[Log, float]]:
    """Yield the log, reopened whenever it may have grown, and the time, s, up to which it has all topics."""
    began, any_record = time.monotonic(), False
    while True:
        opened_at, going, file = time.monotonic(), True, growing_log(path)
        try:
            with Log(file) as log:
                going = log.being_written
                end = _common(log) if going else float("inf")
                any_record |= end > 0.0
                yield log, end
        except LogUnreadable:  # missing, or only its header so far
            if any_record and growing_log(path) == file:  # else the run has just ended and replaced the older log
                raise
        if not going:
            return
        if not any_record and opened_at - began > PATIENCE:
            raise BadInput(f"{path}: no run has written a record there for {PATIENCE:g} s")
        time.sleep(max(PERIOD - (time.monotonic() - opened_at), 0.0))


def _common(log: Log) -> float:
    """Return the last time, s, that every topic has reached; -inf if one is empty."""
    topics = [topic for topic in log.topics if topic.endswith(("/in", "/out", "/links"))]
    ends = [log.ends(topic).t for topic in topics]
    return min((float(t[-1]) if len(t) else float("-inf") for t in ends), default=float("-inf"))
