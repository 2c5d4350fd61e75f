"""Connection of one output to one input, as a line of text: "a.x -> b.u", or "2.0 * a.x + 1.0 -> b.u"."""

from __future__ import annotations

import math
import re
from collections.abc import Collection, Sequence
from itertools import groupby
from typing import NamedTuple

from orchestrator.cosim.base_units import UNCHANGED, Conversion
from orchestrator.cosim.graph import Connection
from orchestrator.scene.gallery import hint

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
