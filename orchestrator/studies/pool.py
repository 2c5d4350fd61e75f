"""Cases side by side: in processes of this machine, or on a Dask cluster.

A case that raises, takes longer than its limit or loses its process becomes a row that says so; the others go on.
Processes end with the one that started them, however that ends.
"""

from __future__ import annotations

import multiprocessing
import os
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, as_completed
from concurrent.futures import TimeoutError as TookTooLong
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

from pebble import ProcessExpired, ProcessPool

from fmus.vehicle import BadInput
from orchestrator.studies import Case
from orchestrator.studies.store import Store
from orchestrator.studies.tables import Row

ROOT = str(Path(__file__).resolve().parents[2])  # where our packages lie
ANSWER = "10 s"  # within which a Dask scheduler must say something

Rows = list[Row]
Answer = Rows | str  # of a case, or why there is none
Found = Iterator[tuple[int, Answer, bool]]  # number of the case, its answer, whether that is worth keeping


def attempt(case: Case) -> Answer:
    """The rows of a case, or how it failed."""
    try:
        rows = case.function(*case.arguments)
        return [replace(row, item=row.item or case.item, case=row.case or case.name) for row in rows]
    except Exception as error:
        return f"{type(error).__name__}: {error}"


def run(
    cases: Sequence[Case],
    workers: int = 1,
    scheduler: str | None = None,
    store: Store | None = None,
    done: Callable[[Case], None] = lambda case: None,
) -> Rows:
    """All rows in the order of the cases; one worker is this process. Raises BadInput without the scheduler."""
    found: dict[int, Rows] = {}
    for k, case in enumerate(cases):
        kept = store.get(case) if store else None
        if kept is not None:
            found[k] = kept
            done(case)
    left = sorted(set(range(len(cases))) - set(found), key=lambda k: -cases[k].seconds)
    if scheduler is not None:
        finished = _on_cluster(cases, left, scheduler)
    elif workers > 1:
        finished = _in_processes(cases, left, workers)
    else:
        finished = ((k, attempt(cases[k]), True) for k in sorted(left))
    for k, answer, worth in finished:
        case = cases[k]
        found[k] = [Row(case.item, case.name, ok=False, note=answer)] if isinstance(answer, str) else answer
        if store and worth:
            store.put(case, found[k])
        done(case)
    return [row for k in range(len(cases)) for row in found[k]]


def _in_processes(cases: Sequence[Case], left: Sequence[int], workers: int) -> Found:
    workers = max(1, min(workers, len(left)))
    context = multiprocessing.get_context("spawn")
    with _own_modules(), _single_threads(), ProcessPool(workers, initializer=_end_with_parent, context=context) as pool:
        waiting: dict[Future[Answer], int] = {
            pool.schedule(attempt, args=(cases[k],), timeout=cases[k].limit): k for k in left
        }
        try:
            for future in as_completed(waiting):
                k = waiting[future]
                try:
                    yield k, future.result(), True
                except TookTooLong:
                    yield k, f"took longer than {cases[k].limit:g} s", True
                except ProcessExpired as error:
                    yield k, f"its process ended with status {error.exitcode}", False
        finally:
            pool.stop()  # nothing is waited for after an interruption


def _end_with_parent() -> None:
    """Watch the process that started this one: a signal may end it before it can end others."""
    parent = multiprocessing.parent_process()
    assert parent is not None

    def watch() -> None:
        parent.join()
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()


@contextmanager
def _own_modules() -> Iterator[None]:
    """An FMU that ran in this process stands first on its path, and processes would take its modules for ours."""
    sys.path.insert(0, ROOT)
    try:
        yield
    finally:
        sys.path.remove(ROOT)


def _on_cluster(cases: Sequence[Case], left: Sequence[int], address: str) -> Found:
    try:
        from dask.distributed import Client
        from dask.distributed import as_completed as completed
    except ImportError:
        raise BadInput(f"--scheduler {address}: needs Dask, pip install 'cotrack[dask]'") from None
    try:
        client = Client(address, timeout=ANSWER)
    except (OSError, ValueError) as error:
        raise BadInput(f"--scheduler {address}: no Dask scheduler answers there ({error})") from None
    with client:
        waiting = {
            client.submit(attempt, cases[k], key=f"{cases[k].name}-{os.getpid()}-{k}", pure=False): k for k in left
        }
        for future in completed(list(waiting)):
            k = waiting[future]
            try:
                yield k, future.result(), True
            except Exception as error:  # the worker ended, again and again
                yield k, f"{type(error).__name__}: {error}", False


@contextmanager
def _single_threads() -> Iterator[None]:
    """Processes do not share the cores out a second time in their linear algebra."""
    names = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
    added = {name: "1" for name in names if not os.environ.get(name)}
    os.environ.update(added)
    try:
        yield
    finally:
        for name in added:
            del os.environ[name]
