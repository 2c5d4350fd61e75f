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
    length,
    pin_rates,
    pins,
)
from fmus.physics.chain.flexible.node_faces import enter as enter_node
from fmus.physics.contact.face import Push
from fmus.physics.vector import add, cross, dot, put, scale, vector

# sums over the points of a section, each by powers 0 and 1 of y: how many, f, g = df / d place + by_rate df / d rate
HITS, FORCE, MATRIX = 0, 1, 7
# and the damper's df / d rate; how a rim hears of that rate: by rates of the pins, where along the link, on which side
RATES, HEARD, FOOT, OUTWARDS = 25, 31, 32, 33


@kernel
def enter(links, x, w, i):
    """See ``node_faces``."""
    if not w.touched[i]:
        w.axes.turned[i] = 0.0
    enter_node(links, x, w, i)


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
    """Leaves shape functions in ``w.S``, c in ``w.C``, t in ``w.t``, m without y, place and j - b t in ``w.axes``."""
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
    at, sideways = (p[0] - z * t2, p[1], p[2] + z * t0), (-per * yaw * t0, 1.0, -per * yaw * t2)
    put(w.axes.place, 0, at)
    put(w.axes.place, 3, sideways)
    return at, (v[0] - turn * t0, v[1], v[2] - turn * t2), sideways, per * sway


@kernel
def locate(links, x, w, i, at, y):
    """Leaves y in ``w.axes``."""
    p, v, sideways, sway = at
    w.axes.lever[1] = y
    return add(p, scale(y, sideways)), (v[0] - y * sway * w.t[0], v[1], v[2] - y * sway * w.t[2])


@kernel
def push(links, w, i, push, tangent):
    """Sum up what the points of a section feel, by powers of y, for ``pushed``."""
    s, y, f, g = w.axes.sums, w.axes.lever[1], push.f, push.g
    s[HITS] += 1.0
    for j in range(3):
        s[FORCE + j] += f[j]
        s[FORCE + 3 + j] += y * f[j]
    if tangent:
        for j in range(9):
            s[MATRIX + j] += g[j]
            s[MATRIX + 9 + j] += y * g[j]


@kernel
def resist(links, w, i, push, by_rate, foot, side):
    """Sum up df / d rate for ``pushed``; the rate falls as a face moves outwards."""
    s, r, y = w.axes.sums, push.by_rate, w.axes.lever[1]
    s[HEARD], s[FOOT] = by_rate, foot
    for j in range(3):
        s[RATES + j] += r[j]
        s[RATES + 3 + j] += y * r[j]
        s[OUTWARDS + j] = side[j]


@kernel
def _rows(s, i):
    """Of a matrix that lies in ``s`` from ``i`` on."""
    return vector(s, i), vector(s, i + 3), vector(s, i + 6)


@kernel
def _columns(s, i):
    """Of a matrix that lies in ``s`` from ``i`` on: the rows of its transpose."""
    return (s[i], s[i + 3], s[i + 6]), (s[i + 1], s[i + 4], s[i + 7]), (s[i + 2], s[i + 5], s[i + 8])


@kernel
def _times(rows, a):
    """A matrix of these rows times the vector ``a``."""
    return dot(rows[0], a), dot(rows[1], a), dot(rows[2], a)


@kernel
def about_x(a):
    """How the axes' roll moves what is at ``a``."""
    return 0.0, -a[2], a[1]


@kernel
def about_z(a):
    """How their yaw does."""
    return -a[1], a[0], 0.0


@kernel
def _carried(w, h, h_y):
    """A force h that acts with the leverage y as h_y, along the normal, the pin axis and the tangent: what B^T adds."""
    t0, t2, lever = w.t[0], w.t[2], w.axes.lever
    pull = h[0] * t0 + h[2] * t2
    return pull * lever[0], h_y[0] * t0 + h_y[2] * t2, pull * lever[2]


@kernel
def pushed(links, w, i, tangent):
    """Force on residual and matrix of the link, R -= B^T f, K -= B^T g B with B = S - c t m^T; moment; border."""
    S, C, R, s, moment = w.S, w.C, w.load[i], w.axes.sums, w.axes.moment
    if s[HITS] == 0.0:
        return
    f, f_y = vector(s, FORCE), vector(s, FORCE + 3)
    l = _carried(w, f, f_y)
    for k in range(4):
        for j in range(3):
            R[k, j] -= S[k] * f[j] - C[k] * l[j]
    p, d = vector(w.axes.place, 0), vector(w.axes.place, 3)
    moment[0] -= dot(about_x(p), f) + dot(about_x(d), f_y)
    moment[1] -= dot(about_z(p), f) + dot(about_z(d), f_y)
    if tangent:
        _stiffen(w, i)
        _brace(w, i, p, d)


