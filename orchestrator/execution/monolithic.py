"""Monolithic run of a scene (without co-simulation), with the same master and the same log topics."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import numpy as np

from fmus.monolith.model import ADAPTIVE, EQUAL, Monolith, MonolithPart
from fmus.ports import TOLERANCE, Port
from fmus.vehicle import BadInput
from orchestrator.cosim import master
from orchestrator.cosim.component import LINK_FAMILIES, ComponentFailed
from orchestrator.cosim.coupling.input_hold import Outputs
from orchestrator.cosim.coupling.scheme import Scheme
from orchestrator.cosim.graph import Feed, Stages, wire
from orchestrator.cosim.narration import Narration
from orchestrator.cosim.observers import Logging, ProgressBar
from orchestrator.execution.manifest import STATS_PERIOD, open_log
from orchestrator.execution.states import States
from orchestrator.log.wire import Rule
from orchestrator.scene.assembly import Assembly, assemble, system
from orchestrator.scene.placing import placed
from orchestrator.scene.scene import Scene


class Shown:
    """Part of the monolith with the interface of a loaded component for wiring, log and statistics."""

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
        """Return the unit of a variable, '1' if it has none."""
        return self._units.get(name, "1")

    def read(self) -> None:
        """Read the model's outputs into ``y``; raises ComponentFailed if one is not finite."""
        self._model.outputs(self.y)
        if not np.isfinite(self.y).all():
            name = self.outputs[int(np.flatnonzero(~np.isfinite(self.y))[0])]
            raise ComponentFailed(f"{self.name}: output '{name}' is not a finite number")

    def read_links(self) -> None:
        """Read the per-link outputs into ``y_links``."""
        self._model.link_outputs(self.y_links)

    def read_counters(self) -> None:
        """Read the counters of the integration, which all parts share."""
        self.counters[:-1] = np.minimum(self._model.counters, np.iinfo(np.int32).max)


class Whole(Scheme):
    """Coupling scheme of the monolith: all parts advance at once."""

    NAME = "monolithic"

    def __init__(self, stages: Stages, monolith: Monolith) -> None:
        super().__init__(stages, threads=False)
        self._monolith = monolith
        self._feed(early=True)

    def exchange(self, t: float, h: float, now: Outputs) -> None:
        """Advance all parts by one step; mean wrenches over the step become inputs of the parts they act on."""
        self._feed(early=True)
        began = time.perf_counter()
        try:
            self._monolith.advance(t, h)
        except RuntimeError as failure:
            raise ComponentFailed(str(failure)) from None
        spent = (time.perf_counter() - began) / len(self.members)
        for member in self.members:
            part: Any = member.component
            part.wall_time += spent
            part.read()
        self._feed(early=False)

    def rule(self, feed: Feed, stepped: bool) -> Rule | None:
        """Rule of a connection in the log: motion at the beginning of the step, means at its end."""
        return "end" if stepped else "start"

    def _feed(self, early: bool) -> None:
        """Copy inputs whose values belong to the beginning of the step (``early``), or to its end."""
        for member in self.members:
            for feed in member.feeds:
                if (feed.source.name in self.stepped(member)) != early:
                    member.component.u[feed.inputs] = feed.source.y[feed.outputs]


def parts_of(assembly: Assembly) -> list[MonolithPart]:
    """Return the parts of an assembly as parts of a ``Monolith``."""
    return [MonolithPart(part.name, part.kind, part.config, part.parameters) for part in assembly.parts]


def run(
    scene: Scene,
    path: Path,
    refine: float = 1.0,
    narration: Narration | None = None,
    interrupted: Callable[[], bool] = lambda: False,
    integrator: str = EQUAL,
    rtol: float = TOLERANCE,
    atol: float = TOLERANCE,
    begun: States | None = None,
) -> tuple[master.Outcome, dict[str, float]]:
    """Integrate a scene as a monolith into the log ``path``; return the outcome and the cost.

    The communication step of the scene is the interval of the outputs. ``refine`` divides the internal step; the
    ``integrator`` "adams" chooses its steps by ``rtol`` and ``atol`` (``Monolith``). ``begun``: states of a
    co-simulation of the scene (``states_at``), from which the run continues to the scene's stop. ``narration``
    receives the progress. The cost holds internal step (the longest allowed) and wall time, s, and the numbers of
    steps, evaluations, rejected steps and restarts, and the mean order. Raises BadInput, BuildFailed or
    ComponentFailed before the first step.
    """
    scene = placed(scene)
    assembly = assemble(scene)
    graph = system(assembly)
    clock = master.Clock(scene.run.step, scene.run.steps)
    if begun is not None:
        clock = clock._replace(done=round(begun.time / clock.step))
        if clock.done >= clock.steps:
            raise BadInput(f"run.stop = {scene.run.stop:g} s must be after the states of {begun.time:g} s")
    try:
        monolith = Monolith(
            parts_of(assembly), assembly.connections, refine, integrator=integrator, rtol=rtol, atol=atol
        )
        if begun is not None:
            monolith.begin_at(begun.time, begun.parts)
    except (RuntimeError, ValueError) as failure:
        raise ComponentFailed(f"{scene.name}: {failure}") from None
    parts: Any = {name: Shown(name, model) for name, model in monolith.models.items()}
    whole = Whole(wire(graph, parts), monolith)
    step = clock.step / np.ceil(clock.step / monolith.step - 1e-9)
    about = {"coupling": "monolithic", "integrator": integrator, "internal_step": repr(float(step))}
    if integrator == ADAPTIVE:
        about |= {"rtol": repr(rtol), "atol": repr(atol)}
    with ExitStack() as stack:
        recorder = stack.enter_context(open_log(path, scene, graph, parts, whole, about))
        stats_every = max(1, round(STATS_PERIOD / clock.step))
        logging = Logging(recorder, list(parts.values()), stats_every)
        observers: list[master.Observer] = [logging]
        if begun is not None:
            logging.begin(clock.done, begun.time, clock.step)
        if narration:
            observers.append(stack.enter_context(ProgressBar(scene.name, scene.run.stop, narration)))
        began = time.perf_counter()
        outcome = master.run(whole, clock, observers, interrupted, begun and (clock.done, begun.time))
        wall = time.perf_counter() - began
        recorder.close(outcome.status, outcome.message, outcome.steps)
    return outcome, {"internal_step": float(step), "wall_time": wall, **monolith.effort._asdict()}
