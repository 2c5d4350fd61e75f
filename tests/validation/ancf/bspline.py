"""Exact linear maps between cubic B-splines and cable elements, and joints that a knot can make.

Section 5 of Shabana et al., Ideal compliant joints and integration of computer aided design and analysis; for
polar forms (blossoms) Ramshaw, Computer Aided Geometric Design 6, 1989. The cubic f of one element has one symmetric
polar form f(a, b, c), linear in each argument, with f(x, x, x) = f(x). On an element from u to w, of length l = w - u:

    Bezier points            f(u,u,u), f(u,u,w), f(u,w,w), f(w,w,w)
    cable coordinates        r(u) = f(u,u,u), r_x(u) = 3 (f(u,u,w) - f(u,u,u)) / l, and so at w
    control point i          f(t[i+1], t[i+2], t[i+3]) of any element in its support

Coordinates are (elements, 4, d) as in fmus/physics/ancf/cable.py: position, slope, position, slope; d = 3 in space.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import BSpline

from fmus.physics.arrays import Floats

DEGREE = 3
SPACE = 3  # components of a position
# Of the size of a curve: smaller jumps are rounding. Differences of derivatives lose digits (most in the third
# derivative of a fine mesh), so a bound near rounding would find too many knots.
SMOOTH = 1e-9
# powers of the fraction xi in the shape functions of a cable of unit length: rows 1, xi, xi^2, xi^3
POWERS = np.array([[1.0, 0, 0, 0], [0, 1, 0, 0], [-3, -2, 3, -1], [2, 1, -2, 1]])
FALLING = np.array([[1.0, 1, 1, 1], [0, 1, 2, 3], [0, 0, 2, 6], [0, 0, 0, 6]])  # derivative of order k of xi^p: factor


# The maps ----------------------------------------------------------------------------------------------------------


def bezier_to_cable(l: float) -> Floats:
    """Matrix (4, 4) from Bezier points to cable coordinates of an element of length ``l``, m."""
    s = 3.0 / l
    return np.array([[1.0, 0, 0, 0], [-s, s, 0, 0], [0, 0, 0, 1.0], [0, 0, -s, s]])


def cable_to_bezier(l: float) -> Floats:
    """Matrix (4, 4) from cable coordinates to Bezier points of an element of length ``l``, m."""
    s = l / 3.0
    return np.array([[1.0, 0, 0, 0], [1.0, s, 0, 0], [0, 0, 1.0, -s], [0, 0, 1.0, 0]])


def elements(knots: Floats) -> Floats:
    """Limits (n, 2) of the elements of a clamped cubic knot vector with knots of multiplicity 1 to 4."""
    breaks = np.unique(knots)
    return np.stack([breaks[:-1], breaks[1:]], axis=1)


def _polar(knots: Floats, span: int, arguments: tuple[float, float, float]) -> Floats:
    """Weights (control points,) of the polar form on [knots[span], knots[span + 1]], by de Boor's scheme."""
    rows = np.eye(control_points(len(knots)))[span - DEGREE : span + 1]
    for r, x in enumerate(arguments, 1):
        left = knots[span - DEGREE + r : span + 1]
        right = knots[span + 1 : span + 1 + len(left)]
        part = ((x - left) / (right - left))[:, None]
        rows = (1.0 - part) * rows[:-1] + part * rows[1:]
    return rows[0]


def extraction(knots: Floats) -> Floats:
    """Matrices (n, 4, control points) from control points to the cable coordinates of every element."""
    matrices = []
    for u, w in elements(knots):
        span = int(np.searchsorted(knots, u, side="right")) - 1
        points = [_polar(knots, span, abc) for abc in ((u, u, u), (u, u, w), (u, w, w), (w, w, w))]
        matrices.append(bezier_to_cable(w - u) @ np.array(points))
    return np.array(matrices)


def drawn(inner: Sequence[int], rng: np.random.Generator) -> BSpline:
    """Clamped cubic spline in space with inner knots of these multiplicities and random control points."""
    breaks = np.concatenate([[0.0], np.cumsum(rng.uniform(0.5, 1.5, len(inner) + 1))])
    knots = np.repeat(breaks, [DEGREE + 1, *inner, DEGREE + 1])
    return BSpline(knots, rng.standard_normal((control_points(len(knots)), SPACE)), DEGREE)


def to_cable(spline: BSpline) -> tuple[Floats, Floats]:
    """Cable coordinates (n, 4, d) and lengths (n) of the elements of a clamped cubic spline."""
    if spline.k != DEGREE:
        raise ValueError(f"a spline of degree {spline.k}: cable elements are cubic")
    spans = elements(spline.t)
    return np.einsum("nap,pi->nai", extraction(spline.t), spline.c), spans[:, 1] - spans[:, 0]


