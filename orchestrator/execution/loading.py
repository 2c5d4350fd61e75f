"""Loading of a scene's components: check its signals, place it, build its FMUs, compile what is missing, initialise.

Signals that the checks of a scene name are compared with those of its components before anything is built.

FMUs of the user are initialised when those that feed them are, so their order does not matter. FMUs that feed each
other in a loop are brought into initialisation mode together. There their inputs are set from their outputs, round
after round, until these stand still (FMI 2.0.4, section 4.2.4: algebraic loops). An FMU whose outputs do not depend on
its inputs ends this in two rounds, so the dependencies that it declares need not be known.
"""

from __future__ import annotations

import subprocess
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import ExitStack
from functools import partial
from graphlib import TopologicalSorter

import numpy as np
import scipy  # loads its parts when they are used

from fmus.ahead import component_ports, start_compilation
from fmus.track.choices import TRACKS
from fmus.vehicles.tables import BadInput, value_text
from orchestrator.cosim.component import Component
from orchestrator.cosim.coupling import power_residual
from orchestrator.cosim.graph import Connection, Instance, System
from orchestrator.cosim.guests.supervisor import Room, RoomRequest, Rooms
from orchestrator.cosim.messages import Logger
from orchestrator.cosim.observers import statistics_names
from orchestrator.cosim.variables import LINK_FAMILIES
from orchestrator.fmi.model_description import loadable
from orchestrator.fmi.slave import ComponentFailed
from orchestrator.log.signal_names import did_you_mean, worded
from orchestrator.results.measures import FIGURES
from orchestrator.scene.assembly import assemble, system
from orchestrator.scene.kinds import Scene, VehicleScene
from orchestrator.scene.parts import Assembly, Part
from orchestrator.scene.placing import placed
from orchestrator.scene.settings import hint
from orchestrator.scene.system_scene import SystemScene

STATISTICS = "stats."  # signals of the cost of a component


def require_signals(scene: SystemScene, assembled: Sequence[Part]) -> None:
    """Raise BadInput if a check of a scene, of its track model, names a signal that a log of its parts lacks."""
    signals = {name: check.signal for name, check in scene.checks.items() if check.signal is not None}
    parts = {part.name: part for part in assembled}
    for name, signal in signals.items():
        instance = signal.partition(".")[0]
        if signal.startswith(STATISTICS):
            continue
        if instance in parts and parts[instance].fmu is not None:  # a check of what it lacks is not met
            continue
        searched = [parts[instance]] if instance in parts else parts.values()
        known = {one: text for part in searched for one, text in _recorded(scene, part).items()}
        if signal in known:
            continue
        where = f"{scene.where}: expect.{name}.signal = {value_text(signal)}"
        problem = "no such signal" if instance in parts else f"no component '{instance}'"
        if found := worded(signal, known, known):
            near = did_you_mean(found)
        else:
            near = hint(signal, known, "there are") if instance in parts else hint(instance, parts, "there are")
        measure = signal.rpartition(".")[2]
        raise BadInput(f"{where}: {problem}: {near}{f' Or measure = {measure!r}?' * (measure in FIGURES)}")


def _recorded(scene: SystemScene, part: Part) -> dict[str, str]:
    """Signals of a component that a log has, and their descriptions."""
    if not part.kind:  # an FMU of a free system
        return {}
    causalities = ("input", "output") if scene.run.inputs else ("output",)
    ports = component_ports(part.kind, part.config)
    texts = {port.name: port.text for port in ports if port.causality in causalities and isinstance(port.start, float)}
    if scene.records_statistics:
        links = tuple(name for name in texts if name.startswith(LINK_FAMILIES))
        texts |= dict.fromkeys(statistics_names(links), "")
    return {f"{part.name}.{name}": text for name, text in texts.items()}


OTHER_KERNELS = "cables have turning axes, whose kernels are others and compile for minutes the first time"
LOW_PRIORITY = 10  # niceness of compiling processes other than the longest one


def load_scene(
    scene: SystemScene,
    assembly: Assembly,
    stack: ExitStack,
    logger: Logger | None,
    native: bool = False,
    rooms: Rooms | None = None,
    announce: Callable[[str], object] = lambda line: None,
    detail: Callable[[str], object] = lambda line: None,
) -> tuple[SystemScene, System, dict[str, Component]]:
    """Place an assembled scene, build its graph, load its components; raises BadInput, BuildFailed, ComponentFailed.

    ``rooms``: where FMUs of the user get their processes; they are closed with the stack. ``announce`` gets a line for
    what takes long or is a risk, ``detail`` what is being done of the start.
    """
    if given := [part.name for part in assembly.parts if part.fmu is not None]:
        announce(f"{scene.name}: FMUs of yours run as {', '.join(given)}: an FMU runs code with your rights")
    if isinstance(scene, VehicleScene) and scene.track.axes == "free" and scene.leaves_plane:
        announce(f"{scene.name}: {scene.leaves_plane}: {OTHER_KERNELS}")
    announce(f"{scene.name}: components are built and initialised")
    processes: list[subprocess.Popen[str]] = []
    try:
        if isinstance(scene, Scene) and not scene.placed:
            processes = _compile_in_processes(assembly.parts)
            detail("the places of idlers and hull are solved from static equilibrium")
            scene = placed(scene)
            assembly = assemble(scene)
        detail(f"FMUs are built or found: {len(assembly.parts)}")
        graph = system(assembly, native)
        detail("kernels are compiled in processes of their own")
        for process in processes:
            process.wait()
    except BaseException:  # bad input, or a signal, which the processes need not have received
        for process in processes:
            process.terminate()
        for process in processes:
            process.wait()
        raise
    detail("components are initialised")
    return scene, graph, load_components(graph, scene.run.times, stack, logger, rooms)


