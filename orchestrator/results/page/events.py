"""What happened, as far as the record shows, in few rows: ``analyses/events.py``, what recurs taken together."""

from __future__ import annotations

from typing import NamedTuple

from orchestrator.results.analyses import events as happened
from orchestrator.results.analyses import wheel_loads
from orchestrator.results.analyses.spells import Spell, settling
from orchestrator.results.page.words import instance, number, text, wheel_name
from orchestrator.results.run_data import Missing, RunData
from orchestrator.results.validity.ledger import validity

SHOWN = 40  # warnings


class Event(NamedTuple):
    """A line of the table, as HTML."""

    t: float
    what: str
    where: str
    detail: str


def lifted(run: RunData) -> dict[tuple[str, str], list[Spell]]:
    """When road wheels are lifted off, by track and wheel; raises LogUnreadable."""
    try:
        found = wheel_loads.lifted(run).of
    except Missing:
        return {}
    return {tuple(name.split(".", 1)): spells for name, spells in found.items()}  # type: ignore[misc]


def events(run: RunData) -> list[Event]:
    """In the order of time; raises LogUnreadable."""
    found = [*_borne(run), *_rejections(run), *_warnings(run), *_limits(run)]
    return sorted(found, key=lambda event: event.t)


def _borne(run: RunData) -> list[Event]:
    made = []
    for (track, wheel), spells in lifted(run).items():
        if times := [spell for spell in spells if not settling(run, spell.end)]:
            made.append(_spell(times, "Road wheel is lifted off", f"{instance(track)}, {text(wheel_name(wheel))}"))
    for track, spells in happened.off_ground(run).of.items():
        if times := [spell for spell in spells if not settling(run, spell.end)]:
            made.append(_spell(times, "Track is off the ground", instance(track)))
    return made


def _spell(times: list[Spell], what: str, where: str) -> Event:
    total = sum(spell.time for spell in times)
    longest = max(times, key=lambda spell: spell.time)
    count = "once" if len(times) == 1 else f"{len(times)} times, {number(total, 3)} s together"
    start = f"{number(longest.start)} to {number(longest.end)} s"
    return Event(times[0].start, what, where, f"{count}; {'longest ' if len(times) > 1 else ''}{start}")


def _rejections(run: RunData) -> list[Event]:
    return [
        Event(float(t[0]), "Solver took back a step and halved it", instance(name),
              f"{number(more.sum(), 7)} in all; last by {number(t[-1])} s")
        for name, t, more in happened.rejections(run)
    ]  # fmt: skip


def _warnings(run: RunData) -> list[Event]:
    told = [*happened.warnings(run)][:SHOWN]
    return [Event(event.t, "Warning", instance(event.component), text(event.text)) for event in told]


def _limits(run: RunData) -> list[Event]:
    return [
        Event(entry.time, f"Limit of validity, {entry.severity}", instance(entry.component), text(entry.sentence))
        for entry in validity(run).entries
    ]
