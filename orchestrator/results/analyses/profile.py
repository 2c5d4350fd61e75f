"""Tension and ground pressure along a chain at an instant, in the order of places on the circuit."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from orchestrator.log.time_series import Floats
from orchestrator.results.analyses import circuit, contact, link_records
from orchestrator.results.analyses.link_loads import LinkLoads
from orchestrator.results.link_columns import POSITION, TENSION
from orchestrator.results.run_data import Missing, RunData, Window


class Profile(NamedTuple):
    """All links at an instant, in the order of their places."""

    t: float
    place: Floats  # (links,) m, on the circuit (``circuit.py``); along an open chain
    tension: Floats  # (links,) N
    ahead: Floats  # (links,) m, of the middles, ahead of the sprocket axle in hull axes; empty for an open chain
    pressure: Floats | None  # (links,) Pa (``contact.py``); None if not recorded
    stretches: list[circuit.Stretch]


def of(run: RunData, loads: LinkLoads, t: float) -> Profile:
    """Profile in the link record nearest to a time; raises Missing, LogUnreadable."""
    if loads.pins < loads.links:
        raise Missing("places of pins were not recorded")
    k = int(np.abs(loads.t - t).argmin())
    nearest = float(loads.t[k])
    if not loads.closed:
        block = next(link_records.records(run, loads.track, Window(nearest, nearest), POSITION, TENSION))
        length = np.linalg.norm(np.diff(block.values[0][0], axis=0), axis=1)
        return Profile(nearest, np.cumsum(length) - 0.5 * length, block.values[1][0], np.empty(0), None, [])
    grounded = link_records.has(run, loads.track, contact.SIGNAL)
    window = Window(float(loads.t[max(k - 1, 0)]), nearest)  # axes of forces need the record before
    links = next(circuit.records(run, loads.track, window, TENSION, *[contact.SIGNAL] * grounded))
    order = np.argsort(links.links[-1])
    place, middle, tension = links.links[-1, order], links.centres[-1, order], links.values[0][-1, order]
    pressure = None
    if grounded:
        pressure = contact.pressure(links.pins, links.axes, links.values[1], contact.pad_area(run))[-1, order]
    return Profile(nearest, place, tension, middle[:, 0], pressure, circuit.stretches(run.scene, place, middle))
