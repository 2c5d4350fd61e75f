"""What the links and pins of a chain of cable elements touch: rims and ground at their faces, teeth at the pins.

Contact points lie on the faces of a link, ``face`` outside or inside the centreline along the normal r_x x e_y; the
change of that normal with the slopes is part of the virtual work.
"""

from __future__ import annotations

import numpy as np

from fmus.jit import kernel
from fmus.physics.ancf.cable import shape, shape_slope
from fmus.physics.contact.ground import ground_contact
from fmus.physics.contact.partner import collect
from fmus.physics.contact.teeth import teeth_contact
from fmus.physics.contact.wheel import GAUSS, bulge, closing, covered, creeping, reach, wheel_contact
from fmus.physics.point import PINS, POINTS
from fmus.track_flexible.nodes import gather
from fmus.track_flexible.sums import CONTACT, COVERING, LOAD, SIDESLIP, SLIP, note


@kernel
def locate(cable, e, de, xi, offset, S, C, x, u):
    """Point at ``xi`` on the face ``offset`` outside the centreline: position ``x`` (3) and velocity ``u`` (3).

    Leaves shape functions in ``S`` (4) and offset x slopes / |r_x| in ``C`` (4). Returns tangent (in x, z).
    The normal is r_x x e_y; its change is -tangent (normal . dr_x) / |r_x|.
    """
    shape(cable, xi, S)
    shape_slope(cable, xi, C)
    a = b = da = db = 0.0
    for k in range(4):
        a += C[k] * e[k, 0]
        b += C[k] * e[k, 2]
        da += C[k] * de[k, 0]
        db += C[k] * de[k, 2]
    rho = np.sqrt(a * a + b * b)
    t0, t2 = a / rho, b / rho
    turn = offset * (t0 * db - t2 * da) / rho
    for i in range(3):
        x[i] = S[0] * e[0, i] + S[1] * e[1, i] + S[2] * e[2, i] + S[3] * e[3, i]
        u[i] = S[0] * de[0, i] + S[1] * de[1, i] + S[2] * de[2, i] + S[3] * de[3, i]
    x[0] -= offset * t2
    x[2] += offset * t0
    u[0] -= turn * t0
    u[2] -= turn * t2
    for k in range(4):
        C[k] *= offset / rho
    return t0, t2


@kernel
def push(f, S, C, t0, t2, R):
    """Put a contact force at the point of ``locate`` on the residual of its link: R -= B^T f with B = S - C t n^T."""
    along = f[0] * t0 + f[2] * t2
    for k in range(4):
        R[k, 0] -= S[k] * f[0] + C[k] * along * t2
        R[k, 1] -= S[k] * f[1]
        R[k, 2] -= S[k] * f[2] - C[k] * along * t0


@kernel
def stiffen(f_x, f_v, by_rate, S, C, t0, t2, K):
    """Its part of the iteration matrix: K -= B^T (f_x + by_rate f_v) B."""
    g00, g01, g02 = (
        f_x[0, 0] + by_rate * f_v[0, 0],
        f_x[0, 1] + by_rate * f_v[0, 1],
        f_x[0, 2] + by_rate * f_v[0, 2],
    )
    g10, g11, g12 = (
        f_x[1, 0] + by_rate * f_v[1, 0],
        f_x[1, 1] + by_rate * f_v[1, 1],
        f_x[1, 2] + by_rate * f_v[1, 2],
    )
    g20, g21, g22 = (
        f_x[2, 0] + by_rate * f_v[2, 0],
        f_x[2, 1] + by_rate * f_v[2, 1],
        f_x[2, 2] + by_rate * f_v[2, 2],
    )
    # G t, t G and t G t; n = (-t2, 0, t0)
    p0, p1, p2 = g00 * t0 + g02 * t2, g10 * t0 + g12 * t2, g20 * t0 + g22 * t2
    o0, o1, o2 = g00 * t0 + g20 * t2, g01 * t0 + g21 * t2, g02 * t0 + g22 * t2
    r = p0 * t0 + p2 * t2
    for a in range(4):
        for b in range(4):
            ss, sc, cs, cc = S[a] * S[b], S[a] * C[b], C[a] * S[b], C[a] * C[b] * r
            K[3 * a, 3 * b] -= ss * g00 + sc * p0 * t2 + cs * t2 * o0 + cc * t2 * t2
            K[3 * a, 3 * b + 1] -= ss * g01 + cs * t2 * o1
            K[3 * a, 3 * b + 2] -= ss * g02 - sc * p0 * t0 + cs * t2 * o2 - cc * t2 * t0
            K[3 * a + 1, 3 * b] -= ss * g10 + sc * p1 * t2
            K[3 * a + 1, 3 * b + 1] -= ss * g11
            K[3 * a + 1, 3 * b + 2] -= ss * g12 - sc * p1 * t0
            K[3 * a + 2, 3 * b] -= ss * g20 + sc * p2 * t2 - cs * t0 * o0 - cc * t0 * t2
            K[3 * a + 2, 3 * b + 1] -= ss * g21 - cs * t0 * o1
            K[3 * a + 2, 3 * b + 2] -= ss * g22 - sc * p2 * t0 - cs * t0 * o2 + cc * t0 * t0


