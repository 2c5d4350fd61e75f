"""Axes of links: along from pin to pin, across along the pins, outwards away from the wheels."""

from __future__ import annotations

import numpy as np

from orchestrator.log.time_series import Floats


def link_axes(pins: Floats, across: Floats, links: int) -> Floats:
    """Rotation matrices (..., links, 3, 3), link to world, with columns along, across, outwards.

    ``pins`` (..., nodes, 3): positions, m; ``across`` (..., nodes, 3): unit vectors along the pins, to the left of
    the vehicle, or an array that broadcasts. With as many nodes as links the chain is closed.
    """
    after = np.roll(pins, -1, axis=-2)[..., :links, :]
    along = after - pins[..., :links, :]
    along = along / np.linalg.norm(along, axis=-1, keepdims=True)
    side = np.broadcast_to(across, pins.shape)
    side = side[..., :links, :] + np.roll(side, -1, axis=-2)[..., :links, :]
    outwards = np.cross(along, side)
    outwards = outwards / np.linalg.norm(outwards, axis=-1, keepdims=True)
    return np.stack([along, np.cross(outwards, along), outwards], axis=-1)
