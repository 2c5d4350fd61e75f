"""Faces of cables that turn with their axes; see ``faces``. Motion: q, v (nodes, 8), axes; vectors along the axes.

A link has a width: a point lies at r + z n + y (j - b t), with the tangent t in the plane of the axes, the normal
n = t x j, the pin axis j and the yaw b = r_x.j / |r_x| of the link against it. With m = z n + y j and c the slopes of
the shape functions over |r_x| it moves by (S - c t m^T) de; the change of t with the yaw is left out.
"""

from __future__ import annotations

import numpy as np

from fmus.jit import kernel
from fmus.physics.ancf.cable import shape, shape_slope
from fmus.physics.chain.flexible.axes_state import ORIGIN, RATE, VELOCITY, from_axes, to_axes
from fmus.physics.chain.flexible.cable_faces import along  # noqa: F401 - behind the door
from fmus.physics.chain.flexible.node_faces import (  # noqa: F401 - behind the door
    begin,
    count,
    enter,
    length,
    pin_rates,
    pins,
)
from fmus.physics.contact.face import Push
from fmus.physics.vector import add, cross, scale, vector

# sums over the points of a section, by powers of y: how many, f, t f, g, g t, t g, t g t
HITS, FORCE, ALONG, MATRIX, RIGHT, LEFT, BOTH = 0, 1, 4, 6, 15, 21, 27
# and of df / d rate r: r, t r by powers of y; how a rim hears of its rate: by rates of the pins, where, at which side
RATES, TURNED, HEARD, FOOT, OUTWARDS = 30, 33, 35, 36, 37


@kernel
def across(links):
    """See ``faces``."""
    return 2, links.lateral


@kernel
def lift(links, x, i):
    """See ``faces``."""
    return 1.1 * links.face + 0.1 * links.element.l + links.lateral * abs(x.axes[7])


@kernel
def to_ground(links, x, w, p, v):
    """See ``faces``."""
    f = x.axes
    v = add(v, cross(vector(f, RATE), p))
    return add(vector(f, ORIGIN), from_axes(f, p)), add(vector(f, VELOCITY), from_axes(f, v))


@kernel
def from_ground(links, x, w, push, tangent):
    """See ``faces``; that the point's velocity turns with the axes is left out of the matrix."""
    f = x.axes
    if not tangent:
        return Push(to_axes(f, push.f), push.g, push.by_rate, push.normal, push.energy, push.power)
    g = push.g
    a, b, c = to_axes(f, (g[0], g[1], g[2])), to_axes(f, (g[3], g[4], g[5])), to_axes(f, (g[6], g[7], g[8]))
    p, q, r = to_axes(f, (a[0], b[0], c[0])), to_axes(f, (a[1], b[1], c[1])), to_axes(f, (a[2], b[2], c[2]))
    turned = (p[0], q[0], r[0], p[1], q[1], r[1], p[2], q[2], r[2])
    return Push(to_axes(f, push.f), turned, to_axes(f, push.by_rate), push.normal, push.energy, push.power)


@kernel
def section(links, x, w, i, xi, z):
    """Leaves shape functions in ``w.S``, c in ``w.C``, t in ``w.t``, m without y in ``w.axes``, and sums of nothing."""
    S, C, e, de, lever = w.S, w.C, w.e, w.v, w.axes.lever
    shape(links.element, xi, S)
    shape_slope(links.element, xi, C)
    a = b = yaw = da = db = sway = 0.0
    p = v = (0.0, 0.0, 0.0)
    for k in range(4):
        a, yaw, b = a + C[k] * e[k, 0], yaw + C[k] * e[k, 1], b + C[k] * e[k, 2]
        da, sway, db = da + C[k] * de[k, 0], sway + C[k] * de[k, 1], db + C[k] * de[k, 2]
        p, v = add(p, scale(S[k], vector(e[k], 0))), add(v, scale(S[k], vector(de[k], 0)))
    per = 1.0 / np.sqrt(a * a + b * b)
    for k in range(4):
        C[k] *= per
    t0, t2 = a * per, b * per
    w.t[0], w.t[2] = t0, t2
    lever[0], lever[2] = -z * t2, z * t0
    turn = per * z * (t0 * db - t2 * da)
    w.axes.sums[:] = 0.0
    return (p[0] - z * t2, p[1], p[2] + z * t0), (v[0] - turn * t0, v[1], v[2] - turn * t2), per * yaw, per * sway


@kernel
def locate(links, x, w, i, at, y):
    """Leaves y and the point in ``w.axes``."""
    (p, v, yaw, sway), t0, t2, point = at, w.t[0], w.t[2], w.axes.point
    w.axes.lever[1] = y
    point[0], point[1], point[2] = p[0] - y * yaw * t0, p[1] + y, p[2] - y * yaw * t2
    return vector(point, 0), (v[0] - y * sway * t0, v[1], v[2] - y * sway * t2)


@kernel
def _turned(w, f):
    """Book the moment of a force at the point about the axes of yaw and roll."""
    p, moment = w.axes.point, w.axes.moment
    moment[0] -= p[1] * f[2] - p[2] * f[1]
    moment[1] -= p[0] * f[1] - p[1] * f[0]


