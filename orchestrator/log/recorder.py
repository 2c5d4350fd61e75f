"""Writer of a log: an MCAP file with one protobuf message per topic and step, readable after a kill.

``Recorder.write`` copies values into a block and returns; kernels may write into the blocks directly (``reserve``,
``commit``). A thread packs full blocks into messages, compresses them into chunks of about 2 MiB and writes a chunk at
least about four times a second of wall time, so a killed run loses no more than that. In a chunk the messages of a
topic are contiguous. Time in the file is simulation time, and values that depend on the wall clock are in
``/stats/<instance>`` only: two equal runs write equal messages. The last record, the metadata ``closing``, holds the
status of the run and a sha256 per topic; a log without it was cut off.

Wired inputs are compared with the outputs they follow from, step by step and bit by bit, and then left out.
"""

from __future__ import annotations

import os
import threading
from collections import deque
from collections.abc import Iterable, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext, suppress
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from orchestrator.files.messages import LOG
from orchestrator.log import log_metadata, schema, seal
from orchestrator.log.container_writer import ContainerWriter
from orchestrator.log.log_file import LogFailed, log_failed, prepared_file
from orchestrator.log.message_records import EVENTS_CHANNEL, EVENTS_TOPIC, MAX_TIME, Event, Messages, event_records
from orchestrator.log.page import CHUNK, Block, Channel, Page, WireViolated
from orchestrator.log.reader import Log, LogUnreadable
from orchestrator.log.time_series import Series, Topic, Wire

FAILED = "-failed"  # ending of the log of a failed run beside that of one that ended well
BACKLOG = 4  # chunks that may wait for the disk before the run waits too


