"""Entries for links under compression."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from orchestrator.log.time_series import Floats
from orchestrator.results.analyses import hull
from orchestrator.results.run_data import Missing, RunData
from orchestrator.results.validity import limits
from orchestrator.results.validity.exceedance import WARNING, Exceedance, excess
from orchestrator.results.validity.piece import Piece


def signals(run: RunData) -> Iterator[str]:
    """Signals of the least tension."""
    yield from (f"{track}.tension.min" for track in run.tracks)


def find(piece: Piece) -> Iterator[Exceedance]:
    """Entries for tracks whose links are under more thrust than their weight holds down; raises Missing.

    The thrust must last longer than HELD.
    """
    limit = thrust(piece.run)
    for track in piece.run.tracks:
        t, tension = piece.signal(f"{track}.tension.min")
        if (first_and_worst := excess(*trailing_minimum(t, -tension, limits.HELD), limit)) is not None:
            yield Exceedance("compression", track, first_and_worst[0], "", first_and_worst[1], limit, WARNING)


def thrust(run: RunData) -> float:
    """Thrust that links between two road wheels bear without lifting, N; raises Missing."""
    weight = (
        hull.vehicle_number(run, "track", "mass")
        * hull.vehicle_number(run, "gravity")
        / hull.vehicle_number(run, "track", "pitch")
    )
    x = run.scene["vehicle"]["road_wheel"]["x"]
    if run.scene.get("assembly") != "vehicle" or len(x) < 2:
        raise Missing("links that push lie between road wheels")
    span = float(np.abs(np.diff(x)).max())
    return weight * span**2 / (8.0 * limits.RISE)


def trailing_minimum(t: Floats, values: Floats, time: float) -> tuple[Floats, Floats]:
    """Minimum over the ``time``, s, before each instant; the first instants have no value."""
    if len(t) < 2 or t[-1] - t[0] < time:
        return t[:0], values[:0]
    count = max(1, round(time / float(np.median(np.diff(t)))))
    windows = np.lib.stride_tricks.sliding_window_view(values, min(count, len(values)))
    return t[count - 1 :], windows.min(axis=1)
