"""Fatigue of links: rainflow cycles, with Miner's rule and equivalent ranges.

Damage sums are those of Palmgren and Miner. The stress is the mean along a link at the two faces of the section,
axial and bending: it is less than the largest along the link. Notches must be in the given S-N line. Mean stress has
no influence. The equivalent range of a record is the range that does its damage in the cycles of the S-N line; it is
defined for forces of links too, by cycles and slope alone.

The residue of rainflow counts as half cycles if a record happens once (ASTM E1049-85, 5.4.4). If it repeats, it closes
across the seams (5.4.5): life and equivalent range are those of the repeated window.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from fmus.track.choices import TRACKS
from fmus.vehicles.tables import BadInput, to_si
from orchestrator.log.extra import library
from orchestrator.log.reader import Missing
from orchestrator.log.time_series import Floats
from orchestrator.results.analyses import hull, record_blocks
from orchestrator.results.run_data import EVER, RunData, Window
from orchestrator.results.table import Table
from orchestrator.results.units import hours
from orchestrator.vocabulary.analyses import UNSTRESSED

FIBRES = ("outer", "inner")
MAX_LINKS = 10  # links of a track in the printed table
COUNTS = "damage of the window repeated: its residue closes to whole cycles; once: the residue counts as half cycles"
ALONG = "stress: mean along a link at its outer and inner fibre, which is less than the largest along the link"


class StressLifeLine(NamedTuple):
    """S-N line: N cycles of range S break a part, N = cycles (stress / S) ** slope."""

    stress: float = 100e6  # Pa: reference range, peak to peak
    cycles: float = 2e6  # allowed at the reference range
    slope: float = 3.0

    @classmethod
    def read(cls, text: str) -> StressLifeLine:
        """Parse "stress,cycles,slope", the stress range in Pa or with its unit; raises BadInput."""
        try:
            stress, cycles, slope = text.split(",")
            line = cls(to_si("Pa")(stress.strip()), float(cycles), float(slope))
        except ValueError:
            raise BadInput(
                f"sn = {text}: must be stress range, cycles and slope, as 100e6,2e6,3 or '100 MPa,2e6,3'"
            ) from None
        return line.checked(f"sn = {text}")

    def checked(self, where: str) -> StressLifeLine:
        """The line itself; raises BadInput, which begins with ``where``, unless its numbers are positive."""
        for name, value in self._asdict().items():
            if not 0.0 < value < np.inf:
                raise BadInput(f"{where}: {name} = {value:g}: must be greater than 0 and finite")
        return self

    def __str__(self) -> str:
        return f"S-N line: {self.cycles:g} cycles at a stress range of {self.stress / 1e6:g} MPa, slope {self.slope:g}"


class TrackFatigue(NamedTuple):
    """Cycles and damage of the links of a track, by fibre (outer, inner); of a force in a single column.

    Cycles and ranges are those of each repeat of a window that repeats.
    """

    track: str
    signal: str  # "" for the stress of fibres, else the signal, "link[*].tension"
    unit: str
    window: Window  # recorded time, s
    line: StressLifeLine
    damage_once: Floats  # (links, 2) share of life consumed by the window alone; (links, 1) NaN for a force
    damage_repeated: Floats  # (links, 2) that of each repeat, with the residue closed; (links, 1) NaN for a force
    cycles: Floats  # (links, n) number
    largest: Floats  # (links, n) in the unit, largest range
    equivalent: Floats  # (links, n) in the unit, range that does the same damage in ``line.cycles`` cycles
    sparse: Floats  # (links, n) in the unit, equivalent range of every second record alone
    interval: float  # s, mean time between records

    @property
    def life(self) -> float:
        """Hours until the first link breaks if the window repeats; infinite without damage."""
        most = float(self.damage_repeated.max())
        return (self.window.end - self.window.start) / 3600.0 / most if most else float("inf")

    @property
    def cost(self) -> Floats:
        """Share of each link's damage that every second record alone would miss, (links, n)."""
        whole = np.where(self.equivalent > 0.0, self.equivalent, 1.0)
        return np.where(self.equivalent > 0.0, 1.0 - (self.sparse / whole) ** self.line.slope, 0.0)

    @property
    def worst(self) -> tuple[int, int]:
        """Place of the link that a repeated window damages most, and its fibre, in the arrays."""
        link, column = np.unravel_index(int(self.equivalent.argmax()), self.equivalent.shape)
        return int(link), int(column)

    def rows(self) -> list[tuple[str | int | float, ...]]:
        """Rows of the table by damage, one for each link: its worse fibre."""
        worse = self.equivalent.argmax(axis=1)
        size = 1e6 if self.unit == "Pa" else 1e3 if self.unit == "N" else 1.0
        rows: list[tuple[str | int | float, ...]] = []
        for i in np.argsort(-self.equivalent.max(axis=1), kind="stable"):
            k = worse[i]
            ranges = float(self.equivalent[i, k]) / size, float(self.largest[i, k]) / size
            damages = float(self.damage_repeated[i, k]), float(self.damage_once[i, k])
            damage = () if self.signal else (FIBRES[k], *damages)
            rows.append((self.track, int(i) + 1, *damage, *ranges, float(self.cycles[i, k])))
        return rows


