"""Outputs of links and pins of a track, in groups: a scene chooses groups, and only they are computed."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from typing import Any, NamedTuple

import numpy as np

from fmus.interface.ports import Port
from fmus.physics.chain import link_columns as column
from fmus.physics.chain.link_columns import NONE, WITH_GROUND, WITH_JOINT, WITH_SLIDING, WITH_WHEELS, LinkForcesShape

XYZ = tuple("xyz")
MEAN = ", world, mean over the interval"


INTERVAL = "link_outputs.interval"  # parameter: communication steps over which link outputs are averaged


class OutputGroup(NamedTuple):
    """Group of outputs of each link or each pin, ordered by link (or pin), then by part."""

    owner: str  # "link" or "joint" (a pin)
    signal: str
    parts: tuple[str, ...]  # last components of the names; "" for a scalar signal
    unit: str
    text: str  # description, with {part} and {it}
    columns: int = 0  # number of ``link_columns`` that the group needs
    ground: bool = False  # only where there is a ground
    bushed: bool = False  # only where pins have bushes


class LinkArrays(NamedTuple):
    """Work arrays of the link outputs of n links and m pins, so that reading them allocates nothing."""

    means: np.ndarray  # (m, columns) means of the forces on links
    tension: np.ndarray  # (n) N
    stress: np.ndarray  # (n) Pa
    place: np.ndarray  # (m, 3) of the pins, m; of their axes
    fibres: np.ndarray  # (n, 2) Pa
    ends: np.ndarray  # (n, 6) slopes


def link_arrays(shape: LinkForcesShape, links: int, pins: int) -> LinkArrays:
    """Return zeroed arrays; ``shape``: of the forces on links."""
    z = np.zeros
    return LinkArrays(z(shape), z(links), z(links), z((pins, 3)), z((links, 2)), z((links, 6)))


GROUPS = {
    "tension": OutputGroup("link", "tension", ("",), "N", "pull between the two parts of {it}, mean along it"),
    "stress": OutputGroup("link", "stress", ("",), "Pa", "largest axial stress of {it}"),
    "position": OutputGroup("joint", "position", XYZ, "m", "{part} of {it}, world"),
    "force": OutputGroup(
        "joint", "force", XYZ, "N", "{part} force of {it} on the link that begins there, world, mean over the interval",
        WITH_JOINT,
    ),
    "ground": OutputGroup(
        "link", "ground.force", XYZ, "N", "{part} force of the ground on {it}, world, mean over the interval",
        WITH_GROUND, True,
    ),
    "wheels": OutputGroup(
        "link", "wheels.force", XYZ, "N",
        "{part} force of the wheels on {it} and on the pin where it ends, world, mean over the interval", WITH_WHEELS,
    ),
    "sliding": OutputGroup(
        "link", "ground.sliding", XYZ, "m/s",
        "{part} velocity over the ground of what of {it} lies on it, world, mean over the interval", WITH_SLIDING, True,
    ),
    "depth": OutputGroup(
        "link", "ground.depth", ("",), "m", "depth of {it} in the ground, mean over the interval", WITH_SLIDING, True
    ),
    "teeth": OutputGroup("joint", "tooth.force", XYZ, "N", "{part} force of teeth on {it}" + MEAN, column.WITH_PARTS),
    "rims": OutputGroup("link", "rim.force", XYZ, "N", "{part} force of rims on {it}" + MEAN, column.WITH_PARTS),
    "horns": OutputGroup("link", "horn.force", XYZ, "N", "{part} force on {it}'s horn" + MEAN, column.WITH_PARTS),
    "moment": OutputGroup(
        "joint", "moment", XYZ, "N.m", "{part} moment of {it} across its axis on the link that begins there" + MEAN,
        column.WITH_MOMENT,
    ),
    "axis": OutputGroup("joint", "axis", XYZ, "1", "{part} of the unit vector along {it}, world"),
    "fibres": OutputGroup(
        "link", "fibre", ("outer", "inner"), "Pa",
        "axial stress of {it} at its {part} fibre, mean along the link, positive where it is stretched",
    ),
    "slopes": OutputGroup(
        "link", "slope", tuple(f"{end}.{axis}" for end in ("first", "last") for axis in XYZ), "1",
        "{part} of the position gradient along {it} at a pin, world",
    ),
    "turned": OutputGroup(
        "joint", "turned", ("",), "rad", "angle by which {it} has turned to and fro so far, all added up", bushed=True
    ),
    "rubbed": OutputGroup(
        "joint", "rubbed", ("",), "J", "work of the friction of {it} so far, which is that of its wear", bushed=True
    ),
}  # fmt: skip
TENSION, STRESS, POSITION, FORCE, GROUND, WHEELS, SLIDING, DEPTH, TEETH, RIMS, HORNS, MOMENT = range(12)
AXIS, FIBRES, SLOPES, TURNED, RUBBED = range(12, len(GROUPS))
STANDARD = ("tension", "stress", "position", "force", "ground")
WITH_OWN_KERNELS = ("axis", "fibres", "slopes", "turned", "rubbed")  # groups with kernels of their own


def chosen_groups(request: Any, ground: bool, bushed: bool = False) -> tuple[str, ...]:
    """Names of the groups to show, in order; ``request``: names, True (standard groups) or False (none)."""
    names = STANDARD if request is True else request or ()
    return tuple(
        name
        for name, group in GROUPS.items()
        if name in names and (ground or not group.ground) and (bushed or not group.bushed)
    )


def on_links_shape(groups: Sequence[str], pins: int, bushed: bool = False) -> LinkForcesShape:
    """Shape (pins, columns) of the array of forces on links that the groups, and bushed pins, need."""
    columns = max((GROUPS[name].columns for name in groups), default=0)
    columns = max(columns, WITH_JOINT * bushed)
    return (pins, columns) if columns else NONE


@cache
def ports(groups: tuple[str, ...], links: int, pins: int) -> list[Port]:
    """Output ports of the groups, of links 1 to ``links`` and pins 1 to ``pins``."""
    output_ports = []
    for group in (GROUPS[name] for name in groups):
        of_link = group.owner == "link"
        for i in range(1, (links if of_link else pins) + 1):
            it = f"link {i}" if of_link else f"pin {i}"
            for part in group.parts:
                name = f"{group.owner}[{i}].{group.signal}" + (f".{part}" if part else "")
                output_ports.append(Port(name, "output", group.unit, group.text.format(part=part, it=it)))
    return output_ports
