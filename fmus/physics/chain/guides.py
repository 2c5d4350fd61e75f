"""Contact of guide horns, for links that can leave their plane; none by default."""

from __future__ import annotations

from typing import TYPE_CHECKING

from fmus.kernels.jit import kernel, namesake
from fmus.physics.arrays import Floats
from fmus.physics.chain.contacts import TOOTHED, ContactPoint
from fmus.physics.chain.interface import (
    apply_force,
    begin_link,
    count,
    finish_section,
    locate,
    locate_section,
    pin_positions,
    pin_velocities,
    position_slope,
    record_point,
)
from fmus.physics.chain.link_columns import HORNS
from fmus.physics.chain.near import WheelAndLink, contact_distance_squared, wheel_distances
from fmus.physics.chain.on_links import add_part
from fmus.physics.chain.sums import GUIDES as GUIDE_LOSSES
from fmus.physics.chain.sums import PATCH_POWER, add_contact
from fmus.physics.contact.face import NOT_SINKING, point_contact_force
from fmus.physics.contact.guide import HORN, guide_face
from fmus.physics.contact.wheel import GAUSS, covered_part, end_rates_in_space, patch_defect
from fmus.physics.point import GUIDES, POINTS
from fmus.physics.vector import dot, vector
from fmus.physics.wheels import add_reaction

if TYPE_CHECKING:
    from fmus.physics.chain.contacts import Contacts
    from fmus.physics.chain.state import ChainWork, FacedLinks, Motion


@namesake
def horn_height(links: FacedLinks) -> float:
    return HORN


@namesake
def evaluate_guides(
    links: FacedLinks, contacts: Contacts, x: Motion, w: ChainWork, rows: Floats, by_rate: float, tangent: bool
) -> None:
    for k in range(rows.shape[0]):
        if contacts.kind[k] == TOOTHED:
            disc = contact_distance_squared(links, contacts.radius[k])
            wheel_distances(rows[k], w.near.middle, w.near.offset, w.near.distance_squared)
            for i in range(count(links, x)[0]):
                if w.near.distance_squared[i] <= disc:
                    a, b = pin_positions(links, x, w, i)
                    pair = WheelAndLink(k, rows[k], i, a, b, w.near.offset[i])
                    evaluate_horn(links, contacts, x, w, pair, by_rate, tangent)


@namesake
def evaluate_horn(
    links: FacedLinks, contacts: Contacts, x: Motion, w: ChainWork, pair: WheelAndLink, by_rate: float, tangent: bool
) -> None:
    k, row, _, a, b, offset = pair
    disc = contacts.radius[k] + (0.0 if contacts.kind[k] == TOOTHED else HORN)
    inclination = 0.5 * (dot(b, vector(row, 9)) - dot(a, vector(row, 9)))
    if abs(offset) + abs(inclination) > contacts.clearance:
        _touch_disc(links, contacts, x, w, pair, disc, by_rate, tangent)


@kernel
def _touch_disc(
    links: FacedLinks,
    contacts: Contacts,
    x: Motion,
    w: ChainWork,
    pair: WheelAndLink,
    disc: float,
    by_rate: float,
    tangent: bool,
) -> None:
    """Contact of the horn of the link with the disc of the wheel, of radius ``disc``, m; see ``evaluate_horn``."""
    k, row, i, a, b, _ = pair
    nodes, law, play = count(links, x)[1], contacts.wheel, contacts.clearance
    part, normal = covered_part(row, disc, a, b, links.face)
    low, high, _ = part
    if high <= low:
        return
    begin_link(links, x, w, i)
    va, vb = pin_velocities(links, x, w, i)
    ends = end_rates_in_space(row, a, b, va, vb, links.face, normal, part)
    share = 0.5 * (high - low)
    for g in range(2):
        half = 2.0 * g - 1.0
        xi = 0.5 * (low + high) + half * GAUSS * (high - low)
        section = locate_section(links, x, w, i, xi, -links.face)
        p, v = locate(links, x, w, i, section, 0.0)
        depth, face = guide_face(row, play, p, v)
        if depth <= 0.0:
            continue
        point = POINTS * (k * nodes + i) + GUIDES + g
        force = point_contact_force(law, share, depth, face, by_rate, tangent, w.contact, point)
        add_contact(w.sums, GUIDE_LOSSES, GUIDE_LOSSES, depth, force)
        slope = -dot(face.n, position_slope(links, x, w, i))
        w.sums[PATCH_POWER] += patch_defect(law, share, depth, slope, part, ends, half)
        add_reaction(row, p, force.f, w.wrench[k])
        add_part(w.on_links, i, HORNS, i, force.f)
        apply_force(links, w, i, force, tangent)
        if tangent:
            record_point(links, w, ContactPoint(k, i, i, 0, HORNS, (xi, -links.face, 0.0), p), force, NOT_SINKING)
        finish_section(links, w, i, tangent)
