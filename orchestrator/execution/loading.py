"""Loading of a scene's components: place it, build its FMUs, compile what is missing, initialise the instances."""

from __future__ import annotations

import math
import subprocess
from collections.abc import Collection, Iterable, Mapping, Sequence
from contextlib import ExitStack

from fmus.ahead import start_compilation
from fmus.track_choices import TRACKS
from orchestrator.cosim.component import Component, Logger
from orchestrator.cosim.coupling import power_residual
from orchestrator.cosim.graph import Connection, System
from orchestrator.scene.assembly import assemble, system
from orchestrator.scene.placing import placed
from orchestrator.scene.scene import Scene
from orchestrator.scene.system_scene import SystemScene

LOW_PRIORITY = 10  # niceness of compiling processes other than the longest one


def load_scene(
    scene: SystemScene, stack: ExitStack, logger: Logger | None, native: bool = False
) -> tuple[SystemScene, System, dict[str, Component]]:
    """Place a scene, build its graph, load its components; raises BadInput, BuildFailed, ComponentFailed."""
    processes = _compile_in_processes(scene) if isinstance(scene, Scene) else []
    try:
        scene = placed(scene) if isinstance(scene, Scene) else scene
        assembly = assemble(scene)
        graph, given = system(assembly, native), [part.name for part in assembly.parts if part.fmu is not None]
        for process in processes:
            process.wait()
    except BaseException:  # bad input, or a signal, which the processes need not have received
        for process in processes:
            process.terminate()
        for process in processes:
            process.wait()
        raise
    return scene, graph, load_components(graph, scene.run.stop, stack, logger, given)


def _compile_in_processes(scene: Scene) -> list[subprocess.Popen[str]]:
    """Start processes that compile kernels while the search for the idler position compiles the start of cables."""
    if scene.placed:
        return []
    parts = reversed(assemble(scene).parts)  # the first part of each kind; its start does not depend on inputs
    kinds = {part.kind: (part.kind, part.config, part.parameters) for part in parts if part.fmu is None}
    rigid, cables = (kinds.pop(TRACKS[name].fmu, None) for name in ("rigid", "flexible"))
    tracks, others = [rigid] if rigid else [], [*kinds.values()]
    # A step of cables last, when the start has compiled what they share; alone, both would compile it at once.
    others += [cables] if cables and others else []
    # Rigid links take longest: on two cores the others get their share when the search is done.
    processes = [start_compilation(tracks), start_compilation(others, LOW_PRIORITY if tracks else 0)]
    return [process for process in processes if process is not None]


def load_components(
    graph: System, stop: float, stack: ExitStack, logger: Logger | None = None, given: Collection[str] = ()
) -> dict[str, Component]:
    """Load and initialise every instance; they are unloaded with the stack.

    Our FMUs start by their parameters. The instances ``given`` by the user are initialised after them, with inputs from
    the outputs of those that are initialised: the last stage first, because earlier ones step with its motion.
    """
    discrete = discrete_variables(graph.connections)
    components = {
        instance.name: stack.enter_context(
            Component(
                instance.fmu,
                instance.name,
                logger,
                discrete=discrete.get(instance.name, ()),
                conversions=instance.conversions,
                units=instance.units,
            )
        )
        for instance in graph.instances
        if instance.fmu is not None
    }
    for connection in graph.connections:
        if connection.carries == "discrete":
            components[connection.target].input_texts |= dict.fromkeys(
                connection.inputs, components[connection.source].texts
            )
    initialised: dict[str, Component] = {}
    for instance in sorted(graph.instances, key=lambda one: -one.stage if one.name in given else -math.inf):
        component = components[instance.name]
        if instance.name in given:
            component.start_with(_start_inputs(instance.name, graph.connections, initialised))
        component.initialise(instance.parameters, 0.0, stop)
        initialised[instance.name] = component
    power_residual.check_bonds(graph.connections, lambda instance, name: components[instance].dimension(name))
    return components


def discrete_variables(connections: Iterable[Connection]) -> dict[str, set[str]]:
    """Connected variables that are no Reals, by the names of their instances."""
    found: dict[str, set[str]] = {}
    for connection in connections:
        if connection.carries == "discrete":
            found.setdefault(connection.source, set()).update(connection.outputs)
            found.setdefault(connection.target, set()).update(connection.inputs)
    return found


def _start_inputs(name: str, connections: Sequence[Connection], sources: Mapping[str, Component]) -> dict[str, float]:
    """Inputs of a component from initialised sources."""
    return {
        into: float(source.y[source.outputs.index(output)])
        for connection in connections
        if connection.target == name and (source := sources.get(connection.source))
        for output, into in zip(connection.outputs, connection.inputs, strict=True)
    }
