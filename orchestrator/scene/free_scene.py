"""Free system: FMUs of the user and their connections, without a vehicle."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from itertools import groupby
from typing import Annotated, Literal, NamedTuple

from pydantic import Field, model_validator

from orchestrator.cosim.base_units import UNCHANGED, Conversion
from orchestrator.cosim.graph import Connection
from orchestrator.scene.fmu_table import FmuTable
from orchestrator.scene.gallery import hint
from orchestrator.scene.system_scene import SystemScene

ARROW = "->"
NUMBER = r"(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
SCALED = re.compile(rf"(?:([-+]?{NUMBER})\s*\*\s*)?(.*?)(?:\s+([-+])\s+({NUMBER}))?")  # factor, output, sign, offset


class Pair(NamedTuple):
    """Connection of one output to one input."""

    source: str
    output: str
    target: str
    into: str
    transformation: Conversion = UNCHANGED  # after the conversion of units

    def __str__(self) -> str:
        factor, offset = self.transformation
        start = f"{factor!r} * " if factor != 1.0 else ""
        end = f" {'-' if offset < 0.0 else '+'} {abs(offset)!r}" if offset else ""
        return f"{start}{self.source}.{self.output}{end} {ARROW} {self.target}.{self.into}"


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
    """connections, "instance.output -> instance.input" or "2 * instance.output + 1 -> ..."; each input at most once"""

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
        return joined(self.pairs())


def joined(pairs: Sequence[Pair]) -> tuple[Connection, ...]:
    """Return the connections from one instance to another as one, for each pair of instances."""
    by_ends = groupby(
        sorted(pairs, key=lambda pair: (pair.source, pair.target)), lambda pair: (pair.source, pair.target)
    )
    return tuple(
        Connection(
            source,
            tuple(pair.output for pair in group),
            target,
            tuple(pair.into for pair in group),
            transformations=tuple(
                (pair.into, pair.transformation) for pair in group if pair.transformation != UNCHANGED
            ),
        )
        for (source, target), group in ((ends, list(members)) for ends, members in by_ends)
    )


def _pair(text: str) -> Pair:
    left, arrow, right = text.partition(ARROW)
    scaled = SCALED.fullmatch(left.strip())
    factor, start, sign, offset = scaled.groups() if scaled else (None, "", None, None)
    ends = [end.strip().partition(".") for end in (start, right)]
    if not arrow or ARROW in right or not all(name and variable for name, _, variable in ends):
        raise ValueError(f"connections: '{text}': must be 'instance.output {ARROW} instance.input'")
    (source, _, output), (target, _, into) = ends
    transformation = Conversion(float(factor or 1.0), float(f"{sign or ''}{offset or 0.0}"))
    if not all(map(math.isfinite, transformation)) or transformation.factor == 0.0:
        raise ValueError(f"connections: '{text}': factor and offset must be finite, and the factor not 0")
    return Pair(source, output, target, into, transformation)
