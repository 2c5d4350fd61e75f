"""A chain let go from a shape: its links are deformed as that instant deforms them, so that no wave is born with it.

Straight links between pins leave each link five deformations: the stretch of its chord, and stretch and turn of its
slopes against the chord at both ends. They are chosen so that none of the five accelerates; what remains is the motion
of a link as one body.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import lu_factor, lu_solve
from scipy.optimize import brentq

from fmus.model import Floats

PROBE = 1e-7  # deformation by which the response is found; it is linear
ROUNDS = 20
STILL = 1e-5  # of the accelerations that undeformed links have; rounding leaves 2e-6 of those of steel

Accelerations = Callable[[], Floats]  # (nodes, width) of the chain as it stands, at rest


def tighten(q: Floats, plane: NDArray[np.int64], pitch: float, accelerations: Accelerations) -> bool:
    """Deform the straight links of an open chain in place, ends where they are. False: not found.

    q (nodes, width); ``plane`` (3, 2) says where x and z of a pin's position, ending and beginning slope lie.
    """
    place, ending, beginning = plane
    pins = q[:, place].copy()
    n = len(pins) - 1
    chord = np.diff(pins, axis=0)
    angles = np.arctan2(chord[:, 1], chord[:, 0])
    distance = float(pins[-1, 0] - pins[0, 0])

    def deforming(d: Floats, factor: float) -> Floats:
        """Lay the chain down with the deformations d (5, n), and their accelerations (5, n), m/s2."""
        along = np.stack([np.cos(factor * angles), np.sin(factor * angles)], axis=1)
        across = np.stack([-along[:, 1], along[:, 0]], axis=1)
        steps = pitch * (1.0 + d[0])[:, None] * along
        q[:, place] = pins[0] + np.vstack([np.zeros(2), np.cumsum(steps, axis=0)])
        q[:n, beginning] = (1.0 + d[1])[:, None] * along + d[3][:, None] * across
        q[1:, ending] = (1.0 + d[2])[:, None] * along + d[4][:, None] * across
        a = accelerations()
        chords, first, last = np.diff(a[:, place], axis=0), pitch * a[:n, beginning], pitch * a[1:, ending]
        stretching = [np.sum(part * along, axis=1) for part in (chords, first, last)]
        turning = [np.sum((part - chords) * across, axis=1) for part in (first, last)]
        return np.stack(stretching + turning)

    d, factor, response, undeformed, before = np.zeros((5, n)), 1.0, None, 0.0, 0.0
    for _ in range(ROUNDS):
        now = deforming(d, factor)
        undeformed = undeformed or float(np.abs(now).max())
        if np.abs(now).max() < STILL * undeformed:
            q[-1, place] = pins[-1]
            return True
        if response is None or np.abs(now).max() > 0.1 * before:
            columns = []
            for k in range(d.size):
                probed = d.copy()
                probed.flat[k] += PROBE
                columns.append((deforming(probed, factor) - now).ravel() / PROBE)
            response = lu_factor(np.stack(columns, axis=1))
        before = float(np.abs(now).max())
        d = d - lu_solve(response, now.ravel()).reshape(d.shape)
        pitches = pitch * (1.0 + d[0])
        factor = brentq(lambda s, p=pitches: p @ np.cos(s * angles) - distance, 0.5, 1.5, xtol=1e-15)
    return False
