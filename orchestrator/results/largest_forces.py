"""Largest forces of a run: in pins, of teeth, rims, wheels, on horns; pin moments; what bears them, where and when."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from typing import NamedTuple

import numpy as np

from orchestrator.log.reader import Missing
from orchestrator.log.time_series import Floats
from orchestrator.results.analyses import record_blocks
from orchestrator.results.analyses.record_blocks import Extreme, larger
from orchestrator.results.figures import SIDE, Figure, Shown, figure
from orchestrator.results.run_data import EVER, RunData, Window, track_of


class Force(NamedTuple):
    """Force or moment that pins, links or wheels bear."""

    what: str  # as in "largest ..."
    signal: str  # of the links of a track; empty: of its wheels
    place: str  # words for where, with the number or the name
    group: str = ""  # of link outputs in which it is
    unit: str = "N"


FORCES = {  # by the figure of the largest one
    "pin_force": Force("force in a pin", "joint[*].force", "in pin {}", "force"),
    "tooth_force": Force("force of a tooth on a pin", "joint[*].tooth.force", "on pin {}", "teeth"),
    "rim_force": Force("force of the rims of wheels on a link", "link[*].rim.force", "on link {}", "rims"),
    "horn_force": Force("force of a wheel on a guide horn", "link[*].horn.force", "on link {}", "horns"),
    "wheel_force": Force("force of a track on a wheel", "", "on {}"),
    "pin_moment": Force("moment of a pin about the axes across it", "joint[*].moment", "in pin {}", "moment", "N m"),
}


BELOW = 0.999  # share of the samples that the high value is above


class Largest(NamedTuple):
    """Extremes of a force on the track that has the largest one."""

    most: float  # N or N m; 0 where nothing bears it
    where: str  # words
    t: float  # s
    high: float  # what all but one in a thousand of the records in which something bears it stay below

    @property
    def place(self) -> str:
        """Words for where and when."""
        return f"{self.where} at {self.t:.4g} s" if self.most else "(none)"


def largest(run: RunData, name: str, of: str = "", window: Window = EVER) -> Largest:
    """Largest force of the track that has it, or of a side; ``name``: a key of FORCES. Raises Missing.

    Forces are means over the interval of records.
    """
    force = FORCES[name]

    def found(track: str) -> Largest:
        blocks, names = (_on_links if force.signal else _on_wheels)(run, track, window, force.signal)
        most, bearing, tail = Extreme(0.0, 0.0, 1), 0, np.empty(0)
        for t, sizes in blocks():
            most = larger(most, t, sizes) or most
            bearing += int(np.count_nonzero(sizes > 0.0))
        rank = (1.0 - BELOW) * (bearing - 1)  # from the largest one
        for _, sizes in blocks() if bearing else ():  # again, because all of a long run are hundreds of MB
            tail = np.sort(np.append(tail, sizes[sizes > 0.0]))[-int(rank) - 2 :]
        high = float(np.interp(len(tail) - 1 - rank, np.arange(len(tail)), tail)) if bearing else 0.0
        where = force.place.format(names[most.member - 1] if names else most.member)
        return Largest(most.value, f"{where} of the {track.replace('_', ' ')}", most.t, high)

    tracks = (track_of(run, of),) if of else run.tracks
    return run.compute_once(f"{name} {of} {window}", lambda _: max(map(found, tracks), key=lambda each: each.most))


Blocks = Callable[[], Iterable[tuple[Floats, Floats]]]  # times (m,), s, and sizes (m, pins, links or wheels)


def _on_links(run: RunData, track: str, window: Window, signal: str) -> tuple[Blocks, list[str]]:
    """Blocks of records of pins or links, which have numbers and no names."""

    def blocks() -> Iterator[tuple[Floats, Floats]]:
        for one in record_blocks.records(run, track, window, signal):
            yield one.t, record_blocks.sizes(one.values[0])

    return blocks, []


def _on_wheels(run: RunData, track: str, window: Window, _: str) -> tuple[Blocks, list[str]]:
    """All records of the wheels, and their names."""
    names = run.log.topics[run.log.known_topic(f"/{track}/out")].names
    wheels = [name.removesuffix(".torque.x") for name in names if name.endswith(".torque.x")]
    if not wheels:
        raise Missing(f"'{track}' has no wheels")
    found = [run.vectors(track, "out", f"{wheel}.force", window=window) for wheel in wheels]
    sizes = np.stack([np.linalg.norm(force, axis=1) for _, force in found], axis=1)
    return lambda: [(found[0][0], sizes)], wheels


@figure("N", Shown("largest link tension", "kN", whole=True), whole=True)
def tension_max(run: RunData, of: str, window: Window) -> float:
    """Largest tension of all links over the run, N."""
    return run.largest([f"{track}.tension.max" for track in run.tracks])


def _figures(name: str, force: Force) -> Iterator[Figure]:
    """Figures of the largest force and of the 99.9 % value."""
    words, tail = name.replace("_", " "), f"{force.what}, {force.unit}, mean over the interval of records"

    def place(run: RunData) -> str:
        return largest(run, name).place

    def most(run: RunData, of: str, window: Window) -> float:
        return largest(run, name, of, window).most

    def high(run: RunData, of: str, window: Window) -> float:
        return largest(run, name, of, window).high

    for end, value, begin, label, where in (
        ("", most, "Largest", f"largest {words}", place),
        ("_high", high, "Force below which 99.9 % of the records have the", f"99.9 % of {words}s below", None),
    ):
        shown = Shown(label, f"k{force.unit}", on=force.group, whole=True, place=where)
        yield Figure(f"{name}{end}", force.unit, f"{begin} {tail}", value, (shown,), SIDE, group=force.group)


OF_BEARERS = tuple(each for name, force in FORCES.items() for each in _figures(name, force))


@figure("N", Shown("mean link tension", "kN"))
def tension_mean(run: RunData, of: str, window: Window) -> float:
    """Mean tension of all links, N."""
    return float(np.mean([run.mean(f"{track}.tension.mean", window) for track in run.tracks]))