@kernel
def _stiffen(w, i):
    """K -= B^T g B."""
    S, C, K, s, (m0, y, m2) = w.S, w.C, w.stiffening[i], w.axes.sums, vector(w.axes.lever, 0)
    t, g, g_y = (w.t[0], 0.0, w.t[2]), _rows(s, MATRIX), _columns(s, MATRIX)
    p, p_y = _times(g, t), _times(_rows(s, MATRIX + 9), t)  # g t
    o, o_y = _times(g_y, t), _times(_columns(s, MATRIX + 9), t)  # t g
    r, r_y = dot(p, t), dot(p_y, t)
    n, q = (r * m0, r_y, r * m2), (r_y * m0, r * y * y, r_y * m2)  # of (t g t) m; times y
    for j in range(3):
        # columns of (g t) m^T, and of m (t g) and m (t g t) m^T
        if j == 1:
            right, both = p_y, q
        else:
            m = m0 if j == 0 else m2
            right, both = scale(m, p), scale(m, n)
        left, whole = (o[j] * m0, o_y[j], o[j] * m2), (g[0][j], g[1][j], g[2][j])
        for b in range(4):
            one, two = add(scale(S[b], whole), scale(-C[b], right)), add(scale(S[b], left), scale(-C[b], both))
            for k in range(4):
                for a in range(3):
                    K[3 * k + a, 3 * b + j] -= S[k] * one[a] - C[k] * two[a]
    if s[HEARD] == 0.0:
        return
    rate, foot = vector(s, RATES), s[FOOT]
    l = _carried(w, rate, vector(s, RATES + 3))
    for k in range(4):
        for a in range(3):
            r = s[HEARD] * (S[k] * rate[a] - C[k] * l[a])
            for j in range(3):
                K[3 * k + a, j] += r * s[OUTWARDS + j] * (1.0 - foot)
                K[3 * k + a, 6 + j] += r * s[OUTWARDS + j] * foot


@kernel
def _answer(g, g_y, y2, a, a_y):
    """Of the points at p + y d to a motion a + y a_y: the sums of g (a + y a_y), and of y times that."""
    return add(_times(g, a), _times(g_y, a_y)), add(_times(g_y, a), scale(y2, _times(g, a_y)))


@kernel
def _put(w, line, h, h_y):
    """A line of the border -= B^T h."""
    S, C, l = w.S, w.C, _carried(w, h, h_y)
    for n in range(4):
        for j in range(3):
            line[3 * n + j] -= S[n] * h[j] - C[n] * l[j]


@kernel
def _brace(w, i, p, d):
    """The turning of the axes moves a point at p + y d by a = axis x (p + y d).

    Into the border of the link: its residual by the turning, -B^T g a, and the balance of the turning by its
    coordinates, -a^T g B; into the corner the balance by the turning. That forces turn with the axes is left out.
    """
    s, turned, corner, y = w.axes.sums, w.axes.turned[i], w.axes.corner, w.axes.lever[1]
    roll, roll_y, yaw, yaw_y = about_x(p), about_x(d), about_z(p), about_z(d)
    g, g_y = _rows(s, MATRIX), _rows(s, MATRIX + 9)
    h, h_y = _answer(g, g_y, y * y, roll, roll_y)
    k, k_y = _answer(g, g_y, y * y, yaw, yaw_y)
    if s[HEARD] != 0.0:
        rate, rate_y, side, e = vector(s, RATES), vector(s, RATES + 3), vector(s, OUTWARDS), w.e
        one, other = s[HEARD] * (1.0 - s[FOOT]), s[HEARD] * s[FOOT]
        place = add(scale(one, vector(e[0], 0)), scale(other, vector(e[2], 0)))
        slow, slower = -dot(side, about_x(place)), -dot(side, about_z(place))
        h, h_y = add(h, scale(slow, rate)), add(h_y, scale(slow, rate_y))
        k, k_y = add(k, scale(slower, rate)), add(k_y, scale(slower, rate_y))
        felt, sensed = dot(roll, rate) + dot(roll_y, rate_y), dot(yaw, rate) + dot(yaw_y, rate_y)
        for j in range(3):
            turned[2, j] += felt * one * side[j]
            turned[2, 6 + j] += felt * other * side[j]
            turned[3, j] += sensed * one * side[j]
            turned[3, 6 + j] += sensed * other * side[j]
    corner[0, 0] -= dot(roll, h) + dot(roll_y, h_y)
    corner[0, 1] -= dot(roll, k) + dot(roll_y, k_y)
    corner[1, 0] -= dot(yaw, h) + dot(yaw_y, h_y)
    corner[1, 1] -= dot(yaw, k) + dot(yaw_y, k_y)
    _put(w, turned[0], h, h_y)
    _put(w, turned[1], k, k_y)
    g, g_y = _columns(s, MATRIX), _columns(s, MATRIX + 9)
    h, h_y = _answer(g, g_y, y * y, roll, roll_y)
    k, k_y = _answer(g, g_y, y * y, yaw, yaw_y)
    _put(w, turned[2], h, h_y)
    _put(w, turned[3], k, k_y)


@kernel
def locate_pin(links, x, w, i, y):
    """See ``faces``."""
    q, v = x.q[i], x.v[i]
    p = q[0], q[1] + y, q[2]
    put(w.axes.point, 0, p)
    return p, (v[0], v[1], v[2])


@kernel
def push_pin(links, x, w, i, y, push, tangent):
    """Residual into ``w.b``, matrix into ``w.A``; what the turning of the axes does to the pin into their border."""
    p, f, g, edge, corner = vector(w.axes.point, 0), push.f, push.g, w.axes.edge[i], w.axes.corner
    for a in range(3):
        w.b[i, a] -= f[a]
    roll, yaw = about_x(p), about_z(p)
    w.axes.moment[0] -= dot(roll, f)
    w.axes.moment[1] -= dot(yaw, f)
    if not tangent:
        return
    for a in range(3):
        for b in range(3):
            w.A[i, a, b] -= g[3 * a + b]
    rows, columns = (g[:3], g[3:6], g[6:]), (g[::3], g[1::3], g[2::3])
    h, k, balance, other = _times(rows, roll), _times(rows, yaw), _times(columns, roll), _times(columns, yaw)
    for a in range(3):
        edge[a, 0] -= h[a]
        edge[a, 1] -= k[a]
        edge[a, 2] -= balance[a]
        edge[a, 3] -= other[a]
    corner[0, 0] -= dot(roll, h)
    corner[0, 1] -= dot(roll, k)
    corner[1, 0] -= dot(yaw, h)
    corner[1, 1] -= dot(yaw, k)
