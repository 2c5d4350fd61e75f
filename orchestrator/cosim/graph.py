"""The system as the master sees it: instances of FMUs, connections by variable name, an order of stages."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Literal, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from orchestrator.cosim.warned import Warned

Floats = NDArray[np.float64]
Indices = NDArray[np.intp]
# What a connection carries decides what a receiver that holds it over a step should be given:
# "value"  of the communication point; "mean" over the step just done; "state" of the communication point, which the
# receiver moves on itself with the "rate" that comes beside it.
Kind = Literal["value", "mean", "state", "rate"]


class Instance(NamedTuple):
    """One FMU with a name of its own."""

    name: str
    fmu: Path | None  # None: stepped in this process, without an FMU
    parameters: Mapping[str, float | int | str]
    stage: int  # instances of a lower stage step first; those of one stage step at once


class Connection(NamedTuple):
    """Outputs of one instance that are inputs of another, variable by variable."""

    source: str
    outputs: tuple[str, ...]
    target: str
    inputs: tuple[str, ...]
    carries: Kind = "value"
    rates: tuple[str, ...] = ()  # of values: the outputs that are their time derivatives, where the source has them
    bond: str = ""  # shared by two connections, there and back: value times value, in their order, is a power, W


class System(NamedTuple):
    """A graph of instances, independent of what they contain."""

    instances: tuple[Instance, ...]
    connections: tuple[Connection, ...]


class Steppable(Protocol):
    """What the master needs of a loaded component (``component.Component`` is one).

    Only couplings and step controls that go back in time save and restore.
    """

    name: str
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    u: Floats
    y: Floats

    def write(self) -> None:
        """Hand ``u`` to the component."""

    def step(self, t: float, h: float) -> None:
        """Advance from t to t + h; raises ComponentFailed."""

    def read(self) -> None:
        """Fetch ``y`` from the component."""

    def save(self) -> Any:
        """Its state with its arrays; raises ComponentFailed where it cannot."""

    def restore(self, state: Any) -> None:
        """Back to a saved state, which stays good."""

    def free(self, state: Any) -> None:
        """Forget a saved state."""


class Recorded(Steppable, Protocol):
    """What log and summary need of it besides."""

    links: tuple[str, ...]  # outputs of every link or point
    integers: tuple[str, ...]
    y_links: Floats
    counters: NDArray[np.int32]
    wall_time: float  # s inside the component

    @property
    def warnings(self) -> Sequence[Warned]:
        """What it has warned of so far."""

    def unit(self, name: str) -> str:
        """Of a variable, '1' if it has none."""

    def read_links(self) -> None:
        """Fetch ``y_links``."""

    def read_counters(self) -> None:
        """Fetch ``counters``."""


class Feed(NamedTuple):
    """``u[inputs] = source.y[outputs]``."""

    source: Steppable
    outputs: Indices
    inputs: Indices
    carries: Kind = "value"
    rates: Indices | None = None  # where the source shows d/dt of the outputs
    bond: str = ""


class Member(NamedTuple):
    """A component with what feeds it."""

    component: Steppable
    feeds: tuple[Feed, ...]


Stages = tuple[tuple[Member, ...], ...]


class Miswired(ValueError):
    """A connection names an instance or a variable that does not exist."""


def _indices(names: tuple[str, ...], wanted: tuple[str, ...], instance: str, what: str) -> Indices:
    place = {name: index for index, name in enumerate(names)}
    for name in wanted:
        if name not in place:
            raise Miswired(f"{instance} has no {what} '{name}'")
    return np.array([place[name] for name in wanted], dtype=np.intp)


def wire(system: System, components: Mapping[str, Steppable]) -> Stages:
    """The members of every stage, connections resolved to index arrays; raises Miswired."""
    feeds: dict[str, list[Feed]] = {instance.name: [] for instance in system.instances}
    for connection in system.connections:
        for end in (connection.source, connection.target):
            if end not in components:
                raise Miswired(f"no component '{end}'")
        source, target = components[connection.source], components[connection.target]
        outputs = _indices(source.outputs, connection.outputs, connection.source, "output")
        inputs = _indices(target.inputs, connection.inputs, connection.target, "input")
        rates = _indices(source.outputs, connection.rates, connection.source, "output")
        known = rates if connection.rates else None
        feeds[connection.target].append(Feed(source, outputs, inputs, connection.carries, known, connection.bond))
    return tuple(
        tuple(
            Member(components[instance.name], tuple(feeds[instance.name]))
            for instance in system.instances
            if instance.stage == stage
        )
        for stage in sorted({instance.stage for instance in system.instances})
    )
