"""Reads a log, whole or cut off: every complete message as arrays, bit by bit what was recorded.

A log is walked from its beginning, record by record, so one that a killed run left without its end reads as
far as it goes; ``complete`` and ``faults`` say what is missing. Contents are checked against their CRCs as
they are read. Messages of a topic have a fixed size and are decoded by the thousand. ``read`` keeps what it has read;
``select``, ``ends`` and ``blocks`` go through the file and keep nothing, so that a long log needs no more memory.
"""

from __future__ import annotations

import difflib
import hashlib
import io
import json
import mmap
import os
import struct
import zlib
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from types import TracebackType
from typing import Any, NamedTuple

import numpy as np
import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import (
    Attachment,
    AttachmentIndex,
    Channel,
    Chunk,
    ChunkIndex,
    DataEnd,
    Footer,
    Metadata,
    MetadataIndex,
    Schema,
)
from mcap.writer import MCAP0_MAGIC
from numpy.typing import NDArray

from orchestrator.log import schema
from orchestrator.log.recorder import CLOSING, IDENTITY, MOST_STEPS, PREFIX

Floats = NDArray[np.float64]

HEAD = struct.Struct("<BQ")  # opcode and length before every record
KEEP = 256 << 20  # bytes of unpacked chunks that an open log keeps in memory
FOOTER = HEAD.size + 20 + len(MCAP0_MAGIC)  # bytes from the footer to the end of a file
_MESSAGE = struct.Struct("<BQH")
AROUND = 16 * mmap.PAGESIZE  # bytes that a system may map when one of them is touched
_SPAN = struct.Struct("<QQ")  # begins a chunk: first and last time in it, ns
EVER = (-np.inf, np.inf)
_DAMAGE = (
    McapError, zstandard.ZstdError, struct.error, ValueError, TypeError, LookupError, MemoryError, OverflowError,
    RecursionError,
)  # fmt: skip


class LogUnreadable(RuntimeError):
    """A log, or the part of it that was asked for, cannot be read; the message is one sentence."""


class NoSuchSignal(LookupError):
    """A log does not hold the topic or variable asked for; the message is one sentence."""

    def __str__(self) -> str:
        return str(self.args[0])


class Topic(NamedTuple):
    """What is recorded on a topic."""

    names: tuple[str, ...]  # variables, in the order of the values
    units: tuple[str, ...]
    every: int  # one step in ``every`` is recorded


class Series(NamedTuple):
    """The messages of a topic."""

    t: Floats  # (m,) s
    h: Floats  # (m,) s, communication step
    names: tuple[str, ...]
    values: Floats  # (m, variables)

    def rows(self, which: slice) -> Series:
        """Some of the messages."""
        return Series(self.t[which], self.h[which], self.names, self.values[which])

    def gap(self, start: float = 0.0) -> tuple[float, float] | None:
        """Beginning and end, s, of the first steps that are missing; of inputs, recorded from ``start`` on."""
        expected = np.append(start, self.t + self.h)[:-1]
        missing = np.flatnonzero(~(np.abs(self.t - expected) <= 1e-9))
        return (float(expected[missing[0]]), float(self.t[missing[0]])) if len(missing) else None


def _nothing(names: Sequence[str]) -> Series:
    return Series(np.empty(0), np.empty(0), tuple(names), np.empty((0, len(names))))


def joined(parts: Sequence[Series]) -> Series:
    """One after the other."""
    t, h, values = (np.concatenate([part[column] for part in parts]) for column in (0, 1, 3))
    return Series(t, h, parts[0].names, values)


class Messages(NamedTuple):
    """Message records of one topic in one chunk, as they stand in the file."""

    topic: str
    layout: schema.Layout
    rows: NDArray[np.uint8]  # (m, bytes)

    def decode(self) -> tuple[Floats, Floats, Floats]:
        """Return t (m,), h (m,), values (m, variables)."""
        return self.layout.unpack(self.rows, PREFIX)

    def digestible(self) -> memoryview:
        """The bytes that a topic's sha256 is made of: sequence, times and data."""
        return np.ascontiguousarray(self.rows[:, IDENTITY:]).data

    @property
    def sequence(self) -> NDArray[np.uint32]:
        """Number of the step (m,)."""
        return self._column(11, 15, "<u4")

    @property
    def log_time(self) -> NDArray[np.uint64]:
        """Simulation time (m,), ns."""
        return self._column(15, 23, "<u8")

    @property
    def publish_time(self) -> NDArray[np.uint64]:
        """The same once more (m,), ns."""
        return self._column(23, 31, "<u8")

    def _column(self, start: int, end: int, kind: str) -> NDArray:
        return np.ascontiguousarray(self.rows[:, start:end]).view(kind)[:, 0]


