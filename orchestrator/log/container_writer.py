"""Writer of an MCAP file (https://mcap.dev/spec), which leaves whole records on a full disk.

``mcap.writer`` costs 3 to 16 us a message on the caller's thread and cannot continue after a full disk.
"""

from __future__ import annotations

import mimetypes
import struct
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import zstandard
from isal.isal_zlib import crc32  # four times as fast as zlib.crc32
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import (
    Attachment,
    AttachmentIndex,
    Channel,
    ChunkIndex,
    DataEnd,
    Footer,
    Header,
    McapRecord,
    Metadata,
    MetadataIndex,
    Schema,
    Statistics,
    SummaryOffset,
)
from mcap.well_known import MessageEncoding, SchemaEncoding
from mcap.writer import MCAP0_MAGIC
from numpy.typing import NDArray

from orchestrator.log import seal
from orchestrator.log.log_file import lock
from orchestrator.log.message_records import items_at

ZSTD, COMPRESSION_LEVEL = b"zstd", -20  # a quarter of level 1's processor time, and 20 % more bytes
_CHUNK = struct.Struct("<BQQQQII4sQ")  # chunk without its records: opcode, length, times, size, checksum, kind
_HEAD = 9  # bytes of opcode and length, which the length does not count
CLOSING = 1 << 14  # bytes reserved for the closing record on a nearly full disk
SUMMARY = (
    Opcode.SCHEMA,
    Opcode.CHANNEL,
    Opcode.STATISTICS,
    Opcode.CHUNK_INDEX,
    Opcode.ATTACHMENT_INDEX,
    Opcode.METADATA_INDEX,
)

LIBRARY = "cotrack"  # in the header: who wrote the file


