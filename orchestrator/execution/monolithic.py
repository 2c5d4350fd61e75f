"""Monolithic run of a scene (without co-simulation), with the same master and the same log topics.

It may start from the states of all parts at one time of a co-simulation, which are cached. An explicit method takes
half a million evaluations for a second of steel links. It therefore integrates a short interval of a drive only, and
implicit co-simulation computes the seconds before.
"""

from __future__ import annotations

import hashlib
import io
import json
import tempfile
import time
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fmus.cache.files import cache_folder, private_folder, read_checked, write_checked
from fmus.fmi.build import identity
from fmus.fmi.saved import from_bytes
from fmus.interface.ports import TOLERANCE, Port
from fmus.monolith.model import ADAPTIVE, EQUAL, Monolith, MonolithPart
from fmus.vehicles.tables import BadInput
from orchestrator.cosim import checkpoint, master
from orchestrator.cosim.coupling.input_hold import Outputs
from orchestrator.cosim.coupling.scheme import Scheme
from orchestrator.cosim.graph import Feed, Stages, connect
from orchestrator.cosim.observers import Logging, TimeReached
from orchestrator.cosim.variables import LINK_FAMILIES
from orchestrator.execution.manifest import STATS_PERIOD, open_log
from orchestrator.execution.simulate import simulate
from orchestrator.fmi.slave import ComponentFailed
from orchestrator.log.log_metadata import CHECKPOINT
from orchestrator.log.reader import Log
from orchestrator.log.time_series import Rule
from orchestrator.scene.assembly import assemble, system
from orchestrator.scene.kinds import Scene
from orchestrator.scene.parts import Assembly
from orchestrator.scene.placing import placed


class States(NamedTuple):
    """Model states of all parts at one time."""

    time: float  # s
    parts: dict[str, NDArray[np.float64]]  # part -> flat state


def states_at(scene: Scene, time: float) -> States:
    """Find the states of a scene at ``time``, s, or compute them by co-simulation.

    The scene's stop is ignored. Raises BadInput if ``time`` is not a multiple of the communication step, and the
    errors of ``simulate``.
    """
    scene.require_own_parts("states of models are those of")
    run = scene.run.model_copy(update={"stop": time, "checkpoints": time})
    steps = run.steps
    if not steps or abs(time / run.step - steps) > 1e-6:
        raise BadInput(f"states at {time:g} s: that must be a multiple of run.step = {run.step:g} s")
    target = scene.model_copy(update={"run": run, "expect": {}})
    place = private_folder(cache_folder() / "states" / _key(target)) / "states.npz"
    content = read_checked(place)
    if content is None:
        content = _computed_states(target, steps)
        write_checked(place, content)
    with np.load(io.BytesIO(content), allow_pickle=False) as archive:
        return States(time, {name: archive[name] for name in archive})


def _key(scene: Scene) -> str:
    """Hash of the scene and of its FMUs."""
    fmus = [identity(instance.fmu) for instance in system(assemble(placed(scene))).instances if instance.fmu]
    return hashlib.sha256(json.dumps([scene.resolved(), fmus], sort_keys=True).encode()).hexdigest()[:24]


def _computed_states(scene: Scene, steps: int) -> bytes:
    """Run to the step and extract the states from its checkpoint."""
    with tempfile.TemporaryDirectory(prefix="cotrack-") as folder:
        summary = simulate(scene, Path(folder) / "run.mcap")
        if summary["status"] != "ok":
            raise ComponentFailed(f"{scene.name}: {summary['message']}")
        with Log(Path(str(summary["log"]))) as log:
            _, saved = checkpoint.states(log.attachment(f"{CHECKPOINT}{steps}"))
    states = {name: from_bytes(state).state for name, state in saved.items()}
    content = io.BytesIO()
    np.savez(content, allow_pickle=False, **states)  # type: ignore[arg-type]
    return content.getvalue()


class MonolithComponent:
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


