"""What the links and pins of a planar chain touch: ``contacts`` in the plane x, z, by the laws of ``contact.plane``."""

from __future__ import annotations

import numpy as np

from fmus.jit import kernel
from fmus.physics.ancf.cable import shape, shape_slope
from fmus.physics.contact.ground import level
from fmus.physics.contact.plane import Face, collect, press, reach, slide, tooth_face, touch
from fmus.physics.contact.wheel import GAUSS, bulge, covered, creep
from fmus.physics.point import PINS, POINTS
from fmus.track_flexible.planar_nodes import gather
from fmus.track_flexible.sums import CONTACT, COVERING, LOAD, SLIP, note


@kernel
def locate(cable, e, de, xi, offset, S, C):
    """Point at ``xi`` on the face ``offset`` outside the centreline: x, z, their rates, and the tangent in x, z.

    Leaves shape functions in ``S`` (4) and offset x slopes / |r_x| in ``C`` (4), as in ``contacts.locate``.
    """
    shape(cable, xi, S)
    shape_slope(cable, xi, C)
    a = b = da = db = x = z = dx = dz = 0.0
    for k in range(4):
        a += C[k] * e[k, 0]
        b += C[k] * e[k, 1]
        da += C[k] * de[k, 0]
        db += C[k] * de[k, 1]
        x += S[k] * e[k, 0]
        z += S[k] * e[k, 1]
        dx += S[k] * de[k, 0]
        dz += S[k] * de[k, 1]
    rho = np.sqrt(a * a + b * b)
    t0, t2 = a / rho, b / rho
    turn = offset * (t0 * db - t2 * da) / rho
    for k in range(4):
        C[k] *= offset / rho
    return x - offset * t2, z + offset * t0, dx - turn * t0, dz - turn * t2, t0, t2


@kernel
def act(f, S, C, t0, t2, R, K, tangent):
    """A contact force at the point of ``locate`` on residual and matrix of its link: R -= B^T f, K -= B^T f_x B.

    B = S - C t n^T.
    """
    along = f.f0 * t0 + f.f2 * t2
    for k in range(4):
        R[k, 0] -= S[k] * f.f0 + C[k] * along * t2
        R[k, 1] -= S[k] * f.f2 - C[k] * along * t0
    if not tangent:
        return
    # G t, t G and t G t; n = (-t2, t0)
    p0, p2 = f.g00 * t0 + f.g02 * t2, f.g20 * t0 + f.g22 * t2
    o0, o2 = f.g00 * t0 + f.g20 * t2, f.g02 * t0 + f.g22 * t2
    r = p0 * t0 + p2 * t2
    for b in range(4):
        # G B and t G B of this column
        q00, q02 = S[b] * f.g00 + C[b] * p0 * t2, S[b] * f.g02 - C[b] * p0 * t0
        q20, q22 = S[b] * f.g20 + C[b] * p2 * t2, S[b] * f.g22 - C[b] * p2 * t0
        s0, s2 = S[b] * o0 + C[b] * r * t2, S[b] * o2 - C[b] * r * t0
        for a in range(4):
            K[2 * a, 2 * b] -= S[a] * q00 + C[a] * t2 * s0
            K[2 * a, 2 * b + 1] -= S[a] * q02 + C[a] * t2 * s2
            K[2 * a + 1, 2 * b] -= S[a] * q20 - C[a] * t0 * s0
            K[2 * a + 1, 2 * b + 1] -= S[a] * q22 - C[a] * t0 * s2


@kernel
def resist(f, n0, n2, by_rate, foot, S, C, t0, t2, K):
    """The part of the rate at which the rim sinks in: it hangs on the pins, K -= B^T f_rate (d rate / d pins)."""
    along = f.r0 * t0 + f.r2 * t2
    first, last = by_rate * (1.0 - foot), by_rate * foot
    for a in range(4):
        p0, p2 = S[a] * f.r0 + C[a] * along * t2, S[a] * f.r2 - C[a] * along * t0
        # the rate falls as the face moves along its normal
        K[2 * a, 0] += p0 * n0 * first
        K[2 * a, 1] += p0 * n2 * first
        K[2 * a + 1, 0] += p2 * n0 * first
        K[2 * a + 1, 1] += p2 * n2 * first
        K[2 * a, 4] += p0 * n0 * last
        K[2 * a, 5] += p0 * n2 * last
        K[2 * a + 1, 4] += p2 * n0 * last
        K[2 * a + 1, 5] += p2 * n2 * last


@kernel
def open_link(q, v, i, w):
    """Element coordinates and rates of link ``i`` into ``w.e``, ``w.v``; its loads are zeroed at its first contact."""
    j = i + 1 if i + 1 < q.shape[0] else 0
    gather(q, i, j, w.e)
    gather(v, i, j, w.v)
    if not w.touched[i]:
        w.touched[i] = True
        w.load[i] = 0.0
        w.stiffening[i] = 0.0


