"""Parallel cases: in processes of this machine, or on a Dask cluster; their progress, and the store of finished ones.

A case that raises, exceeds its limit or loses its process becomes a row with the reason; the others continue. Worker
processes end with their parent, however it ends. Finished cases are JSON files, so an interrupted study continues where
it was. A file is named after the case and the sources that computed it: changed sources make another file. A failure of
the machine is no answer of the model: its case is done again.
"""

from __future__ import annotations

import hashlib
import itertools
import json
import multiprocessing
import os
import sys
import threading
import time
import warnings
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, as_completed
from concurrent.futures import TimeoutError as TookTooLong
from contextlib import contextmanager
from contextvars import Context
from dataclasses import asdict, replace
from functools import cache
from multiprocessing import synchronize
from multiprocessing.context import SpawnContext
from pathlib import Path

from pebble import ProcessExpired, ProcessPool

from fmus.cache.files import write
from fmus.fmi.build import BuildFailed
from fmus.vehicles.tables import BadInput
from orchestrator.cosim.program import processors
from orchestrator.files.messages import LOG, PROGRESS, silent
from orchestrator.log.extra import installation
from orchestrator.log.log_file import LogFailed
from orchestrator.studies import Case, Row

ROOT = str(Path(__file__).resolve().parents[2])  # folder of our packages
LONG = 5.0  # s, after which the time left is told
SCHEDULER_TIMEOUT = "10 s"  # timeout of a Dask scheduler
Rows = list[Row]
CaseResult = tuple[Rows | str, bool]  # rows of a case, or the reason of a failure; True: the model's answer
FinishedCases = Iterator[tuple[int, Rows | str, bool]]  # with the number of the case
MACHINE = OSError, MemoryError, BuildFailed, LogFailed  # also as the cause of another error