@kernel
def resist(f_rate, side, by_rate, foot, S, C, t0, t2, K):
    """The part of the rate at which the rim sinks in: it hangs on the pins, K -= B^T f_rate (d rate / d pins)."""
    along = f_rate[0] * t0 + f_rate[2] * t2
    for a in range(4):
        p0, p1, p2 = (
            S[a] * f_rate[0] + C[a] * along * t2,
            S[a] * f_rate[1],
            S[a] * f_rate[2] - C[a] * along * t0,
        )
        for j in range(3):
            first, last = by_rate * (1.0 - foot) * side[j], by_rate * foot * side[j]
            K[3 * a, j] += p0 * first
            K[3 * a + 1, j] += p1 * first
            K[3 * a + 2, j] += p2 * first
            K[3 * a, 6 + j] += p0 * last
            K[3 * a + 1, 6 + j] += p1 * last
            K[3 * a + 2, 6 + j] += p2 * last


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
def touch_links(contacts, links, q, v, w, by_rate, tangent):
    """Contacts of the links' faces with rims and ground: residuals ``w.load``, matrices ``w.stiffening``.

    One call for the whole chain: handing a tuple of thirty arrays to a kernel a link costs more than the contact.
    """
    e, de, S, C, x, u, sums, s = w.e, w.v, w.S, w.C, w.x, w.u, w.sums, w.contact
    moved, wrench, R, K, cable = w.moved, w.wrench, w.load, w.stiffening, links.cable
    nodes, m = q.shape[0], contacts.radius.size
    w.touched[:] = False
    for k in range(m):
        if contacts.teeth[k]:
            continue
        row, radius = moved[k], contacts.radius[k]
        far = (radius + links.face + 0.6 * cable.l) ** 2
        for i in range(links.count):
            j = i + 1 if i + 1 < nodes else 0
            d0, d2 = 0.5 * (q[i, 0] + q[j, 0]) - row[0], 0.5 * (q[i, 2] + q[j, 2]) - row[2]
            if d0 * d0 + d2 * d2 > far:
                continue
            part = reach(row, radius, q[i], q[j], links.face, s.side)
            low, high, foot = part
            if high <= low:
                continue
            open_link(q, v, i, w)
            for a in range(3):
                u[a] = (1.0 - foot) * de[0, a] + foot * de[2, a]
            rate = closing(row, u, s.side)
            ends = creeping(row, (q[i], de[0]), (q[j], de[2]), links.face, s.side, part, s.w)
            share = 0.5 * (high - low)
            for side in (-1.0, 1.0):
                xi = 0.5 * (low + high) + side * GAUSS * (high - low)
                t0, t2 = locate(cable, e, de, xi, -links.face, S, C, x, u)
                s.point[0] = POINTS * (k * nodes + i) + int(side > 0.0)
                depth, _, stored, power, _ = wheel_contact(
                    contacts.wheel, share, radius, row, x, u, rate, s, tangent
                )
                if depth > 0.0:
                    note(sums, depth, stored, power)
                    slope = -cable.l * (s.n[0] * t0 + s.n[2] * t2)
                    sums[COVERING] += covered(contacts.wheel, share, depth, slope, part, ends, side)
                    collect(row, x, s.f, wrench[k])
                    push(s.f, S, C, t0, t2, R[i])
                    if tangent:
                        stiffen(s.f_x, s.f_v, by_rate, S, C, t0, t2, K[i])
                        resist(s.f_rate, s.side, by_rate, foot, S, C, t0, t2, K[i])
            stored, power = bulge(contacts.wheel, radius, cable.l, low, high, ends)
            sums[CONTACT] += stored
            sums[COVERING] += power
    if not contacts.ground:
        return
    reach_down, summit = 1.1 * links.face + 0.1 * cable.l, contacts.shape.height + contacts.shape.rise
    for i in range(links.count):
        j = i + 1 if i + 1 < nodes else 0
        if min(q[i, 2], q[j, 2]) - reach_down > summit:
            continue
        open_link(q, v, i, w)
        for side in (-1.0, 1.0):
            t0, t2 = locate(cable, e, de, 0.5 + side * GAUSS, links.face, S, C, x, u)
            s.point[0] = POINTS * (m * nodes + i) + int(side > 0.0)
            depth, normal, stored, power, _ = ground_contact(
                contacts.soil, 0.5, contacts.shape, x, u, s, tangent
            )
            if depth > 0.0:
                note(sums, depth, stored, power)
                sums[LOAD] += normal
                sums[SLIP] -= normal * u[0]
                sums[SIDESLIP] -= normal * u[1]
                for a in range(3):
                    wrench[m, a] -= s.f[a]
                push(s.f, S, C, t0, t2, R[i])
                if tangent:
                    stiffen(s.f_x, s.f_v, by_rate, S, C, t0, t2, K[i])


@kernel
def touch_pins(contacts, q, v, w, by_rate, tangent):
    """Teeth on the pins; the residual goes into ``w.b``, the matrix into ``w.A``."""
    nodes = q.shape[0]
    for k in range(contacts.radius.size):
        if not contacts.teeth[k]:
            continue
        row = w.moved[k]
        for i in range(nodes):
            d0, d2 = q[i, 0] - row[0], q[i, 2] - row[2]
            if d0 * d0 + d2 * d2 > contacts.radius[k] ** 2:
                continue
            w.contact.point[0] = POINTS * (k * nodes + i) + PINS
            depth, _, stored, power, _ = teeth_contact(
                contacts.sprocket, 1.0, contacts.profile, row, q[i, :3], v[i, :3], w.contact, tangent
            )
            if depth <= 0.0:
                continue
            note(w.sums, depth, stored, power)
            collect(row, q[i, :3], w.contact.f, w.wrench[k])
            for a in range(3):
                w.b[i, a] -= w.contact.f[a]
                if tangent:
                    for b in range(3):
                        w.A[i, a, b] -= w.contact.f_x[a, b] + by_rate * w.contact.f_v[a, b]
