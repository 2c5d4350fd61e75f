"""Limits that a run exceeded: entries of the validity ledger, and values over their limit."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np

from orchestrator.log.time_series import Floats
from orchestrator.results.units import figure, size
from orchestrator.vocabulary.limits import VALIDITY_KINDS

WARNING, FAILURE = "warning", "failure"


class Exceedance(NamedTuple):
    """Limit that a run exceeded."""

    what: str  # key of ``limits.VALIDITY_KINDS``
    component: str
    time: float  # s, first time
    place: str  # on the component, "road_wheel[3]"; empty for the whole
    value: float  # worst value, SI
    limit: float  # SI
    severity: str  # WARNING or FAILURE

    @property
    def sentence(self) -> str:
        """Sentence for the reader."""
        kind = VALIDITY_KINDS[self.what]
        value, limit = (figure(number / size(kind.unit), 3) for number in (self.value, self.limit))
        where = f" at {self.place}" if self.place else ""
        advice = kind.advice.format(0.99 * self.limit / (self.value or 1.0))  # rounding does not lengthen it
        return f"{kind.text}{where}: {value} {kind.unit}, limit {limit} {kind.unit}{advice}"


def alike_as_one(entries: Iterable[Exceedance]) -> list[Exceedance]:
    """Entries, those that differ only in component and place as one: all their names, first time, worst value."""
    alike: dict[tuple[str, float, str, bool], list[Exceedance]] = {}
    for entry in entries:
        alike.setdefault((entry.what, entry.limit, entry.severity, bool(entry.place)), []).append(entry)
    return [_as_one(same) for same in alike.values()]


def _as_one(alike: list[Exceedance]) -> Exceedance:
    places = {entry.component: [each.place for each in alike if each.component == entry.component] for entry in alike}
    words = {component: in_words(each) for component, each in places.items()}
    if len({*words.values()}) > 1:
        words = {component: f"{place} of {component}" for component, place in words.items()}
    return alike[0]._replace(
        component=" and ".join(words), place=" and ".join(dict.fromkeys(words.values())),
        time=min(each.time for each in alike), value=max(each.value for each in alike),
    )  # fmt: skip


def in_words(places: Iterable[str]) -> str:
    """Names of places, those that differ only in their number as one: "idler, road_wheel[1, 2, 5]"."""
    numbers: dict[str, list[str]] = {}
    for place in places:
        stem, bracket, number = place.partition("[")
        numbers.setdefault(stem + bracket, []).append(number.removesuffix("]"))
    return ", ".join(f"{stem}{', '.join(found)}]" if "[" in stem else stem for stem, found in numbers.items())


def recorded_entries(results: Mapping[str, str]) -> list[dict[str, Any]]:
    """Entries in the results of a closing record, as arguments of ``Exceedance``; invalid ones are left out."""
    try:
        entries = json.loads(results.get("validity", "[]"))
    except (ValueError, RecursionError):
        return []
    texts = dict.fromkeys(("what", "component", "place", "severity"), str)
    types = {**texts, **dict.fromkeys(("time", "value", "limit"), float)}
    tables = (entry for entry in entries if isinstance(entry, dict)) if isinstance(entries, list) else ()
    return [
        entry
        for entry in tables
        if {key: type(value) for key, value in entry.items()} == types and entry["what"] in VALIDITY_KINDS
    ]


def excess(t: Floats, values: Floats, limit: float) -> tuple[float, float, float] | None:
    """First time above the limit, largest value and its time, of values (m,) at times (m,), s; else None."""
    beyond = values > limit  # false for a NaN
    if not beyond.any():
        return None
    worst = int(np.argmax(np.where(beyond, values, -np.inf)))
    return float(t[np.argmax(beyond)]), float(values[worst]), float(t[worst])


def exceedance(
    what: str, component: str, place: str, t: Floats, values: Floats, limit: float, severity: str = WARNING
) -> Iterator[Exceedance]:
    """Entry of a limit that values (m,) at times (m,), s, exceed: the first time and the largest value; else none."""
    if (first_and_worst := excess(t, values, limit)) is not None:
        yield Exceedance(what, component, first_and_worst[0], place, first_and_worst[1], limit, severity)


def exceedances(
    what: str, component: str, t: Floats, values: Floats, warning: float, failure: float
) -> list[tuple[Exceedance, float]]:
    """Warning and failure of values above their limits, without a place, with times of the worst, s."""
    return [
        (Exceedance(what, component, first_and_worst[0], "", first_and_worst[1], limit, severity), first_and_worst[2])
        for limit, severity in ((warning, WARNING), (failure, FAILURE))
        if (first_and_worst := excess(t, values, limit)) is not None
    ]
