"""Chain of fully parameterised beams joined by pins: coordinates of pins and outputs of links.

A node (pin) has 18 coordinates, vectors of three: position r and gradient r_y along the pin, which both links share;
r_x and r_z of the link that ends there; r_x and r_z of the link that begins there. That is the pin of paper (3),
eliminated: its axis is a vector of the links' own, so it turns with them. The twelve of r_x and r_z belong to one link
each, so every Newton step condenses them link by link and leaves a cyclic block tridiagonal system of 6 x 6 blocks.
Sibling with the same names: ``cables``; chosen by ``interface``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from fmus.kernels.jit import implemented_in, kernel, namesake
from fmus.physics.ancf.beam import GAUSS, Beam, basis, radii, section_vectors
from fmus.physics.ancf.element import section_force
from fmus.physics.ancf.gauss import POINTS, WEIGHTS
from fmus.physics.arrays import Floats, Vector
from fmus.physics.chain.bushing import Bushing
from fmus.physics.chain.flexible.closing import ClosingSpring
from fmus.physics.chain.flexible.link_layout import chosen, layout_of_halves, with_torques
from fmus.physics.vector import dot, scale, vector

if TYPE_CHECKING:
    from fmus.physics.chain.flexible.link_layout import LinkLayout
    from fmus.physics.chain.flexible.state import Work


NODE = 18  # r, r_y; r_x, r_z of the ending link; r_x, r_z of the beginning link
BEGIN = np.array([0, 12, 3, 15])  # indices of a beginning link's r, r_x, r_y, r_z in its first pin
END = np.array([0, 6, 3, 9])  # indices of an ending link's in its second pin


LAYOUT = layout_of_halves(
    begin=[BEGIN[a] + k for a in range(4) for k in range(3)],
    end=[END[a] + k for a in range(4) for k in range(3)],
    outer=[0, 1, 2, 6, 7, 8, 12, 13, 14, 18, 19, 20],
    fixed=6,
)
BUSHED = with_torques(LAYOUT)
ELEMENT = (8, 3)  # (rows, axes): vectors of a link, components of a vector
AXES = np.arange(3)  # axes of space that a vector of this chain has
FREE = 0  # size of the state of the axes: fixed
PLANE = np.arange(NODE).reshape(6, 3)[:, [0, 2]]  # indices in a pin of the x and z components of each of its vectors
PIN_AXIS = [4]  # index in a pin of its axis' y component, 1 at rest


@implemented_in(
    dynamics=".dynamics", elements=".beams", bodies=".node_faces", faces=".beam_faces",
    guides="..guides",
)  # fmt: skip
class Beams(NamedTuple):
    """Parameters of a chain of equal links."""

    n: int  # number of links
    closed: int  # 1: a closed mesh, 0: an open one
    element: Beam  # parameters of an element
    face: float  # distance of the contact faces from the pin line, m
    lateral: float  # distance of the contact points from the middle, m
    outer_fibre: float  # distance of the outer fibre from the axis, m
    area: float  # area of the section, m2
    young: float  # Young's modulus, Pa
    closing: ClosingSpring | None = None  # spring of a loop whose mesh is open
    bushing: Bushing | None = None  # bush of each pin between two links


@namesake
def gather(links: Beams, q: Floats, i: int, j: int, e: Floats) -> None:
    for a in range(4):
        for k in range(3):
            e[a, k] = q[i, BEGIN[a] + k]
            e[4 + a, k] = q[j, END[a] + k]


@namesake
def layout(links: Beams) -> LinkLayout:
    return chosen(links.bushing, LAYOUT, BUSHED)


@namesake
def lever(links: Beams) -> tuple[float, float, float, float, float, float]:
    """By the pin's middle, or by its ends as they rotate and stretch."""
    half = 0.5 * links.element.width
    return 1.0, 1.0, 1.0, half, half, half


@kernel
def axial(links: Beams, w: Work) -> tuple[float, float]:
    """Stress is from Green's strains at the axis' Gauss points and the section's corners."""
    N, G, (across, up) = links.element.work.N, links.element.work.sections[0], radii(links.element)
    y, z = 0.5 * links.element.width / across, links.outer_fibre / up
    stress = 0.0
    for p in range(GAUSS):
        basis(links.element, POINTS[GAUSS, p], N)
        section_vectors(N, w.coordinates, G)
        for corner in range(4):
            a, b = y if corner < 2 else -y, z if corner % 2 else -z
            square = 0.0
            for k in range(3):
                square += (G[0, k] + a * G[1, k] + b * G[2, k]) ** 2
            stress = max(stress, abs(links.young * 0.5 * (square - 1.0)))
    return section_force(links.element, w.coordinates, w.rates, w.accelerations), stress


@kernel
def outer_and_inner(links: Beams, w: Work) -> tuple[float, float]:
    """At the middle of the width."""
    N, G = links.element.work.N, links.element.work.sections[0]
    up = links.outer_fibre / radii(links.element)[1]
    outer = inner = 0.0
    for p in range(GAUSS):
        basis(links.element, POINTS[GAUSS, p], N)
        section_vectors(N, w.coordinates, G)
        outer_stretch = inner_stretch = 0.0
        for k in range(3):
            outer_stretch += (G[0, k] + up * G[2, k]) ** 2
            inner_stretch += (G[0, k] - up * G[2, k]) ** 2
        outer += WEIGHTS[GAUSS, p] * links.young * 0.5 * (outer_stretch - 1.0)
        inner += WEIGHTS[GAUSS, p] * links.young * 0.5 * (inner_stretch - 1.0)
    return outer, inner


@namesake
def pin_axis(links: Beams, q: Floats) -> Vector:
    along = vector(q, 3)
    return scale(1.0 / np.sqrt(dot(along, along)), along)
