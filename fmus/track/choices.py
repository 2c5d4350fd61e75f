"""Kinds of tracks, choices of their parameters, and combinations that exclude each other; for scenes and tracks."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

INTEGRATORS = IMPLICIT, EXPLICIT, HHT, ADAMS, DORMAND_PRINCE = (
    "generalized_alpha", "runge_kutta", "hht", "adams", "dormand_prince",
)  # fmt: skip
BY_ERROR = ADAMS, DORMAND_PRINCE  # integrators that choose their steps by tolerances
EXPLICITLY = EXPLICIT, *BY_ERROR  # integrators that solve no equations of a step
EXPLICIT_NAMES = f"'{EXPLICIT}', '{ADAMS}' or '{DORMAND_PRINCE}'"
AXES = ("fixed", "free")
JOINTS = ELIMINATED, CONSTRAINED = "eliminated", "constrained"
COORDINATES = NODAL, CHOLESKY = "nodal", "cholesky"
FORMULATIONS = AUGMENTED, RECURSIVE = "augmented", "recursive"


class Element(NamedTuple):
    """Finite element of flexible links."""

    dofs: int  # coordinates of a link
    shared: int  # equations of a pin
    axes: tuple[int, ...] = (0, 1, 2)  # of space, that its vectors have
    solid: bool = False  # it has all strains of a solid, and its pins turn with the vehicle


ELEMENTS = {"cable": Element(12, 4), "planar": Element(8, 2, axes=(0, 2)), "beam": Element(24, 6, solid=True)}


class TrackKind(NamedTuple):
    """A kind of track; its functions take the parameters of its FMU by name."""

    fmu: str  # kind of component; its model and its shell are in the folder of this name, see ``components``
    links: str  # noun in sentences
    defaults: Mapping[str, Any]  # of the parameters that may exclude each other, or that not every kind has
    conflict: Callable[[Mapping[str, Any]], str | None]  # reason, a sentence, why they do; None for no conflict
    size: Callable[[Mapping[str, Any], int, int], str]  # bodies and equations of so many links and pins, in words
    wide: Callable[[Mapping[str, Any]], bool]  # True for contact points beside the middle of a link, and guides
    stressed: bool  # True if links have stress
    planar: Mapping[str, str] = {}  # values that motion in a plane needs; empty: there is none


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
        if p["integrator"] not in EXPLICITLY:
            return (
                f"coordinates = '{CHOLESKY}' needs integrator = {EXPLICIT_NAMES}, not '{p['integrator']}':"
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
    if p["formulation"] == RECURSIVE and p["integrator"] not in EXPLICITLY:
        return (
            f"formulation = '{RECURSIVE}' is integrated explicitly: integrator = '{p['integrator']}' must be"
            f" {EXPLICIT_NAMES}"
        )
    return None


def links_turn(p: Mapping[str, Any]) -> bool:
    """Whether flexible links turn with the vehicle."""
    return ELEMENTS[p["element"]].solid or p["axes"] == "free"


def size_of_links(p: Mapping[str, Any], links: int, pins: int) -> str:
    """Size of a chain of flexible links, in words."""
    element = ELEMENTS[p["element"]]
    size = f"{links} elements, {element.dofs * links - element.shared * pins} dofs"
    if p["joints"] == CONSTRAINED:
        size = f"{links} elements, {element.dofs * links} dofs and {element.shared * pins} equations of pins"
    size += " and 2 of their axes" if p["axes"] == "free" else ""
    return size + (", Cholesky coordinates" if p["coordinates"] == CHOLESKY else "")


def size_of_bodies(p: Mapping[str, Any], links: int, pins: int) -> str:
    """Size of a chain of rigid links, in words."""
    return f"{links} bodies, {pins} pins" + (", joint coordinates" if p["formulation"] == RECURSIVE else "")


IN_PLANE = {"element": "cable", "elasticity": "small_deformation", "axes": "fixed", "joints": ELIMINATED}
TRACKS = {  # by the name of the model in a scene
    "flexible": TrackKind(
        "TrackFlexible",
        "flexible links",
        {**IN_PLANE, "coordinates": NODAL, "integrator": IMPLICIT},
        conflict_of_links,
        size_of_links,
        links_turn,
        True,
        IN_PLANE,
    ),
    "rigid": TrackKind(
        "TrackRigid",
        "rigid links",
        {"formulation": AUGMENTED, "integrator": IMPLICIT},
        conflict_of_bodies,
        size_of_bodies,
        lambda p: True,
        False,
    ),
}


def models_with(parameter: str) -> list[str]:
    """Models whose FMU has a parameter: those with a default of it here; all, if none has one."""
    return [name for name, kind in TRACKS.items() if parameter in kind.defaults] or list(TRACKS)
