"""Axes that turn with a chain of cables, and the unknowns of their yaw and roll; see ``axes``.

The pins of a chain share their direction, the y axis. Only contacts turn the chain, so the virtual work of a rotation
of all that the axes carry is zero: the moment of inertia forces, weight and contacts about x and z of the axes
vanishes, and internal forces do not contribute. Newton's iteration has a border of two columns and two rows. The
rotation of a step, the angular velocity and its derivative follow the generalised-alpha method as coordinates, rates
and accelerations do, with R = R(before) exp(psi). The axes do not pitch; their origin follows the middle of the wheels,
and no force depends on it. In an explicit step, accelerations follow from the same border with the mass alone. Wheels
are transformed to the axes; ground forces act in the frame of the start.

The module is long because ``axes`` dispatches all its functions to one module.
"""

from __future__ import annotations

import numpy as np
from scipy.linalg import eigh

from fmus.jit import kernel
from fmus.physics.ancf.cable import linear, mass
from fmus.physics.block_cyclic import solve
from fmus.physics.chain.flexible import inertia
from fmus.physics.chain.flexible.axes_state import (
    ACCELERATION,
    AUXILIARY,
    CARRIED,
    GROWTH,
    MIDDLE,
    ORIGIN,
    RATE,
    ROLL,
    VELOCITY,
    YAW,
    from_axes,
    to_axes,
)
from fmus.physics.chain.flexible.condensation import eliminate
from fmus.physics.chain.flexible.elements import gather
from fmus.physics.chain.on_links import WHEELS
from fmus.physics.integrate.generalized_alpha import auxiliary
from fmus.physics.vector import add, cross, dot, put, scale, vector

FOLLOW = 200.0  # rate at which the origin follows the wheels, critically damped, 1/s
ARM = 2.0  # motion of the pins per radian of the axes, m: the weight of a correction


@kernel
def outside(links, x, w, tangent):
    """See ``axes``: wheels ``w.moved`` relative to the axes into ``w.flat``."""
    f, a = x.axes, w.axes
    o, ov, rate = vector(f, ORIGIN), vector(f, VELOCITY), vector(f, RATE)
    for k in range(w.moved.shape[0]):
        row, seen = w.moved[k], w.flat[k]
        place = to_axes(f, add(vector(row, 0), scale(-1.0, o)))
        put(seen, 0, place)
        put(seen, 3, add(to_axes(f, add(vector(row, 3), scale(-1.0, ov))), scale(-1.0, cross(rate, place))))
        put(seen, 6, add(to_axes(f, vector(row, 6)), scale(-1.0, rate)))
        put(seen, 9, to_axes(f, vector(row, 9)))
        put(seen, 12, to_axes(f, vector(row, 12)))
    put(a.drift, 0, to_axes(f, vector(f, ACCELERATION)))
    a.moment[:] = 0.0
    if tangent:
        a.edge[:] = 0.0
        a.corner[:] = 0.0


@kernel
def homeward(links, x, w):
    """See ``axes``: the wrenches on the wheels; those of the ground already are in that frame."""
    for k in range(w.wrench.shape[0] - 1):
        put(w.wrench[k], 0, from_axes(x.axes, vector(w.wrench[k], 0)))
        put(w.wrench[k], 3, from_axes(x.axes, vector(w.wrench[k], 3)))
    if w.on_links.shape[1] > WHEELS:
        for i in range(w.on_links.shape[0]):
            put(w.on_links[i], WHEELS, from_axes(x.axes, vector(w.on_links[i], WHEELS)))


@kernel
def burden(links, x, w, weight, r):
    """See ``axes``; adds their moment to the balance."""
    f, a, l = x.axes, w.axes, links.element.l
    _whirl(f, w)
    inertia.inertia(4, 3, w.M, w.dv, r)
    about_x = about_z = 0.0
    for k in range(3):
        inertia.weigh(weight * f[6 + k], l, 2, k, r)
    for n in range(4):
        e, q = vector(w.e[n], 0), vector(r[n], 0)
        about_x += e[1] * q[2] - e[2] * q[1]
        about_z += e[0] * q[1] - e[1] * q[0]
    a.moment[0] += about_x
    a.moment[1] += about_z


