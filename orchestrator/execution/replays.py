"""Replay of a component: step it with the recorded inputs at the recorded t and h."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from dataclasses import asdict
from itertools import chain
from pathlib import Path
from typing import NamedTuple

import numpy as np

from orchestrator.cosim.component import Component
from orchestrator.log.bitwise import BitDifference, first_difference
from orchestrator.log.log_metadata import TEXTS
from orchestrator.log.reader import Log
from orchestrator.log.recorder import Recorder
from orchestrator.log.time_series import ALL_TIME, Floats, Series, within

Parameters = Mapping[str, float | int | str]


class UnfitLog(ValueError):
    """The log cannot drive this component; the message is one sentence."""


class ReplayVerdict(NamedTuple):
    """Result of a bitwise replay."""

    steps: int
    compared: int  # number of values compared
    difference: BitDifference | None  # None: all are equal

    @property
    def equal(self) -> bool:
        """True if values were compared, and none differs."""
        return self.difference is None and self.steps > 0 and self.compared > 0

    @property
    def sentence(self) -> str:
        """Verdict as a sentence."""
        if not self.steps or not self.compared:
            return f"nothing was compared: the log holds {self.steps} steps and {self.compared} of its values"
        if self.difference is None:
            return f"equal: {self.compared} numbers of {self.steps} steps, bit by bit"
        return f"different: {self.difference}"


def inputs_of(component: Component, inputs: Series) -> Series:
    """Recorded inputs in the order of a component's; raises UnfitLog if they cannot drive it."""
    if missing := sorted(set(component.inputs) ^ set(inputs.names)):
        raise UnfitLog(f"{component.name}: its inputs are not those of the log ({', '.join(missing[:3])})")
    if gap := inputs.gap():
        raise UnfitLog(f"{component.name}: the log lacks its inputs from t = {gap[0]:.6g} to {gap[1]:.6g} s")
    if tuple(component.inputs) == inputs.names:
        return inputs
    return inputs.columns([inputs.names.index(name) for name in component.inputs])


def _ends(inputs: Series) -> Floats:
    """Ends (m,), s, of the steps of recorded inputs."""
    return np.append(inputs.t[1:], inputs.t[-1:] + inputs.h[-1:])


def step_recorded(component: Component, inputs: Series, parameters: Parameters) -> Iterator[tuple[int, float]]:
    """Step a component with recorded inputs; yields (k, t) at the start and after each step; raises UnfitLog."""
    inputs = inputs_of(component, inputs)
    component.initialise(parameters)
    yield 0, 0.0
    ends = _ends(inputs)
    for k, (t, h, u) in enumerate(zip(inputs.t, inputs.h, inputs.values, strict=True), 1):
        component.u[:] = u
        component.write()
        component.step(float(t), float(h))
        component.read()
        yield k, float(ends[k - 1])


def verify(
    log: Log, component: Component, parameters: Parameters, window: tuple[float, float] = ALL_TIME
) -> ReplayVerdict:
    """Step the component again and compare all recorded outputs, bit by bit; raises UnfitLog.

    Link outputs are included. With a window, a closed time interval, s, the component is stepped to its end and
    compared inside it.
    """
    inputs = log.read(f"/{component.name}/in")
    inputs_of(component, inputs)
    out, links = (f"/{component.name}/{kind}" for kind in ("out", "links"))
    outputs = {out: (component.outputs, component.y), links: (component.links, component.y_links)}
    recorded = {topic: log.read(topic) for topic in outputs if topic in log.topics}
    for topic, series in recorded.items():
        if not np.array_equal(log.sequence(topic), np.arange(0, len(inputs.t) + 1, log.topics[topic].every)):
            raise UnfitLog(
                f"{topic} does not hold the steps that the inputs lead to: 'cotrack log recover' leaves whole steps"
            )
        if series.names != outputs[topic][0]:
            raise UnfitLog(f"{component.name}: its outputs are not those of the log")
    numbers = {
        topic: np.flatnonzero(within(series.t, window)) * log.topics[topic].every for topic, series in recorded.items()
    }
    compared = {topic: set(steps.tolist()) for topic, steps in numbers.items()}
    ends = _ends(inputs)
    stepped = np.flatnonzero(within(ends, window)) + 1
    last = max([0, *stepped.tolist()])
    rows: dict[str, list[Floats]] = {topic: [] for topic in recorded}
    for k, _ in step_recorded(component, inputs, parameters):
        if k > last:
            break
        for topic in recorded:
            if k in compared[topic]:
                if topic == links:
                    component.read_links()
                rows[topic].append(outputs[topic][1].copy())
    differences = []
    for topic, series in recorded.items():
        every = log.topics[topic].every
        in_window = series.rows(numbers[topic] // every)
        replayed = in_window._replace(values=np.array(rows[topic]).reshape(in_window.values.shape))
        first = int(numbers[topic][0]) if len(numbers[topic]) else 0
        differences.append(first_difference(topic, in_window, replayed, every, first))
    difference = min(
        (candidate for candidate in differences if candidate is not None),
        key=lambda candidate: candidate.t,
        default=None,
    )
    count = sum(len(steps) * recorded[topic].values.shape[1] for topic, steps in compared.items())
    return ReplayVerdict(len(stepped), count, difference)


class LogHeader(NamedTuple):
    """Metadata and attachments for the log of a replayed model."""

    attachments: Mapping[str, bytes]
    metadata: Mapping[str, Mapping[str, str]]
    links_every: int  # communication steps between two records of links


def record(
    log: Log, component: Component, parameters: Parameters, path: Path, header: LogHeader, end: float = ALL_TIME[1]
) -> int:
    """Step another model with the inputs recorded until ``end``, s, and log its outputs to ``path``.

    Returns the number of steps; without a step no log is written. Raises UnfitLog.
    """
    name = component.name
    inputs, recorded = log.read(f"/{name}/in"), log.read(f"/{name}/out")
    inputs = inputs.rows(inputs.t + inputs.h <= end + 1e-9)
    if not len(inputs.t):
        return 0
    topics = {
        f"/{name}/{kind}": [(variable, component.unit(variable)) for variable in names]
        for kind, names in (("in", component.inputs), ("out", component.outputs), ("links", component.links))
        if names or kind == "in"
    }
    every = {topic: header.links_every for topic in topics if topic.endswith("/links")}
    ends = dict(zip(log.sequence(f"/{name}/out").tolist(), recorded.t.tolist(), strict=True))
    steps = step_recorded(component, inputs, parameters)
    start = next(steps)  # raises before a log is opened
    with Recorder(path, topics, header.attachments, header.metadata, every=every) as recorder:
        for k, t in chain([start], steps):
            t = ends.get(k, t)
            h = float(inputs.h[max(k - 1, 0)])
            if k:
                recorder.write(f"/{name}/in", k - 1, float(inputs.t[k - 1]), h, component.u)
            recorder.write(f"/{name}/out", k, t, h, component.y)
            if len(component.y_links) and recorder.due(f"/{name}/links", k):
                component.read_links()
                recorder.write(f"/{name}/links", k, t, h, component.y_links)
        if texts := component.variables.recorded_texts():
            recorder.attach(TEXTS, json.dumps(texts).encode())
        recorder.close("ok", "", len(inputs.t), warnings=[asdict(warning) for warning in component.warnings])
    return len(inputs.t)
