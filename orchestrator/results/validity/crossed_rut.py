"""Entries for tracks in soil that the other track has pressed before: each knows its own rut only."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from orchestrator.results.ground_surface import gives_way
from orchestrator.results.pressed_ground import pressed_by
from orchestrator.results.run_data import RunData
from orchestrator.results.validity import limits
from orchestrator.results.validity.exceedance import WARNING, Exceedance
from orchestrator.results.validity.piece import Piece


def signals(run: RunData) -> Iterator[str]:
    """Travel of the tracks, for the times of the pieces; positions of pins are read on demand."""
    if gives_way(run.scene):
        yield from (f"{track}.travel" for track in run.tracks)


def find(piece: Piece) -> Iterator[Exceedance]:
    """Entry for the first place that two tracks have pressed; raises Missing."""
    run = piece.run
    if gives_way(run.scene) and len(run.tracks) == 2:
        entry = run.compute_once("crossed rut", _crossing)
        if entry is not None and piece.window.start <= entry.time <= piece.window.end:
            yield entry


def _crossing(run: RunData) -> Exceedance | None:
    """Entry for the track that comes second, with the depth of the other's rut; None where the ways are apart."""
    one, other = (pressed_by(run, track) for track in run.tracks)
    _, i, j = np.intersect1d(one.cell, other.cell, assume_unique=True, return_indices=True)
    if not i.size:
        return None
    after = one.first[i] > other.first[j]
    times, depth = np.maximum(one.first[i], other.first[j]), np.where(after, other.depth[j], one.depth[i])
    k = int(times.argmin())
    return Exceedance(
        "crossed_rut", run.tracks[0 if after[k] else 1], float(times[k]), "", float(depth.max()), limits.RUT, WARNING
    )
