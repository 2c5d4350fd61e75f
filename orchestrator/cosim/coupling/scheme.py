"""Base of all couplings: past outputs, step program, saved communication points."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from functools import cached_property
from time import perf_counter
from typing import Any, NamedTuple

import numpy as np

from orchestrator.cosim.component import Component
from orchestrator.cosim.coupling import input_hold
from orchestrator.cosim.coupling.input_hold import Outputs, Past
from orchestrator.cosim.graph import Feed, Floats, Member, Stages
from orchestrator.cosim.program import InputCopy, Program, Stage
from orchestrator.cosim.row_writer import RowWriter
from orchestrator.fmi.slave import ComponentFailed
from orchestrator.kernels.compiled import CAN_STEP
from orchestrator.log.time_series import Rule, wired_inputs

LONGEST_BATCH = 3e-2  # s of wall time, longest batch: observers wait no longer


class CouplingFailed(RuntimeError):
    """The coupling cannot take a step; the message is one sentence."""


class SavedPoint(NamedTuple):
    """Saved communication point: states in the order of the members, and the past."""

    states: tuple[Any, ...]
    past: Past


class Scheme:
    """Coupling of components; a context manager that owns the threads of parallel steps.

    :param stages: members by stage; lower stages step first if the coupling is sequential.
    :param threads: components of a group step in parallel threads; False: one after another with the same result.
    """

    ORDER: int  # of the motion in the communication step

    def __init__(self, stages: Stages, threads: bool = True) -> None:
        self.stages = stages
        self.members = tuple(member for stage in stages for member in stage)
        self.past = Past({}, 0.0, 0.0)
        self._stepped_before: dict[str, frozenset[str]] = {}
        for stage in stages:
            earlier = frozenset(self._stepped_before)
            self._stepped_before |= {member.component.name: earlier for member in stage}
        self._threads = threads
        self._program: Program | None = None
        self.row_writer: RowWriter | None = None  # memory for the rows of a batch of steps
        self.failure: ComponentFailed | None = None  # of the step after the last batch, raised by the next one
        self._seconds = math.inf  # wall time of a step

    def __enter__(self) -> Scheme:
        loaded = {
            member.component.name: member.component
            for member in self.members
            if isinstance(member.component, Component)
        }
        if CAN_STEP and len(loaded) == len(self.members):
            stages = [
                Stage(
                    [loaded[member.component.name] for member in group],
                    [
                        InputCopy(u, feed.inputs, feed.source.y, feed.outputs, rule)
                        for u, feed, rule in transfers
                        if rule
                    ],
                )
                for group, transfers in self._transfers
            ]
            self._program = Program(stages, self._threads)
        return self

    def __exit__(self, *ended: object) -> None:
        if self._program is not None:
            self._program.close()
        self._program = None

    def groups(self) -> Stages:
        """Groups of members that step at once, in stepping order."""
        return self.stages

    @cached_property
    def _transfers(self) -> list[tuple[Sequence[Member], list[tuple[Floats, Feed, Rule | None]]]]:
        """Members of each group with all their inputs and rules."""
        return [
            (
                group,
                [
                    (member.received, feed, self.rule(feed, feed.source.name in self.stepped_before(member)))
                    for member in group
                    for feed in member.feeds
                ],
            )
            for group in self.groups()
        ]

    @cached_property
    def _computed_feeds(self) -> list[tuple[Floats, Feed]]:
        return [(u, feed) for _, transfers in self._transfers for u, feed, rule in transfers if rule is None]

    def step_batch(self, k: int, n: int, h: float) -> int:
        """Do the steps k + 1 to k + n of ``h`` s, or the first of them; return their number.

        Steps are done in one batch if kernels alone run between them, the ``row_writer`` has room, and they take a
        short time; their rows are then in the pages of the log. Errors are those of ``advance``; an error in a batch
        is raised by the next call, after the completed steps have been returned.
        """
        if self.failure is not None:
            raise self.failure
        start = perf_counter()
        done, n = 1, min(n, self.row_writer.free_rows if self.row_writer else 1, int(LONGEST_BATCH / self._seconds))
        if n > 1 and self._program is not None and self.row_writer is not None and self._all_compiled:
            now = self.outputs()
            done = self._program.step_batch(self.row_writer, k, n, h)
            if done < n:
                self.failure = self._program.failure()
            if not done:
                raise self.failure or AssertionError
            older = h if done > 1 else self.past.last
            self.past = Past(self.row_writer.outputs(done - 2) if done > 1 else now, h, older)
        else:
            self.advance(k * h, h)
        self._seconds = (perf_counter() - start) / done
        return done

    @cached_property
    def _all_compiled(self) -> bool:
        """True if the compiled program does a whole step without this class."""
        kind = type(self)
        return kind.advance is Scheme.advance and kind.exchange is Scheme.exchange and not self._computed_feeds

    def outputs(self) -> dict[str, Floats]:
        """Copies of the present outputs of all components, by name."""
        return {member.component.name: member.component.y.copy() for member in self.members}

    def advance(self, t: float, h: float) -> None:
        """Bring every component from t to t + h; raises the errors of components and CouplingFailed."""
        now = self.outputs()
        self.exchange(t, h, now)
        self.past = Past(now, h, self.past.last)

    def exchange(self, t: float, h: float, now: Outputs) -> None:
        """Do the step; ``now``: outputs at t. Inputs that need outputs at t + h are set once these exist."""
        for u, feed in self._computed_feeds:
            u[feed.inputs] = self.computed_inputs(feed, now, h)
        if self._program is not None:
            self._program.run(t, h)
            return
        for _, transfers in self._transfers:
            for u, feed, rule in transfers:
                if rule in ("start", "middle"):
                    u[feed.inputs] = feed.source.y[feed.outputs]
        for group, transfers in self._transfers:
            for u, feed, rule in transfers:
                if rule in ("end", "middle"):
                    u[feed.inputs] = wired_inputs(rule, u[feed.inputs], feed.source.y[feed.outputs])
            for member in group:
                member.component.write()
                member.component.step(t, h)
                member.component.read()

    def stepped_before(self, member: Member) -> frozenset[str]:
        """Names of the components that have stepped when a member gets its inputs: those of earlier stages."""
        return self._stepped_before[member.component.name]

    def rule(self, feed: Feed, source_stepped: bool) -> Rule | None:
        """Rule by which inputs follow from outputs at t and, with ``source_stepped``, at t + h.

        None: the coupling computes the inputs itself (``computed_inputs``).
        """
        raise NotImplementedError

    def computed_inputs(self, feed: Feed, now: Outputs, h: float) -> Floats:
        """Inputs of a feed without a rule: extrapolated to the middle of the step."""
        return input_hold.extrapolated(feed, now, self.past, h)

    def memory(self) -> dict[str, Floats]:
        """Memory of the coupling at a communication point, by name."""
        outputs = {f"y:{name}": y for name, y in self.past.outputs.items()}
        return outputs | {"steps": np.array([self.past.last, self.past.older])}

    def restore_memory(self, memory: Mapping[str, Floats]) -> None:
        """Restore the memory; raises LookupError, ValueError if it is not one of this coupling."""
        outputs = {name.removeprefix("y:"): memory[name] for name in memory if name.startswith("y:")}
        if outputs and set(outputs) != {member.component.name for member in self.members}:
            raise ValueError("it holds the past of other components")
        last, older = memory["steps"].tolist()
        self.past = Past(outputs, last, older)

    def save(self) -> SavedPoint:
        """Save the communication point, to be restored or freed."""
        return SavedPoint(tuple(member.component.save() for member in self.members), self.past)

    def restore(self, saved: SavedPoint) -> None:
        """Restore a saved point, which stays valid."""
        for member, state in zip(self.members, saved.states, strict=True):
            member.component.restore(state)
        self.past = saved.past

    def free(self, saved: SavedPoint) -> None:
        """Release a saved point."""
        for member, state in zip(self.members, saved.states, strict=True):
            member.component.free(state)


class ExtrapolatingScheme(Scheme):
    """Coupling whose inputs are extrapolated to the middle of the step (``hold`` "linear") or held ("constant")."""

    def __init__(self, stages: Stages, hold: str = "linear", threads: bool = True) -> None:
        super().__init__(stages, threads)
        self.linear = hold == "linear"
        self.ORDER = 2 if self.linear else 1

    def rule(self, feed: Feed, source_stepped: bool) -> Rule | None:
        """Return the rule for the value at t, or None for extrapolation."""
        return None if self.linear and not feed.held else "start"


def require_states(scheme: Scheme, what: str) -> None:
    """Raise CouplingFailed unless every component can save its state."""
    for member in scheme.members:
        try:
            state = member.component.save()
        except ComponentFailed as failure:
            raise CouplingFailed(f"{failure}, which {what} needs") from None
        member.component.free(state)


def copy_inputs(member: Member) -> None:
    """Copy the present outputs of the sources into a member's inputs."""
    for feed in member.feeds:
        member.received[feed.inputs] = feed.source.y[feed.outputs]
