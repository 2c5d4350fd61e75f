"""What was recorded of the links and pins of a track, some records at a time."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from fmus.link_outputs import INTERVAL
from orchestrator.log.schema import family
from orchestrator.log.time_series import Floats
from orchestrator.results.link_columns import POSITION, columns
from orchestrator.results.run_data import EVER, Missing, RunData, Window, since

SIZE = 200  # records that are in memory at once
GROUPS = {  # signals by the groups of ``track.link_outputs`` that record them
    "link[*].tension": "tension",
    "link[*].stress": "stress",
    "joint[*].position": "position",
    "joint[*].force": "force",
    "link[*].ground.force": "ground",
    "link[*].wheels.force": "wheels",
    "link[*].ground.sliding": "sliding",
    "link[*].ground.depth": "depth",
    "joint[*].axis": "axis",
    "link[*].fibre.outer": "fibres",
    "link[*].fibre.inner": "fibres",
    "link[*].slope.first": "slopes",
    "link[*].slope.last": "slopes",
}


class Records(NamedTuple):
    """Some records one after the other."""

    t: Floats  # (m,) s
    since: Floats  # (m,) s, time since the record before
    values: tuple[Floats, ...]  # of each signal (m, links or pins), of a vector (m, links or pins, 3)
    pins: Floats  # (m, pins, 3) m, for the axes of forces (``midway``); (m, 0, 3) where positions are not asked for


def interval(run: RunData, track: str) -> int:
    """Communication steps over which recorded forces of links are means; 0 of logs in which joint forces are instants.

    In those the other forces of links are means over one step.
    """
    for instance in run.system["instances"]:
        if instance["name"] == track:
            return int(instance.get("parameters", {}).get(INTERVAL, 0))
    return 0


def midway(pins: Floats, before: Floats | None) -> Floats:
    """Places of pins (m, pins, 3), m, in the middle between each record and the one before; ``before`` (1, pins, 3).

    Forces that are means since the record before are seen in axes of these: links turn on the way.
    """
    return 0.5 * (pins + np.concatenate([pins[:1] if before is None else before, pins[:-1]]))


def has(run: RunData, track: str, signal: str) -> bool:
    """Whether a signal of links was recorded, as "link[*].tension"."""
    names = run.log.topics[f"/{track}/links"].names if f"/{track}/links" in run.log.topics else ()
    first = signal.replace("*", "1")
    return first in names or f"{first}.x" in names


def count(run: RunData, track: str) -> int:
    """How many links of a track were recorded, by their signals; 0 without any."""
    topic = run.log.topics.get(f"/{track}/links")
    found = [family(name) for name in topic.names] if topic else []
    return max((number for key, number in found if number and key.startswith("link[*]")), default=0)


def unit(run: RunData, track: str, signal: str) -> str:
    """Unit of a signal of links; raises Missing."""
    column = int(_columns(run, track, signal).flat[0])
    return run.log.topics[f"/{track}/links"].units[column]


def records(run: RunData, track: str, window: Window = EVER, *signals: str) -> Iterator[Records]:
    """Signals of all links or pins, as "link[*].tension" or, of a vector, "joint[*].position".

    A block holds some SIZE records; nothing is kept. Raises Missing where one was not recorded, or not in the window.
    """
    topic = f"/{track}/links"
    places = [_columns(run, track, signal) for signal in signals]
    wanted = list(dict.fromkeys(int(column) for place in places for column in place.flat))
    order = {column: k for k, column in enumerate(wanted)}
    found = [np.vectorize(order.__getitem__)(place) for place in places]
    last: float | None = None
    before: Floats | None = None
    means = interval(run, track) > 0
    for block in run.log.blocks({topic: wanted}, SIZE, window=window):
        series = block[topic]
        if len(series.t):
            values = tuple(series.values[:, place] for place in found)
            pins = values[signals.index(POSITION)] if POSITION in signals else np.empty((len(series.t), 0, 3))
            yield Records(series.t, since(series.t, last), values, midway(pins, before) if means else pins)
            last, before = float(series.t[-1]), pins[-1:]
    if last is None:
        when = f"between {window.start:g} and {window.end:g} s"
        raise Missing(f"{run.log.path}: no links of '{track}' were recorded {when}")


def _columns(run: RunData, track: str, signal: str) -> np.ndarray:
    """Columns (n,) or, of a vector, (n, 3); raises Missing."""
    topic = f"/{track}/links"
    found = columns(run.log.topics[topic].names if topic in run.log.topics else (), signal)
    if not found.size:
        group = GROUPS.get(signal)
        how = f"; record it with the group '{group}' of track.link_outputs in the scene" if group else ""
        raise Missing(f"{run.log.path} holds no '{track}.{signal}'{how}")
    return found