class Fatigue(NamedTuple):
    """Fatigue of one or more tracks."""

    tracks: tuple[TrackFatigue, ...]

    def table(self) -> Table:
        """Table of the most damaged links of each track."""
        return self._table(MAX_LINKS)

    def series(self) -> Table:
        """Table of all links."""
        return self._table(None)

    def _table(self, most: int | None) -> Table:
        first = self.tracks[0]
        unit = {"Pa": "MPa", "N": "kN"}.get(first.unit, first.unit)
        damage = () if first.signal else (("fibre", ""), ("damage repeated", ""), ("damage once", ""))
        columns = (
            ("track", ""), ("link", ""), *damage, ("equivalent range", unit), ("largest range", unit), ("cycles", ""),
        )  # fmt: skip
        rows = [row for each in self.tracks for row in each.rows()[:most]]
        start, end = (f"{moment:.6g}" for moment in first.window)
        links = max(len(each.cycles) for each in self.tracks)
        notes = (
            [f"the {most} worst of {links} links of each track; -o FILE.csv has all"] if most and links > most else []
        )
        title = f"Fatigue{f' by {first.signal}' * bool(first.signal)}, {start} to {end} s"
        return Table.of(title, columns, rows, (*notes, *self.notes()))

    def notes(self) -> tuple[str, ...]:
        """Sentences on S-N line, lives, counts, stress and records."""
        first = self.tracks[0]
        line = first.line
        same = f"equivalent range: {line.cycles:g} cycles of it do the damage of a repeat at a slope of {line.slope:g}"
        worst = max(float(each.cost[each.worst]) for each in self.tracks)
        most = max(float(each.cost.max()) for each in self.tracks)
        recorded = (
            f"recorded every {1e3 * first.interval:.4g} ms (run.links); with every second record alone the most damaged"
            f" link would have {100.0 * worst:.2g} % less damage, others up to {100.0 * most:.2g} % less"
        )
        if first.signal:
            return same, recorded
        lives = [
            f"the first link of {each.track} breaks after {hours(each.life)} of this, repeated"
            if np.isfinite(each.life)
            else f"no link of {each.track} is damaged"
            for each in self.tracks
        ]
        return (str(line), *lives, COUNTS, same, ALONG, recorded)


def of(
    run: RunData,
    track: str = "",
    window: Window = EVER,
    sn: StressLifeLine | str | None = None,
    signal: str | Sequence[str] = "",
) -> Fatigue:
    """Fatigue of each link of a track, by default of all tracks; raises Missing, BadInput, NotInstalled.

    ``sn``: S-N line. ``signal``: a force of links instead of the stress of fibres, "tension" or "link[*].tension";
    a vector counts by its norm.
    """
    line = StressLifeLine.read(sn) if isinstance(sn, str) else (sn or StressLifeLine()).checked("the S-N line")
    track, signal = record_blocks.one_signal(run, track, signal, "fatigue")
    signal = f"link[*].{signal}" if signal and "[" not in signal else signal
    model = run.entry("track", "model")
    if not signal and model in TRACKS and not TRACKS[model].stressed:
        raise Missing(f"{run.log.path}: {TRACKS[model].links} have no stress: {UNSTRESSED}")
    return Fatigue(tuple(_of_track(run, name, window, line, signal) for name in hull.tracks(run, track)))


