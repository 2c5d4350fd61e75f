"""Cost of the log in a run: pieces of ``straight`` with and without recording, in turn."""

from __future__ import annotations

import tempfile
import time
from contextlib import ExitStack
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from orchestrator.cosim.coupling import coupling as class_of
from orchestrator.cosim.graph import connect
from orchestrator.cosim.observers import Checkpoints, Logging
from orchestrator.cosim.row_writer import RowWriter
from orchestrator.execution.loading import load_scene
from orchestrator.execution.manifest import STATS_PERIOD, open_log
from orchestrator.results.table import ABOUT, COST, Column, Table
from orchestrator.scene.assembly import assemble
from orchestrator.scene.kinds import Scene
from tests.benchmarks import own
from tests.benchmarks.timing import quiet

SCENE, TRACK = "straight", "flexible"
MOVING = ("drive.ramp_start=0 s", "drive.ramp_time=1 s")  # numbers at rest compress faster
PIECE = 2.0  # s
PIECES, QUICK_PIECES = 8, 3  # pieces with recording, per repeat
NEVER = 1 << 40  # steps
COLUMNS = (
    Column("fmus", "FMUs", "", ABOUT),
    Column("links", "links recorded at", "", ABOUT),
    Column("step", "step without, us", ".0f", COST),
    Column("share", "share of recording, %", ".1f", COST),
    Column("low", "lower quartile, %", ".1f"),
    Column("high", "upper quartile, %", ".1f"),
    Column("size", "MB a simulated second", ".2f", COST),
)


def measure(quick: bool, repeats: int) -> list[Table]:
    """Cost with Python and native FMUs, with default recording and with all link outputs at every step."""
    rows = []
    for native in (False, True):
        for links in ((), ("run.links=1",)):
            pieces = (QUICK_PIECES if quick else PIECES) * (1 if quick else repeats)
            end = f"run.stop={PIECE * (2 * pieces + 2):g} s"
            scene = own.scene(SCENE, TRACK, [*MOVING, *links, end])
            rows.append(row(scene, native, pieces, round(PIECE / scene.run.step)))
    note = (
        f"`{SCENE}`, from standstill; {PIECE:g} s with and without record in turn, wall time until all is in"
        " the file; without: link outputs are not read either. Share: what a piece takes longer than the mean of its"
        " neighbours; median and quartiles."
    )
    return [Table.of_records("What the log costs", COLUMNS, rows, (note,))]


def row(scene: Scene, native: bool, pieces: int, steps: int) -> dict[str, Any]:
    """Time ``pieces`` recorded pieces of ``steps`` steps, each between two without recording."""
    with tempfile.TemporaryDirectory(prefix="cotrack-") as folder:
        log = Path(folder) / "run.mcap"
        times = pieces_of(scene, native, pieces, steps, log)
        size = log.stat().st_size
    without, recorded = times[::2], times[1::2]
    shares = [1.0 - 0.5 * sum(around) / one for around, one in zip(pairwise(without), recorded, strict=True)]
    low, share, high = 100.0 * np.quantile(shares, (0.25, 0.5, 0.75))
    return {
        "fmus": "native" if native else "Python",
        "links": f"one step in {scene.links_every}",
        "step": 1e6 * float(np.median(without)) / steps,
        "share": float(share),
        "low": float(low),
        "high": float(high),
        "size": size / 1e6 / (pieces * steps * scene.run.step),
    }


def pieces_of(scene: Scene, native: bool, pieces: int, steps: int, log: Path) -> list[float]:
    """Wall times of pieces, s; every second one is recorded, the first is not."""
    h, coupling, period = scene.run.step, scene.run.coupling, scene.run.checkpoints
    with ExitStack() as stack:
        placed, graph, components = load_scene(scene, assemble(scene), stack, native)
        scheme = stack.enter_context(class_of(coupling.scheme)(connect(graph, components), **coupling.options()))
        recorder = stack.enter_context(open_log(log, placed, graph, components, scheme))
        logging = Logging(recorder, list(components.values()), max(1, round(STATS_PERIOD / h)))
        checkpoints = Checkpoints(recorder, scheme, round(period / h) if period else NEVER)
        row_writer = scheme.row_writer = logging.row_writer
        assert isinstance(row_writer, RowWriter)
        every, k, times = row_writer.every, 0, []

        def piece(recorded: bool) -> None:
            nonlocal k
            row_writer.every = every if recorded else NEVER
            if recorded:
                logging.continue_after(k, k * h, h)  # skips the steps that are not in the log
            began, end = time.perf_counter(), k + steps
            while k < end:
                k += scheme.step_batch(k, min(end - k, logging.patience(k), checkpoints.patience(k)), h)
                if recorded:
                    logging(k, k * h, h)
                    checkpoints(k, k * h, h)
                else:
                    row_writer.pop_counts()
            recorder.flush()
            times.append(time.perf_counter() - began)

        logging(0, 0.0, h)
        recorder.flush()
        piece(True)  # compiles and allocates
        times.clear()
        with quiet():
            for recorded in (False, *(True, False) * pieces):
                piece(recorded)
        recorder.close("ok", "", k)
    return times
