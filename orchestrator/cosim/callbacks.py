"""C functions by which kernels call a slave that has none of FMI 2.0 in this process, or whose values are converted."""

from __future__ import annotations

from collections.abc import Callable
from ctypes import CFUNCTYPE, c_double, c_int, c_size_t, c_void_p, cast
from typing import Any

from orchestrator.fmi.slave import FATAL

EXCHANGE = CFUNCTYPE(c_int, c_void_p, c_void_p, c_size_t, c_void_p)  # as fmi2SetReal and fmi2GetReal
STEP = CFUNCTYPE(c_int, c_void_p, c_double, c_double, c_int)  # as fmi2DoStep


class Callbacks:
    """C functions that live as long as this object; ``raised``: the error in the last call, which cannot leave it."""

    def __init__(self) -> None:
        self.raised: BaseException | None = None
        self._alive: list[Any] = []

    def address(self, kind: Any, function: Callable[..., int]) -> int:
        """Address of a C function of this kind; an error in it has the status Fatal."""

        def call(*arguments: Any) -> int:
            try:
                return function(*arguments)
            except BaseException as error:
                self.raised = error
                return FATAL

        self._alive.append(kind(call))
        return cast(self._alive[-1], c_void_p).value or 0