class Log:
    """A log opened for reading (a context manager).

    ``topics``, ``metadata`` (name -> key -> value) and ``attachments`` (names) are what was recorded before
    step 0; ``closing`` is the closing record with ``status``, ``message``, ``steps``, ``results``, ``warnings`` (dicts
    with component, text, time in s and count), and ``messages`` and ``sha256`` by topic, or None where the log was cut
    off; ``complete`` says whether closing record and
    indexes are there and the log could be walked without a fault, ``faults`` what is wrong, in sentences.

    :raises LogUnreadable: for a file that is missing or no log.
    """

    def __init__(self, path: str | os.PathLike[str]) -> None:
        self.path = Path(path)
        self._data = _open(self.path)
        self.size = len(self._data)
        self.faults: list[str] = []
        self.topics: dict[str, Topic] = {}
        self.metadata: dict[str, dict[str, str]] = {}
        self._chunks: list[int] = []  # offsets of chunk records
        self._spans: dict[int, tuple[float, float]] = {}  # offset of a chunk -> first and last time in it, s
        self._attachments: dict[str, int] = {}
        self._schemas: dict[int, Schema] = {}
        self._channels: dict[int, tuple[str, schema.Layout]] = {}
        self._series: dict[str, Series] = {}
        self._unpacked: dict[int, list[Messages]] = {}  # offset of a chunk -> its messages
        self._inside: dict[int, list[tuple[int, Sequence[int]]]] = {}  # offset of a chunk -> where messages are in it
        self._room = KEEP
        self._data_end: int | None = None  # offset of the record that ends the data
        self._ended = False
        self.closing: dict | None = None
        self._walk()
        self.complete = self.closing is not None and self._ended and not self.faults
        self._places: dict[str, tuple[str, int]] = {}
        for topic, about in self.topics.items():
            for column in range(len(about.names)):
                self._places.setdefault(self.name(topic, column), (topic, column))

    def __enter__(self) -> Log:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """Give the file back; arrays that were read stay."""
        self._unpacked.clear()
        self._data.close()

    @property
    def attachments(self) -> tuple[str, ...]:
        """Names of the attached files."""
        return tuple(self._attachments)

    @property
    def signals(self) -> tuple[str, ...]:
        """Every recorded variable as "instance.variable"."""
        return tuple(self._places)

    def attachment(self, name: str) -> bytes:
        """The content of an attached file; raises NoSuchSignal, LogUnreadable."""
        if name not in self._attachments:
            raise NoSuchSignal(f"{self.path} has no attachment '{name}'{_near(name, self._attachments)}")
        offset = self._attachments[name]
        body = self._body(offset)
        if zlib.crc32(body[:-4]) != int.from_bytes(body[-4:], "little"):
            raise LogUnreadable(f"{self.path}: the attachment '{name}' at byte {offset} is damaged")
        record = _parse(Attachment, body)
        return record.data

    def table(self, name: str) -> dict[str, Any]:
        """The JSON object in an attached file; raises NoSuchSignal, LogUnreadable."""
        content = self.attachment(name)
        try:
            found = json.loads(content)
            json.dumps(found, ensure_ascii=False).encode()  # half a surrogate pair is JSON, but no text
        except (ValueError, RecursionError) as damage:
            raise LogUnreadable(f"{self.path}: the attachment '{name}' is not readable JSON: {damage}") from None
        if not isinstance(found, dict):
            raise LogUnreadable(f"{self.path}: the attachment '{name}' is no JSON object")
        return found

    def read(self, topic: str) -> Series:
        """All messages of a topic; raises NoSuchSignal, LogUnreadable. Kept: do not write into the arrays."""
        names = self.topics[self.known_topic(topic)].names
        if topic not in self._series:
            decoded = [messages.decode() for messages in self._of(topic)]
            if decoded:
                t, h, values = (np.concatenate(columns) for columns in zip(*decoded, strict=True))
            else:
                t, h, values = np.empty(0), np.empty(0), np.empty((0, len(names)))
            self._series[topic] = Series(t, h, names, values)
        return self._series[topic]

    def select(self, wanted: Mapping[str, Sequence[int]], window: tuple[float, float] = EVER) -> dict[str, Series]:
        """Some columns of topics in a closed interval of time, s; raises NoSuchSignal, LogUnreadable."""
        found = {}
        for topic, columns in wanted.items():
            names = self.topics[self.known_topic(topic)].names
            found[topic] = [_nothing([names[column] for column in columns])]
        for messages in self._passing(wanted, self._chunks, window):
            columns, parts = wanted[messages.topic], found[messages.topic]
            t, h, values = messages.decode()
            inside = (t >= window[0] - 1e-9) & (t <= window[1] + 1e-9)
            parts.append(Series(t[inside], h[inside], parts[0].names, values[:, columns][inside]))
        return {topic: joined(parts) for topic, parts in found.items()}

    def ends(self, topic: str) -> Series:
        """The first and the last message of a topic; none where there is none. Raises NoSuchSignal, LogUnreadable."""
        names = self.topics[self.known_topic(topic)].names
        first, last = (
            next((messages.decode() for messages in self._passing([topic], chunks)), None)
            for chunks in (self._chunks, reversed(self._chunks))
        )
        if first is None or last is None:
            return _nothing(names)
        t, h, values = (np.stack([a[0], b[-1]]) for a, b in zip(first, last, strict=True))
        return Series(t, h, names, values)

    def blocks(self, topics: Sequence[str], size: int, more: int = 0) -> Iterator[dict[str, Series]]:
        """Topics side by side, ``size`` messages of each at a time and some ``more``, with which the next block begins.

        The last block holds what is left: fewer, or, of topics that do not end together, more of some. However a log
        lies in its file, its blocks are the same. Raises NoSuchSignal, LogUnreadable.
        """
        held = {topic: [_nothing(self.topics[self.known_topic(topic)].names)] for topic in topics}
        for offset in self._chunks:
            for messages in self._read(offset, keep=False):
                if messages.topic in held:
                    t, h, values = messages.decode()
                    held[messages.topic].append(Series(t, h, held[messages.topic][0].names, values))
            while min(sum(len(part.t) for part in parts) for parts in held.values()) >= size + max(more, 1):
                whole = {topic: joined(parts) for topic, parts in held.items()}
                yield {topic: series.rows(slice(size + more)) for topic, series in whole.items()}
                held = {topic: [series.rows(slice(size, None))] for topic, series in whole.items()}
        yield {topic: joined(parts) for topic, parts in held.items()}

    def lengths(self) -> dict[str, int]:
        """Number of messages by topic; raises LogUnreadable."""
        found = dict.fromkeys(self.topics, 0)
        for offset in self._chunks:
            for messages in self._read(offset, keep=False):
                found[messages.topic] += len(messages.rows)
        return found

    def sequence(self, topic: str) -> NDArray[np.uint32]:
        """Number of the step of every message of a topic (m,); raises LogUnreadable."""
        return np.concatenate([np.empty(0, np.uint32), *(messages.sequence for messages in self._of(topic))])

    def known_topic(self, topic: str) -> str:
        """The topic, if the log has it; raises NoSuchSignal."""
        if topic not in self.topics:
            raise NoSuchSignal(f"{self.path} has no topic '{topic}'{_near(topic, self.topics)}")
        return topic

    def name(self, topic: str, column: int) -> str:
        """The "instance.variable" in a column of a topic."""
        return f"{_owner(topic)}.{self.topics[topic].names[column]}"

    def find(self, signal: str) -> tuple[str, int]:
        """Topic and column of "instance.variable"; raises NoSuchSignal."""
        if signal not in self._places:
            raise NoSuchSignal(f"{self.path} has no signal '{signal}'{_near(signal, self._places)}")
        return self._places[signal]

    def signal(self, name: str) -> tuple[Floats, Floats]:
        """Time (m,), s, and value (m,) of "instance.variable"; raises NoSuchSignal, LogUnreadable."""
        topic, column = self.find(name)
        series = self.read(topic)
        return series.t, series.values[:, column]

    def unit(self, name: str) -> str:
        """The unit of "instance.variable"; raises NoSuchSignal."""
        topic, column = self.find(name)
        return self.topics[topic].units[column]

    def chunks(self) -> Iterator[list[Messages]]:
        """The log piece by piece, by topic, as recorded; raises LogUnreadable at a damaged piece."""
        for offset in self._chunks:
            yield self._read(offset)

    def intact(self) -> Iterator[list[Messages]]:
        """The log piece by piece without the damaged pieces, which go to ``faults``."""
        for offset in self._chunks:
            try:
                piece = self._read(offset)
            except LogUnreadable as damage:
                self._fault(str(damage))
            else:
                yield piece

    def hashes(self) -> dict[str, str]:
        """A sha256 by topic over sequence, times and data of its messages; raises LogUnreadable."""
        found = {topic: hashlib.sha256() for topic in self.topics}
        for piece in self.chunks():
            for messages in piece:
                found[messages.topic].update(messages.digestible())
        return {topic: value.hexdigest() for topic, value in found.items()}

    def digest(self) -> str:
        """One sha256 over names, units and messages of all topics but /stats: equal runs, equal digests."""
        whole = [
            [topic, *self.topics[topic], value]
            for topic, value in sorted(self.hashes().items())
            if not topic.startswith("/stats/")
        ]
        return hashlib.sha256(json.dumps(whole).encode()).hexdigest()

    def sound(self) -> bool:
        """Whether all bytes but the indexes at the end are as they were written."""
        if self._data_end is None:
            return False
        return _parse(DataEnd, self._body(self._data_end)).data_section_crc == self._crc(0, self._data_end)

    def checksums(self) -> list[str]:
        """Faults of attachments and of the checksums over all bytes, in sentences; chunks: see ``intact``."""
        found = []
        for name in self._attachments:
            try:
                self.attachment(name)
            except LogUnreadable as damage:
                found.append(str(damage))
        if self._data_end is not None and not self.sound():
            found.append(f"{self.path}: the checksum over all data does not hold")
        if self._ended:
            footer = _parse(Footer, self._body(self.size - FOOTER))
            if footer.summary_crc != self._crc(footer.summary_start, self.size - FOOTER + HEAD.size + 16):
                found.append(f"{self.path}: the checksum over the indexes does not hold")
        return found

    # ---- the file

    def _fault(self, sentence: str) -> None:
        if sentence not in self.faults:
            self.faults.append(sentence)

    def _body(self, offset: int) -> bytes:
        _, length = HEAD.unpack_from(self._data, offset)
        return self._data[offset + HEAD.size : offset + HEAD.size + length]

    def _crc(self, start: int, end: int) -> int:
        with memoryview(self._data) as whole, whole[start:end] as part:
            return zlib.crc32(part)

    def _walk(self) -> None:
        """Note where everything is; after a damaged record go on with the next one that is indexed."""
        offset = len(MCAP0_MAGIC)
        while offset < self.size:
            following = self._step(offset)
            if following is None:
                following = next((indexed for indexed in self._indexed() if indexed > offset), self.size)
                self._fault(f"{self.path}: the record at byte {offset} of {self.size} is cut off or damaged")
            offset = following
        if self._data_end is None:
            self._fault(f"{self.path}: the log was cut off at byte {self.size}")
        elif not self._ended:
            self._fault(f"{self.path}: the end of the file is missing or damaged")

    def _step(self, offset: int) -> int | None:
        """Note the record at ``offset``; the offset of the next one, or None where this one is no good."""
        if offset + HEAD.size > self.size:
            return None
        opcode, length = HEAD.unpack_from(self._data, offset)
        following = offset + HEAD.size + length
        if following > self.size or not Opcode.HEADER <= opcode <= Opcode.DATA_END:
            return None
        if opcode == Opcode.CHUNK:
            self._chunks.append(offset)
            self._spans[offset] = self._span(offset)
            self._let_go(offset)
        elif opcode == Opcode.DATA_END and length == 4:
            self._data_end = offset
        elif opcode == Opcode.FOOTER and length == 20:
            self._ended = following + len(MCAP0_MAGIC) == self.size and self._data[following:] == MCAP0_MAGIC
            return self.size if self._ended else None
        elif opcode in (Opcode.ATTACHMENT, Opcode.METADATA, Opcode.SCHEMA, Opcode.CHANNEL):
            try:
                self._note(opcode, offset)
            except _DAMAGE:
                return None
        return following

    def _note(self, opcode: int, offset: int) -> None:
        body = self._body(offset)
        if opcode == Opcode.ATTACHMENT:
            self._attachments[_parse(Attachment, body).name] = offset
        elif opcode == Opcode.METADATA:
            record = _parse(Metadata, body)
            if record.name == CLOSING:
                self.closing = _closing(record.metadata)
            else:
                self.metadata[record.name] = record.metadata
        elif opcode == Opcode.SCHEMA:
            described = _parse(Schema, body)
            self._schemas[described.id] = described
        elif opcode == Opcode.CHANNEL:
            self._note_channel(_parse(Channel, body))

    def _note_channel(self, channel: Channel) -> None:
        """A topic and how its messages are laid out; one that was not recorded by recorder.py is left out."""
        if channel.id in self._channels or "places" not in channel.metadata:
            return
        about = channel.metadata
        names, units, where = (_texts(about[key]) for key in ("names", "units", "places"))
        if not len(names) == len(set(names)) == len(units) == len(where):
            raise ValueError("names, units and places do not belong together")
        described = Topic(names, units, int(about["every"]))
        if not 1 <= described.every <= MOST_STEPS:
            raise ValueError(f"a topic is not recorded every {described.every} steps")
        if self.topics.get(channel.topic, described) != described:
            raise ValueError(f"{channel.topic} is described twice, not alike")
        laid_out = schema.layout(where)
        if not schema.describes(self._schemas[channel.schema_id].data, laid_out.fields):
            raise ValueError("schema and places differ")
        self.topics[channel.topic] = described
        self._channels[channel.id] = channel.topic, laid_out

    def _indexed(self) -> list[int]:
        """Offsets of the records that the summary at the end knows; empty where there is none."""
        found = []
        try:
            footer = _parse(Footer, self._body(self.size - FOOTER))
            offset = footer.summary_start
            found.append(offset - HEAD.size - 4)  # end of data
            while offset < self.size - FOOTER:
                opcode, length = HEAD.unpack_from(self._data, offset)
                if opcode == Opcode.CHUNK_INDEX:
                    found.append(_parse(ChunkIndex, self._body(offset)).chunk_start_offset)
                elif opcode == Opcode.ATTACHMENT_INDEX:
                    found.append(_parse(AttachmentIndex, self._body(offset)).offset)
                elif opcode == Opcode.METADATA_INDEX:
                    found.append(_parse(MetadataIndex, self._body(offset)).offset)
                offset += HEAD.size + length
        except _DAMAGE:
            return []
        return sorted(found)

    # ---- messages

    def _of(self, topic: str) -> Iterator[Messages]:
        return (messages for piece in self.chunks() for messages in piece if messages.topic == topic)

    def _passing(
        self, topics: Collection[str], chunks: Iterable[int], window: tuple[float, float] = EVER
    ) -> Iterator[Messages]:
        """The messages of topics in the chunks at these offsets that have any of a time in the window, s; not kept."""
        for offset in chunks:
            first, last = self._spans[offset]
            if first <= window[1] + 1e-6 and last >= window[0] - 1e-6:
                yield from (messages for messages in self._read(offset, keep=False) if messages.topic in topics)

    def _read(self, offset: int, keep: bool = True) -> list[Messages]:
        """The message records of a chunk by channel; raises LogUnreadable."""
        if offset in self._unpacked:
            return self._unpacked[offset]
        try:
            content = _content(_parse(Chunk, self._body(offset)))
            if offset not in self._inside:
                found = _message_offsets(content)
                self._inside[offset] = [self._together(content, *at) for at in found.items() if at[0] in self._channels]
            piece = [self._messages(content, *at) for at in self._inside[offset]]
        except _DAMAGE as damage:
            raise LogUnreadable(
                f"{self.path}: the chunk at byte {offset} is damaged ({damage}); 'log recover' saves the rest"
            ) from None
        if not keep:
            self._let_go(offset)
        elif len(content) <= self._room:  # a log is read topic by topic, a chunk unpacked once
            self._room -= len(content)
            self._unpacked[offset] = piece
        return piece

    def _span(self, offset: int) -> tuple[float, float]:
        """First and last time in a chunk, s, as it says itself."""
        begins = self._data[offset + HEAD.size : offset + HEAD.size + _SPAN.size]
        first, last = _SPAN.unpack(begins.ljust(_SPAN.size, b"\0"))
        return 1e-9 * first, 1e-9 * last

    def _let_go(self, offset: int) -> None:
        """Of the file's pages that hold the record at ``offset``: what is mapped counts as memory."""
        if hasattr(mmap, "MADV_DONTNEED"):
            start = max(0, offset - offset % AROUND - AROUND)  # what was touched since the chunk before it, too
            _, length = HEAD.unpack_from(self._data, offset)
            self._data.madvise(mmap.MADV_DONTNEED, start, offset + HEAD.size + length - start)

    def _together(self, content: bytes, number: int, offsets: list[int]) -> tuple[int, Sequence[int]]:
        """A channel and where its messages are; where they stand together, in no more room than a range takes."""
        topic, layout = self._channels[number]
        size = PREFIX + len(layout.template)
        if any(HEAD.unpack_from(content, offset)[1] != size - HEAD.size for offset in offsets):
            raise ValueError(f"a message of {topic} does not have {size} bytes")
        together = offsets[-1] - offsets[0] == size * (len(offsets) - 1)
        return number, range(offsets[0], offsets[-1] + 1, size) if together else offsets

    def _messages(self, content: bytes, number: int, offsets: Sequence[int]) -> Messages:
        topic, layout = self._channels[number]
        size = PREFIX + len(layout.template)
        if isinstance(offsets, range):
            rows = np.frombuffer(content, np.uint8, size * len(offsets), offsets[0])
        else:
            rows = np.frombuffer(b"".join(content[offset : offset + size] for offset in offsets), np.uint8)
        return Messages(topic, layout, rows.reshape(-1, size))


