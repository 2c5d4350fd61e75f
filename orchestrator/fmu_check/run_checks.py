"""Checks of runs: the same bits again and from a saved state; what they leave behind in process and memory."""

from __future__ import annotations

import ctypes
import gc
import os
import sys
import tempfile
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from orchestrator.fmu_check.instance import (
    STEPS,
    CallRefused,
    Floats,
    Instance,
    NotApplicable,
    Subject,
    Verdict,
    listed,
)


def check_repeatability(subject: Subject) -> Verdict:
    """Compare a run with a second one, with two that step in turn, and with one whose steps another thread makes."""
    varied = f"inputs vary by {subject.amplitude:g}" if subject.amplitude else "inputs keep their start values"
    inputs = varied if subject.inputs else f"no {subject.fmi.real} inputs"
    (expected,) = _again(subject)
    faults = []
    for where, runs in (
        ("in a second run", _again),
        ("of two instances that step in turn", _in_turn),
        ("in another thread than that of the instantiation", _in_thread),
    ):
        subject.doing = where
        try:
            names = dict.fromkeys(name for run in runs(subject) for name in subject.differing(expected, run))
        except NotApplicable:
            continue  # it takes two instances at once
        except CallRefused as refusal:
            faults.append(f"{where}: {refusal}")
        else:
            faults += [f"{where} {listed([*names])} differ"] if names else []
    return Verdict(f"{STEPS} steps of {subject.step:g} s, {inputs}: the same bits", tuple(faults))


def _again(subject: Subject) -> list[Floats]:
    with Instance(subject) as instance:
        instance.initialise()
        return [instance.run()]


def _in_turn(subject: Subject) -> list[Floats]:
    with Instance(subject) as one, Instance(subject) as two:
        one.initialise()
        two.initialise()
        pairs = [(one.step(k), two.step(k)) for k in range(STEPS)]
    return [np.array(rows) for rows in zip(*pairs, strict=True)]


def _in_thread(subject: Subject) -> list[Floats]:
    with Instance(subject) as instance, ThreadPoolExecutor(1) as pool:
        instance.initialise()
        return [pool.submit(instance.run).result()]


BEFORE, AFTER = 5, 10  # steps before and after the state is saved


def check_states(subject: Subject) -> Verdict:
    """Save a state, step on, restore it, step again; then the same in a second instance by the bytes of the state."""
    can = subject.description.coSimulation
    if not can.canGetAndSetFMUstate:
        raise NotApplicable("canGetAndSetFMUstate is not declared")
    faults = []
    with Instance(subject) as first:
        first.initialise()
        first.run(0, BEFORE)
        state = first.must(first.slave.save)
        expected = first.run(BEFORE, AFTER)
        for time in ("first", "second"):
            subject.doing = f"when a state was restored the {time} time"
            first.must(first.slave.restore, state)
            if names := subject.differing(expected, first.run(BEFORE, AFTER)):
                faults.append(f"steps after restoring a state the {time} time differ in {listed(names)}")
        content = first.must(first.slave.dump, state) if can.canSerializeFMUstate else b""
        first.must(first.slave.discard, state)
    if not can.canSerializeFMUstate:
        return Verdict("restored twice, the same bits; canSerializeFMUstate is not declared", tuple(faults))
    subject.doing = "when a state was carried into a second instance"
    with Instance(subject) as second:
        second.initialise()
        second.must(second.slave.discard, second.must(second.slave.load, content))
        if names := subject.differing(expected, second.run(BEFORE, AFTER)):
            faults.append(f"steps of a second instance with the state's bytes differ in {listed(names)}")
    note = f"restored twice, the same bits; as {len(content)} bytes into a second instance too"
    return Verdict(note, tuple(faults))


SMALL = 1e-310  # a number that has less than the usual digits


class Process(NamedTuple):
    """State of the process that an FMU must leave as it is."""

    rounding: int  # mode of C
    keeps_small: bool  # numbers below 2.2e-308 are not taken for 0
    folder: str  # in which the process works

    @classmethod
    def now(cls) -> Process:
        """The process as it is."""
        rounding = getattr(ctypes.CDLL(None), "fegetround", lambda: 0)()
        return cls(int(rounding), bool(np.multiply(SMALL, np.ones(1))[0]), os.getcwd())

    def changed(self, before: Process) -> Iterator[str]:
        """Words about what is not as before."""
        if self.rounding != before.rounding:
            yield f"another rounding mode ({before.rounding:#x}, then {self.rounding:#x})"
        if self.keeps_small != before.keeps_small:
            yield "numbers below 2.2e-308 are 0"
        if self.folder != before.folder:
            yield f"another working folder ({self.folder})"


def check_surroundings(subject: Subject) -> Verdict:
    """Instantiate, initialise, step and free; look at the process behind each of them."""
    before, faults = Process.now(), []
    with _printed() as text:
        for where in _pieces(subject):
            now = Process.now()
            faults += [f"{where} leaves {words}" for words in now.changed(before)]
            before = now
    is_single = bool(subject.description.coSimulation.canBeInstantiatedOnlyOncePerProcess)
    once = "; the FMU can be instantiated once per process" * is_single
    said = f"prints {len(text[0])} characters" if text[0] else "prints nothing"
    return Verdict(f"a run of {STEPS} steps {said}, and leaves the process as it was{once}", tuple(faults))


def _pieces(subject: Subject) -> Iterator[str]:
    """Yield the words for each piece of work that is done."""
    with Instance(subject) as instance:
        yield subject.name(subject.fmi.instantiate)
        instance.initialise()
        yield "the initialisation"
        for k in range(STEPS):
            instance.step(k, 0.0)  # with start values: a trial of others would make a second instance
        yield subject.name("DoStep")
    yield subject.name("FreeInstance")


@contextmanager
def _printed() -> Iterator[list[str]]:
    """The text that libraries print meanwhile, on both streams, in a list that gets it at the end."""
    found = [""]
    with tempfile.TemporaryFile() as file:
        kept = {number: os.dup(number) for number in (1, 2)}
        try:
            for number in kept:
                os.dup2(file.fileno(), number)
            yield found
        finally:
            sys.stdout.flush()
            _flush()
            for number, copy in kept.items():
                os.dup2(copy, number)
                os.close(copy)
            file.seek(0)
            found[0] = file.read().decode("utf-8", "replace")


def _flush() -> None:
    """Flush the streams of C."""
    flush: Any = getattr(ctypes.CDLL(None), "fflush", None)
    if flush is not None:
        flush(None)


CYCLES, WARM_UP = 200, 50
LIMIT = 10.0  # MB
PROCESS = Path("/proc/self/status")


def check_memory(subject: Subject) -> Verdict:
    """Instantiate, initialise, step and free; measure the growth of resident memory after a warm-up."""
    if not PROCESS.exists():
        raise NotApplicable("this system has no /proc/self/status")
    before = float("inf")
    for cycle in subject.each(range(WARM_UP + CYCLES)):
        subject.doing = f"in cycle {cycle}"
        before = _resident() if cycle == WARM_UP else before
        _cycle(subject)
    growth = _resident() - before
    sentence = f"resident memory grows by {growth:.1f} MB in {CYCLES} cycles of instantiate, initialise, step and free"
    return Verdict(sentence, (sentence,) if growth > LIMIT else ())


def _cycle(subject: Subject) -> None:
    with Instance(subject) as instance:
        instance.initialise()
        instance.step(0)


def _resident() -> float:
    """Resident memory, MB."""
    gc.collect()
    (line,) = (line for line in PROCESS.read_text().splitlines() if line.startswith("VmRSS"))
    return int(line.split()[1]) / 1024.0
