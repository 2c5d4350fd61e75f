"""The kind of links of a track."""

from __future__ import annotations

from mirror.beams import Beam
from mirror.cables import Cable, Engineering, General, Planar, Turning
from mirror.links import Chain, Rigid
from mirror.record import Part

MIRRORED = {
    "TrackRigid": Rigid, "turning": Turning, "cable": Cable, "planar": Planar, "beam": Beam, "general": General,
    "engineering": Engineering,
}  # fmt: skip


def kind_of(part: Part) -> str:
    """Kind of a component; of a flexible track, the kind of its links."""
    if part.kind != "TrackFlexible":
        return part.kind
    if part.parameters["axes"] == "free":
        return "turning"
    elasticity = str(part.parameters["elasticity"])
    return str(part.parameters["element"]) if elasticity == "small_deformation" else elasticity


def chain(part: Part) -> Chain:
    """Return the links of a track."""
    return MIRRORED[kind_of(part)](part)