class Recorder(AbstractContextManager["Recorder"]):
    """Log open for writing; leaving the context closes it, as "failed" unless ``close`` was called.

    :param path: the file, or a link to it; its folder is created, any other file than a log is refused. While there is
        an older log, ``file`` is a new one beside it, which replaces it when this log is closed; that of a failed run
        does not replace one of a run that ended well: it stays beside it, with the ending FAILED.
    :param topics: topic -> (variable, unit) in the order of the arrays given to ``write``. By convention
        "/<instance>/in", "/<instance>/out", "/<instance>/links" and "/stats/<instance>".
    :param attachments: name -> content of files that belong to the run.
    :param metadata: name -> key -> value, all text.
    :param every: topic -> n: only steps whose number is a multiple of n are recorded (default 1).
    :param wires: topic -> wires of its inputs. A topic that is written alone is written without its wired inputs,
        which are not checked then.
    :param types: topic -> name of its message type (default: one for each topic); topics of one kind may share one.
    :param unrecorded: topics that are written with others but do not go into the file.
    :param flush: longest time that a message waits for the disk, s of wall time.
    :raises LogFailed: here, in ``write`` and in ``close`` if the file cannot be written or a wire is wrong.
    :raises ValueError: if the variables of a topic do not fit into a message.
    """

    def __init__(
        self,
        path: str | os.PathLike[str],
        topics: Mapping[str, Sequence[tuple[str, str]]],
        attachments: Mapping[str, bytes],
        metadata: Mapping[str, Mapping[str, str]],
        *,
        every: Mapping[str, int] | None = None,
        wires: Mapping[str, Sequence[Wire]] | None = None,
        types: Mapping[str, str] | None = None,
        unrecorded: Sequence[str] = (),
        flush: float = 0.25,
    ) -> None:
        self.path = Path(path)
        self.seal = ""  # once the log is closed
        strides, wired = every or {}, wires or {}
        self._channels = {}
        for number, (topic, variables) in enumerate(topics.items(), 1):
            names, units = tuple(name for name, _ in variables), tuple(unit for _, unit in variables)
            about = Topic(names, units, strides.get(topic, 1), tuple(wired.get(topic, ())))
            channel = log_metadata.recorded_channel(topic, about)
            self._channels[topic] = Channel(number, channel, topic not in unrecorded)
        self._pages = {topic: Page([], [channel], with_wired=False) for topic, channel in self._channels.items()}
        self._condition = threading.Condition()
        self._backlog: deque[list[tuple[Page, Block]] | tuple[str, bytes]] = deque()  # chunks and attachments
        self._bytes = 0  # message bytes in the blocks
        self._last = 0  # number of the last step written
        self._reserved = self._overdue = False  # kernels are writing into the pages; the pages are due to be written
        self._closing = self._closed = False
        self._failure: LogFailed | None = None
        self._flush = flush
        try:
            self._target, self.file = prepared_file(self.path)
            self._file = ContainerWriter(self.file)
        except OSError as error:
            raise log_failed(self.path, error) from None
        try:
            self._write_header(attachments, metadata, types or {})
        except OSError as error:
            self._file.close()
            if self.replaces:
                self.file.unlink(missing_ok=True)
            raise log_failed(self.path, error) from None
        self._thread = threading.Thread(target=self._write_queue, name="recorder", daemon=True)
        self._thread.start()

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: object) -> None:
        if not self._closed:
            message = str(error) or (kind.__name__ if kind else "the run ended without a status")
            with suppress(LogFailed) if error else nullcontext():  # the first error is the one to report
                self.close("failed", message, self._last)

    @property
    def replaces(self) -> bool:
        """Whether ``file`` is to replace an older log, or has not done so because its run failed."""
        return self.file != self._target

    def join_topics(self, inputs: Sequence[str], outputs: Sequence[str]) -> str:
        """Join topics into one page, so that one ``write`` records all; return its name for ``write``.

        ``inputs``: topics with inputs of the step that has ended; their messages carry its number and start time.
        Wired topics and their sources are joined and written at every step.
        """
        topics = [*inputs, *outputs]
        name = " ".join(topics)
        page = Page([self._channels[topic] for topic in inputs], [self._channels[topic] for topic in outputs])
        with self._condition:
            self._hand_over()
        self._pages = {topic: other for topic, other in self._pages.items() if topic not in topics} | {name: page}
        return name

    @property
    def topics(self) -> tuple[str, ...]:
        """Names of the topics."""
        return tuple(self._channels)

    def stride(self, topic: str) -> int:
        """Return n: steps whose number is a multiple of n are recorded."""
        return self._pages[topic].every

    def due(self, topic: str, sequence: int) -> bool:
        """Whether ``write`` records this step; values of other steps need not be read."""
        return sequence % self.stride(topic) == 0

    def write(self, topic: str, sequence: int, t: float, h: float, *values: NDArray[np.float64]) -> None:
        """Record values at time t, s, of step ``sequence`` of length h, s; ``topic`` may be a joined page.

        ``values``: one array per joined topic, in order; they are copied. A step that is not due is ignored. Waits only
        if the disk is far behind. Raises ValueError unless 0 <= t < MAX_TIME, LogFailed.
        """
        page = self._pages[topic]
        if sequence % page.every:
            return
        self._check_time(topic, t)
        with self._condition:
            self._raise_failure()
            page.add(sequence, t, h, values)
            self._bytes += page.size
            self._hand_over_if_full(sequence, page.free_rows > 0)

    def copy(self, messages: Messages, chosen: NDArray[np.bool_]) -> Series:
        """Record the ``chosen`` (m,) messages of a topic again; return them. Raises like ``write``."""
        series, numbers = messages.decode().rows(chosen), messages.sequence[chosen].tolist()
        for number, t, h, values in zip(numbers, series.t.tolist(), series.h.tolist(), series.values, strict=True):
            self.write(messages.topic, number, t, h, values)
        return series

    def pages(self, *names: str) -> list[Page]:
        """Return joined pages by name, to be written directly between ``reserve`` and ``commit``."""
        return [self._pages[name] for name in names]

    def reserve(self) -> None:
        """Keep the recorder's thread away from the pages until ``commit``."""
        with self._condition:
            self._reserved = True

    def commit(self, rows: Mapping[str, int]) -> None:
        """Count rows written into pages: page name -> number, for consecutive steps of its stride."""
        last = 0
        with self._condition:
            self._reserved = False
            self._condition.notify_all()
            self._raise_failure()
            for topic, n in rows.items():
                page = self._pages[topic]
                page.commit(n)
                self._check_time(topic, float(page.block.t[page.block.count - 1]))
                self._bytes += n * page.size
                last = max(last, int(page.block.sequence[page.block.count - 1]))
            self._hand_over_if_full(last, all(self._pages[topic].free_rows for topic in rows) and not self._overdue)

    def _check_time(self, topic: str, t: float) -> None:
        if not 0.0 <= t < MAX_TIME:
            raise ValueError(f"{topic} cannot be recorded at t = {t} s: a log begins at 0 and ends by {MAX_TIME:g}")

    def _raise_failure(self) -> None:
        """Raise the failure of the thread, if any; the caller holds the lock, as in ``_hand_over_if_full``."""
        if self._failure is not None:
            raise self._failure
        if self._closing:
            raise ValueError(f"the log {self.path} is closed")

    def _hand_over_if_full(self, sequence: int, has_room: bool) -> None:
        """Hand over a full chunk, or where a page ``has_room`` no more; wait if the disk is far behind."""
        self._last = sequence
        if self._bytes >= CHUNK or not has_room:
            self._hand_over()
            while len(self._backlog) > BACKLOG and self._failure is None:
                self._condition.wait()

    def continue_after(self, topic: str, sequence: int, t: float, h: float, *values: NDArray[np.float64]) -> None:
        """Continue a joined page after step ``sequence``, whose messages are recorded already."""
        with self._condition:
            page = self._pages[topic]
            page.add(sequence, t, h, values)
            page.exchange_block()  # makes it the row before the next one

    def attach(self, name: str, content: bytes) -> None:
        """Attach a file behind all messages so far."""
        with self._condition:
            if self._failure is not None:
                raise self._failure
            self._hand_over()
            self._backlog.append((name, content))
            self._condition.notify_all()

    def flush(self) -> None:
        """Wait until all messages so far are in the file."""
        with self._condition:
            self._raise_failure()
            self._hand_over()
            self._condition.wait_for(lambda: not self._backlog or self._failure)
            self._raise_failure()

    def write_remaining(self) -> None:
        """Write the remaining messages; the file is then readable and lacks only its closing record."""
        earlier = self._failure
        with self._condition:
            self._closing = True
            self._condition.notify_all()
        self._thread.join()
        if self._failure is not None and self._failure is not earlier:
            raise self._failure

    def write_events(self, events: Sequence[Event]) -> None:
        """Write the topic /events, after ``write_remaining``; it is left out if the disk is full."""
        if self._failure is not None:
            return
        number = len(self._channels) + 1
        with suppress(OSError):
            self._file.channel(number, *EVENTS_CHANNEL, {}, json=True)
            if events:
                rows, times = event_records(number, events)
                self._file.chunk([(number, rows, times)], reserve_end=True)
                self._file.contents[f"messages:{EVENTS_TOPIC}"] = seal.messages_digest([rows])

    def close(
        self,
        status: str,
        message: str,
        steps: int,
        results: Mapping[str, str] | None = None,
        warnings: Sequence[Mapping[str, object]] = (),
    ) -> None:
        """Write remaining messages, closing record and indexes; a second call does nothing.

        ``results`` (text by name) and ``warnings`` (``ComponentWarning`` as dicts) go into the closing record. After a
        failure that was raised already, everything that still fits is written and nothing is raised.
        """
        if self._closed:
            return
        earlier = self._failure
        with suppress(LogFailed):
            self.write_remaining()
        self._closed = True
        if self._failure is not None:
            status, message = "failed", message or str(self._failure)
        try:
            totals = {channel.topic: (channel.messages, channel.hash.hexdigest()) for channel in self._recorded()}
            contents = self._file.contents
            record = log_metadata.encode_closing(status, message, steps, totals, results or {}, warnings, contents)
            self._file.metadata(log_metadata.CLOSING, record)
            self._file.finish()
            self.seal = record[seal.SEAL]
        except OSError as error:
            self._failure = self._failure or self._failed(error)
        finally:
            self._file.close()
        if self._failure is None and self.replaces:
            try:
                self.file = self.file.replace(self._place_of(status))  # a reader of the older file keeps it
            except OSError as error:
                self._failure = self._failed(error)
        if self._failure is not None and self._failure is not earlier:
            raise self._failure

    def _place_of(self, status: str) -> Path:
        """Return the file that this log of a run with a status replaces."""
        with suppress(LogUnreadable), Log(self._target, unfinished=True) as earlier:
            if status != "ok" and (earlier.closing or {}).get("status") == "ok":
                LOG.warning("%s is kept: its run ended well, and this one did not", self._target)
                return self._target.with_name(f"{self._target.stem}{FAILED}{self._target.suffix}")
        return self._target

    def _write_header(
        self,
        attachments: Mapping[str, bytes],
        metadata: Mapping[str, Mapping[str, str]],
        types: Mapping[str, str],
    ) -> None:
        """Write all records that precede step 0: format, metadata, attachments, channels; raises OSError."""
        about = {"version": str(log_metadata.FORMAT_VERSION), seal.SEAL: "true"}  # in the closing record
        self._file.metadata(log_metadata.FORMAT, about)
        for name, entries in metadata.items():
            self._file.metadata(name, entries)
        for name, content in attachments.items():
            self._file.attachment(name, content)
        described: dict[str, tuple[schema.Field, ...]] = {}  # by message type
        for channel in self._recorded():
            topic = channel.topic
            kind, fields = types.get(topic, schema.type_name(topic)), channel.layout.fields
            if described.setdefault(kind, fields) != fields:  # one kind, but different variables
                kind = schema.type_name(topic)
            about, description = log_metadata.encode_channel(channel.recorded), schema.descriptor(kind, fields)
            self._file.channel(channel.number, topic, kind, description, about)

    def _recorded(self) -> list[Channel]:
        return [channel for channel in self._channels.values() if channel.is_recorded]

    def _hand_over(self) -> None:
        """Queue the filled blocks as one chunk and replace them by empty ones; the caller holds the lock."""
        filled = [(page, page.exchange_block()) for page in self._pages.values() if page.block.count > 1]
        if filled:
            self._backlog.append(filled)
        self._bytes, self._overdue = 0, False
        self._condition.notify_all()

    def _write_queue(self) -> None:
        """Thread: write chunks until the log closes; any error fails the run, first steps go to a full disk."""
        try:
            while self._write_next():
                pass
        except BaseException as error:
            with self._condition:
                violated = isinstance(error, WireViolated)
                self._failure = LogFailed(f"{self.path}: {error}") if violated else self._failed(error)
                self._condition.notify_all()
                if not isinstance(error, OSError):
                    return
                self._condition.wait_for(lambda: self._closing or not self._reserved)  # rows may be being written
                self._hand_over()
                queued = [*self._backlog]
                self._condition.notify_all()
            self._write_first_steps(chunk for chunk in queued if not isinstance(chunk, tuple))

    def _write_next(self) -> bool:
        """Write a queued chunk; if none is queued for ``flush`` s, what the blocks hold. False: the log is whole."""
        with self._condition:
            self._condition.wait_for(lambda: self._backlog or self._closing, timeout=self._flush)
            if not self._backlog:
                if self._reserved and not self._closing:
                    self._overdue = True
                else:
                    self._hand_over()
            if not self._backlog:
                return not self._closing
            filled = self._backlog[0]  # it stays there until it is written
        if isinstance(filled, tuple):
            self._file.attachment(*filled)
        else:
            self._write_chunk(filled)
        with self._condition:
            self._backlog.popleft()
            for page, block in () if isinstance(filled, tuple) else filled:
                page.spare_blocks.append(block)
            self._condition.notify_all()
        return True

    def _failed(self, error: BaseException) -> LogFailed:
        failure = log_failed(self.path, error)
        return LogFailed(f"{failure}; {self.file.name} holds what was written") if self.replaces else failure

    def _write_first_steps(self, chunks: Iterable[Sequence[tuple[Page, Block]]]) -> None:
        """Write as many of the first steps of ``chunks`` as fit on a full disk."""
        for filled in chunks:
            numbers = np.concatenate([block.sequence[1 : block.count] for _, block in filled])
            first, end = int(numbers.min()), int(numbers.max()) + 1
            size = end - first
            while first < end and size:
                try:
                    self._write_chunk([(page, block.steps(first, first + size)) for page, block in filled], True)
                    first += size
                except (OSError, WireViolated):
                    size //= 2
            if first < end:
                return

    def _write_chunk(self, filled: Sequence[tuple[Page, Block]], reserve_end: bool = False) -> None:
        packed = [part for page, block in filled for part in page.pack(block)]
        if not packed:
            return
        packed.sort(key=lambda part: part.channel.number)
        self._file.chunk([(part.channel.number, part.rows, part.times) for part in packed], reserve_end)
        for channel, rows, _ in packed:  # only what is in the file counts
            channel.count(rows)
