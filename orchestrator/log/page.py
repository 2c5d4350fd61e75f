"""Pages: buffers of log rows, which the recorder's thread packs into messages."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from orchestrator.kernels.compiled import kernels
from orchestrator.kernels.tables import RowHead
from orchestrator.log.log_metadata import RecordedChannel
from orchestrator.log.message_records import IDENTITY, LOG_TIME, PREFIX, PUBLISH_TIME, SEQUENCE, prefix, size_of
from orchestrator.log.schema import LENGTH_AT, TIME_AT
from orchestrator.log.time_series import RULES, Floats, Rule, wired_inputs

CHUNK = 1 << 21  # bytes of messages that make a chunk
HEAD = len(RowHead._fields)  # words of a row before its values
NUMBER, NS, TIME, LENGTH = range(HEAD)
WORD = 8  # bytes
Columns = NDArray[np.intp]


class WireViolated(ValueError):
    """An input differs from the value that its wire gives; the message is one sentence."""


class Block:
    """Rows of a page, each a head and then the values. Row 0 repeats the last row of the previous block."""

    def __init__(self, table: Floats, count: int = 1) -> None:
        words = table.view(np.int64)
        self.table = table  # (n + 1, HEAD + values)
        self.sequence = words[:, NUMBER]
        self.ns = table.view(np.uint64)[:, NS]  # written as the rows are packed
        self.t = table[:, TIME]
        self.h = table[:, LENGTH]
        self.values = table[:, HEAD:]
        self.count = count

    def continue_from(self, other: Block) -> Block:
        """Reset this block: row 0 becomes the last row of ``other``."""
        self.table[0] = other.table[other.count - 1]
        self.count = 1
        return self

    def steps(self, first: int, end: int) -> Block:
        """Return the rows of steps ``first`` to ``end`` - 1 as a view on the same memory."""
        begin, stop = np.searchsorted(self.sequence[1 : self.count], [first, end]).tolist()
        return Block(self.table[begin : stop + 1], stop - begin + 1)


class Channel:
    """Message layout, message count and running hash of one topic; raises ValueError for ``every`` < 1."""

    def __init__(self, number: int, recorded: RecordedChannel, is_recorded: bool = True) -> None:
        self.number = number
        self.is_recorded = is_recorded  # False: its values are in rows, but not in the file
        self.recorded = recorded
        self.topic, self.about, self.columns, _, self.layout = recorded
        if self.about.every < 1:
            raise ValueError(f"a topic is recorded every n >= 1 steps, not every {self.about.every}")
        self.size = size_of(self.layout)  # bytes of a message record
        self.hash = hashlib.sha256()
        self.messages = 0
        self._rows = np.empty((0, self.size), np.uint8)  # reused: most bytes of a record never change
        self._hashed = np.empty(0, np.uint8)

    def pack(self, block: Block, due: NDArray[np.int64], moves: NDArray[np.int64]) -> NDArray[np.uint8]:
        """Return message records (m, bytes) of the rows with numbers ``due`` (m,); valid until the next call."""
        m = len(due)
        if m > len(self._rows):
            self._rows = np.empty((m, self.size), np.uint8)
            self._rows[:] = np.frombuffer(prefix(self.number, self.size) + self.layout.template, np.uint8)
            self._hashed = np.empty(m * (self.size - IDENTITY), np.uint8)
        rows = self._rows[:m]
        copy_words(block.table, due, moves, rows)
        return rows

    def count(self, rows: NDArray[np.uint8]) -> None:
        """Add message records (m, bytes) that are in the file to count and hash."""
        hashed = self._hashed[: len(rows) * (self.size - IDENTITY)]
        hashed.reshape(len(rows), -1)[:] = rows[:, IDENTITY:]
        self.hash.update(hashed.data)
        self.messages += len(rows)


def copy_words(rows: Floats, chosen: NDArray[np.int64], moves: NDArray[np.int64], records: NDArray[np.uint8]) -> None:
    """Copy words of rows into message records.

    ``rows`` (rows, words), ``chosen`` (m,) numbers of rows, ``records`` (m, bytes); all arrays are contiguous.
    ``moves`` (n, 2): pairs of a source offset, in bytes from the beginning of the row and possibly negative, and a byte
    of the record. Where two moves overlap the later one wins.
    """
    source, target = (rows.ctypes.data, rows.strides[0]), (records.ctypes.data, records.shape[1])
    kernels().copy_words(*source, chosen.ctypes.data, len(chosen), moves.ctypes.data, len(moves), *target)


class PackedMessages(NamedTuple):
    """Message records of a topic, ready to be written."""

    channel: Channel
    rows: NDArray[np.uint8]  # (m, bytes)
    times: NDArray[np.uint64]  # (m,) ns


class _RowPart(NamedTuple):
    """Part of a row with the values of one topic."""

    channel: Channel
    is_input: bool  # True for inputs of the step that has ended: its number and start time are in the row before
    moves: NDArray[np.int64]  # (n, 2), see ``copy_words``


class _WireCheck(NamedTuple):
    """Columns of a row that are compared by one wire rule."""

    rule: Rule
    outputs: Columns
    inputs: Columns


class Page:
    """Buffer of topics that are written together: one row holds the values of all.

    :param given: topics with the inputs of the step that has ended; their messages carry its number and start time.
    :param shown: topics with values at the time of the row.
    :param whole: rows also hold wired inputs, which are compared with the outputs on this page and not recorded.
    :raises ValueError: if ``whole`` and the page lacks outputs that a wire needs.
    """

    def __init__(self, inputs: Sequence[Channel], outputs: Sequence[Channel], with_wired: bool = True) -> None:
        channels = [*inputs, *outputs]
        self.topics = tuple(channel.topic for channel in channels)
        strides = {channel.about.every for channel in channels}
        self.every = strides.pop() if len(strides) == 1 and not inputs else 1
        self.size = sum(channel.size for channel in channels)  # bytes of the message records of a row
        self.capacity = CHUNK // self.size + 1
        self.widths = [len(channel.about.names if with_wired else channel.columns) for channel in channels]
        self._words = HEAD + sum(self.widths)  # of a row
        self._first = dict(zip(self.topics, np.cumsum([HEAD, *self.widths]).tolist(), strict=False))
        self._parts = []
        for channel in channels:
            columns = np.array(channel.columns, np.intp) if with_wired else np.arange(len(channel.columns))
            is_input = channel in inputs
            self._parts.append(
                _RowPart(channel, is_input, self._moves(channel, is_input, self._first[channel.topic] + columns))
            )
        self._wire_checks = self._make_wire_checks() if with_wired else []
        self.spare_blocks: list[Block] = []
        self.block = self._blank()

    def _blank(self) -> Block:
        return Block(np.zeros((self.capacity + 1, self._words)))

    def _moves(self, channel: Channel, is_input: bool, columns: Columns) -> NDArray[np.int64]:
        """Return the moves (n, 2) from a row with these ``columns`` into a message record of the channel."""
        before = -self._words if is_input else 0  # the previous row holds number and time of the beginning of the step
        head = [(before + NUMBER, SEQUENCE), (before + NS, LOG_TIME)]  # the log time overwrites the number's upper half
        head += [(before + NS, PUBLISH_TIME), (before + TIME, PREFIX + TIME_AT), (LENGTH, PREFIX + LENGTH_AT)]
        order = channel.layout.order
        values = np.column_stack([columns[order], PREFIX + channel.layout.starts[order]])
        moves = np.concatenate([np.array(head), values])
        return np.ascontiguousarray(moves * [WORD, 1], np.int64)

    def _make_wire_checks(self) -> list[_WireCheck]:
        """Return the columns to be compared, by rule; raises ValueError where outputs are missing."""
        about = {part.channel.topic: part.channel.about for part in self._parts}
        place = {
            (topic, name): self._first[topic] + k
            for topic, topic_about in about.items()
            for k, name in enumerate(topic_about.names)
        }
        checks = []
        for rule in RULES:
            outputs, inputs = [], []
            for part in self._parts:
                for wire in part.channel.about.wires:
                    if not part.is_input or wire.source not in about or about[wire.source].every > 1:
                        raise ValueError(f"{part.channel.topic}: not every step of {wire.source} is recorded with it")
                    if wire.rule == rule:
                        outputs += [place[wire.source, name] for name in wire.outputs]
                        inputs += [place[part.channel.topic, name] for name in wire.inputs]
            if inputs:
                checks.append(_WireCheck(rule, np.array(outputs), np.array(inputs)))
        return checks

    def add(self, sequence: int, t: float, h: float, values: Sequence[Floats]) -> None:
        """Append a row with copies of the values of each topic; raises ValueError for a wrong number."""
        block = self.block
        row = block.count
        if [*map(len, values)] != self.widths:
            wrong = zip(self.topics, self.widths, map(len, values), strict=True)
            raise ValueError("; ".join(f"{topic} has {k} variables, not {n}" for topic, k, n in wrong if k != n))
        np.concatenate(values, out=block.values[row])
        block.sequence[row], block.t[row], block.h[row] = sequence, t, h
        block.count = row + 1

    @property
    def free_rows(self) -> int:
        """Number of rows that the block can still take."""
        return self.capacity + 1 - self.block.count

    def commit(self, n: int) -> None:
        """Count n rows that were written into the block's memory behind its last row."""
        self.block.count += n

    def exchange_block(self) -> Block:
        """Return the filled block and replace it by an empty one."""
        filled = self.block
        self.block = (self.spare_blocks.pop() if self.spare_blocks else self._blank()).continue_from(filled)
        return filled

    def pack(self, block: Block) -> list[PackedMessages]:
        """Return the message records of a block, by topic, without topics that have none; raises WireViolated."""
        self._check_wires(block)
        block.ns[: block.count] = np.rint(block.t[: block.count] * 1e9)
        packed = []
        # Many topics share a stride.
        rows_due: dict[tuple[bool, int], tuple[NDArray[np.int64], NDArray[np.uint64]]] = {}
        for channel, is_input, moves in self._parts:
            key = is_input, channel.about.every
            due, times = rows_due[key] = rows_due.get(key) or self._due(block, *key)
            if len(due) and channel.is_recorded:
                packed.append(PackedMessages(channel, channel.pack(block, due, moves), times))
        return packed

    def _due(self, block: Block, is_input: bool, every: int) -> tuple[NDArray[np.int64], NDArray[np.uint64]]:
        """Return numbers (m,) and times (m,), ns, of the rows that a topic of stride ``every`` records."""
        steps = block.sequence[1 : block.count] - is_input
        due = np.flatnonzero((steps % every == 0) & (steps >= 0)) + 1
        return due, block.ns[due - is_input]

    def _check_wires(self, block: Block) -> None:
        """Compare wired inputs with the values that their wires give, bit by bit; raises WireViolated."""
        if not self._wire_checks:
            return
        steps = block.sequence[: block.count]
        begin = 1 + int(block.count > 1 and steps[1] == 0)  # the row of the start has no step before it
        if np.any(np.diff(steps[begin - 1 :]) != 1):
            raise WireViolated("a step is missing")
        before, now = block.table[begin - 1 : block.count - 1], block.table[begin : block.count]
        for check in self._wire_checks:
            start = np.take(before, check.outputs, axis=1)
            end = start if check.rule == "start" else np.take(now, check.outputs, axis=1)
            recorded = np.take(now, check.inputs, axis=1)
            wrong = wired_inputs(check.rule, start, end).view(np.uint64) != recorded.view(np.uint64)
            if wrong.any():
                row, column = np.argwhere(wrong)[0]
                raise WireViolated(self._sentence(float(block.t[begin - 1 + row]), int(check.inputs[column])))

    def _sentence(self, t: float, column: int) -> str:
        topic = max((first, topic) for topic, first in self._first.items() if first <= column)[1]
        names = next(part.channel.about.names for part in self._parts if part.channel.topic == topic)
        return f"{topic}: '{names[column - self._first[topic]]}' at t = {t:.6g} s is not what its coupling's rule gives"