@kernel
def _whirl(f, w):
    """Add the accelerations due to the motion of the axes to ``w.dv`` of the link in ``w.e``, ``w.v``."""
    drift, roll, yaw, d_roll, d_yaw = vector(w.axes.drift, 0), f[RATE], f[RATE + 2], f[GROWTH], f[GROWTH + 2]
    square = roll * roll + yaw * yaw
    for n in range(4):
        x0, y0, z0 = vector(w.e[n], 0)
        dx, dy, dz = vector(w.v[n], 0)
        along = roll * x0 + yaw * z0
        more = (  # rate' x e + 2 rate x e' + rate x (rate x e)
            roll * along - square * x0 - d_yaw * y0 - 2.0 * yaw * dy,
            d_yaw * x0 - d_roll * z0 - square * y0 + 2.0 * (yaw * dx - roll * dz),
            yaw * along - square * z0 + d_roll * y0 + 2.0 * roll * dy,
        )
        for k in range(3):
            w.dv[n, k] += more[k] + (drift[k] if n % 2 == 0 else 0.0)


@kernel
def accelerated(links, s, w, i, j):
    """See ``axes``."""
    gather(links, s.q, i, j, w.e)
    gather(links, s.v, i, j, w.v)
    gather(links, s.vdot, i, j, w.dv)
    _whirl(s.axes, w)


@kernel
def lagging(links, s, w, i, j):
    """See ``axes``: accelerations of the coordinates, and those by the axes' angular acceleration."""
    gather(links, s.q, i, j, w.e)
    gather(links, s.vdot, i, j, w.dv)
    for n in range(4):
        put(w.dv[n], 0, add(vector(w.dv[n], 0), cross(vector(s.axes, GROWTH), vector(w.e[n], 0))))


@kernel
def upwards(links, s):
    """See ``axes``."""
    return vector(s.axes, 6)


@kernel
def sideways(links, w, r, tangent):
    """See ``axes``: the bending about the normal, of the y components alone."""
    e, l, s = w.e, links.element.l, links.sideways / links.element.l
    d = (e[2, 1] - e[0, 1]) / l
    end = s * (6.0 * (e[1, 1] + e[3, 1]) - 12.0 * d) / l
    r[0, 1] += end
    r[1, 1] += s * (4.0 * e[1, 1] + 2.0 * e[3, 1] - 6.0 * d)
    r[2, 1] -= end
    r[3, 1] += s * (2.0 * e[1, 1] + 4.0 * e[3, 1] - 6.0 * d)
    if tangent:
        near, far, mixed = 4.0 * s, 2.0 * s, 6.0 * s / l
        ends = 2.0 * mixed / l
        rows = (
            (ends, mixed, -ends, mixed),
            (mixed, near, -mixed, far),
            (-ends, -mixed, ends, -mixed),
            (mixed, far, -mixed, near),
        )
        for a in range(4):
            for b in range(4):
                w.K[3 * a + 1, 3 * b + 1] += rows[a][b]


@kernel
def lean(links, w, by_acceleration):
    """See ``axes``: M (axis x e)."""
    K, M = w.K, w.M
    e = vector(w.e[0], 0), vector(w.e[1], 0), vector(w.e[2], 0), vector(w.e[3], 0)
    roll = across = yaw = 0.0
    for n in range(4):
        m = (0.0, 0.0, 0.0)
        for k in range(4):
            m = add(m, scale(M[n, k], e[k]))
        x, y, z = scale(by_acceleration, m)
        roll, across, yaw = roll + e[n][1] * y + e[n][2] * z, across - e[n][2] * x, yaw + e[n][0] * x + e[n][1] * y
        put(K[ROLL], 3 * n, (0.0, -z, y))
        put(K[YAW], 3 * n, (-y, x, 0.0))
        K[3 * n, ROLL], K[3 * n + 1, ROLL], K[3 * n + 2, ROLL] = 0.0, -z, y
        K[3 * n, YAW], K[3 * n + 1, YAW], K[3 * n + 2, YAW] = -y, x, 0.0
    K[ROLL, ROLL], K[ROLL, YAW], K[YAW, ROLL], K[YAW, YAW] = roll, across, across, yaw


