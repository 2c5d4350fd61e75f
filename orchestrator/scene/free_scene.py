"""Free system: FMUs of the user and their connections, without a vehicle."""

from __future__ import annotations

from itertools import groupby
from typing import Annotated, Literal, NamedTuple

from pydantic import Field, model_validator

from orchestrator.cosim.graph import Connection
from orchestrator.scene.fmu_table import FmuTable
from orchestrator.scene.gallery import hint
from orchestrator.scene.system_scene import SystemScene

ARROW = "->"


class Pair(NamedTuple):
    """Connection of one output to one input."""

    source: str
    output: str
    target: str
    into: str

    def __str__(self) -> str:
        return f"{self.source}.{self.output} {ARROW} {self.target}.{self.into}"


class FreeFmuTable(FmuTable):
    """FMU of the system."""

    stage: Annotated[int, Field(ge=0, le=1000)] = 0
    """lower stages step first; FMUs of one stage step at once, with inputs that are extrapolated"""


class FreeScene(SystemScene):
    """FMUs of the user and their connections."""

    assembly: Literal["fmus"]
    fmu: Annotated[dict[str, FreeFmuTable], Field(min_length=1)]
    """FMUs by the names of their instances"""
    connections: tuple[str, ...] = ()
    """connections, "instance.output -> instance.input"; each input at most once"""

    @model_validator(mode="after")
    def _check_connections(self) -> FreeScene:
        for name in self.fmu:
            if not name or set(name) & set("./\\") or not name.isprintable():
                raise ValueError(f"fmu.'{name}': the name of an instance must have no dot and no slash")
        targets: set[tuple[str, str]] = set()
        for pair in self.pairs():
            for name in (pair.source, pair.target):
                if name not in self.fmu:
                    raise ValueError(f"connections: '{pair}': no FMU '{name}': {hint(name, self.fmu, 'there are')}")
            if (pair.target, pair.into) in targets:
                raise ValueError(f"connections: '{pair}': the input has another connection")
            targets.add((pair.target, pair.into))
        return self

    def pairs(self) -> list[Pair]:
        """Connections one by one; raises ValueError."""
        return [_pair(text) for text in self.connections]

    def wiring(self) -> tuple[Connection, ...]:
        """Connections of each pair of instances as one."""
        by_ends = groupby(sorted(self.pairs(), key=lambda pair: (pair.source, pair.target)), lambda pair: pair[::2])
        return tuple(
            Connection(source, tuple(pair.output for pair in one), target, tuple(pair.into for pair in one))
            for (source, target), group in by_ends
            for one in [list(group)]
        )


def _pair(text: str) -> Pair:
    ends = [end.strip().partition(".") for end in text.split(ARROW)]
    if len(ends) != 2 or not all(name and variable for name, _, variable in ends):
        raise ValueError(f"connections: '{text}': must be 'instance.output {ARROW} instance.input'")
    (source, _, output), (target, _, into) = ends
    return Pair(source, output, target, into)
