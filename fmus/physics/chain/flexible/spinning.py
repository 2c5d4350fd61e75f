"""Free loop that spins: the common deformation of its links in equilibrium relative to the spin.

A regular polygon stays regular and its links equal, so a few unknowns suffice: the radius, one link's own coordinates,
and those that links share besides the positions. Shapes without resistance are excluded: rounding would let a long or
slow loop drift along them. Where a spring closes the loop, it is compliant and the links are no longer equal: Newton's
iteration then has all coordinates in the plane as unknowns.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from fmus.physics.arrays import Floats
from fmus.physics.chain.flexible.link_layout import across, coordinate_indices, in_plane
from fmus.physics.elementary import cos, hypot, of_each, sin
from fmus.physics.elimination import solved

if TYPE_CHECKING:
    from types import ModuleType

PROBE = 1e-7  # change of an unknown in the difference quotients
# Change of a coordinate to either side, m. The quotient has to resolve the stiffness of a slow loop, spin^2 m: rounding
# of the residuals hides it in shorter changes, the curvature of stiff links in longer or one-sided ones.
STRIDE = 2e-6
MAX_CHANGE = 0.05  # largest change in a step of Newton's iteration; relative for the radius
ROUNDS = 60

Residuals = Callable[[Floats], Floats]  # residuals of the loop (links, rows, axes) by its accelerations (nodes, width)


def deform_polygon(
    kit: ModuleType, q: Floats, rows: int, links: int, spin: float, residuals: Residuals, tolerance: float
) -> bool:
    """Deform a regular polygon of straight links ``q`` (nodes, width) about the origin to Q = spin^2 M q.

    ``kit``: module of the links; ``rows``: number of their vectors; ``spin``, rad/s; ``tolerance``, N. Returns False if
    the iteration fails.
    """
    at, flat, plane = coordinate_indices(kit, q, rows, links), q.reshape(-1), kit.PLANE.ravel()
    axes, m, second = len(kit.AXES), len(kit.LAYOUT.shared), rows // 2
    turn = -2.0 * np.pi * np.arange(links)[:, None, None] / links
    own, shared, shared_last = kit.LAYOUT.inner, kit.LAYOUT.outer[axes:m], kit.LAYOUT.outer[m + axes :]

    def deformed(link: Floats, change: Floats) -> Floats:
        """The first link (rows, axes) after a change of its own coordinates, the shared ones and the radius."""
        link = link.copy()
        e = link.reshape(-1)
        e[own] += change[: own.size]
        e[shared] += change[own.size : -1]
        e[shared_last] = e[shared]
        link[[0, second]] *= 1.0 + change[-1]
        return link

    def lacks(link: Floats) -> Floats:
        """Imbalance of the first pin and the first link if all links are equal to ``link``."""
        flat[at] = link
        flat[at[..., [0, -1]]] = of_each(cos, turn) * in_plane(link) + of_each(sin, turn) * across(in_plane(link))
        a = np.zeros_like(q)
        a[:, plane] = -(spin**2) * q[:, plane]
        R = residuals(a)
        outwards = in_plane(link[0]) / hypot(*in_plane(link[0]).tolist())
        pull = (outwards * in_plane(R[0, 0] + R[-1, second])).sum()
        first, last = R[0].reshape(-1), R[-1].reshape(-1)
        return np.concatenate([first[own], first[shared] + last[shared_last], [pull]])

    link, size = flat[at[0]], own.size + shared.size + 1
    for _ in range(ROUNDS):
        now = lacks(link)
        answers = [(lacks(deformed(link, probe)) - now) / PROBE for probe in PROBE * np.eye(size)]
        change = solved(np.stack(answers, axis=1), -now)
        link = deformed(link, change * min(1.0, MAX_CHANGE / max(np.abs(change).max(), MAX_CHANGE)))
        if np.abs(now).max() < tolerance:  # the step above was the last: pins of a long loop rotate little
            lacks(link)
            return True
    return False


def deform_open_mesh(
    kit: ModuleType,
    q: Floats,
    rows: int,
    links: int,
    spin: float,
    stiffness: float,
    residuals: Residuals,
    tolerance: float,
) -> bool:
    """Same for a loop whose first and last pin a spring of ``stiffness``, N/m, joins.

    It starts from the result of ``deform_polygon``. Every third pin is probed at a time to find the responses. No
    rotation about the origin is taken.
    """
    at, flat, plane = coordinate_indices(kit, q, rows, links), q.reshape(-1), kit.PLANE
    width, place, pins = q.shape[1], plane[0], np.arange(links + 1)
    ends = np.stack([place, links * width + place])  # of the spring, indices into ``flat``
    used = np.intersect1d(at, (width * pins[:, None] + plane.ravel()))
    spring = np.zeros((q.size, q.size))
    for first, last in ends.T:
        spring[first, first] = spring[last, last] = stiffness
        spring[first, last] = spring[last, first] = -stiffness

    def of_links() -> Floats:
        """Residuals of the links."""
        a = np.zeros_like(q)
        a[:, plane] = -(spin**2) * q[:, plane]
        return residuals(a).copy()

    for _ in range(ROUNDS):
        now = of_links()
        lacks = np.bincount(at.ravel(), now.ravel(), q.size) + (spring * flat).sum(axis=1)
        if np.abs(lacks[used]).max() < tolerance:
            return True
        entries = []
        for coordinate in plane.ravel():
            for first in range(3):
                moved = width * pins[first::3] + coordinate
                here, answers = flat[moved].copy(), []
                for stride in (STRIDE, -STRIDE):
                    flat[moved] = here + stride
                    answers.append(of_links())
                flat[moved] = here
                answer = (answers[0] - answers[1]) / (2.0 * STRIDE)
                link = np.arange(links)  # a link has one of these pins, or none
                pin = np.where(link % 3 == first, link, link + 1)
                touched = pin % 3 == first
                columns = np.broadcast_to((width * pin + coordinate)[:, None, None], at.shape)
                entries.append((answer[touched], at[touched], columns[touched]))
        values, one, other = (np.concatenate([entry[k].ravel() for entry in entries]) for k in range(3))
        K = spring.copy()
        np.add.at(K, (one, other), values)
        turned = np.zeros_like(q)
        turned[:, plane] = across(q[:, plane])
        turn = turned.reshape(-1)[used, None]
        bordered = np.block([[K[np.ix_(used, used)], turn], [turn.T, np.zeros((1, 1))]])
        change = solved(bordered, -np.append(lacks[used], 0.0))[:-1]
        flat[used] += change * min(1.0, MAX_CHANGE / max(np.abs(change).max(), MAX_CHANGE))
    return False
