"""Message records: those of one topic in one chunk, as they stand in the file, decoded by the thousand."""

from __future__ import annotations

import struct
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from mcap.opcode import Opcode
from numpy.typing import NDArray

from orchestrator.log.schema import Bytes, Layout
from orchestrator.log.time_series import Series

MOST_STEPS = 2**32 - 1  # a message counts them in 32 bits
LONGEST = 2**64 / 1e9  # s: a message counts nanoseconds in 64 bits
PREFIX = 31  # bytes of a message record before its data: opcode, length, channel, sequence, two times
SEQUENCE, LOG_TIME, PUBLISH_TIME = 11, 15, 23  # where these begin in it
IDENTITY = 11  # bytes of it that depend on the file: opcode, length, channel; the rest is in the digest
_PREFIX = struct.Struct("<BQHIQQ")
_IDENTITY = struct.Struct("<BQH")
_HEAD = 9  # bytes of opcode and length, which the length does not count


class Messages(NamedTuple):
    """Message records of one topic in one chunk, as they stand in the file."""

    topic: str
    names: tuple[str, ...]  # of the variables that they hold
    layout: Layout
    rows: NDArray[np.uint8]  # (m, bytes)

    def decode(self, columns: Sequence[int] | None = None) -> Series:
        """What they say, as arrays; of some variables, or of all."""
        t, h, values = self.layout.unpack(self.rows, PREFIX, columns)
        return Series(t, h, self.names if columns is None else tuple(self.names[k] for k in columns), values)

    @property
    def t(self) -> NDArray[np.float64]:
        """Time (m,), s."""
        return self.layout.unpack(self.rows, PREFIX, ())[0]

    def digestible(self) -> memoryview:
        """The bytes that a topic's sha256 is made of: sequence, times and data."""
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
        """The same once more (m,), ns."""
        return self._column(PUBLISH_TIME, PREFIX, "<u8")

    def _column(self, start: int, end: int, kind: str) -> NDArray:
        return np.ascontiguousarray(self.rows[:, start:end]).view(kind)[:, 0]


def size_of(layout: Layout) -> int:
    """Bytes of a message record."""
    return PREFIX + len(layout.template)


def prefix(channel: int, size: int) -> bytes:
    """What all message records of a channel begin with, sequence and times zero; ``size``: bytes of a record."""
    return _PREFIX.pack(Opcode.MESSAGE, size - _HEAD, channel, 0, 0, 0)


def runs_by_channel(content: Bytes) -> dict[int, list[range]]:
    """Where message records begin in the content of a chunk (n,), by channel; raises ValueError.

    A range is a run of records of one size, its step. Those of a log that ``recorder`` wrote stand together.
    """
    found: dict[int, list[range]] = {}
    offset, end = 0, len(content)
    while offset + IDENTITY <= end:
        opcode, length, channel = _IDENTITY.unpack_from(content.data, offset)
        size = _HEAD + length
        if offset + size > end:
            break
        count = 1
        if opcode == Opcode.MESSAGE:
            count = _alike(content[offset:], size)
            found.setdefault(channel, []).append(range(offset, offset + count * size, size))
        offset += count * size
    if offset != end:
        raise ValueError("its last message is cut off")
    return found


def _alike(content: Bytes, size: int) -> int:
    """How many records of one size, opcode and channel come one after the other."""
    most, count = len(content) // size, 1
    rows = content[: most * size].reshape(most, size)[:, :IDENTITY]
    while count < most:
        same = (rows[count : 4 * count] == rows[0]).all(axis=1)
        if not same.all():
            return count + int(same.argmin())
        count += len(same)
    return most
