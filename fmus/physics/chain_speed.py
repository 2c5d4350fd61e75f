"""Speed of a chain along itself: pins passed per time, times the pitch."""

from __future__ import annotations

import numpy as np

from fmus.jit import kernel

BEND = 0.1  # rad between a link's neighbours from which on the link counts little


@kernel
def chain_speed(x, v, closed):
    """Mean velocity along itself of the straight parts of a chain, m/s, along the index.

    x, v (nodes, 2 or 3): positions and velocities of the pins. Where a chain runs straight, all pins of a link move
    along it at the pitch times the pins that pass; round a wheel the chords lie askew to the velocities and show less,
    so links are weighted down with the angle between their two neighbours.
    """
    nodes = x.shape[0]
    links = nodes if closed else nodes - 1
    total = weight = 0.0
    for i in range(links):
        a, b = i - 1, i + 2
        if closed:
            a, b = a % nodes, b % nodes
        else:
            a, b = max(a, 0), min(b, nodes - 1)
        j = i + 1 if i + 1 < nodes else 0
        # of the angle between the neighbours: its cosine
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
        bend2 = max(2.0 * (1.0 - cosine), 0.0) / (BEND * BEND)
        share = 1.0 / (1.0 + bend2 * bend2)
        total += share * speed / np.sqrt(size)
        weight += share
    return total / weight
