"""Units of FMUs in SI base units, as their model descriptions define them, and conversions between them."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any, NamedTuple

QUANTITIES = ("kg", "m", "s", "A", "K", "mol", "cd")  # an angle has no dimension
DISPLAY_UNITS = {"km/h": 1.0 / 3.6, "kN": 1e3, "mm": 1e-3} | dict.fromkeys(
    ("deg", "degree", "°"), math.pi / 180.0
)  # in SI


class BaseUnit(NamedTuple):
    """A unit in SI base units: value in base units = factor * value + offset."""

    exponents: tuple[float, ...]  # of QUANTITIES
    factor: float = 1.0
    offset: float = 0.0
    relative: bool = False  # of a difference of two values, for which offsets do not count


class Conversion(NamedTuple):
    """Linear conversion of a Real: converted value = factor * value + offset."""

    factor: float = 1.0
    offset: float = 0.0

    def then(self, other: Conversion) -> Conversion:
        """Return the conversion that does the other one after this one."""
        return Conversion(other.factor * self.factor, other.factor * self.offset + other.offset)


UNCHANGED = Conversion()


def unit_of(variable: Any) -> str:
    """Unit of a variable of fmpy, its own or that of its declared type; empty if it has none."""
    return variable.unit or getattr(variable.declaredType, "unit", None) or ""


def base_unit(description: Any, variable: Any) -> BaseUnit | None:
    """Unit of a variable in base units by its model description; None if that does not define it."""
    unit, relative = unit_of(variable), variable.relativeQuantity
    if relative is None:
        relative = getattr(variable.declaredType, "relativeQuantity", False)
    for definition in description.unitDefinitions:
        base = definition.baseUnit
        if definition.name == unit and base is not None and 0.0 < base.factor < math.inf:
            exponents = tuple(float(getattr(base, each)) for each in QUANTITIES)
            return BaseUnit(exponents, base.factor, base.offset, bool(relative))
    return None


def inverse_factors(description: Any) -> Iterator[str]:
    """Sentences on units that an FMU shows by the inverse of their factors."""
    for unit in description.unitDefinitions:
        for shown in unit.displayUnits:
            right = getattr(unit.baseUnit, "factor", 1.0) / DISPLAY_UNITS.get(shown.name, math.inf)
            if right not in (0.0, 1.0) and math.isclose(shown.factor * right, 1.0, rel_tol=1e-3):
                yield f"'{unit.name}' is shown in '{shown.name}' by {shown.factor:g}, the inverse of {right:g}"


def difference(unit: str, base: BaseUnit | None, needed: str, needed_base: BaseUnit | None) -> str:
    """Words on why values of one unit cannot be converted to the one needed; empty if they can."""
    if base is None or needed_base is None:
        own, other = ("" if each is not None else ", which the FMU does not define" for each in (base, needed_base))
        needs = f"'{needed}'{other}{',' * bool(other)} is needed"
        return "" if unit == needed else f"has the unit '{unit}'{own}, and {needs}"
    return "" if base.exponents == needed_base.exponents else f"has the unit '{unit}', and '{needed}' is needed"


def conversion(base: BaseUnit | None, needed: BaseUnit | None) -> Conversion:
    """Conversion of values from one unit to the one needed, of the same dimension; none if one is unknown."""
    if base is None or needed is None:
        return UNCHANGED
    factor = base.factor / needed.factor
    offset = 0.0 if base.relative or needed.relative else (base.offset - needed.offset) / needed.factor
    return UNCHANGED if math.isclose(factor, 1.0, rel_tol=1e-9) and offset == 0.0 else Conversion(factor, offset)
