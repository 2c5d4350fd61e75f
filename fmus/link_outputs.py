"""Outputs of links and pins of a track, in groups: a scene chooses groups, and only they are computed."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

from fmus.physics.chain.on_links import NONE, WITH_GROUND, WITH_JOINT, WITH_SLIDING, WITH_WHEELS, LinkForcesShape
from fmus.ports import Port

XYZ = tuple("xyz")


INTERVAL = "link_outputs.interval"  # parameter: communication steps over which link outputs are averaged


class Group(NamedTuple):
    """Group of outputs of each link or each pin, ordered by link (or pin), then by part."""

    of: str  # "link" or "joint" (a pin)
    signal: str
    parts: tuple[str, ...]  # last components of the names; "" for a scalar signal
    unit: str
    text: str  # description, with {part} and {it}
    columns: int = 0  # number of columns of ``on_links`` that the group needs
    ground: bool = False  # only where there is a ground


GROUPS = {
    "tension": Group("link", "tension", ("",), "N", "pull between the two parts of {it}, mean along it"),
    "stress": Group("link", "stress", ("",), "Pa", "largest axial stress of {it}"),
    "position": Group("joint", "position", XYZ, "m", "{part} of {it}, world"),
    "force": Group(
        "joint", "force", XYZ, "N", "{part} force of {it} on the link that begins there, world, mean over the interval",
        WITH_JOINT,
    ),
    "ground": Group(
        "link", "ground.force", XYZ, "N", "{part} force of the ground on {it}, world, mean over the interval",
        WITH_GROUND, True,
    ),
    "wheels": Group(
        "link", "wheels.force", XYZ, "N",
        "{part} force of the wheels on {it} and on the pin where it ends, world, mean over the interval", WITH_WHEELS,
    ),
    "sliding": Group(
        "link", "ground.sliding", XYZ, "m/s",
        "{part} velocity over the ground of what of {it} lies on it, world, mean over the interval", WITH_SLIDING, True,
    ),
    "depth": Group(
        "link", "ground.depth", ("",), "m", "depth of {it} in the ground, mean over the interval", WITH_SLIDING, True
    ),
    "axis": Group("joint", "axis", XYZ, "1", "{part} of the unit vector along {it}, world"),
    "fibres": Group(
        "link", "fibre", ("outer", "inner"), "Pa",
        "axial stress of {it} at its {part} fibre, mean along the link, positive where it is stretched",
    ),
    "slopes": Group(
        "link", "slope", tuple(f"{end}.{axis}" for end in ("first", "last") for axis in XYZ), "1",
        "{part} of the position gradient along {it} at a pin, world",
    ),
}  # fmt: skip
TENSION, STRESS, POSITION, FORCE, GROUND, WHEELS, SLIDING, DEPTH, AXIS, FIBRES, SLOPES = range(len(GROUPS))
STANDARD = ("tension", "stress", "position", "force", "ground")
BEYOND = ("axis", "fibres", "slopes")  # groups with kernels of their own


def chosen(asked: Any, ground: bool) -> tuple[str, ...]:
    """Names of the groups to show, in order; ``asked``: names, True (standard groups) or False (none)."""
    names = STANDARD if asked is True else asked or ()
    return tuple(name for name, group in GROUPS.items() if name in names and (ground or not group.ground))


def felt(groups: Sequence[str], pins: int) -> LinkForcesShape:
    """Shape (pins, columns) of the array of forces on links that the groups need."""
    columns = max((GROUPS[name].columns for name in groups), default=0)
    return (pins, columns) if columns else NONE


def ports(groups: Sequence[str], links: int, pins: int) -> list[Port]:
    """Output ports of the groups, of links 1 to ``links`` and pins 1 to ``pins``."""
    found = []
    for group in (GROUPS[name] for name in groups):
        of_a_link = group.of == "link"
        for i in range(1, (links if of_a_link else pins) + 1):
            it = f"link {i}" if of_a_link else f"pin {i}"
            for part in group.parts:
                name = f"{group.of}[{i}].{group.signal}" + (f".{part}" if part else "")
                found.append(Port(name, "output", group.unit, group.text.format(part=part, it=it)))
    return found
