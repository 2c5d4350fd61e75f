"""Contacts of a chain, for any kind of link: rims, guides and ground at the faces, teeth at the pins.

Faces and forces are those of ``fmus.physics.contact``; ``faces`` dispatches to the contact points of each kind of link
and the action of forces there. Points are at two places along a covered part (Gauss) and at one or two across.
"""

from __future__ import annotations

from fmus.jit import kernel, noalias
from fmus.physics.chain.faces import (
    across,
    along,
    begin,
    count,
    enter,
    from_ground,
    guide,
    horn,
    length,
    lift,
    locate,
    locate_pin,
    overhang,
    pin_rates,
    pins,
    push,
    push_pin,
    pushed,
    resist,
    section,
    to_ground,
)
from fmus.physics.chain.near import beyond, look, reached, survey
from fmus.physics.chain.on_links import GROUND, WHEELS, clear, feel, rest, slide
from fmus.physics.chain.sums import (
    CONTACT,
    GROUND_DAMPING,
    GROUND_FRICTION,
    LOAD,
    PATCH_POWER,
    SIDESLIP,
    SLIP,
    TOOTH_DAMPING,
    TOOTH_FRICTION,
    WHEEL_DAMPING,
    WHEEL_FRICTION,
    note,
)
from fmus.physics.contact.face import press, touch
from fmus.physics.contact.ground import ground_face
from fmus.physics.contact.teeth import tooth_face
from fmus.physics.contact.wheel import GAUSS, bulge, closing, creeping, patch_defect, reach, rim_face
from fmus.physics.contact.wheel_kinematics import collect
from fmus.physics.point import PINS, POINTS
from fmus.physics.vector import add, dot, scale


@kernel
@noalias
def roll(links, contacts, x, w, rows, by_rate, tangent):
    """Evaluate all contacts of a chain with the wheels ``rows`` (m, 15) and the ground.

    ``x``: motion of the chain. Residuals, reactions, energies and powers, with ``tangent`` also iteration matrices, go
    to the arrays ``w``; ``by_rate``, 1/s, is d velocity / d position.
    """
    begin(links, x, w)
    clear(w.on_links)
    survey(links, x, w)
    for k in range(rows.shape[0]):
        if contacts.teeth[k] == 0:
            _rim(links, contacts, x, w, k, rows[k], by_rate, tangent)
        if contacts.teeth[k] != 0:
            _teeth(links, contacts, x, w, k, rows[k], by_rate, tangent)
    guide(links, contacts, x, w, rows, by_rate, tangent)
    if contacts.ground != 0:
        _soil(links, contacts, x, w, by_rate, tangent)


@kernel
def _rim(links, contacts, x, w, k, row, by_rate, tangent):
    """Contact of the rim of wheel ``k`` with the inner faces, and of its disc with the guides."""
    (n, nodes), (places, side_by), law, radius = count(links, x), across(links), contacts.wheel, contacts.radius[k]
    far, disc = reached(links, radius), reached(links, radius + overhang(links))
    look(row, w.near.middle, w.near.off, w.near.square)
    for i in range(n):
        square = w.near.square[i]
        if square > disc:
            continue
        a, b = pins(links, x, w, i)
        horn(links, contacts, x, w, k, row, i, a, b, w.near.off[i], by_rate, tangent)
        if square > far:
            continue
        part, side = reach(row, radius, a, b, links.face)
        low, high, foot = part
        if high <= low:
            continue
        enter(links, x, w, i)
        va, vb = pin_rates(links, x, w, i)
        rate = closing(row, add(scale(1.0 - foot, va), scale(foot, vb)), side)
        ends = creeping(row, a, b, va, vb, links.face, side, part)
        share = 0.5 * (high - low) / places
        for g in range(2):
            half = 2.0 * g - 1.0
            at = section(links, x, w, i, 0.5 * (low + high) + half * GAUSS * (high - low), -links.face)
            for m in range(places):
                p, v = locate(links, x, w, i, at, (2.0 * m - 1.0) * side_by)
                depth, face = rim_face(row, radius, p, v)
                if depth <= 0.0:
                    continue
                point = POINTS * (k * nodes + i) + places * g + m
                f = press(law, share, depth, rate, 0.0, face, by_rate, tangent, w.contact, point)
                note(w.sums, WHEEL_FRICTION, WHEEL_DAMPING, depth, f)
                slope = -dot(face.n, along(links, x, w, i))
                w.sums[PATCH_POWER] += patch_defect(law, share, depth, slope, part, ends, half)
                collect(row, p, f.f, w.wrench[k])
                feel(w.on_links, i, WHEELS, f.f)
                push(links, w, i, f, tangent)
                if tangent:
                    resist(links, w, i, f, by_rate, foot, side)
            pushed(links, w, i, tangent)
        stored, power = bulge(law, radius, length(links), low, high, ends)
        w.sums[CONTACT] += stored
        w.sums[PATCH_POWER] += power


