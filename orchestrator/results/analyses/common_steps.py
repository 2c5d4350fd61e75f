"""Signals that are recorded at the same steps, as columns of one array."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from orchestrator.log.time_series import Floats
from orchestrator.results.run_data import BLOCK, EVER, Missing, RunData, Window

RECOVER = "'cotrack log recover' leaves those of all"


def columns(run: RunData, names: Sequence[str]) -> dict[str, list[int]]:
    """Topics and columns of signals by name, "*" for anything; raises NoSuchSignal."""
    chosen = run.log.choose(patterns) if (patterns := [name for name in names if "*" in name]) else {}
    for name in names:
        if "*" not in name:  # a full name needs no pattern search
            topic, column = run.log.find(name)
            chosen.setdefault(topic, []).append(column)
    return {topic: sorted(set(chosen[topic])) for topic in run.log.topics if topic in chosen}


def common_values(run: RunData, names: Sequence[str], window: Window) -> tuple[Floats, Floats]:
    """Times (m,) and values (m, names) of signals with common steps; raises Missing, NoSuchSignal."""
    columns_by_topic = columns(run, names)
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


def blocks(run: RunData, names: Sequence[str], window: Window = EVER) -> Iterator[tuple[Floats, Floats]]:
    """Times (m,) and values (m, names) in blocks of steps, as far as all signals go; raises Missing, NoSuchSignal."""
    columns_by_topic = columns(run, names)
    places = [(topic, columns_by_topic[topic].index(column)) for topic, column in map(run.log.find, names)]
    for block in run.log.blocks(columns_by_topic, BLOCK, window=window) if columns_by_topic else ():
        count = min(len(series.t) for series in block.values())
        t = next(iter(block.values())).t[:count]
        if not all(np.array_equal(series.t[:count], t) for series in block.values()):
            raise Missing(f"{run.log.path} holds different steps of its components: {RECOVER}")
        yield t, np.stack([block[topic].values[:count, k] for topic, k in places], axis=1)
