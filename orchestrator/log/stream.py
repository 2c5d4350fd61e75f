"""Reading of selected columns chunk by chunk; wired inputs are reconstructed from recorded outputs.

Chunks, compressed message records, are checked, unpacked and split by channel.
"""

from __future__ import annotations

import struct
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from orchestrator.files.budget import most_records
from orchestrator.log.container_reader import DAMAGE, HEAD, ContainerReader, LogUnreadable
from orchestrator.log.log_metadata import RecordedChannel
from orchestrator.log.message_records import LOG_TIME, Messages, Records, records_by_channel, size_of
from orchestrator.log.schema import Bytes
from orchestrator.log.time_series import (
    EVER,
    Floats,
    Rule,
    Series,
    Wire,
    empty_series,
    join_series,
    wired_inputs,
    within,
)

CACHED_BYTES = 256 << 20  # bytes of unpacked chunks that an open log keeps in memory
SMALL = 32 << 20  # packed bytes of a log whose chunks are all kept: results pass over it a dozen times
_TIME = struct.Struct("<Q")
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

    def add(self, offset: int) -> None:
        """Register the chunk at ``offset`` with the first and last time in its header."""
        first, last = _SPAN.unpack(self._file.body(offset, _SPAN.size).ljust(_SPAN.size, b"\0"))
        self.spans[offset] = 1e-9 * first, 1e-9 * last
        self._file.take_chunk(offset)
        self._file.release_record(offset)

    def add_message(self, offset: int) -> None:
        """Register a message outside a chunk, which is read with those beside it."""
        part = self._file.add_message(offset)
        (t,) = _TIME.unpack(self._file.body(offset, LOG_TIME - HEAD.size + _TIME.size)[LOG_TIME - HEAD.size :])
        first, last = self.spans.get(part, (1e-9 * t, 1e-9 * t))
        self.spans[part] = min(first, 1e-9 * t), max(last, 1e-9 * t)

    def read(self, offset: int, topics: Collection[str] | None = None, keep: bool = False) -> list[Messages]:
        """Return the message records of a chunk, one ``Messages`` per channel; raises LogUnreadable.

        ``topics`` selects (None: all). ``keep``: keep the unpacked chunk in memory while there is room, as those
        of a small log are in any case.
        """
        try:
            kept = self.unpacked.get(offset)
            if kept is None:
                return self._unpack(offset, topics, keep or self._is_small)
            return kept if topics is None else [messages for messages in kept if messages.topic in topics]
        except DAMAGE as damage:
            raise LogUnreadable(
                f"{self._file.path}: the chunk at byte {offset} is damaged ({damage}); 'log recover' saves the rest"
            ) from None

    @cached_property
    def _is_small(self) -> bool:
        return sum(map(self._file.packed_size, self.spans)) <= SMALL

    def rows_of(self, number: int) -> Iterator[NDArray[np.uint8]]:
        """Yield the message records (m, bytes) of a channel that is not ours, chunk by chunk; raises LogUnreadable."""
        for offset in self.spans:
            try:
                content = np.frombuffer(self._file.content(offset), np.uint8)
                records = records_by_channel(content, {}, most_records(self._file.packed_size(offset)), (number,))
                if number in records:
                    yield records[number].rows(content)
            except DAMAGE as damage:
                raise LogUnreadable(f"{self._file.path}: the chunk at byte {offset} is damaged ({damage})") from None

    def _unpack(self, offset: int, topics: Collection[str] | None, keep: bool) -> list[Messages]:
        """Return the message records of topics of a chunk; raises one of DAMAGE."""
        content = np.frombuffer(self._file.content(offset), np.uint8)
        most = most_records(self._file.packed_size(offset))
        records = records_by_channel(content, self._file.message_offsets(offset), most, self._channels)
        keep = keep and len(content) <= self._room
        messages = [
            _messages(content, channel, records[number])
            for number, channel in self._channels.items()
            if number in records and (keep or topics is None or channel.topic in topics)
        ]
        if not keep:
            self._file.release_record(offset)
            return messages
        self._room -= len(content)  # topics are read one after another, so a kept chunk is unpacked once
        self.unpacked[offset] = messages
        return [one for one in messages if topics is None or one.topic in topics]


