"""Table of a belt of one piece, which is computed as links with bushes: their numbers follow from those of the belt."""

from __future__ import annotations

from typing import Annotated

from fmus.vehicles.tables import Distance, FrozenTable, In, Mass


class BeltTable(FrozenTable):  # noqa: D101
    bending: Annotated[float, In("N m^2", gt=0)]
    """stiffness EI of the belt in bending: track.bushing.stiffness = bending / track.pitch"""
    relaxation_time: Annotated[float, In("s", ge=0)] = 0.0
    """damping over stiffness of the belt in bending, of track.bushing.damping too"""
    length: Distance | None = None
    """length of the belt: track.pitch = length / track.links"""
    mass: Mass | None = None
    """mass of the belt: track.mass = mass / track.links"""
    thickness: Distance | None = None
    """thickness of the belt: track.face is half of it, track.inertia that of a box of pitch, width and thickness"""

    def of_links(self, links: int, width: float, pitch: float = 0.0, mass: float = 0.0) -> dict[str, object]:
        """Numbers of its ``links`` in the table of a track, by dotted keys; lengths in m, ``mass`` in kg of a link.

        A belt that bends by an angle over a pitch p has the torque EI angle / p. Links with that bush at each pin
        approach the elastica by the square of the pitch.
        """
        pitch, mass = self.length / links if self.length else pitch, self.mass / links if self.mass else mass
        bush = {"bushing.stiffness": self.bending / pitch}
        if self.relaxation_time:
            bush["bushing.damping"] = self.relaxation_time * self.bending / pitch
        if self.thickness is None:
            return {"pitch": pitch, "mass": mass, **bush}
        along, across, up = pitch * pitch, width * width, self.thickness * self.thickness
        inertia = tuple(mass / 12.0 * both for both in (across + up, along + up, along + across))
        return {"pitch": pitch, "mass": mass, "face": 0.5 * self.thickness, "inertia": inertia, **bush}
