"""Pictures of a vehicle from above, with the forces of the ground on its links, for the player of the page."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from orchestrator.log.time_series import Floats
from orchestrator.results.page.embedded import floats, shorts
from orchestrator.results.rotation import body_axis
from orchestrator.results.run_data import RunData
from orchestrator.results.views.arrows import scale_arrow
from orchestrator.results.views.bodies import EVERY, Bodies, LinkPoses

UNIT = 5e-4  # m: unit of places beside the hull, which are integers of two bytes
LONGEST = 0.7  # m: arrow of the largest force
MARGIN = 0.5  # m round the tracks


def above(run: RunData, t: Floats) -> dict[str, Any] | None:
    """Lower runs of both tracks at the records nearest to times (m,), s, as a JSON table.

    Places and arrows are relative to the hull's centre of mass, in world axes, m. None without a hull, or without the
    forces of the ground on links. Raises LogUnreadable, and ValueError if poses were not recorded.
    """
    bodies = Bodies(run, EVERY)
    bodies.select_instants(t)
    blocks = [*bodies.blocks()]
    hulls = [poses.hull for poses in blocks if poses.hull is not None]
    if not hulls or any(links.ground is None for poses in blocks for links in poses.links.values()):
        return None

    def of_links(values: Callable[[LinkPoses], Any]) -> Any:
        return np.concatenate([np.hstack([values(links) for links in poses.links.values()]) for poses in blocks])

    hull = np.concatenate([pose.position[:, :2] for pose in hulls])
    ahead = np.concatenate([body_axis(pose.orientation, 0) for pose in hulls])
    lower = of_links(lambda links: links.axes[..., 2, 2] < 0.0)
    feet = of_links(lambda links: links.centres[..., :2])[lower] - np.repeat(hull, lower.sum(axis=1), axis=0)
    force = of_links(lambda links: np.asarray(links.ground)[..., :2])[lower]
    largest = float(np.linalg.norm(force, axis=1).max()) or 1.0
    return {
        "hull": floats(hull),
        "heading": floats(np.arctan2(ahead[:, 1], ahead[:, 0])),
        "counts": lower.sum(axis=1).tolist(),
        "feet": shorts(feet, UNIT),
        "arrows": shorts(force * LONGEST / largest, UNIT),
        "unit": UNIT,
        "largest": largest,
        "scale": scale_arrow(LONGEST, largest / LONGEST)._asdict(),
        "half": (bodies.tracks[0].half[:2]).tolist(),
        "reach": float(np.abs(feet).max()) + MARGIN,
    }
