"""Bitwise comparison of two runs: the first difference, its spread, and its growth.

Records are compared without interpolation, so both runs must have the same steps. Both logs are read once, side by
side, and are not kept in memory. ``draw`` makes a picture of the growth.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from fmus.vehicles.tables import BadInput
from orchestrator.log.angles import apart, turn_of
from orchestrator.log.bitwise import BitDifference, bit_difference, bit_patterns
from orchestrator.log.reader import Log
from orchestrator.log.time_series import ALL_TIME, Floats, Series, join_series
from orchestrator.results.output_files import new_figure, save_figure

POINTS = 40  # approximate number of points of a growth curve
BIN = 32  # messages whose maximum is kept


class Growth(NamedTuple):
    """Growth of the difference in a topic: largest per interval, over the largest value of its unit."""

    t: Floats  # (k,) s, ends of the intervals
    difference: Floats  # (k,)


class Divergence(NamedTuple):
    """Result of a bitwise comparison."""

    value_count: int  # number of values
    end: float  # s, common end
    first: BitDifference | None  # None: every bit is equal
    spread: tuple[BitDifference, ...]  # first difference of every instance, in order of time
    growth: Mapping[str, Growth]  # by topic, if it differs
    unmatched: tuple[str, ...]  # topics and variables of one log only


def divergence(log: Log, reference: Log, window: tuple[float, float] = ALL_TIME) -> Divergence:
    """Compare all common values in a closed interval of time, s; raises LogUnreadable."""
    shared, unmatched = _common_columns(log, reference)
    before = {topic: _messages_before(reference, topic, window[0]) for topic in shared}
    firsts: list[BitDifference] = []
    growths = {topic: _TopicGrowth([reference.topics[topic].units[k] for k in shared[topic][1]]) for topic in shared}
    value_count, end, uneven = 0, float("nan"), set[str]()
    names = {topic: [log.topics[topic].names[column] for column in columns[0]] for topic, columns in shared.items()}
    for topic, a, b in _side_by_side(log, reference, shared, window):
        if topic in uneven:
            continue
        every, already = reference.topics[topic].every, before[topic]
        before[topic] += len(a.t)
        end = float(np.fmax(end, b.t[-1]))
        moments = bit_patterns(a.t) != bit_patterns(b.t)
        if moments.any():  # different steps: later rows do not correspond
            row = int(moments.argmax())
            uneven.add(topic)
            firsts.append(bit_difference(topic, "t", (already + row) * every, a.t[row], b.t[row], float(b.t[row])))
            a, b = a.rows(slice(row)), b.rows(slice(row))
        value_count += a.values.size
        different = bit_patterns(a.values) != bit_patterns(b.values)
        if different.any() and not growths[topic].t:
            row = int(different.any(axis=1).argmax())
            column = int(different[row].argmax())
            values = a.values[row, column], b.values[row, column]
            name, step = names[topic][column], (already + row) * every
            firsts.append(bit_difference(topic, name, step, *values, float(b.t[row])))
        growths[topic].add(a, b, bool(different.any()))
    firsts.sort(key=lambda first: (first.t, first.variable != "t"))
    instances: dict[str, BitDifference] = {}
    for first in firsts:
        instances.setdefault(first.instance, first)
    growth = {topic: topic_growth.curve() for topic, topic_growth in growths.items() if topic_growth.t}
    return Divergence(value_count, end, firsts[0] if firsts else None, tuple(instances.values()), growth, unmatched)


class _TopicGrowth:
    """Largest differences of a topic over time, by unit."""

    def __init__(self, units: Sequence[str]) -> None:
        self._unit = np.unique(np.array(units, dtype=str), return_inverse=True)[1]  # index of the unit of each column
        self._turn = np.array([turn_of(unit) for unit in units])
        self._size = np.zeros(len(set(units)))  # one scale per unit: a lateral force may be rounding only
        self.t: list[float] = []  # ends of bins, from the first difference on
        self._differences: list[Floats] = []  # of each bin, by unit

    def add(self, a: Series, b: Series, different: bool) -> None:
        """Add messages of both logs."""
        if not b.values.size:
            return
        with np.errstate(all="ignore"):  # values of an unstable run may overflow
            np.fmax.at(self._size, self._unit, np.abs(b.values).max(axis=0))
            if not (different or self.t):
                return
            differences = apart(a.values, b.values, self._turn)
            differences = np.where(
                bit_patterns(a.values) == bit_patterns(b.values),
                0.0,
                np.where(np.isnan(differences), np.inf, differences),
            )
        for first in range(0, len(b.t), BIN):
            most = np.zeros(len(self._size))
            np.maximum.at(most, self._unit, differences[first : first + BIN].max(axis=0))
            self.t.append(float(b.t[first : first + BIN][-1]))
            self._differences.append(most)

    def curve(self) -> Growth:
        """Growth over some intervals."""
        differences = (np.array(self._differences) / np.where(self._size > 0.0, self._size, 1.0)).max(axis=1)
        first = int((differences > 0.0).argmax())
        starts = np.arange(first, len(differences), max(1, -(-(len(differences) - first) // POINTS)))
        ends = np.append(starts[1:], len(differences)) - 1
        return Growth(np.array(self.t)[ends], np.maximum.reduceat(differences, starts))


Shared = dict[str, tuple[list[int], list[int]]]  # by topic: columns of the common variables in both logs


def _common_columns(log: Log, reference: Log) -> tuple[Shared, tuple[str, ...]]:
    shared: Shared = {}
    unmatched = [f"{side.path}: {topic}" for side, other in ((log, reference), (reference, log))
                 for topic in side.topics if not topic.startswith("/stats/") and topic not in other.topics]  # fmt: skip
    for topic, in_log in log.topics.items():
        in_reference = reference.topics.get(topic)
        if in_reference is None or topic.startswith("/stats/"):
            continue
        if in_reference.every != in_log.every:
            unmatched.append(f"{topic}: one step in {in_log.every} and {in_reference.every}")
            continue
        reference_column = {name: column for column, name in enumerate(in_reference.names)}
        common = [name for name in in_log.names if name in reference_column]
        log_column = {name: column for column, name in enumerate(in_log.names)}
        unmatched += [f"{topic}: {name}" for name in sorted({*in_log.names} ^ {*in_reference.names})]
        shared[topic] = [log_column[name] for name in common], [reference_column[name] for name in common]
    return shared, tuple(unmatched)


def _messages_before(log: Log, topic: str, start: float) -> int:
    """Number of messages of a topic before a time, s."""
    return (
        0
        if start == ALL_TIME[0]
        else int((log.select({topic: []}, (ALL_TIME[0], start))[topic].t < start - 1e-9).sum())
    )


def _side_by_side(
    log: Log, reference: Log, shared: Shared, window: tuple[float, float]
) -> Iterator[tuple[str, Series, Series]]:
    """Messages of each topic in pairs, in blocks, until one of the logs ends."""
    columns_of_logs: Sequence[dict[str, list[int]]] = [
        {topic: both[k] for topic, both in shared.items()} for k in (0, 1)
    ]
    logs = [side.stream(columns, window) for side, columns in zip((log, reference), columns_of_logs, strict=True)]
    waiting: list[dict[str, list[Series]]] = [{topic: [] for topic in shared} for _ in logs]
    reached_time = [-np.inf, -np.inf]
    while True:
        behind = int(reached_time[1] < reached_time[0])
        piece = next(logs[behind], None)
        if piece is None:
            if reached_time[behind] == np.inf:
                return
            reached_time[behind] = np.inf
            continue
        for topic, series in piece.items():
            waiting[behind][topic].append(series)
            reached_time[behind] = max(reached_time[behind], float(series.t[-1]))
        for topic in piece:
            if all(queue[topic] for queue in waiting):
                a, b = (join_series(queue[topic]) for queue in waiting)
                m = min(len(a.t), len(b.t))
                for queue, series in zip(waiting, (a, b), strict=True):
                    queue[topic] = [series.rows(slice(m, None))] if len(series.t) > m else []
                yield topic, a.rows(slice(m)), b.rows(slice(m))


STYLES = {"in": ":", "out": "-", "links": "--"}


def draw(divergence: Divergence, output: Path) -> None:
    """Draw a curve for each topic that differs; raises BadInput without any, or for an unwritable file."""
    if not divergence.growth:
        raise BadInput("both runs are equal bit by bit: there is no growth to draw")
    figure = new_figure(9.0, 4.5)
    pane = figure.subplots()
    instances = list(dict.fromkeys(topic.split("/")[1] for topic in divergence.growth))
    for topic, growth in divergence.growth.items():
        _, instance, kind = topic.split("/", 2)
        finite = np.isfinite(growth.difference) & (growth.difference > 0.0)
        pane.semilogy(
            growth.t[finite], growth.difference[finite], STYLES.get(kind, "-."), color=f"C{instances.index(instance)}",
            marker=".", markersize=3, linewidth=1.0, label=topic,
        )  # fmt: skip
    pane.set_xlabel("t, s")
    pane.set_ylabel("largest difference, over the largest value of its unit")
    pane.grid(alpha=0.3)
    figure.legend(loc="outside right upper", fontsize=7)
    save_figure(figure, output)
