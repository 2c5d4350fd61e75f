"""Numbers of joints and equations of the vehicle's chains, from the Jacobian of rigid links (8.1).

The Jacobian is that of the start of ``straight``. An open chain lacks the closing pin; a closed loop of parallel pins
has three redundant equations.
"""

from __future__ import annotations

import numpy as np

from fmus.physics.rigid import pin
from orchestrator.log.time_series import Floats
from orchestrator.results.rotation import matrices
from orchestrator.studies import Row
from tests.validation.paper.models import CLOSED, RIGID, scene
from tests.validation.paper.states import model

TRACKS = ("left_track", "right_track")
EQUATIONS = 5  # of a pin
SMALL = 1e-9  # of the largest singular value: smaller ones count as 0
# Name, description, and number in the paper (last three: counted by hand).
ASKED = (
    ("pins", "pins of both chains, opened", 126),
    ("equations", "their equations", 630),
    ("rank", "of them independent", 630),
    ("loop_equations", "equations of one closed chain", 320),
    ("loop_rank", "of them independent", 317),
    ("flexible", "coordinates of a closed ANCF chain", 512),
)


def counted() -> list[Row]:
    """Rows of all numbers; a wrong one fails."""
    chains = [model(scene(RIGID), name) for name in TRACKS]
    loops = [jacobian(chain.s.q, 0.5 * chain.pitch) for chain in chains]
    opened = [B[EQUATIONS:] for B in loops]
    both = np.block(
        [[opened[0], np.zeros((len(opened[0]), opened[1].shape[1]))],
         [np.zeros((len(opened[1]), opened[0].shape[1])), opened[1]]]
    )  # fmt: skip
    equations = int(np.count_nonzero(np.abs(both).max(axis=1) > 0.0))
    values = {
        "pins": equations // EQUATIONS,
        "equations": equations,
        "rank": rank(both),
        "loop_equations": len(loops[0]),
        "loop_rank": rank(loops[0]),
        "flexible": model(scene(CLOSED), TRACKS[0]).s.q.size,
    }
    return [
        Row("count", text, {"key": key, "value": values[key], "reference": number}, values[key] == number)
        for key, text, number in ASKED
    ]


def jacobian(q: Floats, half: float) -> Floats:
    """Jacobian (5 n, 6 n) of all pins of a closed chain with poses (n, 7); pin 0 closes it."""
    A, n = np.ascontiguousarray(matrices(q[:, 3:])), len(q)
    B = np.zeros((n, EQUATIONS, n, 6))
    before, behind = np.zeros((EQUATIONS, 6)), np.zeros((EQUATIONS, 6))
    for j in range(n):
        pin.jacobian(half, A[j - 1], A[j], before, behind)
        B[j, :, j - 1], B[j, :, j] = before, behind
    return B.reshape(EQUATIONS * n, 6 * n)


def rank(B: Floats) -> int:
    """Number of independent rows."""
    sizes = np.linalg.svd(B, compute_uv=False)
    return int(np.count_nonzero(sizes > SMALL * sizes[0]))
