"""Reader of an MCAP file, mapped into memory and walked record by record.

A file without its end is read up to the last whole record. After a damaged record the walk continues with the next
record in the indexes at the end of the file, if there are any. ``faults`` lists what is missing.
"""

from __future__ import annotations

import io
import mmap
import os
import struct
from bisect import bisect_right
from collections.abc import Callable, Iterator
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import zstandard
from isal.isal_zlib import crc32
from lz4.frame import LZ4FrameDecompressor
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import AttachmentIndex, ChunkIndex, DataEnd, Footer, Header, MetadataIndex
from mcap.writer import MCAP0_MAGIC
from numpy.typing import NDArray

from orchestrator.files.budget import AT_ONCE, OverBudget, UnpackedBudget, most_others, open_file
from orchestrator.log.container_writer import LIBRARY
from orchestrator.log.log_file import being_written, error_text

HEAD = struct.Struct("<BQ")  # opcode and length before every record
FOOTER = HEAD.size + 20 + len(MCAP0_MAGIC)  # bytes from the footer to the end of a file
AROUND = 16 * mmap.PAGESIZE  # bytes that the system may map when one of them is read
_INDEX = struct.Struct("<HI")  # begins a message index: channel, bytes of its entries
_CHUNK, _LENGTH = struct.Struct("<QQQII"), struct.Struct("<Q")  # times, size, checksum, length of compression name
PIECE = 256 * AROUND  # bytes per update of a checksum
INDEXES: dict[int, tuple[Any, str]] = {  # index records of the summary and their field with an offset
    Opcode.CHUNK_INDEX: (ChunkIndex, "chunk_start_offset"),
    Opcode.ATTACHMENT_INDEX: (AttachmentIndex, "offset"),
    Opcode.METADATA_INDEX: (MetadataIndex, "offset"),
}
LOOSE = 1 << 20  # bytes of messages outside chunks that are read at once
OF_CHUNKS = (Opcode.CHUNK, Opcode.MESSAGE_INDEX, Opcode.CHUNK_INDEX)
MOST_FAULTS = 100
DAMAGE = (
    McapError, zstandard.ZstdError, struct.error, ValueError, TypeError, LookupError, MemoryError, OverflowError,
    RecursionError,
)  # fmt: skip


class LogUnreadable(RuntimeError):
    """A log, or the requested part of it, cannot be read; the message is one sentence."""


