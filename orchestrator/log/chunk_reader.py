"""Chunks of a log: compressed message records, checked, unpacked and split by channel when read."""

from __future__ import annotations

import struct
from collections.abc import Collection, Iterator, Mapping
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from orchestrator.files.budget import most_records
from orchestrator.log.channel_metadata import RecordedChannel
from orchestrator.log.container_reader import DAMAGE, HEAD, ContainerReader, LogUnreadable
from orchestrator.log.message_records import LOG_TIME, Messages, Records, records_by_channel, size_of
from orchestrator.log.schema import Bytes

CACHED_BYTES = 256 << 20  # bytes of unpacked chunks that an open log keeps in memory
SMALL = 32 << 20  # packed bytes of a log whose chunks are all kept: results pass over it a dozen times
_TIME = struct.Struct("<Q")
_SPAN = struct.Struct("<QQ")  # begins a chunk: first and last time in it, ns


class Chunks:
    """Chunks of one log.

    ``spans``: offset in the file -> first and last time in the chunk, s. ``unpacked``: offset -> messages, for the
    chunks in memory.
    """

    def __init__(self, file: ContainerReader, channels: Mapping[int, RecordedChannel]) -> None:
        self._file = file
        self._channels = channels
        self.spans: dict[int, tuple[float, float]] = {}
        self.unpacked: dict[int, list[Messages]] = {}
        self._room = CACHED_BYTES

    def add(self, offset: int) -> None:
        """Register the chunk at ``offset`` with the first and last time in its header."""
        first, last = _SPAN.unpack(self._file.body(offset, _SPAN.size).ljust(_SPAN.size, b"\0"))
        self.spans[offset] = 1e-9 * first, 1e-9 * last
        self._file.take_chunk(offset)
        self._file.release_record(offset)

    def add_message(self, offset: int) -> None:
        """Register a message outside a chunk, which is read with those beside it."""
        part = self._file.add_message(offset)
        (t,) = _TIME.unpack(self._file.body(offset, LOG_TIME - HEAD.size + _TIME.size)[LOG_TIME - HEAD.size :])
        first, last = self.spans.get(part, (1e-9 * t, 1e-9 * t))
        self.spans[part] = min(first, 1e-9 * t), max(last, 1e-9 * t)

    def read(self, offset: int, topics: Collection[str] | None = None, keep: bool = False) -> list[Messages]:
        """Return the message records of a chunk, one ``Messages`` per channel; raises LogUnreadable.

        ``topics`` selects (None: all). ``keep``: keep the unpacked chunk in memory while there is room, as those
        of a small log are in any case.
        """
        try:
            kept = self.unpacked.get(offset)
            if kept is None:
                return self._unpack(offset, topics, keep or self._is_small)
            return kept if topics is None else [messages for messages in kept if messages.topic in topics]
        except DAMAGE as damage:
            raise LogUnreadable(
                f"{self._file.path}: the chunk at byte {offset} is damaged ({damage}); 'log recover' saves the rest"
            ) from None

    @cached_property
    def _is_small(self) -> bool:
        return sum(map(self._file.packed_size, self.spans)) <= SMALL

    def rows_of(self, number: int) -> Iterator[NDArray[np.uint8]]:
        """Yield the message records (m, bytes) of a channel that is not ours, chunk by chunk; raises LogUnreadable."""
        for offset in self.spans:
            try:
                content = np.frombuffer(self._file.content(offset), np.uint8)
                records = records_by_channel(content, {}, most_records(self._file.packed_size(offset)), (number,))
                if number in records:
                    yield records[number].rows(content)
            except DAMAGE as damage:
                raise LogUnreadable(f"{self._file.path}: the chunk at byte {offset} is damaged ({damage})") from None

    def _unpack(self, offset: int, topics: Collection[str] | None, keep: bool) -> list[Messages]:
        """Return the message records of topics of a chunk; raises one of DAMAGE."""
        content = np.frombuffer(self._file.content(offset), np.uint8)
        most = most_records(self._file.packed_size(offset))
        records = records_by_channel(content, self._file.message_offsets(offset), most, self._channels)
        keep = keep and len(content) <= self._room
        messages = [
            _messages(content, channel, records[number])
            for number, channel in self._channels.items()
            if number in records and (keep or topics is None or channel.topic in topics)
        ]
        if not keep:
            self._file.release_record(offset)
            return messages
        self._room -= len(content)  # topics are read one after another, so a kept chunk is unpacked once
        self.unpacked[offset] = messages
        return [one for one in messages if topics is None or one.topic in topics]


def _messages(content: Bytes, channel: RecordedChannel, records: Records) -> Messages:
    size = size_of(channel.layout)
    if records.size != size:
        raise ValueError(f"a message of {channel.topic} does not have {size} bytes")
    return Messages(channel.topic, channel.names, channel.layout, records.rows(content))
