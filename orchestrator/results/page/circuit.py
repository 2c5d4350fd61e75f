"""The links of a track in the order of their places at an instant: on the circuit, or from the first pin on."""

from __future__ import annotations

from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from orchestrator.log.time_series import Floats
from orchestrator.results.analyses import circuit, contact
from orchestrator.results.page.chain import Chain
from orchestrator.results.run_data import Missing, RunData, Window, pitch_radius

NEAR = 0.06  # m: a link whose middle is so far outside of a wheel's pitch circle lies on it


class Section(NamedTuple):
    """A part of the circuit, m."""

    start: float
    end: float
    name: str


class Profile(NamedTuple):
    """Of all links at an instant, in the order of their places."""

    t: float
    place: Floats  # (links,) m, as in ``analyses/circuit.py``; of an open chain along it
    tension: Floats  # (links,) N
    ahead: Floats  # (links,) m, of the middles, ahead of the sprocket axle in the axes of the hull
    pressure: Floats | None  # (links,) Pa, as in ``analyses/contact.py``
    sections: list[Section]


def profile(run: RunData, found: Chain, t: float) -> Profile:
    """Of the record of links nearest to a time; raises LogUnreadable, and LookupError for what is not recorded."""
    at = found.columns
    if len(at.position) < len(at.tension):
        raise Missing("places of pins were not recorded")
    k = int(np.abs(found.t - t).argmin())
    nearest = float(found.t[k])
    if not at.closed:
        links = run.links(found.track, Window(nearest, nearest))
        pins = np.stack([links.forward[0], links.up[0]], axis=1)
        length = np.linalg.norm(np.diff(pins, axis=0), axis=1)
        middle = 0.5 * (pins[1:] + pins[:-1])
        return Profile(nearest, np.cumsum(length) - 0.5 * length, links.tension[0], middle[:, 0], None, [])
    signals = ["link[*].tension", contact.SIGNAL][: 1 + bool(at.ground)]
    window = Window(float(found.t[max(k - 1, 0)]), nearest)  # of the record before, the axes of forces
    block = next(circuit.records(run, found.track, window, *signals))
    order = np.argsort(block.links[-1])
    place, middle, tension = block.links[-1, order], block.centres[-1, order], block.values[0][-1, order]
    under = None
    if at.ground:
        under = contact.pressure(block.pins, block.axes, block.values[1], contact.pad_area(run))[-1, order]
    return Profile(nearest, place, tension, middle[:, 0], under, _sections(run.scene, place, middle))


def _sections(scene: dict[str, Any], place: Floats, middle: Floats) -> list[Section]:
    """The circuit in words, by the scene's sprocket and idler; nothing where it has none."""
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
    upper = middle[:, 1] > level
    names = np.where(
        round_sprocket, "sprocket", np.where(round_idler, "idler", np.where(upper, "upper run", "lower run"))
    )
    edges = [0, *(np.flatnonzero(names[1:] != names[:-1]) + 1), len(names)]
    half = 0.5 * float(np.median(np.diff(place))) if len(place) > 1 else 0.0
    return [
        Section(float(place[first] - half), float(place[last - 1] + half), str(names[first]))
        for first, last in pairwise(edges)
        if last - first > 1
    ]
