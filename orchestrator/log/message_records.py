"""MCAP message records as byte arrays (m, bytes), which are decoded together; records of the topic /events.

Events of a run are messages of Foxglove's type Log, written when the run has ended. They are JSON, which any tool
displays. They follow from the other messages, so digests and ``reader`` leave them out; ``analyses/events.py`` finds
the events in any log.
"""

from __future__ import annotations

import json
import struct
from collections.abc import Collection, Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from mcap.opcode import Opcode
from numpy.typing import NDArray

from orchestrator.log.schema import Bytes, MessageLayout
from orchestrator.log.time_series import Series

MAX_STEPS = 2**32 - 1  # the sequence of a message has 32 bits
MAX_TIME = 2**64 / 1e9  # s: times of a message are nanoseconds in 64 bits
PREFIX = 31  # bytes of a message record before its data: opcode, length, channel, sequence, two times
SEQUENCE, LOG_TIME, PUBLISH_TIME = 11, 15, 23  # byte offsets in the record
IDENTITY = SEQUENCE  # bytes before it depend on the file: opcode, length, channel; the rest is in the digest
_PREFIX = struct.Struct("<BQHIQQ")
_IDENTITY = struct.Struct("<BQH")
_RECORD = struct.Struct("<BQ")
_HEAD = 9  # bytes of opcode and length, which the length does not count


class Messages(NamedTuple):
    """Message records of one topic in one chunk, as bytes of the file."""

    topic: str
    names: tuple[str, ...]  # recorded variables
    layout: MessageLayout
    rows: NDArray[np.uint8]  # (m, bytes)

    def decode(self, columns: Sequence[int] | None = None) -> Series:
        """Return the messages as a series; ``columns`` selects recorded variables (None: all)."""
        t, h, values = self.layout.unpack(self.rows, PREFIX, columns)
        return Series(t, h, self.names if columns is None else tuple(self.names[k] for k in columns), values)

    @property
    def t(self) -> NDArray[np.float64]:
        """Time (m,), s."""
        return self.layout.unpack(self.rows, PREFIX, ())[0]

    def hashed_bytes(self) -> memoryview:
        """Return the bytes that enter a topic's sha256: sequence, times and data."""
        return np.ascontiguousarray(self.rows[:, IDENTITY:]).data

    @property
    def sequence(self) -> NDArray[np.uint32]:
        """Number of the step (m,)."""
        return self._column(SEQUENCE, LOG_TIME, "<u4")

    @property
    def log_time(self) -> NDArray[np.uint64]:
        """Simulation time (m,), ns."""
        return self._column(LOG_TIME, PUBLISH_TIME, "<u8")

    @property
    def publish_time(self) -> NDArray[np.uint64]:
        """Publish time (m,), ns; equal to ``log_time`` in an intact log."""
        return self._column(PUBLISH_TIME, PREFIX, "<u8")

    def _column(self, start: int, end: int, kind: str) -> NDArray:
        return np.ascontiguousarray(self.rows[:, start:end]).view(kind)[:, 0]


def size_of(layout: MessageLayout) -> int:
    """Return the size of a message record in bytes."""
    return PREFIX + len(layout.template)


def prefix(channel: int, size: int) -> bytes:
    """Return the bytes before the data of a channel's records of ``size`` bytes; sequence and times 0."""
    return _PREFIX.pack(Opcode.MESSAGE, size - _HEAD, channel, 0, 0, 0)


def items_at(content: Bytes, size: int) -> NDArray[np.void]:
    """Return the ``size`` bytes that begin at each byte of ``content`` (n,) as an array (n - size + 1,), a view."""
    return np.ndarray((max(len(content) - size + 1, 0),), f"V{size}", content, 0, (1,))


class Records(NamedTuple):
    """Message records of one channel in the content of a chunk."""

    size: int  # bytes of each
    offsets: NDArray[np.int64]  # (m,)

    def rows(self, content: Bytes) -> Bytes:
        """Return the records as rows (m, size); contiguous ones are a view."""
        first, m = int(self.offsets[0]), len(self.offsets)
        if np.all(np.diff(self.offsets) == self.size):
            return content[first : first + m * self.size].reshape(m, self.size)
        return items_at(content, self.size)[self.offsets].view(np.uint8).reshape(m, self.size)