@kernel
def _teeth(links, contacts, x, w, k, row, by_rate, tangent):
    """Contact of the teeth of sprocket ``k`` with the pins."""
    (n, nodes), (places, side_by) = count(links, x), across(links)
    far = (contacts.profile.top + 2.0 * side_by) ** 2
    for i in range(nodes):
        for m in range(places):
            y = (2.0 * m - 1.0) * side_by
            p, v = locate_pin(links, x, w, i, y)
            if beyond(row, p) > far:  # then its other end does not touch either
                break
            depth, face = tooth_face(contacts.profile, row, p, v)
            if depth <= 0.0:
                continue
            point = POINTS * (k * nodes + i) + PINS + m
            f = touch(contacts.sprocket, 1.0 / places, depth, face, by_rate, tangent, w.contact, point)
            note(w.sums, TOOTH_FRICTION, TOOTH_DAMPING, depth, f)
            collect(row, p, f.f, w.wrench[k])
            feel(w.on_links, i - 1 if i > 0 else (n - 1 if nodes == n else 0), WHEELS, f.f)
            push_pin(links, x, w, i, y, f, tangent)


@kernel
def _soil(links, contacts, x, w, by_rate, tangent):
    """Contact of the ground with the outer faces."""
    (n, nodes), (places, side_by), law = count(links, x), across(links), contacts.soil
    summit, first = contacts.shape.height + contacts.shape.rise, POINTS * len(contacts.teeth) * nodes
    for i in range(n):
        a, b = pins(links, x, w, i)
        (_, _, one), _ = to_ground(links, x, w, a, a)
        (_, _, other), _ = to_ground(links, x, w, b, b)
        if min(one, other) - lift(links, x, i) > summit:
            continue
        enter(links, x, w, i)
        hits = 0
        for g in range(2):
            at = section(links, x, w, i, 0.5 + (2.0 * g - 1.0) * GAUSS, links.face)
            for m in range(places):
                p, v = to_ground(links, x, w, *locate(links, x, w, i, at, (2.0 * m - 1.0) * side_by))
                depth, face = ground_face(contacts.shape, p, v)
                if depth <= 0.0:
                    continue
                point = first + POINTS * i + places * g + m
                f = touch(law, 0.5 / places, depth, face, by_rate, tangent, w.contact, point)
                note(w.sums, GROUND_FRICTION, GROUND_DAMPING, depth, f)
                w.sums[LOAD] += f.normal
                w.sums[SLIP] -= f.normal * v[0]
                w.sums[SIDESLIP] -= f.normal * v[1]
                for j in range(3):
                    w.wrench[-1, j] -= f.f[j]
                feel(w.on_links, i, GROUND, f.f)
                slide(w.on_links, i, v, depth)
                hits += 1
                push(links, w, i, from_ground(links, x, w, f, tangent), tangent)
            pushed(links, w, i, tangent)
        rest(w.on_links, i, hits)
