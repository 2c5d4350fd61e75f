"""Loading of a scene's components: place it, build its FMUs, compile what is missing, initialise the instances."""

from __future__ import annotations

import subprocess
from collections.abc import Iterable
from contextlib import ExitStack

from fmus.ahead import start_compilation
from fmus.track_choices import TRACKS
from orchestrator.cosim.component import Component, ComponentFailed, Logger
from orchestrator.cosim.coupling import power_residual
from orchestrator.cosim.graph import Connection, Instance, System
from orchestrator.cosim.guests.room import Room, Rooms, Wanted
from orchestrator.cosim.model_description import loadable
from orchestrator.execution import start_values
from orchestrator.scene.assembly import assemble, system
from orchestrator.scene.kinds import Scene
from orchestrator.scene.placing import placed
from orchestrator.scene.system_scene import SystemScene

LOW_PRIORITY = 10  # niceness of compiling processes other than the longest one


def load_scene(
    scene: SystemScene,
    stack: ExitStack,
    logger: Logger | None,
    native: bool = False,
    rooms: Rooms | None = None,
) -> tuple[SystemScene, System, dict[str, Component]]:
    """Place a scene, build its graph, load its components; raises BadInput, BuildFailed, ComponentFailed.

    ``rooms``: where FMUs of the user get their processes; they are closed with the stack.
    """
    processes = _compile_in_processes(scene) if isinstance(scene, Scene) else []
    try:
        scene = placed(scene) if isinstance(scene, Scene) else scene
        assembly = assemble(scene)
        graph = system(assembly, native)
        for process in processes:
            process.wait()
    except BaseException:  # bad input, or a signal, which the processes need not have received
        for process in processes:
            process.terminate()
        for process in processes:
            process.wait()
        raise
    return scene, graph, load_components(graph, scene.run.times, stack, logger, rooms)


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
    graph: System,
    times: tuple[float, float],
    stack: ExitStack,
    logger: Logger | None = None,
    rooms: Rooms | None = None,
) -> dict[str, Component]:
    """Load and initialise every instance; they are unloaded with the stack. ``times``: start and stop of FMUs, s.

    Our FMUs start by their parameters, those of the user then in the order of flow.
    """
    discrete = discrete_variables(graph.connections)
    placed_in = open_rooms(graph.instances, stack.enter_context(rooms or Rooms()))
    components = {
        instance.name: stack.enter_context(
            Component(
                instance.fmu,
                instance.name,
                logger,
                discrete=discrete.get(instance.name, ()),
                conversions=instance.conversions,
                units=instance.units,
                guest=instance.guest,
                room=placed_in.get(instance.name),
                resources=instance.resources,
                starts=instance.starts,
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
    own = [instance for instance in graph.instances if instance.guest is None]
    start, stop = times
    for instance in own:  # whose times are those of the scene
        components[instance.name].initialise(instance.parameters, 0.0, stop - start)
    initialised = {instance.name: components[instance.name] for instance in own}
    guests = [instance for instance in graph.instances if instance.guest is not None]
    start_values.initialise(guests, graph.connections, components, initialised, times)
    power_residual.check_bonds(graph.connections, lambda instance, name: components[instance].dimension(name))
    return components


def open_rooms(instances: Iterable[Instance], rooms: Rooms) -> dict[str, Room]:
    """Rooms of FMUs of the user, by their names; raises ComponentFailed."""
    wanted, inside = [], set()
    for instance in instances:
        if instance.guest is None or instance.fmu is None:
            continue
        alone = loadable(instance.fmu).description.coSimulation.canBeInstantiatedOnlyOncePerProcess
        if not instance.guest.in_process:
            wanted.append(Wanted(instance.name, instance.fmu, alone, instance.guest.limit))
        elif alone and instance.fmu in inside:
            once = f"'{instance.fmu}' can be instantiated once per process"
            raise ComponentFailed(f"{instance.name}: {once}: leave out in_process = true of this instance")
        else:
            inside.add(instance.fmu)
    return rooms.open(wanted)


def discrete_variables(connections: Iterable[Connection]) -> dict[str, set[str]]:
    """Connected variables that are no Reals, by the names of their instances."""
    found: dict[str, set[str]] = {}
    for connection in connections:
        if connection.carries == "discrete":
            found.setdefault(connection.source, set()).update(connection.outputs)
            found.setdefault(connection.target, set()).update(connection.inputs)
    return found
