"""Entries for tracks off the ground and road wheels off their track."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress

from orchestrator.results.analyses import wheel_loads
from orchestrator.results.analyses.unloaded import is_settling, off_ground
from orchestrator.results.run_data import EVER, Missing, RunData
from orchestrator.results.validity import limits
from orchestrator.results.validity.exceedance import WARNING, Exceedance
from orchestrator.results.validity.piece import Piece


def signals(run: RunData) -> Iterator[str]:
    """No signals: ``unloaded.py`` reads the loads itself, once for all users."""
    return iter(())


def find(piece: Piece) -> Iterator[Exceedance]:
    """Entries for members without load for longer than LIFT, within the piece."""
    run = piece.run
    intervals_by_member = dict(off_ground(run, EVER).by_member)
    with suppress(Missing):
        intervals_by_member |= wheel_loads.lifted(run, EVER).by_member
    for name, intervals in intervals_by_member.items():
        component, _, place = name.partition(".")
        for interval in intervals:
            inside = interval.start <= piece.window.end and interval.end >= piece.window.start
            if inside and interval.time > limits.LIFT and not is_settling(run, interval.end):
                yield Exceedance("lift", component, interval.start, place, interval.time, limits.LIFT, WARNING)
