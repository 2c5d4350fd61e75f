"""Where a link is on its way round: from the foremost point of the sprocket on, in the order of the links."""

from __future__ import annotations

from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from orchestrator.log.time_series import Floats
from orchestrator.results.page import chain as links
from orchestrator.results.page.chain import Chain
from orchestrator.results.page.plane import plane
from orchestrator.results.run_data import RunData, pitch_radius

NEAR = 0.06  # m: a link whose middle is so far outside of a wheel's pitch circle lies on it


class Section(NamedTuple):
    """A part of the way round, m."""

    start: float
    end: float
    name: str


class Profile(NamedTuple):
    """Of all links at an instant, in the order of their places."""

    t: float
    place: Floats  # (links,) m
    tension: Floats  # (links,) N
    ahead: Floats  # (links,) m, of the middles, ahead of the origin of the track's plane
    pressure: Floats | None  # (links,) Pa, vertical force of the ground over the area of a link
    sections: list[Section]


def profile(run: RunData, found: Chain, t: float) -> Profile:
    """Of the record of links nearest to a time; raises LogUnreadable, and LookupError for what is not recorded."""
    at = found.columns
    if len(at.position) < len(at.tension):
        raise LookupError("places of pins were not recorded")
    wanted = [*at.tension, *(k for pin in at.position for k in pin), *(link[2] for link in at.ground)]
    series = links.at(run, found, t, wanted)
    tension, position, ground = np.split(series.values[0], np.cumsum([len(at.tension), 3 * len(at.position)]))
    pins = plane(run, found.track, series.t).seen(position.reshape(1, -1, 3))[0]
    after = np.roll(pins, -1, axis=0)[: len(tension)]
    before = pins[: len(tension)]
    middle, length = 0.5 * (before + after), np.linalg.norm(after - before, axis=1)
    place = np.cumsum(length) - 0.5 * length
    if at.closed:
        place = np.mod(place - _front(before, after, length), length.sum())
    order = np.argsort(place)
    area = links.pad_area(run.scene) if at.ground else None
    sections = _sections(run.scene, place[order], middle[order]) if at.closed else []
    return Profile(
        float(series.t[0]), place[order], tension[order], middle[order, 0], ground[order] / area if area else None,
        sections,
    )  # fmt: skip


def _front(before: Floats, after: Floats, length: Floats) -> float:
    """Way along the chain to where it crosses the level of the axle ahead of all else, m."""
    low, high = np.minimum(before[:, 1], after[:, 1]), np.maximum(before[:, 1], after[:, 1])
    crossing = np.flatnonzero((low <= 0.0) & (high > 0.0))
    if not len(crossing):
        return 0.0
    link = int(crossing[before[crossing, 0].argmax()])
    share = before[link, 1] / (before[link, 1] - after[link, 1])
    return float(length[:link].sum() + share * length[link])


def _sections(scene: dict[str, Any], place: Floats, middle: Floats) -> list[Section]:
    """The way round in words, by the scene's sprocket and idler; nothing where it has none."""
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
