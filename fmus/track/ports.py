"""Ports of a track: motions of the wheels, wrenches on them, outputs of the chain, parameters.

The parameters are those of the start, of contacts, of the integrators, and of the closure of a loop by a pin or, as in
paper 8.1, a stiff spring.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from fmus.interface.defaults import configured_ports
from fmus.interface.model import InvalidParameter
from fmus.interface.ports import (
    NOT_NEGATIVE,
    POSITIVE,
    TOLERANCE,
    TOLERANCES,
    Port,
    Range,
    motion_ports,
    start_pose_ports,
    wrench_ports,
)
from fmus.kernels.jit import plain
from fmus.physics.integrate import generalized_alpha, hht
from fmus.physics.integrate.generalized_alpha import GeneralizedAlpha
from fmus.start import Stance, part_at_rest, stance, start_pose
from fmus.track.choices import HHT, INTEGRATORS
from fmus.track.link_outputs import INTERVAL

# Outputs of a chain after the wrenches, in the order of its report (``chain.report``): name, unit, text.
OUTPUTS = (
    ("travel", "m", "length of chain that has passed a point of the vehicle, along its own index"),
    ("speed", "m/s", "speed of the chain along itself, seen from the vehicle, mean of its straight runs"),
    ("tension.min", "N", "smallest link tension"),
    ("tension.mean", "N", "mean link tension"),
    ("tension.max", "N", "largest link tension"),
    ("stress.max", "Pa", "largest axial stress at an outer fibre, 0 for rigid links"),
    ("energy.kinetic", "J", "kinetic energy of the links"),
    ("energy.strain", "J", "strain energy of the links, of bushes and of a closing spring"),
    ("energy.gravity", "J", "potential energy of the links over the origin of the start frame"),
    ("energy.contact", "J", "energy stored in contact springs"),
    ("energy.dissipated", "J", "energy lost by friction and damping, the sum of its causes"),
    ("energy.work", "J", "work done so far by the loads on the ends"),
    ("penetration.max", "m", "deepest penetration of any contact"),
    ("ground.force.x", "N", "force of the ground on the chain, x, world, mean over the step"),
    ("ground.force.y", "N", "force of the ground on the chain, y, world, mean over the step"),
    ("ground.force.z", "N", "force of the ground on the chain, z, world, mean over the step"),
    (
        "slip",
        "m/s",
        "rearward velocity of the ground contact points along the vehicle's present heading, weighted by their load",
    ),
    ("energy.covered", "J", "energy lost so far as spread contacts come to cover other parts of a link"),
    ("energy.dissipated.ground_friction", "J", "energy lost by friction of links on the ground"),
    ("energy.dissipated.ground_damping", "J", "energy lost by normal damping of the ground"),
    ("energy.dissipated.wheel_friction", "J", "energy lost by friction of links on rims"),
    ("energy.dissipated.wheel_damping", "J", "energy lost by normal damping of rims"),
    ("energy.dissipated.tooth_friction", "J", "energy lost by friction of pins on teeth"),
    ("energy.dissipated.tooth_damping", "J", "energy lost by normal damping of teeth"),
    ("energy.dissipated.guides", "J", "energy lost by friction and damping of guide horns on wheels"),
    ("energy.dissipated.material", "J", "energy lost by damping of the material of links"),
    (
        "energy.dissipated.joints",
        "J",
        "energy lost by damping of pins across the chain, of bushes and of a closing spring",
    ),
    ("energy.dissipated.pins", "J", "energy lost by friction in bushed pins, which is the work of their wear"),
)
ON_SOIL = {  # texts of outputs that are others on soil
    "penetration.max": "deepest penetration of a contact with a wheel or a tooth",
    "energy.contact": "energy stored in contact springs and in sheared and pressed soil",
    "energy.dissipated.ground_friction": "energy lost by shear of the soil",
    "energy.dissipated.ground_damping": "energy lost by compaction and normal damping of the soil",
}
INTERVALS = Range(1.0, 1e6, "a whole number from 1 to 1e6")
STARTS = {
    "rest": "static equilibrium, of a loop that spins relative to its turning",
    "polygon": "as laid out",
    "displaced": "equilibrium of ends 0.7 S apart, its link angles scaled to the span",
    "straight": "level, along x",
    "folded": "down, one link across, and up again",
}
# starts of a chain by the kind of its ends; of a loop and of a chain that is pulled: OTHER_STARTS
STARTS_OF_ENDS = {"pinned": ("rest", "polygon", "displaced"), "held": ("straight", "folded")}
OTHER_STARTS = "rest", "polygon"
SOLVER = "steps", "evaluations", "iterations", "rejected"
CLOSURES = PIN, SPRING = "pin", "spring"
STIFFNESS, DAMPING = 1e9, 1e4  # of a spring that closes a loop, N/m and N s/m


def start_stance(wheel: Mapping[str, Any]) -> Stance:
    """Stance of a wheel of a track's config at the start, y from the track plane; as drawn by default."""
    x, z = wheel["position"]
    return stance(wheel.get("start", (x, 0.0, z)))


