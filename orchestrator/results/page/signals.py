"""Outputs of a run as thinned curves with their extremes, in one pass over the log."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from orchestrator.log.time_series import Floats
from orchestrator.results.analyses import wheel_loads
from orchestrator.results.energy import STORED
from orchestrator.results.moving_mean import Integrals, Moving
from orchestrator.results.run_data import BLOCK, RunData
from orchestrator.results.thinned import Curve, Envelope, Peak

_DRIVEN = re.compile(r"((?:\w+\.)?)torque")
_WHEEL = re.compile(r"((?:road_wheel|idler|sprocket)(?:\[\d+\])?)\.force\.z")


class Recorded(NamedTuple):
    """A signal."""

    curve: Curve
    unit: str
    least: Peak
    most: Peak
    moving: Moving

    @property
    def largest(self) -> Peak:
        """Of its values that of the largest size."""
        return self.most if abs(self.most.value) >= abs(self.least.value) else self.least


def span(run: RunData) -> tuple[float, float]:
    """First and last time of the outputs, s; (0, 0) where there are none. What is no number is damage."""
    ends = [run.log.ends(topic).t for name in run.instances if (topic := f"/{name}/out") in run.log.topics]
    known = [float(t) for each in ends for t in each if np.isfinite(t)]
    return (min(known), max(known)) if known else (0.0, 0.0)


def drives(run: RunData) -> list[str]:
    """What the variables of a drive begin with, "instance." or "instance.side."."""
    return [
        f"{name}.{found[1]}"
        for name in run.instances
        if f"/{name}/out" in run.log.topics
        for variable in run.log.topics[f"/{name}/out"].names
        if (found := _DRIVEN.fullmatch(variable))
    ]


def wheels(run: RunData, track: str) -> list[str]:
    """Names of the wheels that a track acts on."""
    return [found[1] for name in run.log.topics[f"/{track}/out"].names if (found := _WHEEL.fullmatch(name))]


def recorded(run: RunData, signals: Iterable[str]) -> dict[str, Recorded]:
    """Those of the outputs, "instance.variable", that the log has and that are numbers; raises LogUnreadable."""
    wanted: dict[str, list[int]] = {}
    for signal in dict.fromkeys(signals):
        if run.has(signal):
            topic, column = _place(run, signal)
            wanted.setdefault(topic, []).append(column)
    gathered = {topic: _Gathered(run, len(columns)) for topic, columns in wanted.items()}
    for piece in run.log.stream(wanted):
        for topic, series in piece.items():
            gathered[topic].add(series.t, series.values)
    found: dict[str, Recorded] = {}
    for topic, columns in wanted.items():
        about = run.log.topics[topic]
        names = [_name(topic, about.names[column]) for column in columns]
        found |= gathered[topic].signals(names, [about.units[column] for column in columns])
    return found


class _Gathered:
    """Curves, extremes and integrals of some signals of a run, as samples come."""

    def __init__(self, run: RunData, columns: int) -> None:
        self._envelope = Envelope(*span(run), columns)
        self._integrals = Integrals(*span(run), columns)

    def add(self, t: Floats, values: Floats) -> None:
        """Samples (m, columns) at times (m,), s."""
        self._envelope.add(t, values)
        self._integrals.add(t, values)

    def signals(self, names: Sequence[str], units: Sequence[str]) -> dict[str, Recorded]:
        """Those that were numbers."""
        known, integrals = self._envelope, self._integrals
        return {
            name: Recorded(known.curve(k), unit, least, most, integrals.moving(k))
            for k, (name, unit) in enumerate(zip(names, units, strict=True))
            if (least := known.smallest(k)) and (most := known.largest(k))
        }


def loads(run: RunData) -> dict[str, Recorded]:
    """Loads of road wheels, as ``analyses/wheel_loads.py`` has them, "track.road_wheel[1].load"; raises Missing."""
    names = wheel_loads.names(run)
    gathered = _Gathered(run, len(names))
    for t, values in wheel_loads.blocks(run):
        gathered.add(t, values)
    return gathered.signals([f"{name}.load" for name in names], ["N"] * len(names))


def energies(run: RunData) -> dict[str, Curve]:
    """Work, energy that is stored and energy that is lost, since the start, of all components, J; raises LogUnreadable.

    Empty where components were not recorded at the same steps.
    """
    parts: Mapping[str, tuple[str, ...]] = {"work": ("work",), "stored": STORED, "lost": ("dissipated", "covered")}
    columns: dict[str, dict[str, list[int]]] = {}
    for name in run.instances:
        names = run.log.topics[topic].names if (topic := f"/{name}/out") in run.log.topics else ()
        own = {
            what: [k for k, each in enumerate(names) if each.removeprefix("energy.") in which and "energy." in each]
            for what, which in parts.items()
        }
        if any(own.values()):
            columns[topic] = own
    if not columns:
        return {}
    wanted = {topic: sorted({k for each in own.values() for k in each}) for topic, own in columns.items()}
    envelope = Envelope(*span(run), len(parts))
    first: Floats | None = None
    for block in run.log.blocks(wanted, BLOCK):
        count = min(len(series.t) for series in block.values())
        times = [series.t[:count] for series in block.values()]
        if not all(np.array_equal(times[0], each) for each in times):
            return {}
        total = np.zeros((count, len(parts)))
        for topic, own in columns.items():
            copies = run.copies(topic.split("/")[1])
            for k, which in enumerate(own.values()):
                at = [wanted[topic].index(column) for column in which]
                total[:, k] += copies * block[topic].values[:count, at].sum(axis=1)
        if first is None:
            first = total[0] if count else np.zeros(len(parts))
        with np.errstate(invalid="ignore"):  # of a run that blew up
            envelope.add(times[0], total - first)
    return {what: curve for k, what in enumerate(parts) if len((curve := envelope.curve(k)).t)}


def _place(run: RunData, signal: str) -> tuple[str, int]:
    instance, _, variable = signal.partition(".")
    topic = f"/{instance}/out"
    return topic, run.log.topics[topic].names.index(variable)


def _name(topic: str, variable: str) -> str:
    return f"{topic.split('/')[1]}.{variable}"
