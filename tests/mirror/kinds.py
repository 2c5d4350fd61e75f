"""The kind of links of a track."""

from __future__ import annotations

from mirror.beams import Beam
from mirror.cables import Cable, Engineering, General, Planar, Turning
from mirror.links import Chain, Rigid
from mirror.record import Part

KINDS = {"cable": Cable, "planar": Planar, "beam": Beam, "general": General, "engineering": Engineering}


def chain(part: Part) -> Chain:
    """Return the links of a track."""
    if part.kind == "TrackRigid":
        return Rigid(part)
    if part.parameters["axes"] == "free":
        return Turning(part)
    elasticity = str(part.parameters["elasticity"])
    return KINDS[str(part.parameters["element"]) if elasticity == "small_deformation" else elasticity](part)
