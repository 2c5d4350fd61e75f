"""Cost of a communication step outside the components: the master's exchange, and the log."""

from __future__ import annotations

import time
from contextlib import ExitStack
from functools import partial
from pathlib import Path
from typing import Any

from numba import cfunc

from orchestrator.cosim.component import Component
from orchestrator.cosim.coupling import SCHEMES
from orchestrator.cosim.coupling.scheme import Scheme
from orchestrator.cosim.graph import wire
from orchestrator.cosim.observers import Logging
from orchestrator.execution.loading import load_scene
from orchestrator.execution.manifest import open_log
from orchestrator.results.table import ABOUT, COST, Column
from orchestrator.scene.assembly import assemble
from orchestrator.scene.kinds import Scene
from tests.benchmarks.timing import quiet

COLUMNS = (
    Column("tracks", "vehicle on tracks", "", ABOUT),
    Column("exchange", "master's exchange, us", ".1f", COST),
    Column("log", "log, us", ".1f", COST),
    Column("packing", "log's own thread, us", ".1f", COST),
)
NOTHING = cfunc("int32()")(lambda: 0)  # returns as any of FMI's functions does
STATS_EVERY = 100  # steps, as in a run at 1 ms


def measure(scene: Scene, path: Path, repeats: int) -> dict[str, float]:
    """Means over the steps of a scene, each the least of the repeats; the log goes to ``path``."""
    runs = [_run(scene, path) for _ in range(repeats)]
    return dict(zip(("exchange", "log", "packing"), map(min, zip(*runs, strict=True)), strict=True))


def _run(scene: Scene, path: Path) -> tuple[float, float, float]:
    """CPU times per step, us: exchange, log, and the thread that packs messages."""
    h, steps, coupling = scene.run.step, scene.run.steps, scene.run.coupling
    alone: Any = partial(SCHEMES[coupling.scheme], threads=False, **coupling.options())
    with ExitStack() as stack:
        placed, graph, components = load_scene(scene, assemble(scene), stack, None)
        scheme = stack.enter_context(alone(wire(graph, components)))
        recorder = stack.enter_context(open_log(path, placed, graph, components, scheme))
        logging = Logging(recorder, list(components.values()), STATS_EVERY)
        scheme.row_writer = logging.row_writer
        logging(0, 0.0, h)
        packing = time.process_time() - time.thread_time()
        _, log = _marched(scheme, logging, 0, steps, h)
        recorder.close("ok", "", steps)
        packing = 1e6 * (time.process_time() - time.thread_time() - packing) / steps
        for component in components.values():
            assert isinstance(component, Component)
            _idle(component)
        exchange, _ = _marched(scheme, None, steps, steps, h)
    return exchange, log, packing


def _marched(scheme: Scheme, logging: Logging | None, first: int, steps: int, h: float) -> tuple[float, float]:
    """CPU times of this thread per step and per record, us, after ``first`` steps, in batches as in a run."""
    k, stepping, recording, clock = first, 0.0, 0.0, time.thread_time
    with quiet():
        while k < first + steps:
            began = clock()
            k += scheme.step_batch(k, min(STATS_EVERY - k % STATS_EVERY, first + steps - k), h)
            done = clock()
            if logging is not None:
                logging(k, k * h, h)
            stepping, recording = stepping + done - began, recording + clock() - done
    return 1e6 * stepping / steps, 1e6 * recording / steps


def _idle(component: Component) -> None:
    """Replace the component's step and data transfer by functions that do nothing."""
    for function in ("set_real", "do_step", "get_real"):
        component.step_call[function] = NOTHING.address
