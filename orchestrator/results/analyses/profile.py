"""Tension and ground pressure along a chain at an instant, in the order of places on the circuit."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from orchestrator.log.reader import Missing
from orchestrator.log.time_series import Floats
from orchestrator.results.analyses import circuit, ground_pressure, record_blocks
from orchestrator.results.analyses.link_loads import LinkLoads
from orchestrator.results.run_data import EVER, POSITION, TENSION, RunData, Window, link_columns


class Profile(NamedTuple):
    """All links at an instant, in the order of their places."""

    t: float
    place: Floats  # (links,) m, on the circuit (``circuit.py``); along an open chain
    tension: Floats  # (links,) N
    ahead: Floats  # (links,) m, of the middles, ahead of the sprocket axle in hull axes; empty for an open chain
    pressure: Floats | None  # (links,) Pa (``ground_pressure.py``); None if not recorded
    stretches: list[circuit.Stretch]


class Tensions(NamedTuple):
    """Tensions of all links in a block of records, in the order of their places."""

    t: Floats  # (m,) s
    place: Floats  # (m, links) m, on the circuit; along an open chain
    tension: Floats  # (m, links) N
    stretches: list[circuit.Stretch]  # of the block's first record; none of an open chain


def tensions(run: RunData, track: str, window: Window = EVER) -> Iterator[Tensions]:
    """Tensions by place in the link records of a window, in blocks; raises Missing, LogUnreadable."""
    if record_blocks.count(run, track) != len(link_columns(run.log.topics[f"/{track}/links"].names, POSITION)):
        for block in record_blocks.records(run, track, window, POSITION, TENSION):
            length = np.linalg.norm(np.diff(block.values[0], axis=1), axis=2)
            yield Tensions(block.t, np.cumsum(length, axis=1) - 0.5 * length, block.values[1], [])
        return
    for links in circuit.records(run, track, window, TENSION):
        order = np.argsort(links.links, axis=1)
        place, tension = (np.take_along_axis(values, order, axis=1) for values in (links.links, links.values[0]))
        yield Tensions(links.t, place, tension, links.stretches(run.scene))


def of(run: RunData, loads: LinkLoads, t: float) -> Profile:
    """Profile in the link record nearest to a time; raises Missing, LogUnreadable."""
    if loads.pins < loads.links:
        raise Missing("places of pins were not recorded")
    k = int(np.abs(loads.t - t).argmin())
    nearest = float(loads.t[k])
    if not loads.closed:
        block = next(tensions(run, loads.track, Window(nearest, nearest)))
        return Profile(nearest, block.place[0], block.tension[0], np.empty(0), None, [])
    grounded = record_blocks.has(run, loads.track, ground_pressure.SIGNAL)
    window = Window(float(loads.t[max(k - 1, 0)]), nearest)  # axes of forces need the record before
    links = next(circuit.records(run, loads.track, window, TENSION, *[ground_pressure.SIGNAL] * grounded))
    order = np.argsort(links.links[-1])
    place, ahead, tension = links.links[-1, order], links.centres[-1, order, 0], links.values[0][-1, order]
    pressure = None
    if grounded:
        area = ground_pressure.pad_area(run)
        pressure = ground_pressure.pressure(links.pins, links.axes, links.values[1], area)[-1, order]
    return Profile(nearest, place, tension, ahead, pressure, links.stretches(run.scene, -1))
