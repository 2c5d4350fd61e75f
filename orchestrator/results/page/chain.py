"""What the links of a track bear: which one the most and when, all of them over time, and round the circuit."""

from __future__ import annotations

import re
from typing import Any, NamedTuple

import numpy as np

from orchestrator.log.time_series import Floats, Series
from orchestrator.results.page.envelope import Curve, Envelope, Peak
from orchestrator.results.page.signals import span
from orchestrator.results.run_data import Missing, RunData

SLICES = 240  # of time, in the maps, at most
ALIKE = 1e-9  # of two values that differ by rounding
_MEMBER = re.compile(r"(link|joint)\[(\d+)\]\.(.+)")


class Columns(NamedTuple):
    """Where a topic holds what, each by link or pin; empty where it does not."""

    tension: list[int]
    stress: list[int]
    position: list[list[int]]  # x, y, z of each pin
    force: list[list[int]]  # at each pin
    ground: list[list[int]]  # on each link

    @property
    def closed(self) -> bool:
        """Whether the last link ends at the first pin."""
        return len(self.position) == len(self.tension)


class Worst(NamedTuple):
    """The largest value of any link in the records of links."""

    value: float
    t: float
    link: int  # from 1 on


class Chain(NamedTuple):
    """The links of a track."""

    track: str
    columns: Columns
    t: Floats  # (m,) s, of all records of links
    middle: Floats  # (slices,) s, of the slices of time
    tension: Floats  # (slices, links) N, largest in each slice
    pressure: Floats | None  # (slices, links) Pa, vertical force of the ground over the area of a link, largest
    worst: Worst  # by tension
    stressed: Worst | None
    loaded: Worst | None  # by the force in the pin where it begins


def columns(names: tuple[str, ...]) -> Columns:
    """Of the names of a topic with outputs per link."""
    members: dict[str, dict[int, int]] = {}
    for column, name in enumerate(names):
        if found := _MEMBER.fullmatch(name):
            members.setdefault(f"{found[1]}.{found[3]}", {})[int(found[2])] = column

    def one(what: str) -> list[int]:
        return [column for _, column in sorted(members.get(what, {}).items())]

    def three(what: str) -> list[list[int]]:
        parts = [one(f"{what}.{axis}") for axis in "xyz"]
        return [list(each) for each in zip(*parts, strict=True)] if len({len(part) for part in parts}) == 1 else []

    return Columns(
        one("link.tension"),
        one("link.stress"),
        three("joint.position"),
        three("joint.force"),
        three("link.ground.force"),
    )


def pad_area(scene: dict[str, Any]) -> float | None:
    """Of a link on the ground, pitch times width, m2."""
    try:
        track = scene["vehicle"]["track"]
        area = float(track["pitch"]) * float(track["width"])
    except (LookupError, TypeError, ValueError):
        return None
    return area if area > 0.0 else None


def chain(run: RunData, track: str) -> Chain:
    """What was recorded of the links of a track; raises Missing, LogUnreadable."""
    topic = f"/{track}/links"
    if topic not in run.log.topics:
        raise Missing(f"the log has no outputs per link of '{track}'")
    at = columns(run.log.topics[topic].names)
    if not at.tension:
        raise Missing(f"the log has no tensions of the links of '{track}'")
    wanted = [*at.tension, *at.stress, *(k for pin in at.force for k in pin), *(link[2] for link in at.ground)]
    start, end = span(run)
    area = pad_area(run.scene) if at.ground else None
    slices = max(1, min(SLICES, len(run.log.select({topic: []})[topic].t) // 2))  # none without a record
    tension, pressure = (Envelope(start, end, len(at.tension), slices) for _ in range(2))
    most: dict[str, Worst] = {}
    times = []
    for piece in run.log.stream({topic: wanted}):
        series = piece[topic]
        if not np.isfinite(series.t).all():
            raise Missing(f"times of the links of '{track}' are no finite numbers")
        times.append(series.t)
        parts = np.split(
            series.values, np.cumsum([len(at.tension), len(at.stress), 3 * len(at.force), len(at.ground)])[:-1], axis=1
        )
        tension.add(series.t, parts[0])
        if area:
            pressure.add(series.t, parts[3] / area)
        force = np.linalg.norm(parts[2].reshape(len(series.t), -1, 3), axis=2)
        for name, values in (("tension", parts[0]), ("stress", parts[1]), ("force", force)):
            _note(most, name, series.t, values)
    if "tension" not in most:
        raise Missing(f"the log holds no record of the links of '{track}'")
    edges = np.linspace(start, end, slices + 1)
    return Chain(
        track, at, np.concatenate(times), 0.5 * (edges[1:] + edges[:-1]), tension.upper,
        pressure.upper if area else None, most["tension"], most.get("stress"), most.get("force"),
    )  # fmt: skip


def _note(most: dict[str, Worst], name: str, t: Floats, values: Floats) -> None:
    finite = np.where(np.isfinite(values), values, -np.inf)
    if not finite.size or not np.isfinite(finite.max()):
        return
    largest = finite.max()
    row, column = np.argwhere(finite >= largest - ALIKE * abs(largest))[0]  # of equal ones the first
    if name not in most or finite[row, column] > most[name].value + ALIKE * abs(most[name].value):
        most[name] = Worst(float(finite[row, column]), float(t[row]), int(column) + 1)


def of_link(run: RunData, found: Chain, link: int) -> dict[str, tuple[Curve, Peak]]:
    """Tension, stress and pin force of a link, from 1 on, over time; raises LogUnreadable."""
    topic, at, k = f"/{found.track}/links", found.columns, link - 1
    parts = {"tension": [at.tension[k]]}
    if k < len(at.stress):
        parts["stress"] = [at.stress[k]]
    if k < len(at.force):
        parts["force"] = at.force[k]
    envelope = Envelope(*span(run), len(parts))
    for piece in run.log.stream({topic: [column for each in parts.values() for column in each]}):
        series, place, made = piece[topic], 0, []
        for each in parts.values():
            values = series.values[:, place : place + len(each)]
            made.append(values[:, 0] if len(each) == 1 else np.linalg.norm(values, axis=1))
            place += len(each)
        envelope.add(series.t, np.stack(made, axis=1))
    return {
        name: (envelope.curve(k), peak) for k, name in enumerate(parts) if (peak := envelope.largest(k)) is not None
    }


def at(run: RunData, found: Chain, t: float, wanted: list[int]) -> Series:
    """Columns of the links in the record nearest to a time, one row; raises LogUnreadable."""
    nearest = float(found.t[np.abs(found.t - t).argmin()])
    topic = f"/{found.track}/links"
    return run.log.select({topic: wanted}, (nearest, nearest))[topic].rows(slice(0, 1))
