"""Ground pressure under links: normal ground force over the area of a pad (pitch times track width)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from orchestrator.log.reader import Missing
from orchestrator.log.time_series import Floats
from orchestrator.results.analyses import circuit, hull, record_blocks
from orchestrator.results.analyses.envelope import PlaceBins
from orchestrator.results.analyses.link_loads import LinkLoads, sliced
from orchestrator.results.analyses.record_blocks import Extreme, larger
from orchestrator.results.rotation import link_axes
from orchestrator.results.run_data import EVER, RunData, Window
from orchestrator.results.table import Table

SIGNAL = "link[*].ground.force"
BEARS = 1e-3  # of the largest pressure; a place with less has no ground contact


class GroundPressure(NamedTuple):
    """Pressure by place on the circuit (``circuit.py``), in as many bins as there are links."""

    track: str
    place: Floats  # (bins,) m
    mean: Floats  # (bins,) Pa, mean over time
    most: Floats  # (bins,) Pa
    forward: Floats  # (bins,) m ahead of the sprocket axle, in hull axes
    peak: float  # Pa, largest of all links and records
    peak_link: int  # from 1
    peak_t: float  # s
    force: float  # N, sum over links, mean over the window
    area: float  # m2, one pad

    def table(self) -> Table:
        """Table with a row for each place with ground contact."""
        touched = self.most > BEARS * self.peak
        values = (self.place, self.forward, self.mean / 1e3, self.most / 1e3)
        rows = list(zip(*(each[touched].tolist() for each in values), strict=True))
        columns = (("place", "m"), ("ahead", "m"), ("mean", "kPa"), ("largest", "kPa"))
        notes = (
            f"peak {self.peak / 1e3:.4g} kPa under link {self.peak_link} at {self.peak_t:.6g} s",
            f"pads of {self.area * 1e4:.4g} cm2, {self.force / 1e3:.5g} kN together",
        )
        return Table.of(f"Pressure under {self.track} by place on the circuit", columns, rows, notes)


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


def of(run: RunData, track: str = "", window: Window = EVER) -> GroundPressure:
    """Ground pressure of a track, by default the first; raises Missing."""
    track = hull.tracks(run, track)[0]
    if run.scene.get("assembly") != "vehicle":
        raise Missing(f"{run.log.path} holds no vehicle on the ground")
    area = pad_area(run)
    bins: PlaceBins | None = None
    total = time = 0.0
    peak: Extreme | None = None
    for block in circuit.records(run, track, window, SIGNAL):
        bins = bins or PlaceBins(block.links.shape[1], 2)
        under = pressure(block.pins, block.axes, block.values[0], area)
        of_place = np.stack([under, block.centres[..., 0]], axis=2)
        bins.add(block, block.links, of_place)
        total, time = total + float(block.since @ under.sum(axis=1)), time + float(block.since.sum())
        peak = larger(peak, block.t, under)
    if bins is None or peak is None or not peak.value > 0.0:
        raise Missing(f"{run.log.path}: no link of '{track}' touches the ground in the window")
    force = total / time * area
    return GroundPressure(
        track, bins.place, *bins.of(0)[1:], bins.of(1)[1], peak.value, peak.member, peak.t, force, area
    )