@kernel
def border(links, w, i, j):
    """See ``axes``."""
    edge, corner, rest = w.axes.edge, w.axes.corner, w.rest
    for n in range(8):
        pin, place = (i, n) if n < 4 else (j, n - 4)
        for k in range(2):
            edge[pin, place, k] += rest[n, 8 + k]
            edge[pin, place, 2 + k] += rest[8 + k, n]
    for k in range(2):
        for l in range(2):
            corner[k, l] += rest[8 + k, 8 + l]


@kernel
def foresee(links, method, h, s, w):
    """See ``axes``."""
    f, c = s.axes, method.alpha
    rate, growth = vector(f, RATE), vector(f, GROWTH)
    for k in range(2):
        a0 = f[AUXILIARY + k]
        a1 = auxiliary(c, a0, growth[2 * k], growth[2 * k])
        w.axes.psi[k] = h * rate[2 * k] + h * h * ((0.5 - c.beta) * a0 + c.beta * a1)
        f[RATE + 2 * k] += h * ((1.0 - c.gamma) * a0 + c.gamma * a1)
    _turn(f, w.before.axes, w.axes.psi)
    # the origin by the same method, so that forces balance the chain's momentum; implicit: stable at any step
    o, v, a, a0 = vector(f, ORIGIN), vector(f, VELOCITY), vector(f, ACCELERATION), vector(f, CARRIED)
    a1 = auxiliary(c, a0[0], a[0], 0.0), auxiliary(c, a0[1], a[1], 0.0), auxiliary(c, a0[2], a[2], 0.0)
    more = auxiliary(c, 0.0, 0.0, 1.0)  # derivative of a1 by the acceleration at the end
    there = add(o, add(scale(h, v), scale(h * h, add(scale(0.5 - c.beta, a0), scale(c.beta, a1)))))
    going = add(v, scale(h, add(scale(1.0 - c.gamma, a0), scale(c.gamma, a1))))
    by_place, by_rate = more * c.beta * h * h, more * c.gamma * h
    stiff = 1.0 + by_place * FOLLOW * FOLLOW + 2.0 * by_rate * FOLLOW
    after = scale(1.0 / stiff, _after_wheels(f, w, there, going))
    put(f, ORIGIN, add(there, scale(by_place, after)))
    put(f, VELOCITY, add(going, scale(by_rate, after)))
    put(f, ACCELERATION, after)
    put(f, CARRIED, add(a1, scale(more, after)))


@kernel
def _after_wheels(f, w, o, v):
    """Acceleration (3) of the origin at ``o`` with the velocity ``v`` (3), critically damped, m/s2."""
    wheels, m0 = w.moved.shape[0], vector(f, MIDDLE)
    off, slow = add(o, from_axes(f, m0)), add(v, from_axes(f, cross(vector(f, RATE), m0)))
    for k in range(wheels):
        off = add(off, scale(-1.0 / wheels, vector(w.moved[k], 0)))
        slow = add(slow, scale(-1.0 / wheels, vector(w.moved[k], 3)))
    return add(scale(-FOLLOW * FOLLOW, off), scale(-2.0 * FOLLOW, slow))


@kernel
def _turn(f, before, psi):
    """Write R = R(before) exp(psi) to ``f``, Rodrigues' formula; ``psi`` (2) rad about x and z."""
    x, z = psi[0], psi[1]
    square = x * x + z * z
    s, c = 1.0 - square / 6.0, 0.5 - square / 24.0  # sin(a)/a, (1 - cos a)/a^2; a step turns by milliradians
    if square > 1e-4:
        a = np.sqrt(square)
        s, c = np.sin(a) / a, (1.0 - np.cos(a)) / square
    for i in range(3):
        r0, r1, r2 = before[3 * i], before[3 * i + 1], before[3 * i + 2]
        # row r: r + s r [psi x] + c r [psi x]^2 with psi = (x, 0, z)
        f[3 * i] = r0 * (1.0 - c * z * z) + r1 * s * z + r2 * c * x * z
        f[3 * i + 1] = r1 * (1.0 - c * square) - r0 * s * z + r2 * s * x
        f[3 * i + 2] = r2 * (1.0 - c * x * x) + r0 * c * x * z - r1 * s * x


