"""Faces of cable elements; see ``faces``. Motion: q, v (nodes, 8), see ``cable_nodes``.

Contact points lie on the faces of a link, outside or inside the centreline along the normal r_x x e_y; the change of
that normal with the slopes is part of the virtual work: with B = S - C t n^T a point moves by B de.
"""

from __future__ import annotations

import numpy as np

from fmus.jit import kernel
from fmus.physics.ancf.cable import shape, shape_slope
from fmus.physics.chain.flexible.cable_nodes import gather
from fmus.physics.chain.flexible.node_faces import (  # noqa: F401 - behind the door
    begin,
    count,
    last,
    open_link,
    pin_rates,
    pins,
)
from fmus.physics.vector import vector


@kernel
def across(links):
    """See ``faces``."""
    return 1, 0.0


@kernel
def length(links):
    """See ``faces``."""
    return links.cable.l


@kernel
def lift(links, x, i):
    """See ``faces``."""
    return 1.1 * links.face + 0.1 * links.cable.l


@kernel
def enter(links, x, w, i):
    """Coordinates and rates of the link into ``w.e``, ``w.v``; its loads are zeroed at its first contact."""
    j = last(x, i)
    gather(x.q, i, j, w.e)
    gather(x.v, i, j, w.v)
    open_link(w, i)


@kernel
def locate(links, x, w, i, xi, y, z):
    """Leaves shape functions in ``w.S``, z x slopes / |r_x| in ``w.C``, the tangent along x and z in ``w.t``."""
    S, C, e, de = w.S, w.C, w.e, w.v
    shape(links.cable, xi, S)
    shape_slope(links.cable, xi, C)
    a = b = da = db = 0.0
    for k in range(4):
        a += C[k] * e[k, 0]
        b += C[k] * e[k, 2]
        da += C[k] * de[k, 0]
        db += C[k] * de[k, 2]
    rho = np.sqrt(a * a + b * b)
    t0, t2 = a / rho, b / rho
    turn = z * (t0 * db - t2 * da) / rho
    for k in range(4):
        C[k] *= z / rho
    w.t[0], w.t[2] = t0, t2
    return (
        (
            S[0] * e[0, 0] + S[1] * e[1, 0] + S[2] * e[2, 0] + S[3] * e[3, 0] - z * t2,
            S[0] * e[0, 1] + S[1] * e[1, 1] + S[2] * e[2, 1] + S[3] * e[3, 1],
            S[0] * e[0, 2] + S[1] * e[1, 2] + S[2] * e[2, 2] + S[3] * e[3, 2] + z * t0,
        ),
        (
            S[0] * de[0, 0] + S[1] * de[1, 0] + S[2] * de[2, 0] + S[3] * de[3, 0] - turn * t0,
            S[0] * de[0, 1] + S[1] * de[1, 1] + S[2] * de[2, 1] + S[3] * de[3, 1],
            S[0] * de[0, 2] + S[1] * de[1, 2] + S[2] * de[2, 2] + S[3] * de[3, 2] - turn * t2,
        ),
    )


@kernel
def along(links, x, w, i):
    """See ``faces``."""
    l = links.cable.l
    return l * w.t[0], 0.0, l * w.t[2]


@kernel
def push(links, w, i, push, tangent):
    """Force on residual and matrix of the link: R -= B^T f, K -= B^T g B with B = S - C t n^T."""
    S, C, R, K = w.S, w.C, w.load[i], w.stiffening[i]
    t0, t2, f = w.t[0], w.t[2], push.f
    a = f[0] * t0 + f[2] * t2
    for k in range(4):
        R[k, 0] -= S[k] * f[0] + C[k] * a * t2
        R[k, 1] -= S[k] * f[1]
        R[k, 2] -= S[k] * f[2] - C[k] * a * t0
    if not tangent:
        return
    g00, g01, g02, g10, g11, g12, g20, g21, g22 = push.g
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
            s, c0, c2 = S[a], C[a] * t2, C[a] * t0
            K[3 * a, 3 * b] -= s * q00 + c0 * s0
            K[3 * a, 3 * b + 1] -= s * q01 + c0 * s1
            K[3 * a, 3 * b + 2] -= s * q02 + c0 * s2
            K[3 * a + 1, 3 * b] -= s * q10
            K[3 * a + 1, 3 * b + 1] -= s * q11
            K[3 * a + 1, 3 * b + 2] -= s * q12
            K[3 * a + 2, 3 * b] -= s * q20 - c2 * s0
            K[3 * a + 2, 3 * b + 1] -= s * q21 - c2 * s1
            K[3 * a + 2, 3 * b + 2] -= s * q22 - c2 * s2


@kernel
def resist(links, w, i, push, by_rate, foot, side):
    """K -= B^T r (d rate / d pins) with r = df / d rate; the rate falls as the face moves along its normal."""
    S, C, K, t0, t2, r = w.S, w.C, w.stiffening[i], w.t[0], w.t[2], push.by_rate
    a = r[0] * t0 + r[2] * t2
    for k in range(4):
        p = S[k] * r[0] + C[k] * a * t2, S[k] * r[1], S[k] * r[2] - C[k] * a * t0
        for j in range(3):
            first, last = by_rate * (1.0 - foot) * side[j], by_rate * foot * side[j]
            K[3 * k, j] += p[0] * first
            K[3 * k + 1, j] += p[1] * first
            K[3 * k + 2, j] += p[2] * first
            K[3 * k, 6 + j] += p[0] * last
            K[3 * k + 1, 6 + j] += p[1] * last
            K[3 * k + 2, 6 + j] += p[2] * last


@kernel
def locate_pin(links, x, w, i, y):
    """See ``faces``."""
    return vector(x.q[i], 0), vector(x.v[i], 0)


@kernel
def push_pin(links, x, w, i, y, push, tangent):
    """Residual into ``w.b``, matrix into ``w.A``."""
    f, g = push.f, push.g
    for a in range(3):
        w.b[i, a] -= f[a]
    if tangent:
        for a in range(3):
            for b in range(3):
                w.A[i, a, b] -= g[3 * a + b]