def jumps(e: Floats, l: Floats) -> Floats:
    """Largest jumps (n - 1, 4) of the derivatives k = 0 to 3 at each inner node, times l^k: lengths, m."""

    def derivatives(xi: float) -> Floats:
        return np.stack([np.einsum("na,nai->ni", _derivatives(l, xi, k), e) for k in range(DEGREE + 1)], axis=1)

    apart = np.abs(derivatives(1.0)[:-1] - derivatives(0.0)[1:]).max(axis=2)
    return np.asarray(apart * np.minimum(l[:-1], l[1:])[:, None] ** np.arange(DEGREE + 1))


def polynomial(xi: float, k: int) -> Floats:
    """The k-th derivatives (4,) of 1, xi, xi^2, xi^3."""
    return np.asarray(FALLING[k] * xi ** np.maximum(np.arange(4) - k, 0))


def _derivatives(l: Floats, xi: float, k: int) -> Floats:
    """The k-th derivatives (n, 4) by x of the shape functions of elements of lengths ``l`` (n,), m."""
    return polynomial(xi, k) @ POWERS * l[:, None] ** np.array([-k, 1 - k, -k, 1 - k])


def multiplicities(e: Floats, l: Floats) -> NDArray[np.int64]:
    """Least knot multiplicity (n - 1,) of each inner node that its continuity permits.

    A derivative counts as continuous if it jumps by less than SMOOTH of the curve's size.
    """
    size = max(float(np.ptp(e[:, [0, 2]].reshape(-1, e.shape[2]), axis=0).max()), float(l.max()))
    smooth = np.logical_and.accumulate(jumps(e, l) <= SMOOTH * size, axis=1)
    return np.asarray(DEGREE + 1 - smooth.sum(axis=1), dtype=np.int64)


def from_cable(e: Floats, l: Floats, knots_at: NDArray[np.int64] | None = None) -> BSpline:
    """Clamped cubic spline of a cable mesh ``e`` (n, 4, d), m, with lengths ``l`` (n,), m.

    ``knots_at`` (n - 1): multiplicity at each inner node, 1 to 4 (default: 4 less the number of continuous derivatives,
    at least 1). Raises ValueError if the mesh is less smooth than these knots.
    """
    e, l = np.asarray(e, float), np.asarray(l, float)
    inner = np.maximum(multiplicities(e, l), 1) if knots_at is None else np.asarray(knots_at, dtype=np.int64)
    size = max(float(np.abs(e).max()), 1.0)
    gaps = jumps(e, l)
    for node, (m, gap) in enumerate(zip(inner, gaps, strict=True), 1):
        if not 1 <= m <= DEGREE + 1:
            raise ValueError(f"node {node}: multiplicity {m} is not one of 1 to {DEGREE + 1}")
        worst = gap[: DEGREE + 1 - m].max(initial=0.0)
        if worst > SMOOTH * size:
            raise ValueError(
                f"node {node}: a knot of multiplicity {m} joins C{DEGREE - m}, the mesh jumps by {worst:.3g} m"
            )
    nodes = np.concatenate([[0.0], np.cumsum(l)])
    knots = np.repeat(nodes, np.concatenate([[4], inner, [4]]))
    points = np.empty((control_points(len(knots)), e.shape[2]))
    for i in range(len(points)):
        # element nearest to the middle of the control point's knots: least extrapolation
        at = float(np.clip(knots[i + 1 : i + 4].mean(), nodes[0], nodes[-1]))
        low, high = np.searchsorted(nodes, knots[i], "left"), np.searchsorted(nodes, knots[i + 4], "left") - 1
        k = int(np.clip(np.searchsorted(nodes, at, "right") - 1, low, high))
        f = cable_to_bezier(l[k]) @ e[k]
        for x in knots[i + 1 : i + 4]:
            part = (x - nodes[k]) / l[k]
            f = (1.0 - part) * f[:-1] + part * f[1:]
        points[i] = f[0]
    return BSpline(knots, points, DEGREE)


# Relation (7) and the bicubic patch --------------------------------------------------------------------------------


def control_points(knots: int) -> int:
    """Number of control points n + 1 of a spline with ``knots`` = r + 1 knots: r = n + p + 1, paper (7)."""
    if knots < 2 * (DEGREE + 1):
        raise ValueError(f"{knots} knots: a clamped spline of degree {DEGREE} has {2 * (DEGREE + 1)} at least")
    return knots - DEGREE - 1


def patch_points(knots_u: int, knots_v: int) -> int:
    """Number of control points of a surface (5); 16 for one bicubic patch, however simple its shape."""
    return control_points(knots_u) * control_points(knots_v)


def patch_to_nodes(lx: float, ly: float) -> Floats:
    """Matrix (16, 16) from Bezier points 4 i + j along x, then y, to nodal vectors of a bicubic patch.

    Row 4 a + b is cable coordinate a along x of cable coordinate b along y: r, r_x, r_y and r_xy at the four corners.
    A thin plate of ANCF without r_xy has 12 of the 16 vectors; a flat one needs no more than three.
    """
    return np.asarray(np.kron(bezier_to_cable(lx), bezier_to_cable(ly)), float)


# Equations of knots and of joints ----------------------------------------------------------------------------------
#
# Columns of all equations: the derivatives 0 to 3 along x of the element before the joint, then of the one behind it;
# each derivative of r alone (cable), or of r, r_y and r_z (a beam as a spline solid is cubic along x and linear across,
# so the whole section has one knot vector along x).

