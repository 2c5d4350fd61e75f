"""FMI variables of the components: names, causalities, units, signs.

World frame: x forward, y left, z up (ISO 8855). Quaternions are (w, x, y, z), body to world.
A wrench acts *on* the wheel, about its centre, in world axes, and is the mean over the step just done.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import inf, pi
from typing import NamedTuple

from fmus.interface.units import BASES, read


class Range(NamedTuple):
    """Allowed values of a Real parameter."""

    least: float = -inf
    most: float = inf
    text: str = "a finite number"  # "name = value: must be ..."


ANY = Range()
POSITIVE, NOT_NEGATIVE = Range(5e-324, inf, "greater than 0"), Range(0.0, inf, "0 or more")
# ranges of the keys of scenes
PLACE = Range(-1e6, 1e6, "between -1e6 and 1e6")
SPIN, TORQUE = Range(-1e5, 1e5, "between -1e5 and 1e5"), Range(-1e11, 1e11, "between -1e11 and 1e11")
TORQUE_LIMIT = 20000.0  # of a motor by default, N m
BRAKE = Range(0.0, 1e11, "between 0 and 1e11")

# Error of an internal step of variable length, relative and in SI units: default and allowed values.
TOLERANCE, TOLERANCES = 1e-6, Range(1e-13, 0.1, "between 1e-13 and 0.1")


class Port(NamedTuple):
    """FMI scalar variable; the type of ``start`` (float, int, str) is the type of the variable."""

    name: str  # FMI structured name
    causality: str  # "input", "output", "parameter" (fixed, set before initialisation) or "local"
    unit: str  # a key of UNITS; "1" for none
    text: str  # description, one sentence without a full stop
    start: float | int | str = 0.0
    choices: tuple[str, ...] = ()  # allowed values of a String parameter
    allowed: Range = ANY  # values of a Real parameter


def field_of(name: str) -> str:
    """Field of a kernel's parameters that has the number of a parameter ``name``."""
    return name.replace(".", "_")


# Addresses of contiguous doubles in memory: named as in the packaging of the Open Simulation Interface (OSMP, "binary
# variables") for FMI 2.0, which has no arrays.
LINKS_ARRAY = (
    Port("links.base.lo", "local", "1", "lower 32 bits of the address at which the link outputs lie", 0),
    Port("links.base.hi", "local", "1", "upper 32 bits of it; what lies there is good until the next step", 0),
    Port("links.size", "local", "1", "bytes of the link outputs", 0),
)
REALS_ARRAY = (
    Port("reals.base.lo", "local", "1", "lower 32 bits of the address at which all Reals lie by value reference", 0),
    Port("reals.base.hi", "local", "1", "upper 32 bits of it; inputs may be written there between steps", 0),
    Port("reals.size", "local", "1", "bytes of the Reals", 0),
)
STATUS = Port("status", "output", "1", "0 ok, 1 the last step warned, 3 the last call failed", 0)


def enumeration_value(port: Port) -> int:
    """Number of the chosen text of a String with choices, from 1."""
    return 1 + port.choices.index(str(port.start))


class Variables(NamedTuple):
    """Variables of a component; the index in ``row`` is the value reference, and the FMI index less one."""

    reals: tuple[Port, ...]  # inputs, outputs (link outputs last), parameters
    integers: tuple[Port, ...]  # counters, status, parameters
    strings: tuple[Port, ...]

    @property
    def row(self) -> tuple[Port, ...]:
        """All variables in the order of their value references."""
        return (*self.reals, *self.integers, *self.strings)


def variables(ports: Sequence[Port]) -> Variables:
    """Variables of a model's ports, in the order of their value references."""

    def pick(causality: str, kind: type) -> list[Port]:
        return [port for port in ports if port.causality == causality and isinstance(port.start, kind)]

    return Variables(
        (*pick("input", float), *pick("output", float), *pick("parameter", float)),
        (*pick("output", int), STATUS, *pick("parameter", int)),
        tuple(pick("parameter", str)),
    )


# unit -> exponents of SI base units, for modelDescription.xml
UNITS: dict[str, dict[str, int]] = {
    name: {base: power for base, power in zip(BASES, read(name).exponents, strict=True) if power}
    for name in (
        *("1", "m", "1/m", "1/Pa", "1/s", "m/s", "m/s2", "rad", "rad/s", "m2", "m3", "m4", "kg", "kg.m2", "kg/m3", "s"),
        *("N", "N.m", "N/m", "N.m/rad", "N.s/m", "N.m.s/rad", "W", "J", "Pa", "Pa.s", "Pa/m", "Pa/m2", "Pa.s/m"),
        "N.m2",
    )
}

