"""Real variables as the arrays of FMI 3.0: positions, forces and the like, and the outputs of all links.

| Reals | Float64 variable | dimensions |
| --- | --- | --- |
| `S.position.x`, `.y`, `.z`; likewise `velocity`, `angular_velocity`, `force`, `torque` | `S.position` | 3 |
| `S.orientation.w`, `.x`, `.y`, `.z` | `S.orientation` | 4 |
| `link[1].tension` to `link[n].tension` | `link.tension` | n |
| `joint[1].position.x` to `joint[n].position.z` | `joint.position` | n, 3 |

Elements lie one behind the other in the row of Reals, so an array is a slice of it. Reals of such a group that differ
in causality, unit or range stay variables of their own.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from itertools import groupby
from typing import NamedTuple

from fmus.interface.ports import Port
from fmus.track.link_outputs import GROUPS

AXES = ("x", "y", "z"), ("w", "x", "y", "z")
OF_LINKS = {f"{group.owner}.{group.signal}" for group in GROUPS.values()}


class ArrayVariable(NamedTuple):
    """Float64 variable of FMI 3.0."""

    name: str
    text: str
    first: int  # place of the first element among the Reals
    elements: tuple[Port, ...]  # alike in causality, unit and range
    shape: tuple[int, ...] = ()  # empty for a scalar


def arrays(reals: Sequence[Port]) -> list[ArrayVariable]:
    """Float64 variables of the Reals, in their order; the index is the value reference."""
    found: list[ArrayVariable] = []
    place = 0
    for name, group in groupby(reals, key=lambda port: _split(port.name)[0]):
        elements = tuple(group)
        labels = [_split(port.name)[1] for port in elements]
        distinct = tuple(dict.fromkeys(labels))
        known = name in OF_LINKS or distinct in AXES
        alike = len({(port.causality, port.unit, port.allowed) for port in elements}) == 1
        if known and alike and labels == [*distinct] * (len(labels) // len(distinct)):
            shape = tuple(size for size in (len(labels) // len(distinct), len(distinct)) if size > 1)
            found.append(ArrayVariable(name, _text(elements[0].text, distinct), place, elements, shape))
        else:
            found += [ArrayVariable(port.name, port.text, place + i, (port,)) for i, port in enumerate(elements)]
        place += len(elements)
    return found


def _split(name: str) -> tuple[str, str]:
    """Name of the array of a Real, and the label of the element among those of a vector."""
    if match := re.fullmatch(r"(link|joint)\[\d+\]\.(.+)", name):
        whole = f"{match[1]}.{match[2]}"
        for array in OF_LINKS:
            if f"{whole}.".startswith(f"{array}."):
                return array, whole[len(array) + 1 :]
    head, _, last = name.rpartition(".")
    return (head, last) if last in AXES[1] else (name, "")


def _text(text: str, labels: Sequence[str]) -> str:
    """Description of an array from that of its first element."""
    if labels[0]:
        text = re.sub(rf"\b{re.escape(labels[0])}\b", ", ".join(labels), text, count=1)
    return re.sub(r"\b(link|pin) 1\b", r"each \1", text)
