"""Deformation modes at a pin between two full beams: free motion and strains of the joint.

Section 4.4 and figure 8 of Shabana et al., Ideal compliant joints and integration of computer aided design and
analysis.
Two straight elements along x meet at a node: the one before ends there, the one behind begins there. With the pin (3)
along the unit vector b of their common reference they share position and r_b = b_x r_x + b_y r_y + b_z r_z. So six of
the twelve coordinates of a node are shared, and six are each element's own: its gradients along a and c, the two
directions across the pin (a is the one nearest to x). A change of the gradients by H d along the direction d, with
H b = 0, is one of

    rotation  -c a^T + a c^T    no strain            free motion of the pin
    stretch    a a^T            E_aa                 figure 8 a: the length of r_x
    section    c c^T            E_cc                 figure 8 c: the thickness across the pin
    shear      c a^T + a c^T    E_ac                 angle of r_x and its section
    lean       b a^T            E_ab                 angle of r_x and the pin
    twist      b c^T            E_bc                 angle of the section and the pin

while b b^T, the same for both elements, stretches the pin itself. Five of the six strains may jump at the joint, E_bb
may not. Bending (figure 8 b) is the rotation of the node of one element with its chord held: gradients and section
rotate against the line between its nodes; the strain at the joint is 0 on the axis and linear in c beside it.
Coordinates of the pair are (2, 8, 3), before and behind, each as in fmus/physics/ancf/beam.py, which defines the
strains.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from fmus.physics.ancf import beam
from fmus.physics.arrays import Floats

JOINT = ((0, 4), (1, 0))  # (element, row): start of the joint's node in the pair's coordinates
ROTATION = "rotation"
DEFORMATIONS = ("stretch", "section", "shear", "lean", "twist")  # of an element's own gradients at the joint
MODES = (ROTATION, "bending", *DEFORMATIONS, "pin stretch")


def triad(axis: Floats) -> Floats:
    """Rows a, b, c (3, 3): right-handed, b along the pin, a across it nearest to x (y for a pin along x)."""
    b = np.asarray(axis, float) / np.linalg.norm(axis)
    a = np.eye(3)[0] - b[0] * b
    if np.linalg.norm(a) < 1e-6:
        a = np.eye(3)[1] - b[1] * b
    a /= np.linalg.norm(a)
    return np.array([a, b, np.cross(a, b)])


def straight(l: float) -> Floats:
    """Undeformed pair (2, 8, 3), m, of elements of length ``l``, m, with the joint at the origin."""
    pair = np.zeros((2, 8, 3))
    pair[0, 0, 0], pair[1, 4, 0] = -l, l
    pair[:, 1:4] = pair[:, 5:8] = np.eye(3)
    return pair


def pin_rows(axis: Floats) -> Floats:
    """Constant matrix (6, 48) of the pin equations (3) on the coordinates of the pair."""
    b = triad(axis)[1]
    rows = np.zeros((6, 2, 8, 3))
    for (element, node), sign in zip(JOINT, (1.0, -1.0), strict=True):
        for i in range(3):
            rows[i, element, node, i] = sign
            rows[3 + i, element, node + 1 : node + 4, i] = sign * b
    return rows.reshape(6, 48)


def gradient_change(mode: str, axis: Floats) -> Floats:
    """Gradient change H (3, 3) of a mode per unit of amplitude; the gradient along d changes by H d."""
    a, b, c = triad(axis)
    turn = np.outer(a, c) - np.outer(c, a)
    return {
        ROTATION: turn,
        "bending": turn,
        "stretch": np.outer(a, a),
        "section": np.outer(c, c),
        "shear": np.outer(a, c) + np.outer(c, a),
        "lean": np.outer(b, a),
        "twist": np.outer(b, c),
        "pin stretch": np.outer(b, b),
    }[mode]


def turned(axis: Floats, angle: float) -> Floats:
    """Rotation matrix (3, 3) of ``angle``, rad, about the pin."""
    return np.asarray(Rotation.from_rotvec(angle * triad(axis)[1]).as_matrix())


def displacement(mode: str, axis: Floats, amplitude: float, l: float, before: bool = False) -> Floats:
    """Displacement field (2, 8, 3) of a mode of finite ``amplitude``, an angle, rad, or a stretch.

    It acts on the element behind the joint, or with ``before`` on the other; the stretch of the pin acts on both.
    """
    if mode not in MODES:
        raise ValueError(f"mode {mode!r}: one of {', '.join(MODES)}")
    pair = straight(l)
    moved = pair.copy()
    element, node = JOINT[0 if before else 1]
    if mode == ROTATION:
        moved[element] = pair[element] @ turned(axis, amplitude).T
        return moved - pair
    F = turned(axis, amplitude) if mode == "bending" else np.eye(3) + amplitude * gradient_change(mode, axis)
    for other, row in JOINT if mode == "pin stretch" else ((element, node),):
        moved[other, row + 1 : row + 4] = pair[other, row + 1 : row + 4] @ F.T
    return moved - pair


def position(e: Floats, l: float, place: tuple[float, float, float]) -> Floats:
    """Position (3,), m, of the point ``place`` (fraction of length; y, z, m) of an element ``e`` (8, 3)."""
    S = np.empty(8)
    beam.shape(_beam(l), *place, S)
    return S @ e


def at_joint(pair: Floats, l: float, y: float = 0.0, z: float = 0.0) -> Floats:
    """Strains (2, 3, 3) on both sides of the joint, at ``y``, ``z``, m, of its section."""
    return np.array([strains(_beam(l), pair[0], 1.0, y, z), strains(_beam(l), pair[1], 0.0, y, z)])


def strains(c: beam.Beam, e: Floats, xi: float, y: float, z: float) -> Floats:
    """Green-Lagrange strain (3, 3) of a beam ``e`` (8, 3) at the fraction ``xi`` and ``y``, ``z``, m."""
    N, G, (across, up) = np.empty((5, 8)), np.empty((5, 3)), beam.radii(c)
    beam.basis(c, xi, N)
    beam.section_vectors(N, e, G)
    F = np.array([G[0] + y / across * G[1] + z / up * G[2], G[3], G[4]])  # gradients, row by row
    return np.asarray(0.5 * (F @ F.T - np.eye(3)))


def jump_of_strain(axis: Floats) -> Floats:
    """Small-strain jumps (6, 6) at the joint by the six freedoms of one element, in the axes of ``triad``.

    Columns: rotation, then the deformations. Rows: aa, bb, cc, ab, ac, bc.
    """
    axes, step = triad(axis), 1e-6

    def jump(change: Floats) -> Floats:
        pair = straight(1.0)
        pair[1, 1:4] += change.T
        before, behind = at_joint(pair, 1.0)
        return axes @ (behind - before) @ axes.T

    changes = [step * gradient_change(mode, axis) for mode in (ROTATION, *DEFORMATIONS)]
    rates = np.array([(jump(change) - jump(-change)) / (2.0 * step) for change in changes])
    return rates[:, [0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]].T


def _beam(l: float) -> beam.Beam:
    """Beam of length ``l``, m; only its geometry matters here."""
    return beam.Beam(l, 1.0, 1.0, 1.0, 1.0, 0.0, 1.0, 1.0, False, 0.0)
