"""Speed of a chain along itself: pins that pass a point of the carrier per time, times the pitch."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from fmus.jit import kernel
from fmus.physics.arrays import Floats

if TYPE_CHECKING:
    from fmus.physics.chain.protocols import Carrier

BEND = 0.1  # angle between a link's neighbours, rad, beyond which the link has little weight


@kernel
def chain_speed(x: Floats, v: Floats, closed: bool, carrier: Carrier) -> float:
    """Mean velocity along itself of the straight parts of a chain relative to its carrier, m/s.

    x, v (nodes, 3, or 2 for x and z): positions, m, and velocities, m/s, of the pins; ``carrier`` from
    ``carrier.carrier``. The speed is positive along the index. Where a chain is straight, all pins of a link move along
    it at the pitch times the passing rate; round a wheel the chords are askew to the velocities and give less, so the
    weight of a link falls with the angle between its two neighbours.
    """
    nodes = x.shape[0]
    links = nodes if closed else nodes - 1
    (p0, p1, p2), (c0, c1, c2), (w0, w1, w2), _ = carrier
    total = weight = 0.0
    for i in range(links):
        if closed:
            a, j, b = (
                i - 1 if i > 0 else nodes - 1,
                i + 1 if i + 1 < nodes else 0,
                i + 2 if i + 2 < nodes else i + 2 - nodes,
            )
        else:
            a, j, b = max(i - 1, 0), i + 1, min(i + 2, nodes - 1)
        # cosine of the angle between the neighbours
        dot = size_before = size_after = size = speed = 0.0
        for k in range(x.shape[1]):
            before, after, here = x[i, k] - x[a, k], x[b, k] - x[j, k], x[j, k] - x[i, k]
            if a == i:
                before = here
            if b == j:
                after = here
            dot += before * after
            size_before += before * before
            size_after += after * after
            size += here * here
            speed += 0.5 * (v[i, k] + v[j, k]) * here
        cosine = dot / np.sqrt(size_before * size_after)
        angle_squared = max(2.0 * (1.0 - cosine), 0.0) / (BEND * BEND)
        share = 1.0 / (1.0 + angle_squared * angle_squared)
        # the carrier's velocity at the middle of the link, along the link
        h0, h1, h2 = x[j, 0] - x[i, 0], 0.0, x[j, -1] - x[i, -1]
        r0, r1, r2 = 0.5 * (x[i, 0] + x[j, 0]) - p0, -p1, 0.5 * (x[i, -1] + x[j, -1]) - p2
        if x.shape[1] == 3:
            h1, r1 = x[j, 1] - x[i, 1], 0.5 * (x[i, 1] + x[j, 1]) - p1
        speed -= h0 * (c0 + w1 * r2 - w2 * r1) + h1 * (c1 + w2 * r0 - w0 * r2) + h2 * (c2 + w0 * r1 - w1 * r0)
        total += share * speed / np.sqrt(size)
        weight += share
    return total / weight
