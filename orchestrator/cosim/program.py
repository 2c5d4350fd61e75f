"""The step of given components as a program of ``machine``: what is handed over when, who steps at once."""

from __future__ import annotations

import os
import threading
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from orchestrator.cosim.component import Component, ComponentFailed
from orchestrator.cosim.graph import Floats, Indices
from orchestrator.cosim.machine import ENDED, LOOKS, Desk, Group, Plan, laid_out, machine
from orchestrator.cosim.tape import Tape
from orchestrator.log.wire import Rule

LONG = 5e-5  # s: in a shorter step an FMU of ours is mostly Python, which runs in one thread at a time


class Move(NamedTuple):
    """Values that one rule hands over."""

    u: Floats
    inputs: Indices
    y: Floats
    outputs: Indices
    rule: Rule


class Stage(NamedTuple):
    """Components that step at once, and what they are given."""

    components: Sequence[Component]
    moves: Sequence[Move]


class Program:
    """Steps components, some of them in threads beside. Inputs that no rule gives are filled before.

    :param threads: whether components that step at once do so in threads; the result is the same.
    """

    def __init__(self, stages: Sequence[Stage], threads: bool = True) -> None:
        self._components = [component for stage in stages for component in stage.components]
        self._machine = machine()
        self._kept: list[NDArray[np.int64]] = []  # what the plan has the addresses of
        beside = max(len(stage.components) for stage in stages) - 1 if threads and spare_processors() else 0
        self._helpers = [Helper() for _ in range(beside)]
        before = self._moves([move for stage in stages for move in stage.moves if move.rule != "end"])
        groups = self._words([self._group(stage) for stage in stages])
        desks = self._words([helper.desk.ctypes.data for helper in self._helpers])
        self._plan = self._keep(laid_out(Plan(*before, len(stages), groups, beside, desks, LONG)))

    def close(self) -> None:
        """End the threads."""
        for helper in self._helpers:
            helper.close()
        self._helpers = []

    def run(self, t: float, h: float) -> None:
        """From t to t + h; raises ComponentFailed: of the components that failed at once, the first one."""
        for component in self._components:
            component.begin(t)
        if self._machine.advance(self._plan, t, h):
            raise self.failure()

    def march(self, tape: Tape, k: int, n: int, h: float) -> int:
        """The steps k + 1 to k + n of ``h`` s; returns how many were done before a component failed, which are on
        the tape.
        """
        for component in self._components:
            component.begin(k * h)
        for component in tape.linked:
            component.show_links(tape.due)
        done = int(self._machine.march(self._plan, *tape.wound(h), tape.due, tape.every, k, n, h))
        tape.hold(k, done)
        return done

    def failure(self) -> ComponentFailed:
        """Of the components that failed in the last step at once, the first one's."""
        return next(failure for component in self._components if (failure := component.failure()) is not None)

    def _group(self, stage: Stage) -> Group:
        ends, means = ([move for move in stage.moves if move.rule == rule] for rule in ("end", "middle"))
        boards = [component.board.ctypes.data for component in stage.components]
        return Group(*self._moves(ends), *self._moves(means), len(boards), self._words(boards))

    def _moves(self, moves: Sequence[Move]) -> tuple[int, int, int]:
        """How many, and where the addresses of targets and sources are."""
        to = [move.u.ctypes.data + 8 * int(k) for move in moves for k in move.inputs]
        by = [move.y.ctypes.data + 8 * int(k) for move in moves for k in move.outputs]
        return len(to), self._words(to), self._words(by)

    def _words(self, values: Any) -> int:
        return self._keep(np.array(values, dtype=np.int64))

    def _keep(self, words: NDArray[np.int64]) -> int:
        """Their address."""
        self._kept.append(words)
        return int(words.ctypes.data)


def spare_processors() -> bool:
    """Whether there is more than one."""
    return len(os.sched_getaffinity(0)) > 1


class Helper:
    """A thread that steps what lies on its desk."""

    def __init__(self) -> None:
        self.desk = laid_out(Desk())
        at, code = self.desk.ctypes.data, machine()
        self._end = lambda: code.turn(at, ENDED)
        self._thread = threading.Thread(target=code.serve, args=(at, LOOKS), name="beside", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """End the thread, which has nothing to do."""
        self._end()
        self._thread.join()