@kernel
def resolve(links, w, fresh):
    """See ``axes``."""
    if not fresh:
        solve(w.A, w.U, w.factors, links.closed == 1, w.b)
        return
    corner, edge, b, d = w.axes.corner, w.axes.edge, w.axes.answer[0], w.axes.answer[1]
    for i in range(b.shape[0]):
        for k in range(b.shape[1]):
            b[i, k], d[i, k] = edge[i, k, 0], edge[i, k, 1]
    solve(w.A, w.U, w.factors, links.closed == 1, w.b, b, d)
    for i in range(b.shape[0]):
        for k in range(b.shape[1]):
            p, q = edge[i, k, 2], edge[i, k, 3]
            corner[0, 0], corner[0, 1] = corner[0, 0] - p * b[i, k], corner[0, 1] - p * d[i, k]
            corner[1, 0], corner[1, 1] = corner[1, 0] - q * b[i, k], corner[1, 1] - q * d[i, k]


@kernel
def _bent(links, x, w, by_acceleration):
    """Solve for the step of roll and yaw, rad, and correct the solutions of the pins and of the links."""
    a, y, own, edge, Z = w.axes, w.b, w.own, w.axes.edge, w.axes.answer
    t0, t1 = a.moment[0] + links.twist * x.axes[GROWTH], a.moment[1] + links.twist * x.axes[GROWTH + 2]
    s00, s11 = a.corner[0, 0] + links.twist * by_acceleration, a.corner[1, 1] + links.twist * by_acceleration
    s01, s10 = a.corner[0, 1], a.corner[1, 0]
    for i in range(links.n):
        for n in range(4):
            t0, t1 = t0 - w.left[i, 8, n] * own[i, n], t1 - w.left[i, 9, n] * own[i, n]
    for i in range(y.shape[0]):
        for k in range(y.shape[1]):
            t0, t1 = t0 - edge[i, k, 2] * y[i, k], t1 - edge[i, k, 3] * y[i, k]
    per = 1.0 / (s00 * s11 - s01 * s10)
    roll, yaw = per * (s11 * t0 - s01 * t1), per * (s00 * t1 - s10 * t0)
    for i in range(y.shape[0]):
        for k in range(y.shape[1]):
            y[i, k] -= Z[0, i, k] * roll + Z[1, i, k] * yaw
    for i in range(links.n):
        for n in range(4):
            own[i, n] -= w.right[i, n, 8] * roll + w.right[i, n, 9] * yaw
    return roll, yaw


@kernel
def bend(links, x, w, by):
    """See ``axes``."""
    a, f = w.axes, x.axes
    roll, yaw = _bent(links, x, w, by.vdot)
    a.psi[0] -= roll
    a.psi[1] -= yaw
    f[RATE] -= by.v * roll
    f[RATE + 2] -= by.v * yaw
    f[GROWTH] -= by.vdot * roll
    f[GROWTH + 2] -= by.vdot * yaw
    _turn(f, w.before.axes, a.psi)
    return ARM * max(abs(roll), abs(yaw))


@kernel
def arrive(links, method, s, w):
    """See ``axes``: the auxiliary accelerations."""
    c, f, before = method.alpha, s.axes, w.before.axes
    for k in range(2):
        f[AUXILIARY + k] = auxiliary(c, before[AUXILIARY + k], before[GROWTH + 2 * k], f[GROWTH + 2 * k])