def _messages(content: Bytes, channel: RecordedChannel, records: Records) -> Messages:
    size = size_of(channel.layout)
    if records.size != size:
        raise ValueError(f"a message of {channel.topic} does not have {size} bytes")
    return Messages(channel.topic, channel.names, channel.layout, records.rows(content))


FEW = 4  # fewer than one variable in four: each is decoded separately
Steps = NDArray[np.int64]


class NotInOrder(ValueError):
    """Messages of a topic whose step numbers or times do not increase; the message is one sentence."""


class Stream:
    """Reader of selected columns; gets the chunks of a log in order, returns messages once complete.

    An input message whose outputs are missing in the log is left out.

    :param recorded: channels of the log by topic.
    :param wanted: topic -> columns.
    :param window: closed time interval, s.
    """

    def __init__(
        self,
        recorded: Mapping[str, RecordedChannel],
        wanted: Mapping[str, Sequence[int]],
        window: tuple[float, float] = EVER,
    ) -> None:
        needed: dict[str, set[str]] = {}
        for topic, columns in wanted.items():
            for wire, wired in _wired(recorded[topic], [recorded[topic].about.names[column] for column in columns]):
                needed.setdefault(wire.source, set()).update(wired)
        self._window = window
        self._outputs = {source: _Outputs(recorded[source], sorted(names)) for source, names in needed.items()}
        self._topics = {topic: _Topic(recorded[topic], columns, self._outputs) for topic, columns in wanted.items()}
        self.topics = {*self._topics, *self._outputs}  # topics whose messages ``add`` needs

    @property
    def is_waiting(self) -> bool:
        """Whether some messages still lack outputs of a later chunk."""
        return any(len(topic.steps) for topic in self._topics.values())

    def add(self, piece: Iterable[Messages]) -> dict[str, Series]:
        """Add the messages of the next chunk; return the messages that are complete now, by topic.

        Raises NotInOrder.
        """
        for messages in piece:
            if messages.topic in self._outputs:
                self._outputs[messages.topic].add(messages)
            if messages.topic in self._topics:
                self._topics[messages.topic].add(messages, self._window)
        whole = {name: topic.pop_complete() for name, topic in self._topics.items()}
        for source, outputs in self._outputs.items():
            users = [topic for topic in self._topics.values() if any(part.source == source for part in topic.parts)]
            outputs.drop_before(min(topic.next for topic in users))
        return {name: series for name, series in whole.items() if len(series.t)}


class _Outputs:
    """Output columns that wires need from one topic; holds the rows that inputs may still need."""

    def __init__(self, recorded: RecordedChannel, names: Sequence[str]) -> None:
        self.names = list(names)
        self._held = [recorded.columns.index(recorded.about.names.index(name)) for name in names]
        self.sequence = np.empty(0, np.int64)
        self.values = np.empty((0, len(names)))

    def add(self, messages: Messages) -> None:
        """Append the rows of later messages; raises NotInOrder."""
        self.sequence = np.concatenate([self.sequence, messages.sequence.astype(np.int64)])
        _check_order(messages.topic, self.sequence)
        self.values = np.concatenate([self.values, decode_columns(messages, self._held).values])

    def drop_before(self, number: int) -> None:
        """Drop the rows of steps before ``number``."""
        first = int(np.searchsorted(self.sequence, number))
        self.sequence, self.values = self.sequence[first:], self.values[first:]

    def find(self, steps: Steps) -> tuple[NDArray[np.intp], NDArray[np.bool_]]:
        """Return row numbers (m,) of steps (m,), and a mask (m,) of the steps that are present."""
        if not len(self.sequence):
            return np.zeros(len(steps), np.intp), np.zeros(len(steps), bool)
        rows = np.minimum(np.searchsorted(self.sequence, steps), len(self.sequence) - 1)
        return rows, self.sequence[rows] == steps

    def rows(self, which: NDArray[np.intp], columns: list[int]) -> Floats:
        """Return values (m, columns) of rows and columns."""
        consecutive = bool((np.diff(which) == 1).all())  # the usual case: a view instead of a copy
        return (self.values[which[0] : which[-1] + 1] if consecutive else self.values[which])[:, columns]


