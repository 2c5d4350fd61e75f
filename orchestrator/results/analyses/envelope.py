"""Envelope of a link signal or of the ground pressure by place on the circuit: least, mean, largest value."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from orchestrator.log.reader import Missing
from orchestrator.log.time_series import Floats
from orchestrator.results.analyses import circuit, ground_pressure, hull, record_blocks
from orchestrator.results.analyses.circuit import PlacedRecords
from orchestrator.results.analyses.record_blocks import Extreme, larger
from orchestrator.results.run_data import EVER, TENSION, RunData, Window
from orchestrator.results.table import Table

PRESSURE = "pressure"  # in place of a signal: that of the ground under links


class Envelope(NamedTuple):
    """Statistics over all records of a window; NaN for places without a record."""

    signal: str  # "left_track.link[*].tension"; a vector counts by its norm
    unit: str
    place: Floats  # (bins,) m along the circuit (``circuit.py``), centres of bins
    least: Floats  # (bins,)
    mean: Floats  # (bins,)
    most: Floats  # (bins,)
    records: Floats  # (bins,) number of link records
    forward: Floats  # (bins,) m, mean place ahead of the sprocket axle, in hull axes
    up: Floats  # (bins,) m, above the axle
    part: tuple[str, ...]  # (bins,) part of the circuit (``circuit.stretches``)
    peak: Extreme | None = None  # largest value, with its link or pin
    area: float = 0.0  # m2, one pad, of the pressure
    force: float = 0.0  # N, of the pressure: sum over links, mean over time

    def table(self) -> Table:
        """Table with a row for each place."""
        columns = (
            ("place", "m"), ("least", self.unit), ("mean", self.unit), ("largest", self.unit), ("ahead", "m"),
            ("up", "m"), ("records", ""), ("part", ""),
        )  # fmt: skip
        values = (self.place, self.least, self.mean, self.most, self.forward, self.up, self.records.astype(int))
        rows = list(zip(*(each.tolist() for each in values), self.part, strict=True))
        notes = []
        if self.peak:
            whose = f"{'pin' if '.joint[' in self.signal else 'link'} {self.peak.member} at {self.peak.t:.6g} s"
            notes.append(f"largest {self.peak.value:.5g} {self.unit}, {whose}")
        if self.area:
            notes.append(f"pads of {self.area * 1e4:.4g} cm2, {self.force / 1e3:.5g} kN together")
        return Table.of(f"{self.signal} by place on the circuit", columns, rows, tuple(notes))


class PlaceBins:
    """Statistics of values by place."""

    def __init__(self, bins: int, columns: int = 1) -> None:
        self.least = np.full((bins, columns), np.inf)
        self.most = np.full((bins, columns), -np.inf)
        self.total = np.zeros((bins, columns))
        self.time = np.zeros(bins)  # s
        self.count = np.zeros(bins)
        self._lengths: list[Floats] = []

    @property
    def place(self) -> Floats:
        """Middles of the bins (bins,), m along the circuit."""
        bins = len(self.count)
        return np.asarray((np.arange(bins) + 0.5) * float(np.concatenate(self._lengths).mean()) / bins)

    def add(self, block: PlacedRecords, where: Floats, values: Floats) -> None:
        """Add values (m, ..., columns) of records at places (m, ...), m."""
        share, since = where / block.length[:, None], block.since
        self._lengths.append(block.length)
        bin_of_sample = np.minimum((share * len(self.count)).astype(int), len(self.count) - 1).ravel()
        flat = values.reshape(len(bin_of_sample), -1)
        np.minimum.at(self.least, bin_of_sample, flat)
        np.maximum.at(self.most, bin_of_sample, flat)
        weights = np.broadcast_to(since[:, None], share.shape).ravel()
        np.add.at(self.total, bin_of_sample, weights[:, None] * flat)
        self.time += np.bincount(bin_of_sample, weights, len(self.time))
        self.count += np.bincount(bin_of_sample, minlength=len(self.count))

    def of(self, column: int) -> tuple[Floats, Floats, Floats]:
        """Least value, mean over time and largest value (bins,); NaN for empty bins."""
        empty = self.count == 0
        mean = self.total[:, column] / np.where(empty, np.nan, self.time)
        return np.where(empty, np.nan, self.least[:, column]), mean, np.where(empty, np.nan, self.most[:, column])


def of(
    run: RunData, track: str = "", signal: str | Sequence[str] = TENSION, window: Window = EVER, bins: int = 0
) -> Envelope:
    """Envelope of a signal of links or pins of a track, by default the first, or of its PRESSURE.

    The number of bins is ``bins`` or the number of links. The signal may begin with the name of its track. Raises
    Missing, BadInput for several signals.
    """
    track, signal = record_blocks.one_signal(run, track, signal, "an envelope")
    track = hull.tracks(run, track)[0]
    area = ground_pressure.pad_area(run) if signal == PRESSURE else 0.0
    recorded, unit = (ground_pressure.SIGNAL, "kPa") if area else (signal, record_blocks.unit(run, track, signal))
    statistics: PlaceBins | None = None
    peak: Extreme | None = None
    for block in circuit.records(run, track, window, recorded):
        count = block.links.shape[1]
        statistics = statistics or PlaceBins(bins or count, 3)
        values = block.values[0]
        value = ground_pressure.pressure(block.pins, block.axes, values, area) if area else record_blocks.sizes(values)
        of_place = np.concatenate([value[..., None], block.centres], axis=2)
        statistics.add(block, block.joints if signal.startswith("joint") else block.links, of_place)
        peak = larger(peak, block.t, value)
    if statistics is None:
        raise Missing(f"{run.log.path} holds no links of '{track}'")
    place = statistics.place
    forward, up = statistics.of(1)[1], statistics.of(2)[1]
    parts = circuit.stretches(run.scene, place, np.stack([forward, up], axis=1), track)
    names = tuple(circuit.part(each, parts) for each in place)
    scale = 1e3 if area else 1.0
    least, mean, most = (each / scale for each in statistics.of(0))
    peak = peak and peak._replace(value=peak.value / scale)
    force = area * count * float(statistics.total[:, 0].sum() / statistics.time.sum()) if area else 0.0
    return Envelope(
        f"{track}.{signal}", unit, place, least, mean, most, statistics.count, forward, up, names, peak, area, force
    )
