"""Tension of the links of a track over their places on the circuit, at the instants of a view.

Values are those of the analysis ``profile``.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from typing import NamedTuple

import numpy as np

from orchestrator.log.time_series import Floats
from orchestrator.results.analyses import link_records, profile
from orchestrator.results.link_columns import POSITION, TENSION
from orchestrator.results.run_data import Missing, RunData, Window
from orchestrator.results.units import size
from orchestrator.results.views.pose_columns import matched_times


class ChainProfile(NamedTuple):
    """Tensions of the links of a track over its circuit."""

    track: str
    title: str  # with units, and the parts of the circuit at the first instant


def chain_profiles(run: RunData) -> list[ChainProfile]:
    """Return the profiles of tracks whose links' tensions and places a log holds."""
    profiles = []
    for track in run.tracks:
        if all(link_records.has(run, track, signal) for signal in (TENSION, POSITION)):
            with suppress(Missing):
                first = next(profile.tensions(run, track))
                parts = [f"{part.name} {part.start:z.1f} to {part.end:z.1f} m" for part in first.stretches]
                title = "; ".join([f"{track}: tension, kN, over place along it, m", *parts])
                profiles.append(ChainProfile(track, title))
    return profiles


def tensions(run: RunData, track: str, t: Floats) -> Iterator[tuple[float, Floats, Floats]]:
    """Yield time, s, places (links,), m, in order, and tensions (links,), kN, of the link records at times (m,), s.

    Ends early where a chain that blew up no longer goes round its sprocket.
    """
    if not len(t):
        return
    with suppress(Missing):
        for block in profile.tensions(run, track, Window(float(t[0]), float(t[-1]))):
            rows, matched = matched_times(block.t, t)
            for k in np.flatnonzero(matched):
                yield float(t[rows[k]]), block.place[k], block.tension[k] * (1.0 / size("kN"))
