"""Faces of cable elements, in space or in their own plane; see ``chain.interface``.

Motion: q, v (nodes, 8 or 6). In the plane y is zero and forces along y are left out; ``up`` is the index of z. Contact
points are on the faces of a link, outside or inside the centreline along the normal r_x x e_y. The change of
that normal with the slopes is part of the virtual work: with B = S - C t n^T a point moves by B de.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from fmus.kernels.jit import kernel, namesake
from fmus.physics.ancf.cable import axis_count, shape, shape_slope
from fmus.physics.arrays import Vector
from fmus.physics.chain.flexible.interface import in_space, layout
from fmus.physics.chain.flexible.link_layout import node

if TYPE_CHECKING:
    from fmus.physics.chain.flexible.cables import CableLinks, Cables
    from fmus.physics.chain.flexible.state import Motion, Work
    from fmus.physics.contact.face import ContactForce, Sinking


@namesake
def lateral_points(links: Cables) -> tuple[int, float]:
    return 1, 0.0


@namesake
def depth_below_pins(links: Cables, x: Motion, i: int) -> float:
    return 1.1 * links.face + 0.1 * links.element.l


@namesake
def locate_section(links: Cables, x: Motion, w: Work, i: int, xi: float, z: float) -> tuple[Vector, Vector]:
    """Leaves in ``w`` S, C = z x slopes / |r_x| and the unit tangent t (x, z)."""
    S, C, e, de, up = w.shape_functions, w.shape_slopes, w.coordinates, w.rates, axis_count(links.element) - 1
    shape(links.element, xi, S)
    shape_slope(links.element, xi, C)
    a = b = da = db = p0 = p1 = p2 = v0 = v1 = v2 = 0.0
    for k in range(4):
        a += C[k] * e[k, 0]
        b += C[k] * e[k, up]
        da += C[k] * de[k, 0]
        db += C[k] * de[k, up]
        p0 += S[k] * e[k, 0]
        p2 += S[k] * e[k, up]
        v0 += S[k] * de[k, 0]
        v2 += S[k] * de[k, up]
        if up == 2:
            p1 += S[k] * e[k, 1]
            v1 += S[k] * de[k, 1]
    rho = np.sqrt(a * a + b * b)
    t0, t2 = a / rho, b / rho
    turn = z * (t0 * db - t2 * da) / rho
    for k in range(4):
        C[k] *= z / rho
    w.unit_tangent[0], w.unit_tangent[2] = t0, t2
    return (p0 - z * t2, p1, p2 + z * t0), (v0 - turn * t0, v1, v2 - turn * t2)


@namesake
def locate(
    links: Cables, x: Motion, w: Work, i: int, section: tuple[Vector, Vector], y: float
) -> tuple[Vector, Vector]:
    """A cable has one point, in its middle."""
    return section


@namesake
def position_slope(links: CableLinks, x: Motion, w: Work, i: int) -> Vector:
    l = links.element.l
    return l * w.unit_tangent[0], 0.0, l * w.unit_tangent[2]


@kernel
def apply_force(links: Cables, w: Work, i: int, force: ContactForce, tangent: bool) -> None:
    """Add a force to residual and matrix of the link: R -= B^T f, K -= B^T g B with B = S - C t n^T."""
    S, C, R, K, dims = w.shape_functions, w.shape_slopes, w.load[i], w.stiffening[i], axis_count(links.element)
    t0, t2, f, up = w.unit_tangent[0], w.unit_tangent[2], force.f, dims - 1
    a = f[0] * t0 + f[2] * t2
    for k in range(4):
        R[k, 0] -= S[k] * f[0] + C[k] * a * t2
        R[k, up] -= S[k] * f[2] - C[k] * a * t0
        if up == 2:
            R[k, 1] -= S[k] * f[1]
    if not tangent:
        return
    g00, g01, g02, g10, g11, g12, g20, g21, g22 = force.g
    # g t, t g and t g t; n = (-t2, 0, t0)
    p0, p1, p2 = g00 * t0 + g02 * t2, g10 * t0 + g12 * t2, g20 * t0 + g22 * t2
    o0, o1, o2 = g00 * t0 + g20 * t2, g01 * t0 + g21 * t2, g02 * t0 + g22 * t2
    r = p0 * t0 + p2 * t2
    for b in range(4):
        # columns of g B and of t g B
        s, c = S[b], C[b]
        q00, q01, q02 = s * g00 + c * p0 * t2, s * g01, s * g02 - c * p0 * t0
        q10, q11, q12 = s * g10 + c * p1 * t2, s * g11, s * g12 - c * p1 * t0
        q20, q21, q22 = s * g20 + c * p2 * t2, s * g21, s * g22 - c * p2 * t0
        s0, s1, s2 = s * o0 + c * r * t2, s * o1, s * o2 - c * r * t0
        for a in range(4):
            s, c0, c2, row, column = S[a], C[a] * t2, C[a] * t0, dims * a, dims * b
            K[row, column] -= s * q00 + c0 * s0
            K[row, column + up] -= s * q02 + c0 * s2
            K[row + up, column] -= s * q20 - c2 * s0
            K[row + up, column + up] -= s * q22 - c2 * s2
            if up == 2:
                K[row, column + 1] -= s * q01 + c0 * s1
                K[row + 1, column] -= s * q10
                K[row + 1, column + 1] -= s * q11
                K[row + 1, column + 2] -= s * q12
                K[row + 2, column + 1] -= s * q21 - c2 * s1


@kernel
def add_rate_matrix(links: Cables, w: Work, i: int, force: ContactForce, sinking: Sinking) -> None:
    """Add K -= B^T r (d rate / d pins), r = df / d rate; the rate falls with motion along the normal."""
    by_rate, foot, normal = sinking
    S, C, K, t0, t2 = w.shape_functions, w.shape_slopes, w.stiffening[i], w.unit_tangent[0], w.unit_tangent[2]
    r, dims = force.by_rate, axis_count(links.element)
    a = r[0] * t0 + r[2] * t2
    for k in range(4):
        p = S[k] * r[0] + C[k] * a * t2, S[k] * r[1], S[k] * r[2] - C[k] * a * t0
        for m in range(dims):
            for j in range(dims):
                entry = p[_axis(m, dims)] * by_rate * normal[_axis(j, dims)]
                K[dims * k + m, j] += entry * (1.0 - foot)
                K[dims * k + m, 2 * dims + j] += entry * foot


@kernel
def _axis(k: int, dims: int) -> int:
    """Axis of space of a vector's component ``k``: x or z in the plane."""
    return k if dims == 3 else 2 * k


@namesake
def locate_pin(links: Cables, x: Motion, w: Work, i: int, y: float) -> tuple[Vector, Vector]:
    i = node(layout(links), x.q.shape[0], i)
    return in_space(links, x.q[i]), in_space(links, x.v[i])


@kernel
def apply_pin_force(links: Cables, x: Motion, w: Work, i: int, y: float, force: ContactForce, tangent: bool) -> None:
    """Add a force to residual ``w.right_side`` and matrix ``w.diagonal`` of the pin."""
    f, g, dims, i = force.f, force.g, axis_count(links.element), node(layout(links), x.q.shape[0], i)
    for a in range(dims):
        w.right_side[i, a] -= f[_axis(a, dims)]
    if tangent:
        for a in range(dims):
            for b in range(dims):
                w.diagonal[i, a, b] -= g[3 * _axis(a, dims) + _axis(b, dims)]
