"""Check that a run leaves the process as it was: rounding mode, small numbers, working folder, printed text."""

from __future__ import annotations

import ctypes
import os
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, NamedTuple

import numpy as np

from orchestrator.fmu_check.instance import STEPS, Instance, Subject
from orchestrator.fmu_check.verdict import Verdict

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


def check(subject: Subject) -> Verdict:
    """Instantiate, initialise, step and free; look at the process behind each of them."""
    before, faults = Process.now(), []
    with _printed() as text:
        for where in _run(subject):
            now = Process.now()
            faults += [f"{where} leaves {words}" for words in now.changed(before)]
            before = now
    once = "; the FMU can be instantiated once per process" * _is_single(subject)
    said = f"prints {len(text[0])} characters" if text[0] else "prints nothing"
    return Verdict(f"a run of {STEPS} steps {said}, and leaves the process as it was{once}", tuple(faults))


def _is_single(subject: Subject) -> bool:
    return bool(subject.description.coSimulation.canBeInstantiatedOnlyOncePerProcess)


def _run(subject: Subject) -> Iterator[str]:
    """Yield the words for each piece of work that is done."""
    subject.begin("at the instantiation")
    with Instance(subject) as instance:
        yield subject.name(subject.fmi.INSTANTIATE)
        subject.begin("in the initialisation")
        instance.initialise()
        yield "the initialisation"
        subject.begin("in a step")
        for k in range(STEPS):
            instance.step(k, 0.0)  # with start values: a trial of others would make a second instance
        yield subject.name("DoStep")
        subject.begin("at the end")
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
