"""Validity ledger: all entries of a run, from its records."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import chain
from typing import NamedTuple

from orchestrator.results.run_data import EVER, Missing, RunData, Window
from orchestrator.results.table import Table
from orchestrator.results.validity import (
    compression,
    contact_step,
    creep,
    idler_travel,
    lift,
    penetration,
    seats,
    tooth_jump,
)
from orchestrator.results.validity.exceedance import FAILURE, WARNING, Exceedance
from orchestrator.results.validity.piece import pieces

KINDS = (contact_step, penetration, seats, tooth_jump, idler_travel, compression, creep, lift)

# errors of logs that lack signals, and of scenes of another kind or origin
UNFIT = (Missing, LookupError, TypeError, ValueError, AttributeError, ArithmeticError)


class Validity(NamedTuple):
    """Entries of a run."""

    entries: tuple[Exceedance, ...]  # in order of time
    unseen: dict[str, str]  # reason by module that could not look

    @property
    def failures(self) -> tuple[Exceedance, ...]:
        """Failures, which end the model's validity unless the scene allows them."""
        return tuple(entry for entry in self.entries if entry.severity == FAILURE)

    def table(self) -> Table:
        """Table with a row for each entry."""
        columns = (("time", "s"), ("component", ""), ("kind", ""), ("severity", ""), ("what", ""))
        rows = [(entry.time, entry.component, entry.what, entry.severity, entry.sentence) for entry in self.entries]
        notes = tuple(f"not looked at, {name.replace('_', ' ')}: {reason}" for name, reason in self.unseen.items())
        return Table.of(f"{len(rows)} limits passed", columns, rows, notes)


def validity(run: RunData, window: Window = EVER) -> Validity:
    """Validity of a log as far as it has the signals; raises LogUnreadable."""
    return run.once(f"validity, {window}", lambda _: _validity(run, window))


def _validity(run: RunData, window: Window) -> Validity:
    asked = run.scene.get("run")
    allowed = asked.get("allow") if isinstance(asked, dict) else None
    found: list[Exceedance] = []
    unseen: dict[str, str] = {}
    names = chain.from_iterable(kind.signals(run) for kind in KINDS)
    for piece in pieces(run, names, window):
        for kind in KINDS:
            try:
                found += kind.find(piece)
            except UNFIT as problem:
                unseen[kind.__name__.rpartition(".")[2]] = str(problem)
    return Validity(tuple(merged(softened(found, allowed if isinstance(allowed, list) else ()))), unseen)


def softened(entries: Iterable[Exceedance], allowed: Sequence[str]) -> list[Exceedance]:
    """Turn failures of allowed kinds into warnings."""
    return [entry._replace(severity=WARNING) if entry.what in allowed else entry for entry in entries]


def merged(entries: Iterable[Exceedance]) -> list[Exceedance]:
    """Merge entries of equal kind, part, limit and severity: first time and place, worst value.

    A failure of a part replaces its earlier warning.
    """
    found: dict[tuple[str, str, str, float, str], Exceedance] = {}
    for entry in sorted(entries, key=lambda entry: entry.time):
        part = entry.place.partition(",")[0]
        first = found.setdefault((entry.what, entry.component, part, entry.limit, entry.severity), entry)
        found[entry.what, entry.component, part, entry.limit, entry.severity] = first._replace(
            value=max(first.value, entry.value)
        )
    failed = {key[:3] for key in found if key[4] == FAILURE}
    kept = [entry for key, entry in found.items() if key[4] == FAILURE or key[:3] not in failed]
    return sorted(kept, key=lambda entry: (entry.time, entry.component, entry.place))
