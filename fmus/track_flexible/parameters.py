"""FMI parameters of flexible links: kind of link, material, coordinates."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from fmus.interface.ports import NOT_NEGATIVE, POSITIVE, Port
from fmus.physics.ancf.element import ELASTICITIES
from fmus.track.choices import AXES, COORDINATES, JOINTS


def _choice(name: str, text: str, choices: Sequence[str]) -> Port:
    """String parameter with the first choice as its default."""
    return Port(name, "parameter", "1", text, choices[0], tuple(choices))


def link_kind_ports(elements: Sequence[str]) -> tuple[Port, ...]:
    """Element, axes and elasticity; ``elements``: names of the elements."""
    return (
        _choice(
            "element",
            "what a link is: cable, one axis and pins that keep their direction; planar, the cable without its"
            " lateral dofs; beam, all strains of a solid and pins that turn with the vehicle",
            elements,
        ),
        _choice(
            "axes",
            "in which cables have their coordinates: fixed, and the chain stays in its plane, or free, and it turns"
            " with the vehicle",
            AXES,
        ),
        _choice(
            "elasticity",
            "strains of cables: small_deformation, average strain and r_xx; general, Green strain and"
            " curvature; engineering, |r_x| - 1 and the angle turned per length",
            tuple(ELASTICITIES),
        ),
    )


def material_ports(table: Mapping[str, float]) -> tuple[Port, ...]:
    """Material parameters; ``table``: the vehicle's material."""
    young, tau = table["youngs_modulus"], table["relaxation_time"]
    text = "damping constants over Young's modulus"
    return (
        Port("material.youngs_modulus", "parameter", "Pa", "Young's modulus of the links", young, allowed=POSITIVE),
        Port("material.relaxation_time", "parameter", "s", text, tau, allowed=NOT_NEGATIVE),
    )


def coordinate_ports() -> tuple[Port, ...]:
    """Formulation of the pins, and coordinates of an explicit integrator."""
    return (
        _choice(
            "joints",
            "the pins of cables: eliminated, shared coordinates and no equations; constrained, coordinates of each"
            " link's own and equations with multipliers",
            JOINTS,
        ),
        _choice(
            "coordinates",
            "what an explicit integrator integrates: nodal coordinates, or Cholesky coordinates, whose mass matrix"
            " is the identity",
            COORDINATES,
        ),
    )
