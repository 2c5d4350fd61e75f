"""Tables that Python and the kernels share: records of words of 8 bytes, integers or doubles.

Addresses are integers. Whoever makes a table keeps it and all that it has the addresses of.
"""

from __future__ import annotations

from typing import Any, NamedTuple, get_type_hints

import numpy as np
from numpy.typing import NDArray

Record = NDArray[np.void]  # (1,), with the fields of a table
FREE, SUBMITTED, RUNNING, ASLEEP, ENDED = range(5)  # states of a mailbox
CACHE_LINE = 8  # words


class StepCall(NamedTuple):
    """The calls that step a component, their arguments, and how the last step went."""

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
    t: float  # s, where the step begins
    h: float  # s, its length
    no_rollback: int  # whether no earlier state will be restored
    failed: int = 0  # index of the field of the function that failed, or 0
    status: int = 0  # of FMI, returned by the last function
    seconds: float = 1.0  # wall time of the last step; before the first one a guess that is long
    total: float = 0.0  # wall time of all steps, s
    n_links: int = 0  # 0 where nobody records them
    links: int = 0  # value references
    y_links: int = 0
    links_due: int = 0  # address of a word: whether links are read after this step
    links_array: int = 0  # where the FMU keeps them once one of them is read, the reference behind the outputs'; or 0


class Mailbox(NamedTuple):
    """A worker's slot for one task."""

    state: int = FREE
    task: int = 0  # a StepCall


class StepPlan(NamedTuple):
    """A communication step: copy inputs that are known before it, then step group after group."""

    n_copies: int  # u = y, by address
    copies_to: int
    copies_from: int
    n_groups: int
    groups: int  # addresses
    n_workers: int
    mailboxes: int  # addresses
    worthwhile: float  # s: workers are used where the last member of a group took so long


class StepGroup(NamedTuple):
    """Components that step at once, and inputs that they take from components that have stepped."""

    n_copies: int  # u = y
    copies_to: int
    copies_from: int
    n_means: int  # u = (u + y) / 2, u being the value before the step
    means_to: int
    means_from: int
    n_calls: int
    calls: int  # addresses


class RowHead(NamedTuple):
    """The words of a log row before its values."""

    number: int  # of the step
    ns: int  # time, written when the row is packed
    t: float  # s
    h: float  # s, length of the step


class RowTable(NamedTuple):
    """A table that grows by rows: parts that lie anywhere, copied one after the other."""

    n_parts: int
    parts: int  # addresses
    sizes: int  # bytes
    end: int  # address at which the next row begins


def record_type(table: type) -> np.dtype[Any]:
    """The numpy type of a table."""
    kinds = {int: np.int64, float: np.float64}
    return np.dtype([(name, kinds[kind]) for name, kind in get_type_hints(table).items()], align=True)


def record(table: NamedTuple) -> Record:
    """A table in memory (1,); it begins with a cache line that no other thread's table is on."""
    words = np.zeros(len(table) // CACHE_LINE * CACHE_LINE + 2 * CACHE_LINE, dtype=np.int64)
    first = -(words.ctypes.data // 8) % CACHE_LINE
    made = words[first : first + len(table)].view(record_type(type(table)))
    made[0] = tuple(table)
    return made
