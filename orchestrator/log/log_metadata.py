"""Metadata of a log, which are texts in MCAP: version of the format, channels of topics, closing record.

Formats: 1 has no record of its version, and all inputs are recorded; 2 has wired inputs and checkpoints. Metadata of a
channel hold its names, units, places and wires. The closing record holds status, results and warnings of the run, count
and sha256 of each topic; a log without it was cut off.
"""

from __future__ import annotations

import json
import os
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from orchestrator.log import schema, seal
from orchestrator.log.message_records import MAX_STEPS
from orchestrator.log.time_series import RULES, Topic, Wire

FORMAT = "format"  # of the metadata record
FORMAT_VERSION = 2
BRANCHED = "branched"  # of the metadata record of a run that continues another one with changed parameters
INPUTS, UNRECORDED = "inputs", "not recorded"  # entry of the metadata ``run`` of a log without inputs
TEXTS = "texts.json"  # attachment at the end: texts by the numbers that a log holds for a String, by signal
CHECKPOINT = "checkpoint/"  # prefix of the name of an attachment, before the number of the step


def checkpoint_step(attachment: str) -> int | None:
    """Return the step number of a checkpoint attachment; None for other attachments."""
    number = attachment.removeprefix(CHECKPOINT)
    return int(number) if number != attachment and number.isdecimal() else None


def path_text_of(path: str | os.PathLike[str]) -> str:
    """Return a path as a text that a log can hold: file names may hold bytes that are not text."""
    return os.fspath(path).encode(errors="backslashreplace").decode()


class TooNew(ValueError):
    """The log has a newer format than this version reads; the message is the end of a sentence."""


def check_version(record: Mapping[str, str]) -> None:
    """Raise TooNew if this version cannot read the log's format, ValueError if the record is damaged."""
    version = int(record.get("version", "0"))
    if version > FORMAT_VERSION:
        raise TooNew(f"has format {version} of a newer cotrack: this one reads formats 1 to {FORMAT_VERSION}")


WIRE_FIELDS = set(Wire._fields)


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


def encode_channel(channel: RecordedChannel) -> dict[str, str]:
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


def decode_channel(topic: str, about: Mapping[str, str], described: bytes) -> RecordedChannel:
    """Decode a channel from its metadata and schema data; raises LookupError, ValueError, RecursionError."""
    names, units, places = (_texts(about[key]) for key in ("names", "units", "places"))
    if not len(names) == len(set(names)) == len(units) == len(places):
        raise ValueError("names, units and places differ in number or a name is listed twice")
    every = int(about["every"])
    if not 1 <= every <= MAX_STEPS:
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
    if not isinstance(tables, list) or not all(
        isinstance(table, dict) and table.keys() == WIRE_FIELDS for table in tables
    ):
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


CLOSING = "closing"  # of the metadata record
_WARNING_FIELDS = {"component": str, "text": str, "time": float, "count": int}  # ``ComponentWarning``


def encode_closing(
    status: str,
    message: str,
    steps: int,
    topics: Mapping[str, tuple[int, str]],
    results: Mapping[str, str],
    warnings: Sequence[Mapping[str, object]],
    contents: Mapping[str, str],
) -> dict[str, str]:
    """Return the record as texts, with its seal; ``topics``: topic -> (number of messages, sha256).

    ``contents``: digests by name (``seal``).
    """
    record = {"status": status, "message": message, "steps": str(steps)}
    for topic, (messages, sha256) in topics.items():
        record |= {f"messages:{topic}": str(messages), f"sha256:{topic}": sha256}
    record |= {f"result:{name}": text for name, text in results.items()}
    record |= {f"content:{name}": digest for name, digest in contents.items()}
    return seal.sealed(record | {"warnings": json.dumps(list(warnings))})


def decode_closing(record: Mapping[str, str]) -> dict[str, Any]:
    """Decode a closing record: numbers as int, and one dict by topic for messages, sha256 and results.

    Raises ValueError, RecursionError.
    """
    by_topic = {
        kind: {key.partition(":")[2]: value for key, value in record.items() if key.startswith(f"{kind}:")}
        for kind in ("messages", "sha256", "result", "content")
    }
    return {
        "status": record.get("status", ""),
        "message": record.get("message", ""),
        "steps": int(record.get("steps", 0)),
        "messages": {topic: int(value) for topic, value in by_topic["messages"].items()},
        "sha256": by_topic["sha256"],
        "results": by_topic["result"],
        "contents": by_topic["content"],
        "warnings": _warnings(record.get("warnings", "[]")),
        "seal": record.get(seal.SEAL, "").replace(seal.TREE, ""),
        "seal_holds": seal.holds(record),
    }


def _warnings(text: str) -> list[dict[str, Any]]:
    entries = json.loads(text)
    if not isinstance(entries, list):
        raise ValueError("warnings are no list")
    for entry in entries:
        if not isinstance(entry, dict) or {key: type(value) for key, value in entry.items()} != _WARNING_FIELDS:
            raise ValueError("a warning does not consist of component, text, time and count")
        if not 0 < entry["count"] <= MAX_STEPS:
            raise ValueError("the count of a warning is out of range")
        f"{entry['component']}{entry['text']}".encode()  # ValueError for half a surrogate pair, which JSON allows
    return entries
