"""What the links of a rigid chain touch: rims, teeth, guides and ground."""

from __future__ import annotations

from fmus.jit import kernel
from fmus.physics.contact.ground import ground_contact
from fmus.physics.contact.guide import HORN, guide_contact
from fmus.physics.contact.partner import collect
from fmus.physics.contact.teeth import teeth_contact
from fmus.physics.contact.wheel import GAUSS, bulge, closing, covered, creeping, reach, wheel_contact
from fmus.physics.point import GUIDES, PINS, POINTS
from fmus.physics.vector import dot
from fmus.track_rigid.loads import CONTACT, COVERING, LOAD, SIDESLIP, SLIP, count, lever, push, resist

# The contact loops below run over the whole chain and take arrays out of the tuples first: handing a tuple of thirty
# arrays to a kernel a link costs more than the contact itself.


@kernel
def _rims(link, law, contacts, s, w, by_v, tangent):
    """Rolling contact of the links' inner faces on all smooth contacts."""
    A, r, K, rows, p, N, c = w.system.A, w.system.r, w.system.K, w.rows, w.point, w.N, w.contact
    q, v, F, tally, pins = s.q, s.v, s.F, s.tally, s.lam.shape[0]
    for k in range(rows.shape[0]):
        if contacts.teeth[k] != 0:
            continue
        row, radius = rows[k], contacts.radius[k]
        near = (radius + link.face + link.half) ** 2 + 4.0 * link.lateral**2
        for i in range(q.shape[0]):
            if (q[i, 0] - row[0]) ** 2 + (q[i, 1] - row[1]) ** 2 + (q[i, 2] - row[2]) ** 2 > near:
                continue
            lever(A[i], v[i], q[i], -link.half, 0.0, 0.0, N[0])
            lever(A[i], v[i], q[i], link.half, 0.0, 0.0, N[1])
            part = reach(row, radius, N[0, 0], N[1, 0], link.face, c.side)
            low, high, foot = part
            if high <= low:
                continue
            ends = creeping(row, (N[0, 0], N[0, 1]), (N[1, 0], N[1, 1]), link.face, c.side, part, c.w)
            lever(A[i], v[i], q[i], (2.0 * foot - 1.0) * link.half, 0.0, 0.0, p)
            rate = closing(row, p[1], c.side)
            share = 0.25 * (high - low)
            for g in range(4):
                along = 2.0 * (low + (high - low) * (0.5 + (2 * (g // 2) - 1) * GAUSS)) - 1.0
                lever(A[i], v[i], q[i], along * link.half, (2 * (g % 2) - 1) * link.lateral, -link.face, p)
                c.point[0] = POINTS * (k * pins + i) + g
                depth, _, energy, power, _ = wheel_contact(
                    law, share, radius, row, p[0], p[1], rate, c, tangent
                )
                if depth > 0.0:
                    count(tally, depth, energy, power)
                    slope = -2.0 * link.half * dot(c.n, A[i, :, 0])
                    tally[COVERING] += covered(law, share, depth, slope, part, ends, 2 * (g // 2) - 1)
                    collect(row, p[0], c.f, F[k])
                    push(A[i], p[2], 1.0, c, by_v, tangent, N, r[i], K[i])
                    if tangent:
                        resist(A[i], N[0], (2.0 * foot - 1.0) * link.half, c, by_v, K[i])
            energy, power = bulge(law, radius, 2.0 * link.half, low, high, ends)
            tally[CONTACT] += energy
            tally[COVERING] += power


@kernel
def _teeth(link, closed, law, contacts, s, w, by_v, tangent):
    """Pins in the teeth, at two places across; half of the force goes to each of a pin's links."""
    A, r, K, rows, p, N, c = w.system.A, w.system.r, w.system.K, w.rows, w.point, w.N, w.contact
    q, v, F, tally, n, pins = s.q, s.v, s.F, s.tally, s.q.shape[0], s.lam.shape[0]
    for k in range(rows.shape[0]):
        if contacts.teeth[k] == 0:
            continue
        row = rows[k]
        near = contacts.radius[k] ** 2 + 4.0 * link.lateral**2
        for j in range(s.lam.shape[0]):
            before, after = (j - 1 if j > 0 or not closed else n - 1), (j if j < n else -1)
            i = after if after >= 0 else before
            end = -link.half if after >= 0 else link.half
            square = 0.0
            for a in range(3):
                square += (q[i, a] + end * A[i, a, 0] - row[a]) ** 2
            if square > near:
                continue
            share = 1.0 if before < 0 or after < 0 else 0.5
            for g in range(2):
                lateral = (2 * g - 1) * link.lateral
                lever(A[i], v[i], q[i], end, lateral, 0.0, p)
                c.point[0] = POINTS * (k * pins + j) + PINS + g
                depth, _, energy, power, _ = teeth_contact(
                    law, 0.5, contacts.profile, row, p[0], p[1], c, tangent
                )
                if depth <= 0.0:
                    continue
                count(tally, depth, energy, power)
                collect(row, p[0], c.f, F[k])
                for a in range(3):
                    s.load[j, a] += c.f[a]
                push(A[i], p[2], share, c, by_v, tangent, N, r[i], K[i])
                if share < 1.0:
                    for a in range(3):  # the same point seen from the other link
                        p[2, a] = link.half * A[before, a, 0] + lateral * A[before, a, 1]
                    push(A[before], p[2], share, c, by_v, tangent, N, r[before], K[before])


@kernel
def _guides(link, law, contacts, s, w, by_v, tangent):
    """Guide horns against the wheels' discs, at two places of the part of a link that is inside the disc."""
    A, r, K, rows, p, N, c = w.system.A, w.system.r, w.system.K, w.rows, w.point, w.N, w.contact
    q, v, F, tally, pins = s.q, s.v, s.F, s.tally, s.lam.shape[0]
    for k in range(rows.shape[0]):
        row, radius = rows[k], contacts.radius[k] + (0.0 if contacts.teeth[k] != 0 else HORN)
        for i in range(q.shape[0]):
            off, lean, square = 0.0, 0.0, 0.0
            for j in range(3):
                d = q[i, j] - row[j]
                off += d * row[9 + j]
                lean += A[i, j, 0] * row[9 + j]
                square += d * d
            if abs(off) + abs(lean) * link.half <= contacts.clearance:
                continue
            if square - off * off > (radius + link.face + link.half) ** 2:
                continue
            lever(A[i], v[i], q[i], -link.half, 0.0, 0.0, N[0])
            lever(A[i], v[i], q[i], link.half, 0.0, 0.0, N[1])
            part = reach(row, radius, N[0, 0], N[1, 0], link.face, c.side)
            low, high, _ = part
            if high <= low:
                continue
            ends = creeping(row, (N[0, 0], N[0, 1]), (N[1, 0], N[1, 1]), link.face, c.side, part, c.w)
            share = 0.5 * (high - low)
            for g in range(2):
                along = 2.0 * (low + (high - low) * (0.5 + (2 * g - 1) * GAUSS)) - 1.0
                lever(A[i], v[i], q[i], along * link.half, 0.0, -link.face, p)
                c.point[0] = POINTS * (k * pins + i) + GUIDES + g
                depth, _, energy, power, _ = guide_contact(
                    law, share, contacts.clearance, row, p[0], p[1], c, tangent
                )
                if depth > 0.0:
                    count(tally, depth, energy, power)
                    slope = -2.0 * link.half * dot(c.n, A[i, :, 0])
                    tally[COVERING] += covered(law, share, depth, slope, part, ends, 2 * g - 1)
                    collect(row, p[0], c.f, F[k])
                    push(A[i], p[2], 1.0, c, by_v, tangent, N, r[i], K[i])


@kernel
def _soil(link, law, ground, s, w, by_v, tangent):
    """Four points of each outer face on the ground."""
    A, r, K, p, N, c = w.system.A, w.system.r, w.system.K, w.point, w.N, w.contact
    q, v, F, tally, pins = s.q, s.v, s.F[w.rows.shape[0]], s.tally, s.lam.shape[0]
    for i in range(q.shape[0]):
        if q[i, 2] - link.face - link.half > ground.height + ground.rise:
            continue
        for g in range(4):
            along, lateral = 2.0 * (2 * (g // 2) - 1) * GAUSS * link.half, (2 * (g % 2) - 1) * link.lateral
            lever(A[i], v[i], q[i], along, lateral, link.face, p)
            c.point[0] = POINTS * (w.rows.shape[0] * pins + i) + g
            depth, force, energy, power, _ = ground_contact(law, 0.25, ground, p[0], p[1], c, tangent)
            if depth > 0.0:
                count(tally, depth, energy, power)
                tally[LOAD] += force
                tally[SLIP] -= force * p[1, 0]
                tally[SIDESLIP] -= force * p[1, 1]
                for a in range(3):
                    F[a] += c.f[a]
                push(A[i], p[2], 1.0, c, by_v, tangent, N, r[i], K[i])


@kernel
def touch(contacts, link, closed, s, w, by_v, tangent):
    """All contacts of the chain: residuals, with ``tangent`` their matrices, wrenches and the tally."""
    if w.rows.shape[0] > 0:
        _rims(link, contacts.wheel, contacts, s, w, by_v, tangent)
        _teeth(link, closed, contacts.sprocket, contacts, s, w, by_v, tangent)
        _guides(link, contacts.wheel, contacts, s, w, by_v, tangent)
    if contacts.ground != 0:
        _soil(link, contacts.soil, contacts.shape, s, w, by_v, tangent)
