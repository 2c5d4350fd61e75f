"""Units of FMUs in SI base units, as their model descriptions define them."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

QUANTITIES = ("kg", "m", "s", "A", "K", "mol", "cd")  # an angle has no dimension


class BaseUnit(NamedTuple):
    """A unit in SI base units: value in base units = factor * value + offset."""

    exponents: tuple[float, ...]  # of QUANTITIES
    factor: float = 1.0
    offset: float = 0.0


def base_unit(description: Any, unit: str | None) -> BaseUnit | None:
    """Unit in base units by a model description of fmpy; None if it does not define it."""
    for definition in description.unitDefinitions:
        base = definition.baseUnit
        if definition.name == unit and base is not None and 0.0 < base.factor < math.inf:
            return BaseUnit(tuple(float(getattr(base, each)) for each in QUANTITIES), base.factor, base.offset)
    return None


def difference(unit: str, base: BaseUnit | None, needed: str, needed_base: BaseUnit | None) -> str:
    """Words on how the unit of a variable differs from the one needed; empty if values mean the same."""
    if base is None or needed_base is None:
        undefined = "" if base is not None else ", which the FMU does not define"
        return "" if unit == needed else f"has the unit '{unit}'{undefined}, and '{needed}' is needed"
    if base.exponents != needed_base.exponents:
        return f"has the unit '{unit}', and '{needed}' is needed"
    factor, offset = base.factor / needed_base.factor, base.offset - needed_base.offset
    if math.isclose(factor, 1.0, rel_tol=1e-9) and offset == 0.0:
        return ""
    shift = f" and an offset of {offset:g}" if offset else ""
    return f"has the unit '{unit}', which is {factor:.9g} '{needed}'{shift}: values are not converted"