def _open(path: Path) -> mmap.mmap:
    try:
        with path.open("rb") as stream:
            size = os.fstat(stream.fileno()).st_size
            if size < len(MCAP0_MAGIC) or stream.read(len(MCAP0_MAGIC)) != MCAP0_MAGIC:
                raise LogUnreadable(f"{path} is not a log: it does not begin as an MCAP file does")
            return mmap.mmap(stream.fileno(), 0, access=mmap.ACCESS_READ)
    except OSError as error:
        reason = error.strerror or str(error)
        raise LogUnreadable(f"the log {path} cannot be read: {reason[:1].lower()}{reason[1:]}") from None


def _parse(kind: Any, body: bytes) -> Any:
    """The record of a class of mcap.records; raises one of _DAMAGE."""
    return kind.read(ReadDataStream(io.BytesIO(body)))


def _content(chunk: Chunk) -> bytes:
    """The uncompressed records of a chunk, checked; raises one of _DAMAGE."""
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


def _texts(text: str) -> tuple[str, ...]:
    """A JSON list of texts; raises one of _DAMAGE."""
    found = json.loads(text)
    if not isinstance(found, list) or not all(isinstance(each, str) for each in found):
        raise ValueError("not a list of texts")
    "".join(found).encode()  # half a surrogate pair is JSON, but no text
    return tuple(found)


