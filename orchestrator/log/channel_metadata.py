"""Channels: what the record of a channel says of its topic, as the texts that MCAP's metadata hold, and read again."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import NamedTuple

from orchestrator.log import schema
from orchestrator.log.message_records import MOST_STEPS
from orchestrator.log.time_series import Topic


class Recorded(NamedTuple):
    """A channel whose messages ``recorder`` wrote."""

    topic: str
    about: Topic
    layout: schema.Layout


def texts(variables: Sequence[tuple[str, str]], every: int) -> dict[str, str]:
    """The metadata of a channel of (variable, unit)."""
    names = [name for name, _ in variables]
    return {
        "names": json.dumps(names),
        "units": json.dumps([unit for _, unit in variables]),
        "places": json.dumps(schema.places(names)),
        "every": str(every),
    }


def recorded(topic: str, about: Mapping[str, str], described: bytes) -> Recorded:
    """The channel of these metadata, whose schema is ``described``; raises LookupError, ValueError, RecursionError."""
    names, units, where = (_texts(about[key]) for key in ("names", "units", "places"))
    if not len(names) == len(set(names)) == len(units) == len(where):
        raise ValueError("names, units and places do not belong together")
    every = int(about["every"])
    if not 1 <= every <= MOST_STEPS:
        raise ValueError(f"a topic is not recorded every {every} steps")
    layout = schema.layout(where)
    if not schema.describes(described, layout.fields):
        raise ValueError("schema and places differ")
    return Recorded(topic, Topic(names, units, every), layout)


def _texts(text: str) -> tuple[str, ...]:
    """A JSON list of texts."""
    found = json.loads(text)
    if not isinstance(found, list) or not all(isinstance(each, str) for each in found):
        raise ValueError("not a list of texts")
    "".join(found).encode()  # half a surrogate pair is JSON, but no text
    return tuple(found)