class ContainerWriter:
    """MCAP file open for writing; a record that does not fit on the disk is removed whole.

    All methods that write raise OSError.
    """

    def __init__(self, path: Path) -> None:
        self.size = 0
        self._crc = 0  # of all bytes so far
        self._stream = path.open("xb", buffering=0)
        lock(self._stream)
        self._compressor = zstandard.ZstdCompressor(COMPRESSION_LEVEL)
        self._indexed: dict[Opcode, list[Any]] = {opcode: [] for opcode in SUMMARY}  # records of the summary
        self.contents: dict[str, str] = {}  # digests of attachments, metadata and channels (``seal``)
        self._counts: dict[int, int] = {}  # messages of each channel
        self._room = np.empty(0, np.uint8)
        try:
            self._append(MCAP0_MAGIC + _bytes(Header(profile="", library=LIBRARY)))
        except OSError:
            self.close()
            raise

    def metadata(self, name: str, entries: Mapping[str, str]) -> None:
        """Write a metadata record (texts by key)."""
        offset = self.size
        self._append(_bytes(Metadata(name, dict(entries))))
        self.contents[f"metadata:{name}"] = seal.metadata_digest(entries)
        self._indexed[Opcode.METADATA_INDEX].append(MetadataIndex(offset=offset, length=self.size - offset, name=name))

    def attachment(self, name: str, content: bytes) -> None:
        """Write a whole file as an attachment record."""
        kind = mimetypes.guess_type(name)[0] or "application/octet-stream"
        record = Attachment(create_time=0, log_time=0, name=name, media_type=kind, data=content)
        offset = self.size
        self._append(_bytes(record))
        self.contents[f"attachment:{name}"] = seal.attachment_digest(content)
        index = AttachmentIndex(offset, self.size - offset, 0, 0, len(content), name, kind)
        self._indexed[Opcode.ATTACHMENT_INDEX].append(index)

    def channel(
        self, number: int, topic: str, kind: str, description: bytes, about: dict[str, str], json: bool = False
    ) -> None:
        """Write a channel record, and a schema record unless one with this ``description`` exists already.

        ``kind``: name of the message type; ``about``: metadata of the channel; ``json``: JSON instead of protobuf.
        """
        message_encoding, schema_encoding = (
            (MessageEncoding.JSON, SchemaEncoding.JSONSchema)
            if json
            else (MessageEncoding.Protobuf, SchemaEncoding.Protobuf)
        )
        schema = next((record for record in self._indexed[Opcode.SCHEMA] if record.data == description), None)
        if schema is None:
            schema = Schema(number, description, schema_encoding, kind)
            self._append(_bytes(schema))
            self._indexed[Opcode.SCHEMA].append(schema)
        channel = Channel(number, topic, message_encoding, about, schema_id=schema.id)
        self._append(_bytes(channel))
        self.contents[f"channel:{topic}"] = seal.channel_digest(channel, schema)
        self._indexed[Opcode.CHANNEL].append(channel)
        self._counts[number] = 0

    def chunk(
        self, parts: Sequence[tuple[int, NDArray[np.uint8], NDArray[np.uint64]]], reserve_end: bool = False
    ) -> None:
        """Write a chunk of (channel number, message records (m, size), times (m,) in ns), in order of time.

        ``reserve_end``: write it only if the end of the file fits behind it, else raise OSError.
        """
        spans = {id(times): times for _, _, times in parts}.values()  # topics share arrays of times
        start, end = min(int(times.min()) for times in spans), max(int(times.max()) for times in spans)
        places = _places_by_time([rows.shape[1] for _, rows, _ in parts], [times for _, _, times in parts])
        content = self._interleaved([rows for _, rows, _ in parts], places)
        data = self._compressor.compress(content)
        length = _CHUNK.size - _HEAD + len(data)
        crc = crc32(content)
        head = _CHUNK.pack(Opcode.CHUNK, length, start, end, len(content), crc, len(ZSTD), ZSTD, len(data))
        indexes, offsets = bytearray(), {}
        for (number, _, times), where in zip(parts, places, strict=True):
            offsets[number] = self.size + _HEAD + length + len(indexes)
            entries = np.column_stack([times, where]).astype("<u8", copy=False)
            indexes += struct.pack("<BQHI", Opcode.MESSAGE_INDEX, 6 + entries.nbytes, number, entries.nbytes)
            indexes += entries.tobytes()
        offset = self.size
        if reserve_end:
            self._check_space(len(head) + len(data) + len(indexes) + CLOSING + len(self._end()))
        self._append(head, data, indexes)
        for number, rows, _ in parts:
            self._counts[number] += len(rows)
        self._indexed[Opcode.CHUNK_INDEX].append(
            ChunkIndex(
                chunk_length=_HEAD + length,
                chunk_start_offset=offset,
                compression=ZSTD.decode(),
                compressed_size=len(data),
                message_end_time=end,
                message_index_length=len(indexes),
                message_index_offsets=offsets,
                message_start_time=start,
                uncompressed_size=len(content),
            )
        )

    def finish(self) -> None:
        """Write end of data, summary and footer in one write, so that a full disk leaves the data intact."""
        self._append(self._end())

    def _end(self) -> bytes:
        """Return the bytes after the last record: end of data, summary, footer, magic."""
        chunks = self._indexed[Opcode.CHUNK_INDEX]
        statistics = Statistics(
            attachment_count=len(self._indexed[Opcode.ATTACHMENT_INDEX]),
            channel_count=len(self._indexed[Opcode.CHANNEL]),
            channel_message_counts=self._counts,
            chunk_count=len(chunks),
            message_count=sum(self._counts.values()),
            message_end_time=max((chunk.message_end_time for chunk in chunks), default=0),
            message_start_time=min((chunk.message_start_time for chunk in chunks), default=0),
            metadata_count=len(self._indexed[Opcode.METADATA_INDEX]),
            schema_count=len(self._indexed[Opcode.SCHEMA]),
        )
        data_end = _bytes(DataEnd(self._crc))
        start = self.size + len(data_end)
        summary, offsets = bytearray(), []
        for opcode, group in (self._indexed | {Opcode.STATISTICS: [statistics]}).items():
            content = _bytes(*group)
            if content:
                offsets.append(SummaryOffset(opcode, start + len(summary), len(content)))
            summary += content
        offset_start = start + len(summary)
        summary += _bytes(*offsets)
        footer = _bytes(Footer(start, offset_start, 0))
        crc = crc32(footer[:-4], crc32(summary))
        return data_end + summary + footer[:-4] + struct.pack("<I", crc) + MCAP0_MAGIC

    def close(self) -> None:
        """Close the file."""
        self._stream.close()

    def _interleaved(self, parts: Sequence[NDArray[np.uint8]], places: Sequence[NDArray[np.int64]]) -> memoryview:
        """Copy rows to their places in a reused buffer, because allocating memory costs more than the copy."""
        size = sum(part.size for part in parts)
        if size > len(self._room):
            self._room = np.empty(size, np.uint8)
        for rows, where in zip(parts, places, strict=True):
            items_at(self._room[:size], rows.shape[1])[where] = np.ascontiguousarray(rows).view(f"V{rows.shape[1]}")[
                :, 0
            ]
        return self._room[:size].data

    def _append(self, *parts: bytes | bytearray) -> None:
        """Write whole records, or none of them."""
        try:
            self._write(*parts)
        except OSError:
            self._cut_back()
            raise
        for part in parts:
            self.size += len(part)
            self._crc = crc32(part, self._crc)

    def _check_space(self, size: int) -> None:
        """Raise OSError if ``size`` bytes do not fit on the disk; only writing them shows it."""
        try:
            self._write(bytes(size))
        finally:
            self._cut_back()

    def _write(self, *parts: bytes | bytearray) -> None:
        for part in parts:
            rest = memoryview(part)
            while rest:
                rest = rest[self._stream.write(rest) :]

    def _cut_back(self) -> None:
        with suppress(OSError):  # else an incomplete record remains at the end of the file
            self._stream.truncate(self.size)
            self._stream.seek(self.size)


def _places_by_time(sizes: Sequence[int], times: Sequence[NDArray[np.uint64]]) -> list[NDArray[np.int64]]:
    """Return the places (m,), bytes, of the messages of each part if all are in order of time.

    ``sizes``: bytes of a message of each part; at equal times the order of the parts holds.
    """
    counts = [len(part) for part in times]
    order = np.argsort(np.concatenate(times), kind="stable")
    widths = np.repeat(np.array(sizes, np.int64), counts)
    places = np.empty(len(order), np.int64)
    places[order] = np.cumsum(widths[order]) - widths[order]
    return np.split(places, np.cumsum(counts)[:-1])


def _bytes(*records: McapRecord) -> bytes:
    builder = RecordBuilder()
    for record in records:
        record.write(builder)
    return builder.end()