def _message_offsets(content: bytes) -> dict[int, list[int]]:
    """Offsets of the messages by channel number."""
    found: dict[int, list[int]] = {}
    offset, end = 0, len(content)
    while offset < end:
        opcode, length, channel = _MESSAGE.unpack_from(content, offset)
        if opcode == Opcode.MESSAGE:
            found.setdefault(channel, []).append(offset)
        offset += HEAD.size + length
    if offset != end:
        raise ValueError("its last message is cut off")
    return found


def _closing(record: Mapping[str, str]) -> dict:
    """The closing record with numbers as numbers and the entries by topic in dicts of their own."""
    by_topic = {
        kind: {key.partition(":")[2]: value for key, value in record.items() if key.startswith(f"{kind}:")}
        for kind in ("messages", "sha256", "result")
    }
    return {
        "status": record.get("status", ""),
        "message": record.get("message", ""),
        "steps": int(record.get("steps", 0)),
        "messages": {topic: int(value) for topic, value in by_topic["messages"].items()},
        "sha256": by_topic["sha256"],
        "results": by_topic["result"],
        "warnings": _warnings(record.get("warnings", "[]")),
    }


def _warnings(text: str) -> list[dict[str, Any]]:
    """What components warned of (``warned.Warned``), as recorded; raises one of _DAMAGE."""
    kinds = {"component": str, "text": str, "time": float, "count": int}
    found = json.loads(text)
    if not isinstance(found, list):
        raise ValueError("warnings are no list")
    for each in found:
        if not isinstance(each, dict) or {key: type(value) for key, value in each.items()} != kinds:
            raise ValueError("a warning is not told as one")
        if not 0 < each["count"] <= MOST_STEPS:
            raise ValueError("a warning was not told so often")
        f"{each['component']}{each['text']}".encode()  # half a surrogate pair is JSON, but no text
    return found


def _owner(topic: str) -> str:
    """The instance of a topic; statistics stand apart: "/stats/chassis" -> "stats.chassis"."""
    words = topic.strip("/").split("/")
    return f"stats.{words[1]}" if words[0] == "stats" and len(words) > 1 else words[0]


def _near(name: str, known: Mapping[str, object]) -> str:
    close = difflib.get_close_matches(name, known, 1, 0.0 if len(known) < 4 else 0.6)
    return f"; did you mean '{close[0]}'?" if close else ""
