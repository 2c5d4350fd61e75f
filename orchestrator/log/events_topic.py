"""Topic /events: events of a run in messages of Foxglove's type Log, written when the run has ended.

The messages are JSON, which any tool displays. They follow from the other messages, so digests and ``reader`` leave
them out; ``analyses/events.py`` finds the events in any log.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from orchestrator.log.message_records import PREFIX, prefix

EVENTS_TOPIC, EVENTS_TYPE = "/events", "foxglove.Log"
EVENT, EVENT_WARNING = 2, 3  # levels of that type
WARNINGS = ("step", "warning", "validity")  # kinds about the simulation, not the vehicle
_TIME = {"type": "object", "properties": {"sec": {"type": "integer"}, "nsec": {"type": "integer"}}}
_TEXT, _NUMBER = {"type": "string"}, {"type": "integer"}
EVENTS_SCHEMA = json.dumps({
    "title": EVENTS_TYPE,
    "type": "object",
    "properties": {
        "timestamp": _TIME, "level": _NUMBER, "message": _TEXT, "name": _TEXT, "file": _TEXT, "line": _NUMBER,
        "kind": _TEXT,
    },
}).encode()  # fmt: skip


class Event(NamedTuple):
    """Event at one time."""

    t: float  # s
    component: str  # "left_track.road_wheel[1]"
    kind: str  # "lifted", "touches", "airborne", "lands", "tooth", "locked", "released", or one of WARNINGS
    text: str


def event_records(channel: int, events: Sequence[Event]) -> tuple[NDArray[np.uint8], NDArray[np.uint64]]:
    """Return message records (m, bytes), padded with blanks to one size, and their times (m,), ns."""
    times = np.array([max(round(event.t * 1e9), 0) for event in events], "<u8")
    texts = [_event_text(event, int(time)) for event, time in zip(events, times, strict=True)]
    size = PREFIX + max(map(len, texts))
    rows = np.empty((len(events), size), np.uint8)
    rows[:, :PREFIX] = np.frombuffer(prefix(channel, size), np.uint8)
    for number, (row, text) in enumerate(zip(rows, texts, strict=True)):
        row[11:15] = np.frombuffer(number.to_bytes(4, "little"), np.uint8)
        row[PREFIX:] = np.frombuffer(text.ljust(size - PREFIX), np.uint8)
    for first in (15, 23):  # log time and publish time
        rows[:, first : first + 8] = times.view(np.uint8).reshape(-1, 8)
    return rows, times


def _event_text(event: Event, time: int) -> bytes:
    seconds, rest = divmod(time, 1_000_000_000)
    message = {
        "timestamp": {"sec": seconds, "nsec": rest},
        "level": EVENT_WARNING if event.kind in WARNINGS else EVENT, "message": event.text, "name": event.component,
        "file": "", "line": 0, "kind": event.kind,
    }  # fmt: skip
    return json.dumps(message).encode()
