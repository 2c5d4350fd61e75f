"""A scene in one process, without co-simulation, behind the master and into the log of an ordinary run."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import numpy as np

from fmus.monolith.model import Monolith, Part
from fmus.ports import Port
from orchestrator.cosim import master
from orchestrator.cosim.component import LINK_FAMILIES, ComponentFailed
from orchestrator.cosim.coupling.tracks_first import TracksFirst
from orchestrator.cosim.graph import Member, System, wire
from orchestrator.cosim.narration import Narration
from orchestrator.cosim.observers import Logging, ProgressBar
from orchestrator.execution.manifest import STATS_PERIOD, manifest, strides
from orchestrator.log.recorder import Recorder
from orchestrator.scene.assembly import Assembly, assemble, placed, system
from orchestrator.scene.scene import TrackScene


class Shown:
    """One part of the monolith as a loaded component shows itself to wiring, log and statistics."""

    def __init__(self, name: str, model: Any) -> None:
        self.name, self._model = name, model
        self.wall_time, self.warnings = 0.0, ()
        ports: Sequence[Port] = model.ports
        self._units = {port.name: port.unit for port in ports}
        outputs = [port for port in ports if port.causality == "output"]
        reals = tuple(port.name for port in outputs if isinstance(port.start, float))
        self.inputs = tuple(port.name for port in ports if port.causality == "input")
        self.outputs = tuple(name for name in reals if not name.startswith(LINK_FAMILIES))
        self.links = tuple(name for name in reals if name.startswith(LINK_FAMILIES))
        self.integers = (*(port.name for port in outputs if isinstance(port.start, int)), "status")
        self.u = np.array([float(port.start) for port in ports if port.causality == "input"])
        self.y, self.y_links = np.zeros(len(self.outputs)), np.zeros(len(self.links))
        self.counters = np.zeros(len(self.integers), dtype=np.int32)
        self.read()

    def unit(self, name: str) -> str:
        """Unit of a variable."""
        return self._units.get(name, "1")

    def write(self) -> None:
        """The inputs are only shown."""

    def step(self, t: float, h: float) -> None:
        """The whole steps, not its parts."""

    def read(self) -> None:
        """The model's outputs into ``y``; raises ComponentFailed where one is not finite."""
        self._model.outputs(self.y)
        if not np.isfinite(self.y).all():
            name = self.outputs[int(np.flatnonzero(~np.isfinite(self.y))[0])]
            raise ComponentFailed(f"{self.name}: output '{name}' is not a finite number")

    def read_links(self) -> None:
        """Those of links into ``y_links``."""
        self._model.link_outputs(self.y_links)

    def read_counters(self) -> None:
        """The counters of the one integration, which all parts share."""
        self.counters[:-1] = np.minimum(self._model.counters, np.iinfo(np.int32).max)


class Whole:
    """The monolith as the only thing that the master steps: its parts follow."""

    def __init__(self, monolith: Monolith, graph: System) -> None:
        self.name = "monolith"
        self.inputs: tuple[str, ...] = ()
        self.outputs: tuple[str, ...] = ()
        self.u, self.y = np.zeros(0), np.zeros(0)
        self._monolith = monolith
        self.parts = {name: Shown(name, model) for name, model in monolith.models.items()}
        parts: Any = self.parts
        self._stages = wire(graph, parts)
        self._feed(early=True)

    def write(self) -> None:
        """Nothing comes from outside."""

    def step(self, t: float, h: float) -> None:
        """Advance all parts; raises ComponentFailed."""
        self._feed(early=True)
        began = time.perf_counter()
        try:
            self._monolith.advance(t, h)
        except RuntimeError as failure:
            raise ComponentFailed(str(failure)) from None
        spent = (time.perf_counter() - began) / len(self.parts)
        for part in self.parts.values():
            part.wall_time += spent

    def read(self) -> None:
        """What the parts show, and the mean wrenches of the step as inputs of those that take them."""
        for part in self.parts.values():
            part.read()
        self._feed(early=False)

    def _feed(self, early: bool) -> None:
        """The inputs that a log holds for a step: motions at its beginning (``early``), means over it."""
        done: set[str] = set()
        for stage in self._stages:
            for member in stage:
                for feed in member.feeds:
                    if (feed.source.name not in done) == early:
                        member.component.u[feed.inputs] = feed.source.y[feed.outputs]
            done |= {member.component.name for member in stage}


def parts_of(assembly: Assembly) -> list[Part]:
    """The parts of an assembly as the monolith takes them."""
    return [Part(part.name, part.kind, part.config, part.parameters) for part in assembly.parts]


def run(
    scene: TrackScene,
    path: Path,
    refine: float = 1.0,
    narration: Narration | None = None,
    interrupted: Callable[[], bool] = lambda: False,
) -> tuple[master.Outcome, dict[str, float]]:
    """Integrate a scene as a monolith into the log ``path``; how it ended, and what it cost.

    The communication step of the scene is that of the outputs. ``refine`` divides the internal step; a ``narration``
    is told how far it is. Raises BadInput, BuildFailed or ComponentFailed before the first step.
    """
    scene = placed(scene)
    assembly = assemble(scene)
    graph = system(assembly)
    try:
        monolith = Monolith(parts_of(assembly), assembly.connections, refine)
    except (RuntimeError, ValueError) as failure:
        raise ComponentFailed(f"{scene.name}: {failure}") from None
    whole = Whole(monolith, graph)
    parts: Any = whole.parts
    clock = master.Clock(scene.run.step, scene.run.steps)
    step = clock.step / np.ceil(clock.step / monolith.step - 1e-9)
    topics, attachments, metadata = manifest(scene, graph, parts)
    metadata["run"] |= {
        "coupling": "monolithic",
        "integrator": "runge_kutta",
        "internal_step": repr(float(step)),
    }
    part: Any = whole
    scheme = TracksFirst(((Member(part, ()),),))
    with ExitStack() as stack:
        recorder = stack.enter_context(Recorder(path, topics, attachments, metadata, every=strides(scene, parts)))
        stats_every = max(1, round(STATS_PERIOD / clock.step))
        observers: list[master.Observer] = [Logging(recorder, list(parts.values()), stats_every)]
        if narration:
            observers.append(stack.enter_context(ProgressBar(scene.name, scene.run.stop, narration)))
        began = time.perf_counter()
        outcome = master.run(scheme, clock, observers, interrupted)
        wall = time.perf_counter() - began
        recorder.close(outcome.status, outcome.message, outcome.steps)
    return outcome, {"internal_step": float(step), "wall_time": wall}
