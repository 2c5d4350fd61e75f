"""MCAP file of a log, open for reading: what it holds, by the summary at its end or record by record, and its messages.

The summary is used if it is there and its checksum and counts hold; opening a large log then reads little of it. A file
without its end is read up to the last whole record. After a damaged record the walk continues with the next one in the
indexes at the end, if there are any. ``faults`` lists what is missing.

Records are those of ``mcap``. Its readers decode one message after another, in 2.4 to 3.5 times the processor time of
the arrays here, and take whatever a file of others claims to hold.
"""

from __future__ import annotations

import io
import mmap
import struct
from bisect import bisect_right
from collections import Counter
from collections.abc import Callable, Collection, Iterator, Mapping
from functools import cached_property
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
import zstandard
from isal.isal_zlib import crc32
from lz4.frame import LZ4FrameDecompressor
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import (
    Attachment,
    AttachmentIndex,
    Channel,
    ChunkIndex,
    DataEnd,
    Footer,
    Header,
    Metadata,
    MetadataIndex,
    Schema,
    Statistics,
)
from mcap.writer import MCAP0_MAGIC
from numpy.typing import NDArray

from orchestrator.files.budget import AT_ONCE, OverBudget, UnpackedBudget, most_others, most_records, open_file
from orchestrator.log import log_metadata, seal
from orchestrator.log.container_writer import LIBRARY
from orchestrator.log.log_file import being_written, error_text
from orchestrator.log.message_records import LOG_TIME, Messages, record_places, records_by_channel, size_of
from orchestrator.log.time_series import Topic

HEAD = struct.Struct("<BQ")  # opcode and length before every record
FOOTER = HEAD.size + 20 + len(MCAP0_MAGIC)  # bytes from the footer to the end of a file
DATA_END = HEAD.size + 4  # bytes of the record that ends the data
_INDEX = struct.Struct("<HI")  # begins a message index: channel, bytes of its entries
_CHUNK, _LENGTH = struct.Struct("<QQQII"), struct.Struct("<Q")  # times, size, checksum, length of compression name
PIECE = 1 << 22  # bytes per update of a checksum
COUNTED = {  # records of the summary and their number in the statistics
    Opcode.SCHEMA: "schema_count", Opcode.CHANNEL: "channel_count", Opcode.CHUNK_INDEX: "chunk_count",
    Opcode.ATTACHMENT_INDEX: "attachment_count", Opcode.METADATA_INDEX: "metadata_count",
}  # fmt: skip
INDEXES: dict[int, tuple[Any, str]] = {  # index records of the summary and their field with an offset
    Opcode.CHUNK_INDEX: (ChunkIndex, "chunk_start_offset"),
    Opcode.ATTACHMENT_INDEX: (AttachmentIndex, "offset"),
    Opcode.METADATA_INDEX: (MetadataIndex, "offset"),
}
OF_CHUNKS = (Opcode.CHUNK, Opcode.MESSAGE_INDEX, Opcode.CHUNK_INDEX)
LOOSE = 1 << 20  # bytes of messages outside chunks that are read at once
KEPT = 192 << 20  # bytes of unpacked chunks that an open log keeps in memory: a report passes over it eighty times
BESIDE_A_RUN = 8 << 20  # the same in a process that holds components too
MAX_FAULTS = 100
DAMAGE = (
    McapError, zstandard.ZstdError, struct.error, ValueError, TypeError, LookupError, MemoryError, OverflowError,
    RecursionError,
)  # fmt: skip


class LogUnreadable(RuntimeError):
    """A log, or the requested part of it, cannot be read; the message is one sentence."""


class ForeignLog(LogUnreadable):
    """An MCAP file of other software, which serves as measured data (``bags``)."""


