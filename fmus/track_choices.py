"""Choices of a track's parameters, and combinations that exclude each other; for scenes and tracks."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

INTEGRATORS = IMPLICIT, EXPLICIT, HHT, ADAMS = "generalized_alpha", "runge_kutta", "hht", "adams"
AXES = ("fixed", "free")
JOINTS = ELIMINATED, CONSTRAINED = "eliminated", "constrained"
COORDINATES = NODAL, CHOLESKY = "nodal", "cholesky"
FORMULATIONS = AUGMENTED, RECURSIVE = "augmented", "recursive"
DEFAULTS = {  # of the parameters that may exclude each other, by model
    "flexible": {
        "element": "cable", "elasticity": "small_deformation", "axes": "fixed", "joints": ELIMINATED,
        "coordinates": NODAL, "integrator": IMPLICIT,
    },
    "rigid": {"formulation": AUGMENTED, "integrator": IMPLICIT},
}  # fmt: skip


def conflict_of_links(p: Mapping[str, Any]) -> str | None:
    """Reason, a sentence, why these parameters of flexible links exclude each other; None for no conflict."""
    element, elasticity, axes, joints = p["element"], p["elasticity"], p["axes"], p["joints"]
    if element != "cable" and elasticity != "small_deformation":
        return f"elasticity = '{elasticity}' needs element = 'cable': a {element} has but one"
    if axes == "free" and element != "cable":
        return f"axes = 'free' needs element = 'cable': a {element} has no use for them"
    if joints == CONSTRAINED and (element != "cable" or axes != "fixed"):
        return f"joints = '{CONSTRAINED}' needs element = 'cable' and axes = 'fixed', not '{element}' and '{axes}'"
    if p["coordinates"] == CHOLESKY:
        if p["integrator"] not in (EXPLICIT, ADAMS):
            return (
                f"coordinates = '{CHOLESKY}' needs integrator = '{EXPLICIT}' or '{ADAMS}', not '{p['integrator']}':"
                " an implicit step factors another matrix than the mass"
            )
        if axes != "fixed" or joints != ELIMINATED:
            return (
                f"coordinates = '{CHOLESKY}' needs axes = 'fixed' and joints = '{ELIMINATED}', not '{axes}' and"
                f" '{joints}': only then is there a constant mass matrix and no equation"
            )
    return None


def conflict_of_bodies(p: Mapping[str, Any]) -> str | None:
    """Reason, a sentence, why these parameters of rigid links exclude each other; None for no conflict."""
    if p["formulation"] == RECURSIVE and p["integrator"] not in (EXPLICIT, ADAMS):
        return (
            f"formulation = '{RECURSIVE}' is integrated explicitly: integrator = '{p['integrator']}' must be"
            f" '{EXPLICIT}' or '{ADAMS}'"
        )
    return None
