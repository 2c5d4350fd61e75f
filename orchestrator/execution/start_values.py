"""Start values of FMUs of the user: each is initialised when those that feed it are, so their order does not matter.

FMUs that feed each other in a loop are brought into initialisation mode together. There their inputs are set from their
outputs, round after round, until these stand still (FMI 2.0.4, section 4.2.4: algebraic loops). An FMU whose outputs
do not depend on its inputs ends this in two rounds, so the dependencies that it declares need not be known.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from graphlib import TopologicalSorter

import numpy as np
import scipy  # loads its parts when they are used

from orchestrator.cosim.component import Component, ComponentFailed
from orchestrator.cosim.graph import Connection, Instance

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