def attempt(case: Case) -> CaseResult:
    """Rows of a case, or the reason of its failure: the model's answer, unless machine or program failed."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", RuntimeWarning)  # of overflow; the rows have what became of it
            rows = Context().run(silent()(case.function), *case.arguments)  # its faults are not the command's
        return [replace(row, item=row.item or case.item, case=row.case or case.name) for row in rows], True
    except Exception as error:
        cause: BaseException | None = error
        while cause is not None and not isinstance(cause, MACHINE):
            cause = cause.__cause__ or cause.__context__
        return f"{type(error).__name__}: {error}", cause is None and isinstance(error, BadInput | RuntimeError)


def run(
    cases: Sequence[Case],
    workers: int = 1,
    scheduler: str | None = None,
    store: Store | None = None,
    done: Callable[[Case, Rows], None] = lambda case, rows: None,
) -> Rows:
    """Run all cases; return their rows in order. One worker is this process, more than there are processors none.

    Raises BadInput if the scheduler cannot be reached.
    """
    rows_of: dict[int, Rows] = {}
    for k, case in enumerate(cases):
        stored = store.get(case) if store else None
        if stored is not None:
            rows_of[k] = stored
            done(case, stored)
    if store and store.unanswered:
        LOG.warning("runs that the machine failed are done again: %d", store.unanswered)
        store.unanswered = 0
    remaining = sorted(set(range(len(cases))) - set(rows_of), key=lambda k: -cases[k].seconds)
    if scheduler is not None:
        finished = _on_cluster(cases, remaining, scheduler)
    elif workers > 1:
        # More workers than processors would take turns, with the memory of all.
        finished = _in_processes(cases, remaining, min(workers, processors()))
    else:
        finished = ((k, *attempt(cases[k])) for k in sorted(remaining))
    for k, answer, answered in finished:
        case = cases[k]
        rows_of[k] = [Row(case.item, case.name, ok=False, note=answer)] if isinstance(answer, str) else answer
        if store:
            store.put(case, rows_of[k] if answered else None)
        done(case, rows_of[k])
    return [row for k in range(len(cases)) for row in rows_of[k]]


class _LastingLocks(SpawnContext):
    """Starts processes anew; keeps their locks until the pool has ended.

    A pool of Pebble 5.2.3 removes them before it ends its processes, and one that is still starting prints a traceback.
    """

    def __init__(self) -> None:
        super().__init__()
        self._locks: list[synchronize.RLock] = []

    def RLock(self) -> synchronize.RLock:  # noqa: N802 (name of Python)
        self._locks.append(super().RLock())
        return self._locks[-1]


def _in_processes(cases: Sequence[Case], remaining: Sequence[int], workers: int) -> FinishedCases:
    workers = max(1, min(workers, len(remaining)))
    context = _LastingLocks()
    with _own_modules(), _single_threads(), ProcessPool(workers, initializer=_end_with_parent, context=context) as pool:
        waiting: dict[Future[CaseResult], int] = {
            pool.schedule(attempt, args=(cases[k],), timeout=cases[k].limit): k for k in remaining
        }
        try:
            for future in as_completed(waiting):
                k = waiting[future]
                try:
                    yield k, *future.result()
                except TookTooLong:
                    yield k, f"took longer than {cases[k].limit:g} s", True
                except ProcessExpired as error:
                    yield k, f"its process ended with status {error.exitcode}", False
        except BaseException:  # after an interruption, do not wait
            pool.stop()
            raise


def _end_with_parent() -> None:
    """End this process when its parent has ended: a signal may end the parent before its children."""
    parent = multiprocessing.parent_process()
    assert parent is not None

    def watch() -> None:
        parent.join()
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()


@contextmanager
def _own_modules() -> Iterator[None]:
    """Put our packages first on the path of worker processes; an FMU that ran here may stand there."""
    sys.path.insert(0, ROOT)
    try:
        yield
    finally:
        sys.path.remove(ROOT)


def _on_cluster(cases: Sequence[Case], remaining: Sequence[int], address: str) -> FinishedCases:
    try:
        from dask.distributed import Client
        from dask.distributed import as_completed as completed
    except ImportError:
        raise BadInput(f"scheduler {address}: Dask is not installed: {installation('dask')}") from None
    try:
        client = Client(address, timeout=SCHEDULER_TIMEOUT)
    except (OSError, ValueError) as error:
        raise BadInput(f"scheduler {address}: no Dask scheduler answers there ({error})") from None
    with client:
        waiting = {
            client.submit(attempt, cases[k], key=f"{cases[k].name}-{os.getpid()}-{k}", pure=False): k for k in remaining
        }
        for future in completed(list(waiting)):
            k = waiting[future]
            try:
                yield k, *future.result()
            except Exception as error:  # the worker has ended repeatedly
                yield k, f"{type(error).__name__}: {error}", False


@contextmanager
def _single_threads() -> Iterator[None]:
    """Limit the linear algebra of workers to one thread, because the processes use all cores."""
    names = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
    added = {name: "1" for name in names if not os.environ.get(name)}
    os.environ.update(added)
    try:
        yield
    finally:
        for name in added:
            del os.environ[name]


def finished_cases(count: int, remark: Callable[[Rows], str]) -> Callable[[Case, Rows], None]:
    """Return a function that logs each finished case of ``count`` as progress, with the ``remark`` on its rows."""
    done, began = itertools.count(1), time.monotonic()

    def finished(case: Case, rows: Rows) -> None:
        number, spent = next(done), time.monotonic() - began
        left = f"; {spent / number * (count - number):.0f} s left" if spent > LONG and number < count else ""
        text, counted = "%d/%d %s%s%s", {"done": number, "of": count}
        PROGRESS.info(text, number, count, case.name, remark(rows), left, extra=counted)

    return finished


PACKAGES = ("fmus", "orchestrator")


@cache
def sources(module: str) -> str:
    """Hash of all sources and scenes of the installed packages, and of the folder of an outside module."""
    digest = hashlib.sha256()
    root = Path(__file__).parents[2]
    folder = "/".join(module.split(".")[:2])  # tests.validation.x: tests/validation
    for package in dict.fromkeys((*PACKAGES, folder)):
        for file in sorted((root / package).rglob("*")):
            if file.suffix in (".py", ".toml"):
                digest.update(file.relative_to(root).as_posix().encode() + b"\0")
                digest.update(hashlib.sha256(file.read_bytes()).digest())
    return digest.hexdigest()


class Store:
    """Rows of finished cases in a folder."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self.unanswered = 0  # cases that ``get`` has found without an answer of the model

    def _file(self, case: Case) -> Path:
        """File of a case. Limits of time do not count: a case that took too long is not repeated."""
        identity = [
            case.item,
            case.name,
            case.function.__qualname__,
            repr(case.arguments),
            sources(case.function.__module__),
        ]
        return self._folder / f"{hashlib.sha256(json.dumps(identity).encode()).hexdigest()[:24]}.json"

    def get(self, case: Case) -> list[Row] | None:
        """Rows of a case; None if it is not finished, has no answer of the model, or its file is unreadable."""
        try:
            rows = json.loads(self._file(case).read_text())["rows"]
            self.unanswered += rows is None
            return rows and [Row(**row) for row in rows]
        except (OSError, ValueError, TypeError, KeyError):
            return None

    def put(self, case: Case, rows: list[Row] | None) -> None:
        """Store the rows of a case, None without an answer of the model, whole or not at all."""
        self._folder.mkdir(parents=True, exist_ok=True)
        content = {"case": case.name, "rows": None if rows is None else [asdict(row) for row in rows]}
        write(self._file(case), json.dumps(content, indent=1).encode())
