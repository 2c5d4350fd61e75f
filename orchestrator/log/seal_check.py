"""Check of a seal, and of the summary against the records that it lists."""

from __future__ import annotations

import struct
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

from mcap.opcode import Opcode
from mcap.records import Attachment, AttachmentIndex, Channel, ChunkIndex, Metadata, MetadataIndex, Schema, Statistics

from orchestrator.log import seal as sealing
from orchestrator.log.container_reader import DAMAGE, ContainerReader, LogUnreadable
from orchestrator.log.contents import LogContents

_CHUNK, _TEXT, _LENGTH = struct.Struct("<QQQI"), struct.Struct("<I"), struct.Struct("<Q")
_CHANNEL, _ENTRIES, _ENTRY = struct.Struct("<HI"), 6, 16  # of a message index: its head and bytes of it, of an entry
_LISTED: dict[int, Any] = {
    Opcode.SCHEMA: Schema,
    Opcode.CHANNEL: Channel,
    Opcode.CHUNK_INDEX: ChunkIndex,
    Opcode.ATTACHMENT_INDEX: AttachmentIndex,
    Opcode.METADATA_INDEX: MetadataIndex,
    Opcode.STATISTICS: Statistics,
}


def seal_faults(file: ContainerReader, contents: LogContents) -> list[str]:
    """Return sentences if a log is not as it was sealed, or lost its seal; a log that never had one has no fault.

    Every byte is read: those before the seal record are hashed, the summary behind it is compared with them.
    """
    seal, at = contents.seal, contents.seal_at
    if seal is None and contents.closing and contents.closing["seal"]:
        return [f"{file.path} has lost its seal"]
    if seal is None:
        return index_faults(file)
    ends = [*seal.offsets[1:], at]
    if seal.offsets[-1] >= at or file.following(at) != file.data_end:
        return [f"{file.path} is not as it was sealed: records follow its seal or are missing before it"]
    changed = [
        start
        for start, end, leaf in zip(seal.offsets, ends, seal.leaves, strict=True)
        if file.leaf_hash(start, end) != leaf
    ]
    if changed:
        others = f", and so are {len(changed) - 1} parts behind it" if len(changed) > 1 else ""
        return [f"{file.path} is not as it was sealed: {_part(file, changed[0])} is changed{others}"]
    return index_faults(file)


def _part(file: ContainerReader, offset: int) -> str:
    """Return the kind, place and, if it is short, the name of the record at ``offset``."""
    try:
        opcode = file.opcode(offset)
        if opcode == Opcode.ATTACHMENT:
            return f"the attachment '{file.record(Attachment, offset).name[:80]}'"
        if opcode == Opcode.METADATA:
            return f"the record '{file.record(Metadata, offset).name[:80]}'"
        if opcode == Opcode.CHANNEL:
            return f"the description of {file.record(Channel, offset).topic[:80]}"
    except DAMAGE:
        pass
    return f"the part at byte {offset}"


def content_faults(
    file: ContainerReader,
    contents: LogContents,
    attachment: Callable[[str], bytes],
    hashes: Callable[[], Mapping[str, str]],
) -> list[str]:
    """Return a sentence about the first content that is not that of the closing record; empty if all are.

    ``attachment`` and ``hashes`` read an attached file and the sha256 of each topic, and may raise LogUnreadable.
    """
    closing = contents.closing
    if closing is None or not closing["contents"]:
        reason = "an older cotrack made it, which sealed the file alone" if closing else "it has no closing record"
        return [f"{file.path} was rewritten by other software, and its seal cannot be checked: {reason}"]
    beginning = f"{file.path} was rewritten by other software and is not as it was sealed: "
    if not contents.is_sealed(contents.closing_at):
        return [f"{beginning}the closing record is changed"]
    for name, digest in closing["contents"].items():
        kind, _, which = name.partition(":")
        words = {"attachment": f"the attachment '{which}'", "metadata": f"the record '{which}'"}
        words |= {"channel": f"the description of {which}", "messages": f"the text of {which}"}
        found = contents.contents.get(name)
        if kind == "attachment" and which in contents.attachments:
            try:
                found = sealing.attachment_digest(attachment(which))
            except LogUnreadable as damage:
                return [str(damage)]
        has_messages = closing["messages"].get(which) or f"messages:{which}" in closing["contents"]
        if kind == "channel" and not found and not has_messages:
            continue  # a topic without messages may be left out
        if kind == "messages" and which in contents.other_channels:
            found = sealing.messages_digest(contents.chunks.rows_of(contents.other_channels[which]))
        if found != digest:
            return [f"{beginning}{words.get(kind, name)} is {'changed' if found else 'missing'}"]
    try:
        changed = [topic for topic, digest in closing["sha256"].items() if hashes().get(topic) != digest]
    except LogUnreadable as damage:
        return [str(damage)]
    return [f"{beginning}the messages of {changed[0]} are changed or missing"] if changed else []


