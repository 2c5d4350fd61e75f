"""What the links of a track bear: which one the most and when, all of them over time, and round the circuit."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from orchestrator.log.time_series import Floats, Series
from orchestrator.results.analyses import contact, of_links
from orchestrator.results.page.signals import span
from orchestrator.results.run_data import Missing, RunData
from orchestrator.results.thinned import Curve, Envelope, Peak

SLICES = 240  # of time, in the maps, at most
ALIKE = 1e-9  # of two values that differ by rounding


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
    worst: Worst  # by tension
    stressed: Worst | None
    loaded: Worst | None  # by the force in the pin where it begins
    slackest: Worst  # its smallest tension

    @property
    def bearers(self) -> dict[int, list[str]]:
        """The links that bear the most, from 1 on, and of what each bears the most."""
        found: dict[int, list[str]] = {self.worst.link: ["tension"]}
        for of, what in ((self.stressed, "stress"), (self.loaded, "force")):
            if of and of.value > 0.0:
                found.setdefault(of.link, []).append(what)
        return found


def columns(names: tuple[str, ...]) -> Columns:
    """Of the names of a topic with outputs per link."""
    wanted = ("link[*].tension", "link[*].stress", "joint[*].position", "joint[*].force", contact.SIGNAL)
    return Columns(*(of_links.columns(names, signal).tolist() for signal in wanted))


def chain(run: RunData, track: str) -> Chain:
    """What was recorded of the links of a track; raises Missing, LogUnreadable."""
    topic = f"/{track}/links"
    if topic not in run.log.topics:
        raise Missing(f"the log has no outputs per link of '{track}'")
    at = columns(run.log.topics[topic].names)
    if not at.tension:
        raise Missing(f"the log has no tensions of the links of '{track}'")
    wanted = [*at.tension, *at.stress, *(k for pin in at.force for k in pin)]
    t = run.log.select({topic: []})[topic].t
    if not np.isfinite(t).all():
        raise Missing(f"times of the links of '{track}' are no finite numbers")
    tension, middle = sliced(run, t, len(at.tension))
    most: dict[str, Worst] = {}
    for piece in run.log.stream({topic: wanted}):
        series = piece[topic]
        parts = np.split(series.values, np.cumsum([len(at.tension), len(at.stress)]), axis=1)
        tension.add(series.t, parts[0])
        force = np.linalg.norm(parts[2].reshape(len(series.t), -1, 3), axis=2)
        for name, values in (("tension", parts[0]), ("slack", -parts[0]), ("stress", parts[1]), ("force", force)):
            note(most, name, series.t, values)
    if "tension" not in most:
        raise Missing(f"the log holds no record of the links of '{track}'")
    slackest = most["slack"]._replace(value=-most["slack"].value)
    return Chain(track, at, t, middle, tension.upper, most["tension"], most.get("stress"), most.get("force"), slackest)


def sliced(run: RunData, t: Floats, links: int) -> tuple[Envelope, Floats]:
    """For the largest values of links in slices of time, and the middles of the slices (slices,), s.

    A slice is at least two records long, of those at times ``t``, so that none is empty.
    """
    start, end = span(run)
    slices = max(1, min(SLICES, len(t) // 2))
    edges = np.linspace(start, end, slices + 1)
    return Envelope(start, end, links, slices), 0.5 * (edges[1:] + edges[:-1])


def tension_in(run: RunData, found: Chain, like: tuple[float, float], slices: int) -> Floats:
    """Largest tensions (slices, links), N, in slices of another run's time, s; NaN where none was recorded.

    Raises LogUnreadable.
    """
    topic, envelope = f"/{found.track}/links", Envelope(*like, len(found.columns.tension), slices)
    for piece in run.log.stream({topic: found.columns.tension}, like):
        envelope.add(piece[topic].t, piece[topic].values)
    return envelope.upper


def note(most: dict[str, Worst], name: str, t: Floats, values: Floats) -> None:
    """Keep the largest of values (m, links) at times (m,) in ``most``, if it is larger than what is there."""
    finite = np.where(np.isfinite(values), values, -np.inf)
    if not finite.size or not np.isfinite(finite.max()):
        return
    largest = finite.max()
    row, column = np.argwhere(finite >= largest - ALIKE * abs(largest))[0]  # of equal ones the first
    if name not in most or finite[row, column] > most[name].value + ALIKE * abs(most[name].value):
        most[name] = Worst(float(finite[row, column]), float(t[row]), int(column) + 1)


def of_bearers(run: RunData, found: Chain) -> dict[int, dict[str, tuple[Curve, Peak]]]:
    """Tension, stress and pin force over time of the links that bear the most; raises LogUnreadable."""
    topic, at = f"/{found.track}/links", found.columns
    of_all = {"tension": [[k] for k in at.tension], "stress": [[k] for k in at.stress], "force": at.force}
    parts = {
        (link, name): columns[link - 1]
        for link in found.bearers
        for name, columns in of_all.items()
        if link <= len(columns)
    }
    wanted = list(dict.fromkeys(column for each in parts.values() for column in each))
    envelope = Envelope(*span(run), len(parts))
    for piece in run.log.stream({topic: wanted}):
        series = piece[topic]
        made = [series.values[:, [wanted.index(column) for column in each]] for each in parts.values()]
        # of a scalar itself, with its sign
        sizes = [each[:, 0] if each.shape[1] == 1 else np.linalg.norm(each, axis=1) for each in made]
        envelope.add(series.t, np.stack(sizes, axis=1))
    curves: dict[int, dict[str, tuple[Curve, Peak]]] = {link: {} for link in found.bearers}
    for k, (link, name) in enumerate(parts):
        if peak := envelope.largest(k):
            curves[link][name] = envelope.curve(k), peak
    return curves


def at(run: RunData, found: Chain, t: float, wanted: list[int]) -> Series:
    """Columns of the links in the record nearest to a time, one row; raises LogUnreadable."""
    nearest = float(found.t[np.abs(found.t - t).argmin()])
    topic = f"/{found.track}/links"
    return run.log.select({topic: wanted}, (nearest, nearest))[topic].rows(slice(0, 1))
