"""Outputs from the tree's state: wheel motions, chassis pose, springs, energies.

Each kernel writes its part of the output vector from index ``i`` on and returns the index after it; the order is
that of the ports in ``model.py``.
"""

from __future__ import annotations

from typing import Any

from fmus.chassis.dynamics import Parts, energies, put_elements, spring_push
from fmus.chassis.fittings import put_hitch, put_seats, touch
from fmus.chassis.leaf import ROOT, compression, is_fixed, wheel_offset
from fmus.chassis.tree import VehicleTree
from fmus.kernels.jit import allocating, kernel
from fmus.physics.arrays import Floats, Four, Matrix, Quaternion, Vector
from fmus.physics.elementary import asin, atan2, cos, sin
from fmus.physics.rotation import put_matrix, put_quat, quat_multiply
from fmus.physics.vector import add, cross, dot, put, scale, to_body, to_world, vector
from fmus.physics.wheels import into_frame
from fmus.start import FRAME


@allocating
def put_motion(y: Floats, i: int, x: Floats, A: Matrix, r: Vector, dr: Vector, q: Quaternion | Four, w: Vector) -> int:
    """Write the motion (13) of a wheel at r that moves at dr, with quaternion q and rate w; r, dr, w in B."""
    put(y, i, add(vector(x, 0), to_world(A, r)))
    put_quat(y, i + 3, q)
    put(y, i + 7, add(vector(x, 7), to_world(A, add(cross(vector(x, 10), r), dr))))
    put(y, i + 10, to_world(A, w))
    return i + 13


@allocating
def put_sides(tree: VehicleTree, x: Floats, sides: int, y: Floats, i: int) -> int:
    """Write the motions (13 each) of road wheels, idler, return rollers and sprocket mount of each side."""
    n, still = len(tree.is_arm), (0.0, 0.0, 0.0)
    A, w = tree.rotation, vector(x, 10)
    put_matrix(A, x[3:7])
    for side in range(sides):
        for k in range(side * n // 2, (side + 1) * n // 2):
            r, dr = wheel_offset(tree, k, x[ROOT + k])
            half, spin = 0.5 * x[ROOT + n + k], x[ROOT + 3 * n + k]
            q = quat_multiply(x[3:7], (cos(half), 0.0, sin(half), 0.0))
            centre, velocity = add(vector(tree.hinge[k], 0), r), scale(x[ROOT + 2 * n + k], dr)
            i = put_motion(y, i, x, A, centre, velocity, q, (w[0], spin, w[2]))
        i = put_motion(y, i, x, A, vector(tree.sprocket[side], 0), still, x[3:7], w)
    return i


@allocating
def put_chassis(tree: VehicleTree, x: Floats, start: Floats, y: Floats, i: int) -> int:
    """Write motion (13), pitch, roll, yaw, speed, distance, settlement, rates in B; start: see ``dynamics.Parts``."""
    A, zero = tree.rotation, (0.0, 0.0, 0.0)
    put_matrix(A, x[3:7])
    i = put_motion(y, i, x, A, zero, zero, x[3:7], vector(x, 10))
    y[i] = asin(min(1.0, max(-1.0, -A[2, 0])))
    y[i + 1] = atan2(A[2, 1], A[2, 2])
    y[i + 2] = atan2(A[1, 0], A[0, 0])
    y[i + 3] = dot(vector(x, 7), A[:, 0])
    y[i + 4] = into_frame(start, x[0] - start[FRAME], x[1] - start[FRAME + 1], x[2] - start[FRAME + 2])[0]
    y[i + 5] = into_frame(start, start[0] - x[0], start[1] - x[1], start[2] - x[2])[2]
    put(y, i + 6, vector(x, 10))
    return i + 9


@kernel
def put_springs(tree: VehicleTree, x: Floats, sides: int, y: Floats, i: int) -> int:
    """Write what arms and suspension have, then the tensioner's force, side by side."""
    n = len(tree.is_arm)
    for k in range(sides * n // 2):
        if is_fixed(tree, k):
            continue
        d = x[ROOT + k]
        push = spring_push(tree.suspension, tree, k, d, x[ROOT + 2 * n + k])
        if tree.is_arm[k] == 1:
            y[i] = d
            i += 1
        if tree.is_arm[k] == 0 or tree.drawn_length[k] > 0.0:
            y[i] = push
            i += 1
        if tree.drawn_length[k] > 0.0:
            y[i] = tree.drawn_length[k] - compression(tree, k, d)[0]
            i += 1
        i = put_elements(tree.suspension, tree, x, k, y, i)
    return i


@allocating
def write_outputs(c: Parts, y: Floats) -> None:
    """See ``output_kernel`` of ``interface.model.ComponentModel``."""
    tree, x = c.tree, c.state
    i = put_sides(tree, x, c.sides, y, 0)
    i = put_chassis(tree, x, c.start, y, i)
    i = put_springs(tree, x, c.sides, y, i)
    y[i], y[i + 1], y[i + 2] = energies(tree, x)
    y[i + 1] -= c.start[FRAME + 3]
    y[i + 3], y[i + 4] = x[-2], x[-1]
    i = put_touch(c.contacts, tree, x, y, i + 5)
    put_fittings(c.hitch, c.seats, x, tree.rotation, y, i)


@allocating
def put_touch(contacts: Any, tree: VehicleTree, x: Floats, y: Floats, i: int) -> int:
    """Write stored energy and force of the ground, where there are contacts."""
    if contacts is not None:
        A = tree.rotation
        put_matrix(A, x[3:7])
        touch(contacts, tree, x, A, to_body(A, vector(x, 7)), vector(x, 10))
        y[i] = contacts.sums[0]
        put(y, i + 1, vector(contacts.sums, 2))
        i += 4
    return i


@allocating
def put_fittings(hitch: Any, seats: Any, x: Floats, A: Matrix, y: Floats, i: int) -> None:
    """Write the outputs of hitch and seats, where there are any; A: scratch (3, 3)."""
    put_matrix(A, x[3:7])
    if hitch is not None:
        i = put_hitch(hitch, x, A, y, i)
    if seats is not None:
        put_seats(seats, x, A, y, i)