def _of_track(run: RunData, track: str, window: Window, line: StressLifeLine, signal: str) -> TrackFatigue:
    """Fatigue of each link of a track."""
    signals = [signal] if signal else [f"link[*].fibre.{fibre}" for fibre in FIBRES]
    columns: list[tuple[list[Floats], list[Floats]]] = []  # turning points of all records, of every second one
    times: list[float] = []
    count = 0
    for block in record_blocks.records(run, track, window, *signals):
        values = np.concatenate([*map(record_blocks.sizes, block.values)], axis=1)
        if not np.isfinite(values).all():
            what = f"'{track}.{signal}'" if signal else f"stress of '{track}'"
            raise Missing(f"{run.log.path}: {what} is no finite number from {block.t[0]:g} s on")
        columns = columns or [([], []) for _ in range(values.shape[1])]
        for (whole, sparse), column in zip(columns, values.T, strict=True):
            whole.append(turning_points(column))
            sparse.append(turning_points(column[count % 2 :: 2]))
        times += [float(block.t[0]), float(block.t[-1])]
        count += len(block.t)

    def figures(records: int, counted: Callable[[Floats], Floats]) -> Floats:
        """Equivalent range, number of cycles and largest range, (3, links, n)."""
        cycles = [rainflow_cycles(counted(np.concatenate(column[records]))) for column in columns]
        found = [(equivalent_range(s, n, line.cycles, line.slope), n.sum(), s.max(initial=0.0)) for s, n in cycles]
        return np.array(found).T.reshape(3, len(signals), -1).swapaxes(1, 2)

    equivalent, number, largest = figures(0, closed)
    once, sparse = figures(0, turning_points)[0], figures(1, closed)[0]
    alone, repeated = (
        np.full_like(s, np.nan) if signal else (s / line.stress) ** line.slope for s in (once, equivalent)
    )
    unit, span = record_blocks.unit(run, track, signals[0]), Window(times[0], times[-1])
    interval = (span.end - span.start) / max(count - 1, 1)
    return TrackFatigue(track, signal, unit, span, line, alone, repeated, number, largest, equivalent, sparse, interval)


def equivalent_range(ranges: Floats, counts: Floats, cycles: float, slope: float) -> float:
    """Range that does in so many cycles the damage of ranges (k,) with their counts (k,), by Miner's rule."""
    largest = ranges.max(initial=0.0)
    if not largest > 0.0:
        return 0.0
    return float(largest * (np.sum(counts * (ranges / largest) ** slope) / cycles) ** (1.0 / slope))


def turning_points(values: Floats) -> Floats:
    """End points and turning points of a record (m,); only these affect cycles."""
    return values[turning_places(values)]


def turning_places(values: Floats) -> np.ndarray:
    """Places (k,) of the end points and turning points in a record (m,)."""
    if len(values) < 3:
        return np.arange(len(values))
    kept = np.flatnonzero(np.append(True, np.diff(values) != 0.0))  # first of equal neighbours
    turns = np.flatnonzero(np.diff(np.sign(np.diff(values[kept])))) + 1
    return kept[np.unique(np.concatenate([[0], turns, [len(kept) - 1]]))]


def closed(values: Floats) -> Floats:
    """Turning points (m,) of a repeated record (n,) from its largest value on, as ASTM E1049-85, 5.4.5 counts it."""
    return values[closed_places(values)]


def closed_places(values: Floats) -> np.ndarray:
    """Places (m,) in a record (n,) of its points ``closed``."""
    once_round = (np.arange(len(values) + 1) + values.argmax()) % len(values)
    return once_round[turning_places(values[once_round])]


def rainflow_cycles(values: Floats) -> tuple[Floats, Floats]:
    """Ranges (k,) of a record (m,) and their counts, 1 or 0.5, by ASTM E1049-85; raises NotInstalled."""
    sizes, _, counts, _ = cycles_with_peaks(values)
    return sizes, counts


def cycles_with_peaks(values: Floats) -> tuple[Floats, Floats, Floats, np.ndarray]:
    """Ranges, means, counts and places of the largest values (k,) as of ``rainflow_cycles``."""
    if not np.ptp(values):
        return np.empty(0), np.empty(0), np.empty(0), np.empty(0, int)
    twice = [values[0], *values.tolist()]  # of a record of two points the package counts none
    sizes, means, counts, *ends = np.array([*library("rainflow").extract_cycles(twice)]).reshape(-1, 5).T
    first, last = (np.maximum(end.astype(int) - 1, 0) for end in ends)
    return sizes, means, counts, np.where(values[first] >= values[last], first, last)
