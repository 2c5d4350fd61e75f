"""What the links and pins of a chain of beams touch: rims and ground at their faces, teeth at the pins, guides.

A material point of a beam is linear in its coordinates, x = S(xi, y, z) e, so a contact force f acts as S^T f and its
derivatives as S^T f_x S: no moment is left out, whichever way the link is turned. The points are those of the rigid
links: two by two on a face, two across a pin, guide horns on the middle of the inner face.
"""

from __future__ import annotations

from fmus.jit import kernel
from fmus.physics.ancf.beam import shape
from fmus.physics.contact.ground import ground_contact
from fmus.physics.contact.guide import HORN, guide_contact
from fmus.physics.contact.partner import collect
from fmus.physics.contact.teeth import teeth_contact
from fmus.physics.contact.wheel import GAUSS, bulge, closing, covered, creeping, reach, wheel_contact
from fmus.physics.point import GUIDES, PINS, POINTS
from fmus.track_flexible.beams import gather
from fmus.track_flexible.sums import CONTACT, COVERING, LOAD, SIDESLIP, SLIP, note


@kernel
def locate(beam, e, de, xi, y, z, S, x, u):
    """The material point at ``xi``, ``y``, ``z``: shape functions ``S`` (8), position ``x`` (3), velocity ``u`` (3)."""
    shape(beam, xi, y, z, S)
    for i in range(3):
        x[i] = u[i] = 0.0
        for a in range(8):
            x[i] += S[a] * e[a, i]
            u[i] += S[a] * de[a, i]


@kernel
def push(s, by_rate, tangent, S, R, K):
    """Put the contact force in the scratch ``s`` on its link: R -= S^T f, K -= S^T (f_x + by_rate f_v) S."""
    for a in range(8):
        for i in range(3):
            R[a, i] -= S[a] * s.f[i]
    if not tangent:
        return
    for i in range(3):
        for j in range(3):
            g = s.f_x[i, j] + by_rate * s.f_v[i, j]
            for a in range(8):
                for b in range(8):
                    K[3 * a + i, 3 * b + j] -= S[a] * g * S[b]


@kernel
def resist(s, by_rate, foot, S, K):
    """The part of the rate at which the rim sinks in: it hangs on the pins, K -= S^T f_rate (d rate / d pins)."""
    for a in range(8):
        for i in range(3):
            g = by_rate * S[a] * s.f_rate[i]
            for j in range(3):
                K[3 * a + i, j] += g * (1.0 - foot) * s.side[j]
                K[3 * a + i, 12 + j] += g * foot * s.side[j]


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
def _steeper(first, last, n):
    """How fast a depth along ``n`` grows by the fraction of the link between two pins; of its bending nothing."""
    return n[0] * (first[0] - last[0]) + n[1] * (first[1] - last[1]) + n[2] * (first[2] - last[2])


# The contact loops run over the whole chain: handing a tuple of thirty arrays to a kernel a link costs more than the
# contact itself.