def records_by_channel(
    content: Bytes, indexed: Mapping[int, NDArray[np.int64]], most: int, wanted: Collection[int]
) -> dict[int, Records]:
    """Find the message records of ``wanted`` channels in the content of a chunk (n,); raises ValueError.

    ``indexed``: offsets (m,) by channel in the message indexes. The records are scanned one
    by one if these are wrong. ``most``: largest number of records.
    """
    records = {}
    for channel, offsets in indexed.items():
        if not len(offsets) or offsets.min() < 0 or offsets.max() > len(content) - IDENTITY:
            break
        heads = items_at(content, IDENTITY)[offsets].view(np.uint8).reshape(-1, IDENTITY)
        opcode, length, number = _IDENTITY.unpack(heads[0].tobytes())
        if opcode != Opcode.MESSAGE or number != channel or (heads != heads[0]).any():
            break
        records[channel] = Records(_HEAD + length, offsets)
    if len(records) == len(indexed) and _cover(records.values(), len(content)):
        return records
    return {channel: _of_runs(runs) for channel, runs in runs_by_channel(content, most).items() if channel in wanted}


def record_places(content: bytes) -> Iterator[tuple[int, int, int]]:
    """Yield opcode, beginning and end of the records in the content of a chunk; the last one may be cut off."""
    offset = 0
    while offset + _HEAD <= len(content):
        opcode, length = _RECORD.unpack_from(content, offset)
        yield opcode, offset, offset + _HEAD + length
        offset += _HEAD + length


def _cover(records: Collection[Records], size: int) -> bool:
    """Whether records fill ``size`` bytes without gap and overlap."""
    begins = np.concatenate([np.empty(0, np.int64), *(part.offsets for part in records)])
    ends = np.concatenate([np.empty(0, np.int64), *(part.offsets + part.size for part in records)])
    return np.array_equal(np.append(np.sort(begins), size), np.append(0, np.sort(ends)))


def _of_runs(runs: Sequence[range]) -> Records:
    """Return the records of runs; raises ValueError if they differ in size."""
    if len({run.step for run in runs}) > 1:
        raise ValueError("messages of one channel differ in size")
    return Records(runs[0].step, np.concatenate([np.arange(run.start, run.stop, run.step) for run in runs]))


def runs_by_channel(content: Bytes, most: int) -> dict[int, list[range]]:
    """Find the message records in the content of a chunk (n,); raises ValueError.

    ``most``: largest number of records. Returns ranges of offsets by channel. A range is a run of records of equal
    size, which is its step.
    """
    runs: dict[int, list[range]] = {}
    offset, end = 0, len(content)
    while offset + IDENTITY <= end:
        opcode, length, channel = _IDENTITY.unpack_from(content.data, offset)
        size = _HEAD + length
        if offset + size > end:
            break
        count = 1
        if opcode == Opcode.MESSAGE:
            count = _run_length(content[offset:], size)
            runs.setdefault(channel, []).append(range(offset, offset + count * size, size))
        offset += count * size
        most -= count
        if most < 0:
            raise ValueError("it has more records than its size allows")
    if offset != end:
        raise ValueError("its last message is cut off")
    return runs


def _run_length(content: Bytes, size: int) -> int:
    """Number of consecutive records of ``size`` bytes with the opcode and channel of the first one."""
    records, count = len(content) // size, 1
    rows = content[: records * size].reshape(records, size)[:, :IDENTITY]
    while count < records:
        is_equal = (rows[count : 4 * count] == rows[0]).all(axis=1)
        if not is_equal.all():
            return count + int(is_equal.argmin())
        count += len(is_equal)
    return records


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
EVENTS_CHANNEL = EVENTS_TOPIC, EVENTS_TYPE, EVENTS_SCHEMA


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
