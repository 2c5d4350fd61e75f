"""Contact partners of a chain: wheels, teeth and ground with their laws."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from fmus.physics.arrays import Vector
from fmus.physics.contact.teeth import Teeth

if TYPE_CHECKING:
    from fmus.physics.contact.laws import Law


class Contacts(NamedTuple):
    """Contact partners of a chain with m wheels, constant through a run."""

    teeth: np.ndarray  # (m) int: 1 where the wheel has teeth
    radius: np.ndarray  # (m) radius of the rim, m; of teeth, the outer radius of the pins' path
    profile: Teeth  # outline of the teeth
    clearance: float  # lateral play of the guides on each side, m
    ground: int  # 1 where there is a ground
    shape: Any  # shape of the ground (``grounds``) in the track's frame
    belt: Vector  # velocity of the ground's surface in that frame, m/s
    sprocket: Law  # contact law of pins with teeth,
    wheel: Law  # of links with rims and of horns with discs,
    soil: Any  # and of links with the ground (``grounds``)
