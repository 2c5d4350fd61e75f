"""Pages: what topics that are written together wait in for the recorder's thread, which packs it into messages."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from orchestrator.kernels.compiled import kernels
from orchestrator.kernels.tables import RowHead
from orchestrator.log.channel_metadata import Recorded
from orchestrator.log.message_records import IDENTITY, LOG_TIME, PREFIX, PUBLISH_TIME, SEQUENCE, prefix, size_of
from orchestrator.log.schema import LENGTH_AT, TIME_AT
from orchestrator.log.wire import RULES, Floats, Rule, handed_over

CHUNK = 1 << 21  # bytes of messages that make a chunk
HEAD = len(RowHead._fields)  # words of a row before its values
NUMBER, NS, TIME, LENGTH = range(HEAD)
WORD = 8  # bytes
Columns = NDArray[np.intp]


class Unproven(ValueError):
    """An input is not what its wire says; the message is one sentence."""


class Block:
    """Rows of a page: a head, then values. Row 0 repeats the last one of the block before."""

    def __init__(self, table: Floats, count: int = 1) -> None:
        words = table.view(np.int64)
        self.table = table  # (n + 1, HEAD + values)
        self.sequence = words[:, NUMBER]
        self.ns = table.view(np.uint64)[:, NS]  # written as the rows are packed
        self.t = table[:, TIME]
        self.h = table[:, LENGTH]
        self.values = table[:, HEAD:]
        self.count = count

    def follow(self, other: Block) -> Block:
        """Begin after another one."""
        self.table[0] = other.table[other.count - 1]
        self.count = 1
        return self

    def steps(self, first: int, end: int) -> Block:
        """Those of its rows that are of steps from ``first`` to before ``end``, in its memory."""
        begin, stop = np.searchsorted(self.sequence[1 : self.count], [first, end]).tolist()
        return Block(self.table[begin : stop + 1], stop - begin + 1)


class Channel:
    """One topic: how its messages lie, how many there are, and their hash."""

    def __init__(self, number: int, recorded: Recorded) -> None:
        self.number = number
        self.recorded = recorded
        self.topic, self.about, self.columns, _, self.layout = recorded
        if self.about.every < 1:
            raise ValueError(f"a topic is recorded every n >= 1 steps, not every {self.about.every}")
        self.size = size_of(self.layout)  # bytes of a message record
        self.hash = hashlib.sha256()
        self.messages = 0
        self._rows = np.empty((0, self.size), np.uint8)  # used again, for most bytes of a record are always the same
        self._hashed = np.empty(0, np.uint8)

    def pack(self, block: Block, due: NDArray[np.int64], moves: NDArray[np.int64]) -> NDArray[np.uint8]:
        """Message records of the rows that are ``due`` (m,); good until the next call."""
        m = len(due)
        if m > len(self._rows):
            self._rows = np.empty((m, self.size), np.uint8)
            self._rows[:] = np.frombuffer(prefix(self.number, self.size) + self.layout.template, np.uint8)
            self._hashed = np.empty(m * (self.size - IDENTITY), np.uint8)
        rows = self._rows[:m]
        copy_words(block.table, due, moves, rows)
        return rows

    def count(self, rows: NDArray[np.uint8]) -> None:
        """Messages that are in the file."""
        hashed = self._hashed[: len(rows) * (self.size - IDENTITY)]
        hashed.reshape(len(rows), -1)[:] = rows[:, IDENTITY:]
        self.hash.update(hashed.data)
        self.messages += len(rows)


def copy_words(rows: Floats, chosen: NDArray[np.int64], moves: NDArray[np.int64], records: NDArray[np.uint8]) -> None:
    """Copy words of chosen rows (m,) into as many records (m, bytes), all arrays contiguous.

    ``moves`` (n, 2): from so many bytes behind the beginning of the row, which may be negative, to that byte of the
    record; the later of two that overlap counts.
    """
    source, target = (rows.ctypes.data, rows.strides[0]), (records.ctypes.data, records.shape[1])
    kernels().copy_words(*source, chosen.ctypes.data, len(chosen), moves.ctypes.data, len(moves), *target)


class Packed(NamedTuple):
    """Messages of a topic that are about to be written."""

    channel: Channel
    rows: NDArray[np.uint8]  # (m, bytes)
    times: NDArray[np.uint64]  # (m,) ns


class _Part(NamedTuple):
    """A topic's part of a row."""

    channel: Channel
    late: bool  # whether it holds what the step that ended was given
    moves: NDArray[np.int64]  # of ``copy_words``


class _Proof(NamedTuple):
    """Columns of a row that one rule connects."""

    rule: Rule
    outputs: Columns
    inputs: Columns