class Container:
    """Open MCAP file: topics, metadata, closing record, places of attachments and chunks.

    ``spans``: offset of each chunk -> first and last time in it, s. ``unpacked``: offset -> messages, of the chunks in
    memory. ``contents``: digests of metadata and channels (``seal``). ``faults``: sentences, MAX_FAULTS at most.

    :param by_index: use the summary if it is whole; otherwise, or else, every record is walked.
    :param kept: bytes of unpacked chunks that stay in memory, the first ones that are read.
    :raises LogUnreadable: for a file that is missing, no MCAP file, or a log of a newer format.
    """

    def __init__(self, path: Path, by_index: bool = True, kept: int = KEPT) -> None:
        self.path = path
        try:
            with open_file(path) as stream:
                if stream.read(len(MCAP0_MAGIC)) != MCAP0_MAGIC:
                    raise LogUnreadable(f"{path} is not a log: it does not begin as an MCAP file does")
                self._data = mmap.mmap(stream.fileno(), 0, access=mmap.ACCESS_READ)
                self.being_written = being_written(stream)
        except OSError as error:
            raise LogUnreadable(f"the log {path} cannot be read: {error_text(error)}") from None
        self.size = len(self._data)
        self.faults: list[str] = []
        self._decompressor = zstandard.ZstdDecompressor()
        self._room = kept
        self.unpacked: dict[int, list[Messages]] = {}
        self._forget()
        try:
            if not (by_index and self._read_summary()):
                self._forget()
                self._walk()
        except BaseException:
            self.close()
            raise
        self._check_wires()

    def _forget(self) -> None:
        self.topics: dict[str, Topic] = {}
        self.metadata: dict[str, dict[str, str]] = {}
        self.others: dict[str, str] = {}  # topics of other tools -> message type and encoding
        self.other_channels: dict[int, tuple[Channel, Schema]] = {}  # theirs, by number
        self.closing: dict[str, Any] | None = None
        self.contents: dict[str, str] = {}
        self.attachments: dict[str, int] = {}  # name -> offset
        self.recorded: dict[str, log_metadata.RecordedChannel] = {}
        self.spans: dict[int, tuple[float, float]] = {}
        self._schemas: dict[int, Schema] = {}
        self._channels: dict[int, log_metadata.RecordedChannel] = {}
        self._budget = UnpackedBudget(self.size)
        self._counted: dict[int, int] = {}  # unpacked bytes of the chunks by offset
        self._loose: dict[int, int] = {}  # messages outside chunks: beginning and end of a part of the file
        self.data_end: int | None = None  # offset of the record that ends the data
        self.ended = False
        self.is_sealed = False  # its closing record must have a seal

    def close(self) -> None:
        """Close the file."""
        self._data.close()

    def add_fault(self, sentence: str) -> None:
        """Add a sentence to ``faults`` unless it is there already."""
        if sentence not in self.faults and len(self.faults) < MAX_FAULTS:
            self.faults.append(sentence)

    # --- records

    def _read(self, start: int, size: int) -> bytes:
        return self._data[start : start + size]

    def _release(self, start: int, end: int) -> None:
        """Give back the pages of bytes that were read, which count as memory of the process."""
        if hasattr(mmap, "MADV_DONTNEED"):
            start -= start % mmap.ALLOCATIONGRANULARITY
            self._data.madvise(mmap.MADV_DONTNEED, start, min(end, self.size) - start)

    def head(self, offset: int) -> tuple[int, int]:
        """Return opcode and length of the record at ``offset``; raises struct.error."""
        opcode, length = HEAD.unpack_from(self._data, offset)
        return int(opcode), int(length)

    def following(self, offset: int) -> int:
        """Return the offset behind the record at ``offset``."""
        return offset + HEAD.size + self.head(offset)[1]

    def body(self, offset: int, most: int | None = None) -> bytes:
        """Return the content of the record at ``offset``, at most its first ``most`` bytes."""
        _, length = self.head(offset)
        if most is None and length > AT_ONCE:
            raise OverBudget(f"a record of {length} bytes, and {AT_ONCE} are allowed")
        return self._read(offset + HEAD.size, length if most is None else min(length, most))

    def record(self, kind: Any, offset: int) -> Any:
        """Parse the record at ``offset`` as a class of ``mcap.records``; raises one of DAMAGE."""
        if self.following(offset) > self.size:
            raise ValueError("it is cut off")
        return _parsed(kind, self.body(offset))

    def _take(self, take: Callable[[int], None], amount: int) -> None:
        try:
            take(amount)
        except OverBudget as excess:
            raise LogUnreadable(f"{self.path} is not read: {excess}") from None

    def _take_chunk(self, offset: int, unpacked: int) -> None:
        """Count the unpacked bytes of the chunk at ``offset``; raises LogUnreadable."""
        self._counted[offset] = unpacked
        self._take(self._budget.take, unpacked)

    def _take_record(self, opcode: int, length: int) -> None:
        """Count a record unless it belongs to a chunk, which counts itself; raises LogUnreadable."""
        if opcode not in (*OF_CHUNKS, Opcode.MESSAGE):
            self._take(self._budget.take_record, length if opcode == Opcode.CHANNEL else 0)

    # --- what the file holds

    def _summary(self) -> Iterator[tuple[int, int]]:
        """Yield opcode and offset of every record of the summary; raises one of DAMAGE."""
        end = self.size - FOOTER
        offset = self.record(Footer, end).summary_start
        if not len(MCAP0_MAGIC) + DATA_END <= offset < end:
            raise ValueError("there is no summary")
        while offset < end:
            opcode, length = self.head(offset)
            yield opcode, offset
            offset += HEAD.size + length
        if offset != end:
            raise ValueError("the summary does not end where the footer begins")

    def _read_summary(self) -> bool:
        """Register what the summary lists; return whether it is whole."""
        counts: Counter[int] = Counter()
        statistics, end = None, self.size - FOOTER
        try:
            data_end = self.record(Footer, end).summary_start - DATA_END
            if (
                self.head(end) != (Opcode.FOOTER, 20)
                or self._read(self.size - len(MCAP0_MAGIC), len(MCAP0_MAGIC)) != MCAP0_MAGIC
                or self.head(data_end) != (Opcode.DATA_END, 4)
                or not self.indexes_sound()
            ):
                return False
            for opcode, offset in self._summary():
                self._take_record(opcode, self.head(offset)[1])
                counts[opcode] += 1
                if opcode == Opcode.STATISTICS:
                    statistics = self.record(Statistics, offset)
                elif opcode in INDEXES:
                    self._register_indexed(opcode, self.record(INDEXES[opcode][0], offset))
                elif opcode in COUNTED:
                    self._register(opcode, offset)
        except DAMAGE:
            return False
        if statistics is None or (statistics.message_count and not statistics.chunk_count):  # messages outside chunks
            return False
        self.data_end, self.ended = data_end, True
        return all(counts[code] == getattr(statistics, key) for code, key in COUNTED.items())

    def _walk(self) -> None:
        """Register every data record, from the next one in the indexes on behind a damaged one."""
        offset, indexed = len(MCAP0_MAGIC), [*self._indexed, self.size]
        while offset < self.size:
            following, next_indexed = self._step(offset), indexed[bisect_right(indexed, offset)]
            if following is None or (self._has_sound_indexes and following > next_indexed):
                following = next_indexed  # also behind a record that is said to be longer than it is
                self.add_fault(f"{self.path}: the record at byte {offset} of {self.size} is cut off or damaged")
            offset = following
        if self.data_end is None and self.being_written:
            self.add_fault(f"{self.path}: the log is still being written, {self.size} bytes so far")
        elif self.data_end is None:
            self.add_fault(f"{self.path}: the log was cut off at byte {self.size}")
        elif not self.ended:
            self.add_fault(f"{self.path}: the end of the file is missing or damaged")

    def _step(self, offset: int) -> int | None:
        """Register the record at ``offset``; return the offset of the next one, or None if it is damaged."""
        if offset + HEAD.size > self.size:
            return None
        opcode, length = self.head(offset)
        following = offset + HEAD.size + length
        if following > self.size or not Opcode.HEADER <= opcode <= Opcode.DATA_END:
            return None
        if opcode == Opcode.FOOTER and length == 20:
            self.ended = self._read(following, len(MCAP0_MAGIC) + 1) == MCAP0_MAGIC
            return self.size if self.ended else None
        if opcode == Opcode.DATA_END and length == 4:
            self.data_end = offset
        self._take_record(opcode, length)
        try:
            self._register(opcode, offset)
        except DAMAGE:
            return None
        return following

    @cached_property
    def _indexed(self) -> dict[int, int]:
        """Offset of each record in the summary, and of the end of the data -> unpacked bytes of a chunk, else 0.

        Sorted; empty if the summary is damaged.
        """
        try:
            indexes = ((opcode, offset) for opcode, offset in self._summary() if opcode in INDEXES)
            kinds = ((INDEXES[opcode], offset) for opcode, offset in islice(indexes, most_others(self.size)))
            found = {self.record(Footer, self.size - FOOTER).summary_start - DATA_END: 0}
            for (kind, field), offset in kinds:
                index = self.record(kind, offset)
                found[getattr(index, field)] = getattr(index, "uncompressed_size", 0)
            return dict(sorted(found.items()))
        except DAMAGE:
            return {}

    @cached_property
    def _has_sound_indexes(self) -> bool:
        try:
            return bool(self._indexed) and self.indexes_sound()
        except DAMAGE:
            return False

    def _register_indexed(self, opcode: int, index: Any) -> None:
        """Register what an index record points at; raises one of DAMAGE."""
        if opcode == Opcode.CHUNK_INDEX:
            self.spans[index.chunk_start_offset] = 1e-9 * index.message_start_time, 1e-9 * index.message_end_time
            self._take_chunk(index.chunk_start_offset, index.uncompressed_size)
        elif opcode == Opcode.ATTACHMENT_INDEX:
            self.attachments[index.name] = index.offset
        elif self.head(index.offset)[0] != Opcode.METADATA:
            raise ValueError(f"there are no metadata at byte {index.offset}")
        else:
            self._register(Opcode.METADATA, index.offset)

    def _register(self, opcode: int, offset: int) -> None:
        """Register a record; raises one of DAMAGE."""
        if opcode == Opcode.CHUNK:
            first, last, size, *_ = _CHUNK.unpack(self.body(offset, _CHUNK.size).ljust(_CHUNK.size, b"\0"))
            if self._has_sound_indexes and size != self._indexed.get(offset, size):
                raise ValueError("the summary has another size for it")
            self.spans[offset] = 1e-9 * first, 1e-9 * last
            self._take_chunk(offset, size)
            if not self.is_ours:
                self._register_descriptions(self._content(offset))
        elif opcode == Opcode.MESSAGE:
            self._register_message(offset)
        elif opcode == Opcode.ATTACHMENT:
            self.attachments[self.record(Attachment, offset).name] = offset
        elif opcode == Opcode.METADATA:
            self._register_metadata(self.record(Metadata, offset))
        elif opcode == Opcode.SCHEMA:
            schema = self.record(Schema, offset)
            self._schemas[schema.id] = schema
        elif opcode == Opcode.CHANNEL:
            self._register_channel(self.record(Channel, offset))

    def _register_message(self, offset: int) -> None:
        """Register a message outside a chunk, which is read with those beside it."""
        end = self.following(offset)
        first, last = next(reversed(self._loose.items()), (offset, offset))
        if last != offset or end - first > LOOSE:
            first = offset
            self._take(self._budget.take, 0)
        self._loose[first] = end
        t = 1e-9 * _LENGTH.unpack(self._read(offset + LOG_TIME, _LENGTH.size))[0]
        start, stop = self.spans.get(first, (t, t))
        self.spans[first] = min(start, t), max(stop, t)

    def _register_descriptions(self, content: bytes) -> None:
        """Register schemas and channels in a chunk, where other writers have them; raises one of DAMAGE."""
        for opcode, start, end in record_places(content):
            if opcode == Opcode.SCHEMA:
                schema = _parsed(Schema, content[start + HEAD.size : end])
                self._schemas[schema.id] = schema
            elif opcode == Opcode.CHANNEL:
                self._register_channel(_parsed(Channel, content[start + HEAD.size : end]))

    def _register_metadata(self, record: Metadata) -> None:
        """Register a metadata record; raises LogUnreadable for a log of a newer format."""
        if record.name == log_metadata.CLOSING:
            self.closing = log_metadata.decode_closing(record.metadata)
        elif record.name != seal.SEAL:  # of a log with a hash tree
            self.contents[f"metadata:{record.name}"] = seal.metadata_digest(record.metadata)
            self.metadata[record.name] = record.metadata
        if record.name == log_metadata.FORMAT:
            self.is_sealed = seal.SEAL in self.metadata.pop(record.name)
            try:
                log_metadata.check_version(record.metadata)
            except log_metadata.TooNew as newer:
                raise LogUnreadable(f"{self.path} {newer}") from None

    def _register_channel(self, channel: Channel) -> None:
        """Register a channel; one that ``recorder`` did not write goes to ``others``."""
        if channel.id in self._channels or channel.id in self.other_channels:
            return
        schema = self._schemas.get(channel.schema_id)
        self.contents[f"channel:{channel.topic}"] = seal.channel_digest(channel, schema)
        if "places" not in channel.metadata:
            kind = schema.name if schema else "", channel.message_encoding
            self.others[channel.topic] = ", ".join(filter(None, kind))
            self.other_channels[channel.id] = channel, schema or Schema(id=0, name="", encoding="", data=b"")
            return
        recorded = log_metadata.decode_channel(channel.topic, channel.metadata, self._schemas[channel.schema_id].data)
        if self.topics.setdefault(channel.topic, recorded.about) != recorded.about:
            raise ValueError(f"{channel.topic} has two different descriptions")
        self._channels[channel.id] = self.recorded[channel.topic] = recorded

    def _check_wires(self) -> None:
        """Remove topics whose wires refer to outputs that the log lacks; each is a fault."""
        for topic, about in list(self.topics.items()):
            for wire in about.wires:
                source = self.recorded.get(wire.source)
                if source is None or source.about.every > 1 or not set(wire.outputs) <= set(source.names):
                    self.add_fault(f"{self.path}: {topic} is wired to {wire.source}, which lacks what it needs")
                    self.topics.pop(topic, None)
        self._channels = {number: one for number, one in self._channels.items() if one.topic in self.topics}

    # --- messages

    def read(self, offset: int, topics: Collection[str] | None = None) -> list[Messages]:
        """Return the message records of a chunk, one ``Messages`` per channel; raises LogUnreadable.

        ``topics`` selects (None: all).
        """
        try:
            found = self.unpacked.get(offset) or self._unpack(offset, topics)
        except DAMAGE as damage:
            raise self._damaged(offset, damage) from None
        return found if topics is None else [messages for messages in found if messages.topic in topics]

    def _damaged(self, offset: int, damage: BaseException) -> LogUnreadable:
        saved = "; 'log recover' saves the rest" if self.is_ours else ""
        return LogUnreadable(f"{self.path}: the chunk at byte {offset} is damaged ({damage}){saved}")

    def _packed_size(self, offset: int) -> int:
        """Return the bytes in the file of the content of the chunk, or of the messages, at ``offset``."""
        return self._loose[offset] - offset if offset in self._loose else self.head(offset)[1]

    def messages(self, wanted: Collection[int]) -> Iterator[tuple[int, bytes]]:
        """Yield channel and record of the messages of channels that are not ours; raises LogUnreadable."""
        for offset in self.spans:
            try:
                if (indexed := self._message_offsets(offset)) and indexed.keys().isdisjoint(wanted):
                    continue
                content = self._content(offset)
                for opcode, start, end in record_places(content):
                    if end > len(content):
                        raise ValueError("its last message is cut off")
                    channel = int.from_bytes(content[start + HEAD.size : start + HEAD.size + 2], "little")
                    if opcode == Opcode.MESSAGE and channel in wanted:
                        yield channel, content[start:end]
            except DAMAGE as damage:
                raise self._damaged(offset, damage) from None

    def _unpack(self, offset: int, topics: Collection[str] | None) -> list[Messages]:
        """Return the message records of topics of a chunk, or of all if they are kept; raises one of DAMAGE."""
        content, most = np.frombuffer(self._content(offset), np.uint8), most_records(self._packed_size(offset))
        records = records_by_channel(content, self._message_offsets(offset), most, self._channels)
        keep = len(content) <= self._room
        messages = []
        for number, channel in self._channels.items():
            if number in records and (keep or topics is None or channel.topic in topics):
                if records[number].size != (size := size_of(channel.layout)):
                    raise ValueError(f"a message of {channel.topic} does not have {size} bytes")
                rows = records[number].rows(content)
                messages.append(Messages(channel.topic, channel.names, channel.layout, rows))
        if keep:
            self._room -= len(content)
            self.unpacked[offset] = messages
        return messages

    def _content(self, offset: int) -> bytes:
        """Return the unpacked and checked content of a chunk, or of messages outside one; raises one of DAMAGE."""
        if (loose_end := self._loose.get(offset)) is not None:
            return self._read(offset, loose_end - offset)
        start, end = offset + HEAD.size, self.following(offset)
        *_, size, crc, name_length = _CHUNK.unpack_from(self._data, start)
        kind, position = self._read(start + _CHUNK.size, name_length), start + _CHUNK.size + name_length
        begin, length = position + _LENGTH.size, _LENGTH.unpack_from(self._data, position)[0]
        if begin + length > min(end, self.size):
            raise ValueError("it is cut off")
        if size != self._counted.get(offset, size):
            raise ValueError("the summary has another size for it")
        with memoryview(self._data) as view, view[begin : begin + length] as packed:
            content = self._decompressed(kind, packed, size)
        self._release(offset, end)
        if crc not in (0, crc32(content)):
            raise ValueError("its checksum does not hold")
        return content

    def _decompressed(self, kind: bytes, packed: memoryview, size: int) -> bytes:
        if kind == b"" and len(packed) == size:
            return bytes(packed)
        if kind == b"lz4":
            try:
                content = LZ4FrameDecompressor().decompress(packed, max_length=size + 1)
            except RuntimeError as error:
                raise ValueError(str(error)) from None
            if len(content) != size:
                raise ValueError("its size does not hold")
            return content
        if kind != b"zstd":
            raise ValueError(f"compression {kind.decode(errors='replace')!r} is not known")
        if zstandard.frame_content_size(packed) not in (-1, size):  # -1: unknown
            raise ValueError("its size does not hold")
        return self._decompressor.decompress(packed, size)

    def _message_offsets(self, offset: int) -> Mapping[int, NDArray[np.int64]]:
        """Return offsets (m,) in the content of the chunk at ``offset`` by channel, as its message indexes have them.

        Whatever is damaged is left out.
        """
        offsets, following = {}, self._loose.get(offset) or self.following(offset)
        while following + HEAD.size < self.size and self.head(following)[0] == Opcode.MESSAGE_INDEX:
            body = self.body(following)
            if len(body) >= _INDEX.size:
                entries = np.frombuffer(body[_INDEX.size : len(body) - (len(body) - _INDEX.size) % 16], "<u8")
                offsets[_INDEX.unpack_from(body)[0]] = entries[1::2].astype(np.int64)
            following += HEAD.size + len(body)
        return offsets

    # --- checks

    def attachment(self, name: str) -> bytes:
        """Return the content of an attached file, checked by its checksum; raises LogUnreadable."""
        offset = self.attachments[name]
        try:
            body = self.body(offset)
            given = int.from_bytes(body[-4:], "little")  # 0: none
            if self.head(offset)[0] != Opcode.ATTACHMENT or given not in (0, crc32(body[:-4])):
                raise ValueError("its checksum does not hold")
            return bytes(_parsed(Attachment, body).data)
        except DAMAGE:
            raise LogUnreadable(f"{self.path}: the attachment '{name}' at byte {offset} is damaged") from None

    def data_sound(self) -> bool:
        """Whether the checksum over all data, without the indexes at the end, holds; 0 is none."""
        if self.data_end is None:
            return False
        given = self.record(DataEnd, self.data_end).data_section_crc
        return given in (0, self._crc(0, self.data_end))

    def indexes_sound(self) -> bool:
        """Whether the checksum over the indexes holds; the file must have its end."""
        footer = self.record(Footer, self.size - FOOTER)
        if not (footer.summary_start and footer.summary_crc):  # there is no summary, or no checksum
            return True
        return bool(footer.summary_crc == self._crc(footer.summary_start, self.size - FOOTER + HEAD.size + 16))

    @cached_property
    def header(self) -> Header:
        """Profile of the file, and the library that wrote it; raises one of DAMAGE."""
        return self.record(Header, len(MCAP0_MAGIC))

    @property
    def is_ours(self) -> bool:
        """Whether the file was written by the recorder, not by other software."""
        try:
            return bool(self.header.library == LIBRARY)
        except DAMAGE:
            return True

    def _crc(self, start: int, end: int) -> int:
        crc = 0
        for begin in range(start, end, PIECE):
            crc = crc32(self._read(begin, min(PIECE, end - begin)), crc)
            self._release(begin, begin + PIECE)
        return crc


def _parsed(kind: Any, body: bytes) -> Any:
    """Parse bytes as a class of ``mcap.records``; raises one of DAMAGE."""
    return kind.read(ReadDataStream(io.BytesIO(body)))
