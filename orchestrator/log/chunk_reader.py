"""Chunks: compressed pieces of a log with the messages of its topics, checked and taken apart as they are read."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Collection, Mapping, Sequence

import numpy as np
import zstandard
from mcap.records import Chunk

from orchestrator.log.channel_metadata import Recorded
from orchestrator.log.container_reader import DAMAGE, ContainerReader, LogUnreadable
from orchestrator.log.message_records import Messages, all_of_size, offsets_by_channel, size_of

KEEP = 256 << 20  # bytes of unpacked chunks that an open log keeps in memory
_SPAN = struct.Struct("<QQ")  # begins a chunk: first and last time in it, ns


class Chunks:
    """The chunks of a log.

    ``spans``: offset of each in the file -> first and last time in it, s. ``unpacked``: of those in memory, by offset,
    their messages.
    """

    def __init__(self, file: ContainerReader, channels: Mapping[int, Recorded]) -> None:
        self._file = file
        self._channels = channels
        self.spans: dict[int, tuple[float, float]] = {}
        self.unpacked: dict[int, list[Messages]] = {}
        self._inside: dict[int, list[tuple[Recorded, Sequence[int]]]] = {}  # where messages are in a chunk, by offset
        self._room = KEEP

    def add(self, offset: int) -> None:
        """Note the chunk at ``offset``, and when it begins and ends as it says itself."""
        first, last = _SPAN.unpack(self._file.body(offset, _SPAN.size).ljust(_SPAN.size, b"\0"))
        self.spans[offset] = 1e-9 * first, 1e-9 * last
        self._file.let_go(offset)

    def read(self, offset: int, topics: Collection[str] | None = None, keep: bool = True) -> list[Messages]:
        """The message records of a chunk by channel, of topics or of all; raises LogUnreadable."""
        piece = self.unpacked.get(offset)
        if piece is None:
            piece = self._unpack(offset, keep)
        return [messages for messages in piece if topics is None or messages.topic in topics]

    def _unpack(self, offset: int, keep: bool) -> list[Messages]:
        try:
            content = _content(self._file.record(Chunk, offset))
            if offset not in self._inside:
                found = offsets_by_channel(content)
                self._inside[offset] = [
                    (self._channels[number], _together(content, self._channels[number], where))
                    for number, where in found.items()
                    if number in self._channels
                ]
            piece = [_messages(content, *at) for at in self._inside[offset]]
        except DAMAGE as damage:
            raise LogUnreadable(
                f"{self._file.path}: the chunk at byte {offset} is damaged ({damage}); 'log recover' saves the rest"
            ) from None
        if not keep:
            self._file.let_go(offset)
        elif len(content) <= self._room:  # a log is read topic by topic, a chunk unpacked once
            self._room -= len(content)
            self.unpacked[offset] = piece
        return piece


def _together(content: bytes, channel: Recorded, offsets: list[int]) -> Sequence[int]:
    """Where the messages of a channel are; where they stand together, in no more room than a range takes."""
    size = size_of(channel.layout)
    if not all_of_size(content, offsets, size):
        raise ValueError(f"a message of {channel.topic} does not have {size} bytes")
    together = offsets[-1] - offsets[0] == size * (len(offsets) - 1)
    return range(offsets[0], offsets[-1] + 1, size) if together else offsets


def _messages(content: bytes, channel: Recorded, offsets: Sequence[int]) -> Messages:
    size = size_of(channel.layout)
    if isinstance(offsets, range):
        rows = np.frombuffer(content, np.uint8, size * len(offsets), offsets[0])
    else:
        rows = np.frombuffer(b"".join(content[offset : offset + size] for offset in offsets), np.uint8)
    names = tuple(channel.about.names[column] for column in channel.columns)
    return Messages(channel.topic, names, channel.layout, rows.reshape(-1, size))


def _content(chunk: Chunk) -> bytes:
    """The uncompressed records of a chunk, checked; raises one of DAMAGE."""
    if chunk.compression == "zstd":
        if zstandard.frame_content_size(chunk.data) not in (-1, chunk.uncompressed_size):  # -1: not said
            raise ValueError("its size does not hold")
        content = zstandard.decompress(chunk.data, chunk.uncompressed_size)
    elif chunk.compression == "":
        content = chunk.data
    else:
        raise ValueError(f"compression {chunk.compression!r} is not known")
    if chunk.uncompressed_crc not in (0, zlib.crc32(content)):
        raise ValueError("its checksum does not hold")
    return content
