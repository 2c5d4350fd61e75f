"""FMUs of the user in a scene: table ``[fmu.NAME]``, and connections as lines of text.

A connection of one output to one input is "a.x -> b.u", or "2.0 * a.x + 1.0 -> b.u".
"""

from __future__ import annotations

import math
import re
from collections.abc import Collection, Mapping, Sequence
from itertools import groupby
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple

from pydantic import AfterValidator, Field

from fmus.vehicles.tables import NUMBER, BadInput, FrozenTable, In
from orchestrator.cosim.base_units import UNCHANGED, Conversion
from orchestrator.cosim.graph import Connection
from orchestrator.scene.settings import hint, toml_text

Integer = Annotated[int, Field(ge=-(2**63), le=2**64 - 1)]  # of FMI
Value = Annotated[
    bool | Integer | Annotated[float, Field(allow_inf_nan=False)] | str,
    Field(json_schema_extra={"unit": "that of the parameter", "description": "value of the parameter NAME of the FMU"}),
]


def _absolute(file: str) -> str:
    return str(Path(file).absolute())


class FmuTable(FrozenTable):
    """FMU of the user in place of the part NAME, with its connections; else a further one, with those of the scene."""

    file: Annotated[str, Field(pattern=r"^[^\x00]+$"), AfterValidator(_absolute)]
    """FMU for co-simulation (FMI 2.0 or 3.0); its path is relative to the scene file"""
    parameters: dict[str, Value] = Field(default_factory=dict)
    """parameters of the FMU by their names, and start values of its inputs; it gets those of the part too"""
    in_process: bool = False
    """an FMU that cotrack has not built runs in the process of the run, where it can do harm, not in one of its own"""
    call_limit: Annotated[float, In("s", gt=0)] | None = None
    """longest time of a call of an FMU in a process of its own; without it a call may last as long as it likes"""
    non_finite: Literal["fail", "warn"] = "fail"
    """what an output that is not finite does: the run fails, or goes on with a warning"""


def require_instance_name(name: str) -> None:
    """Raise ValueError for a name that no connection or topic can have."""
    if not name or set(name) & set("./\\") or not name.isprintable():
        raise ValueError(f"fmu.'{name}': the name of an instance must have no dot and no slash")


def set_folder(table: Mapping[str, Any], folder: Path) -> None:
    """Make the paths of FMUs in a raw scene, which are relative to ``folder``, absolute."""
    entries = table.get("fmu")
    for entry in entries.values() if isinstance(entries, dict) else ():
        if isinstance(entry, dict) and isinstance(entry.get("file"), str):
            entry["file"] = str(folder.absolute() / entry["file"])


def replacing_fmus(texts: Sequence[str]) -> list[str]:
    """Settings that texts ``NAME=FMU`` stand for; raises BadInput."""
    files: dict[str, str] = {}
    for text in texts:
        name, _, file = (part.strip() for part in text.partition("="))
        if not (name and file):
            raise BadInput(f"--replace {text}: must be NAME=FMU, the name of a part and a file")
        if name in files:
            raise BadInput(f"--replace {text}: '{name}' is replaced already, by {files[name]}")
        files[name] = file
    return [f"fmu.{name}.file={toml_text(file)}" for name, file in files.items()]


ARROW = "->"
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


def require_free_inputs(pairs: Sequence[Pair], names: Collection[str], taken: Collection[tuple[str, str]]) -> None:
    """Raise ValueError if a pair has an unknown component, or an input that has another connection."""
    targets = set(taken)
    for pair in pairs:
        for name in (pair.source, pair.target):
            if name not in names:
                raise ValueError(f"connections: '{pair}': no component '{name}': {hint(name, names, 'there are')}")
        if (pair.target, pair.into) in targets:
            raise ValueError(f"connections: '{pair}': the input has another connection")
        targets.add((pair.target, pair.into))


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


def pair_of(text: str) -> Pair:
    """Parse a connection; raises ValueError."""
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
