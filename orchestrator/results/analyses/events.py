"""Events of a run in order of time, from its records."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import zip_longest
from typing import Any, NamedTuple

import numpy as np

from orchestrator.log.events_topic import Event
from orchestrator.log.time_series import Floats
from orchestrator.results.analyses import hull, wheel_loads
from orchestrator.results.analyses.airborne import off_ground
from orchestrator.results.analyses.spells import Spell, settling, switches
from orchestrator.results.energy import Port, ports
from orchestrator.results.run_data import EVER, Missing, RunData, Window, within
from orchestrator.results.table import Table
from orchestrator.results.validity.ledger import validity

STANDS = 0.1  # rad/s: a slower sprocket stands; default speed below which brakes fade
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
    run: RunData, window: Window = EVER, teeth: bool = False, warned: Sequence[Mapping[str, Any]] | None = None
) -> Events:
    """Events: wheels and tracks without contact, locked sprockets, halved steps, warnings.

    ``teeth`` adds an event for each tooth that passes; ``warned``: warnings of a run whose log is still open. Raises
    LogUnreadable.
    """
    run.hold(_signals(run), window)
    found = [*_borne(run, window), *_locks(run, window), *_steps(run, window), *warnings(run, window, warned)]
    found += _validity(run, window)
    counts = {}
    for name, t, passed in _turned(run, window):
        moves = np.diff(np.floor(passed))
        counts[name] = int(np.abs(moves).sum())
        if teeth:
            found += _teeth(name, t, passed, moves)
    return Events(tuple(sorted(found, key=lambda event: (event.t, event.component))), counts)


def _signals(run: RunData) -> Iterator[str]:
    """Signals of drives and solvers that are needed."""
    for _, prefix, name in _drives(run):
        wanted = f"{prefix}angle", f"{prefix}speed", f"{name.partition('.')[0]}.energy.dissipated"
        yield from filter(run.has, wanted)
    for name in run.instances:
        about = run.log.topics.get(f"/stats/{name}")
        if about and REJECTED in about.names:
            yield f"stats.{name}.{REJECTED}"


def lifted(run: RunData, window: Window = EVER) -> dict[str, list[Spell]]:
    """Intervals in which road wheels are lifted, by wheel; none if their loads were not recorded."""
    try:
        return wheel_loads.lifted(run, window).of
    except Missing:
        return {}


def _borne(run: RunData, window: Window) -> Iterator[Event]:
    """Events of wheels and tracks that lose and regain contact."""
    for found, off, on, verb in (
        (lifted(run, window), "lifted", "touches", "lifts off"),
        (off_ground(run, window).of, "airborne", "lands", "leaves the ground"),
    ):
        for name, each in found.items():
            for spell in each:
                early = ", while the vehicle comes to rest" if settling(run, spell.end) else ""
                if spell.begins:
                    yield Event(spell.start, name, off, f"{verb}{early}")
                if spell.ends:
                    yield Event(spell.end, name, on, f"{on}, {spell.load / 1e3:.3g} kN{early}")


def _drives(run: RunData) -> Iterator[tuple[Port, str, str]]:
    """Ports to sprockets on shafts, with variable prefix and name: "left_drive.", "left_drive"."""
    for port in ports(run):
        prefix = f"{port.taker}.{port.taken.removesuffix('sprocket')}"
        if port.taken.endswith("sprocket") and run.has(f"{prefix}angle"):
            yield port, prefix, prefix.removesuffix(".")


def _turned(run: RunData, window: Window) -> Iterator[tuple[str, Floats, Floats]]:
    """Drive, times (m,), s, and number of teeth passed (m,), for each sprocket."""
    for port, prefix, name in _drives(run):
        if port.connector == "sprocket" and "vehicle" in run.scene:
            t, angle = run.signal(f"{prefix}angle", window)
            known = np.isfinite(angle)
            yield name, t[known], angle[known] * hull.number(run, "sprocket", "teeth") / (2.0 * np.pi)


def _teeth(name: str, t: Floats, passed: Floats, moves: Floats) -> Iterator[Event]:
    """Event for each step in which teeth pass."""
    for at in np.flatnonzero(moves):
        edge = np.floor(passed[at + 1]) + (moves[at] < 0.0)  # last tooth passed
        share = (edge - passed[at]) / (passed[at + 1] - passed[at])
        size, way = int(abs(moves[at])), "ahead" if moves[at] > 0.0 else "back"
        text = f"{'a tooth' if size == 1 else f'{size} teeth'} {way}"
        yield Event(float(t[at] + share * (t[at + 1] - t[at])), name, "tooth", text)


def _locks(run: RunData, window: Window) -> Iterator[Event]:
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
        stood = [at for at, stands in ends if stands]
        went = [at for at, stands in ends if not stands]
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


def _steps(run: RunData, window: Window) -> Iterator[Event]:
    for name, t, more in rejections(run, window):
        for at, count in zip(t.tolist(), more.astype(int).tolist(), strict=True):
            yield Event(at, name, "step", f"halved its step {count} time{'s' if count > 1 else ''}")


def _validity(run: RunData, window: Window) -> Iterator[Event]:
    for entry in validity(run, window).entries:
        name = f"{entry.component}.{entry.place}" if entry.place else entry.component
        yield Event(entry.time, name, "validity", f"{entry.severity}: {entry.sentence}")


def warnings(run: RunData, window: Window = EVER, warned: Sequence[Mapping[str, Any]] | None = None) -> Iterator[Event]:
    """Warnings of components, from the closing record."""
    for told in (run.log.closing or {}).get("warnings", ()) if warned is None else warned:
        if within(np.array(told["time"]), window):
            times = f", {told['count']} times" if told["count"] > 1 else ""
            yield Event(float(told["time"]), told["component"], "warning", f"{told['text']}{times}")
