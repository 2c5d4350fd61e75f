"""System graph of the master: FMU instances, connections by variable name, stages."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import Any, Literal, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from orchestrator.cosim.base_units import Conversion
from orchestrator.cosim.messages import ComponentWarning
from orchestrator.log.time_series import Floats

Indices = NDArray[np.intp]
# Quantity that a connection carries, which decides the input hold: "value" at the communication point; "mean" over the
# last step; "state" at the communication point, which the receiver extrapolates with its "rate", sent beside it;
# "discrete": Integers, Enumerations, Booleans, Strings and demands of the communication point, which are held.
Quantity = Literal["value", "mean", "state", "rate", "discrete"]
NO_CONVERSIONS: Mapping[str, Any] = MappingProxyType({})


class ImportSettings(NamedTuple):
    """How an FMU of the user is loaded and watched."""

    in_process: bool = False  # in the process of the run, not in one of its own
    limit: float = math.inf  # s, longest call of a process of its own
    non_finite: Literal["fail", "warn"] = "fail"  # outputs that are not finite


class Instance(NamedTuple):
    """Named instance of an FMU."""

    name: str
    fmu: Path | None  # None: a component of this process, without an FMU
    parameters: Mapping[str, float | int | str]
    stage: int  # lower stages step first; instances of one stage step at once
    # By Real: of an input from what its source outputs to what the FMU gets, of an output to what others get.
    conversions: Mapping[str, Conversion] = NO_CONVERSIONS
    units: Mapping[str, str] = NO_CONVERSIONS  # of outputs with a conversion
    imported: ImportSettings | None = None  # None: a component of ours
    resources: Path | None = None  # folder with the numbers of the instance; None: those of the FMU
    starts: Sequence[float] = ()  # start values of its Reals, inputs first; empty: those of the FMU


class Connection(NamedTuple):
    """Connection of outputs of one instance to inputs of another, variable by variable."""

    source: str
    outputs: tuple[str, ...]
    target: str
    inputs: tuple[str, ...]
    carries: Quantity = "value"
    rates: tuple[str, ...] = ()  # of values: outputs that are their time derivatives, if the source has them
    bond: str = ""  # name shared by two opposite connections whose products, in order, are a power, W
    transformations: tuple[tuple[str, Conversion], ...] = ()  # of inputs, after the conversions of their units


class System(NamedTuple):
    """Graph of instances, independent of their contents."""

    instances: tuple[Instance, ...]
    connections: tuple[Connection, ...]


class Steppable(Protocol):
    """Interface of a component for the master (``component.Component`` implements it).

    Only couplings and step controls that repeat steps save and restore.
    """

    name: str
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    u: Floats
    y: Floats

    def write(self) -> None:
        """Set the component's inputs from ``u``."""

    def step(self, t: float, h: float) -> None:
        """Advance from t to t + h; raises ComponentFailed."""

    def read(self) -> None:
        """Read the component's outputs into ``y``."""

    def save(self) -> Any:
        """Save the state and the arrays; raises ComponentFailed if it cannot."""

    def restore(self, state: Any) -> None:
        """Restore a saved state, which stays valid."""

    def free(self, state: Any) -> None:
        """Release a saved state."""


class Recordable(Steppable, Protocol):
    """Further interface of a component for log and summary."""

    links: tuple[str, ...]  # outputs of every link or point
    integers: tuple[str, ...]
    y_links: Floats
    counters: NDArray[np.int32]
    wall_time: float  # s inside the component

    @property
    def warnings(self) -> Sequence[ComponentWarning]:
        """Warnings so far."""

    def unit(self, name: str) -> str:
        """Unit of a variable, '1' if it has none."""

    def read_links(self) -> None:
        """Read per-link outputs into ``y_links``."""

    def read_counters(self) -> None:
        """Read the Integer, Enumeration and Boolean outputs into ``counters``."""


class Feed(NamedTuple):
    """Transfer ``received[inputs] = source.y[outputs]``."""

    source: Steppable
    outputs: Indices
    inputs: Indices
    carries: Quantity = "value"
    rates: Indices | None = None  # where the source has d/dt of the outputs
    bond: str = ""

    @property
    def held(self) -> bool:
        """True for values of the communication point, which are neither extrapolated nor interpolated."""
        return self.carries in ("state", "discrete")


class Member(NamedTuple):
    """Component with the feeds of its inputs."""

    component: Steppable
    feeds: tuple[Feed, ...]
    received: Floats  # inputs as their sources output them: ``component.u`` unless some are converted
    converted: frozenset[str] = frozenset()  # names of these


Stages = tuple[tuple[Member, ...], ...]


class Miswired(ValueError):
    """A connection names an unknown instance or variable."""


def _indices(names: tuple[str, ...], wanted: tuple[str, ...], instance: str, what: str) -> Indices:
    place = {name: index for index, name in enumerate(names)}
    for name in wanted:
        if name not in place:
            raise Miswired(f"{instance} has no {what} '{name}'")
    return np.array([place[name] for name in wanted], dtype=np.intp)


def connect(system: System, components: Mapping[str, Steppable]) -> Stages:
    """Return the members of every stage, with connections as index arrays; raises Miswired."""
    feeds: dict[str, list[Feed]] = {instance.name: [] for instance in system.instances}
    for connection in system.connections:
        for end in (connection.source, connection.target):
            if end not in components:
                raise Miswired(f"no component '{end}'")
        source, target = components[connection.source], components[connection.target]
        outputs = _indices(source.outputs, connection.outputs, connection.source, "output")
        inputs = _indices(target.inputs, connection.inputs, connection.target, "input")
        rates = _indices(source.outputs, connection.rates, connection.source, "output")
        rate_indices = rates if connection.rates else None
        feeds[connection.target].append(
            Feed(source, outputs, inputs, connection.carries, rate_indices, connection.bond)
        )
    return tuple(
        tuple(
            _member(instance, components[instance.name], tuple(feeds[instance.name]))
            for instance in system.instances
            if instance.stage == stage
        )
        for stage in sorted({instance.stage for instance in system.instances})
    )


def _member(instance: Instance, component: Steppable, feeds: tuple[Feed, ...]) -> Member:
    converted = frozenset(component.inputs) & instance.conversions.keys()
    return Member(component, feeds, getattr(component, "received", component.u), converted)
