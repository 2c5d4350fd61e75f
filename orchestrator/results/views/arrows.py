"""Ground forces as arrows, with one scale for all vehicles, so that views can be compared."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from orchestrator.log.time_series import Floats
from orchestrator.results.views.bodies import Bodies, LinkPoses
from orchestrator.results.views.shapes import TrackBody

METRES_PER_NEWTON = 5e-5  # m of arrow per newton: 20 kN are a metre
SHORTEST = 0.01  # m: shorter arrows are left out
ROUND = (5.0, 2.0, 1.0)  # first digits of the force of a scale arrow
BEHIND = 0.4  # m from the hull to the scale arrow
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


def has_forces(bodies: Bodies) -> bool:
    """True if a log holds the forces of the ground on the links of a track."""
    return any(links.ground is not None for links in next(bodies.blocks(1)).links.values())


def legend(bodies: Bodies) -> str:
    """Words on the arrows of a view in space, to follow others; empty without forces."""
    return f"; arrows: forces of the ground, {1e-3 / METRES_PER_NEWTON:.3g} kN a metre" if has_forces(bodies) else ""


class ScaleArrow(NamedTuple):
    """Arrow of a round force, which shows the scale of the others."""

    length: float  # m
    label: str  # force with its unit


def scale_arrow(room: float, metres_per_newton: float = METRES_PER_NEWTON) -> ScaleArrow:
    """Return the longest arrow of a round force that fits into ``room``, m."""
    most = room / metres_per_newton
    power = 10.0 ** np.floor(np.log10(most))
    force = float(power * next(digit for digit in ROUND if digit * power <= most * (1.0 + 1e-9)))
    return ScaleArrow(force * metres_per_newton, f"{force / 1e3:g} kN")


def scale_on_hull(bodies: Bodies) -> tuple[Floats, ScaleArrow] | None:
    """Foot (3), m, in hull axes, and the arrow that stands behind the hull upright to show the scale of forces."""
    if bodies.hull is None or not has_forces(bodies):
        return None
    low = bodies.hull.corners.min(axis=0)
    return low - [BEHIND, 0.0, 0.0], scale_arrow(float(np.ptp(bodies.hull.corners[:, 2])))


def with_heads(arrows: Floats, size: float) -> Floats:
    """Return flat arrows (n, 2, 2) as broken lines (n, 5, 2) with heads of a size, m, or of a third of a short one."""
    tail, tip = arrows[:, 0], arrows[:, 1]
    length = np.linalg.norm(tip - tail, axis=1, keepdims=True)
    back = (tail - tip) * np.minimum(size / np.maximum(length, 1e-12), 1.0 / 3.0)
    aside = 0.5 * back @ np.array([[0.0, 1.0], [-1.0, 0.0]])
    return np.stack([tail, tip, tip + back + aside, tip, tip + back - aside], axis=1)
