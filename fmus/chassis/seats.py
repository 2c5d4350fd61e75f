"""Seats: points of the hull whose motion is an output. Imported only where a scene asks for them.

The acceleration is the change of the point's velocity over the last communication step, over its length: what the mean
wrenches of that step made of it. It is a part of the state, so that outputs depend on states alone.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from fmus.interface.model import InvalidParameter
from fmus.interface.ports import Port
from fmus.kernels.jit import kernel
from fmus.physics.arrays import Floats, Matrix, Vector
from fmus.physics.vector import add, cross, put, scale, to_world, vector

STATES = 3  # of a seat in the state of the chassis: its mean acceleration, world, m/s2


class Seats(NamedTuple):
    """Seats of a chassis."""

    places: np.ndarray  # (n, 3) from O, in B, m
    state: int  # index in the state of the chassis, see STATES


def output_ports(names: Sequence[str]) -> list[Port]:
    """Motion of each seat."""
    parts = (
        ("position", "m", ""), ("velocity", "m/s", " velocity"), ("acceleration", "m/s2", " acceleration"),
    )  # fmt: skip
    return [
        Port(f"seat.{name}.{part}.{axis}", "output", unit, f"{axis}{text} of the seat {name}, world"
             + (", mean over the step; 0 at the start" if part == "acceleration" else ""))
        for name in names for part, unit, text in parts for axis in "xyz"
    ]  # fmt: skip


def seats(table: Mapping[str, Any], names: Sequence[str], origin: Sequence[float], state: int) -> Seats:
    """Seats by ``names`` from the table ``seat`` of a vehicle; ``origin``: O in the vehicle frame, m.

    Raises InvalidParameter for a name that the table lacks.
    """
    for name in names:
        if name not in table:
            raise InvalidParameter(f"chassis.seats names '{name}': the vehicle has {', '.join(table) or 'none'}")
    places = np.array([table[name]["position"] for name in names], dtype=float) - np.array(origin)
    return Seats(places, state)


@kernel
def velocity_of(seats: Seats, k: int, x: Floats, A: Matrix) -> Vector:
    """Velocity of a seat in the state x, world, m/s; A: rotation of B (3, 3)."""
    return add(vector(x, 7), to_world(A, cross(vector(x, 10), vector(seats.places[k], 0))))


@kernel
def keep_velocities(seats: Seats, x: Floats, A: Matrix) -> None:
    """Keep the velocities before a step where the accelerations are."""
    for k in range(len(seats.places)):
        put(x, seats.state + STATES * k, velocity_of(seats, k, x, A))


@kernel
def put_accelerations(seats: Seats, x: Floats, A: Matrix, h: float) -> None:
    """Set the accelerations from the velocities after a step of ``h`` s and those that were kept."""
    for k in range(len(seats.places)):
        i = seats.state + STATES * k
        change = add(velocity_of(seats, k, x, A), scale(-1.0, vector(x, i)))
        put(x, i, scale(1.0 / h, change))


@kernel
def put_seats(seats: Seats, x: Floats, A: Matrix, y: Floats, i: int) -> None:
    """Write position, velocity and acceleration of each seat from ``y[i]`` on."""
    for k in range(len(seats.places)):
        put(y, i, add(vector(x, 0), to_world(A, vector(seats.places[k], 0))))
        put(y, i + 3, velocity_of(seats, k, x, A))
        put(y, i + 6, vector(x, seats.state + STATES * k))
        i += 9