def track_ports(
    config: Mapping[str, Any], wheels: Sequence[Mapping[str, Any]], link_ports: Sequence[Port]
) -> tuple[Port, ...]:
    """Ports of a track from its config, its ``wheels`` as drawn and the outputs of its links.

    A kind of links adds its own parameters.
    """
    vehicle, track = config["vehicle"], config["track"]
    text = "lateral position of the track plane in the vehicle, left positive"
    pose_ports = [*start_pose_ports(), Port("start.lateral", "parameter", "m", text, vehicle["track"]["lateral"])]
    pose_values = {port.name: port.start for port in configured_ports(pose_ports, config)}
    pose, lateral = start_pose(pose_values), float(pose_values["start.lateral"])
    ports: list[Port] = []
    for wheel in wheels:
        x, y, *rest = start_stance(wheel)
        ports += motion_ports(wheel["name"], "input", plain(part_at_rest)(pose, stance((x, y + lateral, *rest))))
    for wheel in wheels:
        ports += wrench_ports(wheel["name"], "output")
    other = ON_SOIL if track.get("soil") else {}
    ports += [Port(name, "output", unit, other.get(name, text)) for name, unit, text in OUTPUTS]
    ports += link_ports
    ports += [Port(f"solver.{name}", "output", "1", f"{name} of the integrator so far", 0) for name in SOLVER]
    return (*ports, *pose_ports, *_start_ports(track), *_step_ports(), *_contact_ports(vehicle, track, wheels))


def _start_ports(track: Mapping[str, Any]) -> Iterator[Port]:
    """Layout of the chain at the start, and the turning of a loop without wheels."""
    starts = STARTS_OF_ENDS.get(track["ends"]["kind"] if track.get("ends") else "", OTHER_STARTS)
    text = "; ".join(f"{start}: {STARTS[start]}" for start in starts)
    yield Port("start", "parameter", "1", text, starts[0], starts)
    if track["closed"] and not track["wheels"]:
        yield Port("start.spin", "parameter", "rad/s", "turning of the loop about y at the start")
        text = "turning of links by this times cos(2 angle) at the start besides: the loop becomes oval"
        yield Port("start.ovalling", "parameter", "rad/s", text)


def _step_ports() -> Iterator[Port]:
    """Integrator, its step, and the interval of means."""
    yield Port("integrator", "parameter", "1", "time integration of the chain", INTEGRATORS[0], INTEGRATORS)
    yield Port("step", "parameter", "s", "largest internal step", 1e-3, allowed=POSITIVE)
    text = "communication steps over which forces, sliding and depth of links are means, a whole number"
    yield Port(INTERVAL, "parameter", "1", text, 1.0, allowed=INTERVALS)


def _contact_ports(
    vehicle: Mapping[str, Any], track: Mapping[str, Any], wheels: Sequence[Mapping[str, Any]]
) -> Iterator[Port]:
    """Laws of what the chain may touch."""
    kinds = {wheel["kind"] for wheel in wheels}
    hard = bool(track["ground"]) and not track.get("soil")
    existing = {"sprocket": bool(kinds - {"rim"}), "wheel": bool(kinds), "ground": hard}
    for pair in (pair for pair, exists in existing.items() if exists):
        from fmus.physics.contact.laws import LAWS  # of chains that touch something

        law, text = vehicle["contact"][pair], f"normal law of {pair} contact"
        yield Port(f"contact.{pair}.law", "parameter", "1", text, law["law"], tuple(LAWS))
        for key, unit, text, allowed in (
            ("stiffness", "N/m", "normal stiffness", NOT_NEGATIVE),
            ("damping", "N.s/m", "normal damping", NOT_NEGATIVE),
            ("friction", "1", "friction coefficient", NOT_NEGATIVE),
            ("friction_velocity", "m/s", "regularisation velocity of friction", POSITIVE),
        ):
            name, text = f"contact.{pair}.{key}", f"{text} of {pair} contact"
            yield Port(name, "parameter", unit, text, law[key], allowed=allowed)


def closure_ports() -> tuple[Port, ...]:
    """Parameters of a closed chain."""
    text = "of the spring that closes a chain with closure = 'spring'"
    return (
        Port(
            "closure",
            "parameter",
            "1",
            "how the loop is closed: pin, by the last pin as by all others; spring, by a stiff spring at a cut there",
            PIN,
            CLOSURES,
        ),
        Port("closure.stiffness", "parameter", "N/m", f"stiffness {text}", STIFFNESS, allowed=POSITIVE),
        Port("closure.damping", "parameter", "N.s/m", f"damping {text}", DAMPING, allowed=NOT_NEGATIVE),
    )


def integrator_ports() -> tuple[Port, ...]:
    """Parameters of the integrators of links."""
    text = f"of generalised-alpha at infinite frequency, 0 to 1; of hht {hht.LEAST:g} to 1"
    return (
        Port("spectral_radius", "parameter", "1", text, 0.4, allowed=Range(0.0, 1.0, "between 0 and 1")),
        *(
            Port(f"adams.{name}", "parameter", "1", text, TOLERANCE, allowed=TOLERANCES)
            for name, text in (
                ("rtol", "relative error of a step of integrator = adams or dormand_prince"),
                ("atol", "absolute error of such a step, in m, rad, m/s and rad/s"),
            )
        ),
    )


def integrator_coefficients(p: Mapping[str, Any]) -> GeneralizedAlpha:
    """Coefficients of the implicit integrator that the parameters choose; raises InvalidParameter."""
    radius = p["spectral_radius"]
    if p["integrator"] != HHT:
        coefficients: GeneralizedAlpha = generalized_alpha.coefficients(radius)
    elif radius < hht.LEAST:
        raise InvalidParameter(f"spectral_radius = {radius:g}: integrator = '{HHT}' has {hht.LEAST:g} to 1")
    else:
        coefficients = hht.coefficients(radius)
    return coefficients
