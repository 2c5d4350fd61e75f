"""Reading of selected columns chunk by chunk; wired inputs are reconstructed from recorded outputs.

Chunks, compressed message records, are checked, unpacked and split by channel.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import chain

import numpy as np
from numpy.typing import NDArray

from orchestrator.log.log_metadata import RecordedChannel
from orchestrator.log.message_records import Messages
from orchestrator.log.time_series import (
    ALL_TIME,
    Floats,
    Series,
    Wire,
    empty_series,
    join_series,
    wired_inputs,
    within,
)

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
        window: tuple[float, float] = ALL_TIME,
    ) -> None:
        self._names = {topic: [recorded[topic].about.names[k] for k in columns] for topic, columns in wanted.items()}
        self._wires = {topic: [*_wired(recorded[topic], names)] for topic, names in self._names.items()}
        needed: dict[str, dict[str, None]] = {}  # outputs by their topic
        for wire in chain.from_iterable(self._wires.values()):
            needed.setdefault(wire.source, {}).update(dict.fromkeys(wire.outputs))
        self._outputs = {source: _Rows(recorded[source], [*names]) for source, names in needed.items()}
        self._topics = {topic: _Rows(recorded[topic], names, window) for topic, names in self._names.items()}
        self.topics = {*self._topics, *self._outputs}  # topics whose messages ``add`` needs

    @property
    def is_waiting(self) -> bool:
        """Whether some messages still lack outputs of a later chunk."""
        return any(len(rows.steps) for rows in self._topics.values())

    def add(self, piece: Iterable[Messages]) -> dict[str, Series]:
        """Add the messages of the next chunk; return the messages that are complete now, by topic.

        Raises NotInOrder.
        """
        for messages in piece:
            for rows in (self._outputs.get(messages.topic), self._topics.get(messages.topic)):
                if rows is not None:
                    rows.add(messages)
        whole = {topic: self._pop_complete(topic) for topic in self._topics}
        for source, outputs in self._outputs.items():
            users = [topic for topic, wires in self._wires.items() if any(wire.source == source for wire in wires)]
            outputs.pop(int(np.searchsorted(outputs.steps, min(self._topics[topic].next for topic in users))))
        return {name: series for name, series in whole.items() if len(series.t)}

    def _pop_complete(self, topic: str) -> Series:
        """Return the messages whose outputs have come, without those whose outputs are missing in the log."""
        rows, names, wires = self._topics[topic], self._names[topic], self._wires[topic]
        decided = len(rows.steps)
        for wire in wires:
            known = self._outputs[wire.source].come - _delay(wire)  # inputs of steps below are decided
            decided = min(decided, int(np.searchsorted(rows.steps, known)))
        steps, series = rows.pop(decided)
        if not wires:
            return series
        values, complete = np.empty((decided, len(names))), np.ones(decided, bool)
        values[:, [names.index(name) for name in series.names]] = series.values
        for wire in wires:
            outputs = self._outputs[wire.source]
            (first, has_first), (last, has_last) = outputs.find(steps), outputs.find(steps + _delay(wire))
            complete &= has_last & (has_first | (wire.rule == "end"))
            if decided and len(outputs.steps):
                columns = [outputs.series.names.index(name) for name in wire.outputs]
                ends = (_taken(outputs.series.values, which)[:, columns] for which in (first, last))
                values[:, [names.index(name) for name in wire.inputs]] = wired_inputs(wire.rule, *ends)
        series = series._replace(names=tuple(names), values=values)
        return series if complete.all() else series.rows(complete)


class _Rows:
    """Recorded ones of selected variables of a topic, in a window of time; holds the rows that are still needed."""

    def __init__(self, recorded: RecordedChannel, names: Sequence[str], window: tuple[float, float] = ALL_TIME) -> None:
        held = [name for name in names if name in recorded.names]
        self._columns, self._window = [recorded.names.index(name) for name in held], window
        self._last = -np.inf  # time of the last message, s
        self.come = 0  # its step number and 1
        self.steps, self.series = np.empty(0, np.int64), empty_series(held)

    @property
    def next(self) -> int:
        """Step number of the first row that is held, or of the next message."""
        return int(self.steps[0]) if len(self.steps) else self.come

    def add(self, messages: Messages) -> None:
        """Append the rows of later messages in the window; raises NotInOrder."""
        series, steps = decode_columns(messages, self._columns), messages.sequence.astype(np.int64)
        for before, numbers in ((self.come - 1, steps), (self._last, series.t)):
            if not (np.diff(numbers, prepend=before) > 0).all():
                raise NotInOrder(f"the messages of {messages.topic} are not in order of time")
        self.come, self._last = int(steps[-1]) + 1, float(series.t[-1])
        if not (series.t[0] >= self._window[0] and series.t[-1] <= self._window[1]):
            inside = within(series.t, self._window)
            series, steps = series.rows(inside), steps[inside]
        waiting = len(self.steps)
        self.series = join_series([self.series, series]) if waiting else series
        self.steps = np.concatenate([self.steps, steps]) if waiting else steps

    def pop(self, count: int) -> tuple[Steps, Series]:
        """Return the first rows and drop them."""
        popped = self.steps[:count], self.series.rows(slice(count))
        self.steps, self.series = self.steps[count:], self.series.rows(slice(count, None))
        return popped

    def find(self, steps: Steps) -> tuple[NDArray[np.intp], NDArray[np.bool_]]:
        """Return row numbers (m,) of steps (m,), and a mask (m,) of the steps that are present."""
        if not len(self.steps):
            return np.zeros(len(steps), np.intp), np.zeros(len(steps), bool)
        rows = np.minimum(np.searchsorted(self.steps, steps), len(self.steps) - 1)
        return rows, self.steps[rows] == steps


def _delay(wire: Wire) -> int:
    """Number of steps from an input to the last output that it needs: 0 or 1."""
    return int(wire.rule != "start")


def _taken(values: Floats, rows: NDArray[np.intp]) -> Floats:
    """Rows of values: consecutive ones, the usual case, are a view."""
    return values[rows[0] : rows[-1] + 1] if (np.diff(rows) == 1).all() else values[rows]


def _wired(recorded: RecordedChannel, names: Sequence[str]) -> Iterator[Wire]:
    """Yield the part of each wire that ends at inputs among ``names``."""
    for wire in recorded.about.wires:
        pairs = [pair for pair in zip(wire.outputs, wire.inputs, strict=True) if pair[1] in names]
        if pairs:
            outputs, inputs = zip(*pairs, strict=True)
            yield wire._replace(outputs=outputs, inputs=inputs)


def decode_columns(messages: Messages, columns: Sequence[int]) -> Series:
    """Decode columns of messages; a few columns are decoded one by one, else all at once."""
    if FEW * len(columns) < len(messages.names):
        return messages.decode(columns)
    whole = messages.decode()
    return whole if list(columns) == [*range(len(messages.names))] else whole.columns(columns)
