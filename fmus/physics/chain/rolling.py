"""Contacts of a chain, for any kind of link: rims, guides and ground at the faces, teeth at the pins.

Faces and forces are those of ``fmus.physics.contact``; ``interface`` leads to the contact points of each kind of link
and the action of forces there. Points are at two places along a covered part (Gauss) and at one or two across.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from fmus.kernels.jit import kernel, namesake, noalias
from fmus.physics.arrays import Floats, Row
from fmus.physics.chain.contacts import DRIVING, LUGGED, TOOTHED, ContactPoint
from fmus.physics.chain.interface import (
    add_rate_matrix,
    apply_force,
    apply_pin_force,
    begin_contacts,
    begin_link,
    count,
    depth_below_pins,
    evaluate_guides,
    evaluate_horn,
    finish_section,
    from_ground,
    horn_height,
    lateral_points,
    length,
    locate,
    locate_pin,
    locate_section,
    pin_positions,
    pin_velocities,
    position_slope,
    record_point,
    to_ground,
)
from fmus.physics.chain.link_columns import GROUND, RIMS, TEETH
from fmus.physics.chain.near import (
    WheelAndLink,
    axis_distance_squared,
    compute_middles,
    contact_distance_squared,
    wheel_distances,
)
from fmus.physics.chain.on_links import add_link_force, add_part, add_sliding, average_sliding, clear
from fmus.physics.chain.report import add_loss
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
    add_contact,
)
from fmus.physics.contact.face import NOT_SINKING, Penetration, Sinking, contact_force, point_contact_force
from fmus.physics.contact.grounds import (
    MIDDLE,
    PLACE,
    SHARE,
    GroundPoint,
    begin_ground,
    commit_ground,
    ground_face,
    ground_force,
    ground_law,
    is_above,
    penetration,
)
from fmus.physics.contact.teeth import tooth_face
from fmus.physics.contact.wheel import (
    GAUSS,
    covered_part,
    end_rates_in_space,
    gauss_excess,
    patch_defect,
    rim_face,
    sink_rate,
)
from fmus.physics.point import PINS, POINTS
from fmus.physics.vector import add, dot, scale, vector
from fmus.physics.wheels import add_reaction

if TYPE_CHECKING:
    from fmus.physics.chain.contacts import Contacts
    from fmus.physics.chain.state import ChainState, ChainWork, FacedLinks, Motion
    from fmus.physics.contact.laws import Law


@namesake
@noalias
def evaluate_contacts(
    links: FacedLinks, contacts: Contacts, x: Motion, w: ChainWork, rows: Floats, by_rate: float, tangent: bool
) -> None:
    begin_contacts(links, x, w)
    clear(w.on_links)
    compute_middles(links, x, w)
    for k in range(rows.shape[0]):
        if contacts.kind[k] == DRIVING:
            _rim(links, contacts, contacts.sprocket, x, w, k, rows[k], by_rate, tangent)
        elif contacts.kind[k] != TOOTHED:
            _rim(links, contacts, contacts.wheel, x, w, k, rows[k], by_rate, tangent)
        if contacts.kind[k] == TOOTHED or contacts.kind[k] == LUGGED:
            _teeth(links, contacts, x, w, k, rows[k], by_rate, tangent)
    evaluate_guides(links, contacts, x, w, rows, by_rate, tangent)
    if contacts.ground != 0:
        _ground(links, contacts, x, w, by_rate, tangent)


@kernel
def _rim(
    links: FacedLinks,
    contacts: Contacts,
    law: Law,
    x: Motion,
    w: ChainWork,
    k: int,
    row: Row,
    by_rate: float,
    tangent: bool,
) -> None:
    """Contact of the rim of wheel ``k`` with the inner faces by ``law``, and of its disc with the guides."""
    (n, nodes), (points_across, lateral), radius = count(links, x), lateral_points(links), contacts.radius[k]
    far = contact_distance_squared(links, radius)
    disc = contact_distance_squared(links, radius + horn_height(links))
    wheel_distances(row, w.near.middle, w.near.offset, w.near.distance_squared)
    for i in range(n):
        distance_squared = w.near.distance_squared[i]
        if distance_squared > disc:
            continue
        a, b = pin_positions(links, x, w, i)
        evaluate_horn(links, contacts, x, w, WheelAndLink(k, row, i, a, b, w.near.offset[i]), by_rate, tangent)
        if distance_squared > far:
            continue
        part, normal = covered_part(row, radius, a, b, links.face)
        low, high, foot = part
        if high <= low:
            continue
        begin_link(links, x, w, i)
        va, vb = pin_velocities(links, x, w, i)
        rate = sink_rate(row, add(scale(1.0 - foot, va), scale(foot, vb)), normal)
        sinking = Sinking(by_rate, foot, normal)
        ends = end_rates_in_space(row, a, b, va, vb, links.face, normal, part)
        share = 0.5 * (high - low) / points_across
        for g in range(2):
            half = 2.0 * g - 1.0
            xi = 0.5 * (low + high) + half * GAUSS * (high - low)
            section = locate_section(links, x, w, i, xi, -links.face)
            for m in range(points_across):
                y = (2.0 * m - 1.0) * lateral
                p, v = locate(links, x, w, i, section, y)
                depth, face = rim_face(row, radius, p, v)
                if depth <= 0.0:
                    continue
                point = POINTS * (k * nodes + i) + points_across * g + m
                force = contact_force(
                    law, share, Penetration(depth, rate, 0.0), face, by_rate, tangent, w.contact, point
                )
                add_contact(w.sums, WHEEL_FRICTION, WHEEL_DAMPING, depth, force)
                slope = -dot(face.n, position_slope(links, x, w, i))
                w.sums[PATCH_POWER] += patch_defect(law, share, depth, slope, part, ends, half)
                add_reaction(row, p, force.f, w.wrench[k])
                add_part(w.on_links, i, RIMS, i, force.f)
                apply_force(links, w, i, force, tangent)
                if tangent:
                    add_rate_matrix(links, w, i, force, sinking)
                    record_point(links, w, ContactPoint(k, i, i, 0, RIMS, (xi, -links.face, y), p), force, sinking)
            finish_section(links, w, i, tangent)
        energy, power = gauss_excess(law, radius, length(links), low, high, ends)
        w.sums[CONTACT] += energy
        w.sums[PATCH_POWER] += power


@kernel
def _teeth(
    links: FacedLinks, contacts: Contacts, x: Motion, w: ChainWork, k: int, row: Row, by_rate: float, tangent: bool
) -> None:
    """Contact of the teeth of sprocket ``k`` with the pins, or with those that have lugs."""
    (n, nodes), (points_across, lateral) = count(links, x), lateral_points(links)
    far = (contacts.profile.top + 2.0 * lateral) ** 2
    for i in range(0, nodes, contacts.lugs):
        for m in range(points_across):
            y = (2.0 * m - 1.0) * lateral
            p, v = locate_pin(links, x, w, i, y)
            if axis_distance_squared(row, p) > far:  # then its other end does not touch either
                break
            depth, face = tooth_face(contacts.profile, row, p, v)
            if depth <= 0.0:
                continue
            point = POINTS * (k * nodes + i) + PINS + m
            force = point_contact_force(
                contacts.sprocket, 1.0 / points_across, depth, face, by_rate, tangent, w.contact, point
            )
            add_contact(w.sums, TOOTH_FRICTION, TOOTH_DAMPING, depth, force)
            add_reaction(row, p, force.f, w.wrench[k])
            link = i - 1 if i > 0 else (n - 1 if nodes == n else 0)
            add_part(w.on_links, link, TEETH, i, force.f)
            apply_pin_force(links, x, w, i, y, force, tangent)
            if tangent:
                record_point(links, w, ContactPoint(k, i, link, 1, TEETH, (0.0, 0.0, y), p), force, NOT_SINKING)


@kernel
def _ground(links: FacedLinks, contacts: Contacts, x: Motion, w: ChainWork, by_rate: float, tangent: bool) -> None:
    """Contact of the ground with the outer faces and the grousers on them."""
    (n, nodes), (points_across, _) = count(links, x), lateral_points(links)
    ground, shape, sections = len(contacts.kind), contacts.shape, contacts.sections
    begin_ground(contacts.soil, w)
    first, on_link = POINTS * ground * nodes, 2 * sections.shape[0]
    for i in range(n):
        a, b = pin_positions(links, x, w, i)
        first_pin, _ = to_ground(links, x, w, a, a)
        last_pin, _ = to_ground(links, x, w, b, b)
        if is_above(shape, first_pin, last_pin, depth_below_pins(links, x, i) + 1.1 * contacts.grouser):
            continue
        begin_link(links, x, w, i)
        along, hits = add(last_pin, scale(-1.0, first_pin)), 0
        for row in range(sections.shape[0]):
            xi, aside, beyond = vector(sections[row], PLACE)
            share, middle, z = sections[row, SHARE] / points_across, sections[row, MIDDLE], links.face + beyond
            section = locate_section(links, x, w, i, xi, z)
            for m in range(points_across):
                y = (2.0 * m - 1.0) * aside
                along_axes = locate(links, x, w, i, section, y)
                p, v = to_ground(links, x, w, *along_axes)
                v = add(v, scale(-1.0, contacts.belt))
                depth, face = ground_face(shape, p, v)
                if depth <= 0.0:
                    continue
                k = points_across * row + m
                point = GroundPoint(share, depth, p, along, middle, first + on_link * i + k, on_link * i + k)
                force = ground_force(ground_law(shape, contacts.soil, p), point, face, by_rate, tangent, w)
                add_contact(w.sums, GROUND_FRICTION, GROUND_DAMPING, penetration(contacts.soil, depth), force)
                w.sums[LOAD] += force.normal
                w.sums[SLIP] -= force.normal * v[0]
                w.sums[SIDESLIP] -= force.normal * v[1]
                for j in range(3):
                    w.wrench[-1, j] -= force.f[j]
                add_link_force(w.on_links, i, GROUND, force.f)
                add_sliding(w.on_links, i, v, depth)
                hits += 1
                force = from_ground(links, x, w, force, tangent)
                apply_force(links, w, i, force, tangent)
                if tangent:
                    touched = ContactPoint(ground, i, i, 0, GROUND, (xi, z, y), along_axes[0])
                    record_point(links, w, touched, force, NOT_SINKING)
            finish_section(links, w, i, tangent)
        average_sliding(w.on_links, i, hits)


@namesake
def commit_contacts(links: FacedLinks, contacts: Contacts, s: ChainState, w: ChainWork, report: Floats) -> None:
    points_across, _ = lateral_points(links)
    compacted, sheared = commit_ground(contacts.soil, contacts.sections, points_across, s, w)
    add_loss(report, GROUND_DAMPING, compacted)
    add_loss(report, GROUND_FRICTION, sheared)
