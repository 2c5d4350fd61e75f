"""Cases side by side: in processes of this machine, or on a Dask cluster.

A case that raises, takes longer than its limit or loses its process becomes a row that says so; the others go on.
"""

from __future__ import annotations

import multiprocessing
import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, as_completed
from concurrent.futures import TimeoutError as TookTooLong
from contextlib import contextmanager
from typing import Any

from pebble import ProcessExpired, ProcessPool

from fmus.vehicle import BadInput
from orchestrator.studies import Case, Study
from orchestrator.studies.store import Store

ANSWER = "10 s"  # within which a Dask scheduler must say something

Rows = list[Any]
Found = Iterator[tuple[int, Rows, bool]]  # number of the case, its rows, whether they are worth keeping


def attempt(study: Study, case: Case) -> Rows:
    """The rows of a case, or the one that says how it failed."""
    try:
        return study.measure(case)
    except Exception as error:
        return [study.failed(case.item, case.name, f"{type(error).__name__}: {error}")]


def run(
    study: Study,
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
        finished = _on_cluster(study, cases, left, scheduler)
    elif workers > 1:
        finished = _in_processes(study, cases, left, workers)
    else:
        finished = ((k, attempt(study, cases[k]), True) for k in sorted(left))
    for k, rows, worth in finished:
        found[k] = rows
        if store and worth:
            store.put(cases[k], rows)
        done(cases[k])
    return [row for k in range(len(cases)) for row in found[k]]


def _in_processes(study: Study, cases: Sequence[Case], left: Sequence[int], workers: int) -> Found:
    name = _name(study)
    workers = max(1, min(workers, len(left)))
    with _single_threads(), ProcessPool(workers, context=multiprocessing.get_context("spawn")) as pool:
        waiting: dict[Future[Rows], int] = {
            pool.schedule(_attempt, args=(name, cases[k]), timeout=cases[k].limit): k for k in left
        }
        try:
            for future in as_completed(waiting):
                k = waiting[future]
                try:
                    yield k, future.result(), True
                except TookTooLong:
                    yield k, _lost(study, cases[k], f"took longer than {cases[k].limit:g} s"), True
                except ProcessExpired as error:
                    yield k, _lost(study, cases[k], f"its process ended with status {error.exitcode}"), False
        finally:
            pool.stop()  # nothing is waited for after an interruption


def _on_cluster(study: Study, cases: Sequence[Case], left: Sequence[int], address: str) -> Found:
    try:
        from dask.distributed import Client
        from dask.distributed import as_completed as completed
    except ImportError:
        raise BadInput(f"--scheduler {address}: needs Dask, pip install 'cotrack[dask]'") from None
    try:
        client = Client(address, timeout=ANSWER)
    except (OSError, ValueError) as error:
        raise BadInput(f"--scheduler {address}: no Dask scheduler answers there ({error})") from None
    name = _name(study)
    with client:
        waiting = {
            client.submit(_attempt, name, cases[k], key=f"{cases[k].name}-{os.getpid()}-{k}", pure=False): k
            for k in left
        }
        for future in completed(list(waiting)):
            k = waiting[future]
            try:
                yield k, future.result(), True
            except Exception as error:  # the worker ended, again and again
                yield k, _lost(study, cases[k], f"{type(error).__name__}: {error}"), False


def _attempt(study: str, case: Case) -> Rows:
    from importlib import import_module

    module: Any = import_module(study)
    return attempt(module, case)


def _name(study: Study) -> str:
    return str(getattr(study, "__name__"))  # noqa: B009  a module


def _lost(study: Study, case: Case, reason: str) -> Rows:
    return [study.failed(case.item, case.name, reason)]


@contextmanager
def _single_threads() -> Iterator[None]:
    """Processes do not share the cores out a second time in their linear algebra."""
    names = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
    before = {name: os.environ.get(name) for name in names}
    os.environ.update({name: value or "1" for name, value in before.items()})
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                os.environ.pop(name, None)
