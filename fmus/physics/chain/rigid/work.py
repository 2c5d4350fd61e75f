"""Work arrays of a rigid chain, allocated once; the common part: ``chain.state``."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from fmus.physics.arrays import Floats
from fmus.physics.chain.near import Near, near
from fmus.physics.chain.on_links import NONE, LinkForcesShape
from fmus.physics.chain.rigid.state import State, shapes, views
from fmus.physics.chain.state import HARD, NO_RUT, GroundMemory, size
from fmus.physics.chain.sums import SUMS
from fmus.physics.point import Memory, memory, points
from fmus.physics.rigid import augmented, recursive
from fmus.physics.rigid.augmented import AugmentedSystem
from fmus.physics.rigid.recursive import ArticulatedBodies
from fmus.physics.wheels import WIDTH

if TYPE_CHECKING:
    from fmus.physics.chain.contact_points import ContactPoints


class Work(NamedTuple):
    """Arrays for n links, p pins, m wheels."""

    before: State  # state at the beginning of a step, without a rut
    system: AugmentedSystem  # linear system
    articulated: ArticulatedBodies  # arrays of the recursive formulation; without links in the augmented one
    contact: Memory  # memory of sharp friction
    points: Any  # ``ContactPoints`` at the last iteration matrix; None without contacts
    near: Near  # distances of links from a wheel
    x: np.ndarray  # (n, 6) increments over the step, m and rad
    wheels: np.ndarray  # (m, 15) wheels at the time of evaluation
    wrench: np.ndarray  # (m + 1, 6) wrenches on the wheels and, last, on the ground, N and N m
    on_links: np.ndarray  # (k, c) forces on each link, see ``on_links``
    along: np.ndarray  # (n, 1) tension of a link due to contacts between its pins, N
    sums: np.ndarray  # (SUMS) see ``sums``
    pins: np.ndarray  # (2, p, 3) positions, m, and velocities, m/s, of the pins
    lever: np.ndarray  # (3) lever of a contact point, m
    N: np.ndarray  # (3, 3) derivative of the contact point by the link's rotation, m
    ground: np.ndarray  # (2, 7) poses of the supports of the first and the last pin
    still: np.ndarray  # (3, 3) rotation matrix of the supports, the identity
    soil: np.ndarray  # (points, k) memory that the ground would have after the evaluation; (0, 0) on hard ground
    rut: np.ndarray  # (k) rut of the state, which changes with accepted steps only; (0) on hard ground


def work(
    links: int,
    closed: bool,
    wheels: int,
    forces: LinkForcesShape = NONE,
    joints: int = 0,
    contacts: bool = False,
    ground: GroundMemory = HARD,
    rut: Floats = NO_RUT,
) -> Work:
    """Return zeroed arrays.

    ``forces``: shape of the forces on each link; ``joints``: number of joint coordinates with rates; ``contacts``: the
    chain may touch something; ``ground``: its memory, ``rut``: that part of it in the state.
    """
    z, pins = np.zeros, links if closed else links + 1
    sizes, supports = shapes(links, closed, wheels, forces, joints, ground._replace(rut=0)), z((2, 7))
    supports[:, 3] = 1.0
    return Work(
        before=views(z(size(sizes)), sizes),
        system=augmented.system(links, closed),
        articulated=recursive.articulated_bodies(links if joints else 0),
        contact=memory(points(wheels, pins)),
        points=_contact_points(points(wheels, pins), links) if contacts else None,
        near=near(links),
        x=z((links, 6)),
        wheels=z((wheels, WIDTH)),
        wrench=z((wheels + 1, 6)),
        on_links=z(forces),
        along=z((links, 1)),
        sums=z(SUMS),
        pins=z((2, pins, 3)),
        lever=z(3),
        N=z((3, 3)),
        ground=supports,
        still=np.eye(3),
        soil=z((ground.points, ground.pending)),
        rut=rut,
    )


def _contact_points(most: int, links: int) -> ContactPoints:
    """Return the arrays of contact points, see ``contact_points.contact_points``."""
    from fmus.physics.chain.contact_points import contact_points

    return contact_points(most, (links, 7))
