"""Tables of a vehicle's track: links, pins, grousers, belt, section, material, guides, and what its life depends on.

A belt of one piece is computed as links with bushes, whose numbers follow from its own. No FMU reads the table of life.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from operator import attrgetter
from typing import Annotated, Any, Literal

from pydantic import Field, model_validator

from fmus.vehicles.ranges import Mistake
from fmus.vehicles.sides import of_wheels
from fmus.vehicles.tables import Force, FrozenTable, Gap, In, Inertia, Length, Mass, Size, ratio, to_si, value_text

STIFFER = 10.0  # bending stiffness of flexible links over that of their belt: nine tenths of it bends in the bushes
POISSON = 0.3  # Poisson's ratio, of beams
Stress = Annotated[float, In("Pa", gt=0, le=1e16)]
Area = Annotated[float, In("m^2", gt=0, le=10)]
Bending = Annotated[float, In("m^4", gt=0, le=10)]
Factor = Annotated[float, ratio(ge=1.0, le=1e3)]


class BeltTable(FrozenTable):  # noqa: D101
    bending: Annotated[float, In("N m^2", gt=0, le=1e12)]
    """stiffness EI of the belt in bending: track.bushing.stiffness = bending / track.pitch"""
    relaxation_time: Annotated[float, In("s", ge=0, le=1e3)] = 0.0
    """damping over stiffness of the belt in bending, of track.bushing.damping too"""
    axial: Annotated[float, In("N", gt=0, le=1e16)] | None = None
    """stiffness EA of the belt in stretch, of flexible links: it gives section and material, without relaxation time,
    where their tables do not say otherwise; rigid links do not stretch"""
    length: Annotated[float, In("m", gt=0, le=1e3)] | None = None
    """length of the belt: track.pitch = length / track.links"""
    mass: Annotated[float, In("kg", gt=0, le=1e8)] | None = None
    """mass of the belt: track.mass = mass / track.links"""
    thickness: Size | None = None
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


class BushingTable(FrozenTable):  # noqa: D101
    stiffness: Annotated[float, In("N m/rad", ge=0)] = 0.0
    """stiffness of the bushes of a pin against the turning of its two links"""
    preset: Annotated[float, In("rad", gt=-1.5, lt=1.5)] = 0.0
    """angle between the links at which the bushes are free of torque, positive as the chain bends round its wheels"""
    damping: Annotated[float, In("N m s/rad", ge=0)] = 0.0
    """damping of the bushes of a pin"""
    in_series: bool = False
    """stiffness and damping are those of bushes and flexible links in series; rigid links have bushes alone"""
    friction: Annotated[float, ratio(ge=0, le=2.0)] = 0.0
    """coefficient of friction between pin and link, under the force of the pin"""
    radius: Annotated[float, In("m", gt=0, lt=1)] | None = None
    """radius at which a pin rubs; with friction"""
    slow: Annotated[float, In("rad/s", gt=0, le=1e5)] = 0.2
    """rate of turning below which the friction of a pin grows in proportion to it"""
    wear: Annotated[float, In("1/Pa", ge=0, le=1e-9)] = 0.0
    """volume that wears off per force and way of rubbing (Archard)"""
    bearing: Annotated[float, In("m", gt=0, lt=10)] | None = None
    """width along the pin on which a link bears it; with wear"""


class GrouserTable(FrozenTable):  # noqa: D101
    height: Annotated[float, In("m", ge=0, le=2)]
    """height of a bar or pad over the outer face of its link, track.face"""
    length: Size
    """length of a bar or pad along the track"""
    width: Size | None = None
    """width of a bar or pad; without it track.width"""
    count: Annotated[int, Field(ge=1, le=8)] = 1
    """number of bars or pads of a link, each in the middle of an equal part of the pitch"""


class TrackTable(FrozenTable):  # noqa: D101
    links: Annotated[int, Field(ge=4, le=4096)]
    """number of links of a track"""
    lateral: Length
    """distance of the track's plane from the plane of symmetry"""
    pitch: Size
    """distance between the pins of a link"""
    mass: Mass
    """mass of a link"""
    inertia: tuple[Inertia, Inertia, Inertia]
    """moments of inertia of a link about its own x (along), y (pin), z (normal)"""
    face: Gap
    """distance of both faces of a link, towards the ground and towards the wheels, from the line of the pins"""
    width: Size
    """width of a link"""
    tension: Force
    """mean static tension of the vehicle standing on level, hard ground: the idler's place is solved for it. Flexible
    links have it to 0.1 %. Rigid ones keep that place if they carry the tension there to 1 % at t = 0; else they have
    their own, or if none is found the nearest known. The summary of a run says what they carry. Soil and slopes add
    their own; a drawn start moves no idler; without gravity as drawn. 0: a slack track, its idler drawn in by 60 mm
    (links of 152.4 mm; others in proportion), the farthest that the search goes"""
    bushing: BushingTable | None = None
    """bushes and friction of the pins"""
    belt: BeltTable | None = None
    """belt of one piece, in place of pitch, mass, face, inertia and bushes of the links that it is cut into"""
    grouser: GrouserTable | None = None
    """bars or pads on the outer faces of the links; without them the whole outer face stands on the ground"""

    @model_validator(mode="before")
    @classmethod
    def _cut(cls, data: Any) -> Any:
        """Fill in the numbers of links that a belt gives; other faults of the table are found later."""
        units = {"pitch": "m", "width": "m", "mass": "kg"}
        try:
            given = {key: to_si(unit)(data[key]) for key, unit in units.items() if key in data}
            own = BeltTable.model_validate(data["belt"]).of_links(data["links"], **given)
        except (KeyError, TypeError, ValueError, ArithmeticError):
            return data
        bushes = {key.removeprefix("bushing."): own.pop(key) for key in [*own] if key.startswith("bushing.")}
        return {**own, **data, "bushing": {**bushes, **(data.get("bushing") or {})}}

    @model_validator(mode="after")
    def _one_belt(self) -> TrackTable:
        """Refuse numbers of links that are not those of their belt."""
        own = self.belt.of_links(self.links, self.width, self.pitch, self.mass) if self.belt else {}
        for key, made in own.items():
            given = attrgetter(key)(self)
            if not all(math.isclose(*pair) for pair in zip(of_wheels(given, 1), of_wheels(made, 1), strict=True)):
                raise ValueError(f"{key} = {value_text(given)}: track.belt makes it {value_text(made)}, leave it out")
        return self