class Page:
    """Topics that are written together: a row holds the values of all.

    :param given: topics that hold what the step that ended was given: their messages have the number and the time of
        its beginning.
    :param shown: topics of the time of the row.
    :param whole: a row also holds variables that wires have; they are compared with the outputs, which the page has,
        and not recorded. Raises ValueError where it has not.
    """

    def __init__(self, given: Sequence[Channel], shown: Sequence[Channel], whole: bool = True) -> None:
        channels = [*given, *shown]
        self.topics = tuple(channel.topic for channel in channels)
        strides = {channel.about.every for channel in channels}
        self.every = strides.pop() if len(strides) == 1 and not given else 1
        self.size = sum(channel.size for channel in channels)  # bytes of a row's message records
        self.capacity = CHUNK // self.size + 1
        self.widths = [len(channel.about.names if whole else channel.columns) for channel in channels]
        self._words = HEAD + sum(self.widths)  # of a row
        self._first = dict(zip(self.topics, np.cumsum([HEAD, *self.widths]).tolist(), strict=False))
        self._parts = []
        for channel in channels:
            held = np.array(channel.columns, np.intp) if whole else np.arange(len(channel.columns))
            late = channel in given
            self._parts.append(_Part(channel, late, self._moves(channel, late, self._first[channel.topic] + held)))
        self._proofs = self._all_proofs() if whole else []
        self.spare: list[Block] = []
        self.block = self._blank()

    def _blank(self) -> Block:
        return Block(np.zeros((self.capacity + 1, self._words)))

    def _moves(self, channel: Channel, late: bool, columns: Columns) -> NDArray[np.int64]:
        """Where the words of a row stand in a message record of a channel that has these ``columns`` of it."""
        before = -self._words if late else 0  # a step began where the row before was
        head = [(before + NUMBER, SEQUENCE), (before + NS, LOG_TIME)]  # the upper half of a number is written over
        head += [(before + NS, PUBLISH_TIME), (before + TIME, PREFIX + TIME_AT), (LENGTH, PREFIX + LENGTH_AT)]
        order = channel.layout.order
        values = np.column_stack([columns[order], PREFIX + channel.layout.starts[order]])
        moves = np.concatenate([np.array(head), values])
        return np.ascontiguousarray(moves * [WORD, 1], np.int64)

    def _all_proofs(self) -> list[_Proof]:
        """What is to be compared, by rule."""
        about = {part.channel.topic: part.channel.about for part in self._parts}
        place = {
            (topic, name): self._first[topic] + k for topic, one in about.items() for k, name in enumerate(one.names)
        }
        proofs = []
        for rule in RULES:
            outputs, inputs = [], []
            for part in self._parts:
                for wire in part.channel.about.wires:
                    if not part.late or wire.source not in about or about[wire.source].every > 1:
                        raise ValueError(f"{part.channel.topic}: not every step of {wire.source} is recorded with it")
                    if wire.rule == rule:
                        outputs += [place[wire.source, name] for name in wire.outputs]
                        inputs += [place[part.channel.topic, name] for name in wire.inputs]
            if inputs:
                proofs.append(_Proof(rule, np.array(outputs), np.array(inputs)))
        return proofs

    def add(self, sequence: int, t: float, h: float, values: Sequence[Floats]) -> None:
        """Another row: the values of each topic, which are copied; raises ValueError where their number is wrong."""
        block = self.block
        row = block.count
        if [*map(len, values)] != self.widths:
            wrong = zip(self.topics, self.widths, map(len, values), strict=True)
            raise ValueError("; ".join(f"{topic} has {k} variables, not {n}" for topic, k, n in wrong if k != n))
        np.concatenate(values, out=block.values[row])
        block.sequence[row], block.t[row], block.h[row] = sequence, t, h
        block.count = row + 1

    @property
    def room(self) -> int:
        """Rows that the block has room for."""
        return self.capacity + 1 - self.block.count

    def filled(self, n: int) -> None:
        """So many rows more stand in the block, behind the last one."""
        self.block.count += n

    def turn(self) -> Block:
        """The filled block; another one takes its place."""
        filled = self.block
        self.block = (self.spare.pop() if self.spare else self._blank()).follow(filled)
        return filled

    def pack(self, block: Block) -> list[Packed]:
        """Messages of the topics that have any in a block; raises Unproven."""
        self._prove(block)
        block.ns[: block.count] = np.rint(block.t[: block.count] * 1e9)
        packed = []
        found: dict[tuple[bool, int], tuple[NDArray[np.int64], NDArray[np.uint64]]] = {}  # topics have few strides
        for channel, late, moves in self._parts:
            key = late, channel.about.every
            due, times = found[key] = found.get(key) or self._due(block, *key)
            if len(due):
                packed.append(Packed(channel, channel.pack(block, due, moves), times))
        return packed

    def _due(self, block: Block, late: bool, every: int) -> tuple[NDArray[np.int64], NDArray[np.uint64]]:
        """Rows of messages of topics that have one in so many steps, and the times of these."""
        steps = block.sequence[1 : block.count] - late
        due = np.flatnonzero((steps % every == 0) & (steps >= 0)) + 1
        return due, block.ns[due - late]

    def _prove(self, block: Block) -> None:
        """Whether inputs are what their wires say."""
        if not self._proofs:
            return
        steps = block.sequence[: block.count]
        begin = 1 + int(block.count > 1 and steps[1] == 0)  # the start was given nothing by a step
        if np.any(np.diff(steps[begin - 1 :]) != 1):
            raise Unproven("a step is missing")
        before, now = block.table[begin - 1 : block.count - 1], block.table[begin : block.count]
        for proof in self._proofs:
            start = np.take(before, proof.outputs, axis=1)
            end = start if proof.rule == "start" else np.take(now, proof.outputs, axis=1)
            given = np.take(now, proof.inputs, axis=1)
            wrong = handed_over(proof.rule, start, end).view(np.uint64) != given.view(np.uint64)
            if wrong.any():
                row, column = np.argwhere(wrong)[0]
                raise Unproven(self._sentence(float(block.t[begin - 1 + row]), int(proof.inputs[column])))

    def _sentence(self, t: float, column: int) -> str:
        topic = max((first, topic) for topic, first in self._first.items() if first <= column)[1]
        names = next(part.channel.about.names for part in self._parts if part.channel.topic == topic)
        return (
            f"{topic}: '{names[column - self._first[topic]]}' at t = {t:.6g} s is not what its coupling is said to give"
        )