@kernel
def follow(links, x, w):
    """See ``axes``."""
    f = x.axes
    put(f, ACCELERATION, _after_wheels(f, w, vector(f, ORIGIN), vector(f, VELOCITY)))
    f[GROWTH] = f[GROWTH + 2] = 0.0


@kernel
def swing(links, x, w):
    """See ``axes``: the border of the mass depends on the coordinates."""
    f, nodes = x.axes, x.q.shape[0]
    w.axes.edge[:] = 0.0
    w.axes.corner[:] = 0.0
    for i in range(links.n):
        j = i + 1 if i + 1 < nodes else 0
        gather(links, x.q, i, j, w.e)
        w.K[:] = 0.0
        inertia.add_mass(4, 3, w.M, 1.0, w.K)
        lean(links, w, 1.0)
        eliminate(links, w, i)
        border(links, w, i, j)
    resolve(links, w, True)
    roll, yaw = _bent(links, x, w, 1.0)
    f[GROWTH], f[GROWTH + 2] = -roll, -yaw


@kernel
def rates(links, x, k, at):
    """See ``axes``: R' = R (rate x)."""
    f, rate = x.axes, vector(x.axes, RATE)
    for i in range(3):
        put(k, at + 3 * i, cross(vector(f, 3 * i), rate))
        k[at + ORIGIN + i], k[at + VELOCITY + i], k[at + RATE + i] = f[VELOCITY + i], f[ACCELERATION + i], f[GROWTH + i]
    for i in range(f.size):
        if ACCELERATION <= i < RATE or i >= GROWTH:
            k[at + i] = 0.0


@kernel
def square(links, s):
    """See ``axes``: one step of Newton's iteration for the polar factor, R (3 - R^T R) / 2."""
    f = s.axes
    rows = vector(f, 0), vector(f, 3), vector(f, 6)
    for i in range(3):
        row = rows[i]
        for j in range(3):
            row = add(row, scale((0.5 if i == j else 0.0) - 0.5 * dot(rows[i], rows[j]), rows[j]))
        put(f, 3 * i, row)


def sideways_frequency(links):
    """See ``axes``: of elements with shared slopes, all in phase; a single one (the ends) is stiffer."""
    c, M = links.element, np.zeros((4, 4))
    mass(c, M)
    K = np.array(linear(c._replace(EI=c.EI + links.sideways), 0.0, 0.0))
    if links.closed and links.closing is None:
        both = np.vstack([np.eye(2), np.eye(2)])
        K, M = both.T @ K @ both, both.T @ M @ both
    return np.sqrt(eigh(K, M, eigvals_only=True)[-1])


@kernel
def absolute(links, x, w):
    """See ``axes``; components along the axes."""
    f = x.axes
    rate, drift = vector(f, RATE), to_axes(f, vector(f, VELOCITY))
    for n in range(4):
        v = add(vector(w.v[n], 0), cross(rate, vector(w.e[n], 0)))
        put(w.v[n], 0, add(v, drift) if n % 2 == 0 else v)


@kernel
def risen(links, x, w):
    """See ``axes``."""
    f, l, e, z = x.axes, links.element.l, w.e, x.axes[ORIGIN + 2]
    for k in range(3):
        z += f[6 + k] * inertia.height(l, 2, k, e)
    return z


@kernel
def placed(links, s, p):
    """See ``axes``."""
    return add(vector(s.axes, ORIGIN), from_axes(s.axes, p))


@kernel
def directed(links, s, v):
    """See ``axes``."""
    return from_axes(s.axes, v)


@kernel
def sideways_energy(links, w):
    """See ``axes``."""
    e, s = w.e, links.sideways / links.element.l
    d = (e[2, 1] - e[0, 1]) / links.element.l
    first, second = 4.0 * e[1, 1] + 2.0 * e[3, 1] - 6.0 * d, 6.0 * d - 2.0 * e[1, 1] - 4.0 * e[3, 1]
    return s / 6.0 * (first * first + first * second + second * second)


@kernel
def turning_energy(links, x):
    """See ``axes``."""
    return 0.5 * links.twist * (x.axes[RATE] ** 2 + x.axes[RATE + 2] ** 2)