class SectionTable(FrozenTable):  # noqa: D101
    area: Area
    """area of the section"""
    bending: Bending
    """second moment of area for bending in the plane of the track"""
    lateral_bending: Bending
    """second moment of area for bending to the side, of beams"""
    torsion: Bending
    """torsion constant of Saint-Venant, of beams; at most bending + lateral_bending"""
    outer_fibre: Size
    """distance of the outer fibre from the neutral axis, for the stress of bending"""


class MaterialTable(FrozenTable):  # noqa: D101
    youngs_modulus: Annotated[float, In("Pa", gt=0)]
    """Young's modulus"""
    shear_modulus: Stress
    """shear modulus, of beams"""
    relaxation_time: Annotated[float, In("s", ge=0)]
    """damping constants of the material over its Young's modulus"""


class GuideTable(FrozenTable):  # noqa: D101
    clearance: Gap
    """lateral play of a guide horn, on each side, between the discs of a wheel; of rigid links and beams"""


class FatigueTable(FrozenTable):
    """Life of a material: amplitude of stress over cycles, with a knee (Basquin 1910), at half of the specimens."""

    stress: Stress
    """amplitude at the knee, for a stress that alternates about 0"""
    cycles: Annotated[float, ratio(gt=0, le=1e15)] = 2e6
    """cycles at the knee"""
    slope: Factor = 5.0
    """slope above the knee: cycles = cycles at the knee (stress / amplitude)^slope"""
    slope_beyond: Factor | None = None
    """slope below the knee; without it 2 slope - 1 (Haibach 1970)"""
    mean_stress: Literal["none", "goodman", "morrow", "walker", "swt"] = "goodman"
    """rule by which the mean of a cycle counts"""
    ultimate: Stress | None = None
    """ultimate strength, of the rule goodman"""
    fracture: Stress | None = None
    """true fracture strength, of the rule morrow"""
    exponent: Annotated[float, ratio(gt=0.0, le=1.0)] = 0.65
    """exponent of the rule walker; swt is 0.5"""
    scatter: Factor = 3.0
    """life that 10 % of the parts reach over the one that 90 % reach"""


class LifeTable(FrozenTable):  # noqa: D101
    pin_diameter: Size
    """diameter of a pin"""
    lugs: Annotated[int, Field(ge=1, le=20)]
    """lugs of the link on one end, which stand between one more of the next link; all carry alike"""
    inner_lug: Size
    """width of one of these lugs"""
    outer_lug: Size
    """width of an outermost lug of the next link, which carries half as much"""
    gap: Gap = 0.0
    """gap between two lugs"""
    body_area: Area
    """net section of the body of a link across its pull"""
    pin_factor: Factor = 1.0
    """stress concentration factor of the pin in bending"""
    body_factor: Factor = 1.0
    """stress concentration factor of the net section"""
    pin: FatigueTable
    """life of the pin"""
    body: FatigueTable
    """life of the body of a link"""


NEEDED = {"goodman": "ultimate", "morrow": "fracture"}


def contradictions(vehicle: Mapping[str, Any]) -> Iterator[str]:
    """Yield a sentence for each mean-stress rule that lacks its strength, and each strength below the knee."""
    for part in ("pin", "body"):
        if (table := (vehicle.get("life") or {}).get(part)) is None:
            continue
        needed = NEEDED.get(table["mean_stress"])
        if needed and table[needed] is None:
            yield f'life.{part}.{needed}: is missing; mean_stress = "{table["mean_stress"]}" needs it'
        for key in NEEDED.values():
            if table[key] is not None and table[key] <= table["stress"]:
                yield Mistake(
                    f"life.{part}.{key} = {table[key]:g} Pa: must be more than life.{part}.stress ="
                    f" {table['stress']:g} Pa, the amplitude at the knee"
                )
