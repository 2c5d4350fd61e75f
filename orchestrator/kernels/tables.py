"""Tables shared by Python and the kernels: records of 8-byte integers and doubles.

Addresses are integers. The maker of a table must keep alive the table and all memory that it refers to.
"""

from __future__ import annotations

from typing import Any, NamedTuple, get_type_hints

import numpy as np
from numpy.typing import NDArray

Record = NDArray[np.void]  # (1,), with the fields of a table
FREE, SUBMITTED, RUNNING, ASLEEP, ENDED = range(5)  # states of a mailbox
CACHE_LINE = 8  # words


class StepCall(NamedTuple):
    """FMI calls that step a component, their arguments, and the result of the last step."""

    instance: int
    set_real: int
    inputs: int  # value references
    n_inputs: int
    u: int
    do_step: int
    get_real: int
    outputs: int  # value references
    n_outputs: int
    y: int
    start: float  # s, time of the FMU at the start of the run
    t: float  # s from the start of the run, beginning of the step
    h: float  # s, its length
    no_rollback: int  # 1: no earlier state will be restored
    begin: int = 0  # function with the arguments of do_step that begins the step in another process, or 0
    failed: int = 0  # index of the field of the function that failed, or 0
    status: int = 0  # FMI status of the last function
    seconds: float = 1.0  # wall time of the last step; initially an overestimate
    total: float = 0.0  # wall time of all steps, s
    clock: int = 0  # s, the system's monotonic time, as clock_gettime writes it
    clock_ns: int = 0  # and ns
    n_links: int = 0  # number of link outputs; 0: not recorded
    links: int = 0  # value references
    y_links: int = 0
    links_due: int = 0  # address of a word: 1 if links are read after this step
    u_array: int = 0  # address of the FMU's inputs, or 0: there they are copied instead of being set
    y_array: int = 0  # of its outputs
    links_array: int = 0  # of its link outputs; reading one of them fills it


class Mailbox(NamedTuple):
    """Slot of a worker for one task."""

    state: int = FREE
    task: int = 0  # address of a StepCall
    bell: int = 0  # address of a semaphore of the C library, at which the worker sleeps


class StepPlan(NamedTuple):
    """Plan of a communication step: copy the inputs known before it, then step group after group."""

    n_copies: int  # u = y, by address
    copies_to: int
    copies_from: int
    n_groups: int
    groups: int  # addresses
    n_workers: int
    mailboxes: int  # addresses
    worthwhile: float  # s: workers are used if the last member of the group took at least this long


class StepGroup(NamedTuple):
    """Components that step in parallel, and their inputs from components that have stepped."""

    n_copies: int  # u = y
    copies_to: int
    copies_from: int
    n_means: int  # u = (u + y) / 2, u being the value before the step
    means_to: int
    means_from: int
    n_calls: int
    calls: int  # addresses; those that begin a step in another process are the last ones
    n_here: int  # number of the others


class RowHead(NamedTuple):
    """Words of a log row before its values."""

    number: int  # of the step
    ns: int  # time, written when the row is packed
    t: float  # s
    h: float  # s, length of the step


class RowTable(NamedTuple):
    """Table that grows by rows; a row is a copy of parts anywhere in memory, one after the other."""

    n_parts: int
    parts: int  # addresses
    sizes: int  # bytes
    end: int  # address at which the next row begins


def record_type(table: type) -> np.dtype[Any]:
    """Return the numpy dtype of a table class."""
    kinds = {int: np.int64, float: np.float64}
    return np.dtype([(name, kinds[kind]) for name, kind in get_type_hints(table).items()], align=True)


def record(table: NamedTuple) -> Record:
    """Return a table in memory (1,) on cache lines of its own, which no other table shares."""
    words = np.zeros(len(table) // CACHE_LINE * CACHE_LINE + 2 * CACHE_LINE, dtype=np.int64)
    first = -(words.ctypes.data // 8) % CACHE_LINE
    row = words[first : first + len(table)].view(record_type(type(table)))
    row[0] = tuple(table)
    return row
