"""Faces of cable elements in their own plane; see ``faces``. Motion: q, v (nodes, 6), see ``planar_nodes``.

``cable_faces`` where y is zero: what a force does along y is left out.
"""

from __future__ import annotations

import numpy as np

from fmus.jit import kernel
from fmus.physics.ancf.cable import shape, shape_slope
from fmus.physics.chain.flexible.node_faces import begin, count, last, open_link  # noqa: F401 - behind the door
from fmus.physics.chain.flexible.planar_nodes import gather


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
def _in_space(a, i):
    return a[i, 0], 0.0, a[i, 1]


@kernel
def pins(links, x, w, i):
    """See ``faces``."""
    return _in_space(x.q, i), _in_space(x.q, last(x, i))


@kernel
def pin_rates(links, x, w, i):
    """See ``faces``."""
    return _in_space(x.v, i), _in_space(x.v, last(x, i))


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
    a = b = da = db = p0 = p2 = v0 = v2 = 0.0
    for k in range(4):
        a += C[k] * e[k, 0]
        b += C[k] * e[k, 1]
        da += C[k] * de[k, 0]
        db += C[k] * de[k, 1]
        p0 += S[k] * e[k, 0]
        p2 += S[k] * e[k, 1]
        v0 += S[k] * de[k, 0]
        v2 += S[k] * de[k, 1]
    rho = np.sqrt(a * a + b * b)
    t0, t2 = a / rho, b / rho
    turn = z * (t0 * db - t2 * da) / rho
    for k in range(4):
        C[k] *= z / rho
    w.t[0], w.t[2] = t0, t2
    return (p0 - z * t2, 0.0, p2 + z * t0), (v0 - turn * t0, 0.0, v2 - turn * t2)


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
        R[k, 1] -= S[k] * f[2] - C[k] * a * t0
    if not tangent:
        return
    g00, _, g02, _, _, _, g20, _, g22 = push.g
    # g t, t g and t g t; n = (-t2, t0)
    p0, p2 = g00 * t0 + g02 * t2, g20 * t0 + g22 * t2
    o0, o2 = g00 * t0 + g20 * t2, g02 * t0 + g22 * t2
    r = p0 * t0 + p2 * t2
    for b in range(4):
        # g B and t g B of this column
        q00, q02 = S[b] * g00 + C[b] * p0 * t2, S[b] * g02 - C[b] * p0 * t0
        q20, q22 = S[b] * g20 + C[b] * p2 * t2, S[b] * g22 - C[b] * p2 * t0
        s0, s2 = S[b] * o0 + C[b] * r * t2, S[b] * o2 - C[b] * r * t0
        for a in range(4):
            K[2 * a, 2 * b] -= S[a] * q00 + C[a] * t2 * s0
            K[2 * a, 2 * b + 1] -= S[a] * q02 + C[a] * t2 * s2
            K[2 * a + 1, 2 * b] -= S[a] * q20 - C[a] * t0 * s0
            K[2 * a + 1, 2 * b + 1] -= S[a] * q22 - C[a] * t0 * s2


@kernel
def resist(links, w, i, push, by_rate, foot, side):
    """K -= B^T r (d rate / d pins) with r = df / d rate; the rate falls as the face moves along its normal."""
    S, C, K, t0, t2, r = w.S, w.C, w.stiffening[i], w.t[0], w.t[2], push.by_rate
    a, first, last = r[0] * t0 + r[2] * t2, by_rate * (1.0 - foot), by_rate * foot
    for k in range(4):
        p0, p2 = S[k] * r[0] + C[k] * a * t2, S[k] * r[2] - C[k] * a * t0
        K[2 * k, 0] += p0 * side[0] * first
        K[2 * k, 1] += p0 * side[2] * first
        K[2 * k + 1, 0] += p2 * side[0] * first
        K[2 * k + 1, 1] += p2 * side[2] * first
        K[2 * k, 4] += p0 * side[0] * last
        K[2 * k, 5] += p0 * side[2] * last
        K[2 * k + 1, 4] += p2 * side[0] * last
        K[2 * k + 1, 5] += p2 * side[2] * last


@kernel
def locate_pin(links, x, w, i, y):
    """See ``faces``."""
    return _in_space(x.q, i), _in_space(x.v, i)


@kernel
def push_pin(links, x, w, i, y, push, tangent):
    """Residual into ``w.b``, matrix into ``w.A``."""
    f, g = push.f, push.g
    w.b[i, 0] -= f[0]
    w.b[i, 1] -= f[2]
    if tangent:
        w.A[i, 0, 0] -= g[0]
        w.A[i, 0, 1] -= g[2]
        w.A[i, 1, 0] -= g[6]
        w.A[i, 1, 1] -= g[8]
