"""Contacts of a chain: its partners, and the contact points at its last iteration matrix.

The points have the derivatives of their forces.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from fmus.kernels.jit import kernel
from fmus.physics.arrays import Vector
from fmus.physics.point import POINTS
from fmus.physics.vector import put

if TYPE_CHECKING:
    from fmus.physics.contact.face import ContactForce, Sinking
    from fmus.physics.contact.laws import Law
    from fmus.physics.contact.teeth import Teeth

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


PARTNER, BODY, LINK, ON_PIN, COLUMN = range(5)  # numbers of a point, see ``ContactPoint``
# numbers of a point: xi, z, y of ``locate``; position, m; g; of ``Sinking``, where its first is not 0: by_rate,
# ``ContactForce.by_rate``, normal, foot
PLACE, POSITION, MATRIX, BY_RATE, RATE, NORMAL, FOOT = 0, 3, 6, 15, 16, 19, 22
SIZE = 23


class ContactPoint(NamedTuple):
    """Contact point of a chain with m wheels."""

    partner: int  # index of the wheel; m: the ground
    body: int  # index of the link, or of the pin
    link: int  # index of the link that is said to bear the force
    on_pin: int  # 1: on a pin, 0: on a face
    column: int  # of the force in ``on_links``
    place: Vector  # xi, z and y of ``locate``; of a pin only y
    position: Vector  # along the axes of the chain's coordinates, m


class ContactPoints(NamedTuple):
    """Contact points at the last matrix, and the motion of the chain since."""

    number: np.ndarray  # (1) int: of points
    which: np.ndarray  # (points, 5) int: PARTNER to COLUMN
    numbers: np.ndarray  # (points, SIZE)
    q: np.ndarray  # coordinates at the matrix, (nodes, width) or (links, 7)
    step: np.ndarray  # (nodes, width) last correction of the coordinates; of rigid links it is in ``AugmentedSystem``


def contact_points(points: int, coordinates: tuple[int, int], step: tuple[int, int] = (0, 0)) -> ContactPoints:
    """Return zeroed arrays for at most ``points`` points of a chain; shapes of its coordinates and of ``step``."""
    z = np.zeros
    return ContactPoints(
        z(1, dtype=np.int64), z((points, 5), dtype=np.int64), z((points, SIZE)), z(coordinates), z(step)
    )


def most_points(contacts: Contacts, pitch: float, nodes: int) -> int:
    """Most contact points of a chain of ``nodes`` pins whose links lie side by side round wheels and on the ground."""
    links = np.ceil(2.0 * np.pi * (contacts.radius / pitch + 1.0)) + 1.0
    return POINTS * int(np.minimum(links, nodes).sum()) + 2 * len(contacts.sections) * nodes * contacts.ground


@kernel
def record(points: ContactPoints, point: ContactPoint, force: ContactForce, sinking: Sinking) -> None:
    """Append the ``point``, on which the ``force`` acts, in the axes of the chain's coordinates; count it if full."""
    n = points.number[0]
    points.number[0] = n + 1
    if n >= points.which.shape[0]:
        return
    which, numbers, g = points.which[n], points.numbers[n], force.g
    which[PARTNER], which[BODY], which[LINK], which[ON_PIN] = point.partner, point.body, point.link, point.on_pin
    which[COLUMN] = point.column
    put(numbers, PLACE, point.place)
    put(numbers, POSITION, point.position)
    for k in range(3):
        put(numbers, MATRIX + 3 * k, (g[3 * k], g[3 * k + 1], g[3 * k + 2]))
    numbers[BY_RATE] = sinking.by_rate
    if sinking.by_rate != 0.0:
        put(numbers, RATE, force.by_rate)
        put(numbers, NORMAL, sinking.normal)
        numbers[FOOT] = sinking.foot