VECTORS = {"cable": 1, "beam": 3}  # r, or r and the two directors
JOINTS = ("spherical", "pin", "sliding", "rigid", "smooth", "curvature")


class Demand(NamedTuple):
    """Comparison of a joint between two elements with the knots that could make it."""

    element: str
    joint: str
    equations: int  # scalar equations, by rank
    knot: int | None  # multiplicity that imposes exactly these; None without one
    weaker: int  # smallest multiplicity that imposes only equations of the joint
    missing: int  # equations that the weaker knot lacks


EXPECTED = {  # by hand; element and joint: equations, knot, weaker knot, equations that it lacks
    ("cable", "spherical"): (3, 3, 3, 0),  # C0: the only joint that a knot can make
    ("cable", "pin"): (4, None, 3, 1),  # one equation more than C0, two less than C1
    ("cable", "sliding"): (4, None, 4, 4),  # slopes without positions: not a knot
    ("cable", "rigid"): (6, None, 3, 3),  # C0 and no relative rotation
    ("cable", "smooth"): (6, 2, 2, 0),
    ("cable", "curvature"): (9, 1, 1, 0),
    ("beam", "spherical"): (3, None, 4, 3),  # C0 already holds the whole section
    ("beam", "pin"): (6, None, 4, 6),
    ("beam", "sliding"): (4, None, 4, 4),
    ("beam", "rigid"): (12, None, 4, 12),
    ("beam", "smooth"): (18, 2, 2, 0),
    ("beam", "curvature"): (27, 1, 1, 0),
}


def knot_rows(multiplicity: int, element: str = "cable") -> Floats:
    """Equations of a knot: multiplicity 4 imposes none, each lower one one more derivative (5.3).

    A derivative is three scalar equations of a cable, nine of a beam, for its whole section.
    """
    if not 0 <= multiplicity <= DEGREE + 1:
        raise ValueError(f"multiplicity {multiplicity}: a cubic has 0 to {DEGREE + 1}")
    return _equal(element)[: (DEGREE + 1 - multiplicity) * SPACE * VECTORS[element]]


def _equal(element: str) -> Floats:
    one = np.eye(SPACE * VECTORS[element] * (DEGREE + 1))
    return np.hstack([one, -one])


def joint_rows(joint: str, element: str = "cable", axis: int = 1, turn: Floats | None = None) -> Floats:
    """Equations of a joint between elements along the world's axes; ``turn`` (3, 3) rotates a rigid joint.

    ``spherical`` (1); ``pin`` (2) or (3) about the coordinate ``axis``; ``sliding`` (4) along x with u and m eliminated
    (positions and slopes across x agree); ``rigid``: joined at an angle; ``smooth``: C1; ``curvature``: also equal
    r_xx.
    """
    if joint not in JOINTS:
        raise ValueError(f"joint {joint!r}: one of {', '.join(JOINTS)}")
    n = SPACE * VECTORS[element]  # columns of a derivative
    rows = _equal(element)
    gradients = [*range(n, n + SPACE), *range(SPACE, n)]  # columns of r_x, and of r_y and r_z of a beam
    parts: dict[str, Sequence[int]] = {
        "spherical": (0, 1, 2),
        "pin": (0, 1, 2, *([n + axis] if element == "cable" else gradients[SPACE * axis :][:SPACE])),
        "sliding": (1, 2, n + 1, n + 2),
        "rigid": (0, 1, 2, *gradients),
        "smooth": range(2 * n),
        "curvature": range(3 * n),
    }
    equations = rows[list(parts[joint])]
    if joint == "rigid" and turn is not None:
        # slopes rotate as vectors; gradient transformation: r_k before = sum_m turn[m, k] r_m behind
        by = turn if element == "cable" else np.kron(turn.T, np.eye(SPACE))
        equations[3:, rows.shape[1] // 2 + np.array(gradients)] = -by
    return equations


def _implies(rows: Floats, others: Floats) -> bool:
    return bool(np.linalg.matrix_rank(np.vstack([rows, others])) == np.linalg.matrix_rank(rows))


def demand(joint: str, element: str = "cable", axis: int = 1, turn: Floats | None = None) -> Demand:
    """Compare a joint with every knot multiplicity, by ranks."""
    rows = joint_rows(joint, element, axis, turn)
    count = int(np.linalg.matrix_rank(rows))
    weaker = min(m for m in range(DEGREE + 2) if _implies(rows, knot_rows(m, element)))
    given = len(knot_rows(weaker, element))
    return Demand(element, joint, count, weaker if given == count else None, weaker, count - given)


def table(turn: Floats | None = None) -> list[Demand]:
    """Compare all joints with the knots; rigid ones at a rotation ``turn`` (3, 3), default 90 deg about y."""
    corner = np.array([[0.0, 0, 1], [0, 1, 0], [-1, 0, 0]]) if turn is None else turn
    return [demand(name, element, turn=corner) for element in VECTORS for name in JOINTS]