@kernel
def push(links, w, i, push, tangent):
    """Sum up what the points of a section feel, by powers of y, for ``pushed``."""
    s, t0, t2, y, f, g = w.axes.sums, w.t[0], w.t[2], w.axes.lever[1], push.f, push.g
    _turned(w, f)
    a = f[0] * t0 + f[2] * t2
    s[HITS] += 1.0
    for j in range(3):
        s[FORCE + j] += f[j]
    s[ALONG] += a
    s[ALONG + 1] += y * a
    if not tangent:
        return
    p = g[0] * t0 + g[2] * t2, g[3] * t0 + g[5] * t2, g[6] * t0 + g[8] * t2  # g t
    o = g[0] * t0 + g[6] * t2, g[1] * t0 + g[7] * t2, g[2] * t0 + g[8] * t2  # t g
    r = p[0] * t0 + p[2] * t2
    for j in range(9):
        s[MATRIX + j] += g[j]
    for j in range(3):
        s[RIGHT + j] += p[j]
        s[RIGHT + 3 + j] += y * p[j]
        s[LEFT + j] += o[j]
        s[LEFT + 3 + j] += y * o[j]
    s[BOTH] += r
    s[BOTH + 1] += y * r
    s[BOTH + 2] += y * y * r


@kernel
def pushed(links, w, i, tangent):
    """Force on residual and matrix of the link: R -= B^T f, K -= B^T g B with B = S - c t m^T."""
    S, C, R, K, s, m0, m2 = w.S, w.C, w.load[i], w.stiffening[i], w.axes.sums, w.axes.lever[0], w.axes.lever[2]
    if s[HITS] == 0.0:
        return
    l = s[ALONG] * m0, s[ALONG + 1], s[ALONG] * m2  # of (t f) m
    for k in range(4):
        for j in range(3):
            R[k, j] -= S[k] * s[FORCE + j] - C[k] * l[j]
    if not tangent:
        return
    n = s[BOTH] * m0, s[BOTH + 1], s[BOTH] * m2  # of (t g t) m
    q = s[BOTH + 1] * m0, s[BOTH + 2], s[BOTH + 1] * m2  # times y
    for j in range(3):
        # columns of (g t) m^T, and of m (t g) and m (t g t) m^T
        if j == 1:
            p, u = (s[RIGHT + 3], s[RIGHT + 4], s[RIGHT + 5]), (n[1] * m0, q[1], n[1] * m2)
        else:
            m = m0 if j == 0 else m2
            p, u = scale(m, vector(s, RIGHT)), (n[0] * m, n[1] * m, n[2] * m)
        o = s[LEFT + j] * m0, s[LEFT + 3 + j], s[LEFT + j] * m2
        g = s[MATRIX + j], s[MATRIX + 3 + j], s[MATRIX + 6 + j]
        for b in range(4):
            right, left = add(scale(S[b], g), scale(-C[b], p)), add(scale(S[b], o), scale(-C[b], u))
            for k in range(4):
                for a in range(3):
                    K[3 * k + a, 3 * b + j] -= S[k] * right[a] - C[k] * left[a]
    if s[HEARD] == 0.0:
        return
    l, foot = (s[TURNED] * m0, s[TURNED + 1], s[TURNED] * m2), s[FOOT]
    for k in range(4):
        for a in range(3):
            r = s[HEARD] * (S[k] * s[RATES + a] - C[k] * l[a])
            for j in range(3):
                K[3 * k + a, j] += r * s[OUTWARDS + j] * (1.0 - foot)
                K[3 * k + a, 6 + j] += r * s[OUTWARDS + j] * foot


@kernel
def resist(links, w, i, push, by_rate, foot, side):
    """Sum up r = df / d rate for ``pushed``: K -= B^T r (d rate / d pins); the rate falls as a face moves outwards."""
    s, r, y = w.axes.sums, push.by_rate, w.axes.lever[1]
    a = r[0] * w.t[0] + r[2] * w.t[2]
    s[TURNED] += a
    s[TURNED + 1] += y * a
    s[HEARD], s[FOOT] = by_rate, foot
    for j in range(3):
        s[RATES + j] += r[j]
        s[OUTWARDS + j] = side[j]


@kernel
def locate_pin(links, x, w, i, y):
    """See ``faces``."""
    q, v = x.q[i], x.v[i]
    p, point = (q[0], q[1] + y, q[2]), w.axes.point
    point[0], point[1], point[2] = p
    return p, (v[0], v[1], v[2])


@kernel
def push_pin(links, x, w, i, y, push, tangent):
    """Residual into ``w.b``, matrix into ``w.A``; what the axes' turning does to the pin into their border."""
    f, g, edge, corner = push.f, push.g, w.axes.edge[i], w.axes.corner
    _turned(w, f)
    for a in range(3):
        w.b[i, a] -= f[a]
    if not tangent:
        return
    for a in range(3):
        for b in range(3):
            w.A[i, a, b] -= g[3 * a + b]
    p = w.axes.point
    for a in range(3):
        edge[a, 0] -= g[3 * a + 2] * p[1] - g[3 * a + 1] * p[2]
        edge[a, 1] -= g[3 * a + 1] * p[0] - g[3 * a] * p[1]
    for k in range(2):
        e = (0.0, -p[2], p[1]) if k == 0 else (-p[1], p[0], 0.0)
        for b in range(2):
            h = (0.0, -p[2], p[1]) if b == 0 else (-p[1], p[0], 0.0)
            s = 0.0
            for a in range(3):
                s += e[a] * (g[3 * a] * h[0] + g[3 * a + 1] * h[1] + g[3 * a + 2] * h[2])
            corner[k, b] -= s
