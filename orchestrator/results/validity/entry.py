"""An entry of the validity ledger."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from orchestrator.log.time_series import Floats
from orchestrator.results.validity.limits import KINDS

WARNING, FAILURE = "warning", "failure"


class Entry(NamedTuple):
    """A limit that was passed."""

    what: str  # a key of ``limits.KINDS``
    component: str
    time: float  # s, when it was passed first
    place: str  # on the component, "road_wheel[3]"; empty for all of it
    value: float  # the worst, SI
    limit: float  # SI
    severity: str  # WARNING or FAILURE

    @property
    def sentence(self) -> str:
        """What a reader is told."""
        kind = KINDS[self.what]
        value, limit = (f"{each / kind.size:.3g}" for each in (self.value, self.limit))
        at = f" at {self.place}" if self.place else ""
        return f"{kind.text}{at}: {value} {kind.unit}, limit {limit} {kind.unit}"


def recorded(results: Mapping[str, str]) -> list[dict[str, Any]]:
    """Entries in the results of a closing record, as ``Entry`` takes them; what is none of them is left out."""
    try:
        found = json.loads(results.get("validity", "[]"))
    except (ValueError, RecursionError):
        return []
    texts = dict.fromkeys(("what", "component", "place", "severity"), str)
    types = {**texts, **dict.fromkeys(("time", "value", "limit"), float)}
    whole = (each for each in found if isinstance(each, dict)) if isinstance(found, list) else ()
    return [each for each in whole if {key: type(one) for key, one in each.items()} == types and each["what"] in KINDS]


def passed(t: Floats, values: Floats, limit: float) -> tuple[float, float, float] | None:
    """Of values (m,) at times (m,), s: when the limit was first passed, the largest value, and when that was."""
    beyond = values > limit  # false for a NaN
    if not beyond.any():
        return None
    worst = int(np.argmax(np.where(beyond, values, -np.inf)))
    return float(t[np.argmax(beyond)]), float(values[worst]), float(t[worst])


def levels(
    what: str, component: str, t: Floats, values: Floats, warning: float, failure: float
) -> list[tuple[Entry, float]]:
    """A warning and a failure where values pass their limits, without a place, and when they were worst, s."""
    return [
        (Entry(what, component, one[0], "", one[1], limit, severity), one[2])
        for limit, severity in ((warning, WARNING), (failure, FAILURE))
        if (one := passed(t, values, limit)) is not None
    ]
