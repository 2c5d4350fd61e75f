"""What all couplings share: the past of the outputs, threads, states to go back to."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from functools import cached_property
from time import perf_counter
from typing import Any, ClassVar, NamedTuple

import numpy as np

from orchestrator.cosim.component import Component, ComponentFailed
from orchestrator.cosim.coupling import input_hold
from orchestrator.cosim.coupling.input_hold import Outputs, Past
from orchestrator.cosim.graph import Feed, Floats, Member, Stages
from orchestrator.cosim.program import Move, Program, Stage
from orchestrator.cosim.tape import Tape
from orchestrator.kernels.compiled import CAN_STEP
from orchestrator.log.wire import Rule, handed_over

TOGETHER = 3e-2  # s of wall time: who looks on a run waits no longer


class CouplingFailed(RuntimeError):
    """The coupling cannot take a step; the message is one sentence."""


class Saved(NamedTuple):
    """Everything at a communication point: states in the order of the members, and the past."""

    states: tuple[Any, ...]
    past: Past
    more: Any = None  # what else a coupling remembers


class Scheme:
    """A coupling of given components; a context manager that owns the threads in which they step side by side.

    :param stages: members by stage; those of a lower one step first where the coupling has an order of stepping.
    :param threads: components that step at once do so in threads; without, one after the other with the same result.
    """

    NAME: ClassVar[str]
    ORDER: int  # of the motion in the communication step

    def __init__(self, stages: Stages, threads: bool = True) -> None:
        self.stages = stages
        self.members = tuple(member for stage in stages for member in stage)
        self.past = Past({}, 0.0, 0.0)
        self._stepped: dict[str, frozenset[str]] = {}
        for stage in stages:
            before = frozenset(self._stepped)
            self._stepped |= {member.component.name: before for member in stage}
        self._threads = threads
        self._program: Program | None = None
        self.tape: Tape | None = None  # for the rows of many steps at once
        self._failure: ComponentFailed | None = None  # of the step after the last one
        self._seconds = math.inf  # a step has taken

    def __enter__(self) -> Scheme:
        loaded = {each.component.name: each.component for each in self.members if isinstance(each.component, Component)}
        if CAN_STEP and len(loaded) == len(self.members):
            stages = [
                Stage(
                    [loaded[member.component.name] for member in group],
                    [Move(u, feed.inputs, feed.source.y, feed.outputs, rule) for u, feed, rule in hands if rule],
                )
                for group, hands in self._hands
            ]
            self._program = Program(stages, self._threads)
        return self

    def __exit__(self, *ended: object) -> None:
        if self._program is not None:
            self._program.close()
        self._program = None

    def groups(self) -> Stages:
        """Members that step at once, group after group."""
        return self.stages

    @cached_property
    def _hands(self) -> list[tuple[Sequence[Member], list[tuple[Floats, Feed, Rule | None]]]]:
        """Group after group its members, and all their inputs."""
        return [
            (
                group,
                [
                    (member.component.u, feed, self.rule(feed, feed.source.name in self.stepped(member)))
                    for member in group
                    for feed in member.feeds
                ],
            )
            for group in self.groups()
        ]

    @cached_property
    def _without_rule(self) -> list[tuple[Floats, Feed]]:
        return [(u, feed) for _, hands in self._hands for u, feed, rule in hands if rule is None]

    def march(self, k: int, n: int, h: float) -> int:
        """The steps k + 1 to k + n of ``h`` s, or the first of them; returns how many.

        They are many where kernels alone are between them, the ``tape`` has room and the time that they take is
        short; the tape then holds their rows. Raises what ``advance`` raises, after the steps that were done were
        returned.
        """
        if self._failure is not None:
            raise self._failure
        began = perf_counter()
        done, n = 1, min(n, self.tape.room if self.tape else 1, int(TOGETHER / self._seconds))
        if n > 1 and self._program is not None and self.tape is not None and self._alone:
            now = self._outputs()
            done = self._program.march(self.tape, k, n, h)
            if done < n:
                self._failure = self._program.failure()
            if not done:
                raise self._failure or AssertionError
            older = h if done > 1 else self.past.last
            self.past = Past(self.tape.shown(done - 2) if done > 1 else now, h, older)
        else:
            self.advance(k * h, h)
        self._seconds = (perf_counter() - began) / done
        return done

    @cached_property
    def _alone(self) -> bool:
        """Whether the program makes a step without the coupling."""
        own = type(self)
        return own.advance is Scheme.advance and own.exchange is Scheme.exchange and not self._without_rule

    def _outputs(self) -> dict[str, Floats]:
        return {member.component.name: member.component.y.copy() for member in self.members}

    def advance(self, t: float, h: float) -> None:
        """Bring every component from t to t + h; raises what a component raises, and CouplingFailed."""
        now = self._outputs()
        self.exchange(t, h, now)
        self.past = Past(now, h, self.past.last)

    def exchange(self, t: float, h: float, now: Outputs) -> None:
        """The step itself; ``now`` holds the outputs at t. Inputs that need later ones are filled as these come."""
        for u, feed in self._without_rule:
            u[feed.inputs] = self.made(feed, now, h)
        if self._program is not None:
            self._program.run(t, h)
            return
        for _, hands in self._hands:
            for u, feed, rule in hands:
                if rule in ("start", "middle"):
                    u[feed.inputs] = feed.source.y[feed.outputs]
        for group, hands in self._hands:
            for u, feed, rule in hands:
                if rule in ("end", "middle"):
                    u[feed.inputs] = handed_over(rule, u[feed.inputs], feed.source.y[feed.outputs])
            for member in group:
                member.component.write()
                member.component.step(t, h)
                member.component.read()

    def stepped(self, member: Member) -> frozenset[str]:
        """Names of the components that have done the step when a member is given its inputs: the stages before."""
        return self._stepped[member.component.name]

    def rule(self, feed: Feed, stepped: bool) -> Rule | None:
        """How the inputs of a feed follow from outputs at t and, where its source has ``stepped``, at t + h.

        None: the coupling makes them otherwise (``made``).
        """
        raise NotImplementedError

    def made(self, feed: Feed, now: Outputs, h: float) -> Floats:
        """What a feed without a rule hands over: for the middle of the step, from the past."""
        return input_hold.extrapolated(feed, now, self.past, h)

    def memory(self) -> dict[str, Floats]:
        """What the coupling remembers at a communication point, by name: the past, and what else one needs."""
        outputs = {f"y:{name}": y for name, y in self.past.outputs.items()}
        return outputs | {"steps": np.array([self.past.last, self.past.older])}

    def remember(self, memory: Mapping[str, Floats]) -> None:
        """Go on with that; raises LookupError, ValueError for what is none of this coupling's."""
        outputs = {name.removeprefix("y:"): memory[name] for name in memory if name.startswith("y:")}
        if outputs and set(outputs) != {member.component.name for member in self.members}:
            raise ValueError("it holds the past of other components")
        last, older = memory["steps"].tolist()
        self.past = Past(outputs, last, older)

    def save(self) -> Saved:
        """The communication point, to be restored or freed."""
        return Saved(tuple(member.component.save() for member in self.members), self.past)

    def restore(self, saved: Saved) -> None:
        """Back to a saved point, which stays good."""
        for member, state in zip(self.members, saved.states, strict=True):
            member.component.restore(state)
        self.past = saved.past

    def free(self, saved: Saved) -> None:
        """Forget a saved point."""
        for member, state in zip(self.members, saved.states, strict=True):
            member.component.free(state)


def needs_states(scheme: Scheme, what: str) -> None:
    """Raises CouplingFailed unless every component can go back in time."""
    for member in scheme.members:
        try:
            state = member.component.save()
        except ComponentFailed as failure:
            raise CouplingFailed(f"{failure}, which {what} needs") from None
        member.component.free(state)


def gather(member: Member) -> None:
    """Copy what the peers show now into the inputs."""
    for feed in member.feeds:
        member.component.u[feed.inputs] = feed.source.y[feed.outputs]
