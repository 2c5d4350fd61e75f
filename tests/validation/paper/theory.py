"""Rules that judge the statements about joints, elements, knots and elasticity (sections 1 to 7)."""

from __future__ import annotations

import math
from collections.abc import Callable

from orchestrator.studies import Row
from tests.validation.paper.models import CLOSED
from tests.validation.paper.results import NONE, Results, Verdict, graded

NEAR = 1e-3  # of a printed value


def equations(results: Results, *keys: str) -> list[Row]:
    """Rows of these equations, in this order; raises LookupError if one was not measured."""
    rows = {row.figures["key"]: row for row in results.of("equation")}
    return [rows[key] for key in keys]


def checked(results: Results, *keys: str, printed: float | None = None) -> Verdict:
    """Verdict "holds" if all these equations hold and, if given, yield the ``printed`` value."""
    try:
        rows = equations(results, *keys)
    except LookupError:
        return NONE
    good = [row.ok is True if printed is None else abs(row["value"] - printed) < NEAR for row in rows]
    return graded(good, "; ".join(f"{row.case}: {row['value']:.3g}" for row in rows))


def holding(*keys: str) -> Callable[[Results], Verdict]:
    """Rule by which all these equations have to hold."""
    return lambda results: checked(results, *keys)


positions = holding("cubic", "rigid")  # section 2: positions are S e
joint_equations = holding("spherical", "pin", "pin_beam", "sliding")  # sections 4.1 to 4.3
joint_modes = holding("deformations", "rotation", "continuous", "pin_stretch")  # 4.4: modes at a pin of beams
patch = holding("patch")  # 5.2: control points of a bicubic patch
# 5.3: a knot is one control point and three equations; no knot has the pin's four
knots = holding(*(f"removed_{m}" for m in (3, 2, 1)), "equations_cable", "pin_equations", "pin_knot")
# 5.4: a rigid corner is C0 like a spherical joint, with three more equations
corners = holding("spherical_equations", "spherical_knot", "rigid_equations", "rigid_weaker", "rigid_knot")
# 5.5: every knot that makes slopes continuous makes positions continuous too
sliding = holding(*(f"continuity_{m}" for m in (3, 2, 1)), "sliding_knot", "sliding_weaker")
coupled = holding("coupling", "models")  # 7.1: bending causes tension, and both models agree at small strains
undamped = holding("undamped")  # 7.2: rigid motion is undamped


def constant_inertia(results: Results) -> Verdict:
    """One mass matrix gives the kinetic energy of every motion; that of a cut rigid chain varies."""
    verdict, row = checked(results, "mass", "kinetic", "inertia"), results.first("singularity", CLOSED)
    if row is None or not row.ok or verdict is NONE:
        return verdict
    varies = max(row["cut"]) / min(row["cut"])
    return verdict._replace(
        measured=f"{verdict.measured}; condition of the mass, 2 to 8 s: ANCF mesh {row['mesh']:.0f} always, of a cut"
        f" rigid chain it varies by a factor of {varies:.2f}"
    )


def same_geometry(results: Results) -> Verdict:
    """Splines and elements are linked by exact linear maps in both directions; rational weights have none."""
    verdict = checked(results, "geometry")
    return verdict if verdict is NONE else verdict._replace(measured=f"{verdict.measured}; NURBS have no such map")


def cheaper(results: Results) -> Verdict:
    """Section 7.1: (11)-(15) cost less than (8)-(10)."""
    rows = results.of("elasticity", elasticity="general")
    text = ", ".join(f"{row['links']} links {row['evaluation']:.2f} and {row['step']:.2f}" for row in rows)
    good = [row[key] > 1.0 for row in rows for key in ("evaluation", "step") if math.isfinite(row[key])]
    return graded(good, f"CPU time of (8)-(10) over (11)-(15), of an evaluation and of an implicit step: {text}")


def constant_stiffness(results: Results) -> Verdict:
    """Below (15): K_e,t is constant, K_e,l is proportional to the strain."""
    return checked(results, "bending", "axial", printed=1.0)


def potential(results: Results) -> Verdict:
    """Below (12): the force of the printed mean strain is no gradient of (8); that of Green's strain is."""
    chord, green = checked(results, "chord", printed=0.0), checked(results, "green")
    return chord if chord is NONE else chord._replace(measured=f"{chord.measured}; {green.measured}")
