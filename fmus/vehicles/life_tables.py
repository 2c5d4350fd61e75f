"""Table of what the life of a track depends on: pin, lugs, section of the body, material; read by no FMU."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Annotated, Any, Literal

from pydantic import Field

from fmus.vehicles.ranges import Mistake
from fmus.vehicles.tables import Distance, FrozenTable, In, ratio

Stress = Annotated[float, In("Pa", gt=0)]
Notch = Annotated[float, ratio(ge=1.0)]


class FatigueTable(FrozenTable):
    """Life of a material: amplitude of stress over cycles, with a knee (Basquin 1910), at half of the specimens."""

    stress: Stress
    """amplitude at the knee, for a stress that alternates about 0"""
    cycles: Annotated[float, ratio(gt=0)] = 2e6
    """cycles at the knee"""
    slope: Annotated[float, ratio(ge=1.0)] = 5.0
    """slope above the knee: cycles = cycles at the knee (stress / amplitude)^slope"""
    slope_beyond: Annotated[float, ratio(ge=1.0)] | None = None
    """slope below the knee; without it 2 slope - 1 (Haibach 1970)"""
    mean_stress: Literal["none", "goodman", "morrow", "walker", "swt"] = "goodman"
    """rule by which the mean of a cycle counts"""
    ultimate: Stress | None = None
    """ultimate strength, of the rule goodman"""
    fracture: Stress | None = None
    """true fracture strength, of the rule morrow"""
    exponent: Annotated[float, ratio(gt=0.0, le=1.0)] = 0.65
    """exponent of the rule walker; swt is 0.5"""
    scatter: Annotated[float, ratio(ge=1.0)] = 3.0
    """life that 10 % of the parts reach over the one that 90 % reach"""


class LifeTable(FrozenTable):  # noqa: D101
    pin_diameter: Distance
    """diameter of a pin"""
    lugs: Annotated[int, Field(ge=1, le=20)]
    """lugs of the link on one end, which stand between one more of the next link; all carry alike"""
    inner_lug: Distance
    """width of one of these lugs"""
    outer_lug: Distance
    """width of an outermost lug of the next link, which carries half as much"""
    gap: Annotated[float, In("m", ge=0)] = 0.0
    """gap between two lugs"""
    body_area: Annotated[float, In("m^2", gt=0)]
    """net section of the body of a link across its pull"""
    pin_factor: Notch = 1.0
    """stress concentration factor of the pin in bending"""
    body_factor: Notch = 1.0
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
