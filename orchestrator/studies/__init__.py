"""Studies: cases() -> measure(case) -> rows -> tables and a figure. They run side by side in processes.

A study is a module with ``TITLE``, ``cases(quick)`` and ``measure(case)``. It may use ``fmus.physics`` itself: a study
of the mechanics needs the mechanics.
"""

from __future__ import annotations

import multiprocessing
import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor, Future, ProcessPoolExecutor, as_completed
from contextlib import contextmanager
from difflib import get_close_matches
from importlib import import_module
from types import TracebackType
from typing import Any, NamedTuple, Protocol

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

from fmus.vehicle import BadInput
from orchestrator.studies.tables import Row, failed

STUDIES = {
    "mechanics": "elements, joints and chains of the paper against exact and published figures",
    "coupling": "orders, energies and largest stable steps of all couplings on two masses",
}


class Case(NamedTuple):
    """One piece of work of a study; it travels to another process."""

    item: str
    name: str
    function: Callable[..., list[Row]]
    arguments: tuple[Any, ...] = ()
    seconds: float = 1.0  # roughly; the long ones begin first


class Study(Protocol):
    """What a module of this folder offers."""

    TITLE: str

    def cases(self, quick: bool) -> list[Case]: ...  # noqa: D102
    def measure(self, case: Case) -> list[Row]: ...  # noqa: D102


def find(name: str) -> Study:
    """A study by its name; raises BadInput."""
    if name not in STUDIES:
        near = get_close_matches(name, STUDIES, n=1)
        hint = f"did you mean '{near[0]}'?" if near else f"there are {', '.join(STUDIES)}"
        raise BadInput(f"no study '{name}': {hint}")
    study: Any = import_module(f"orchestrator.studies.{name.replace('-', '_')}")
    return study


def attempt(measure: Callable[[Case], list[Row]], case: Case) -> list[Row]:
    """The rows of a case, or the one that says how it failed."""
    try:
        return measure(case)
    except Exception as error:
        return [failed(case.item, case.name, f"{type(error).__name__}: {error}")]


def run(
    study: Study, cases: Sequence[Case], workers: int, done: Callable[[Case], None] = lambda case: None
) -> list[Row]:
    """All rows in the order of the cases; one worker is this process."""
    found: dict[int, list[Row]] = {}
    if workers <= 1:
        for k, case in enumerate(cases):
            found[k] = attempt(study.measure, case)
            done(case)
    else:
        order = sorted(range(len(cases)), key=lambda k: -cases[k].seconds)
        with _processes(workers) as pool:
            waiting: dict[Future[list[Row]], int] = {
                pool.submit(attempt, study.measure, cases[k]): k for k in order
            }
            for future in as_completed(waiting):
                case = cases[waiting[future]]
                try:
                    found[waiting[future]] = future.result()
                except Exception as error:  # the process itself ended
                    found[waiting[future]] = [
                        failed(case.item, case.name, f"{type(error).__name__}: {error}")
                    ]
                done(case)
    return [row for k in range(len(cases)) for row in found[k]]


@contextmanager
def _processes(workers: int) -> Iterator[Executor]:
    """A pool whose processes do not share the cores out a second time in their linear algebra."""
    names = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
    before = {name: os.environ.get(name) for name in names}
    os.environ.update({name: value or "1" for name, value in before.items()})
    pool = ProcessPoolExecutor(workers, mp_context=multiprocessing.get_context("spawn"))
    try:
        yield pool
    finally:
        pool.shutdown(cancel_futures=True)
        for name, value in before.items():
            if value is None:
                os.environ.pop(name, None)


class Watched:
    """A bar on stderr where someone watches, else a line for each case that is done."""

    def __init__(self, title: str, count: int) -> None:
        self._count, self._done = count, 0
        self._console = Console(stderr=True)
        self._bar = Progress(
            TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn(),
            TextColumn("{task.fields[last]}"), console=self._console, transient=True,
        )  # fmt: skip
        self._task = self._bar.add_task(title, total=count, last="")

    def __enter__(self) -> Watched:
        if self._console.is_terminal:
            self._bar.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._bar.stop()

    def __call__(self, case: Case) -> None:
        """One more case is done."""
        self._done += 1
        if self._console.is_terminal:
            self._bar.update(self._task, advance=1, last=case.name)
        else:
            self._console.print(f"{self._done}/{self._count} {case.name}", markup=False, highlight=False)
