"""Section with the events of the run; events that recur are one row."""

from __future__ import annotations

from typing import NamedTuple

from orchestrator.results.analyses import events
from orchestrator.results.analyses.validity import of as validity
from orchestrator.results.analyses.wheel_loads import LIFTED, SETTLING, TOUCHES, UnloadedInterval, is_settling, lifted
from orchestrator.results.page.embedded import instance, quantity, text, wheel, wheel_name
from orchestrator.results.page.heading import PEAKS
from orchestrator.results.page.motion import AT_REST
from orchestrator.results.page.section import PageSection, Pair, table
from orchestrator.results.run_data import RunData
from orchestrator.results.units import number, percent
from orchestrator.vocabulary import and_list

MAX_ROWS = 40  # rows, and warnings


class EventRow(NamedTuple):
    """Row of the table of events, HTML."""

    t: float  # s
    what: str
    where: str
    detail: str


def event_section(pair: Pair) -> PageSection:
    """Section with events, warnings and extremes in order of time, and the events that did not happen."""
    run = pair.run.run
    event_rows = sorted([*rows(run), *_peak_rows(pair)], key=lambda row: row.t)
    cells = [(f"{number(row.t)} s", row.what, row.where, row.detail) for row in event_rows[:MAX_ROWS]]
    html = table(("First at", "What", "Where", "How much, how often"), cells) if cells else ""
    if len(event_rows) > MAX_ROWS:
        html += f"<p class='muted'>and {len(event_rows) - MAX_ROWS} more.</p>"
    loaded = any(name.endswith(".load") for name in pair.run.signals)
    early = [
        name
        for name, intervals in lifted(run).by_member.items()
        if any(is_settling(run, interval.end) for interval in intervals)
    ]
    if absences := _absences(run, event_rows, loaded, bool(early)):
        html += f"<p>{and_list(absences).capitalize()}.</p>"
    if early:
        html += (
            f"<p class='muted'>In its first {number(SETTLING)} s, while the drawn vehicle comes to rest on its tracks,"
            f" {len(early)} road wheel{'s are' if len(early) > 1 else ' is'} lifted off: {_wheels(early)}.</p>"
        )
    if loaded:
        html += (
            f"<p class='muted'>A road wheel is lifted off from where it carries less than {percent(LIFTED)} of the mean"
            f" load of all to where it carries more than {percent(TOUCHES * LIFTED)}.</p>"
        )
    return PageSection("events", "Events", "What happened on the way?", html, {})


def _wheels(wheels: list[str]) -> str:
    parts = [name.partition(".") for name in wheels]
    return text(and_list([f"{wheel_name(wheel)} ({instance(track)})" for track, _, wheel in parts]))


def _absences(run: RunData, event_rows: list[EventRow], loaded: bool, some_settling: bool) -> list[str]:
    """Clauses on the kinds of events that did not happen, HTML."""
    rest = " once the vehicle had come to rest"
    kinds = " ".join(row.what for row in event_rows)
    clauses = (
        [f"no road wheel was lifted off{rest if some_settling else ''}"] if loaded and "lifted" not in kinds else []
    )
    airborne = events.off_ground(run)
    if airborne.threshold > 0.0 and "off the ground" not in kinds:
        clauses.append(f"no track left the ground{rest if any(airborne.by_member.values()) else ''}")
    if any(events.REJECTED in about.names for about in run.log.topics.values()) and "Solver" not in kinds:
        clauses.append("no solver took back a step")
    if run.log.closing is not None and not run.log.closing["warnings"]:
        clauses.append("no component warned")
    return clauses


def rows(run: RunData) -> list[EventRow]:
    """Rows of events and limits of validity in order of time; raises LogUnreadable."""
    event_rows = [*_unloaded_rows(run), *_rejection_rows(run)]
    warnings = [*events.warnings(run)][:MAX_ROWS]
    event_rows += [EventRow(event.t, "Warning", instance(event.component), text(event.text)) for event in warnings]
    event_rows += [
        EventRow(entry.time, f"Limit of validity, {entry.severity}", instance(entry.component), text(entry.sentence))
        for entry in validity(run).entries
    ]
    return sorted(event_rows, key=lambda row: row.t)


def _unloaded_rows(run: RunData) -> list[EventRow]:
    """Rows of wheels and tracks without contact, without those of a vehicle that settles."""
    rows_of_members = []
    for what, where, by_name in (
        ("Road wheel is lifted off", wheel, lifted(run).by_member),
        ("Track is off the ground", instance, events.off_ground(run).by_member),
    ):
        for name, intervals in by_name.items():
            if shown := [interval for interval in intervals if not is_settling(run, interval.end)]:
                rows_of_members.append(EventRow(shown[0].start, what, where(name), _durations(shown)))
    return rows_of_members


def _durations(intervals: list[UnloadedInterval]) -> str:
    total = sum(interval.time for interval in intervals)
    longest = max(intervals, key=lambda interval: interval.time)
    times = f"{number(longest.start)} to {number(longest.end)} s"
    if len(intervals) == 1:
        return f"once; {times}"
    return f"{len(intervals)} times, {number(total, 3)} s together; longest {times}"


def _rejection_rows(run: RunData) -> list[EventRow]:
    return [
        EventRow(float(t[0]), "Solver took back a step and halved it", instance(name),
                 f"{number(more.sum(), 7)} in all; last by {number(t[-1])} s")
        for name, t, more in events.rejections(run)
    ]  # fmt: skip


def _peak_rows(pair: Pair) -> list[EventRow]:
    """Rows of the largest values of the run."""
    event_rows = []
    for key, (what, _) in PEAKS.items():
        peak = pair.figures.get(key)
        if peak and abs(peak["value"]) > AT_REST:
            track, _, variable = peak["signal"].partition(".")
            place = f", {text(wheel_name(variable.removesuffix('.load')))}" if key == "wheel_load" else ""
            place += f", link {peak['link']}" if "link" in peak else ""
            size = quantity(peak["value"], peak["unit"])
            event_rows.append(EventRow(peak["t"], what, f"{instance(track)}{place}", size))
    return event_rows
