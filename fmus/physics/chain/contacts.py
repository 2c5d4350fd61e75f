"""Contacts of a chain: its partners, and the record of a contact point with the derivatives of its force."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from fmus.kernels.jit import kernel
from fmus.physics import point as at
from fmus.physics.arrays import Vector
from fmus.physics.vector import put

if TYPE_CHECKING:
    from fmus.physics.contact.face import ContactForce, Sinking
    from fmus.physics.contact.laws import Law
    from fmus.physics.contact.teeth import Teeth
    from fmus.physics.point import ContactPoints

# kinds of wheels; driving: by friction of the rim; lugged: teeth push some pins, and a rim bears the links
RIM, TOOTHED, DRIVING, LUGGED = range(4)


class Contacts(NamedTuple):
    """Contact partners of a chain with m wheels, constant through a run."""

    kind: np.ndarray  # (m) int: RIM, TOOTHED, DRIVING or LUGGED
    radius: np.ndarray  # (m) radius of the rim, m; of teeth, the outer radius of the pins' path
    profile: Teeth  # outline of the teeth, without influence where there are none
    lugs: int  # pins from one that the teeth push to the next, beginning with the first pin
    clearance: float  # lateral play of the guides on each side, m
    ground: int  # 1 where there is a ground
    shape: Any  # shape of the ground (``grounds``) in the track's frame
    belt: Vector  # velocity of the ground's surface in that frame, m/s
    sprocket: Law  # contact law of pins with teeth, or of links with the rim that drives,
    wheel: Law  # of links with other rims and of horns with discs,
    soil: Any  # and of links with the ground (``grounds``)
    sections: np.ndarray  # (k, 7) of a link with points on the ground; columns in ``grounds``
    grouser: float  # height of the grousers of a link, m


class ContactPoint(NamedTuple):
    """Contact point of a chain with m wheels."""

    partner: int  # index of the wheel; m: the ground
    body: int  # index of the link, or of the pin
    link: int  # index of the link that is said to bear the force
    on_pin: int  # 1: on a pin, 0: on a face
    column: int  # of the force in ``on_links``
    place: Vector  # xi, z and y of ``locate``; of a pin only y
    position: Vector  # along the axes of the chain's coordinates, m


def most_points(contacts: Contacts, pitch: float, nodes: int) -> int:
    """Most contact points of a chain of ``nodes`` pins whose links lie side by side round wheels and on the ground."""
    links = np.ceil(2.0 * np.pi * (contacts.radius / pitch + 1.0)) + 1.0
    return at.POINTS * int(np.minimum(links, nodes).sum()) + 2 * len(contacts.sections) * nodes * contacts.ground


@kernel
def record(points: ContactPoints, point: ContactPoint, force: ContactForce, sinking: Sinking) -> None:
    """Append the ``point``, on which the ``force`` acts, in the axes of the chain's coordinates; count it if full."""
    n = points.number[0]
    points.number[0] = n + 1
    if n >= points.which.shape[0]:
        return
    which, numbers, g = points.which[n], points.numbers[n], force.g
    which[at.PARTNER], which[at.BODY], which[at.LINK], which[at.ON_PIN] = (
        point.partner,
        point.body,
        point.link,
        point.on_pin,
    )
    which[at.COLUMN] = point.column
    put(numbers, at.PLACE, point.place)
    put(numbers, at.POSITION, point.position)
    for k in range(3):
        put(numbers, at.MATRIX + 3 * k, (g[3 * k], g[3 * k + 1], g[3 * k + 2]))
    numbers[at.BY_RATE] = sinking.by_rate
    if sinking.by_rate != 0.0:
        put(numbers, at.RATE, force.by_rate)
        put(numbers, at.NORMAL, sinking.normal)
        numbers[at.FOOT] = sinking.foot
