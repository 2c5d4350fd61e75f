"""Table of a belt of one piece, which is computed as links with bushes: their numbers follow from those of the belt."""

from __future__ import annotations

from typing import Annotated

from fmus.vehicles.tables import Distance, FrozenTable, In, Mass

STIFFER = 10.0  # bending stiffness of flexible links over that of their belt: nine tenths of it bends in the bushes
POISSON = 0.3  # Poisson's ratio, of beams


class BeltTable(FrozenTable):  # noqa: D101
    bending: Annotated[float, In("N m^2", gt=0)]
    """stiffness EI of the belt in bending: track.bushing.stiffness = bending / track.pitch"""
    relaxation_time: Annotated[float, In("s", ge=0)] = 0.0
    """damping over stiffness of the belt in bending, of track.bushing.damping too"""
    axial: Annotated[float, In("N", gt=0)] | None = None
    """stiffness EA of the belt in stretch, of flexible links: it gives section and material, without relaxation time,
    where their tables do not say otherwise; rigid links do not stretch"""
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
        bush = {"bushing.stiffness": self.bending / pitch, "bushing.in_series": self.axial is not None}
        if self.relaxation_time:
            bush["bushing.damping"] = self.relaxation_time * self.bending / pitch
        if self.thickness is None:
            return {"pitch": pitch, "mass": mass, **bush}
        along, across, up = pitch * pitch, width * width, self.thickness * self.thickness
        inertia = tuple(mass / 12.0 * both for both in (across + up, along + up, along + across))
        return {"pitch": pitch, "mass": mass, "face": 0.5 * self.thickness, "inertia": inertia, **bush}

    def of_section(self, width: float, thickness: float) -> dict[str, dict[str, float]]:
        """Section and material of flexible links, sizes in m; ``bushing.in_series`` makes up for their bending."""
        area, fibre = width * thickness, 0.5 * thickness
        young = self.axial / area  # type: ignore[operator]
        second, lateral, torsion = STIFFER * self.bending / young, area * width * width, area * fibre * fibre
        section = {"bending": second, "lateral_bending": lateral / 12.0, "torsion": 4.0 / 3.0 * torsion}
        material = {"youngs_modulus": young, "shear_modulus": young / (2.0 + 2.0 * POISSON), "relaxation_time": 0.0}
        return {"section": {"area": area, "outer_fibre": fibre, **section}, "material": material}
