"""Tension and ground pressure along a chain at an instant, in the order of places on the circuit."""

from __future__ import annotations

from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from orchestrator.log.time_series import Floats
from orchestrator.results.analyses import circuit, contact, link_records
from orchestrator.results.analyses.link_loads import LinkLoads
from orchestrator.results.link_columns import POSITION, TENSION
from orchestrator.results.run_data import Missing, RunData, Window, pitch_radius

NEAR = 0.06  # m: distance outside of a wheel's pitch circle within which the middle of a link lies on the wheel


class Stretch(NamedTuple):
    """Part of the circuit, m."""

    start: float
    end: float
    name: str  # "sprocket", "lower run", "idler" or "upper run"


class Profile(NamedTuple):
    """All links at an instant, in the order of their places."""

    t: float
    place: Floats  # (links,) m, on the circuit (``circuit.py``); along an open chain
    tension: Floats  # (links,) N
    ahead: Floats  # (links,) m, of the middles, ahead of the sprocket axle in hull axes; empty for an open chain
    pressure: Floats | None  # (links,) Pa (``contact.py``); None if not recorded
    stretches: list[Stretch]


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
    return Profile(nearest, place, tension, middle[:, 0], pressure, _stretches(run.scene, place, middle))


def _stretches(scene: dict[str, Any], place: Floats, middle: Floats) -> list[Stretch]:
    """Parts of the circuit by the scene's sprocket and idler; none without them.

    ``middle`` (links, 2) m: centres of the links ahead of and above the sprocket's axle. The idler touches the rearmost
    link. A part of a single link is left out.
    """
    try:
        vehicle = scene["vehicle"]
        round_sprocket = np.linalg.norm(middle, axis=1) < pitch_radius(vehicle) + NEAR
        rear = middle[:, 0].argmin()
        radius = float(vehicle["idler"]["radius"]) + float(vehicle["track"]["face"])
        idler = middle[rear] + [radius, 0.0]
        round_idler = np.linalg.norm(middle - idler, axis=1) < radius + NEAR
        level = 0.5 * (middle[:, 1].max() + middle[:, 1].min())
    except (LookupError, TypeError, ValueError):
        return []
    runs = np.where(middle[:, 1] > level, "upper run", "lower run")
    names = np.where(round_sprocket, "sprocket", np.where(round_idler, "idler", runs))
    edges = [0, *(np.flatnonzero(names[1:] != names[:-1]) + 1), len(names)]
    half_pitch = 0.5 * float(np.median(np.diff(place))) if len(place) > 1 else 0.0
    return [
        Stretch(float(place[first] - half_pitch), float(place[last - 1] + half_pitch), str(names[first]))
        for first, last in pairwise(edges)
        if last - first > 1
    ]
