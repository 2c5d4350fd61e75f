"""Writes a log: one MCAP file with one protobuf message per topic and step, safe against being killed.

``Recorder.write`` copies the values into a block and returns; a thread packs whole blocks into messages,
compresses them into chunks of about 1 MiB and writes these at least four times a second of wall time, so a
killed run loses no more than that. In a chunk the messages of a topic stand together. Time in the file is
simulation time, and what depends on the wall clock goes to ``/stats/<instance>`` only: two equal runs write
equal messages. The last record, the metadata ``closing``, says how the run ended and holds a sha256 per
topic; a log without it was cut off.

MCAP is written here record by record (https://mcap.dev/spec) rather than with ``mcap.writer``, which costs 3
to 16 us a message on the caller's thread and cannot go on after a full disk.
"""

from __future__ import annotations

import hashlib
import json
import mimetypes
import os
import struct
import threading
import zlib
from collections import deque
from collections.abc import Mapping, Sequence
from contextlib import nullcontext, suppress
from pathlib import Path
from types import TracebackType
from typing import IO, NamedTuple

import numpy as np
import zstandard
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import (
    Attachment,
    AttachmentIndex,
    Channel,
    Chunk,
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

from orchestrator.log import schema

try:
    import fcntl
except ImportError:  # Windows does not let go of open files in any case
    fcntl = None  # type: ignore[assignment]

CHUNK = 1 << 20  # bytes of messages that make a chunk
BACKLOG = 4  # chunks that may wait for the disk before the run waits too
CLOSING = "closing"  # name of the metadata record that ends a log
COMPRESSION_LEVEL = 1  # of zstandard
MOST_STEPS = 2**32 - 1  # a message counts them in 32 bits
LONGEST = 2**64 / 1e9  # s: a message counts nanoseconds in 64 bits
PREFIX = 31  # bytes of a message record before its data: opcode, length, channel, sequence, two times
IDENTITY = 11  # bytes of it that depend on the file: opcode, length, channel; the rest is in the digest


class LogFailed(RuntimeError):
    """The log cannot be written; the message is one sentence."""


class Recorder:
    """An open log; closes itself when left, with status "failed" unless ``close`` was called before.

    :param path: the file; its folder is made, an older log is replaced, any other file is refused.
    :param topics: topic -> (variable, unit) in the order of the arrays handed to ``write``. By convention
        "/<instance>/in", "/<instance>/out", "/<instance>/links" and "/stats/<instance>".
    :param attachments: name -> content of the files that belong to the run.
    :param metadata: name -> key -> value, all text.
    :param every: topic -> n: only steps whose number is a multiple of n are recorded (default 1).
    :param flush: longest time that a message waits for the disk, s of wall time.
    :raises LogFailed: here and in ``write`` and ``close``, when the file cannot be written.
    :raises ValueError: for topics that no message can be made of.
    """

    def __init__(
        self,
        path: str | os.PathLike[str],
        topics: Mapping[str, Sequence[tuple[str, str]]],
        attachments: Mapping[str, bytes],
        metadata: Mapping[str, Mapping[str, str]],
        *,
        every: Mapping[str, int] | None = None,
        flush: float = 0.25,
    ) -> None:
        self.path = Path(path)
        strides = {topic: 1 for topic in topics} | dict(every or {})
        self._channels = {
            topic: _Channel(number, topic, variables, strides[topic])
            for number, (topic, variables) in enumerate(topics.items(), 1)
        }
        self._pages = {topic: _Page([channel]) for topic, channel in self._channels.items()}
        self._turn = threading.Condition()
        self._backlog: deque[list[_Filled]] = deque()
        self._bytes = 0  # of messages in the blocks
        self._last = 0  # newest sequence written
        self._closing = self._closed = False
        self._failure: LogFailed | None = None
        self._flush = flush
        try:
            check_writable(self.path)
            self.path.parent.mkdir(parents=True, exist_ok=True)
            if self.path.is_file():  # a reader that has the older file open keeps it
                self.path.unlink()
            self._file = _File(self.path)
        except OSError as error:
            raise _failed(self.path, error) from None
        try:
            self._begin(topics, attachments, metadata)
        except OSError as error:
            self._file.close()
            raise _failed(self.path, error) from None
        self._thread = threading.Thread(target=self._drain, name="recorder", daemon=True)
        self._thread.start()

    def __enter__(self) -> Recorder:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if not self._closed:
            message = str(error) or (kind.__name__ if kind else "the run ended without saying how")
            with suppress(LogFailed) if error else nullcontext():  # the first error is the one to hear of
                self.close("failed", message, self._last)

    @property
    def size(self) -> int:
        """Bytes in the file so far."""
        return self._file.size

    def together(self, topics: Sequence[str]) -> str:
        """Let topics recorded at the same steps be written by one ``write``, under the name that is returned."""
        channels = [self._channels[topic] for topic in topics]
        if len({channel.every for channel in channels}) > 1:
            raise ValueError(f"{', '.join(topics)} are not recorded at the same steps")
        name = " ".join(topics)
        self._pages = {topic: page for topic, page in self._pages.items() if topic not in topics}
        self._pages[name] = _Page(channels)
        return name

    def due(self, topic: str, sequence: int) -> bool:
        """Whether ``write`` would record this step: what is not due need not be fetched."""
        return sequence % self._pages[topic].every == 0

    def write(self, topic: str, sequence: int, t: float, h: float, *values: NDArray[np.float64]) -> None:
        """Record a topic's values at time t (s, 0 to LONGEST) of step ``sequence``, h (s) being the step's length.

        Of topics that are written ``together`` the values of each, in their order. ``values`` are copied. A step that
        is not due is left out. Waits only when the disk is far behind.
        """
        page = self._pages[topic]
        if sequence % page.every:
            return
        for channel, part in zip(page.channels, values, strict=True):
            if len(part) != channel.width:
                raise ValueError(f"{channel.topic} has {channel.width} variables, not {len(part)}")
        if not 0.0 <= t < LONGEST:
            raise ValueError(f"{topic} cannot be recorded at t = {t} s: a log begins at 0 and ends by {LONGEST:g}")
        with self._turn:
            if self._failure is not None:
                raise self._failure
            if self._closing:
                raise ValueError(f"the log {self.path} is closed")
            block = page.block
            row = block.count
            block.sequence[row] = sequence
            block.t[row] = t
            block.h[row] = h
            np.concatenate(values, out=block.values[row])
            block.count = row + 1
            self._last = sequence
            self._bytes += page.size
            if self._bytes >= CHUNK or block.count == page.capacity:
                self._hand_over()
                while len(self._backlog) > BACKLOG and self._failure is None:
                    self._turn.wait()

    def stats(self, instance: str, sequence: int, t: float, h: float, values: NDArray[np.float64]) -> None:
        """Record what depends on the wall clock: the topic "/stats/<instance>", which no digest counts."""
        self.write(f"/stats/{instance}", sequence, t, h, values)

    def end(self) -> None:
        """Write what is left of the messages: now the file can be read, and lacks only its closing record."""
        known = self._failure
        with self._turn:
            self._closing = True
            self._turn.notify_all()
        self._thread.join()
        if self._failure is not None and self._failure is not known:
            raise self._failure

    def close(
        self,
        status: str,
        message: str,
        steps: int,
        results: Mapping[str, str] | None = None,
        warnings: Sequence[Mapping[str, object]] = (),
    ) -> None:
        """Write what is left, the closing record and the indexes; a second call does nothing.

        ``results`` (text by name) and ``warnings`` (``warned.Warned`` as dicts) go into the closing record. After a
        failure that was raised before, what can still be written is written and nothing is raised.
        """
        if self._closed:
            return
        known = self._failure
        with suppress(LogFailed):
            self.end()
        self._closed = True
        if self._failure is not None:
            status, message = "failed", message or str(self._failure)
        try:
            record = self._closing_record(status, message, steps)
            record |= {f"result:{name}": text for name, text in (results or {}).items()}
            record["warnings"] = json.dumps(list(warnings))
            self._file.metadata(CLOSING, record)
            self._file.finish()
        except OSError as error:
            self._failure = self._failure or _failed(self.path, error)
        finally:
            self._file.close()
        if self._failure is not None and self._failure is not known:
            raise self._failure

    def _begin(
        self,
        topics: Mapping[str, Sequence[tuple[str, str]]],
        attachments: Mapping[str, bytes],
        metadata: Mapping[str, Mapping[str, str]],
    ) -> None:
        """Everything that stands before step 0."""
        for name, entries in metadata.items():
            self._file.metadata(name, entries)
        for name, content in attachments.items():
            self._file.attachment(name, content)
        for topic, channel in self._channels.items():
            names = [name for name, _ in topics[topic]]
            kind = schema.type_name(topic)
            about = {
                "names": json.dumps(names),
                "units": json.dumps([unit for _, unit in topics[topic]]),
                "places": json.dumps(schema.places(names)),
                "every": str(channel.every),
            }
            self._file.channel(channel.number, topic, kind, schema.descriptor(kind, channel.layout.fields), about)

    def _closing_record(self, status: str, message: str, steps: int) -> dict[str, str]:
        record = {"status": status, "message": message, "steps": str(steps)}
        for topic, channel in self._channels.items():
            record[f"messages:{topic}"] = str(channel.messages)
            record[f"sha256:{topic}"] = channel.hash.hexdigest()
        return record

    def _hand_over(self) -> None:
        """Queue the filled blocks as one chunk and go on with empty ones; the caller holds the lock."""
        filled: list[_Filled] = []
        for page in self._pages.values():
            if page.block.count:
                filled += page.turn()
        if filled:
            self._backlog.append(sorted(filled, key=lambda each: each.channel.number))
        self._bytes = 0
        self._turn.notify_all()

    def _drain(self) -> None:
        """The thread: write chunks as they come, and what there is when none comes for a while."""
        while True:
            with self._turn:
                self._turn.wait_for(lambda: self._backlog or self._closing, timeout=self._flush)
                if not self._backlog:
                    self._hand_over()
                if not self._backlog:
                    if self._closing:
                        return
                    continue
                filled = self._backlog.popleft()
            try:
                self._write_chunk(filled)
            except Exception as error:  # whatever it is, the run must hear of it
                with self._turn:
                    self._failure = _failed(self.path, error)
                    self._backlog.clear()
                    self._turn.notify_all()
                return
            with self._turn:
                self._turn.notify_all()

    def _write_chunk(self, filled: Sequence[_Filled]) -> None:
        packed = [each.channel.pack(each.block, each.columns) for each in filled]
        self._file.chunk(
            [(each.channel.number, rows, times) for each, (rows, times) in zip(filled, packed, strict=True)]
        )
        for each, (rows, _) in zip(filled, packed, strict=True):  # only what is in the file counts
            each.channel.hash.update(np.ascontiguousarray(rows[:, IDENTITY:]).data)
            each.channel.messages += len(rows)


class _Block:
    """The messages of one topic, or of topics written together, that wait for the thread."""

    def __init__(self, capacity: int, width: int) -> None:
        self.sequence = np.empty(capacity, "<u4")
        self.t = np.empty(capacity)
        self.h = np.empty(capacity)
        self.values = np.empty((capacity, width))
        self.count = 0


class _Channel:
    """One topic: its layout and its hash."""

    def __init__(self, number: int, topic: str, variables: Sequence[tuple[str, str]], every: int) -> None:
        if every < 1:
            raise ValueError(f"a topic is recorded every n >= 1 steps, not every {every}")
        self.number = number
        self.topic = topic
        self.every = every
        self.width = len(variables)
        self.layout = schema.layout(schema.places([name for name, _ in variables]))
        self.size = PREFIX + len(self.layout.template)  # bytes of a message record
        self.hash = hashlib.sha256()
        self.messages = 0
        self._prefix = struct.pack("<BQHIQQ", Opcode.MESSAGE, self.size - 9, number, 0, 0, 0)

    def pack(self, block: _Block, columns: slice) -> tuple[NDArray[np.uint8], NDArray[np.uint64]]:
        """Message records (m, size), and their times in ns, of the topic's columns of a block."""
        m = block.count
        t = block.t[:m]
        times = np.rint(t * 1e9).astype("<u8")
        rows = np.empty((m, self.size), np.uint8)
        rows[:, :PREFIX] = np.frombuffer(self._prefix, np.uint8)
        rows[:, 11:15] = block.sequence[:m].view(np.uint8).reshape(m, 4)
        rows[:, 15:23] = rows[:, 23:31] = times.view(np.uint8).reshape(m, 8)
        self.layout.pack(rows, PREFIX, t, block.h[:m], block.values[:m, columns])
        return rows, times


class _Filled(NamedTuple):
    """A topic's part of a block that is full enough to be written."""

    channel: _Channel
    block: _Block
    columns: slice


class _Page:
    """Topics that are written together: a row of its block holds the values of all."""

    def __init__(self, channels: Sequence[_Channel]) -> None:
        self.channels = tuple(channels)
        self.every = channels[0].every
        self.size = sum(channel.size for channel in channels)  # bytes of a row's message records
        self.capacity = CHUNK // self.size + 1
        self._ends = np.cumsum([channel.width for channel in channels]).tolist()
        self.block = self._blank()

    def _blank(self) -> _Block:
        return _Block(self.capacity, self._ends[-1])

    def turn(self) -> list[_Filled]:
        """The filled block by topic; a blank one takes its place."""
        filled, self.block = self.block, self._blank()
        return [
            _Filled(channel, filled, slice(end - channel.width, end))
            for channel, end in zip(self.channels, self._ends, strict=True)
        ]


class _File:
    """An MCAP file being written. A record that does not fit on the disk is taken back whole."""

    def __init__(self, path: Path) -> None:
        self.size = 0
        self._crc = 0  # of all bytes so far
        self._stream = path.open("wb" if path.exists() else "xb", buffering=0)  # exists: a device
        _lock(self._stream)
        self._compressor = zstandard.ZstdCompressor(COMPRESSION_LEVEL)
        self._schemas: list[Schema] = []
        self._channels: list[Channel] = []
        self._chunks: list[ChunkIndex] = []
        self._attachments: list[AttachmentIndex] = []
        self._metadata: list[MetadataIndex] = []
        self._counts: dict[int, int] = {}
        try:
            self._append(MCAP0_MAGIC + _bytes(Header(profile="", library="cotrack")))
        except OSError:
            self.close()
            raise

    def metadata(self, name: str, entries: Mapping[str, str]) -> None:
        offset = self.size
        self._append(_bytes(Metadata(name, dict(entries))))
        self._metadata.append(MetadataIndex(offset=offset, length=self.size - offset, name=name))

    def attachment(self, name: str, content: bytes) -> None:
        kind = mimetypes.guess_type(name)[0] or "application/octet-stream"
        record = Attachment(create_time=0, log_time=0, name=name, media_type=kind, data=content)
        offset = self.size
        self._append(_bytes(record))
        index = AttachmentIndex(offset, self.size - offset, 0, 0, len(content), name, kind)
        self._attachments.append(index)

    def channel(self, number: int, topic: str, kind: str, description: bytes, about: dict[str, str]) -> None:
        described = Schema(number, description, SchemaEncoding.Protobuf, kind)
        channel = Channel(number, topic, MessageEncoding.Protobuf, about, schema_id=number)
        self._append(_bytes(described, channel))
        self._schemas.append(described)
        self._channels.append(channel)
        self._counts[number] = 0

    def chunk(self, parts: Sequence[tuple[int, NDArray[np.uint8], NDArray[np.uint64]]]) -> None:
        """Write message records (m, size) with their times (ns), by channel number, as one chunk."""
        content = b"".join(rows.data for _, rows, _ in parts)
        start = min(int(times.min()) for _, _, times in parts)
        end = max(int(times.max()) for _, _, times in parts)
        record = Chunk(
            compression="zstd",
            data=self._compressor.compress(content),
            message_end_time=end,
            message_start_time=start,
            uncompressed_crc=zlib.crc32(content),
            uncompressed_size=len(content),
        )
        head = _bytes(record)
        indexes, offsets, within = bytearray(), {}, 0
        for number, rows, times in parts:
            offsets[number] = self.size + len(head) + len(indexes)
            entries = np.empty((len(rows), 2), "<u8")
            entries[:, 0] = times
            entries[:, 1] = within + rows.shape[1] * np.arange(len(rows), dtype=np.uint64)
            within += rows.size
            indexes += struct.pack("<BQHI", Opcode.MESSAGE_INDEX, 6 + entries.nbytes, number, entries.nbytes)
            indexes += entries.tobytes()
        offset = self.size
        self._append(head + indexes)
        for number, rows, _ in parts:
            self._counts[number] += len(rows)
        self._chunks.append(
            ChunkIndex(
                chunk_length=len(head),
                chunk_start_offset=offset,
                compression=record.compression,
                compressed_size=len(record.data),
                message_end_time=end,
                message_index_length=len(indexes),
                message_index_offsets=offsets,
                message_start_time=start,
                uncompressed_size=record.uncompressed_size,
            )
        )

    def finish(self) -> None:
        """End of data, summary, footer: one write, so that a full disk leaves the data as they are."""
        statistics = Statistics(
            attachment_count=len(self._attachments),
            channel_count=len(self._channels),
            channel_message_counts=self._counts,
            chunk_count=len(self._chunks),
            message_count=sum(self._counts.values()),
            message_end_time=max((chunk.message_end_time for chunk in self._chunks), default=0),
            message_start_time=min((chunk.message_start_time for chunk in self._chunks), default=0),
            metadata_count=len(self._metadata),
            schema_count=len(self._schemas),
        )
        data_end = _bytes(DataEnd(self._crc))
        start = self.size + len(data_end)
        summary, offsets = bytearray(), []
        for opcode, group in (
            (Opcode.SCHEMA, self._schemas),
            (Opcode.CHANNEL, self._channels),
            (Opcode.STATISTICS, [statistics]),
            (Opcode.CHUNK_INDEX, self._chunks),
            (Opcode.ATTACHMENT_INDEX, self._attachments),
            (Opcode.METADATA_INDEX, self._metadata),
        ):
            content = _bytes(*group)
            if content:
                offsets.append(SummaryOffset(opcode, start + len(summary), len(content)))
            summary += content
        offset_start = start + len(summary)
        summary += _bytes(*offsets)
        footer = _bytes(Footer(start, offset_start, 0))
        crc = zlib.crc32(footer[:-4], zlib.crc32(summary))
        self._append(data_end + summary + footer[:-4] + struct.pack("<I", crc) + MCAP0_MAGIC)

    def close(self) -> None:
        self._stream.close()

    def _append(self, data: bytes | bytearray) -> None:
        """Write whole records, or none of them."""
        rest = memoryview(data)
        try:
            while rest:
                rest = rest[self._stream.write(rest) :]
        except OSError:
            with suppress(OSError):  # what cannot be cut back stays behind as a cut record
                self._stream.truncate(self.size)
                self._stream.seek(self.size)
            raise
        self.size += len(data)
        self._crc = zlib.crc32(data, self._crc)


def check_writable(path: Path) -> None:
    """Whether a log can be written there, as far as can be said now; raises LogFailed."""
    reason = ""
    if path.is_dir():
        reason = "it is a directory"
    elif path.is_file():
        try:
            with path.open("rb") as stream:
                if not MCAP0_MAGIC.startswith(stream.read(len(MCAP0_MAGIC))):
                    reason = "there is a file that is no log"
                elif not _lock(stream):
                    reason = "another run is writing it"
        except OSError as error:
            raise _failed(path, error) from None
    elif not path.exists():
        above = next(folder for folder in path.absolute().parents if folder.exists())
        if not above.is_dir():
            reason = f"{above} is no folder"
        elif not os.access(above, os.W_OK):
            reason = f"the folder {above} is read-only"
    if reason:
        raise LogFailed(f"the log {path} cannot be written: {reason}")


def _lock(stream: IO[bytes]) -> bool:
    """Take the file for oneself until it is closed; False: someone else has it."""
    if fcntl is not None:
        try:
            fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            return False
        except OSError:  # a file system without locks
            pass
    return True


def _bytes(*records: McapRecord) -> bytes:
    builder = RecordBuilder()
    for record in records:
        record.write(builder)
    return builder.end()


def _failed(path: Path, error: Exception) -> LogFailed:
    reason = (error.strerror or str(error)) if isinstance(error, OSError) else f"{type(error).__name__}: {error}"
    return LogFailed(f"the log {path} cannot be written: {reason[:1].lower()}{reason[1:]}")
