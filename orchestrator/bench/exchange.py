"""What a communication step costs outside the components: the master's exchange, and the log."""

from __future__ import annotations

import time
from contextlib import ExitStack
from functools import partial
from pathlib import Path
from typing import Any

from orchestrator.bench.timing import Floats, laps, per_step
from orchestrator.cosim.component import Component
from orchestrator.cosim.coupling import SCHEMES
from orchestrator.cosim.graph import wire
from orchestrator.cosim.machine import Board, machine
from orchestrator.cosim.observers import Logging
from orchestrator.execution.manifest import open_log
from orchestrator.execution.simulate import opened
from orchestrator.scene.scene import TrackScene
from orchestrator.studies.tables import ABOUT, COST, Column

COLUMNS = (
    Column("tracks", "vehicle on tracks", "", ABOUT),
    Column("exchange", "master's exchange, us", ".1f", COST),
    Column("log", "log, us", ".1f", COST),
    Column("packing", "log's own thread, us", ".1f", COST),
)
STATS_EVERY = 100  # steps, as in a run at 1 ms


def measure(scene: TrackScene, path: Path, repeats: int) -> dict[str, float]:
    """Mean over a scene's steps, by the least of the repeats of each; the log goes to ``path``."""
    runs = [_run(scene, path) for _ in range(repeats)]
    return {
        "exchange": per_step([exchange for exchange, _, _ in runs]),
        "log": per_step([log for _, log, _ in runs]),
        "packing": min(packing for _, _, packing in runs),
    }


def _run(scene: TrackScene, path: Path) -> tuple[Floats, Floats, float]:
    """CPU times of the exchange and of the log at each step, us; of the thread that packs messages the mean."""
    h, steps, coupling = scene.run.step, scene.run.steps, scene.run.coupling
    alone: Any = partial(SCHEMES[coupling.scheme], threads=False, **coupling.options())
    with ExitStack() as stack:
        placed, graph, components = opened(scene, stack, None)
        scheme = stack.enter_context(alone(wire(graph, components)))
        recorder = stack.enter_context(open_log(path, placed, graph, components, scheme))
        logging = Logging(recorder, list(components.values()), STATS_EVERY)
        packing = time.process_time() - time.thread_time()
        _, log = laps(steps, lambda k: scheme.advance(k * h, h), lambda k: logging(k, k * h, h))
        recorder.close("ok", "", steps)
        packing = 1e6 * (time.process_time() - time.thread_time() - packing) / steps
        for component in components.values():
            assert isinstance(component, Component)
            _idle(component)
        (exchange,) = laps(steps, lambda k: scheme.advance((steps + k) * h, h))
    return exchange, log, packing


def _idle(component: Component) -> None:
    """What is left of a step without what happens inside the components."""
    for function in ("set_real", "do_step", "get_real"):
        component.board[Board._fields.index(function)] = machine().nothing
