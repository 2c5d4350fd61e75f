"""Chunks of a log: compressed message records, checked, unpacked and split by channel when read."""

from __future__ import annotations

import struct
from collections.abc import Collection, Mapping, Sequence

import numpy as np

from orchestrator.files.budget import most_records
from orchestrator.log.channel_metadata import RecordedChannel
from orchestrator.log.container_reader import DAMAGE, ContainerReader, LogUnreadable
from orchestrator.log.message_records import Messages, runs_by_channel, size_of
from orchestrator.log.schema import Bytes

CACHED_BYTES = 256 << 20  # bytes of unpacked chunks that an open log keeps in memory
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
        self._runs: dict[int, dict[int, list[range]]] = {}  # offset -> places of its messages by channel

    def add(self, offset: int) -> None:
        """Register the chunk at ``offset`` with the first and last time in its header."""
        first, last = _SPAN.unpack(self._file.body(offset, _SPAN.size).ljust(_SPAN.size, b"\0"))
        self.spans[offset] = 1e-9 * first, 1e-9 * last
        self._file.take_chunk(offset)
        self._file.release_record(offset)

    def read(self, offset: int, topics: Collection[str] | None = None, keep: bool = True) -> list[Messages]:
        """Return the message records of a chunk, one ``Messages`` per channel; raises LogUnreadable.

        ``topics`` selects (None: all). ``keep``: keep the unpacked chunk in memory while there is room.
        """
        piece = self.unpacked.get(offset)
        if piece is None:
            piece = self._unpack(offset, keep)
        return [messages for messages in piece if topics is None or messages.topic in topics]

    def _unpack(self, offset: int, keep: bool) -> list[Messages]:
        try:
            content = np.frombuffer(self._file.content(offset), np.uint8)
            if offset not in self._runs:
                self._runs[offset] = runs_by_channel(content, most_records(self._file.length(offset)))
            piece = [
                _messages(content, self._channels[number], runs)
                for number, runs in self._runs[offset].items()
                if number in self._channels
            ]
        except DAMAGE as damage:
            raise LogUnreadable(
                f"{self._file.path}: the chunk at byte {offset} is damaged ({damage}); 'log recover' saves the rest"
            ) from None
        if not keep:
            self._file.release_record(offset)
        elif len(content) <= self._room:  # topics are read one after another, so a kept chunk is unpacked once
            self._room -= len(content)
            self.unpacked[offset] = piece
        return piece


def _messages(content: Bytes, channel: RecordedChannel, runs: Sequence[range]) -> Messages:
    size = size_of(channel.layout)
    rows = [content[run.start : run.stop].reshape(-1, run.step) for run in runs]
    if any(run.step != size for run in runs):
        raise ValueError(f"a message of {channel.topic} does not have {size} bytes")
    return Messages(channel.topic, channel.names, channel.layout, rows[0] if len(rows) == 1 else np.concatenate(rows))
