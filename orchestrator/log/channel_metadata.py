"""Channels: what the record of a channel says of its topic, as the texts that MCAP's metadata hold, and read again."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import NamedTuple

from orchestrator.log import schema
from orchestrator.log.message_records import MOST_STEPS
from orchestrator.log.time_series import Topic
from orchestrator.log.wire import RULES, Wire

FIELDS = set(Wire._fields)


class Recorded(NamedTuple):
    """A channel whose messages ``recorder`` wrote."""

    topic: str
    about: Topic
    columns: tuple[int, ...]  # of its variables, those that its messages hold
    names: tuple[str, ...]  # of these
    layout: schema.Layout


def recorded(topic: str, about: Topic) -> Recorded:
    """The channel of a topic; raises ValueError for one that no message can be made of."""
    wired = {name for wire in about.wires for name in wire.inputs}
    columns = tuple(column for column, name in enumerate(about.names) if name not in wired)
    names = tuple(about.names[column] for column in columns)
    return Recorded(topic, about, columns, names, schema.layout(schema.places(names)))


def texts(channel: Recorded) -> dict[str, str]:
    """Its metadata; a variable that a wire has has no place in its messages."""
    about = channel.about
    places = dict(zip(channel.columns, schema.places(channel.names), strict=True))
    found = {
        "names": json.dumps(about.names),
        "units": json.dumps(about.units),
        "places": json.dumps([places.get(column, "") for column in range(len(about.names))]),
        "every": str(about.every),
    }
    return found | ({"wires": json.dumps([wire._asdict() for wire in about.wires])} if about.wires else {})


def read(topic: str, about: Mapping[str, str], described: bytes) -> Recorded:
    """The channel of these metadata, whose schema is ``described``; raises LookupError, ValueError, RecursionError."""
    names, units, places = (_texts(about[key]) for key in ("names", "units", "places"))
    if not len(names) == len(set(names)) == len(units) == len(places):
        raise ValueError("names, units and places do not belong together")
    every = int(about["every"])
    if not 1 <= every <= MOST_STEPS:
        raise ValueError(f"a topic is not recorded every {every} steps")
    wires = _wires(about["wires"]) if "wires" in about else ()
    columns = tuple(column for column, place in enumerate(places) if place or not wires)
    held = tuple(names[column] for column in columns)
    wired = [name for wire in wires for name in wire.inputs]
    if sorted(wired) != sorted(set(names) - set(held)):
        raise ValueError("what has no place has no wire")
    if wires and every != 1:
        raise ValueError("wires are of every step")
    layout = schema.layout([places[column] for column in columns])
    if not schema.describes(described, layout.fields):
        raise ValueError("schema and places differ")
    return Recorded(topic, Topic(names, units, every, wires), columns, held, layout)


def _wires(text: str) -> tuple[Wire, ...]:
    """A JSON list of wires."""
    found = json.loads(text)
    if not isinstance(found, list) or not all(isinstance(each, dict) and each.keys() == FIELDS for each in found):
        raise ValueError("not a list of wires")
    wires = []
    for each in found:
        outputs, inputs = (_all_texts(each[key]) for key in ("outputs", "inputs"))
        if len(outputs) != len(inputs) or each["rule"] not in RULES:
            raise ValueError("a wire is not told as one")
        (source,) = _all_texts([each["source"]])
        wires.append(Wire(source, each["rule"], outputs, inputs))
    return tuple(wires)


def _texts(text: str) -> tuple[str, ...]:
    """A JSON list of texts."""
    return _all_texts(json.loads(text))


def _all_texts(found: object) -> tuple[str, ...]:
    if not isinstance(found, list) or not all(isinstance(each, str) for each in found):
        raise ValueError("not a list of texts")
    "".join(found).encode()  # half a surrogate pair is JSON, but no text
    return tuple(found)