@kernel
def _wheels(contacts, links, q, v, w, by_rate, tangent):
    """Rims on the inner faces, discs against the guide horns."""
    e, de, S, x, u, sums, s = w.e, w.v, w.S, w.x, w.u, w.sums, w.contact
    moved, wrench, R, K, beam = w.moved, w.wrench, w.load, w.stiffening, links.beam
    nodes = q.shape[0]
    for k in range(contacts.radius.size):
        row, radius, toothed = moved[k], contacts.radius[k], contacts.teeth[k] != 0
        disc = radius if toothed else radius + HORN
        far = (disc + links.face + 0.6 * beam.l) ** 2 + 4.0 * links.lateral**2
        for i in range(links.count):
            j = i + 1 if i + 1 < nodes else 0
            square, off, lean = 0.0, 0.0, 0.0
            for a in range(3):
                d = 0.5 * (q[i, a] + q[j, a]) - row[a]
                square += d * d
                off += d * row[9 + a]
                lean += 0.5 * (q[j, a] - q[i, a]) * row[9 + a]
            if square > far:
                continue
            if not toothed:
                part = reach(row, radius, q[i, :3], q[j, :3], links.face, s.side)
                low, high, foot = part
                if high > low:
                    open_link(q, v, i, w)
                    for a in range(3):
                        u[a] = (1.0 - foot) * de[0, a] + foot * de[4, a]
                    rate = closing(row, u, s.side)
                    ends = creeping(row, (q[i], de[0]), (q[j], de[4]), links.face, s.side, part, s.w)
                    share = 0.25 * (high - low)
                    for g in range(4):
                        xi = low + (high - low) * (0.5 + (2 * (g // 2) - 1) * GAUSS)
                        locate(beam, e, de, xi, (2 * (g % 2) - 1) * links.lateral, -links.face, S, x, u)
                        s.point[0] = POINTS * (k * nodes + i) + g
                        depth, _, stored, power, _ = wheel_contact(
                            contacts.wheel, share, radius, row, x, u, rate, s, tangent
                        )
                        if depth > 0.0:
                            note(sums, depth, stored, power)
                            slope = _steeper(q[i], q[j], s.n)
                            sums[COVERING] += covered(contacts.wheel, share, depth, slope, part, ends, 2 * (g // 2) - 1)
                            collect(row, x, s.f, wrench[k])
                            push(s, by_rate, tangent, S, R[i], K[i])
                            if tangent:
                                resist(s, by_rate, foot, S, K[i])
                    stored, power = bulge(contacts.wheel, radius, beam.l, low, high, ends)
                    sums[CONTACT] += stored
                    sums[COVERING] += power
            if abs(off) + abs(lean) <= contacts.clearance:
                continue
            part = reach(row, disc, q[i, :3], q[j, :3], links.face, s.side)
            low, high, _ = part
            if high <= low:
                continue
            open_link(q, v, i, w)
            ends = creeping(row, (q[i], de[0]), (q[j], de[4]), links.face, s.side, part, s.w)
            share = 0.5 * (high - low)
            for side in (-1.0, 1.0):
                xi = 0.5 * (low + high) + side * GAUSS * (high - low)
                locate(beam, e, de, xi, 0.0, -links.face, S, x, u)
                s.point[0] = POINTS * (k * nodes + i) + GUIDES + int(side > 0.0)
                depth, _, stored, power, _ = guide_contact(
                    contacts.wheel, share, contacts.clearance, row, x, u, s, tangent
                )
                if depth > 0.0:
                    note(sums, depth, stored, power)
                    slope = _steeper(q[i], q[j], s.n)
                    sums[COVERING] += covered(contacts.wheel, share, depth, slope, part, ends, side)
                    collect(row, x, s.f, wrench[k])
                    push(s, by_rate, tangent, S, R[i], K[i])


@kernel
def _soil(contacts, links, q, v, w, by_rate, tangent):
    """Four points of each outer face on the ground."""
    e, de, S, x, u, sums, s = w.e, w.v, w.S, w.x, w.u, w.sums, w.contact
    wrench, R, K, beam = w.wrench[w.moved.shape[0]], w.load, w.stiffening, links.beam
    nodes, summit = q.shape[0], contacts.shape.height + contacts.shape.rise
    for i in range(links.count):
        j = i + 1 if i + 1 < nodes else 0
        lean = links.lateral * max(abs(q[i, 5]), abs(q[j, 5]))  # a pin's ends, by the rise of its axis
        if min(q[i, 2], q[j, 2]) - lean - 1.1 * links.face - 0.1 * beam.l > summit:
            continue
        open_link(q, v, i, w)
        for g in range(4):
            xi = 0.5 + (2 * (g // 2) - 1) * GAUSS
            locate(beam, e, de, xi, (2 * (g % 2) - 1) * links.lateral, links.face, S, x, u)
            s.point[0] = POINTS * (w.moved.shape[0] * nodes + i) + g
            depth, normal, stored, power, _ = ground_contact(
                contacts.soil, 0.25, contacts.shape, x, u, s, tangent
            )
            if depth > 0.0:
                note(sums, depth, stored, power)
                sums[LOAD] += normal
                sums[SLIP] -= normal * u[0]
                sums[SIDESLIP] -= normal * u[1]
                for a in range(3):
                    wrench[a] -= s.f[a]
                push(s, by_rate, tangent, S, R[i], K[i])


@kernel
def _teeth(contacts, links, q, v, w, by_rate, tangent):
    """Teeth on the pins, at two places across; the residual goes into ``w.b``, the matrix into ``w.A``."""
    x, u, s = w.x, w.u, w.contact
    for k in range(contacts.radius.size):
        if not contacts.teeth[k]:
            continue
        row = w.moved[k]
        far = contacts.radius[k] ** 2 + 4.0 * links.lateral**2
        for i in range(q.shape[0]):
            square = 0.0
            for a in range(3):
                square += (q[i, a] - row[a]) ** 2
            if square > far:
                continue
            for y in (-links.lateral, links.lateral):
                for a in range(3):
                    x[a] = q[i, a] + y * q[i, 3 + a]
                    u[a] = v[i, a] + y * v[i, 3 + a]
                s.point[0] = POINTS * (k * q.shape[0] + i) + PINS + int(y > 0.0)
                depth, _, stored, power, _ = teeth_contact(
                    contacts.sprocket, 0.5, contacts.profile, row, x, u, s, tangent
                )
                if depth <= 0.0:
                    continue
                note(w.sums, depth, stored, power)
                collect(row, x, s.f, w.wrench[k])
                for a in range(3):
                    w.b[i, a] -= s.f[a]
                    w.b[i, 3 + a] -= y * s.f[a]
                    if tangent:
                        for b in range(3):
                            g = s.f_x[a, b] + by_rate * s.f_v[a, b]
                            w.A[i, a, b] -= g
                            w.A[i, a, 3 + b] -= y * g
                            w.A[i, 3 + a, b] -= y * g
                            w.A[i, 3 + a, 3 + b] -= y * y * g


@kernel
def touch(contacts, links, q, v, w, by_rate, tangent):
    """All contacts of the chain: of links into ``w.load`` and ``w.stiffening``, of pins into ``w.b`` and ``w.A``."""
    w.touched[:] = False
    _wheels(contacts, links, q, v, w, by_rate, tangent)
    if contacts.ground:
        _soil(contacts, links, q, v, w, by_rate, tangent)
    _teeth(contacts, links, q, v, w, by_rate, tangent)
