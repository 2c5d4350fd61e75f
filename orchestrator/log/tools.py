"""Operations on whole logs: verify, recover and summarise."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fmus.cache.files import replacing
from orchestrator.files.command import command_scope
from orchestrator.log.log_file import LogFailed, check_writable
from orchestrator.log.log_metadata import checkpoint_step, path_text_of
from orchestrator.log.message_records import Messages
from orchestrator.log.reader import Log, LogUnreadable
from orchestrator.log.recorded_system import system_of
from orchestrator.log.recorder import Recorder

WHOLE, BROKEN, RECOVERED = 0, 1, 3  # exit codes


class LogVerdict(NamedTuple):
    """Result of a verification or a recovery."""

    code: int  # WHOLE, BROKEN or RECOVERED
    sentences: list[str]


class Tally:
    """Message count, size, first and last time, newest step and hash of one topic."""

    def __init__(self) -> None:
        self.messages = 0
        self.bytes = 0  # before compression
        self.first = self.last = float("nan")  # s
        self.newest: int | None = None  # number of the last step
        self.hash = hashlib.sha256()

    def add(self, messages: Messages, stride: int | None) -> list[str]:
        """Count messages; return sentences about missing steps (stride ``stride``) and wrong times."""
        faults = []
        sequence = messages.sequence.astype(np.int64)
        if stride and self.newest is None and sequence[0] >= stride:
            faults.append(f"{messages.topic}: begins with step {sequence[0]}")
        if self.newest is not None:
            sequence = np.concatenate([[self.newest], sequence])
        steps = np.diff(sequence)
        wrong = np.flatnonzero(steps != stride if stride else steps <= 0)
        if len(wrong):
            before, after = sequence[wrong[0] : wrong[0] + 2]
            faults.append(f"{messages.topic}: step {after} follows step {before}")
        t = messages.t
        with np.errstate(invalid="ignore", over="ignore"):
            times = np.rint(t * 1e9).astype(np.uint64)
        if not (np.array_equal(messages.log_time, times) and np.array_equal(messages.publish_time, times)):
            faults.append(f"{messages.topic}: times of records and messages differ near t = {t[0]:.6g} s")
        self.first = float(t[0]) if self.messages == 0 else self.first
        self.last = float(t[-1])
        self.newest = int(sequence[-1])
        self.messages += len(messages.rows)
        self.bytes += messages.rows.nbytes
        self.hash.update(messages.hashed_bytes())
        return faults


class Info(NamedTuple):
    """Summary of a log."""

    log: Log  # closed; its attributes remain readable
    start: float  # s; nan without messages
    end: float  # s; nan without messages
    digest: str  # empty where a part is damaged
    seal_faults: list[str]  # sentences if the log is not as it was sealed
    topics: dict[str, Tally]
    attachments: dict[str, int]  # bytes by name


def verify(path: str | os.PathLike[str]) -> LogVerdict:
    """Check that a log is whole: checksums, steps, sha256, closing record, wires against connections."""
    try:
        with Log(path, unfinished=True, by_index=False) as log:
            faults = _faults(log)
            if faults:
                return LogVerdict(BROKEN, faults)
            closing = log.closing or {}
            count = sum(closing["messages"].values())
            sentence = f"{path} is whole: {len(log.topics)} topics, {count} messages, {closing['steps']} steps"
            ending = f"the run ended with status {closing['status']}"
            return LogVerdict(
                WHOLE,
                [
                    sentence,
                    f"{ending}: {closing['message']}" if closing["message"] else ending,
                    f"seal {log.seal}" if log.seal else "no seal: an older cotrack made it",
                ],
            )
    except LogUnreadable as error:
        return LogVerdict(BROKEN, [str(error)])


def _faults(log: Log) -> list[str]:
    """Return all faults of a log as sentences."""
    tallies = {topic: Tally() for topic in log.topics}
    faults = [
        fault
        for messages in log.intact()
        for fault in tallies[messages.topic].add(messages, _stride(log, messages.topic))
    ]
    faults = [*log.faults, *log.checksums(), *faults, *_unconnected_wires(log)]
    hashes = {topic: tally.hash.hexdigest() for topic, tally in tallies.items()}
    with Log(log.path, unfinished=True) as indexed:  # as other commands read it
        sealing = dict.fromkeys([*log.seal_faults(hashes), *indexed.seal_faults(hashes)])
    faults += [fault for fault in sealing if fault not in faults]
    if log.stripped:
        return [*faults, log.cut_off]
    if log.closing is None:
        last = max((tally.last for tally in tallies.values() if tally.messages), default=0.0)
        end = "has come to" if log.being_written else "was cut off after"
        return [*faults, f"{log.path} has no closing record: the run {end} t = {last:.6g} s"]
    for topic, expected in log.closing["messages"].items():
        if topic not in tallies:
            faults.append(f"{topic} is missing")
        elif tallies[topic].messages != expected:
            faults.append(f"{topic} has {tallies[topic].messages} messages, {expected} were recorded")
        elif tallies[topic].hash.hexdigest() != log.closing["sha256"].get(topic):
            faults.append(f"{topic} does not have the sha256 of the closing record")
    last_steps = {topic: tally.newest for topic, tally in tallies.items() if _stride(log, topic)}
    newest = [step + _is_input(topic) for topic, step in last_steps.items() if step is not None]
    reached, steps = max(newest, default=0), log.closing["steps"]
    return [*faults, f"{log.path} ends with step {reached} of {steps}"] if _lacks_steps(log, reached, steps) else faults


def _lacks_steps(log: Log, reached: int, steps: int) -> bool:
    """Whether a log that ends with step ``reached`` lacks recorded steps of a run of ``steps`` steps."""
    strides = [every for topic in log.topics if (every := _stride(log, topic))]
    return bool(strides) and reached + min(strides) <= steps


def _unconnected_wires(log: Log) -> list[str]:
    """Return sentences about wires without a connection in ``system.json``."""
    if "system.json" not in log.attachments:
        return []
    try:
        connections = system_of(log)["connections"]
    except LogUnreadable as damage:
        return [str(damage)]
    connected = {
        (f"/{connection['source']}/out", output, f"/{connection['target']}/in", input_name)
        for connection in connections
        for output, input_name in zip(connection["outputs"], connection["inputs"], strict=True)
    }
    return [
        f"{log.path}: {topic} takes '{input_name}' from '{output}' of {wire.source}, which system.json does not connect"
        for topic, about in log.topics.items()
        for wire in about.wires
        for output, input_name in zip(wire.outputs, wire.inputs, strict=True)
        if (wire.source, output, topic, input_name) not in connected
    ]


def _stride(log: Log, topic: str) -> int | None:
    """Number of steps between messages of a topic; None for statistics, which have no fixed interval."""
    return None if topic.startswith("/stats/") else log.topics[topic].every


@command_scope()
def recover(path: str | os.PathLike[str], out: str | os.PathLike[str]) -> LogVerdict:
    """Write a new log with all complete steps of a broken one.

    Returns WHOLE if only the indexes at the end were broken, RECOVERED if something is lost or may have been changed
    (the new closing record says so), BROKEN if nothing could be saved. Incomplete steps are left out, so all topics
    end with the same step. Results of the closing record are kept.
    """
    source, target = Path(path), Path(out)
    try:
        with Log(source, unfinished=True, by_index=False) as log:
            if not log.topics:
                return LogVerdict(BROKEN, [f"nothing could be saved from {source}", *log.faults])
            with _replacing(target) as fresh:
                return _rewrite(log, fresh, target)
    except (LogUnreadable, LogFailed, ValueError) as error:
        return LogVerdict(BROKEN, [str(error)])


@contextmanager
def _replacing(target: Path) -> Iterator[Path]:
    """Write a temporary file and replace ``target`` by it when it is complete; raises LogFailed."""
    check_writable(target)
    fresh = target
    try:
        with replacing(target) as fresh:
            yield fresh
    except LogFailed as error:
        raise LogFailed(str(error).replace(str(fresh), str(target))) from None
    except OSError as error:
        raise LogFailed(f"the log {target} cannot be written: {error.strerror}") from None


def _rewrite(log: Log, fresh: Path, target: Path) -> LogVerdict:
    topics = {topic: list(zip(about.names, about.units, strict=True)) for topic, about in log.topics.items()}
    every = {topic: about.every for topic, about in log.topics.items()}
    counts = dict.fromkeys(log.topics, 0)
    closing = log.closing or {"status": "", "steps": 0, "messages": {}, "results": {}, "warnings": []}
    steps = _whole_steps(log, closing["messages"], closing["steps"])
    untouched = log.closing is not None and log.sound() and steps is None
    last = None if steps is None else int(steps[-1]) if len(steps) else 0
    names = [name for name in log.attachments if last is None or (checkpoint_step(name) or 0) <= last]
    attachments = {name: content for name in names if (content := _attachment(log, name)) is not None}
    reached = 0.0
    wires = {topic: about.wires for topic, about in log.topics.items()}
    metadata = {**log.metadata, "recovered": {"of": path_text_of(log.path.name), "seal": log.seal or "none"}}
    resealed = f"sealed anew; {log.path} {f'had the seal {log.seal}' if log.seal else 'had no seal'}"
    with Recorder(fresh, topics, attachments, metadata, every=every, wires=wires) as recorder:
        for messages in log.intact():
            rows = np.ones(len(messages.rows), bool) if steps is None else np.isin(steps_of(messages), steps)
            written = recorder.copy(messages, rows)
            counts[messages.topic] += len(written.t)
            ends = written.t + written.h if _is_input(messages.topic) else written.t
            reached = max([reached, *ends.tolist()])
        if untouched:
            recorder.close(*(closing[key] for key in ("status", "message", "steps", "results", "warnings")))
            return LogVerdict(WHOLE, [f"{target} holds everything that was recorded", resealed, *log.faults])
        ending = f"; the run ended with status {closing['status']}" if closing["status"] else ""
        recorder.close(
            "failed",
            f"recovered from a broken log, readable to t = {reached:.6g} s{ending}",
            closing["steps"] if last is None else last,
            closing["results"],
            closing["warnings"],
        )
    sentence = f"{target} holds {sum(counts.values())} messages, to t = {reached:.6g} s; the rest is lost"
    if counts == closing["messages"] and len(attachments) == len(names) and steps is None:
        sentence = f"{target} holds all {sum(counts.values())} messages, but names or metadata may be damaged"
    return LogVerdict(RECOVERED, [sentence, resealed, *log.faults])


def _whole_steps(log: Log, recorded: Mapping[str, int], done: int) -> NDArray[np.int64] | None:
    """Return the numbers (m,) of the steps without a lost message; None if no message is lost.

    ``recorded``: messages by topic in the closing record. ``done``: steps of the run; a log that ends earlier has lost
    steps before they were recorded. Inputs count with the step that ends them.
    """
    parts_of = {topic: [np.empty(0, np.int64)] for topic in log.topics}
    for messages in log.intact():
        parts_of[messages.topic].append(steps_of(messages))
    held = {topic: np.unique(np.concatenate(parts)) for topic, parts in parts_of.items() if _stride(log, topic)}
    steps = np.unique(np.concatenate([np.empty(0, np.int64), *held.values()]))
    complete = {topic: sum(map(len, parts)) for topic, parts in parts_of.items()} == recorded
    if complete and not _lacks_steps(log, int(steps.max(initial=0)), done):
        return None
    is_whole = np.ones(len(steps), bool)
    for topic, topic_steps in held.items():
        every, first = log.topics[topic].every, int(_is_input(topic))
        if len(topic_steps) or not len(steps) or steps[-1] < every:  # else the topic was never recorded: no loss
            is_whole &= (steps < first) | ((steps - first) % every != 0) | np.isin(steps, topic_steps)
    return steps[is_whole]


def steps_of(messages: Messages) -> NDArray[np.int64]:
    """Return the numbers (m,) of the steps of messages; inputs count with the step that ends them."""
    return messages.sequence.astype(np.int64) + int(_is_input(messages.topic))


def _is_input(topic: str) -> bool:
    return topic.endswith("/in")


def _attachment(log: Log, name: str) -> bytes | None:
    """Return the content of an attached file; None if it is damaged, which is added to the log's faults."""
    try:
        return log.attachment(name)
    except LogUnreadable as damage:
        log.faults.append(str(damage))
        return None


def info(path: str | os.PathLike[str]) -> Info:
    """Read a whole log and return its summary; raises LogUnreadable."""
    with Log(path, unfinished=True, by_index=False) as log:
        tallies, n_faults = {topic: Tally() for topic in log.topics}, len(log.faults)
        for messages in log.intact():
            tallies[messages.topic].add(messages, None)
        is_intact = len(log.faults) == n_faults
        hashes = {topic: tally.hash.hexdigest() for topic, tally in tallies.items()}
        digest = log.digest(hashes) if is_intact else ""
        attachments = {name: len(_attachment(log, name) or b"") for name in log.attachments}
        recorded = [tally for tally in tallies.values() if tally.messages]
        start = min((tally.first for tally in recorded), default=float("nan"))
        end = max((tally.last for tally in recorded), default=float("nan"))
        sealing = [fault for fault in log.seal_faults(hashes) if fault not in log.faults]
        return Info(log, start, end, digest, sealing, tallies, attachments)
