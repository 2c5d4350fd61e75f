"""What all couplings share: the past of the outputs, threads, states to go back to."""

from __future__ import annotations

from collections.abc import Sequence
from time import perf_counter
from typing import Any, ClassVar, NamedTuple

from orchestrator.cosim.beside import Beside, possible
from orchestrator.cosim.component import Component, ComponentFailed
from orchestrator.cosim.coupling import input_hold
from orchestrator.cosim.coupling.input_hold import Outputs, Past
from orchestrator.cosim.graph import Feed, Floats, Member, Stages
from orchestrator.log.wire import Rule

LONG = 5e-5  # s: in a shorter step an FMU of ours is mostly Python, which runs in one thread at a time


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
        self._helpers: list[Beside] = []
        self._spent: dict[str, float] = {}  # s, by the last member of each group in its last step

    def __enter__(self) -> Scheme:
        width = max(len(group) for group in self.groups())
        if self._threads and width > 1 and possible():
            self._helpers = [Beside() for _ in range(width - 1)]
        return self

    def __exit__(self, *ended: object) -> None:
        for helper in self._helpers:
            helper.close()
        self._helpers = []

    def groups(self) -> Stages:
        """Members that step at once, group after group."""
        return self.stages

    def advance(self, t: float, h: float) -> None:
        """Bring every component from t to t + h; raises what a component raises, and CouplingFailed."""
        now = {member.component.name: member.component.y.copy() for member in self.members}
        self.exchange(t, h, now)
        self.past = Past(now, h, self.past.last)

    def exchange(self, t: float, h: float, now: Outputs) -> None:
        """The step itself; ``now`` holds the outputs at t."""
        raise NotImplementedError

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

    def given(self, feed: Feed, stepped: bool, now: Outputs, h: float) -> Floats:
        """What a feed hands over for [t, t + h]."""
        rule = self.rule(feed, stepped)
        return self.made(feed, now, h) if rule is None else input_hold.by_rule(rule, feed, now)

    def step(self, group: Sequence[Member], t: float, h: float) -> None:
        """Members of a group over [t, t + h] at once; the first failure of the group is raised when all have ended."""
        *others, last = group
        helpers = self._helpers if self._spent.get(last.component.name, LONG) >= LONG else []
        beside: list[tuple[Component, Beside]] = []
        failures: list[ComponentFailed] = []
        try:
            for k, member in enumerate(others):
                if k < len(helpers) and isinstance(member.component, Component):
                    member.component.exchange_beside(helpers[k], t, h)
                    beside.append((member.component, helpers[k]))
                else:
                    step(member, t, h)
            self._timed(last, t, h)
        finally:
            for component, helper in beside:
                try:
                    component.join(helper)
                except ComponentFailed as failure:
                    failures.append(failure)
        if failures:
            raise failures[0]

    def _timed(self, member: Member, t: float, h: float) -> None:
        began = perf_counter()
        step(member, t, h)
        self._spent[member.component.name] = perf_counter() - began

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


def step(member: Member, t: float, h: float) -> None:
    """One component over [t, t + h]."""
    component = member.component
    if isinstance(component, Component):
        component.exchange(t, h)
    else:
        component.write()
        component.step(t, h)
        component.read()
