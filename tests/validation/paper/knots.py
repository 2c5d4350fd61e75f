"""Section 5: joints that knots of B-splines make, and equations of the joints of section 4, by ranks."""

from __future__ import annotations

import numpy as np
from scipy.interpolate import BSpline

from orchestrator.studies import Row
from tests.validation.ancf import bspline

SAME = 1e-12  # relative difference of two descriptions of one curve


def rows() -> list[Row]:
    """Rows as in ``equations``; the knot is 0 for a joint that no knot makes."""
    facts = [
        ("5.2", "patch", "control points of a bicubic surface, the least (7)", bspline.patch_points(8, 8), 16),
        *(("5.5", f"continuity_{m}", f"degree of continuity at a knot of multiplicity {m}", continuity(m), 3 - m)
          for m in (3, 2, 1)),
        *(("5.3", f"removed_{m}", f"control points that a knot less than {m + 1} takes away",
           points(m + 1) - points(m), 1) for m in (3, 2, 1)),
        *(("5.3", f"equations_{element}", f"scalar equations of a knot less, {element}",
           len(bspline.knot_rows(2, element)) - len(bspline.knot_rows(3, element)), expected)
          for element, expected in (("cable", 3), ("beam", 9))),
        *(fact for demand in bspline.table() if demand.element == "cable" for fact in _demanded(demand)),
    ]  # fmt: skip
    made = [
        Row("equation", text, {"where": where, "key": key, "value": value, "reference": reference}, value == reference)
        for where, key, text, value, reference in facts
    ]
    apart = there_and_back()
    text = "the same curve as B-spline and as cable elements: largest difference, of its size"
    return [
        *made,
        Row("equation", text, {"where": "5", "key": "geometry", "value": apart, "reference": 0.0}, apart < SAME),
    ]


WHERE = {"sliding": "5.5", "rigid": "5.4"}  # other joints: 5.3


def _demanded(demand: bspline.Demand) -> list[tuple[str, str, str, int, int]]:
    """Facts of a joint between cables: its equations and its knot."""
    name, (equations, knot, weaker, _) = demand.joint, bspline.EXPECTED["cable", demand.joint]
    where = WHERE.get(name, "5.3")
    return [
        (where, f"{name}_equations", f"equations of the {name} joint of cables", demand.equations, equations),
        (where, f"{name}_knot", "the knot that imposes exactly these, 0: none", demand.knot or 0, knot or 0),
        (where, f"{name}_weaker", "the smallest knot that imposes none but these (4: no equation)", demand.weaker,
         weaker),
    ]  # fmt: skip


def spline(multiplicity: int) -> BSpline:
    """Clamped cubic in space with one inner knot of this multiplicity and arbitrary control points."""
    knots = np.repeat([0.0, 0.7, 1.6], [4, multiplicity, 4])
    return BSpline(knots, np.random.default_rng(multiplicity).standard_normal((len(knots) - 4, 3)), bspline.DEGREE)


def continuity(multiplicity: int) -> int:
    """Continuity of that curve's cable elements at their common node, by their derivatives."""
    return bspline.DEGREE - int(bspline.multiplicities(*bspline.to_cable(spline(multiplicity)))[0])


def points(multiplicity: int) -> int:
    """Number of control points."""
    return bspline.control_points(len(spline(multiplicity).t))


def there_and_back() -> float:
    """Largest relative difference of control points after conversion to cable elements and back."""
    apart = []
    for multiplicity in (1, 2, 3):
        curve = spline(multiplicity)
        back = bspline.from_cable(*bspline.to_cable(curve))
        apart.append(float(np.abs(back.c - curve.c).max() / np.abs(curve.c).max()))
    return max(apart)
