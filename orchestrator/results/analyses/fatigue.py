"""Fatigue of links: rainflow cycles of the stress at outer and inner fibres, with Miner's rule.

Damage sums are those of Palmgren and Miner. The stress is the mean along a link at the two faces of the section,
axial and bending. Notches must be in the given S-N line. Mean stress has no influence.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fmus.vehicle import BadInput
from orchestrator.log.extra import library
from orchestrator.log.time_series import Floats
from orchestrator.results.analyses import hull, link_records
from orchestrator.results.run_data import EVER, Missing, RunData, Window
from orchestrator.results.table import Table

FIBRES = ("outer", "inner")


class StressLifeLine(NamedTuple):
    """S-N line: N cycles of range S break a part, N = cycles (stress / S) ** slope."""

    stress: float = 100e6  # Pa: reference range, peak to peak
    cycles: float = 2e6  # allowed at the reference range
    slope: float = 3.0

    @classmethod
    def read(cls, text: str) -> StressLifeLine:
        """Parse "stress,cycles,slope"; raises BadInput."""
        try:
            stress, cycles, slope = map(float, text.split(","))
        except ValueError:
            raise BadInput(f"--sn {text}: must be stress range in Pa, cycles and slope, as 100e6,2e6,3") from None
        return cls(stress, cycles, slope)


class Fatigue(NamedTuple):
    """Damage by link and fibre (outer, inner)."""

    track: str
    window: Window  # recorded time, s
    line: StressLifeLine
    damage: Floats  # (links, 2) share of life consumed in the window
    cycles: Floats  # (links, 2) number, half cycles as 0.5
    largest: Floats  # (links, 2) Pa, largest range

    @property
    def life(self) -> float:
        """Hours until the first link breaks if the window repeats; infinite without damage."""
        most = float(self.damage.max())
        return (self.window.end - self.window.start) / 3600.0 / most if most else float("inf")

    def table(self) -> Table:
        """Table with a row for each link: its worse fibre."""
        worse = self.damage.argmax(axis=1)
        rows = [
            (i + 1, FIBRES[k], float(self.damage[i, k]), float(self.cycles[i, k]), float(self.largest[i, k]) / 1e6)
            for i, k in enumerate(worse)
        ]
        columns = (("link", ""), ("fibre", ""), ("damage", ""), ("cycles", ""), ("largest range", "MPa"))
        line = self.line
        notes = (
            f"S-N line: {line.cycles:g} cycles at a range of {line.stress / 1e6:g} MPa, slope {line.slope:g}",
            f"the first link breaks after {self.life:.4g} h of this",
        )
        title = f"Fatigue of {self.track}, {self.window.start:.6g} to {self.window.end:.6g} s"
        return Table.of(title, columns, rows, notes)


def of(run: RunData, track: str = "", window: Window = EVER, line: StressLifeLine | str | None = None) -> Fatigue:
    """Fatigue of each link of a track, by default the first; raises Missing, BadInput, NotInstalled."""
    line = StressLifeLine.read(line) if isinstance(line, str) else line or StressLifeLine()
    for name, value in line._asdict().items():
        if not 0.0 < value < np.inf:
            raise BadInput(f"the S-N line's {name} = {value:g}: must be greater than 0 and finite")
    track = hull.tracks(run, track)[0]
    columns: list[list[Floats]] = []
    times: list[float] = []
    for block in link_records.records(run, track, window, *(f"link[*].fibre.{fibre}" for fibre in FIBRES)):
        stress = np.concatenate(block.values, axis=1)
        if not np.isfinite(stress).all():
            raise Missing(f"{run.log.path}: stress of '{track}' is no finite number from {block.t[0]:g} s on")
        columns = columns or [[] for _ in range(stress.shape[1])]
        for gathered, column in zip(columns, stress.T, strict=True):
            gathered.append(turning_points(column))
        times += [float(block.t[0]), float(block.t[-1])]
    counted = [rainflow_cycles(np.concatenate(column)) for column in columns]
    found = np.array(
        [(np.sum(n * (s / line.stress) ** line.slope) / line.cycles, n.sum(), s.max(initial=0.0)) for s, n in counted]
    )
    damage, number, largest = (each.reshape(2, -1).T for each in found.T)
    return Fatigue(track, Window(times[0], times[-1]), line, damage, number, largest)


def turning_points(values: Floats) -> Floats:
    """End points and turning points of a record (m,); only these affect cycles."""
    if len(values) < 3:
        return values
    steps = np.diff(values)
    kept = np.flatnonzero(np.append(True, steps != 0.0))  # first of equal neighbours
    values = values[kept]
    turns = np.flatnonzero(np.diff(np.sign(np.diff(values)))) + 1
    return values[np.unique(np.concatenate([[0], turns, [len(values) - 1]]))]


def rainflow_cycles(values: Floats) -> tuple[Floats, Floats]:
    """Ranges (k,) of a record (m,) and their counts, 1 or 0.5, by ASTM E1049-85; raises NotInstalled."""
    if not np.ptp(values):
        return np.empty(0), np.empty(0)
    found = [(size, count) for size, _, count, _, _ in library("rainflow").extract_cycles(values.tolist())]
    sizes, counts = np.array(found).reshape(-1, 2).T
    return sizes, counts
