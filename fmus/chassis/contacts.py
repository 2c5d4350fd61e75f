"""Contact of the chassis with the ground: points of the hull, and wheels that have no track.

The laws are those of the links (``fmus.physics.contact``): each hull point has the stiffness of one link; so has each
wheel, half of it at either edge of its rim. Imported only where a scene declares such contact.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from fmus.chassis.leaf import ROOT, wheel_offset
from fmus.chassis.tree import VehicleTree
from fmus.ground.contact import contact_law, ground_shape
from fmus.kernels.jit import kernel
from fmus.physics.arrays import Floats, Matrix, Vector
from fmus.physics.contact.face import point_contact_force
from fmus.physics.contact.grounds import ground_face, ground_law, wheel_normal
from fmus.physics.point import Memory, memory
from fmus.physics.vector import add, cross, dot, put, scale, to_body, to_world, vector
from fmus.physics.wheels import from_frame, into_frame
from fmus.start import FRAME
from fmus.vehicles.sides import smooth_wheels

STORED, POWER, FORCE = 0, 1, 2  # indices in the sums; the force has three numbers


class ChassisContacts(NamedTuple):
    """Contact partners, constant through a run, and scratch arrays; n leaves."""

    ground: Any  # shape (``physics.contact.grounds``) in the frame of the start
    law: Any  # a law of ``physics.contact.laws``
    frame: np.ndarray  # (12) of the start, see ``fmus.start``
    points: np.ndarray  # (m, 3) points of the hull, frame B, m
    radius: np.ndarray  # (n) radius of road wheels and idlers without a track, 0 for others, m
    half_width: np.ndarray  # (n) half the width of their rims, m
    f: np.ndarray  # (6 n + 6) force and torque, in B: on wheels about their centres, then on the hull about O
    sums: np.ndarray  # (5) stored energy, J; dissipated power, W; force of the ground, N, world
    memory: Memory  # of sharp friction, for ``point_contact_force``; not used without a tangent


def contacts(vehicle: Mapping[str, Any], ground: Mapping[str, Any], parameters: Mapping[str, Any]) -> ChassisContacts:
    """Contacts from the vehicle table, the config's ``ground`` and the checked parameters.

    ``ground``: {"hull": bool, "bare": sides without a track}, and the keys of ``ground_shape``. Raises
    InvalidParameter.
    """
    origin = np.array(vehicle["chassis"]["centre"])
    hull = vehicle["chassis"]["hull"] if ground["hull"] else []
    bare = [1.0 if side in ground["bare"] else 0.0 for side in ("left", "right")]
    radius, width = (  # return rollers touch no ground
        [0.0 if wheel["kind"] == "return_roller" else wheel[key] for wheel in smooth_wheels(vehicle)]
        for key in ("radius", "width")
    )
    return ChassisContacts(
        ground_shape(vehicle, ground, parameters),
        contact_law("ground", parameters, vehicle["contact"]["ground"]),
        np.zeros(FRAME),
        np.array(hull, dtype=float).reshape(-1, 3) - origin,
        np.kron(bare, radius),
        0.5 * np.kron(bare, width),
        np.zeros(12 * len(radius) + 6),
        np.zeros(5),
        memory(),
    )


@kernel
def _add_contact(
    contacts: ChassisContacts, A: Matrix, share: float, index: int, p: Vector, velocity: Vector, centre: Vector
) -> None:
    """Add the contact of a point to ``f[index : index + 6]``, its torque about ``centre``, and to the sums.

    p, velocity, centre: of the point, world; ``share`` scales the stiffness; A: rotation of B (3, 3).
    """
    frame, sums, f = contacts.frame, contacts.sums, contacts.f
    x = into_frame(frame, p[0] - frame[0], p[1] - frame[1], p[2] - frame[2])
    v = into_frame(frame, velocity[0], velocity[1], velocity[2])
    depth, face = ground_face(contacts.ground, x, v)
    if depth <= 0.0:
        return
    law = ground_law(contacts.ground, contacts.law, x)
    contact = point_contact_force(law, share, depth, face, 0.0, False, contacts.memory, 0)
    force = from_frame(frame, contact.f)
    sums[STORED] += contact.energy
    sums[POWER] += contact.friction + contact.damping
    put(sums, FORCE, add(vector(sums, FORCE), force))
    torque = cross(add(p, scale(-1.0, centre)), force)
    put(f, index, add(vector(f, index), to_body(A, force)))
    put(f, index + 3, add(vector(f, index + 3), to_body(A, torque)))


@kernel
def touch(contacts: ChassisContacts, tree: VehicleTree, x: Floats, A: Matrix, v: Vector, w: Vector) -> None:
    """Compute all contacts in the state x into ``contacts.f`` and ``contacts.sums``.

    A, v, w: rotation of B (3, 3), velocity of O and angular velocity in B.
    """
    n, O, frame = len(tree.is_arm), vector(x, 0), contacts.frame
    contacts.f[:] = 0.0
    contacts.sums[:] = 0.0
    for i in range(contacts.points.shape[0]):
        r = vector(contacts.points[i], 0)
        _add_contact(contacts, A, 1.0, 6 * n, add(O, to_world(A, r)), to_world(A, add(v, cross(w, r))), O)
    axle = (A[0, 1], A[1, 1], A[2, 1])
    for k in range(n):
        if contacts.radius[k] == 0.0:
            continue
        r, dr = wheel_offset(tree, k, x[ROOT + k])
        r = add(vector(tree.hinge[k], 0), r)
        centre = add(O, to_world(A, r))
        velocity = to_world(A, add(add(v, cross(w, r)), scale(x[ROOT + 2 * n + k], dr)))
        turning = to_world(A, (w[0], x[ROOT + 3 * n + k], w[2]))
        # the deepest point of the rim lies along the ground's normal under the centre
        place = into_frame(frame, centre[0] - frame[0], centre[1] - frame[1], centre[2] - frame[2])
        normal = wheel_normal(contacts.ground, place, into_frame(frame, axle[0], axle[1], axle[2]), contacts.radius[k])
        down = from_frame(frame, scale(-1.0, normal))
        down = add(down, scale(-dot(down, axle), axle))
        length = np.sqrt(dot(down, down))
        if length < 1e-3:  # the wheel lies flat
            continue
        for side in (-1.0, 1.0):
            arm = add(scale(contacts.radius[k] / length, down), scale(side * contacts.half_width[k], axle))
            _add_contact(contacts, A, 0.5, 6 * k, add(centre, arm), add(velocity, cross(turning, arm)), centre)
