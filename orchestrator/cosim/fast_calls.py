"""Calls of a slave by kernels, without Python: addresses of its functions, its arrays and its values in memory."""

from __future__ import annotations

from ctypes import addressof, c_int
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from orchestrator.cosim.callbacks import EXCHANGE, STEP, Callbacks
from orchestrator.cosim.mixed_exchange import MixedExchange
from orchestrator.cosim.processes.remote import RemoteSlave
from orchestrator.cosim.variables import Variables
from orchestrator.fmi import fmi2
from orchestrator.fmi.slave import Slave, failed
from orchestrator.kernels.tables import Record, StepCall, record

REALS = ("reals.base.lo", "reals.base.hi", "reals.size")  # address (two words) and bytes of an FMU's Reals in memory
_OUTPUTS, _LINKS = 1, 2  # in place of value references, for functions that need none


class Places(NamedTuple):
    """Addresses in an FMU's memory, 0 if unknown."""

    u_array: int = 0
    y_array: int = 0
    links_array: int = 0


def places(slave: Slave, variables: Variables) -> Places:
    """Addresses at which an FMU of ours has inputs, outputs and link outputs, where they can be copied."""
    names = [name for name in REALS if name in variables.by_name and variables.by_name[name].type == "Integer"]
    if names != [*REALS]:
        return Places()
    values = np.zeros(len(REALS), c_int)
    if failed(slave.exchange("Integer", variables.references(REALS), values).get()):
        return Places()
    low, high, size = values.tolist()
    base = (high & 0xFFFFFFFF) << 32 | low & 0xFFFFFFFF
    groups = [variables.references(names) for names in (variables.inputs, variables.outputs, variables.links)]
    in_rows = all(group == [*range(group[0], group[0] + len(group))] for group in groups if group)
    if not in_rows or size != 8 * sum(v.type == "Real" for v in variables.by_name.values()):
        return Places()
    return Places(*(base + 8 * group[0] if group else 0 for group in groups))


class FastCalls:
    """Table of a slave for kernels (a ``StepCall``), and what it refers to.

    :param reals: exchanges of Real inputs, Real outputs and link outputs, of FMI 2.0 in this process where values are
        exchanged as they are.
    :param mixed: exchange of all others; None: there is none.
    :param start: time of the FMU at the start of the run, s; ``t``: that of the run, s.
    """

    def __init__(
        self, slave: Slave, variables: Variables, reals: Any, mixed: MixedExchange | None, start: float, t: float
    ) -> None:
        self._slave, self._callbacks, self._has_callbacks = slave, Callbacks(), set[str]()
        if mixed is not None:
            setter = self._callback("set_real", EXCHANGE, lambda *_: mixed.write()), 0
            getter = self._callback("get_real", EXCHANGE, lambda _, which, *more: _read(mixed, which)), _OUTPUTS
            self._links = _LINKS
        else:
            assert isinstance(slave, fmi2.Slave)
            u, y, links = reals
            setter = slave.address("SetReal"), addressof(u.references)
            getter = slave.address("GetReal"), addressof(y.references)
            self._links = addressof(links.references)
        if isinstance(slave, RemoteSlave):
            begin = self._callbacks.address(STEP, lambda _, *step: slave.begin_step(*step))
            step, instance = self._callback("do_step", STEP, lambda *_: slave.finish_step()), 1
        else:
            assert isinstance(slave, fmi2.Slave)
            step, instance, begin = slave.address("DoStep"), int(slave.handle), 0
        inputs = *setter, len(variables.u), variables.u.ctypes.data
        outputs = *getter, len(variables.raw), variables.raw.ctypes.data
        call = StepCall(instance, *inputs, step, *outputs, start, t, 0.0, 1, begin)
        self.table: Record = record(call)
        self._y_links = variables.y_links

    def _callback(self, field: str, kind: Any, function: Any) -> int:
        self._has_callbacks.add(field)
        return self._callbacks.address(kind, function)

    def copy_at(self, known: Places) -> None:
        """Copy values where the FMU has them."""
        for name, place in known._asdict().items():
            self.table[name] = place

    def read_links_when(self, due: int) -> None:
        """Read link outputs whenever the word at the address ``due`` is not 0."""
        words = len(self._y_links), self._links, self._y_links.ctypes.data, due
        for name, word in zip(("n_links", "links", "y_links", "links_due"), words, strict=True):
            self.table[name] = word

    @property
    def clock(self) -> NDArray[np.float64]:
        """Beginning of the present step, s from the start of the run (1,)."""
        return self.table["t"]

    def failure(self) -> tuple[str, int] | None:
        """Function that failed in the last step, and its status; None if none did. Raises what a callback raised."""
        call = StepCall(*self.table[0].item())
        if not call.failed:
            return None
        if (error := self._callbacks.raised) is not None:
            self._callbacks.raised = None
            raise error
        field = StepCall._fields[call.failed]
        method = {"set_real": "fmi2SetReal", "get_real": "fmi2GetReal", "do_step": "fmi2DoStep"}[field]
        return self._slave.failed if field in self._has_callbacks else method, call.status


def _read(mixed: MixedExchange, which: int) -> int:
    return mixed.read_links() if which == _LINKS else mixed.read()