# unit -> nominal value of inputs and outputs, for modelDescription.xml; 1 for the other units
NOMINAL = {"N": 1e4, "N.m": 1e3, "J": 1e4, "Pa": 1e7, "W": 1e4}

# type of a Real -> unit, unit to show, and how many of these are one of the unit, for modelDescription.xml
TYPES: dict[str, tuple[str, str, float]] = {
    "Length": ("m", "", 1.0),
    "Velocity": ("m/s", "", 1.0),
    "Speed": ("m/s", "km/h", 3.6),
    "Acceleration": ("m/s2", "", 1.0),
    "Angle": ("rad", "deg", 180.0 / pi),
    "AngularVelocity": ("rad/s", "deg/s", 180.0 / pi),
    "RotationalSpeed": ("rad/s", "rpm", 30.0 / pi),
    "Mass": ("kg", "", 1.0),
    "MomentOfInertia": ("kg.m2", "", 1.0),
    "Time": ("s", "", 1.0),
    "Force": ("N", "kN", 1e-3),
    "Torque": ("N.m", "kN.m", 1e-3),
    "Stiffness": ("N/m", "kN/m", 1e-3),
    "Damping": ("N.s/m", "kN.s/m", 1e-3),
    "Power": ("W", "kW", 1e-3),
    "Energy": ("J", "kJ", 1e-3),
    "Stress": ("Pa", "MPa", 1e-6),
}
# bodies that turn with the hull
NOT_SPUN = ("chassis.", "mount.", "left.mount.", "right.mount.", "hitch.", "seat.", "body_rate.")


def type_of(port: Port) -> str:
    """Type of a Real in ``TYPES``; empty if it has none."""
    if port.unit == "rad/s":
        return "AngularVelocity" if port.name.startswith(NOT_SPUN) else "RotationalSpeed"
    if port.unit == "m/s":
        return "Speed" if "speed" in port.name else "Velocity"
    return next((name for name, (unit, _, _) in TYPES.items() if unit == port.unit), "")


# Number of variables of the two connectors.
STATE = 13  # position 3, orientation 4, velocity 3, angular velocity 3
WRENCH = 6  # force 3, torque 3


def motion_ports(
    name: str, causality: str, start: tuple[float, ...] = (0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0)
) -> list[Port]:
    """The 13 variables of the motion of a wheel (or mount) in the world frame, m, m/s, rad/s.

    ``start``: start values of position and quaternion; velocities start at 0.
    """
    centre = [
        Port(f"{name}.position.{axis}", causality, "m", f"{axis} of the centre of {name}, world", place)
        for axis, place in zip("xyz", start[:3], strict=True)
    ]
    orientation = [
        Port(
            f"{name}.orientation.{part}",
            causality,
            "1",
            f"{part} of the quaternion of {name}, body to world",
            turn,
        )
        for part, turn in zip("wxyz", start[3:7], strict=True)
    ]
    velocity = [
        Port(f"{name}.velocity.{axis}", causality, "m/s", f"{axis} velocity of the centre of {name}, world")
        for axis in "xyz"
    ]
    angular = [
        Port(f"{name}.angular_velocity.{axis}", causality, "rad/s", f"{axis} angular velocity of {name}, world")
        for axis in "xyz"
    ]
    return centre + orientation + velocity + angular


def wrench_ports(name: str, causality: str) -> list[Port]:
    """The 6 variables of the mean wrench on a wheel (or mount) about its centre, world axes, N, N m."""
    force = [
        Port(f"{name}.force.{axis}", causality, "N", f"{axis} force on {name}, world, mean over the step")
        for axis in "xyz"
    ]
    torque = [
        Port(
            f"{name}.torque.{axis}",
            causality,
            "N.m",
            f"{axis} torque on {name} about its centre, world, mean over the step",
        )
        for axis in "xyz"
    ]
    return force + torque


def start_pose_ports() -> list[Port]:
    """Parameters of the vehicle's pose at the start: set alike on every component that has a place."""
    return [
        *(
            Port(
                f"start.position.{axis}",
                "parameter",
                "m",
                f"{axis} of the sprocket axle line's middle at the start, world",
                allowed=PLACE,
            )
            for axis in "xyz"
        ),
        Port("start.heading", "parameter", "rad", "heading of the vehicle at the start, about z"),
        Port(
            "start.height", "parameter", "m", "height of the vehicle over its drawn place on the ground", allowed=PLACE
        ),
        Port("start.pitch", "parameter", "rad", "pitch of the vehicle at the start, about its sprocket axle"),
        Port("start.slope.pitch", "parameter", "rad", "pitch of the ground at the start, downhill ahead is positive"),
        Port("start.slope.roll", "parameter", "rad", "roll of that ground, downhill to the right is positive"),
    ]