def index_faults(file: ContainerReader) -> list[str]:
    """Return a sentence if the summary does not list exactly the records of the file."""
    listed = file.summary()
    if not listed or not file.is_ours:  # the walk and the checksums say what is wrong
        return []
    try:
        given = Counter(
            _text(file.record(_LISTED[opcode], offset)) if opcode in _LISTED else f"record {opcode}"
            for opcode, offset in listed
            if opcode != Opcode.SUMMARY_OFFSET
        )
    except DAMAGE:
        given = Counter()
    walked = _Listing(file)
    if given == Counter(map(_text, walked.records())):
        return []
    return [
        f"{file.path}: the indexes at its end do not list what the file holds; 'cotrack log recover' makes them again"
    ]


def _text(record: Any) -> str:
    """Return a record as text; counts of channels without messages may be missing."""
    if isinstance(record, Statistics):
        counts = sorted((channel, n) for channel, n in record.channel_message_counts.items() if n)
        record = replace(record, channel_message_counts=dict(counts))
    return repr(record)


class _Listing:
    """Records that the summary of a file must hold, from a walk through the file."""

    def __init__(self, file: ContainerReader) -> None:
        self._file = file
        self._chunks: list[ChunkIndex] = []
        self._listed: list[Any] = []  # all others
        self._counts: Counter[int] = Counter()  # by opcode
        self._messages: dict[int, int] = {}  # by channel
        file.walk(self._visit)

    def records(self) -> list[Any]:
        """Return all records of the summary but the offsets of its groups."""
        statistics = Statistics(
            attachment_count=self._counts[Opcode.ATTACHMENT],
            channel_count=self._counts[Opcode.CHANNEL],
            channel_message_counts=self._messages,
            chunk_count=len(self._chunks),
            message_count=sum(self._messages.values()),
            message_end_time=max((chunk.message_end_time for chunk in self._chunks), default=0),
            message_start_time=min((chunk.message_start_time for chunk in self._chunks), default=0),
            metadata_count=self._counts[Opcode.METADATA],
            schema_count=self._counts[Opcode.SCHEMA],
        )
        return [*self._listed, *self._chunks, statistics]

    def _visit(self, opcode: int, offset: int) -> None:
        if offset > (self._file.data_end or self._file.size):  # the summary itself
            return
        self._counts[opcode] += 1
        file, length = self._file, self._file.following(offset) - offset
        if opcode == Opcode.SCHEMA:
            self._listed.append(file.record(Schema, offset))
        elif opcode == Opcode.CHANNEL:
            channel = file.record(Channel, offset)
            self._listed.append(channel)
            self._messages[channel.id] = 0
        elif opcode == Opcode.ATTACHMENT:
            item = file.record(Attachment, offset)
            times, kind = (item.log_time, item.create_time), item.media_type
            self._listed.append(AttachmentIndex(offset, length, *times, len(item.data), item.name, kind))
        elif opcode == Opcode.METADATA:
            self._listed.append(MetadataIndex(offset=offset, length=length, name=file.record(Metadata, offset).name))
        elif opcode == Opcode.CHUNK:
            self._chunks.append(self._chunk_index(offset, length))
            file.release_record(offset)
        elif opcode == Opcode.MESSAGE_INDEX:
            number, size = _CHANNEL.unpack(file.body(offset, _ENTRIES))
            self._messages[number] += size // _ENTRY
            self._chunks[-1].message_index_offsets[number] = offset
            self._chunks[-1].message_index_length += length

    def _chunk_index(self, offset: int, length: int) -> ChunkIndex:
        head = self._file.body(offset, 64)
        start, end, size, _ = _CHUNK.unpack_from(head)
        (width,) = _TEXT.unpack_from(head, _CHUNK.size)
        name = _CHUNK.size + _TEXT.size
        return ChunkIndex(
            chunk_length=length,
            chunk_start_offset=offset,
            compression=head[name : name + width].decode(),
            compressed_size=_LENGTH.unpack_from(head, name + width)[0],
            message_end_time=end,
            message_index_length=0,
            message_index_offsets={},
            message_start_time=start,
            uncompressed_size=size,
        )
