"""Ground forces as arrows, with one scale for all vehicles, so that views can be compared."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from orchestrator.log.time_series import Floats
from orchestrator.results.views.bodies import LinkPoses
from orchestrator.results.views.shapes import TrackBody

METRES_PER_NEWTON = 5e-5  # m of arrow per newton: 20 kN are a metre
SHORTEST = 0.01  # m: shorter arrows are left out
ASIDE = 0.03  # m beyond the outer edge of a link: wheels and links would hide arrows


def ground_arrows(
    track: TrackBody, links: LinkPoses, rows: Any = slice(None)
) -> tuple[Floats, Floats, NDArray[np.int64]]:
    """Origins (n, 3) at the pads and vectors (n, 3), m, world; and the number of arrows of each instant."""
    assert links.ground is not None
    outer = (-1.0 if track.name.startswith("right") else 1.0) * (track.half[1] + ASIDE)
    axes = links.axes[rows]
    feet = links.centres[rows] + track.half[2] * axes[..., 2] + outer * axes[..., 1]
    vectors = METRES_PER_NEWTON * links.ground[rows]
    visible = np.linalg.norm(vectors, axis=-1) > SHORTEST
    return feet[visible], vectors[visible], visible.sum(axis=1)