@kernel
def touch_plane(contacts, links, q, v, w, by_rate, tangent):
    """Faces on rims and ground into ``w.load``, ``w.stiffening``; pins in teeth into ``w.b``, ``w.A``."""
    e, de, S, C, sums, cable, s = w.e, w.v, w.S, w.C, w.sums, links.cable, w.contact
    nodes, m = q.shape[0], contacts.radius.size
    w.touched[:] = False
    for k in range(m):
        row, radius, wrench = w.moved[k], contacts.radius[k], w.wrench[k]
        if contacts.teeth[k]:
            for i in range(nodes):
                d0, d2 = q[i, 0] - row[0], q[i, 1] - row[2]
                if d0 * d0 + d2 * d2 > radius**2:
                    continue
                depth, face = tooth_face(contacts.profile, row, d0, d2, v[i, 0], v[i, 1])
                if depth <= 0.0:
                    continue
                s.point[0] = POINTS * (k * nodes + i) + PINS
                f = touch(contacts.sprocket, 1.0, depth, face, by_rate, s)
                note(sums, depth, f.energy, f.power)
                collect(d0, d2, f, wrench)
                w.b[i, 0] -= f.f0
                w.b[i, 1] -= f.f2
                if tangent:
                    w.A[i, 0, 0] -= f.g00
                    w.A[i, 0, 1] -= f.g02
                    w.A[i, 1, 0] -= f.g20
                    w.A[i, 1, 1] -= f.g22
            continue
        far = (radius + links.face + 0.6 * cable.l) ** 2
        for i in range(links.count):
            j = i + 1 if i + 1 < nodes else 0
            d0, d2 = 0.5 * (q[i, 0] + q[j, 0]) - row[0], 0.5 * (q[i, 1] + q[j, 1]) - row[2]
            if d0 * d0 + d2 * d2 > far:
                continue
            low, high, foot, n0, n2 = reach(row, radius, q[i, 0], q[i, 1], q[j, 0], q[j, 1], links.face)
            if high <= low:
                continue
            open_link(q, v, i, w)
            u0, u2 = (1.0 - foot) * de[0, 0] + foot * de[2, 0], (1.0 - foot) * de[0, 1] + foot * de[2, 1]
            rate = n0 * (row[3] - u0) + n2 * (row[5] - u2)
            # the pins against the wheel: along the normal and along the link, which is normal x y
            a0, a2 = slide(row, q[i, 0] - row[0], q[i, 1] - row[2], de[0, 0], de[0, 1])
            b0, b2 = slide(row, q[j, 0] - row[0], q[j, 1] - row[2], de[2, 0], de[2, 1])
            first, last = (n0 * a0 + n2 * a2, n2 * a0 - n0 * a2), (n0 * b0 + n2 * b2, n2 * b0 - n0 * b2)
            length, part = n2 * (q[j, 0] - q[i, 0]) - n0 * (q[j, 1] - q[i, 1]), (low, high, foot)
            height = n0 * (q[i, 0] - row[0]) + n2 * (q[i, 1] - row[2]) - links.face
            ends = creep(height, length, links.face, part, first, last)
            share = 0.5 * (high - low)
            for side in (-1.0, 1.0):
                xi = 0.5 * (low + high) + side * GAUSS * (high - low)
                x0, x2, u0, u2, t0, t2 = locate(cable, e, de, xi, -links.face, S, C)
                d0, d2 = x0 - row[0], x2 - row[2]
                rho = np.sqrt(d0 * d0 + d2 * d2)
                depth = radius - rho
                if depth <= 0.0 or rho == 0.0:
                    continue
                w0, w2 = slide(row, d0, d2, u0, u2)
                face = Face(d0 / rho, d2 / rho, 1.0 / rho, w0, w2, row[7])
                s.point[0] = POINTS * (k * nodes + i) + int(side > 0.0)
                f = press(contacts.wheel, share, depth, rate, 0.0, face, by_rate, s)
                note(sums, depth, f.energy, f.power)
                slope = -cable.l * (face.n0 * t0 + face.n2 * t2)
                sums[COVERING] += covered(contacts.wheel, share, depth, slope, part, ends, side)
                collect(d0, d2, f, wrench)
                act(f, S, C, t0, t2, w.load[i], w.stiffening[i], tangent)
                if tangent:
                    resist(f, n0, n2, by_rate, foot, S, C, t0, t2, w.stiffening[i])
            stored, power = bulge(contacts.wheel, radius, cable.l, low, high, ends)
            sums[CONTACT] += stored
            sums[COVERING] += power
    if not contacts.ground:
        return
    reach_down, summit = 1.1 * links.face + 0.1 * cable.l, contacts.shape.height + contacts.shape.rise
    for i in range(links.count):
        j = i + 1 if i + 1 < nodes else 0
        if min(q[i, 1], q[j, 1]) - reach_down > summit:
            continue
        open_link(q, v, i, w)
        for side in (-1.0, 1.0):
            x0, x2, u0, u2, t0, t2 = locate(cable, e, de, 0.5 + side * GAUSS, links.face, S, C)
            depth, n0, n2, bend = level(contacts.shape, x0, x2)
            if depth <= 0.0:
                continue
            s.point[0] = POINTS * (m * nodes + i) + int(side > 0.0)
            f = touch(contacts.soil, 0.5, depth, Face(n0, n2, bend, u0, u2, 0.0), by_rate, s)
            note(sums, depth, f.energy, f.power)
            sums[LOAD] += f.normal
            sums[SLIP] -= f.normal * u0
            w.wrench[m, 0] -= f.f0
            w.wrench[m, 2] -= f.f2
            act(f, S, C, t0, t2, w.load[i], w.stiffening[i], tangent)
