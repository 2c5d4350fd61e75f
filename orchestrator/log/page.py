"""Pages: what topics that are written together wait in for the recorder's thread, which packs it into messages."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from copy import copy
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from orchestrator.log.channel_metadata import Recorded
from orchestrator.log.message_records import IDENTITY, PREFIX, prefix, size_of
from orchestrator.log.wire import RULES, Floats, Rule, handed_over

CHUNK = 1 << 20  # bytes of messages that make a chunk
Columns = NDArray[np.intp]


class Unproven(ValueError):
    """An input is not what its wire says; the message is one sentence."""


class Rows(NamedTuple):
    """Of steps, one after the other, the values of topics that are written together."""

    sequence: NDArray[np.int64]  # (m,)
    t: Floats  # (m,) s
    values: Floats  # (m, n)

    def every(self, stride: int) -> Rows:
        """Those of steps whose number is a multiple of ``stride``."""
        due = self.sequence % stride == 0
        return self if due.all() else Rows(self.sequence[due], self.t[due], self.values[due])

    def between(self, first: int, end: int) -> Rows:
        """Those of steps from ``first`` to before ``end``."""
        some = slice(*np.searchsorted(self.sequence, [first, end]).tolist())
        return Rows(self.sequence[some], self.t[some], self.values[some])


class Block:
    """Rows of a page; row 0 repeats the last one of the block before."""

    def __init__(self, capacity: int, width: int) -> None:
        self.sequence = np.zeros(capacity + 1, "<u4")
        self.t = np.zeros(capacity + 1)
        self.h = np.zeros(capacity + 1)
        self.values = np.zeros((capacity + 1, width))
        self.count = 1

    def follow(self, other: Block) -> Block:
        """Begin after another one."""
        last = other.count - 1
        self.sequence[0], self.t[0], self.h[0] = other.sequence[last], other.t[last], other.h[last]
        self.values[0] = other.values[last]
        self.count = 1
        return self

    def steps(self, first: int, end: int) -> Block:
        """Those of its rows that are of steps from ``first`` to before ``end``, in its memory."""
        begin, stop = np.searchsorted(self.sequence[1 : self.count], [first, end]).tolist()
        part = copy(self)
        for name in ("sequence", "t", "h", "values"):
            setattr(part, name, getattr(self, name)[begin : stop + 1])
        part.count = stop - begin + 1
        return part


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

    def pack(self, sequence: NDArray[np.uint32], t: Floats, h: Floats, ordered: Floats) -> Packed:
        """Message records of values (m, variables) in the order of the layout; good until the next call."""
        m = len(t)
        if m > len(self._rows):
            self._rows = np.empty((m, self.size), np.uint8)
            self._rows[:] = np.frombuffer(prefix(self.number, self.size) + self.layout.template, np.uint8)
            self._hashed = np.empty(m * (self.size - IDENTITY), np.uint8)
        rows = self._rows[:m]
        times = np.rint(t * 1e9).astype("<u8")
        rows[:, 11:15] = sequence.view(np.uint8).reshape(m, 4)
        rows[:, 15:23] = rows[:, 23:31] = times.view(np.uint8).reshape(m, 8)
        self.layout.pack(rows, PREFIX, t, h, ordered)
        return Packed(self, rows, times)

    def count(self, rows: NDArray[np.uint8]) -> None:
        """Messages that are in the file."""
        hashed = self._hashed[: len(rows) * (self.size - IDENTITY)]
        hashed.reshape(len(rows), -1)[:] = rows[:, IDENTITY:]
        self.hash.update(hashed.data)
        self.messages += len(rows)


class Packed(NamedTuple):
    """Messages of a topic that are about to be written."""

    channel: Channel
    rows: NDArray[np.uint8]  # (m, bytes)
    times: NDArray[np.uint64]  # (m,) ns


class _Part(NamedTuple):
    """A topic's part of a row."""

    channel: Channel
    late: bool  # whether it holds what the step that ended was given
    columns: Columns  # of the row, in the order of the topic's layout


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
        self._first = dict(zip(self.topics, np.cumsum([0, *self.widths]).tolist(), strict=False))
        self._parts = []
        for channel in channels:
            held = np.array(channel.columns, np.intp) if whole else np.arange(len(channel.columns))
            columns = self._first[channel.topic] + held[channel.layout.order]
            self._parts.append(_Part(channel, channel in given, columns))
        self._proofs = self._all_proofs() if whole else []
        self.spare: list[Block] = []
        self.block = self._blank()

    def _blank(self) -> Block:
        return Block(self.capacity, sum(self.widths))

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

    def add_rows(self, sequence: NDArray[np.int64], t: Floats, h: float, values: Floats) -> None:
        """As many rows as there is room for, at most: numbers and times (m,), the values of all topics (m, n)."""
        if values.shape != (len(t), sum(self.widths)):
            raise ValueError(f"{', '.join(self.topics)} have {sum(self.widths)} variables, not {values.shape[1]}")
        block = self.block
        rows = slice(block.count, block.count + len(t))
        block.values[rows], block.sequence[rows], block.t[rows], block.h[rows] = values, sequence, t, h
        block.count = rows.stop

    def turn(self) -> Block:
        """The filled block; another one takes its place."""
        filled = self.block
        self.block = (self.spare.pop() if self.spare else self._blank()).follow(filled)
        return filled

    def pack(self, block: Block) -> list[Packed]:
        """Messages of the topics that have any in a block; raises Unproven."""
        self._prove(block)
        packed = []
        rows = np.arange(1, block.count)
        for channel, late, columns in self._parts:
            steps = block.sequence[rows].astype(np.int64) - late
            due = rows[(steps % channel.about.every == 0) & (steps >= 0)]
            if not len(due):
                continue
            of = due - late
            values = np.take(block.values[1 : block.count], columns, axis=1)
            if len(due) < len(rows):
                values = values[due - 1]
            packed.append(channel.pack(block.sequence[due] - np.uint32(late), block.t[of], block.h[due], values))
        return packed

    def _prove(self, block: Block) -> None:
        """Whether inputs are what their wires say."""
        if not self._proofs:
            return
        steps = block.sequence[: block.count].astype(np.int64)
        begin = 1 + int(block.count > 1 and steps[1] == 0)  # the start was given nothing by a step
        if np.any(np.diff(steps[begin - 1 :]) != 1):
            raise Unproven("a step is missing")
        values = block.values
        for proof in self._proofs:
            start = np.take(values[begin - 1 : block.count - 1], proof.outputs, axis=1)
            end = start if proof.rule == "start" else np.take(values[begin : block.count], proof.outputs, axis=1)
            given = np.take(values[begin : block.count], proof.inputs, axis=1)
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
