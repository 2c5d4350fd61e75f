"""Slave in another process: the methods of ``fmi.slave.Slave`` by name over a connection."""
# ruff: noqa: D102 (methods of ``fmi.slave.Slave`` and ``fmi.slave.Exchange``)

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from orchestrator.cosim.processes.supervisor import SlaveProcess
from orchestrator.fmi import fmi2, fmi3
from orchestrator.fmi.slave import FATAL, OK, ComponentFailed, Kind, LogCallback, NotInstantiated, Opening, failed

ENDINGS = ("terminate", "free")  # calls after the last step


class RemoteSlave:
    """See ``fmi.slave.Slave``. Exchanges of arrays of ``memory`` cost no packet of their own in a step."""

    def __init__(self, process: SlaveProcess, log: LogCallback) -> None:
        self._process, self._log, self._number = process, log, process.enter()
        self._places: dict[int, int] = {}  # of arrays in the shared memory, by their addresses
        self._time: float | None = None  # s, of the present step
        self._exchanges = 0
        self._written: list[int] = []  # exchanges that are set with the next call
        self.is_fresh = False  # what goes with steps is in the memory
        self.failed = ""
        process.log = log

    def memory(self, n: int) -> NDArray[np.float64]:
        """Return n doubles, 0, that are shared with the process."""
        array, place = self._process.memory(n)
        self._places[array.ctypes.data] = place
        return array

    def open(self, opening: Opening) -> None:
        """Make the instance; raises NotInstantiated, and ComponentFailed for a binary that cannot be loaded."""
        self._opening = opening
        self.functions = (fmi2 if opening.version == "2.0" else fmi3).FUNCTIONS
        status, made = self._call("open", (opening._asdict(),))
        if status >= FATAL and made:
            raise ComponentFailed(f"cannot load the binary of '{opening.name}': {made}")
        if failed(status) or not made:
            raise NotInstantiated

    def post(self, method: str, arguments: Sequence[Any], function: str = "") -> None:
        """Begin a call; ``function``: of FMI, if it is not that of the method."""
        written, self._written, self.is_fresh = self._written, [], False
        time = None if method in ENDINGS else self._time
        self._process.post(self._number, (function or self.functions[method], time), written, method, *arguments)

    def take(self, fits: Callable[[Any], bool] = lambda result: result is None) -> tuple[int, Any]:
        """Return status and result of the call that was begun; ``fits``: whether a result is one."""
        status, function, result, messages = self._process.take(self._number, fits)
        self.failed = self.functions.get(function, function)  # a method, where Python has failed
        for message in messages:
            self._log(*message)
        return status, result

    def _call(self, method: str, arguments: Sequence[Any] = (), fits: Any = lambda result: True) -> tuple[int, Any]:
        self.post(method, arguments)
        return self.take(fits)

    def setup(self, start: float, stop: float | None) -> int:
        self._time = start
        return self._call("setup", (start, stop))[0]

    def enter_initialisation(self) -> int:
        return self._call("enter_initialisation")[0]

    def exit_initialisation(self) -> int:
        return self._call("exit_initialisation")[0]

    def exchange(self, kind: Kind, references: Sequence[int], values: Any, with_steps: bool = False) -> Exchange:
        place = None if isinstance(values, list) else self._places.get(values.ctypes.data)
        types = [self._opening.elements[reference][1] for reference in references if self._opening.elements]
        name = "Int64" if types[:1] == ["Enumeration"] else types[0] if types else kind
        made = Exchange(self, self._exchanges, f"{self.functions['step'][:4]}{{}}{name}", values, place is not None)
        if references:
            self._exchanges += 1
            self.post("exchange", (kind, [*references], place, with_steps), made.function("Get"))
            self.take()
        return made

    def step(self, t: float, h: float, no_rollback: bool) -> int:
        self.begin_step(t, h, no_rollback)
        return self.finish_step()

    def begin_step(self, t: float, h: float, no_rollback: bool) -> int:
        """Begin a step; other slaves may step meanwhile."""
        self._time = t
        self.post("step", (t, h, bool(no_rollback)))
        return OK

    def finish_step(self) -> int:
        """Return the status of the step that was begun."""
        status, _ = self.take()
        self.is_fresh = not failed(status)
        return status

    def set_later(self, number: int) -> None:
        """Set an exchange in the shared memory with the next call."""
        self._written.append(number)

    def discarded(self) -> tuple[bool, float]:
        _, found = self._call("discarded", (), lambda result: [*map(type, result)] == [bool, float])
        return (found[0], found[1]) if found else (False, float("nan"))

    def save(self) -> tuple[int, Any]:
        return self._call("save", (), lambda result: isinstance(result, int))

    def restore(self, state: Any) -> int:
        return self._call("restore", (state,))[0]

    def discard(self, state: Any) -> int:
        return self._call("discard", (state,))[0]

    def dump(self, state: Any) -> tuple[int, bytes]:
        return self._call("dump", (state,), lambda result: isinstance(result, bytes))

    def load(self, content: bytes) -> tuple[int, Any]:
        return self._call("load", (content,), lambda result: isinstance(result, int))

    def reset(self) -> int:
        return self._call("reset")[0]

    def terminate(self) -> int:
        return self._call("terminate")[0]

    def free(self) -> int:
        """Free the instance; the process ends with its last one."""
        status, _ = self._call("free")
        self._process.leave()
        return status


class Exchange:
    """See ``fmi.slave.Exchange``. ``name``: of its function of FMI, with a gap for the way."""

    def __init__(self, slave: RemoteSlave, number: int, name: str, values: Any, is_shared: bool) -> None:
        self._slave, self._number, self._name, self._values = slave, number, name, values
        self._is_shared, self._size = is_shared, len(values)

    def function(self, way: str) -> str:
        """Name of the function that sets or gets."""
        return self._name.format(way)

    def set(self) -> int:
        if not self._size:
            return OK
        if self._is_shared:
            self._slave.set_later(self._number)
            return OK
        content = self._values if isinstance(self._values, list) else self._values.tobytes()
        self._slave.post("set", (self._number, content), self.function("Set"))
        return self._slave.take()[0]

    def get(self) -> int:
        if not self._size or (self._is_shared and self._slave.is_fresh):
            return OK
        was_fresh, values = self._slave.is_fresh, self._values
        self._slave.post("get", (self._number, self._is_shared), self.function("Get"))
        status, found = self._slave.take(self._fits)
        if not failed(status) and not self._is_shared:
            values[:] = found if isinstance(values, list) else np.frombuffer(found[0], values.dtype)
        self._slave.is_fresh = was_fresh
        return status

    def _fits(self, result: Any) -> bool:
        if self._is_shared:
            return result is None
        if not isinstance(result, list):
            return False
        if isinstance(self._values, list):
            return [*map(type, result)] == [bytes] * self._size
        return [*map(type, result)] == [bytes] and len(result[0]) == self._values.nbytes
