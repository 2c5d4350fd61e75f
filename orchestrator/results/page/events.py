"""What happened, as far as the record shows: unloaded wheels, steps taken again, warnings."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from orchestrator.log.time_series import Floats
from orchestrator.results.page.signals import Spell, spells, wheels
from orchestrator.results.page.words import instance, number, text, wheel_name
from orchestrator.results.run_data import RunData

SHOWN = 40  # rows
SETTLING = 0.1  # s: as drawn, a vehicle does not rest on its tracks yet


class Event(NamedTuple):
    """A line of the table, as HTML."""

    t: float
    what: str
    where: str
    detail: str


def _slack(force: Floats) -> NDArray[np.bool_]:
    return force <= 0.0


def _pushed(force: Floats) -> NDArray[np.bool_]:
    return force > 0.0


def unloaded(run: RunData) -> dict[tuple[str, str], list[Spell]]:
    """When the chain did not push a road wheel up, by track and wheel; raises LogUnreadable."""
    names = {
        f"{track}.{wheel}.force.z": (track, wheel)
        for track in run.tracks
        for wheel in wheels(run, track)
        if wheel.startswith("road_wheel")
    }
    found = spells(run, names, _slack)
    return {names[signal]: found[signal] for signal in found}


def off_ground(run: RunData) -> dict[str, list[Spell]]:
    """When the ground did not push a track up, of tracks that it ever pushes; raises LogUnreadable."""
    names = {f"{track}.ground.force.z": track for track in run.tracks}
    found = spells(run, names, _slack)
    pushed = spells(run, names, _pushed)
    return {names[signal]: found[signal] for signal in found if pushed[signal]}


def events(run: RunData) -> list[Event]:
    """In the order of time; raises LogUnreadable."""
    found = [*_lifts(run), *_rejections(run), *_warnings(run)]
    return sorted(found, key=lambda event: event.t)


def settling(run: RunData, spell: Spell) -> bool:
    """Whether a vehicle was then just coming to rest."""
    return run.scene.get("assembly") == "vehicle" and spell.end <= SETTLING


def _lifts(run: RunData) -> list[Event]:
    made = []
    for (track, wheel), spells_of in unloaded(run).items():
        if times := [spell for spell in spells_of if not settling(run, spell)]:
            made.append(_spell(times, "Road wheel carries nothing", f"{instance(track)}, {text(wheel_name(wheel))}"))
    for track, spells_of in off_ground(run).items():
        if times := [spell for spell in spells_of if not settling(run, spell)]:
            made.append(_spell(times, "Track is off the ground", instance(track)))
    return made


def _spell(times: list[Spell], what: str, where: str) -> Event:
    total = sum(spell.end - spell.start for spell in times)
    longest = max(times, key=lambda spell: spell.end - spell.start)
    count = "once" if len(times) == 1 else f"{len(times)} times, {number(total, 3)} s together"
    start = f"{number(longest.start)} to {number(longest.end)} s"
    return Event(times[0].start, what, where, f"{count}; {'longest ' if len(times) > 1 else ''}{start}")


def _rejections(run: RunData) -> list[Event]:
    made = []
    for topic, about in run.log.topics.items():
        if not topic.startswith("/stats/") or "solver.rejected" not in about.names:
            continue
        series = run.log.select({topic: [about.names.index("solver.rejected")]})[topic]
        grown = np.diff(series.values[:, 0], prepend=0.0)
        rows = np.flatnonzero(grown > 0.0)
        if len(rows):
            total, last = float(series.values[rows[-1], 0]), float(series.t[rows[-1]])
            where = instance(topic.removeprefix("/stats/"))
            detail = f"{number(total, 7)} in all; last by {number(last)} s"
            made.append(Event(float(series.t[rows[0]]), "Solver took back a step and halved it", where, detail))
    return made


def _warnings(run: RunData) -> list[Event]:
    made = []
    for told in (run.log.closing or {}).get("warnings", [])[:SHOWN]:
        count = f" ({told['count']} times)" if told["count"] > 1 else ""
        made.append(Event(float(told["time"]), "Warning", instance(told["component"]), f"{text(told['text'])}{count}"))
    return made
