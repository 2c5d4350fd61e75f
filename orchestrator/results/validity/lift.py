"""Entries for tracks off the ground and road wheels off their track."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress

from orchestrator.results.analyses import wheel_loads
from orchestrator.results.analyses.airborne import off_ground
from orchestrator.results.analyses.spells import settling
from orchestrator.results.run_data import EVER, Missing, RunData
from orchestrator.results.validity import limits
from orchestrator.results.validity.entry import WARNING, Entry
from orchestrator.results.validity.piece import Piece


def signals(run: RunData) -> Iterator[str]:
    """No signals: ``spells.py`` reads the loads itself, once for all users."""
    return iter(())


def find(piece: Piece) -> Iterator[Entry]:
    """Entries for members without load for longer than LIFT, within the piece."""
    run = piece.run
    found = dict(off_ground(run, EVER).of)
    with suppress(Missing):
        found |= wheel_loads.lifted(run, EVER).of
    for name, spells in found.items():
        component, _, place = name.partition(".")
        for spell in spells:
            inside = spell.start <= piece.window.end and spell.end >= piece.window.start
            if inside and spell.time > limits.LIFT and not settling(run, spell.end):
                yield Entry("lift", component, spell.start, place, spell.time, limits.LIFT, WARNING)
