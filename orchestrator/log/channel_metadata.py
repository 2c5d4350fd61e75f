"""Metadata of MCAP channel records: encoding and checked decoding of names, units, places, wires."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import NamedTuple

from orchestrator.log import schema
from orchestrator.log.message_records import MOST_STEPS
from orchestrator.log.time_series import Topic
from orchestrator.log.wire import RULES, Wire

FIELDS = set(Wire._fields)


class RecordedChannel(NamedTuple):
    """Channel of a topic that ``recorder`` writes."""

    topic: str
    about: Topic
    columns: tuple[int, ...]  # indices of the variables that the messages hold (the others are wired)
    names: tuple[str, ...]  # names of these
    layout: schema.MessageLayout


def recorded_channel(topic: str, about: Topic) -> RecordedChannel:
    """Return the channel of a topic; raises ValueError if its variables do not fit into a message."""
    wired = {name for wire in about.wires for name in wire.inputs}
    columns = tuple(column for column, name in enumerate(about.names) if name not in wired)
    names = tuple(about.names[column] for column in columns)
    return RecordedChannel(topic, about, columns, names, schema.layout(schema.places(names)))


def encode(channel: RecordedChannel) -> dict[str, str]:
    """Encode a channel as metadata texts; wired variables have the empty place."""
    about = channel.about
    places = dict(zip(channel.columns, schema.places(channel.names), strict=True))
    entries = {
        "names": json.dumps(about.names),
        "units": json.dumps(about.units),
        "places": json.dumps([places.get(column, "") for column in range(len(about.names))]),
        "every": str(about.every),
    }
    return entries | ({"wires": json.dumps([wire._asdict() for wire in about.wires])} if about.wires else {})


def decode(topic: str, about: Mapping[str, str], described: bytes) -> RecordedChannel:
    """Decode a channel from its metadata and schema data; raises LookupError, ValueError, RecursionError."""
    names, units, places = (_texts(about[key]) for key in ("names", "units", "places"))
    if not len(names) == len(set(names)) == len(units) == len(places):
        raise ValueError("names, units and places differ in number or a name is listed twice")
    every = int(about["every"])
    if not 1 <= every <= MOST_STEPS:
        raise ValueError(f"a topic is not recorded every {every} steps")
    wires = _wires(about["wires"]) if "wires" in about else ()
    columns = tuple(column for column, place in enumerate(places) if place or not wires)
    recorded_names = tuple(names[column] for column in columns)
    wired = [name for wire in wires for name in wire.inputs]
    if sorted(wired) != sorted(set(names) - set(recorded_names)):
        raise ValueError("the variables without a place are not the wired ones")
    if wires and every != 1:
        raise ValueError("a wired topic is not recorded at every step")
    layout = schema.layout([places[column] for column in columns])
    if not schema.is_descriptor_of(described, layout.fields):
        raise ValueError("schema and places differ")
    return RecordedChannel(topic, Topic(names, units, every, wires), columns, recorded_names, layout)


def _wires(text: str) -> tuple[Wire, ...]:
    """Decode a JSON list of wires; raises ValueError."""
    tables = json.loads(text)
    if not isinstance(tables, list) or not all(isinstance(table, dict) and table.keys() == FIELDS for table in tables):
        raise ValueError("not a list of wires")
    wires = []
    for table in tables:
        outputs, inputs = (_checked_texts(table[key]) for key in ("outputs", "inputs"))
        if len(outputs) != len(inputs) or table["rule"] not in RULES:
            raise ValueError("a wire has an unknown rule or not as many outputs as inputs")
        (source,) = _checked_texts([table["source"]])
        wires.append(Wire(source, table["rule"], outputs, inputs))
    return tuple(wires)


def _texts(text: str) -> tuple[str, ...]:
    """Decode a JSON list of texts; raises ValueError."""
    return _checked_texts(json.loads(text))


def _checked_texts(entries: object) -> tuple[str, ...]:
    if not isinstance(entries, list) or not all(isinstance(entry, str) for entry in entries):
        raise ValueError("not a list of texts")
    "".join(entries).encode()  # raises ValueError for half a surrogate pair, which JSON allows
    return tuple(entries)
