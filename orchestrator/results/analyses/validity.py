"""Validity of a run: the ledger, with all entries of its checks in ``results/validity``, from its records."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import chain
from typing import NamedTuple

from orchestrator.results.run_data import EVER, RunData, Window, reason
from orchestrator.results.table import Table
from orchestrator.results.validity import chain_checks, hull_checks, sprocket_checks, track_checks
from orchestrator.results.validity.exceedance import FAILURE, WARNING, Exceedance
from orchestrator.results.validity.piece import Piece, pieces


class ValidityCheck(NamedTuple):
    """Check of one kind of limit."""

    find: Callable[[Piece], Iterator[Exceedance]]  # entries of a piece of the run; raises Missing
    signals: Callable[[RunData], Iterator[str]] = lambda run: iter(())  # that the pieces hold for it


CHECKS = {
    "contact_step": ValidityCheck(chain_checks.contact_step),
    "penetration": ValidityCheck(chain_checks.penetration, chain_checks.penetration_signals),
    "seats": ValidityCheck(sprocket_checks.seats, sprocket_checks.pin_signals),
    "tooth_jump": ValidityCheck(sprocket_checks.tooth_jump, sprocket_checks.pin_signals),
    "idler_travel": ValidityCheck(hull_checks.idler_travel, hull_checks.idler_travel_signals),
    "compression": ValidityCheck(chain_checks.compression, chain_checks.compression_signals),
    "creep": ValidityCheck(track_checks.creep, track_checks.creep_signals),
    "lift": ValidityCheck(track_checks.lift),
    "belly": ValidityCheck(hull_checks.belly, hull_checks.belly_signals),
    "crossed_rut": ValidityCheck(track_checks.crossed_rut, track_checks.crossed_rut_signals),
    "lanes": ValidityCheck(hull_checks.lanes, hull_checks.lanes_signals),
}


class Validity(NamedTuple):
    """Entries of a run."""

    entries: tuple[Exceedance, ...]  # in order of time
    unchecked: dict[str, str]  # reason by check that could not look

    @property
    def failures(self) -> tuple[Exceedance, ...]:
        """Failures, which end the model's validity unless the scene allows them."""
        return tuple(entry for entry in self.entries if entry.severity == FAILURE)

    @property
    def passed_over(self) -> list[str]:
        """Sentence on the kinds for which the vehicle lacks what no log can have."""
        errors = {name: why for name, why in self.unchecked.items() if why == hull_checks.NO_POINTS}
        faults = "; ".join(f"{name.replace('_', ' ')}: {error}" for name, error in errors.items())
        return [f"{len(errors)} of {len(CHECKS)} kinds of validity not looked at: {faults}"] if faults else []

    def table(self) -> Table:
        """Table with a row for each entry."""
        columns = (("time", "s"), ("component", ""), ("kind", ""), ("severity", ""), ("what", ""))
        rows = [(entry.time, entry.component, entry.what, entry.severity, entry.sentence) for entry in self.entries]
        notes = tuple(f"not looked at, {name.replace('_', ' ')}: {reason}" for name, reason in self.unchecked.items())
        return Table.of(f"{len(rows)} limits passed", columns, rows, notes)


def of(run: RunData, window: Window = EVER) -> Validity:
    """Limits that the run passed, as far as its log has the signals; raises LogUnreadable."""
    return run.compute_once(f"validity, {window}", lambda _: _validity(run, window))


def _validity(run: RunData, window: Window) -> Validity:
    allowed = run.entry("run", "allow")
    entries: list[Exceedance] = []
    unchecked: dict[str, str] = {}
    names = chain.from_iterable(check.signals(run) for check in CHECKS.values())
    for piece in pieces(run, names, window):
        for name, check in CHECKS.items():
            try:
                entries += check.find(piece)
            except Exception as problem:
                unchecked[name] = reason(problem)
    return Validity(tuple(merge(soften(entries, allowed if isinstance(allowed, list) else ()))), unchecked)


def soften(entries: Iterable[Exceedance], allowed: Sequence[str]) -> list[Exceedance]:
    """Turn failures of allowed kinds into warnings."""
    return [entry._replace(severity=WARNING) if entry.what in allowed else entry for entry in entries]


def merge(entries: Iterable[Exceedance]) -> list[Exceedance]:
    """Merge entries of equal kind, part, limit and severity: first time and place, worst value.

    A failure of a part replaces its earlier warning.
    """
    merged: dict[tuple[str, str, str, float, str], Exceedance] = {}
    for entry in sorted(entries, key=lambda entry: entry.time):
        part = entry.place.partition(",")[0]
        first = merged.setdefault((entry.what, entry.component, part, entry.limit, entry.severity), entry)
        merged[entry.what, entry.component, part, entry.limit, entry.severity] = first._replace(
            value=max(first.value, entry.value)
        )
    failed = {key[:3] for key in merged if key[4] == FAILURE}
    entries_left = [entry for key, entry in merged.items() if key[4] == FAILURE or key[:3] not in failed]
    return sorted(entries_left, key=lambda entry: (entry.time, entry.component, entry.place))