def _compile_in_processes(parts: Sequence[Part]) -> list[subprocess.Popen[str]]:
    """Start processes that compile kernels while the search for the idler position compiles the start of cables."""
    # The first part of each kind; its start does not depend on inputs.
    kinds = {part.kind: (part.kind, part.config, part.parameters) for part in reversed(parts) if part.fmu is None}
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
            target, source = components[connection.target], components[connection.source]
            target.variables.input_texts |= dict.fromkeys(connection.inputs, source.variables.texts)
            pairs = zip(connection.inputs, connection.outputs, strict=True)
            target.variables.links_in |= {
                into: f"{source.name}.{output} -> {target.name}.{into}" for into, output in pairs
            }
    own = [instance for instance in graph.instances if instance.guest is None]
    start, stop = times
    for instance in own:  # whose times are those of the scene
        components[instance.name].initialise(instance.parameters, 0.0, stop - start)
    initialised = {instance.name: components[instance.name] for instance in own}
    guests = [instance for instance in graph.instances if instance.guest is not None]
    initialise(guests, graph.connections, components, initialised, times)
    power_residual.check_bonds(graph.connections, lambda instance, name: components[instance].variables.dimension(name))
    return components


def open_rooms(instances: Iterable[Instance], rooms: Rooms) -> dict[str, Room]:
    """Rooms of FMUs of the user, by their names; raises ComponentFailed."""
    wanted, inside = [], set()
    for instance in instances:
        if instance.guest is None or instance.fmu is None:
            continue
        alone = loadable(instance.fmu).description.coSimulation.canBeInstantiatedOnlyOncePerProcess
        if not instance.guest.in_process:
            wanted.append(RoomRequest(instance.name, instance.fmu, alone, instance.guest.limit))
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


ROUNDS = 1000  # of a loop
STILL = 1e-12  # largest change of an output over its largest value so far, at the end of a loop


def initialise(
    instances: Sequence[Instance],
    connections: Sequence[Connection],
    components: Mapping[str, Component],
    earlier: Mapping[str, Component],
    times: tuple[float, float],
) -> None:
    """Initialise the components of instances; ``earlier`` are those that are initialised already.

    ``times``: start and stop, s. Raises ComponentFailed, also for a loop whose start values do not settle.
    """
    if not instances:
        return
    done = dict(earlier)
    by_name = {instance.name: instance for instance in instances}
    fed = [one for one in connections if one.target in by_name]
    for group in _in_order_of_flow([*by_name], fed):
        members = sorted((by_name[name] for name in group), key=lambda one: (-one.stage, one.name))

        def receive(name: str, sources: Mapping[str, Component]) -> None:
            components[name].start_with(_inputs(name, fed, sources))

        loop = {name: components[name] for name in group}
        feeds_itself = len(members) > 1 or any(one.source == one.target == group[0] for one in fed)
        if feeds_itself:
            for instance in members:
                receive(instance.name, done)
                loop[instance.name].enter(instance.parameters, *times)
            _settle([one.name for one in members], loop, partial(receive, sources=done | loop))
        for instance in members:
            if feeds_itself:
                receive(instance.name, done | loop)
                loop[instance.name].leave_initialisation()
            else:
                receive(instance.name, done)
                loop[instance.name].initialise(instance.parameters, *times)
        done |= loop


def _in_order_of_flow(names: Sequence[str], connections: Sequence[Connection]) -> list[list[str]]:
    """Groups of names, each in order; those of one group feed each other, and earlier groups feed later ones."""
    names = sorted(names)
    place = {name: k for k, name in enumerate(names)}
    edges = {(place[one.source], place[one.target]) for one in connections if one.source in place}
    rows, columns = zip(*edges, strict=True) if edges else ((), ())
    matrix = scipy.sparse.coo_matrix((np.ones(len(edges)), (rows, columns)), shape=(len(names), len(names)))
    labels = scipy.sparse.csgraph.connected_components(matrix, connection="strong")[1].tolist()
    groups: dict[int, list[str]] = {}
    for name in names:
        groups.setdefault(labels[place[name]], []).append(name)
    sorter: TopologicalSorter[int] = TopologicalSorter({label: set() for label in groups})
    for source, target in sorted(edges):
        if labels[source] != labels[target]:
            sorter.add(labels[target], labels[source])
    return [groups[label] for label in sorter.static_order()]


def _inputs(name: str, connections: Sequence[Connection], sources: Mapping[str, Component]) -> dict[str, float]:
    """Inputs of a component from its sources, as far as these are known."""
    return {
        into: float(source.y[source.outputs.index(output)])
        for connection in connections
        if connection.target == name and (source := sources.get(connection.source))
        for output, into in zip(connection.outputs, connection.inputs, strict=True)
    }


def _settle(names: Sequence[str], loop: Mapping[str, Component], receive: Callable[[str], None]) -> None:
    """Exchange values in initialisation mode until all outputs stand still."""
    for name in names:
        loop[name].set_inputs()
        loop[name].read()
    largest = {name: abs(loop[name].y) for name in names}
    for _ in range(ROUNDS):
        moved = ""
        for name in names:
            component, before = loop[name], loop[name].y.copy()
            receive(name)
            component.set_inputs()
            component.read()
            largest[name] = np.maximum(largest[name], abs(component.y))
            if (found := np.flatnonzero(abs(component.y - before) > STILL * largest[name])).size:
                k = int(found[0])
                moved = f"'{name}.{component.outputs[k]}' was {before[k]:.6g} and then {component.y[k]:.6g}"
        if not moved:
            return
    raise ComponentFailed(
        f"the start values of {', '.join(names)}, which feed each other, do not settle: in round {ROUNDS} {moved}"
    )
