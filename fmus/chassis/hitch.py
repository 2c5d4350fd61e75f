"""Hitch: a point of the hull on which a towed load and an input force act. Imported only where a scene tows.

The load pulls rearward, along the horizontal part of the chassis' x axis, with a constant force plus one over the speed
of the hitch, both times a half-cosine ramp. Equation numbers: README.md of this folder.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from fmus.interface.model import InvalidParameter
from fmus.interface.ports import Port
from fmus.interface.profile import Profile, evaluate, has_points, parse_profile, ramp
from fmus.kernels.jit import kernel
from fmus.physics.arrays import Floats, Matrix, Vector
from fmus.physics.vector import add, cross, dot, put, scale, to_body, to_world, vector

STATES = 2  # in the state of the chassis: time, s; work of the hull on what it tows, J
UPRIGHT = 1e-3  # horizontal part of the x axis below which the chassis stands on end and the load has no direction


class Hitch(NamedTuple):
    """Hitch of a chassis."""

    place: tuple[float, float, float]  # from O, in B, m
    first_input: int  # index of the input force
    state: int  # index in the state of the chassis, see STATES
    force: float  # constant part of the load, N, rearward
    drag: Profile  # load over the speed of the hitch, m/s, N
    ramp_start: float  # s
    ramp_end: float  # s
    speed_start: float = 0.0  # share of the load before the ramp; these two have the names of ``profile.ramp``
    speed_end: float = 1.0  # share of the load after the ramp


def input_ports() -> list[Port]:
    """Force that another component exerts."""
    text = "force on the hitch, world, mean over the step"
    return [Port(f"hitch.force.{axis}", "input", "N", f"{axis} {text}") for axis in "xyz"]


def output_ports() -> list[Port]:
    """Motion of the hitch, its load and its work."""
    return [
        *(Port(f"hitch.position.{axis}", "output", "m", f"{axis} of the hitch, world") for axis in "xyz"),
        *(Port(f"hitch.velocity.{axis}", "output", "m/s", f"{axis} velocity of the hitch, world") for axis in "xyz"),
        Port("hitch.speed", "output", "m/s", "velocity of the hitch along the chassis' x axis"),
        Port("hitch.pull", "output", "N", "horizontal force of the load on the hitch, rearward, without the input"),
        Port("energy.towed", "output", "J", "work of the hitch on the load and against the input force since the"
             " start: positive where it tows"),
    ]  # fmt: skip


def parameter_ports() -> list[Port]:
    """Parameters of the load."""
    return [
        Port("hitch.load.force", "parameter", "N", "constant force of the load, rearward"),
        Port("hitch.load.points", "parameter", "1", "'speed force; speed force; ...', straight lines between: force of"
             " the load, N, rearward, over hitch.speed, m/s, besides the constant one", ""),
        Port("hitch.load.ramp.start", "parameter", "s", "time at which the half-cosine ramp of the load begins", 0.0),
        Port("hitch.load.ramp.end", "parameter", "s", "time at which the half-cosine ramp of the load ends", 1.0),
    ]  # fmt: skip


# numbers of a ``Hitch`` that follow from free parameters, see ``interface.model.FreeParameters``
FREE = {
    "hitch.force": "{hitch.load.force}",
    "hitch.ramp_start": "{hitch.load.ramp.start}",
    "hitch.ramp_end": "{hitch.load.ramp.end}",
}


def hitch(place: Sequence[float], first_input: int, state: int, parameters: Mapping[str, Any]) -> Hitch:
    """Hitch at a ``place`` (3) from O, m, with the load of the checked parameters; raises InvalidParameter."""
    start, end = (float(parameters[f"hitch.load.ramp.{key}"]) for key in ("start", "end"))
    if end < start:
        raise InvalidParameter(f"hitch.load.ramp.end = {end:.6g} s must not be before hitch.load.ramp.start")
    drag = parse_profile("hitch.load.points", str(parameters["hitch.load.points"]), "speed force")
    x, y, z = map(float, place)
    return Hitch((x, y, z), first_input, state, float(parameters["hitch.load.force"]), drag, start, end)


@kernel
def velocity_of(hitch: Hitch, x: Floats, A: Matrix) -> Vector:
    """Velocity of the hitch in the state x, world, m/s; A: rotation of B (3, 3). (14)"""
    return add(vector(x, 7), to_world(A, cross(vector(x, 10), hitch.place)))


@kernel
def load_of(hitch: Hitch, x: Floats, A: Matrix, velocity: Vector) -> tuple[float, Vector]:
    """Rearward force of the load, N, and its direction in the world. (15)"""
    length = np.sqrt(A[0, 0] ** 2 + A[1, 0] ** 2)
    if length < UPRIGHT:
        return 0.0, (0.0, 0.0, 0.0)
    force = hitch.force
    if has_points(hitch.drag):
        force += evaluate(hitch.drag, dot(velocity, (A[0, 0], A[1, 0], A[2, 0])))[0]
    t = x[hitch.state]
    share = 1.0 if t >= hitch.ramp_end else ramp(hitch, t)[0]  # also at the end of a ramp without length
    return share * force, (-A[0, 0] / length, -A[1, 0] / length, 0.0)


@kernel
def pull(hitch: Hitch, x: Floats, A: Matrix, u: Floats, out: Floats) -> tuple[Vector, Vector]:
    """Force and torque about O of load and input, in B; writes the rates of time and work to ``out``. (16)"""
    velocity = velocity_of(hitch, x, A)
    force, direction = load_of(hitch, x, A, velocity)
    f = add(scale(force, direction), vector(u, hitch.first_input))
    out[hitch.state], out[hitch.state + 1] = 1.0, -dot(f, velocity)
    f = to_body(A, f)
    return f, cross(hitch.place, f)


@kernel
def set_time(hitch: Hitch, x: Floats, t: float) -> None:
    """Set the time in the state."""
    x[hitch.state] = t


@kernel
def put_hitch(hitch: Hitch, x: Floats, A: Matrix, y: Floats, i: int) -> int:
    """Write motion, speed, load and work from ``y[i]`` on; return the index after them."""
    velocity = velocity_of(hitch, x, A)
    put(y, i, add(vector(x, 0), to_world(A, hitch.place)))
    put(y, i + 3, velocity)
    y[i + 6] = dot(velocity, (A[0, 0], A[1, 0], A[2, 0]))
    y[i + 7] = load_of(hitch, x, A, velocity)[0]
    y[i + 8] = x[hitch.state + 1]
    return i + 9
