"""Communication step as a plan for the kernels: copies of inputs, and groups that step in parallel."""

from __future__ import annotations

import ctypes
import os
import threading
from collections.abc import Sequence
from contextvars import copy_context
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from orchestrator.cosim.component import Component
from orchestrator.cosim.graph import Floats, Indices
from orchestrator.cosim.row_writer import RowWriter
from orchestrator.fmi.slave import ComponentFailed
from orchestrator.kernels.compiled import kernels
from orchestrator.kernels.tables import ENDED, Mailbox, StepGroup, StepPlan, record
from orchestrator.log.time_series import Rule

WORTHWHILE = 5e-5  # s, least step time for threads: a shorter step of our FMUs is mostly Python, which has one lock
SEMAPHORE = 8  # words, enough for a semaphore of any C library
POLLS = 800_000  # polls for a task before a worker sleeps, about a millisecond


class InputCopy(NamedTuple):
    """Inputs that follow from outputs by one rule."""

    u: Floats
    inputs: Indices
    y: Floats
    outputs: Indices
    rule: Rule


class Stage(NamedTuple):
    """Components that step in parallel, and the copies of their inputs."""

    components: Sequence[Component]
    copies: Sequence[InputCopy]


class Program:
    """Step of all components by the kernels; inputs without a rule must be set before.

    :param threads: components of a stage step in parallel threads; the result is the same without.
    """

    def __init__(self, stages: Sequence[Stage], threads: bool = True) -> None:
        self._components = [component for stage in stages for component in stage.components]
        self._kernels = kernels()
        self._arrays: list[NDArray[Any]] = []  # arrays whose addresses are in the plan
        most = max(sum(not component.is_remote for component in stage.components) for stage in stages)
        n_workers = max(min(most, processors()) - 1, 0) if threads else 0
        self._workers = [Worker() for _ in range(n_workers)]
        copies_before = self._copy_words([copy for stage in stages for copy in stage.copies if copy.rule != "end"])
        groups = self._words([self._address(record(self._group(stage))) for stage in stages])
        mailboxes = self._words([worker.address for worker in self._workers])
        self._plan = self._address(
            record(StepPlan(*copies_before, len(stages), groups, n_workers, mailboxes, WORTHWHILE))
        )

    def close(self) -> None:
        """End the threads."""
        for worker in self._workers:
            worker.close()
        self._workers = []

    def run(self, t: float, h: float) -> None:
        """Step all components from t to t + h, s; raises ComponentFailed for the first one that failed."""
        for component in self._components:
            component.prepare_step(t)
        if self._kernels.step_all(self._plan, t, h):
            raise self.failure()

    def step_batch(self, row_writer: RowWriter, k: int, n: int, h: float) -> int:
        """Do the steps k + 1 to k + n of ``h`` s and write their rows into the pages of the log.

        Returns the number of steps done before a component failed.
        """
        for component in self._components:
            component.prepare_step(k * h)
        for component in row_writer.linked:
            component.read_links_when(row_writer.due)
        done = int(
            self._kernels.step_many(self._plan, *row_writer.addresses(h), row_writer.due, row_writer.every, k, n, h)
        )
        row_writer.count_rows(k, done)
        return done

    def failure(self) -> ComponentFailed:
        """Return the failure of the last step; if several components failed, that of the first one."""
        return next(failure for component in self._components if (failure := component.failure()) is not None)

    def _group(self, stage: Stage) -> StepGroup:
        ends, means = ([copy for copy in stage.copies if copy.rule == rule] for rule in ("end", "middle"))
        ordered = sorted(stage.components, key=lambda component: component.is_remote)
        calls = self._words([component.step_call.ctypes.data for component in ordered])
        here = sum(not component.is_remote for component in ordered)
        return StepGroup(*self._copy_words(ends), *self._copy_words(means), len(ordered), calls, here)

    def _copy_words(self, copies: Sequence[InputCopy]) -> tuple[int, int, int]:
        """Return the number of values, and the addresses of the arrays of target and source addresses."""
        targets = [copy.u.ctypes.data + 8 * int(k) for copy in copies for k in copy.inputs]
        sources = [copy.y.ctypes.data + 8 * int(k) for copy in copies for k in copy.outputs]
        return len(targets), self._words(targets), self._words(sources)

    def _words(self, values: Any) -> int:
        return self._address(np.array(values, dtype=np.int64))

    def _address(self, table: NDArray[Any]) -> int:
        """Keep an array alive; return its address."""
        self._arrays.append(table)
        return int(table.ctypes.data)


def processors() -> int:
    """Number of processors that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


class Worker:
    """Thread that does the tasks of its mailbox."""

    def __init__(self) -> None:
        self._bell = np.zeros(SEMAPHORE, dtype=np.int64)
        ctypes.CDLL(None).sem_init(ctypes.c_void_p(self._bell.ctypes.data), 0, 0)
        self.mailbox = record(Mailbox(bell=self._bell.ctypes.data))
        self.address = int(self.mailbox.ctypes.data)
        self._kernels = kernels()  # held: two threads that load them at once get two, and the cache keeps one
        context = copy_context()  # whether messages of the run are silent holds for its threads
        self._thread = threading.Thread(target=context.run, args=(self._work,), name="step", daemon=True)
        self._thread.start()

    def _work(self) -> None:
        self._kernels.work(self.address, POLLS)

    def close(self) -> None:
        """End the thread, which must have no task."""
        self._kernels.set_state(self.address, ENDED)
        self._thread.join()
