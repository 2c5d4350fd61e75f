"""Contents of a log except its messages, from the summary at the end of the file or from a walk through all records.

The summary is used if it is there and its checksum and counts hold; opening a large log then reads little of it.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from typing import Any

from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, Metadata, Schema, Statistics

from orchestrator.log import log_metadata, seal
from orchestrator.log.container_reader import DAMAGE, INDEXES, ContainerReader, LogUnreadable, parse_record
from orchestrator.log.message_records import descriptions
from orchestrator.log.stream import Chunks
from orchestrator.log.time_series import Topic

COUNTED = {  # number in the statistics by opcode
    Opcode.SCHEMA: "schema_count",
    Opcode.CHANNEL: "channel_count",
    Opcode.CHUNK_INDEX: "chunk_count",
    Opcode.ATTACHMENT_INDEX: "attachment_count",
    Opcode.METADATA_INDEX: "metadata_count",
}


class LogContents:
    """Topics, metadata, attachments and closing record of a log; ``chunks`` gets the places of the messages.

    :param by_index: use the summary if it is whole; otherwise, or else, every record is walked.
    :raises LogUnreadable: for a log of a newer format.
    """

    def __init__(self, file: ContainerReader, by_index: bool) -> None:
        self._file = file
        self.topics: dict[str, Topic] = {}
        self.metadata: dict[str, dict[str, str]] = {}
        self.others: dict[str, str] = {}  # topics of other tools -> message type and encoding
        self.other_channels: dict[str, int] = {}  # their numbers
        self.closing: dict[str, Any] | None = None
        self.contents: dict[str, str] = {}  # digests of metadata and channels (``seal``)
        self.attachments: dict[str, int] = {}  # name -> offset
        self.recorded: dict[str, log_metadata.RecordedChannel] = {}
        self._schemas: dict[int, Schema] = {}
        self._channels: dict[int, log_metadata.RecordedChannel] = {}
        self.chunks = Chunks(file, self._channels)
        if not (by_index and self._read_summary()):
            self._clear()
            self._file.walk(self._register)
        self._check_wires()

    def _clear(self) -> None:
        named = self.topics, self.metadata, self.others, self.other_channels, self.attachments, self.recorded
        held: tuple[dict, ...] = (*named, self.contents)
        for entries in (*held, self._schemas, self._channels, self.chunks.spans):
            entries.clear()
        self.closing = None

    def _read_summary(self) -> bool:
        """Register what the summary lists; return whether it is whole."""
        counts: Counter[int] = Counter()
        statistics = None
        try:
            for opcode, offset in self._file.summary():
                self._file.take_record(opcode, offset)
                counts[opcode] += 1
                if opcode == Opcode.STATISTICS:
                    statistics = self._file.record(Statistics, offset)
                elif opcode in INDEXES:
                    self._register_indexed(opcode, self._file.record(INDEXES[opcode][0], offset))
                elif opcode in COUNTED:
                    self._register(opcode, offset)
        except DAMAGE:
            return False
        if statistics is None or (statistics.message_count and not statistics.chunk_count):  # messages outside chunks
            return False
        return all(counts[code] == getattr(statistics, key) for code, key in COUNTED.items())

    def _register_indexed(self, opcode: int, index: Any) -> None:
        """Register what an index record points at; raises one of DAMAGE."""
        if opcode == Opcode.CHUNK_INDEX:
            self.chunks.spans[index.chunk_start_offset] = 1e-9 * index.message_start_time, 1e-9 * index.message_end_time
            self._file.take_chunk(index.chunk_start_offset, index.uncompressed_size)
        elif opcode == Opcode.ATTACHMENT_INDEX:
            self.attachments[index.name] = index.offset
        elif self._file.opcode(index.offset) != Opcode.METADATA:
            raise ValueError(f"there are no metadata at byte {index.offset}")
        else:
            self._register(Opcode.METADATA, index.offset)

    def _register(self, opcode: int, offset: int) -> None:
        """Register a record; raises one of DAMAGE."""
        if opcode == Opcode.CHUNK:
            self.chunks.add(offset)
            if not self._file.is_ours:
                self._register_descriptions(offset)
        elif opcode == Opcode.MESSAGE:
            self.chunks.add_message(offset)
        elif opcode == Opcode.ATTACHMENT:
            self.attachments[self._file.record(Attachment, offset).name] = offset
        elif opcode == Opcode.METADATA:
            record = self._file.record(Metadata, offset)
            if record.name not in (log_metadata.CLOSING, seal.SEAL):
                self.contents[f"metadata:{record.name}"] = seal.metadata_digest(record.metadata)
            if record.name == log_metadata.FORMAT:
                self._check_format(record.metadata)
            elif record.name == log_metadata.CLOSING:
                self.closing = log_metadata.decode_closing(record.metadata)
            elif record.name != seal.SEAL:  # of a log of 0.4.0
                self.metadata[record.name] = record.metadata
        elif opcode == Opcode.SCHEMA:
            schema = self._file.record(Schema, offset)
            self._schemas[schema.id] = schema
        elif opcode == Opcode.CHANNEL:
            self._register_channel(self._file.record(Channel, offset))

    def _register_descriptions(self, offset: int) -> None:
        """Register schemas and channels in a chunk, where other writers have them; raises one of DAMAGE."""
        for opcode, body in descriptions(self._file.content(offset)):
            if opcode == Opcode.SCHEMA:
                schema = parse_record(Schema, body)
                self._schemas[schema.id] = schema
            else:
                self._register_channel(parse_record(Channel, body))
        self._file.release_record(offset)

    def _check_format(self, record: Mapping[str, str]) -> None:
        """Raise LogUnreadable for a log of a newer format."""
        try:
            log_metadata.check_version(record)
        except log_metadata.TooNew as newer:
            self._file.close()
            raise LogUnreadable(f"{self._file.path} {newer}") from None

    def _register_channel(self, channel: Channel) -> None:
        """Register a channel; one that ``recorder`` did not write goes to ``others``."""
        if channel.id in self._channels or channel.id in self.other_channels.values():
            return
        digest = seal.channel_digest(channel, self._schemas.get(channel.schema_id))
        self.contents[f"channel:{channel.topic}"] = digest
        if "places" not in channel.metadata:
            schema = self._schemas.get(channel.schema_id)
            kind = schema.name if schema else "", channel.message_encoding
            self.others[channel.topic] = ", ".join(filter(None, kind))
            self.other_channels[channel.topic] = channel.id
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
                names = () if source is None else source.names
                if source is None or source.about.every > 1 or not set(wire.outputs) <= set(names):
                    self._file.add_fault(
                        f"{self._file.path}: {topic} is wired to {wire.source}, which lacks what it needs"
                    )
                    self.topics.pop(topic, None)
        for number in [number for number, channel in self._channels.items() if channel.topic not in self.topics]:
            del self._channels[number]
