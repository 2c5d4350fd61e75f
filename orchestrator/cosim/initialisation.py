"""Components of a system, loaded and initialised.

FMUs of the user are initialised when those that feed them are, so their order does not matter. FMUs that feed each
other in a loop are brought into initialisation mode together. There their inputs are set from their outputs, round
after round, until these stand still (FMI 2.0.4, section 4.2.4: algebraic loops). An FMU whose outputs do not depend on
its inputs ends this in two rounds, so the dependencies that it declares need not be known.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import ExitStack
from functools import partial
from graphlib import TopologicalSorter

import numpy as np
import scipy  # loads its parts when they are used

from orchestrator.cosim.component import Component
from orchestrator.cosim.coupling import power_residual
from orchestrator.cosim.graph import Connection, Instance, System
from orchestrator.cosim.processes.supervisor import ProcessPool, ProcessRequest, SlaveProcess
from orchestrator.fmi.model_description import loadable
from orchestrator.fmi.slave import ComponentFailed


def load_components(
    graph: System,
    times: tuple[float, float],
    stack: ExitStack,
    pool: ProcessPool | None = None,
) -> dict[str, Component]:
    """Load and initialise every instance; they are unloaded with the stack. ``times``: start and stop of FMUs, s.

    Our FMUs start by their parameters, those of the user then in the order of flow.
    """
    discrete = discrete_variables(graph.connections)
    placed_in = open_processes(graph.instances, stack.enter_context(pool or ProcessPool()))
    components = {
        instance.name: stack.enter_context(
            Component(
                instance.fmu,
                instance.name,
                discrete=discrete.get(instance.name, ()),
                conversions=instance.conversions,
                units=instance.units,
                imported=instance.imported,
                process=placed_in.get(instance.name),
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
    own = [instance for instance in graph.instances if instance.imported is None]
    start, stop = times
    for instance in own:  # whose times are those of the scene
        components[instance.name].initialise(instance.parameters, 0.0, stop - start)
    initialised = {instance.name: components[instance.name] for instance in own}
    foreign = [instance for instance in graph.instances if instance.imported is not None]
    initialise(foreign, graph.connections, components, initialised, times)
    power_residual.check_bonds(graph.connections, lambda instance, name: components[instance].variables.dimension(name))
    return components


def open_processes(instances: Iterable[Instance], pool: ProcessPool) -> dict[str, SlaveProcess]:
    """Processes of FMUs of the user, by their names; raises ComponentFailed."""
    wanted, inside = [], set()
    for instance in instances:
        if instance.imported is None or instance.fmu is None:
            continue
        alone = loadable(instance.fmu).description.coSimulation.canBeInstantiatedOnlyOncePerProcess
        if not instance.imported.in_process:
            wanted.append(ProcessRequest(instance.name, instance.fmu, alone, instance.imported.limit))
        elif alone and instance.fmu in inside:
            once = f"'{instance.fmu}' can be instantiated once per process"
            raise ComponentFailed(f"{instance.name}: {once}: leave out in_process = true of this instance")
        else:
            inside.add(instance.fmu)
    return pool.open(wanted)


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