class ContainerReader:
    """MCAP file open for reading; raises LogUnreadable if it is missing or not an MCAP file."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._data, self.being_written = _map_file(path)
        self.size = len(self._data)
        self.faults: list[str] = []  # sentences, MOST_FAULTS at most
        self._budget = UnpackedBudget(self.size)
        self._counted: dict[int, int] = {}  # unpacked bytes of the chunks by offset
        self._loose: dict[int, int] = {}  # messages outside chunks: beginning and end of a part of the file
        self.data_end: int | None = None  # offset of the record that ends the data
        self.ended = False
        self._decompressor = zstandard.ZstdDecompressor()
        self._advise("MADV_RANDOM")  # else the system reads up to megabytes around every record

    def close(self) -> None:
        """Unmap the file."""
        self._data.close()

    def add_fault(self, sentence: str) -> None:
        """Add a sentence to ``faults`` unless it is there already."""
        if sentence not in self.faults and len(self.faults) < MOST_FAULTS:
            self.faults.append(sentence)

    def body(self, offset: int, most: int | None = None) -> bytes:
        """Return the content of the record at ``offset``, at most its first ``most`` bytes."""
        _, length = HEAD.unpack_from(self._data, offset)
        if most is None and length > AT_ONCE:
            raise OverBudget(f"a record of {length} bytes, and {AT_ONCE} are allowed")
        start, end = offset + HEAD.size, offset + HEAD.size + (length if most is None else min(length, most))
        if end - start > mmap.PAGESIZE:
            self._advise("MADV_WILLNEED", start, end)
        return self._data[start:end]

    def packed_size(self, offset: int) -> int:
        """Return the bytes in the file of the content of the chunk, or of the messages, at ``offset``."""
        return self._loose[offset] - offset if offset in self._loose else self.length(offset)

    def length(self, offset: int) -> int:
        """Return the length of the content of the record at ``offset``."""
        return int(HEAD.unpack_from(self._data, offset)[1])

    def record(self, kind: Any, offset: int) -> Any:
        """Parse the record at ``offset`` as a class of ``mcap.records``; raises one of DAMAGE."""
        return parse_record(kind, self.body(offset))

    def take_chunk(self, offset: int, unpacked: int | None = None) -> None:
        """Count the unpacked bytes of the chunk at ``offset``, by default those in its head; raises LogUnreadable."""
        if unpacked is None:
            unpacked = int(_CHUNK.unpack(self.body(offset, _CHUNK.size).ljust(_CHUNK.size, b"\0"))[2])
        self._counted[offset] = unpacked
        self._take(self._budget.take, unpacked)

    def take_record(self, opcode: int, offset: int) -> None:
        """Count the record at ``offset`` unless it belongs to a chunk, which counts itself; raises LogUnreadable."""
        if opcode not in (*OF_CHUNKS, Opcode.MESSAGE):
            self._take(self._budget.take_record, self.length(offset) if opcode == Opcode.CHANNEL else 0)

    def _take(self, take: Callable[[int], None], amount: int) -> None:
        try:
            take(amount)
        except OverBudget as excess:
            raise LogUnreadable(f"{self.path} is not read: {excess}") from None

    def content(self, offset: int) -> bytes:
        """Return the unpacked and checked content of the chunk at ``offset``; raises one of DAMAGE.

        Messages outside chunks (``add_message``) are such a content too.
        """
        if (loose_end := self._loose.get(offset)) is not None:
            return self._data[offset:loose_end]
        _, length = HEAD.unpack_from(self._data, offset)
        start = offset + HEAD.size
        self._advise("MADV_WILLNEED", start, start + length)
        with memoryview(self._data) as view, view[start : start + length] as body:
            *_, size, crc, name_length = _CHUNK.unpack_from(body)
            kind, position = bytes(body[_CHUNK.size : _CHUNK.size + name_length]), _CHUNK.size + name_length
            (length,) = _LENGTH.unpack_from(body, position)
            with body[position + _LENGTH.size : position + _LENGTH.size + length] as packed:
                if len(packed) != length:
                    raise ValueError("it is cut off")
                if size != self._counted.get(offset, size):
                    raise ValueError("the summary has another size for it")
                content = self._decompress(kind, packed, size)
        if crc not in (0, crc32(content)):
            raise ValueError("its checksum does not hold")
        return content

    def add_message(self, offset: int) -> int:
        """Register a message outside a chunk; return the offset of the content of which it is a part."""
        end = self.following(offset)
        first, last = next(reversed(self._loose.items()), (offset, offset))
        if last != offset or end - first > LOOSE:
            first = offset
            self._take(self._budget.take, 0)
        self._loose[first] = end
        return first

    def message_offsets(self, offset: int) -> dict[int, NDArray[np.int64]]:
        """Return offsets (m,) in the content of the chunk at ``offset`` by channel, as its message indexes have them.

        Whatever is damaged is left out.
        """
        if offset in self._loose:
            return {}
        offsets, following = {}, self.following(offset)
        while following + HEAD.size < self.size and self._data[following] == Opcode.MESSAGE_INDEX:
            body = self.body(following)
            if len(body) >= _INDEX.size:
                entries = np.frombuffer(body[_INDEX.size : len(body) - (len(body) - _INDEX.size) % 16], "<u8")
                offsets[_INDEX.unpack_from(body)[0]] = entries[1::2].astype(np.int64)
            following = self.following(following)
        return offsets

    def opcode(self, offset: int) -> int:
        """Return the opcode of the record at ``offset``; raises LookupError."""
        return self._data[offset]

    def following(self, offset: int) -> int:
        """Return the offset behind the record at ``offset``."""
        return offset + HEAD.size + int(HEAD.unpack_from(self._data, offset)[1])

    def _decompress(self, kind: bytes, packed: memoryview, size: int) -> bytes:
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

    def walk(self, visit: Callable[[int, int], None]) -> None:
        """Call ``visit(opcode, offset)`` for every data record; ``visit`` may raise one of DAMAGE."""
        offset = len(MCAP0_MAGIC)
        self._budget, self._counted, self._loose = UnpackedBudget(self.size), {}, {}  # of a summary that is not used
        self._advise("MADV_NORMAL")
        while offset < self.size:
            following = self._step(offset, visit)
            if following is None:
                following = self._indexed_offset_behind(offset)
                self.add_fault(f"{self.path}: the record at byte {offset} of {self.size} is cut off or damaged")
            offset = following
        if self.data_end is None and self.being_written:
            self.add_fault(f"{self.path}: the log is still being written, {self.size} bytes so far")
        elif self.data_end is None:
            self.add_fault(f"{self.path}: the log was cut off at byte {self.size}")
        elif not self.ended:
            self.add_fault(f"{self.path}: the end of the file is missing or damaged")

    def _step(self, offset: int, visit: Callable[[int, int], None]) -> int | None:
        """Visit the record at ``offset``; return the offset of the next one, or None if it is damaged."""
        if offset + HEAD.size > self.size:
            return None
        opcode, length = HEAD.unpack_from(self._data, offset)
        following = offset + HEAD.size + length
        if following > self.size or not Opcode.HEADER <= opcode <= Opcode.DATA_END:
            return None
        if opcode == Opcode.FOOTER and length == 20:
            self.ended = following + len(MCAP0_MAGIC) == self.size and self._data[following:] == MCAP0_MAGIC
            return self.size if self.ended else None
        if opcode == Opcode.DATA_END and length == 4:
            self.data_end = offset
        self.take_record(opcode, offset)
        try:
            visit(opcode, offset)
        except DAMAGE:
            return None
        return following

    def _indexed_offset_behind(self, offset: int) -> int:
        """Return the offset of the next record in the summary behind ``offset``, or the size of the file."""
        place = bisect_right(self._indexed_offsets, offset)
        return self._indexed_offsets[place] if place < len(self._indexed_offsets) else self.size

    @cached_property
    def _indexed_offsets(self) -> list[int]:
        """Return the sorted offsets of records in the summary; empty without a readable summary."""
        offsets = []
        try:
            offset = self.record(Footer, self.size - FOOTER).summary_start
            offsets.append(offset - HEAD.size - 4)  # end of data
            while offset < self.size - FOOTER and len(offsets) < most_others(self.size):
                opcode, length = HEAD.unpack_from(self._data, offset)
                if opcode in INDEXES:
                    kind, field = INDEXES[opcode]
                    offsets.append(getattr(self.record(kind, offset), field))
                offset += HEAD.size + length
        except DAMAGE:
            return []
        return sorted(offsets)

    def summary(self) -> list[tuple[int, int]]:
        """Return opcode and offset of every record of the summary; empty if it is missing or its checksum fails."""
        records: list[tuple[int, int]] = []
        try:
            opcode, length = HEAD.unpack_from(self._data, self.size - FOOTER)
            footer = self.record(Footer, self.size - FOOTER)
            offset, end = footer.summary_start, self.size - FOOTER
            data_end = offset - HEAD.size - 4
            if (
                (opcode, length) != (Opcode.FOOTER, 20)
                or self._data[self.size - len(MCAP0_MAGIC) :] != MCAP0_MAGIC
                or not len(MCAP0_MAGIC) <= data_end < offset < end
                or HEAD.unpack_from(self._data, data_end) != (Opcode.DATA_END, 4)
                or not self.indexes_sound()
            ):
                return []
            while offset < end:
                records.append((self._data[offset], offset))
                offset = self.following(offset)
        except DAMAGE:
            return []
        if offset != end:
            return []
        self.data_end, self.ended = data_end, True
        return records

    def release_record(self, offset: int) -> None:
        """Release the mapped pages of the record at ``offset``, which count as memory of the process."""
        _, length = HEAD.unpack_from(self._data, offset)
        start = offset - offset % AROUND - AROUND  # includes pages read since the previous chunk
        self._release(max(0, start), offset + HEAD.size + length)

    def _release(self, start: int, end: int) -> None:
        self._advise("MADV_DONTNEED", start, end)

    def _advise(self, advice: str, start: int = 0, end: int | None = None) -> None:
        """Tell the system how the bytes from ``start`` to ``end`` are read, where it can be told."""
        first, last = start - start % mmap.PAGESIZE, min(self.size if end is None else end, self.size)
        if hasattr(mmap, advice) and first < last:
            self._data.madvise(getattr(mmap, advice), first, last - first)

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

    @property
    def is_ours(self) -> bool:
        """Whether the file was written by the recorder, not by other software."""
        try:
            return bool(self.record(Header, len(MCAP0_MAGIC)).library == LIBRARY)
        except DAMAGE:
            return True

    def _crc(self, start: int, end: int) -> int:
        crc = 0
        for part in self._pieces(start, end):
            crc = crc32(part, crc)
        return crc

    def _pieces(self, start: int, end: int) -> Iterator[memoryview]:
        """Yield the bytes from ``start`` to ``end`` in pieces, whose pages are released afterwards."""
        while start < end:
            part_end = min(start - start % PIECE + PIECE, end)
            self._advise("MADV_WILLNEED", start, part_end)
            with memoryview(self._data) as view, view[start:part_end] as part:
                yield part
            self._release(part_end - part_end % AROUND - PIECE if part_end > PIECE else 0, part_end)
            start = part_end


def parse_record(kind: Any, body: bytes) -> Any:
    """Parse bytes as a class of ``mcap.records``; raises one of DAMAGE."""
    return kind.read(ReadDataStream(io.BytesIO(body)))


def _map_file(path: Path) -> tuple[mmap.mmap, bool]:
    """Map a file; return it with whether a recorder has it open. Raises LogUnreadable."""
    try:
        with open_file(path) as stream:
            size = os.fstat(stream.fileno()).st_size
            if size < len(MCAP0_MAGIC) or stream.read(len(MCAP0_MAGIC)) != MCAP0_MAGIC:
                raise LogUnreadable(f"{path} is not a log: it does not begin as an MCAP file does")
            return mmap.mmap(stream.fileno(), 0, access=mmap.ACCESS_READ), being_written(stream)
    except OSError as error:
        raise LogUnreadable(f"the log {path} cannot be read: {error_text(error)}") from None
