"""Start of a chassis at rest: in the drawn position, or in equilibrium with its tracks."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from fmus.chassis.dynamics import ROOT, Parts, energies, is_fixed
from fmus.chassis.tree import BODY, WHOLE, VehicleTree, with_leaves, with_sprockets
from fmus.kernels.jit import allocating, kernel
from fmus.physics.arrays import Floats
from fmus.start import AFTER_POSE, FRAME, lay_frame, part_at_rest

PRELOADS = AFTER_POSE  # index of the preloads in ``p``: of suspension springs, of tensioners
NUMBERS = (  # numbers of the vehicle table that follow the preloads in ``p``
    "gravity",
    "chassis.mass",
    "chassis.inertia[1]",
    "chassis.inertia[2]",
    "chassis.inertia[3]",
    "sprocket.mass",
    "sprocket.transverse_inertia",
    "suspension.stiffness",
    "suspension.damping",
    "tensioner.stiffness",
    "tensioner.damping",
)
# indices in ``p``; what belongs together follows
GRAVITY, MASS, INERTIA, SPROCKET, SUSPENSION, TENSIONER = (
    PRELOADS + 2 + NUMBERS.index(name)
    for name in ("gravity", "chassis.mass", "chassis.inertia[1]", "sprocket.mass", "suspension.stiffness",
                 "tensioner.stiffness")
)  # fmt: skip


@allocating
def begin(c: Parts, messages: Floats, p: Sequence[float]) -> int:
    """See ``interface.model.ComponentModel``; p: the start pose, then the preloads, N, then NUMBERS, SI."""
    set_masses(c.tree, p)
    tree, x, start = c.tree, c.state, c.start
    n = tree.is_arm.size
    x[:] = 0.0
    c.received[:] = 0.0
    for k in range(n):
        if not is_fixed(tree, k):
            spring = SUSPENSION if tree.is_arm[k] == 1 else TENSIONER
            tree.stiffness[k], tree.damping[k] = p[spring], p[spring + 1]
            tree.preload[k] = p[PRELOADS] if tree.is_arm[k] == 1 else p[PRELOADS + 1] - c.missing_preload[2 * k // n]
        x[ROOT + k] = c.leaves[k]
    hull = part_at_rest(p, c.hull)
    for i in range(7):
        x[i] = hull[i]
    lay_frame(p, c.centre[0], c.centre[1], c.centre[2], start[:FRAME])
    for i in range(3):
        start[FRAME + i] = x[i]
    start[FRAME + 3] = energies(tree, x)[1]
    _lay_contact_frame(c.contacts, p)
    return 0


@allocating
def set_masses(tree: VehicleTree, p: Sequence[float]) -> None:
    """Set gravity and the masses of a tree, see ``begin``."""
    moments = p[INERTIA], p[INERTIA + 1], p[INERTIA + 2]
    mounts, centre, inertia = tree.sprocket, tree.centre, tree.inertia
    mass = with_sprockets(p[MASS], moments, p[SPROCKET], p[SPROCKET + 1], mounts, centre, inertia)
    tree.gravity[0], tree.masses[BODY] = p[GRAVITY], mass
    tree.masses[WHOLE] = with_leaves(mass, tree.is_arm, tree.leaf_mass)


@kernel
def _lay_contact_frame(contacts: Any, p: Sequence[float]) -> None:
    if contacts is not None:
        lay_frame(p, 0.0, 0.0, 0.0, contacts.frame)
