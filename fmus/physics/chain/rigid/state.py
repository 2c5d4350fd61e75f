"""State and work arrays of a chain of rigid links; the common part: ``chain.state``."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fmus.kernels.jit import by_reference
from fmus.physics.arrays import Floats
from fmus.physics.chain import state
from fmus.physics.chain.bushing import BushArrays, bush_arrays
from fmus.physics.chain.link_columns import NONE, LinkForcesShape
from fmus.physics.chain.near import Near, near
from fmus.physics.chain.state import HARD, NO_RUT, GroundMemory, size, views
from fmus.physics.chain.sums import SUMS
from fmus.physics.point import ContactPoints, Memory, contact_points, memory, points
from fmus.physics.rigid import augmented, recursive
from fmus.physics.rigid.augmented import AugmentedSystem
from fmus.physics.rigid.recursive import ArticulatedBodies
from fmus.physics.wheels import WIDTH


class State(NamedTuple):
    """Views into the flat state: n links, p pins, m wheels."""

    flat: np.ndarray  # (size) all of the following
    joints: np.ndarray  # (k) joint coordinates and their rates (``jointed``), k = 0 in the augmented formulation
    q: np.ndarray  # (n, 7) poses: centre of mass, m, quaternion
    v: np.ndarray  # (n, 6) velocity, m/s, angular velocity in body axes, rad/s
    a: np.ndarray  # (n, 6) auxiliary accelerations, m/s2 and rad/s2
    vdot: np.ndarray  # (n, 6) accelerations, m/s2 and rad/s2
    wrench: np.ndarray  # (m + 1, 6) present wrench on each wheel and, last, on the ground, N and N m
    aux: np.ndarray  # (m + 1, 6) auxiliary wrenches, N and N m
    mean: np.ndarray  # (m + 1, 6) mean wrenches over the communication step, N and N m
    on_links: np.ndarray  # (k, c) present forces on each link, see ``on_links``; k = 0 without a request
    on_links_aux: np.ndarray  # (k, c) auxiliary forces
    on_links_sum: np.ndarray  # (k, c) impulses since the interval began
    span: np.ndarray  # (2) time since then, s, and steps left of the interval
    lengths: np.ndarray  # (2) of the steps of the auxiliary values, see ``implicit``
    sums: np.ndarray  # (SUMS) of the last evaluation, see ``sums``
    turned: np.ndarray  # (k, 2) angle, rad, and work of friction, J, of bushed pins so far; k = 0 without bushes
    turning: np.ndarray  # (k, 2) their present rates, rad/s and W
    lam: np.ndarray  # (p, 5) multipliers of the pins, N and N m
    load: np.ndarray  # (p, 3) present force of teeth and damping on each pin, N: half on either link
    along: np.ndarray  # (n, 1) tension of a link due to contacts between its pins, N
    soil: np.ndarray  # (points, k) memory of the ground at the contact points; (0, 0) on hard ground
    rut: np.ndarray  # (k) rut of the chain, see ``contact.soil.memory``; (0) on hard ground


def shapes(
    links: int,
    closed: bool,
    wheels: int,
    forces: LinkForcesShape = NONE,
    joints: int = 0,
    ground: state.GroundMemory = state.HARD,
    bushed: bool = False,
) -> state.Shapes:
    """Shapes of the views.

    ``forces``: shape of the forces on each link; ``joints``: number of joint coordinates with rates; ``ground``: its
    memory; ``bushed``: with what bushed pins turned.
    """
    pins, on = (links if closed else links + 1), (wheels + 1, 6)
    motion = links, 6
    return {
        "joints": (joints,),
        "q": (links, 7), "v": motion, "a": motion, "vdot": motion, "wrench": on, "aux": on, "mean": on,
        "on_links": forces, "on_links_aux": forces, "on_links_sum": forces, "span": (2,), "lengths": (2,),
        "sums": (SUMS,), "turned": (bushed * pins, 2), "turning": (bushed * pins, 2),
        "lam": (pins, 5), "load": (pins, 3), "along": (links, 1),
        **ground.shapes,
    }  # fmt: skip


class Work(NamedTuple):
    """Arrays for n links, p pins, m wheels."""

    before: State  # state at the beginning of a step, without a rut
    system: AugmentedSystem  # linear system
    articulated: ArticulatedBodies  # arrays of the recursive formulation; without links in the augmented one
    contact: Memory  # memory of sharp friction
    points: ContactPoints  # at the last iteration matrix; empty without contacts
    near: Near  # distances of links from a wheel
    increment: np.ndarray  # (n, 6) increments over the step, m and rad
    wheels: np.ndarray  # (m, 15) wheels at the time of evaluation
    wrench: np.ndarray  # (m + 1, 6) wrenches on the wheels and, last, on the ground, N and N m
    on_links: np.ndarray  # (k, c) forces on each link, see ``on_links``
    along: np.ndarray  # (n, 1) tension of a link due to contacts between its pins, N
    sums: np.ndarray  # (SUMS) see ``sums``
    bushes: BushArrays  # of bushed pins
    pins: np.ndarray  # (2, p, 3) positions, m, and velocities, m/s, of the pins
    lever: np.ndarray  # (3) lever of a contact point, m
    rotation_jacobian: np.ndarray  # (3, 3) derivative of the contact point by the link's rotation, m
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
    contacts: int = 0,
    ground: GroundMemory = HARD,
    rut: Floats = NO_RUT,
    bushed: bool = False,
) -> Work:
    """Return zeroed arrays.

    ``forces``: shape of the forces on each link; ``joints``: number of joint coordinates with rates; ``contacts``: most
    contact points, 0 if the chain can touch nothing; ``ground``: its memory, ``rut``: that part of it in the state;
    ``bushed``: for bushed pins.
    """
    z, pins = np.zeros, links if closed else links + 1
    sizes, supports = shapes(links, closed, wheels, forces, joints, ground._replace(rut=0), bushed), z((2, 7))
    supports[:, 3] = 1.0
    return by_reference(
        Work(
            before=views(State, sizes, z(size(sizes))),
            system=augmented.system(links, closed, bushed),
            articulated=recursive.articulated_bodies(links if joints else 0),
            contact=memory(points(wheels, pins, ground.points // links)),
            points=contact_points(contacts, (links, 7)),
            near=near(links),
            increment=z((links, 6)),
            wheels=z((wheels, WIDTH)),
            wrench=z((wheels + 1, 6)),
            on_links=z(forces),
            along=z((links, 1)),
            sums=z(SUMS),
            bushes=bush_arrays(pins if bushed else 0),
            pins=z((2, pins, 3)),
            lever=z(3),
            rotation_jacobian=z((3, 3)),
            ground=supports,
            still=np.eye(3),
            soil=z((ground.points, ground.pending)),
            rut=rut,
        )
    )
