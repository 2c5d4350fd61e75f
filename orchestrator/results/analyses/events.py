"""What happened in a run, in order of time, from what was recorded."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import zip_longest
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from orchestrator.log.time_series import Floats
from orchestrator.results.analyses import hull, wheel_loads
from orchestrator.results.analyses.table import Table
from orchestrator.results.energy import Port, ports
from orchestrator.results.run_data import EVER, Missing, RunData, Window, within

STANDS = 0.1  # rad/s: a sprocket that turns more slowly stands: there brakes fade, by default, and creep
TURNS = 0.2  # rad/s: one that turns faster is let go
TOUCHES = 2.0  # times the load of a lifted wheel: with more it touches


class Event(NamedTuple):
    """Something that happened."""

    t: float  # s
    component: str  # "left_track.road_wheel[1]"
    kind: str  # "lifted", "touches", "tooth", "locked", "released", "step", "warning"
    text: str


class Events(NamedTuple):
    """In order of time."""

    events: tuple[Event, ...]
    teeth: dict[str, int]  # by drive, how many teeth passed

    def of(self, *kinds: str) -> tuple[Event, ...]:
        """Those of some kinds."""
        return tuple(event for event in self.events if event.kind in kinds)

    def table(self) -> Table:
        """A row for each event."""
        columns = (("time", "s"), ("component", ""), ("kind", ""), ("what", ""))
        notes = [f"{count} teeth of {drive} passed" for drive, count in self.teeth.items()]
        return Table(f"{len(self.events)} events", columns, [tuple(event) for event in self.events], tuple(notes))


def of(run: RunData, window: Window = EVER, teeth: bool = False) -> Events:
    """Wheels that lift off and touch again, sprockets that lock, steps that solvers took back, warnings of the run.

    ``teeth`` lists also each tooth that passes. Raises LogUnreadable.
    """
    found = [*_wheels(run, window), *_locks(run, window), *_steps(run, window), *_warnings(run, window)]
    counts = {}
    for name, t, passed in _turned(run, window):
        moves = np.diff(np.floor(passed))
        counts[name] = int(np.abs(moves).sum())
        if teeth:
            found += _teeth(name, t, passed, moves)
    return Events(tuple(sorted(found, key=lambda event: (event.t, event.component))), counts)


def switches(low: NDArray[np.bool_], high: NDArray[np.bool_]) -> Iterator[tuple[int, bool]]:
    """Where a state begins, at ``low``, and ends, at ``high``, of samples (m,); what lies between keeps the state.

    A state at the first sample has no beginning.
    """
    state = bool(len(low)) and bool(low[0])
    for at in np.flatnonzero(low | high):
        if bool(low[at]) != state:
            state = not state
            yield int(at), state


def _wheels(run: RunData, window: Window) -> Iterator[Event]:
    try:
        names, t, load = wheel_loads.loads(run, window)
    except Missing:
        return
    least = wheel_loads.LIFTED * load.mean()
    for name, values in zip(names, load.T, strict=True):
        for at, off in switches(values < least, values > TOUCHES * least):
            text = "lifts off" if off else f"touches, {values[at] / 1e3:.3g} kN"
            yield Event(float(t[at]), name, "lifted" if off else "touches", text)


def _drives(run: RunData) -> Iterator[tuple[Port, str, str]]:
    """Ports into what turns on a shaft, what its variables begin with, and its name: "left_drive.", "left_drive"."""
    for port in ports(run):
        prefix = f"{port.taker}.{port.taken.removesuffix('sprocket')}"
        if port.taken.endswith("sprocket") and run.has(f"{prefix}angle"):
            yield port, prefix, prefix.removesuffix(".")


def _turned(run: RunData, window: Window) -> Iterator[tuple[str, Floats, Floats]]:
    """Of each sprocket its drive, times (m,), s, and how many teeth have passed (m,)."""
    for port, prefix, name in _drives(run):
        if port.connector == "sprocket" and "vehicle" in run.scene:
            t, angle = run.signal(f"{prefix}angle", window)
            known = np.isfinite(angle)
            yield name, t[known], angle[known] * hull.number(run, "sprocket", "teeth") / (2.0 * np.pi)


def _teeth(name: str, t: Floats, passed: Floats, moves: Floats) -> Iterator[Event]:
    """An event for each step in which one tooth or more take the place of another."""
    for at in np.flatnonzero(moves):
        edge = np.floor(passed[at + 1]) + (moves[at] < 0.0)  # the last that is passed
        share = (edge - passed[at]) / (passed[at + 1] - passed[at])
        size, way = int(abs(moves[at])), "ahead" if moves[at] > 0.0 else "back"
        text = f"{'a tooth' if size == 1 else f'{size} teeth'} {way}"
        yield Event(float(t[at] + share * (t[at + 1] - t[at])), name, "tooth", text)


def _locks(run: RunData, window: Window) -> Iterator[Event]:
    """Of a sprocket that stands while its brake takes energy, be it from the start."""
    for _, prefix, name in _drives(run):
        lost = f"{name.partition('.')[0]}.energy.dissipated"
        if not run.has(lost):
            continue
        (t, speed), (_, braked) = run.signal(f"{prefix}speed", window), run.signal(lost, window)
        if not len(t):
            continue
        size = np.abs(speed)
        ends = [*switches(size < STANDS, size > TURNS)]
        stood = [at for at, stands in ends if stands] if size[0] >= STANDS else [0, *(at for at, s in ends if s)]
        went = [at for at, stands in ends if not stands]
        before = 0
        for begin, end in zip_longest(stood, went):
            until = len(t) - 1 if end is None else end
            if braked[until] > braked[before]:
                yield Event(float(t[begin]), name, "locked", "the brake holds the sprocket against the hull")
                if end is not None:
                    yield Event(float(t[end]), name, "released", "the sprocket turns again")
            before = until


def _steps(run: RunData, window: Window) -> Iterator[Event]:
    for name in run.instances:
        topic = f"/stats/{name}"
        if topic not in run.log.topics or "solver.rejected" not in run.log.topics[topic].names:
            continue
        column = run.log.topics[topic].names.index("solver.rejected")
        series = run.log.select({topic: [column]}, window)[topic]
        for at in np.flatnonzero(np.diff(series.values[:, 0]) > 0.0):
            more = int(series.values[at + 1, 0] - series.values[at, 0])
            text = f"halved its step {more} times since {series.t[at]:.6g} s"
            yield Event(float(series.t[at + 1]), name, "step", text)


def _warnings(run: RunData, window: Window) -> Iterator[Event]:
    for told in (run.log.closing or {}).get("warnings", ()):
        if within(np.array(told["time"]), window):
            times = f", {told['count']} times" if told["count"] > 1 else ""
            yield Event(float(told["time"]), told["component"], "warning", f"{told['text']}{times}")
