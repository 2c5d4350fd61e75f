"""Tension, stress and pin force of the links of a track: largest values, a map over time, curves of single links."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from orchestrator.log.reader import Missing
from orchestrator.log.time_series import Floats
from orchestrator.results.analyses import record_blocks
from orchestrator.results.analyses.record_blocks import Extreme, larger, smaller
from orchestrator.results.approximations import Curve, Peak, TimeEnvelope
from orchestrator.results.run_data import EVER, POSITION, TENSION, RunData, Window, link_columns

SLICES = 240  # most intervals of time of a map
SIGNALS = {"tension": TENSION, "stress": "link[*].stress", "force": "joint[*].force"}


class LinkLoads(NamedTuple):
    """Extreme loads in the records of links."""

    track: str
    t: Floats  # (m,) s, of all records of links
    middle: Floats  # (slices,) s, middles of equal intervals of time
    tension: Floats  # (slices, links) N, largest in each interval
    most: dict[str, Extreme]  # largest tension, N, stress, Pa, and force, N, in the pin where the link begins
    slackest: Extreme  # N, smallest tension
    pins: int  # number of pins with recorded positions; as many as links in a closed chain

    @property
    def links(self) -> int:
        """Number of links."""
        return self.tension.shape[1]

    @property
    def closed(self) -> bool:
        """True if the last link ends at the first pin."""
        return self.pins == self.links


def of(run: RunData, track: str) -> LinkLoads:
    """Loads of the links of a track; raises Missing, LogUnreadable."""
    topic = f"/{track}/links"
    kinds = [name for name, signal in SIGNALS.items() if name == "tension" or record_blocks.has(run, track, signal)]
    t = run.log.select({topic: []})[topic].t if topic in run.log.topics else np.empty(0)
    if not np.isfinite(t).all():
        raise Missing(f"times of the links of '{track}' are no finite numbers")
    most: dict[str, Extreme | None] = {}
    slackest, by_link, middle = None, None, np.empty(0)
    for block in record_blocks.records(run, track, EVER, *(SIGNALS[name] for name in kinds)):
        sizes = dict(zip(kinds, map(record_blocks.sizes, block.values), strict=True))
        if by_link is None:
            by_link, middle = sliced(run, len(t), sizes["tension"].shape[1])
        by_link.add(block.t, sizes["tension"])
        slackest = smaller(slackest, block.t, sizes["tension"])
        most |= {name: larger(most.get(name), block.t, values) for name, values in sizes.items()}
    if by_link is None or slackest is None:
        raise Missing(f"the log holds no tension of the links of '{track}'")
    recorded = {name: extreme for name, extreme in most.items() if extreme}
    pins = len(link_columns(run.log.topics[topic].names, POSITION))
    return LinkLoads(track, t, middle, by_link.upper, recorded, slackest, pins)


def sliced(run: RunData, records: int, links: int) -> tuple[TimeEnvelope, Floats]:
    """Envelope of links in equal intervals of time, and the middles of these (slices,), s.

    An interval is at least two records long, so that none is empty.
    """
    start, end = run.span
    slices = max(1, min(SLICES, records // 2))
    edges = np.linspace(start, end, slices + 1)
    return TimeEnvelope(start, end, links, slices), 0.5 * (edges[1:] + edges[:-1])


def tensions_in(run: RunData, track: str, span: tuple[float, float], like: LinkLoads) -> Floats:
    """Largest tensions (slices, links), N, in the intervals of another run of that time span, s.

    NaN where none was recorded. Raises Missing, LogUnreadable.
    """
    envelope = TimeEnvelope(*span, like.links, len(like.middle))
    for block in record_blocks.records(run, track, Window(*span), TENSION):
        envelope.add(block.t, block.values[0])
    return envelope.upper


def curves(run: RunData, track: str, links: Sequence[int]) -> dict[int, dict[str, tuple[Curve, Peak]]]:
    """Curves of the loads of some links of a track, with their peaks; raises LogUnreadable."""
    kinds = [name for name, signal in SIGNALS.items() if record_blocks.has(run, track, signal)]
    members = [link - 1 for link in links]
    envelope = TimeEnvelope(*run.span, len(kinds) * len(members))
    for block in record_blocks.records(run, track, EVER, *(SIGNALS[name] for name in kinds)):
        sizes = [record_blocks.sizes(values) for values in block.values]
        chosen = [
            values[:, k] if k < values.shape[1] else np.full(len(block.t), np.nan) for k in members for values in sizes
        ]
        envelope.add(block.t, np.stack(chosen, axis=1))
    by_link: dict[int, dict[str, tuple[Curve, Peak]]] = {link: {} for link in links}
    for k, (link, name) in enumerate((link, name) for link in by_link for name in kinds):
        if peak := envelope.largest(k):
            by_link[link][name] = envelope.curve(k), peak
    return by_link


def loads_at(run: RunData, loads: LinkLoads, name: str, t: float) -> tuple[float, Floats]:
    """Time, s, of the link record nearest to a time, and a load of all links in it (links,).

    Raises Missing, LogUnreadable.
    """
    nearest = loads.t[np.abs(loads.t - t).argmin()]
    block = next(record_blocks.records(run, loads.track, Window(nearest, nearest), SIGNALS[name]))
    return float(block.t[0]), record_blocks.sizes(block.values[0])[0]
