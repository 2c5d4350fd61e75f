"""Wear of bushed pins: how far each turns and what its friction does, and the growth of the pitch by that.

Archard (J. Appl. Phys. 24, 1953, doi 10.1063/1.1721448): the volume that wears off is a coefficient times the force
times the way of rubbing, V = wear int |F| r |d theta|, the work of friction over its coefficient. The hole and the pin
of the radius r and the width b that part by d under a pull leave 2 r b d of it, so the pitch grows by d.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from orchestrator.log.reader import Missing
from orchestrator.log.time_series import Floats
from orchestrator.results.analyses import hull, record_blocks
from orchestrator.results.run_data import EVER, RunData, Window
from orchestrator.results.table import Table

TURNED, RUBBED = "joint[*].turned", "joint[*].rubbed"
FAR = 1e6  # way for which growth is given, m


class TrackWear(NamedTuple):
    """Wear of the pins of a track in a window; n pins."""

    track: str
    window: Window  # recorded time, s
    travel: float  # length of chain that passed, m
    circuits: float  # of the chain
    turned: Floats  # (n) angle to and fro, rad
    rubbed: Floats  # (n) work of friction, J
    growth: Floats  # (n) of the pitch in FAR m of this, m


class Wear(NamedTuple):
    """Wear of one or more tracks."""

    tracks: tuple[TrackWear, ...]
    pitch: float  # m
    sprocket_pitch: float  # m
    grows: bool  # a coefficient of wear is given

    def table(self) -> Table:
        """Table of the tracks, means of their pins."""
        rows = []
        for each in self.tracks:
            per = max(each.circuits, 1e-12) * len(each.turned)
            grown = 1e3 * each.growth
            growth = (grown.mean(), grown.min(), grown.max()) if self.grows else ()
            rows.append((each.track, each.circuits, each.turned.sum() / per, each.rubbed.sum() / per, *growth))
        columns = [("track", ""), ("circuits", ""), ("turned a circuit", "rad"), ("work of friction a circuit", "J")]
        if self.grows:
            columns += [(f"{name} growth of pitch in 1000 km", "mm") for name in ("mean", "least", "largest")]
        start, end = (f"{moment:.6g}" for moment in self.tracks[0].window)
        return Table.of(f"Wear of pins, {start} to {end} s", columns, rows, self.notes())

    def series(self) -> Table:
        """Table of all pins."""
        columns = [("track", ""), ("pin", ""), ("turned", "rad"), ("work of friction", "J")]
        columns += [("growth of pitch in 1000 km", "mm")] if self.grows else []
        rows: list[tuple[Any, ...]] = []
        for each in self.tracks:
            for k, (turned, rubbed, growth) in enumerate(zip(each.turned, each.rubbed, each.growth, strict=True), 1):
                rows.append(
                    (each.track, k, float(turned), float(rubbed), *([1e3 * float(growth)] if self.grows else []))
                )
        return Table.of("Wear of pins", columns, rows, self.notes())

    def notes(self) -> tuple[str, ...]:
        """Sentences on circuits, and on a run with the grown pitch."""
        found = [
            f"{each.track} went round {each.circuits:.2f} times: pins have not all been everywhere alike"
            for each in self.tracks
            if abs(each.circuits - round(each.circuits)) > 0.1 or each.circuits < 0.9
        ]
        if not self.grows:
            return (*found, "the growth of the pitch needs track.bushing.wear and track.bushing.bearing of the vehicle")
        if any(each.circuits < 0.9 for each in self.tracks):
            return (*found, "a run with the grown pitch is said of a circuit or more")
        grown = self.pitch + max(float(each.growth.mean()) for each in self.tracks)
        again = f"--set vehicle.track.pitch={grown:.7g} --set vehicle.sprocket.pitch={self.sprocket_pitch:.7g}"
        return (*found, f"after 1000 km of this, on the sprocket as it is: cotrack run with {again}")


def of(run: RunData, track: str = "", window: Window = EVER) -> Wear:
    """Wear of the pins of a track, by default of all; raises Missing where no pin rubs."""
    vehicle, bushing = run.entry("vehicle"), run.entry("vehicle", "track", "bushing", default={})
    if not bushing.get("friction"):
        raise Missing(f"{run.log.path}: no pin of the vehicle rubs (vehicle.track.bushing.friction)")
    per_work = 0.0  # growth of the pitch by the work of friction, m/J
    if bushing.get("wear"):
        per_work = bushing["wear"] / bushing["friction"] / (2.0 * bushing["radius"] * bushing["bearing"])
    pitch = float(vehicle["track"]["pitch"])
    tracks = tuple(_of_track(run, name, window, pitch, per_work) for name in hull.tracks(run, track))
    return Wear(tracks, pitch, float(vehicle["sprocket"].get("pitch") or pitch), per_work > 0.0)


def _of_track(run: RunData, track: str, window: Window, pitch: float, per_work: float) -> TrackWear:
    first: Any = None
    for block in record_blocks.records(run, track, window, TURNED, RUBBED):
        turned, rubbed = block.values
        first = first or (float(block.t[0]), turned[0].copy(), rubbed[0].copy())
        last = float(block.t[-1]), turned[-1].copy(), rubbed[-1].copy()
    moment, passed = run.signal(f"{track}.travel", EVER)
    way = np.append(0.0, np.abs(np.diff(passed)).cumsum())
    travel = float(np.diff(np.interp([first[0], last[0]], moment, way))[0])
    turned, rubbed = last[1] - first[1], last[2] - first[2]
    growth = rubbed * per_work * FAR / travel if travel > 0.0 else np.full(len(rubbed), np.nan)
    span = Window(first[0], last[0])
    return TrackWear(track, span, travel, travel / (len(turned) * pitch), turned, rubbed, growth)
