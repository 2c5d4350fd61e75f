"""Events of a run in order of time, from its records."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import zip_longest
from typing import Any, NamedTuple

import numpy as np

from orchestrator.log.message_records import Event
from orchestrator.log.reader import Missing
from orchestrator.log.time_series import Floats
from orchestrator.results.analyses import hull
from orchestrator.results.analyses.validity import of as validity
from orchestrator.results.analyses.wheel_loads import is_settling, lifted, off_ground, switches
from orchestrator.results.run_data import EVER, RunData, Window, WrenchPort, within
from orchestrator.results.table import Table

STANDS = 0.1  # rad/s: a slower sprocket stands
TURNS = 0.2  # rad/s: a faster sprocket is released


REJECTED = "solver.rejected"  # variable of a component's statistics


class Events(NamedTuple):
    """Events in order of time."""

    events: tuple[Event, ...]
    teeth: dict[str, int]  # number of teeth passed, by drive

    def of(self, *kinds: str) -> tuple[Event, ...]:
        """Events of some kinds."""
        return tuple(event for event in self.events if event.kind in kinds)

    def table(self) -> Table:
        """Table with a row for each event."""
        columns = (("time", "s"), ("component", ""), ("kind", ""), ("what", ""))
        notes = [f"{count} teeth of {drive} passed" for drive, count in self.teeth.items()]
        return Table.of(f"{len(self.events)} events", columns, [tuple(event) for event in self.events], tuple(notes))


def of(
    run: RunData, window: Window = EVER, teeth: bool = False, open_warnings: Sequence[Mapping[str, Any]] | None = None
) -> Events:
    """Events: wheels and tracks without contact, locked sprockets, halved steps, warnings.

    ``teeth`` adds an event for each tooth that passes; ``open_warnings``: those of a run whose log is open. Raises
    LogUnreadable.
    """
    run.prefetch(_signals(run), window)
    events = [
        *_contact_events(run, window),
        *_lock_events(run, window),
        *_rejection_events(run, window),
        *warnings(run, window, open_warnings),
    ]
    events += _validity_events(run, window)
    counts = {}
    for name, t, passed in _teeth_passed(run, window):
        moves = np.diff(np.floor(passed))
        counts[name] = int(np.abs(moves).sum())
        if teeth:
            events += _tooth_events(name, t, passed, moves)
    return Events(tuple(sorted(events, key=lambda event: (event.t, event.component))), counts)


def _signals(run: RunData) -> Iterator[str]:
    """Signals of drives and solvers that are needed."""
    for _, prefix, name in _drives(run):
        wanted = f"{prefix}angle", f"{prefix}speed", f"{name.partition('.')[0]}.energy.dissipated"
        yield from filter(run.has, wanted)
    for name in run.instances:
        about = run.log.topics.get(f"/stats/{name}")
        if about and REJECTED in about.names:
            yield f"stats.{name}.{REJECTED}"


def _contact_events(run: RunData, window: Window) -> Iterator[Event]:
    """Events of wheels and tracks that lose and regain contact."""
    for by_name, off, on, verb in (
        (lifted(run, window).by_member, "lifted", "touches", "lifts off"),
        (off_ground(run, window).by_member, "airborne", "lands", "leaves the ground"),
    ):
        for name, intervals in by_name.items():
            for interval in intervals:
                early = ", while the vehicle comes to rest" if is_settling(run, interval.end) else ""
                if interval.begins:
                    yield Event(interval.start, name, off, f"{verb}{early}")
                if interval.ends:
                    yield Event(interval.end, name, on, f"{on}, {interval.load / 1e3:.3g} kN{early}")


def _drives(run: RunData) -> Iterator[tuple[WrenchPort, str, str]]:
    """Ports to sprockets on shafts, with variable prefix and name: "left_drive.", "left_drive"."""
    for port in run.ports:
        prefix = f"{port.taker}.{port.taker_connector.removesuffix('sprocket')}"
        if port.taker_connector.endswith("sprocket") and run.has(f"{prefix}angle"):
            yield port, prefix, prefix.removesuffix(".")


def _teeth_passed(run: RunData, window: Window) -> Iterator[tuple[str, Floats, Floats]]:
    """Drive, times (m,), s, and number of teeth passed (m,), for each sprocket that has teeth."""
    for port, prefix, name in _drives(run):
        if port.giver_connector == "sprocket" and "vehicle" in run.scene and not hull.is_smooth(run):
            t, angle = run.signal(f"{prefix}angle", window)
            finite = np.isfinite(angle)
            yield name, t[finite], angle[finite] * hull.pins_of_sprocket(run) / (2.0 * np.pi)


def _tooth_events(name: str, t: Floats, passed: Floats, moves: Floats) -> Iterator[Event]:
    """Event for each step in which teeth pass."""
    for k in np.flatnonzero(moves):
        edge = np.floor(passed[k + 1]) + (moves[k] < 0.0)  # last tooth passed
        share = (edge - passed[k]) / (passed[k + 1] - passed[k])
        size, way = int(abs(moves[k])), "ahead" if moves[k] > 0.0 else "back"
        text = f"{'a tooth' if size == 1 else f'{size} teeth'} {way}"
        yield Event(float(t[k] + share * (t[k + 1] - t[k])), name, "tooth", text)


def _lock_events(run: RunData, window: Window) -> Iterator[Event]:
    """Events of sprockets that stand while their brake dissipates energy, from the start too."""
    for _, prefix, name in _drives(run):
        lost = f"{name.partition('.')[0]}.energy.dissipated"
        if not run.has(lost):
            continue
        (t, speed), (_, braked) = run.signal(f"{prefix}speed", window), run.signal(lost, window)
        if not len(t):
            continue
        size = np.abs(speed)
        ends = [*switches(size < STANDS, size > TURNS, False)]  # a sprocket that stands at first stood before
        stood = [k for k, stands in ends if stands]
        went = [k for k, stands in ends if not stands]
        before = 0
        for begin, end in zip_longest(stood, went):
            until = len(t) - 1 if end is None else end
            if braked[until] > braked[before]:
                yield Event(float(t[begin]), name, "locked", "the brake holds the sprocket against the hull")
                if end is not None:
                    yield Event(float(t[end]), name, "released", "the sprocket turns again")
            before = until


def rejections(run: RunData, window: Window = EVER) -> Iterator[tuple[str, Floats, Floats]]:
    """Component, times (k,), s, and numbers of steps that its solver rejected and halved.

    The first record counts from the start of the run, so a window that begins later does not count it.
    """
    for name in run.instances:
        try:
            t, total = run.signal(f"stats.{name}.{REJECTED}", window)
        except Missing:
            continue
        more = np.diff(total, prepend=0.0 if window.start <= 0.0 else total[:1])
        if (grown := more > 0.0).any():
            yield name, t[grown], more[grown]


def _rejection_events(run: RunData, window: Window) -> Iterator[Event]:
    for name, t, more in rejections(run, window):
        for time, count in zip(t.tolist(), more.astype(int).tolist(), strict=True):
            yield Event(time, name, "step", f"halved its step {count} time{'s' if count > 1 else ''}")


def _validity_events(run: RunData, window: Window) -> Iterator[Event]:
    for entry in validity(run, window).entries:
        name = f"{entry.component}.{entry.place}" if entry.place else entry.component
        yield Event(entry.time, name, "validity", f"{entry.severity}: {entry.sentence}")


def warnings(
    run: RunData, window: Window = EVER, open_warnings: Sequence[Mapping[str, Any]] | None = None
) -> Iterator[Event]:
    """Warnings of components, from the closing record."""
    for warning in (run.log.closing or {}).get("warnings", ()) if open_warnings is None else open_warnings:
        if within(np.array(warning["time"]), window):
            times = f", {warning['count']} times" if warning["count"] > 1 else ""
            yield Event(float(warning["time"]), warning["component"], "warning", f"{warning['text']}{times}")
