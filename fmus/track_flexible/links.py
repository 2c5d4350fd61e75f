"""Chains of cables or beams: their kinds, FMI parameters, and links from the vehicle's tables."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from fmus.interface.model import InvalidParameter
from fmus.interface.ports import NOT_NEGATIVE, POSITIVE, Port
from fmus.kernels.jit import implementation
from fmus.physics.ancf.cable import cable_arrays
from fmus.physics.ancf.element import ELASTICITIES
from fmus.physics.chain.bushing import Bushing
from fmus.physics.chain.flexible.closing import ClosingSpring
from fmus.physics.chain.flexible.inertia import LEAST_SHARE, second_moments
from fmus.track.choices import AXES, CHOLESKY, CONSTRAINED, COORDINATES, ELEMENTS, ELIMINATED, JOINTS, NODAL
from fmus.track.ports import PIN, SPRING

SHEAR = 5.0 / 6.0  # correction of a beam's shear stiffness, rectangular section


class ChainKind(NamedTuple):
    """Kind of a chain, which decides its kernels and the sizes of its arrays: the parameters of these names."""

    element: str = "cable"
    elasticity: str = "small_deformation"
    axes: str = "fixed"
    closure: str = PIN
    joints: str = ELIMINATED
    coordinates: str = NODAL

    def at_start(self) -> ChainKind:
        """Kind in which the chain starts: equilibrium is compiled for no other joints and coordinates."""
        return self._replace(joints=ELIMINATED, coordinates=NODAL)


class Material(NamedTuple):
    """Material of flexible links."""

    young: float  # Young's modulus, Pa
    tau: float  # damping constants over Young's modulus, s


def chain_kind(p: Mapping[str, Any]) -> ChainKind:
    """Kind of the chain with the FMI parameters ``p``; an open one has no closure."""
    return ChainKind(**{name: p[name] for name in ChainKind._fields if name in p})


def mesh_size(kind: ChainKind, links: int, closed: bool) -> int:
    """Number of pins of the mesh: one more with a closing spring, 2 a link with constrained joints."""
    return 2 * links if kind.joints == CONSTRAINED else links + (not closed or kind.closure == SPRING)


def chain_links(
    kind: ChainKind,
    vehicle: Mapping[str, Any],
    links: int,
    closed: bool,
    material: Material,
    closing: ClosingSpring | None,
    bushing: Bushing | None = None,
) -> Any:
    """Parameters of the links of a chain, of the class of its kind; raises InvalidParameter."""
    make = _beams if ELEMENTS[kind.element].solid else _cables
    made = make(kind, vehicle, (links, int(closed)), material, closing)._replace(bushing=bushing)
    if kind.coordinates != CHOLESKY:
        return made
    from fmus.physics.chain.flexible.cholesky import cholesky_links

    kit = implementation("elements")(type(made))
    layout = kit.BUSHED if bushing else kit.LAYOUT
    return cholesky_links(made, len(layout.own), (mesh_size(kind, links, closed), len(layout.shared)))


def _cables(
    kind: ChainKind,
    vehicle: Mapping[str, Any],
    size: tuple[int, int],
    material: Material,
    closing: ClosingSpring | None,
) -> Any:
    section, track, (young, tau) = vehicle["section"], vehicle["track"], material
    pitch, area, second = float(track["pitch"]), section["area"], section["bending"]
    cable = ELASTICITIES[kind.elasticity](
        pitch,
        track["mass"] / pitch,
        young * area,
        young * second,
        tau * (young * area),
        tau * (young * second),
        ELEMENTS[kind.element].axes,
        _rotary_of_cables(track, pitch),
        cable_arrays(),
    )
    common = *size, cable, track["face"], section["outer_fibre"], area, second
    if kind.axes != "free":
        return _class_of_cables(kind)(*common, closing)
    from fmus.physics.chain.flexible.turning import TurningCables

    across = second_moments(track["inertia"])[1]
    if across <= 0.0:
        raise _inertia_error(track["inertia"], 1)
    lateral_bending, twist = young * (section["lateral_bending"] - second), size[0] * across
    return TurningCables(*common, 0.25 * track["width"], lateral_bending, twist, closing)


def _class_of_cables(kind: ChainKind) -> type:
    """Class of cables whose axes are fixed; its module alone is imported."""
    if kind.element == "planar":
        from fmus.physics.chain.flexible.planar import PlanarCables

        return PlanarCables
    if kind.joints == CONSTRAINED:
        from fmus.physics.chain.flexible.constrained import ConstrainedCables

        return ConstrainedCables
    from fmus.physics.chain.flexible.cables import Cables

    return Cables


def _beams(
    kind: ChainKind,
    vehicle: Mapping[str, Any],
    size: tuple[int, int],
    material: Material,
    closing: ClosingSpring | None,
) -> Any:
    """Beams with a rectangle of the section's radii of gyration, moduli scaled to its area, a link's mass."""
    from fmus.physics.ancf.beam import Beam, beam_arrays
    from fmus.physics.chain.flexible.beams import Beams

    s, m, track, (young, tau) = vehicle["section"], vehicle["material"], vehicle["track"], material
    poisson = 0.5 * m["youngs_modulus"] / m["shear_modulus"] - 1.0
    if not 0.0 <= poisson < 0.5:
        raise InvalidParameter(
            f"material.shear_modulus = {m['shear_modulus']}: with the vehicle's Young's modulus it makes"
            f" Poisson's ratio {poisson:.3g}, of a beam 0 or more and below 0.5"
        )
    pitch = float(track["pitch"])
    width, height = (np.sqrt(12.0 * s[key] / s["area"]) for key in ("lateral_bending", "bending"))
    scale = s["area"] / (width * height)
    rho, twist = track["mass"] / (pitch * width * height), s["torsion"] / (s["bending"] + s["lateral_bending"])
    more = _rotary_of_beams(track, (pitch, width, height))
    beam = Beam(pitch, width, height, rho, scale * young, poisson, SHEAR, twist, True, tau, more, beam_arrays())
    return Beams(*size, beam, track["face"], 0.25 * track["width"], s["outer_fibre"], s["area"], young, closing)


def _rotary_of_cables(track: Mapping[str, Any], pitch: float) -> float:
    """Inertia of a link about its pin less that of a rod, kg m2; raises InvalidParameter."""
    mass, pin = track["mass"], track["inertia"][1]
    rod, least = mass * pitch**2 / 12.0, LEAST_SHARE
    if pin < least * rod:
        raise InvalidParameter(
            f"vehicle.track.inertia[1] = {pin:g} kg m2, about the pin: must be at least {least:g} of a rod's of"
            f" {mass:g} kg and {pitch:g} m, {least * rod:.6g} kg m2, or a cable's mass matrix is singular"
        )
    return float(pin - rod)


def _rotary_of_beams(track: Mapping[str, Any], sizes: tuple[float, float, float]) -> tuple[float, float, float]:
    """Second moments of a link's mass less those of a beam of ``sizes``, m, kg m2; raises InvalidParameter."""
    mass, moments = track["mass"], second_moments(track["inertia"])
    section_moments = tuple(float(mass * size * size / 12.0) for size in sizes)
    for axis, (moment, section) in enumerate(zip(moments, section_moments, strict=True)):
        if moment < LEAST_SHARE * section:
            raise _inertia_error(track["inertia"], axis)
    x, y, z = (moment - section for moment, section in zip(moments, section_moments, strict=True))
    return x, y, z


def _inertia_error(inertia: Sequence[float], axis: int) -> InvalidParameter:
    """Error for an ``inertia`` that no body has about the ``axis`` (0 to 2) of a link."""
    return InvalidParameter(
        f"vehicle.track.inertia[{axis}] = {inertia[axis]:g} kg m2: must be less than the sum of the other two,"
        f" {sum(inertia) - inertia[axis]:g} kg m2 (no body has more), or the chain's mass matrix is not positive"
        " definite"
    )


def _choice(name: str, text: str, choices: Sequence[str]) -> Port:
    """String parameter with the first choice as its default."""
    return Port(name, "parameter", "1", text, choices[0], tuple(choices))


def link_kind_ports() -> tuple[Port, ...]:
    """Element, axes and elasticity."""
    return (
        _choice(
            "element",
            "what a link is: cable, one axis and pins that keep their direction; planar, the cable without its"
            " lateral dofs; beam, all strains of a solid and pins that turn with the vehicle",
            tuple(ELEMENTS),
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