class MonolithScheme(Scheme):
    """Coupling scheme of the monolith: all parts advance at once."""

    NAME = "monolithic"

    def __init__(self, stages: Stages, monolith: Monolith) -> None:
        super().__init__(stages, threads=False)
        self._monolith = monolith
        self._feed(at_start=True)

    def exchange(self, t: float, h: float, now: Outputs) -> None:
        """Advance all parts by one step; mean wrenches over the step become inputs of the parts they act on."""
        self._feed(at_start=True)
        start = time.perf_counter()
        try:
            self._monolith.advance(t, h)
        except RuntimeError as failure:
            raise ComponentFailed(str(failure)) from None
        share = (time.perf_counter() - start) / len(self.members)
        for member in self.members:
            part: Any = member.component
            part.wall_time += share
            part.read()
        self._feed(at_start=False)

    def rule(self, feed: Feed, source_stepped: bool) -> Rule | None:
        """Rule of a connection in the log: motion at the beginning of the step, means at its end."""
        return "end" if source_stepped else "start"

    def _feed(self, at_start: bool) -> None:
        """Copy inputs whose values belong to the beginning of the step (``at_start``), or to its end."""
        for member in self.members:
            for feed in member.feeds:
                if (feed.source.name in self.stepped_before(member)) != at_start:
                    member.component.u[feed.inputs] = feed.source.y[feed.outputs]


def parts_of(assembly: Assembly) -> list[MonolithPart]:
    """Return the parts of an assembly as parts of a ``Monolith``."""
    return [MonolithPart(part.name, part.kind, part.config, part.parameters) for part in assembly.parts]


def run(
    scene: Scene,
    path: Path,
    refine: float = 1.0,
    interrupted: Callable[[], bool] = lambda: False,
    integrator: str = EQUAL,
    rtol: float = TOLERANCE,
    atol: float = TOLERANCE,
    initial_states: States | None = None,
) -> tuple[master.RunOutcome, dict[str, float]]:
    """Integrate a scene as a monolith into the log ``path``; return the outcome and the cost.

    The communication step of the scene is the interval of the outputs. ``refine`` divides the internal step; the
    ``integrator`` "adams" chooses its steps by ``rtol`` and ``atol`` (``Monolith``). ``initial_states``: states of a
    co-simulation of the scene (``states_at``), from which the run continues to the scene's stop. The cost holds
    internal step (the longest allowed) and wall time, s, and the numbers of steps, evaluations, rejected steps and
    restarts, and the mean order. Raises BadInput, BuildFailed or ComponentFailed before the first step.
    """
    scene.require_own_parts("a monolith has")
    scene = placed(scene)
    assembly = assemble(scene)
    graph = system(assembly)
    clock = master.FixedStep(scene.run.step, scene.run.steps)
    if initial_states is not None:
        clock = clock._replace(steps_done=round(initial_states.time / clock.step))
        if clock.steps_done >= clock.steps:
            raise BadInput(f"run.stop = {scene.run.stop:g} s must be after the states of {initial_states.time:g} s")
    try:
        monolith = Monolith(
            parts_of(assembly), assembly.connections, refine, integrator=integrator, rtol=rtol, atol=atol
        )
        if initial_states is not None:
            monolith.begin_at(initial_states.time, initial_states.parts)
    except (RuntimeError, ValueError) as failure:
        raise ComponentFailed(f"{scene.name}: {failure}") from None
    parts: Any = {name: MonolithComponent(name, model) for name, model in monolith.models.items()}
    scheme = MonolithScheme(connect(graph, parts), monolith)
    step = clock.step / np.ceil(clock.step / monolith.step - 1e-9)
    about = {"coupling": "monolithic", "integrator": integrator, "internal_step": repr(float(step))}
    if integrator == ADAPTIVE:
        about |= {"rtol": repr(rtol), "atol": repr(atol)}
    with ExitStack() as stack:
        recorder = stack.enter_context(open_log(path, scene, graph, parts, scheme, about))
        stats_every = max(1, round(STATS_PERIOD / clock.step))
        logging = Logging(recorder, list(parts.values()), stats_every)
        observers: list[master.Observer] = [logging, TimeReached(scene.run.stop)]
        if initial_states is not None:
            logging.continue_after(clock.steps_done, initial_states.time, clock.step)
        start = time.perf_counter()
        outcome = master.run(
            scheme, clock, observers, interrupted, initial_states and (clock.steps_done, initial_states.time)
        )
        wall = time.perf_counter() - start
        recorder.close(outcome.status, outcome.message, outcome.steps)
    return outcome, {"internal_step": float(step), "wall_time": wall, **monolith.effort._asdict()}
