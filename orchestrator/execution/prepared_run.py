"""Run that is ready to step: components wired by a coupling scheme, at the start of a scene or at a checkpoint."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import asdict
from math import ceil
from typing import Any, NamedTuple

from orchestrator.cosim import checkpoint, master
from orchestrator.cosim.component import Component
from orchestrator.cosim.coupling import coupling
from orchestrator.cosim.coupling.power_residual import PowerResidual
from orchestrator.cosim.coupling.scheme import Scheme, copy_inputs, require_states
from orchestrator.cosim.coupling.variable_step import VariableStep
from orchestrator.cosim.graph import Recordable, Stages, System, connect
from orchestrator.cosim.observers import Checkpoints, Logging, ReachedPoint, TimedCheckpoints
from orchestrator.execution.interrupt import Interrupt
from orchestrator.execution.manifest import STATS_PERIOD
from orchestrator.fmi.slave import ComponentFailed
from orchestrator.kernels.compiled import kernels
from orchestrator.log.message_records import MAX_STEPS
from orchestrator.log.recorder import Recorder
from orchestrator.scene.system_scene import SystemScene
from orchestrator.scene.tables import RunTable

REFERENCE_ENERGY = 1.0  # J, of the power residual until a bond has carried more, unless the scene sets it


class Continuation(NamedTuple):
    """Checkpoint of an earlier run, and the function that copies its log."""

    step: int  # number of the last step done
    checkpoint: bytes
    copy_records: Callable[[Recorder], None]  # copies the records up to the step
    metadata: Mapping[str, Mapping[str, str]]
    # Maps a saved state to what the component gets.
    adapt_state: Callable[[Component, bytes], bytes] = lambda _, state: state


class PreparedRun(NamedTuple):
    """Scene with wired components at their start or at a checkpoint."""

    scene: SystemScene
    graph: System
    components: dict[str, Component]
    scheme: Scheme
    step_control: master.FixedStep | VariableStep | PowerResidual
    restored_point: Any  # number, time and state of the checkpoint; None at the start

    @classmethod
    def prepare(
        cls,
        scene: SystemScene,
        graph: System,
        components: dict[str, Component],
        continuation: Continuation | None = None,
    ) -> PreparedRun:
        """Wire, warm up and, if ``continuation`` is given, restore; raises CouplingFailed, UnusableCheckpoint."""
        stages = connect(graph, components)
        scheme: Scheme = coupling(scene.run.coupling.scheme)(stages, **scene.run.coupling.options())
        step_control, restored_point = step_control_of(scene.run), None
        if isinstance(step_control, VariableStep):
            require_states(scheme, "a variable step")
        warm_up(stages, scene.run.step)
        if continuation is not None:
            restore_memory = None if isinstance(step_control, master.FixedStep) else step_control.restore_memory
            restored_point = checkpoint.restore(
                continuation.checkpoint, scheme, continuation.step, restore_memory, continuation.adapt_state
            )
            if isinstance(step_control, master.FixedStep):
                step_control = step_control._replace(steps_done=restored_point.k)
        return cls(scene, graph, components, scheme, step_control, restored_point)

    def observers(self, recorder: Recorder, reached: ReachedPoint) -> list[master.Observer]:
        """Return the observers for log and checkpoints; they start at the checkpoint of the run, if any."""
        scene, scheme, step_control, restored_point = self.scene, self.scheme, self.step_control, self.restored_point
        every = max(1, round(STATS_PERIOD / step_control.step))
        logging = Logging(recorder, list(self.components.values()), every, scene.records_statistics)
        scheme.row_writer = logging.row_writer
        if restored_point is not None:
            logging.continue_after(*restored_point)
            reached(*restored_point)
        observers: list[master.Observer] = [logging]
        if scene.resumable and scene.run.inputs and (period := scene.run.checkpoints) and checkpoint.can_save(scheme):
            stride = (
                scene.links_every if scene.records_statistics else 1
            )  # statistics between two records are not in a checkpoint
            if isinstance(step_control, master.FixedStep):
                steps = stride * ceil(max(1, round(min(period / step_control.step, MAX_STEPS))) / stride)
                observers.append(Checkpoints(recorder, scheme, steps))
            else:
                observers.append(
                    TimedCheckpoints(
                        recorder, scheme, step_control, period, stride, restored_point.t if restored_point else 0.0
                    )
                )
        return observers

    def step_to_end(
        self, observers: list[master.Observer], interrupt: Interrupt, result: dict[str, Any]
    ) -> master.RunOutcome:
        """Step to the end and add outcome and cost to the result, the time also after an exception."""
        wall_start, cpu_start = time.perf_counter(), time.process_time()
        try:
            outcome = master.run(
                self.scheme,
                self.step_control,
                observers,
                lambda: interrupt.requested,
                self.restored_point and self.restored_point[:2],
            )
        finally:
            result["wall_time"] = time.perf_counter() - wall_start
        result |= outcome_entries(outcome, result["wall_time"], self.restored_point.t if self.restored_point else 0.0)
        control = self.step_control
        result |= {
            "cpu_time": time.process_time() - cpu_start,
            "rejected_steps": 0 if isinstance(control, master.FixedStep) else control.rejected_steps,
            "components": {name: cost(component) for name, component in self.components.items()},
        }
        return outcome

    def warnings(self) -> list[dict[str, Any]]:
        """Warnings of all components in order of time, then about the steps of the run."""
        return [*component_warnings(self.components), *self.forced_steps()]

    def forced_steps(self) -> list[dict[str, Any]]:
        """Warning of variable steps that were kept with too large an error, if there are any."""
        variable = self.scene.run.variable
        if variable is None or isinstance(self.step_control, master.FixedStep) or not self.step_control.forced_steps:
            return []
        count = self.step_control.forced_steps
        text = f"{count} steps of run.variable.shortest = {variable.shortest:g} s have too large an error"
        return [{"component": "run", "text": text, "time": 0.0, "count": 1}]


def component_warnings(components: Mapping[str, Recordable]) -> list[dict[str, Any]]:
    """Return the warnings of all components in order of time."""
    entries = [warning for component in components.values() for warning in component.warnings]
    return [asdict(warning) for warning in sorted(entries, key=lambda warning: warning.time)]


def step_control_of(run: RunTable) -> master.FixedStep | VariableStep | PowerResidual:
    """Return the step length control of a run, fixed or variable."""
    variable = run.variable
    if variable is None:
        return master.FixedStep(run.step, run.steps)
    limits = run.stop, run.step, variable.tolerance, variable.shortest, variable.longest
    if variable.estimate == "power":
        return PowerResidual(*limits, REFERENCE_ENERGY if variable.energy is None else variable.energy)
    return VariableStep(*limits)


def warm_up(stages: Stages, h: float) -> None:
    """Do one step and restore the state bit by bit, so that compiling and loading count as start-up."""
    kernels()
    for member in (member for stage in stages for member in stage):
        component = member.component
        if not isinstance(component, Component) or not component.warms_up:
            continue
        copy_inputs(member)
        state = component.save()
        with suppress(ComponentFailed):  # a step that fails here fails again in the run and is reported there
            component.write()
            component.step(0.0, h)
        component.restore(state)
        component.free(state)
        component.wall_time = 0.0


def outcome_entries(outcome: master.RunOutcome, wall: float, start_time: float = 0.0) -> dict[str, Any]:
    """Return the entries of a summary on status, time and steps; ``wall``: s of stepping from ``start_time``, s."""
    return {
        "status": outcome.status,
        "message": outcome.message,
        "simulated_time": outcome.time,
        "wall_time": wall,
        "real_time_factor": (outcome.time - start_time) / wall if wall else 0.0,
        "communication_steps": outcome.steps,
    }


def cost(component: Recordable) -> dict[str, float | int]:
    """Return wall time, s, and counters of a component, the last ones known if it has ended."""
    with suppress(ComponentFailed):
        component.read_counters()
    counters = {
        name.removeprefix("solver."): int(value)
        for name, value in zip(component.integers, component.counters, strict=True)
        if name != "status"
    }
    blank = dict.fromkeys(("steps", "evaluations", "iterations", "rejected"), 0)
    return {"wall_time": component.wall_time, **blank, **counters}
