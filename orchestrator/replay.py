"""Replay: one component fed with the inputs that a log holds, bit by bit, at the recorded (t, h)."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from orchestrator.compare import Difference, first_difference
from orchestrator.component import Component
from orchestrator.reader import Log, Series
from orchestrator.recorder import Recorder

Floats = NDArray[np.float64]
Parameters = Mapping[str, float | int | str]
Progress = Callable[[int, float], None]


class Unfit(ValueError):
    """The component cannot be driven by this log; the message is one sentence."""


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
        return f"different: {self.difference}"


class Row(NamedTuple):
    """One signal of two track models under the same wheel motion."""

    name: str
    unit: str
    recorded_mean: float
    replayed_mean: float
    recorded_rms: float
    replayed_rms: float


def drive(component: Component, inputs: Series, parameters: Parameters) -> Iterator[tuple[int, float]]:
    """Step a component through recorded inputs; yields (k, t) at the start and after every step. Raises Unfit."""
    if tuple(component.inputs) != tuple(inputs.names):
        missing = sorted(set(component.inputs) ^ set(inputs.names))
        raise Unfit(
            f"{component.name}: its inputs are not those of the log ({', '.join(missing[:3]) or 'order'})"
        )
    expected = np.concatenate([[0.0], inputs.t[:-1] + inputs.h[:-1]])
    gaps = np.flatnonzero(np.abs(inputs.t - expected) > 1e-9)
    if len(gaps):
        before, after = expected[gaps[0]], inputs.t[gaps[0]]
        raise Unfit(f"{component.name}: the log lacks its inputs from t = {before:.6g} to {after:.6g} s")
    component.initialise(parameters, 0.0)
    yield 0, 0.0
    for k, (t, h, u) in enumerate(zip(inputs.t, inputs.h, inputs.values, strict=True), 1):
        component.u[:] = u
        component.write()
        component.step(float(t), float(h))
        component.read()
        yield k, float(t + h)


def verify(
    log: Log, component: Component, parameters: Parameters, progress: Progress | None = None
) -> Verdict:
    """Step the component again and compare every recorded output and link output, bit by bit."""
    inputs = log.read(f"/{component.name}/in")
    recorded = {
        kind: log.read(topic)
        for kind in ("out", "links")
        if (topic := f"/{component.name}/{kind}") in log.topics
    }
    every = {kind: log.topics[f"/{component.name}/{kind}"].every for kind in recorded}
    rows: dict[str, list[Floats]] = {kind: [] for kind in recorded}
    for k, t in drive(component, inputs, parameters):
        if progress is not None:
            progress(k, t)
        if "out" in rows and k % every["out"] == 0:
            rows["out"].append(component.y.copy())
        if "links" in rows and k % every["links"] == 0:
            component.read_links()
            rows["links"].append(component.y_links.copy())
    differences = []
    for kind, series in recorded.items():
        found = series._replace(
            names=component.outputs if kind == "out" else component.links, values=np.array(rows[kind])
        )
        differences.append(first_difference(component.name, series, found))
    first = min((d for d in differences if d is not None), key=lambda d: d.t, default=None)
    return Verdict(len(inputs.t), sum(series.values.size for series in recorded.values()), first)


def answer(
    log: Log,
    component: Component,
    parameters: Parameters,
    path: Path,
    attachments: Mapping[str, bytes],
    links_every: int,
    progress: Progress | None = None,
) -> list[Row]:
    """Another model under the recorded inputs: its answer goes to the log ``path``, forces side by side."""
    name = component.name
    inputs = log.read(f"/{name}/in")
    topics = {
        f"/{name}/{kind}": [(variable, component.unit(variable)) for variable in names]
        for kind, names in (("in", component.inputs), ("out", component.outputs), ("links", component.links))
        if names or kind == "in"
    }
    metadata = {"replay": {"of": str(log.path), "component": name}}
    every = {topic: links_every for topic in topics if topic.endswith("/links")}
    answers: list[Floats] = []
    with Recorder(path, topics, attachments, metadata, every=every) as recorder:
        for k, t in drive(component, inputs, parameters):
            if progress is not None:
                progress(k, t)
            h = float(inputs.h[max(k - 1, 0)])
            if k:
                recorder.write(f"/{name}/in", k - 1, float(inputs.t[k - 1]), h, component.u)
            recorder.write(f"/{name}/out", k, t, h, component.y)
            if len(component.y_links) and recorder.due(f"/{name}/links", k):
                component.read_links()
                recorder.write(f"/{name}/links", k, t, h, component.y_links)
            answers.append(component.y.copy())
        recorder.close("ok", "", len(inputs.t), warnings=[asdict(one) for one in component.warnings])
    every_out = log.topics[f"/{name}/out"].every
    return _table(log.read(f"/{name}/out"), component, np.array(answers)[::every_out])


def _table(recorded: Series, component: Component, answers: Floats) -> list[Row]:
    """Tensions and wheel forces, mean and RMS, over the steps that the log holds."""
    mine = {name: i for i, name in enumerate(component.outputs)}
    rows = []
    for i, name in enumerate(recorded.names):
        if name not in mine or not (name.startswith("tension.") or ".force." in name):
            continue
        theirs, ours = recorded.values[:, i], answers[: len(recorded.t), mine[name]]
        rows.append(
            Row(
                name, component.unit(name), float(theirs.mean()), float(ours.mean()), _rms(theirs), _rms(ours)
            )
        )
    return rows


def _rms(values: Floats) -> float:
    return float(np.sqrt(np.mean(values**2)))


def instance(system: Mapping[str, Any], name: str) -> dict[str, Any]:
    """The entry of a component in a log's system; raises Unfit."""
    for entry in system["instances"]:
        if entry["name"] == name:
            return dict(entry)
    known = ", ".join(entry["name"] for entry in system["instances"])
    raise Unfit(f"the log has no component '{name}': one of {known}")
