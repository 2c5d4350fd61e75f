"""Replay: one component fed with the inputs that a log holds, bit by bit, at the recorded (t, h)."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from orchestrator.component import Component
from orchestrator.reader import Log, NoSuchSignal, Series
from orchestrator.recorder import Recorder

Floats = NDArray[np.float64]
Parameters = Mapping[str, float | int | str]


class Unfit(ValueError):
    """The component cannot be driven by this log; the message is one sentence."""


class Difference(NamedTuple):
    """The first place where a replay departs from its log."""

    topic: str
    t: float
    variable: str
    recorded: float
    replayed: float


class Verdict(NamedTuple):
    """What a bitwise replay found."""

    steps: int
    compared: int  # numbers compared
    difference: Difference | None  # None: all are equal

    @property
    def sentence(self) -> str:
        """The verdict in words."""
        if self.difference is None:
            return f"equal: {self.compared} numbers of {self.steps} steps, bit by bit"
        topic, t, variable, recorded, replayed = self.difference
        return f"different: {topic} {variable} at t = {t:.6g} s was {recorded!r}, is {replayed!r}"


class Row(NamedTuple):
    """One signal of two track models under the same wheel motion."""

    name: str
    unit: str
    recorded_mean: float
    replayed_mean: float
    recorded_rms: float
    replayed_rms: float


class Moment(NamedTuple):
    """The component after k steps."""

    k: int
    t: float


def drive(component: Component, inputs: Series, parameters: Parameters) -> Iterator[Moment]:
    """Initialise and step a component through recorded inputs; yields before the first and after every step."""
    if tuple(component.inputs) != tuple(inputs.names):
        missing = sorted(set(component.inputs) ^ set(inputs.names))
        raise Unfit(f"{component.name}: its inputs are not those of the log ({', '.join(missing[:3]) or 'order'})")
    component.initialise(parameters, 0.0)
    component.read()
    yield Moment(0, 0.0)
    for k, (t, h, u) in enumerate(zip(inputs.t, inputs.h, inputs.values, strict=True), 1):
        component.u[:] = u
        component.write()
        component.step(float(t), float(h))
        component.read()
        yield Moment(k, float(t + h))


def verify(log: Log, component: Component, parameters: Parameters, progress: Callable[[int, float], None] | None = None) -> Verdict:
    """Compare every recorded output and link output of the component, bit by bit, up to the first difference."""
    inputs = log.read(f"/{component.name}/in")
    expected = {kind: _by_step(log, f"/{component.name}/{kind}") for kind in ("out", "links")}
    compared = 0
    for moment in drive(component, inputs, parameters):
        if progress is not None:
            progress(*moment)
        for kind, (series, rows) in expected.items():
            if series is None or moment.k not in rows:
                continue
            if kind == "links":
                component.read_links()
            found = component.y if kind == "out" else component.y_links
            recorded = series.values[rows[moment.k]]
            unequal = np.flatnonzero(recorded.view(np.uint64) != found.view(np.uint64))
            compared += len(recorded)
            if len(unequal):
                i = int(unequal[0])
                difference = Difference(
                    series_topic(component, kind), moment.t, series.names[i], float(recorded[i]), float(found[i])
                )
                return Verdict(moment.k, compared, difference)
    return Verdict(len(inputs.t), compared, None)


def answer(
    log: Log, component: Component, parameters: Parameters, path: Path, attachments: Mapping[str, bytes], links_every: int,
    progress: Callable[[int, float], None] | None = None,
) -> list[Row]:
    """Put another model under the recorded inputs, log its answer to ``path``, compare forces side by side."""
    name = component.name
    inputs = log.read(f"/{name}/in")
    topics = {
        f"/{name}/{kind}": [(variable, component.unit(variable)) for variable in names]
        for kind, names in (("in", component.inputs), ("out", component.outputs), ("links", component.links))
        if names or kind == "in"
    }
    metadata = {"replay": {"of": str(log.path), "component": name}}
    every = {topic: links_every for topic in topics if topic.endswith("/links")}
    with Recorder(path, topics, attachments, metadata, every=every) as recorder:
        answers, steps = [component.y.copy()], 0
        for k, t in drive(component, inputs, parameters):
            if progress is not None:
                progress(k, t)
            h = float(inputs.h[max(k - 1, 0)])
            if k:
                recorder.write(f"/{name}/in", k - 1, float(inputs.t[k - 1]), h, component.u)
                answers.append(component.y.copy())
            else:
                answers[0] = component.y.copy()
            recorder.write(f"/{name}/out", k, t, h, component.y)
            if len(component.y_links) and recorder.due(f"/{name}/links", k):
                component.read_links()
                recorder.write(f"/{name}/links", k, t, h, component.y_links)
            steps = k
        recorder.close("ok", "", steps)
    return _table(log.read(f"/{name}/out"), component, np.array(answers))


def _table(recorded: Series, component: Component, answers: Floats) -> list[Row]:
    """Tensions and wheel forces, mean and RMS, over the steps that the log holds."""
    mine = {name: i for i, name in enumerate(component.outputs)}
    rows = []
    for i, name in enumerate(recorded.names):
        if name not in mine or not (name.startswith("tension.") or ".force." in name):
            continue
        theirs, ours = recorded.values[:, i], answers[recorded.sequence, mine[name]]
        rows.append(
            Row(name, component.unit(name), float(theirs.mean()), float(ours.mean()), _rms(theirs), _rms(ours))
        )
    return rows


def _rms(values: Floats) -> float:
    return float(np.sqrt(np.mean(values**2)))


def _by_step(log: Log, topic: str) -> tuple[Series | None, dict[int, int]]:
    try:
        series = log.read(topic)
    except NoSuchSignal:
        return None, {}
    return series, {int(k): row for row, k in enumerate(series.sequence)}


def series_topic(component: Component, kind: str) -> str:
    """Topic of a component's ``kind`` of record."""
    return f"/{component.name}/{kind}"


def instance(system: Mapping[str, Any], name: str) -> dict[str, Any]:
    """The entry of a component in a log's system; raises Unfit."""
    for entry in system["instances"]:
        if entry["name"] == name:
            return dict(entry)
    known = ", ".join(entry["name"] for entry in system["instances"])
    raise Unfit(f"the log has no component '{name}': one of {known}")
