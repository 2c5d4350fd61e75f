"""Reader of a log, whole or cut off: every complete message as arrays with the recorded bits.

``complete`` and ``faults`` tell what is missing. Contents are checked against their CRCs when they are read. ``read``
keeps its result in memory; ``stream``, ``select``, ``ends`` and ``blocks`` keep as many unpacked chunks as ``kept`` has
room for, so that a long log needs no more memory.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager
from functools import cached_property
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from orchestrator.files.budget import DOCUMENT, check_size
from orchestrator.files.messages import LOG
from orchestrator.log import log_metadata, notices, seal, signal_names
from orchestrator.log.angles import continuous, turn_of
from orchestrator.log.container import KEPT, Container, ForeignLog, LogUnreadable
from orchestrator.log.message_records import Messages
from orchestrator.log.signal_names import Names, recorded_texts
from orchestrator.log.stream import NotInOrder, Stream
from orchestrator.log.time_series import ALL_TIME, Floats, Series, empty_series, join_series

MAX_CHANGES = 3  # that a message names


class Missing(LookupError):
    """The log lacks the topic, variable, attachment or figure that was asked for; the message is one sentence."""


class NoSuchTime(Missing):
    """The log has no instant of a window of time."""


class Log(AbstractContextManager["Log"]):
    """Log opened for reading (a context manager).

    ``topics``, ``metadata`` (name -> key -> value) and ``attachments`` (names) were written before step 0.
    ``closing`` is the closing record with ``status``, ``message``, ``steps``, ``results``, ``warnings`` (dicts with
    component, text, time in s and count), and ``messages`` and ``sha256`` by topic; None if the log was cut off.
    ``complete``: closing record and indexes exist and opening found no fault. ``faults``: sentences. ``seal``: digest
    of the closing record, "" without one; attachments are checked by it when they are read, all by ``seal_faults``.
    ``unsound``: sentence about a run that failed or a log that was cut off, empty for another one.

    :param unfinished: the run may still be going on; otherwise opening a log that was cut off logs a warning.
    :param by_index: open the log by the summary at its end if this is whole; False: look at every record.
    :param kept: bytes of unpacked messages that stay in memory until the log is closed.
    :raises LogUnreadable: if the file is missing or no log.
    """

    def __init__(
        self, path: str | os.PathLike[str], unfinished: bool = False, by_index: bool = True, kept: int = KEPT
    ) -> None:
        self.path = Path(path)
        self._file = file = Container(self.path, by_index, kept)
        unmarked = f"metadata:{log_metadata.FORMAT}" not in file.contents
        if unmarked and not file.topics and not file.is_ours:
            header = file.header
            file.close()
            raise ForeignLog(notices.foreign(self.path, header, file.others))
        self.size, self.faults = file.size, file.faults
        self.being_written = file.being_written  # by a run that has not ended
        self.topics, self.metadata, self.closing = file.topics, file.metadata, file.closing
        self.others = file.others  # topics of other tools, left out by this reader -> type, encoding
        self.seal = (file.closing or {"seal": ""})["seal"]
        self._recorded = file.recorded
        self._series: dict[str, Series] = {}
        self.complete = self.closing is not None and file.ended and not self.faults
        is_cut_off = self.closing is None and bool(self.topics) and not self.being_written
        last = max((end for _, end in file.spans.values()), default=0.0)
        self.stripped = is_cut_off and not file.is_ours and unmarked
        cut_off = notices.stripped(self.path) if self.stripped else notices.cut_off(self.path, last)
        self.cut_off = cut_off if is_cut_off else ""
        closing = self.closing or {"status": ""}
        self.unsound = notices.failed(self.path, closing["message"]) if closing["status"] == "failed" else self.cut_off
        if self.unsound and not unfinished:
            LOG.warning(self.unsound)
        self._places: dict[str, tuple[str, int]] = {}
        for topic, about in self.topics.items():
            for column in range(len(about.names)):
                self._places.setdefault(self.name(topic, column), (topic, column))

    def __exit__(self, *ended: object) -> None:
        self.close()

    def close(self) -> None:
        """Close the file; arrays that were read remain valid."""
        self._file.unpacked.clear()
        self._file.close()

    @property
    def attachments(self) -> tuple[str, ...]:
        """Names of the attached files."""
        return tuple(self._file.attachments)

    @property
    def signals(self) -> tuple[str, ...]:
        """Every recorded variable as "instance.variable"."""
        return tuple(self._places)

    def attachment(self, name: str) -> bytes:
        """Return the content of an attached file; raises Missing, LogUnreadable."""
        if name not in self._file.attachments:
            raise Missing(f"{self.path} has no attachment '{name}'{signal_names.near(name, self._file.attachments)}")
        content, listed = self._file.attachment(name), (self.closing or {"contents": {}})["contents"]
        if listed.get(f"attachment:{name}", digest := seal.attachment_digest(content)) != digest:
            raise LogUnreadable(f"{self.path} is not as it was sealed: the attachment '{name}' is changed")
        return content

    def table(self, name: str) -> dict[str, Any]:
        """Return the JSON object in an attached file; raises Missing, LogUnreadable."""
        content = self.attachment(name)
        try:
            check_size(content, DOCUMENT)
            table = json.loads(content)
            json.dumps(table, ensure_ascii=False).encode()  # raises ValueError for half a surrogate pair
        except (ValueError, RecursionError) as damage:
            raise LogUnreadable(f"{self.path}: the attachment '{name}' is not readable JSON: {damage}") from None
        if not isinstance(table, dict):
            raise LogUnreadable(f"{self.path}: the attachment '{name}' is no JSON object")
        return table

    @cached_property
    def _texts(self) -> dict[str, str]:
        """Texts by "instance.variable"."""
        owners = dict.fromkeys(map(signal_names.owner, self.topics))
        texts = {one: recorded_texts(self.attachment, one) for one in owners}
        return {f"{one}.{variable}": text for one, own in texts.items() for variable, text in own.items()}

    def read(self, topic: str) -> Series:
        """Return all messages of a topic; raises Missing, LogUnreadable.

        The result is cached: do not write into the arrays.
        """
        if topic not in self._series:
            every = range(len(self.topics[self.known_topic(topic)].names))
            pieces = self._stream({topic: every}, self._file.spans)
            self._series[topic] = join_series([self._empty_series(topic), *(piece[topic] for piece in pieces)])
        return self._series[topic]

    def require_window(self, start: float, end: float, timed: bool = True) -> None:
        """Raise NoSuchTime for a window that ends before it begins or, of ``timed``, s, has no instant of the run."""
        given, spans = f"from {start:g} to {end:g}", np.array([*self._file.spans.values()]).reshape(-1, 2)
        if not start <= end:
            raise NoSuchTime(f"{given}: the first instant must not be after the last")
        first, last = spans.min(initial=np.inf), spans.max(initial=-np.inf)
        if timed and len(spans) and not (start <= last + 1e-9 and first <= end + 1e-9):
            raise NoSuchTime(f"{given}: the run is recorded from {first:g} to {last:g} s")

    def stream(
        self, wanted: Mapping[str, Sequence[int]], window: tuple[float, float] = ALL_TIME
    ) -> Iterator[dict[str, Series]]:
        """Yield columns of topics in a closed time interval, s, in one pass through the file.

        ``wanted``: topic -> columns. A piece holds some messages of some of the topics.
        Raises Missing, LogUnreadable.
        """
        return self._stream(wanted, self._file.spans, window)

    def _stream(
        self,
        wanted: Mapping[str, Sequence[int]],
        chunks: Iterable[int],
        window: tuple[float, float] = ALL_TIME,
    ) -> Iterator[dict[str, Series]]:
        for topic in wanted:
            self.known_topic(topic)
        stream = Stream(self._recorded, wanted, window)
        for offset in chunks:
            first, last = self._file.spans[offset]
            if last >= window[0] - 1e-6 and (first <= window[1] + 1e-6 or stream.is_waiting):
                try:
                    piece = stream.add(self._file.read(offset, stream.topics))
                except NotInOrder as damage:
                    raise LogUnreadable(f"{self.path}: {damage}") from None
                if piece:
                    yield piece

    def select(self, wanted: Mapping[str, Sequence[int]], window: tuple[float, float] = ALL_TIME) -> dict[str, Series]:
        """Return columns of topics in a closed time interval, s; raises Missing, LogUnreadable."""
        by_topic = {topic: [self._empty_series(topic).columns(columns)] for topic, columns in wanted.items()}
        for piece in self.stream(wanted, window):
            for topic, series in piece.items():
                by_topic[topic].append(series)
        return {topic: join_series(parts) for topic, parts in by_topic.items()}

    def ends(self, topic: str) -> Series:
        """Return the first and the last message of a topic, empty without messages.

        Raises Missing, LogUnreadable.
        """
        wanted = {topic: range(len(self.topics[self.known_topic(topic)].names))}
        offsets = list(self._file.spans)
        first = next(self._stream(wanted, offsets), None)
        if first is None:
            return self._empty_series(topic)
        for number in range(1, len(offsets) + 1):  # more and more chunks from the end, until one has a message
            *_, last = [None, *self._stream(wanted, offsets[-number:])]
            if last is not None:
                break
        assert last is not None
        return join_series([first[topic].rows(slice(1)), last[topic].rows(slice(-1, None))])

    def blocks(
        self,
        topics: Sequence[str] | Mapping[str, Sequence[int]],
        size: int,
        more: int = 0,
        window: tuple[float, float] = ALL_TIME,
    ) -> Iterator[dict[str, Series]]:
        """Yield topics, or columns of topics, in blocks of equally many messages in a closed time interval, s.

        A block has ``size`` + ``more`` messages of each topic; the last ``more`` begin the next block. The last block
        holds the rest, possibly with different numbers by topic. Blocks do not depend on the chunks of the file.
        Raises Missing, LogUnreadable.
        """
        whole_topics = {topic: range(len(self.topics[self.known_topic(topic)].names)) for topic in topics}
        wanted = topics if isinstance(topics, Mapping) else whole_topics
        waiting = {topic: [self._empty_series(topic).columns(columns)] for topic, columns in wanted.items()}
        for piece in self.stream(wanted, window):
            for topic, series in piece.items():
                waiting[topic].append(series)
            while min(sum(len(part.t) for part in parts) for parts in waiting.values()) >= size + max(more, 1):
                whole = {topic: join_series(parts) for topic, parts in waiting.items()}
                yield {topic: series.rows(slice(size + more)) for topic, series in whole.items()}
                waiting = {topic: [series.rows(slice(size, None))] for topic, series in whole.items()}
        yield {topic: join_series(parts) for topic, parts in waiting.items()}

    def choose(self, signals: Names | Sequence[Names] = (), topics: Sequence[str] = ()) -> dict[str, list[int]]:
        """Return topic -> columns for a signal ("instance.variable") or several, and whole topics, in the log's order.

        ``*`` stands for any text; without arguments everything is selected. Raises Missing.
        """
        signals = signal_names.listed(signals)
        if not topics and not signals:
            return {topic: [*range(len(about.names))] for topic, about in self.topics.items()}
        chosen: dict[str, set[int]] = {}
        for wanted in topics:
            matches = [topic for topic in self.topics if signal_names.matches(wanted, topic)]
            for topic in matches or [self.known_topic(wanted)]:
                chosen.setdefault(topic, set()).update(range(len(self.topics[topic].names)))
        for wanted in signals:
            for signal in [name for name in self.signals if signal_names.matches(wanted, name)] or [wanted]:
                topic, column = self.find(signal)
                chosen.setdefault(topic, set()).add(column)
        return {topic: sorted(chosen[topic]) for topic in self.topics if topic in chosen}

    def sample(self, signals: Sequence[str], t: Floats) -> Floats:
        """Interpolate signals linearly, angles without jumps, at times ``t`` (m,), s; returns (m, signals).

        Values are held before the first and after the last record. Frequencies above half the sampling rate of ``t``
        are aliased: average first where that matters. Raises Missing, LogUnreadable.
        """
        places = [self.find(signal) for signal in signals]
        wanted: dict[str, list[int]] = {}
        for topic, column in places:
            wanted.setdefault(topic, []).append(column)
        series = self.select(wanted)
        column_of = {(topic, column): k for topic, columns in wanted.items() for k, column in enumerate(columns)}
        columns = []
        for topic, column in places:
            values = continuous(
                series[topic].values[:, column_of[topic, column]], turn_of(self.topics[topic].units[column])
            )
            columns.append(np.interp(t, series[topic].t, values))
        return np.stack(columns, axis=1)

    def lengths(self) -> dict[str, int]:
        """Count the messages of each topic; raises LogUnreadable."""
        counts = dict.fromkeys(self.topics, 0)
        for offset in self._file.spans:
            for messages in self._file.read(offset, counts):
                counts[messages.topic] += len(messages.rows)
        return counts

    def sequence(self, topic: str) -> NDArray[np.uint32]:
        """Return the step numbers (m,) of a topic's messages; raises LogUnreadable."""
        return np.concatenate([np.empty(0, np.uint32), *(messages.sequence for messages in self._messages_of(topic))])

    def known_topic(self, topic: str) -> str:
        """Return the topic if the log has it, else raise Missing."""
        if topic not in self.topics:
            raise Missing(f"{self.path} has no topic '{topic}'{signal_names.near(topic, self.topics)}")
        return topic

    def name(self, topic: str, column: int) -> str:
        """Return "instance.variable" of a column of a topic."""
        return f"{signal_names.owner(topic)}.{self.topics[topic].names[column]}"

    def __contains__(self, signal: object) -> bool:
        """Whether the log has the signal "instance.variable"."""
        return signal in self._places

    def find(self, signal: str) -> tuple[str, int]:
        """Return topic and column of "instance.variable"; raises Missing."""
        if signal not in self._places:
            near = signal_names.components(signal, self._places)
            near = near or signal_names.near(signal, self._places, self._texts)
            raise Missing(f"{self.path} has no signal '{signal}'{near}")
        return self._places[signal]

    def signal(self, name: str) -> tuple[Floats, Floats]:
        """Return times (m,), s, and values (m,) of "instance.variable"; raises Missing, LogUnreadable."""
        topic, column = self.find(name)
        series = self.read(topic)
        return series.t, series.values[:, column]

    def unit(self, name: str) -> str:
        """Return the unit of "instance.variable"; raises Missing."""
        topic, column = self.find(name)
        return self.topics[topic].units[column]

    def chunks(self) -> Iterator[list[Messages]]:
        """Yield the messages of each chunk by topic, as recorded; raises LogUnreadable at a damaged chunk."""
        for offset in self._file.spans:
            yield self._file.read(offset)

    def intact(self) -> Iterator[Messages]:
        """Yield all messages, chunk by chunk and by topic; damaged chunks are left out and go to ``faults``."""
        for offset in self._file.spans:
            try:
                yield from self._file.read(offset)
            except LogUnreadable as damage:
                self._file.add_fault(str(damage))

    def hashes(self) -> dict[str, str]:
        """Return topic -> sha256 over sequence, times and data of its messages; raises LogUnreadable."""
        return dict(self._hashes)

    @cached_property
    def _hashes(self) -> dict[str, str]:
        hashes = {topic: hashlib.sha256() for topic in self.topics}
        for messages in chain.from_iterable(self.chunks()):
            hashes[messages.topic].update(messages.hashed_bytes())
        return {topic: value.hexdigest() for topic, value in hashes.items()}

    def digest(self, hashes: Mapping[str, str] | None = None) -> str:
        """Return one sha256 over names, units and messages of all topics but /stats; equal for equal runs.

        ``hashes``: result of ``hashes()`` if known, which saves a pass. Raises LogUnreadable.
        """
        about = {topic: (*entry[:3], *([entry.wires] if entry.wires else [])) for topic, entry in self.topics.items()}
        entries = [
            [topic, *about[topic], value]
            for topic, value in sorted((hashes or self.hashes()).items())
            if not topic.startswith("/stats/")
        ]
        return hashlib.sha256(json.dumps(entries).encode()).hexdigest()

    def sound(self) -> bool:
        """Whether the checksum over all data, without the indexes at the end, holds."""
        return self._file.data_sound()

    def seal_faults(self, hashes: Mapping[str, str] | None = None) -> list[str]:
        """Return a sentence if the log is not as it was sealed; reads the whole file.

        ``hashes``: result of ``hashes()`` if known.
        """
        if self.closing is None:
            return []
        if self._file.is_sealed and not self.seal:
            return [f"{self.path} has lost its seal"]
        try:
            changed = (
                [*self._changes(self.closing, hashes)]
                if self.closing["seal_holds"]
                else ["its closing record is changed"]
            )
        except LogUnreadable as damage:
            return [str(damage)]
        more = f", and {len(changed) - MAX_CHANGES} more" if len(changed) > MAX_CHANGES else ""
        return [f"{self.path} is not as it was sealed: {', '.join(changed[:MAX_CHANGES])}{more}"] if changed else []

    def _changes(self, closing: Mapping[str, Any], hashes: Mapping[str, str] | None) -> Iterator[str]:
        """Yield in words what is not as the closing record has it; raises LogUnreadable."""
        listed = {**closing["contents"], **{f"sha256:{topic}": one for topic, one in closing["sha256"].items()}}
        found = {f"sha256:{topic}": one for topic, one in (hashes or self.hashes()).items()}
        if closing["contents"]:  # older logs have none
            found |= {
                f"attachment:{name}": seal.attachment_digest(self._file.attachment(name)) for name in self.attachments
            }
            found |= self._file.contents
        for number, (channel, _) in self._file.other_channels.items():
            topic = channel.topic
            if f"messages:{topic}" in listed:
                rows = (np.frombuffer(record, np.uint8)[None] for _, record in self._file.messages([number]))
                found[f"messages:{topic}"] = seal.messages_digest(rows)
            if f"channel:{topic}" not in listed:  # of other software
                found.pop(f"channel:{topic}", None)
        empty = {
            topic for topic in (*self.topics, *self.others, *closing["messages"]) if not closing["messages"].get(topic)
        }
        empty -= {name.removeprefix("messages:") for name in listed}
        yield from seal.changes(listed, found, {f"{kind}:{topic}" for kind in ("channel", "sha256") for topic in empty})

    def check_seal(self) -> None:
        """Raise LogUnreadable if the log is not as it was sealed; reads the whole file."""
        if faults := self.seal_faults():
            raise LogUnreadable(f"{faults[0]}; 'cotrack log recover' writes a log of what it holds now, sealed anew")

    def notice_seal(self) -> None:
        """Log a warning if the log is not as it was sealed; reads the whole file."""
        for fault in self.seal_faults():
            LOG.warning(fault)

    def check_repeatable(self) -> None:
        """Raise LogUnreadable if the run did not record its inputs, or the log is not as it was sealed.

        Logs a warning if another version ran.
        """
        if self.metadata.get("run", {}).get(log_metadata.INPUTS) == log_metadata.UNRECORDED:
            raise LogUnreadable(
                f"{self.path} cannot be replayed or resumed: its inputs were not recorded (run.inputs = false)"
            )
        self.check_seal()
        if other := notices.other_version(self.path, self.metadata.get("versions", {})):
            LOG.warning(other)

    def checksums(self) -> list[str]:
        """Check attachments and the checksums over all bytes; return faults as sentences (chunks: ``intact``)."""
        faults = []
        for name in self._file.attachments:
            try:
                self.attachment(name)
            except LogUnreadable as damage:
                faults.append(str(damage))
        if self._file.data_end is not None and not self.sound():
            faults.append(f"{self.path}: the checksum over all data does not hold")
        if self._file.ended and not self._file.indexes_sound():
            faults.append(f"{self.path}: the checksum over the indexes does not hold")
        return faults

    def _empty_series(self, topic: str) -> Series:
        """Return an empty series of a topic; raises Missing."""
        return empty_series(self.topics[self.known_topic(topic)].names)

    def _messages_of(self, topic: str) -> Iterator[Messages]:
        return (messages for messages in chain.from_iterable(self.chunks()) if messages.topic == topic)
