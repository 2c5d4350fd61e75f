"""Pressure under every link over time, of a track on the ground."""

from __future__ import annotations

from typing import NamedTuple

from orchestrator.log.time_series import Floats
from orchestrator.results.analyses import contact, hull, of_links
from orchestrator.results.page.chain import Chain, Worst, note, sliced
from orchestrator.results.run_data import EVER, RunData


class Pressure(NamedTuple):
    """As ``analyses/contact.py`` has it."""

    middle: Floats  # (slices,) s, of the slices of time
    most: Floats  # (slices, links) Pa, largest in each slice
    peak: Worst
    area: float  # m2, of a pad


def pressure(run: RunData, found: Chain) -> Pressure | None:
    """Of a track; None for one that nothing touches. Raises Missing, LogUnreadable."""
    if not (found.columns.ground and found.columns.closed):
        return None
    area = contact.pad_area(run)
    envelope, middle = sliced(run, found.t, len(found.columns.ground))
    most: dict[str, Worst] = {}
    for block in of_links.records(run, found.track, EVER, of_links.POSITION, contact.SIGNAL):
        under = contact.pressure(block.pins, hull.poses(run, found.track, block.t).axes, block.values[1], area)
        envelope.add(block.t, under)
        note(most, "pressure", block.t, under)
    peak = most.get("pressure")
    return Pressure(middle, envelope.upper, peak, area) if peak and peak.value > 0.0 else None
