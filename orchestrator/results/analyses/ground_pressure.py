"""Ground pressure under links: normal ground force over the area of a pad (pitch times track width)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from orchestrator.log.time_series import Floats
from orchestrator.results.analyses import hull, record_blocks
from orchestrator.results.analyses.link_loads import LinkLoads, sliced
from orchestrator.results.analyses.record_blocks import Extreme, larger
from orchestrator.results.rotation import link_axes
from orchestrator.results.run_data import EVER, RunData

SIGNAL = "link[*].ground.force"


class PressureMap(NamedTuple):
    """Pressure by link over time."""

    middle: Floats  # (slices,) s, middles of equal intervals of time
    most: Floats  # (slices, links) Pa, largest in each interval
    peak: Extreme  # Pa
    area: float  # m2, one pad


def pad_area(run: RunData) -> float:
    """Area of a link's pad, m2; raises Missing."""
    return hull.vehicle_number(run, "track", "pitch") * hull.vehicle_number(run, "track", "width")


def pressure(pins: Floats, axes: Floats, force: Floats, area: float) -> Floats:
    """Pressure under links (m, links), Pa: inward component of the ground force over the area.

    ``pins`` (m, pins, 3), m, and ``force`` (m, links, 3), N, in world; ``axes`` (m, 3, 3) of the hull.
    """
    across = np.broadcast_to(axes[:, None, :, 1], pins.shape)
    return -np.einsum("mni,mni->mn", force, link_axes(pins, across, force.shape[1])[..., 2]) / area


def over_time(run: RunData, loads: LinkLoads) -> PressureMap | None:
    """Pressure under every link over time; None for a track without ground contact. Raises Missing, LogUnreadable."""
    if not (loads.closed and record_blocks.has(run, loads.track, SIGNAL)):
        return None
    area = pad_area(run)
    envelope, middle = sliced(run, len(loads.t), loads.links)
    peak: Extreme | None = None
    for block in record_blocks.records(run, loads.track, EVER, record_blocks.POSITION, SIGNAL):
        under = pressure(block.pins, hull.poses(run, loads.track, block.t).axes, block.values[1], area)
        envelope.add(block.t, under)
        peak = larger(peak, block.t, under)
    return PressureMap(middle, envelope.upper, peak, area) if peak and peak.value > 0.0 else None
