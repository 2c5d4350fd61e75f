"""Ground forces as arrows, with one scale for all views of vehicles of one size, so that they can be compared."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from orchestrator.log.time_series import Floats
from orchestrator.results.views.bodies import Bodies, LinkPoses
from orchestrator.results.views.shapes import TrackBody

ALMOST = 1.2  # a force that is this much below a round one counts as that
LENGTH, FORCE = 9.8, 20e3  # of the m113: length of a chain, m; force of an arrow of a metre, N
SHORTEST = 0.01  # m: shorter arrows are left out
ROUND = (5.0, 2.0, 1.0)  # first digits of the force of a scale arrow
BEHIND = 0.4  # m from the hull to the scale arrow
ASIDE = 0.03  # m beyond the outer edge of a link: wheels and links would hide arrows


def force_of_a_metre(bodies: Bodies) -> float:
    """Force whose arrow is a metre long, N: as the square of the chain's length, with a first digit of ROUND."""
    if not bodies.tracks:
        return FORCE
    length = bodies.tracks[0].links * bodies.scene["vehicle"]["track"]["pitch"]
    return _round_below(ALMOST * FORCE * (length / LENGTH) ** 2)


def _round_below(force: float) -> float:
    power = 10.0 ** np.floor(np.log10(force))
    return float(power * next(digit for digit in ROUND if digit * power <= force * (1.0 + 1e-9)))


def ground_arrows(
    bodies: Bodies, track: TrackBody, links: LinkPoses, rows: Any = slice(None)
) -> tuple[Floats, Floats, NDArray[np.int64]]:
    """Origins (n, 3) at the pads and vectors (n, 3), m, world; and the number of arrows of each instant."""
    assert links.ground is not None
    outer = (-1.0 if track.name.startswith("right") else 1.0) * (track.half[1] + ASIDE)
    axes = links.axes[rows]
    feet = links.centres[rows] + track.half[2] * axes[..., 2] + outer * axes[..., 1]
    vectors = links.ground[rows] / force_of_a_metre(bodies)
    visible = np.linalg.norm(vectors, axis=-1) > SHORTEST
    return feet[visible], vectors[visible], visible.sum(axis=1)


def has_forces(bodies: Bodies) -> bool:
    """True if a log holds the forces of the ground on the links of a track."""
    return any(links.ground is not None for links in next(bodies.blocks(1)).links.values())


def legend(bodies: Bodies) -> str:
    """Words on the arrows of a view in space, to follow others; empty without forces."""
    force = force_of_a_metre(bodies)
    return f"; arrows: forces of the ground, {1e-3 * force:.3g} kN a metre" if has_forces(bodies) else ""


class ScaleArrow(NamedTuple):
    """Arrow of a round force, which shows the scale of the others."""

    length: float  # m
    label: str  # force with its unit


def scale_arrow(room: float, force_of_metre: float) -> ScaleArrow:
    """Return the longest arrow of a round force that fits into ``room``, m."""
    force = _round_below(room * force_of_metre)
    return ScaleArrow(force / force_of_metre, f"{force / 1e3:g} kN")


def scale_on_hull(bodies: Bodies) -> tuple[Floats, ScaleArrow] | None:
    """Foot (3), m, in hull axes, and the arrow that stands behind the hull upright to show the scale of forces."""
    if bodies.hull is None or not has_forces(bodies):
        return None
    low = bodies.hull.corners.min(axis=0)
    return low - [BEHIND, 0.0, 0.0], scale_arrow(float(np.ptp(bodies.hull.corners[:, 2])), force_of_a_metre(bodies))


def with_heads(arrows: Floats, size: float) -> Floats:
    """Return flat arrows (n, 2, 2) as broken lines (n, 5, 2) with heads of a size, m, or of a third of a short one."""
    tail, tip = arrows[:, 0], arrows[:, 1]
    length = np.linalg.norm(tip - tail, axis=1, keepdims=True)
    back = (tail - tip) * np.minimum(size / np.maximum(length, 1e-12), 1.0 / 3.0)
    aside = 0.5 * back @ np.array([[0.0, 1.0], [-1.0, 0.0]])
    return np.stack([tail, tip, tip + back + aside, tip, tip + back - aside], axis=1)