class _WiredColumns(NamedTuple):
    """Selected inputs of a topic that one wire defines."""

    source: str
    rule: Rule
    outputs: list[int]  # columns of ``_Outputs``
    places: list[int]  # columns among the selected ones

    @property
    def delay(self) -> int:
        """Number of steps from an input to the last output that it needs: 0 or 1."""
        return int(self.rule != "start")


class _Topic:
    """Selected topic with the messages that wait for outputs."""

    def __init__(self, recorded: RecordedChannel, columns: Sequence[int], outputs: Mapping[str, _Outputs]) -> None:
        names = [recorded.about.names[column] for column in columns]
        recorded_column = {column: k for k, column in enumerate(recorded.columns)}
        self._recorded = [
            k for k, column in enumerate(columns) if column in recorded_column
        ]  # selected columns that are recorded
        self._held = [recorded_column[columns[k]] for k in self._recorded]
        self._outputs = outputs
        self.parts = [
            _WiredColumns(
                wire.source,
                wire.rule,
                [outputs[wire.source].names.index(name) for name in wired],
                [names.index(name) for name in wired.values()],
            )
            for wire, wired in _wired(recorded, names)
        ]
        self.next = 0  # step number of the first message that is not returned yet
        self._newest = -np.inf  # time of the last message, s
        self.steps = np.empty(0, np.int64)  # step numbers of the waiting messages
        self._nothing = self._waiting = empty_series(names)

    def add(self, messages: Messages, window: tuple[float, float]) -> None:
        """Append later messages in the window; raises NotInOrder."""
        series, steps = decode_columns(messages, self._held), messages.sequence.astype(np.int64)
        _check_order(messages.topic, np.append(self.next - 1, steps))
        _check_order(messages.topic, np.append(self._newest, series.t))
        self.next, self._newest = int(steps[-1]) + 1, float(series.t[-1])
        if self.parts:
            values = np.empty((len(series.t), len(self._nothing.names)))
            values[:, self._recorded] = series.values
            series = series._replace(names=self._nothing.names, values=values)
        if not (series.t[0] >= window[0] and series.t[-1] <= window[1]):
            inside = within(series.t, window)
            series, steps = series.rows(inside), steps[inside]
        if len(self.steps):
            series, steps = join_series([self._waiting, series]), np.concatenate([self.steps, steps])
        self._waiting, self.steps = series, steps

    def pop_complete(self) -> Series:
        """Return the messages whose outputs have come, without those whose outputs are missing in the log."""
        decided = len(self.steps)
        for part in self.parts:
            sequence = self._outputs[part.source].sequence
            newest = int(sequence[-1]) - part.delay if len(sequence) else -1
            decided = min(decided, int(np.searchsorted(self.steps, newest, "right")))
        steps, series = self.steps[:decided], self._waiting.rows(slice(decided))
        complete = np.ones(decided, bool)
        for part in self.parts:
            outputs = self._outputs[part.source]
            first, present = outputs.find(steps)
            complete &= present | (part.rule == "end")
            last, present = outputs.find(steps + part.delay)
            complete &= present
            if decided and len(outputs.sequence):
                end = outputs.rows(last, part.outputs)
                start = outputs.rows(first, part.outputs) if part.rule == "middle" else end
                series.values[:, part.places] = wired_inputs(part.rule, start, end)
        self.steps, self._waiting = self.steps[decided:], self._waiting.rows(slice(decided, None))
        if len(self.steps):
            self.next = int(self.steps[0])
        return series if complete.all() else series.rows(complete)


def _check_order(topic: str, numbers: Floats | Steps) -> None:
    if not (numbers[1:] > numbers[:-1]).all():
        raise NotInOrder(f"the messages of {topic} are not in order of time")


def _wired(recorded: RecordedChannel, names: Sequence[str]) -> Iterator[tuple[Wire, dict[str, str]]]:
    """Yield each wire of any inputs ``names`` with its pairs output -> input among them."""
    for wire in recorded.about.wires:
        wired = {output: given for output, given in zip(wire.outputs, wire.inputs, strict=True) if given in names}
        if wired:
            yield wire, wired


def decode_columns(messages: Messages, columns: Sequence[int]) -> Series:
    """Decode columns of messages; a few columns are decoded one by one, else all at once."""
    if FEW * len(columns) < len(messages.names):
        return messages.decode(columns)
    whole = messages.decode()
    return whole if list(columns) == [*range(len(messages.names))] else whole.columns(columns)
