"""Entries for pins deep in the teeth of a sprocket, relative to the size of a pin."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from orchestrator.results.analyses import hull
from orchestrator.results.run_data import pitch_radius
from orchestrator.results.validity import limits
from orchestrator.results.validity.exceedance import Exceedance, exceedances
from orchestrator.results.validity.piece import Piece
from orchestrator.results.validity.sprocket_pins import polar, signals, tracks_on_sprockets

__all__ = ["find", "signals"]


def find(piece: Piece) -> Iterator[Exceedance]:
    """Entries for pins of tracks with recorded pins; raises Missing."""
    radius = hull.vehicle_number(piece.run, "sprocket", "pin_radius")
    seated = pitch_radius(piece.run.scene["vehicle"])
    most = radius * limits.PIN_WARNING, radius * limits.PIN_FAILURE
    for track in tracks_on_sprockets(piece.run):
        if not (piece.signal(f"{track}.penetration.max")[1] > most[0]).any():  # no contact is deeper
            continue
        t, distance, _ = polar(piece, track)
        deepest = distance.argmin(axis=1)
        depth = seated - distance.min(axis=1)
        for entry, worst in exceedances("penetration", track, t, depth, *most):
            pin = int(deepest[np.searchsorted(t, worst)]) + 1
            yield entry._replace(place=f"sprocket, pin {pin}")
