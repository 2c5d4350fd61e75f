"""Recorded signals in blocks: of the links and pins of a track by record, of instances with common steps."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from fmus.track.link_outputs import INTERVAL
from fmus.vehicles.tables import BadInput
from orchestrator.log.reader import Missing
from orchestrator.log.schema import family
from orchestrator.log.time_series import Floats
from orchestrator.results.run_data import BLOCK, EVER, POSITION, RunData, Window, link_columns, record_durations
from orchestrator.vocabulary.analyses import recorder_of

SIZE = 200  # records in memory at once
GROUPS = {  # signals by the group of ``track.link_outputs`` that contains them
    "link[*].tension": "tension",
    "link[*].stress": "stress",
    "joint[*].position": "position",
    "joint[*].force": "force",
    "link[*].ground.force": "ground",
    "link[*].wheels.force": "wheels",
    "link[*].ground.sliding": "sliding",
    "link[*].ground.depth": "depth",
    "joint[*].tooth.force": "teeth",
    "link[*].rim.force": "rims",
    "link[*].horn.force": "horns",
    "joint[*].moment": "moment",
    "joint[*].axis": "axis",
    "link[*].fibre.outer": "fibres",
    "link[*].fibre.inner": "fibres",
    "link[*].slope.first": "slopes",
    "link[*].slope.last": "slopes",
}


class LinkRecords(NamedTuple):
    """Block of records."""

    t: Floats  # (m,) s
    record_durations: Floats  # (m,) s, time since the record before
    values: tuple[Floats, ...]  # one per signal, (m, links or pins), vectors (m, links or pins, 3)
    pins: Floats  # (m, pins, 3) m, for the axes of forces (``midway``); (m, 0, 3) without positions


def interval(run: RunData, track: str) -> int:
    """Communication steps over which link forces are means; 0 for logs with instantaneous joint forces.

    In these older logs the other forces of links are means over one step.
    """
    for instance in run.system["instances"]:
        if instance["name"] == track:
            return int(instance.get("parameters", {}).get(INTERVAL, 0))
    return 0


def one_signal(run: RunData, track: str, signal: str | Sequence[str], what: str) -> tuple[str, str]:
    """Track and signal of links, whose name may begin with that of the track; raises BadInput for several signals.

    ``what``: the analysis, in the sentence.
    """
    signal, *more = [signal] if isinstance(signal, str) else signal
    if more:
        raise BadInput(f"{what} is of one signal, not of {1 + len(more)}")
    track = next((name for name in run.tracks if signal.startswith(f"{name}.")), track)
    return track, signal.removeprefix(f"{track}.")


def midway(pins: Floats, before: Floats | None) -> Floats:
    """Positions of pins (m, pins, 3), m, midway between each record and the last; ``before`` (1, pins, 3).

    Forces that are means since the last record are resolved in axes of these positions, because links rotate
    meanwhile.
    """
    return 0.5 * (pins + np.concatenate([pins[:1] if before is None else before, pins[:-1]]))


def has(run: RunData, track: str, signal: str) -> bool:
    """True if a signal of links was recorded, as "link[*].tension"."""
    names = run.log.topics[f"/{track}/links"].names if f"/{track}/links" in run.log.topics else ()
    first = signal.replace("*", "1")
    return first in names or f"{first}.x" in names


def count(run: RunData, track: str) -> int:
    """Number of links of a track by its recorded signals; 0 without any."""
    topic = run.log.topics.get(f"/{track}/links")
    families = [family(name) for name in topic.names] if topic else []
    return max((number for key, number in families if number and key.startswith("link[*]")), default=0)


def unit(run: RunData, track: str, signal: str) -> str:
    """Unit of a link signal; raises Missing."""
    column = int(_columns(run, track, signal).flat[0])
    return run.log.topics[f"/{track}/links"].units[column]


def records(run: RunData, track: str, window: Window = EVER, *signals: str) -> Iterator[LinkRecords]:
    """Signals of all links or pins, as "link[*].tension" or, for a vector, "joint[*].position".

    A block holds about SIZE records; nothing is cached. Raises Missing if a signal was not recorded, or not in the
    window.
    """
    topic = f"/{track}/links"
    places = [_columns(run, track, signal) for signal in signals]
    columns_read = list(dict.fromkeys(int(column) for place in places for column in place.flat))
    order = {column: k for k, column in enumerate(columns_read)}
    columns_of_signals = [np.vectorize(order.__getitem__)(place) for place in places]
    last: float | None = None
    before: Floats | None = None
    means = interval(run, track) > 0
    for block in run.log.blocks({topic: columns_read}, SIZE, window=window):
        series = block[topic]
        if len(series.t):
            values = tuple(series.values[:, place] for place in columns_of_signals)
            pins = values[signals.index(POSITION)] if POSITION in signals else np.empty((len(series.t), 0, 3))
            yield LinkRecords(
                series.t, record_durations(series.t, last), values, midway(pins, before) if means else pins
            )
            last, before = float(series.t[-1]), pins[-1:]
    if last is None:
        when = f"between {window.start:g} and {window.end:g} s"
        raise Missing(f"{run.log.path}: no links of '{track}' were recorded {when}")


def sizes(values: Floats) -> Floats:
    """Values (m, links) with their sign, or norms of vectors (m, links, 3)."""
    return values if values.ndim == 2 else np.linalg.norm(values, axis=2)


def _columns(run: RunData, track: str, signal: str) -> np.ndarray:
    """Columns of a signal (n,), of a vector (n, 3); raises Missing."""
    topic = f"/{track}/links"
    found = link_columns(run.log.topics[topic].names if topic in run.log.topics else (), signal)
    if not found.size:
        group = GROUPS.get(signal)
        option = f", or cotrack run --for {recorder_of(group)}" if group and recorder_of(group) else ""
        how = f"; record it with the group '{group}' of track.link_outputs in the scene{option}" if group else ""
        raise Missing(f"{run.log.path} holds no '{track}.{signal}'{how}")
    return found


ALIKE = 1e-9  # relative difference of values that differ by rounding only


class Extreme(NamedTuple):
    """Largest value of any member."""

    value: float
    t: float  # s
    member: int  # number of the link or pin, from 1


def larger(known: Extreme | None, t: Floats, values: Floats) -> Extreme | None:
    """Larger of a known extreme and the largest of finite values (m, members) at times (m,), s.

    Of values that are equal but for rounding, the first one counts.
    """
    finite = np.where(np.isfinite(values), values, -np.inf)
    most = finite.max(initial=-np.inf)
    if not np.isfinite(most) or (known and not most > known.value + ALIKE * abs(known.value)):
        return known
    row, column = np.argwhere(finite >= most - ALIKE * abs(most))[0]
    return Extreme(float(finite[row, column]), float(t[row]), int(column) + 1)


def smaller(known: Extreme | None, t: Floats, values: Floats) -> Extreme | None:
    """Smaller of a known extreme and the smallest of finite values; see ``larger``."""
    found = larger(known and known._replace(value=-known.value), t, -values)
    return found and found._replace(value=-found.value)


RECOVER = "'cotrack log recover' leaves those of all"


def named_columns(run: RunData, names: Sequence[str]) -> dict[str, list[int]]:
    """Topics and columns of signals by name, "*" for anything; raises Missing."""
    chosen = run.log.choose(patterns) if (patterns := [name for name in names if "*" in name]) else {}
    for name in names:
        if "*" not in name:  # a full name needs no pattern search
            topic, column = run.log.find(name)
            chosen.setdefault(topic, []).append(column)
    return {topic: sorted(set(chosen[topic])) for topic in run.log.topics if topic in chosen}


def common_values(run: RunData, names: Sequence[str], window: Window) -> tuple[Floats, Floats]:
    """Times (m,) and values (m, names) of signals with common steps; raises Missing."""
    columns_by_topic = named_columns(run, names)
    series_by_topic = run.log.select(columns_by_topic, window)
    t = next(iter(series_by_topic.values())).t
    if not all(np.array_equal(series.t, t) for series in series_by_topic.values()):
        raise Missing(f"{run.log.path} holds different steps of its components: {RECOVER}")
    if not len(t):
        raise Missing(f"{run.log.path} holds no step between {window.start:g} and {window.end:g} s")
    places = [run.log.find(name) for name in names]
    return t, np.stack(
        [series_by_topic[topic].values[:, columns_by_topic[topic].index(column)] for topic, column in places], axis=1
    )


def common_blocks(run: RunData, names: Sequence[str], window: Window = EVER) -> Iterator[tuple[Floats, Floats]]:
    """Times (m,) and values (m, names) in blocks of steps, as far as all signals go; raises Missing."""
    columns_by_topic = named_columns(run, names)
    places = [(topic, columns_by_topic[topic].index(column)) for topic, column in map(run.log.find, names)]
    for block in run.log.blocks(columns_by_topic, BLOCK, window=window) if columns_by_topic else ():
        count = min(len(series.t) for series in block.values())
        t = next(iter(block.values())).t[:count]
        if not all(np.array_equal(series.t[:count], t) for series in block.values()):
            raise Missing(f"{run.log.path} holds different steps of its components: {RECOVER}")
        yield t, np.stack([block[topic].values[:count, k] for topic, k in places], axis=1)
