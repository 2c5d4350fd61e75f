"""Contact of guide horns, for links that can leave their plane; sibling for other links: ``unguided``."""

from __future__ import annotations

from fmus.jit import kernel
from fmus.physics.chain.faces import along, count, enter, locate, pin_rates, pins, push, pushed, section
from fmus.physics.chain.near import look, reached
from fmus.physics.chain.on_links import WHEELS, feel
from fmus.physics.chain.sums import GUIDES as LOST
from fmus.physics.chain.sums import PATCH_POWER, note
from fmus.physics.contact.face import touch
from fmus.physics.contact.guide import HORN, guide_face
from fmus.physics.contact.wheel import GAUSS, creeping, patch_defect, reach
from fmus.physics.contact.wheel_kinematics import collect
from fmus.physics.point import GUIDES, POINTS
from fmus.physics.vector import dot, vector


@kernel
def overhang(links):
    """See ``faces``."""
    return HORN


@kernel
def guide(links, contacts, x, w, rows, by_rate, tangent):
    """See ``faces``."""
    for k in range(rows.shape[0]):
        if contacts.teeth[k] != 0:
            disc = reached(links, contacts.radius[k])
            look(rows[k], w.near.middle, w.near.off, w.near.square)
            for i in range(count(links, x)[0]):
                if w.near.square[i] <= disc:
                    a, b = pins(links, x, w, i)
                    horn(links, contacts, x, w, k, rows[k], i, a, b, w.near.off[i], by_rate, tangent)


@kernel
def horn(links, contacts, x, w, k, row, i, a, b, off, by_rate, tangent):
    """See ``faces``; its many arguments are what the loops over wheels and links have computed already."""
    disc = contacts.radius[k] + (0.0 if contacts.teeth[k] != 0 else HORN)
    lean = 0.5 * (dot(b, vector(row, 9)) - dot(a, vector(row, 9)))
    if abs(off) + abs(lean) > contacts.clearance:
        _hold(links, contacts, x, w, k, row, i, a, b, disc, by_rate, tangent)


@kernel
def _hold(links, contacts, x, w, k, row, i, a, b, disc, by_rate, tangent):
    """Contact of the horn of link ``i`` with the disc of wheel ``k``, of radius ``disc``, m; see ``horn``."""
    nodes, law, play = count(links, x)[1], contacts.wheel, contacts.clearance
    part, side = reach(row, disc, a, b, links.face)
    low, high, _ = part
    if high <= low:
        return
    enter(links, x, w, i)
    va, vb = pin_rates(links, x, w, i)
    ends = creeping(row, a, b, va, vb, links.face, side, part)
    share = 0.5 * (high - low)
    for g in range(2):
        half = 2.0 * g - 1.0
        at = section(links, x, w, i, 0.5 * (low + high) + half * GAUSS * (high - low), -links.face)
        p, v = locate(links, x, w, i, at, 0.0)
        depth, face = guide_face(row, play, p, v)
        if depth <= 0.0:
            continue
        point = POINTS * (k * nodes + i) + GUIDES + g
        f = touch(law, share, depth, face, by_rate, tangent, w.contact, point)
        note(w.sums, LOST, LOST, depth, f)
        slope = -dot(face.n, along(links, x, w, i))
        w.sums[PATCH_POWER] += patch_defect(law, share, depth, slope, part, ends, half)
        collect(row, p, f.f, w.wrench[k])
        feel(w.on_links, i, WHEELS, f.f)
        push(links, w, i, f, tangent)
        pushed(links, w, i, tangent)
