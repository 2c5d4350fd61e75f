"""Force side first: stage after stage over the same interval, each with what was just produced for it.

Inputs are gathered right before a stage steps. A component whose peer steps later sees the peer's state at t
(and extrapolates it by the exchanged rates); one whose peer has stepped sees the mean wrench over [t, t + h].
No rollback, and what leaves one component in a step enters the other in the same step.
"""

from __future__ import annotations

from concurrent.futures import Executor

from orchestrator.graph import Member, Stages

ORDER = 2  # of the motion, without damping across the ports


def advance(stages: Stages, t: float, h: float, pool: Executor | None) -> None:
    """Bring every component from t to t + h; raises what a component raises, the first of a stage first."""
    for stage in stages:
        for member in stage:
            gather(member)
        *others, last = stage
        if pool is None:
            for member in stage:
                step(member, t, h)
        else:
            waiting = [pool.submit(step, member, t, h) for member in others]
            try:
                step(last, t, h)
            finally:
                failures = [future.exception() for future in waiting]
            for failure in failures:
                if failure is not None:
                    raise failure


def gather(member: Member) -> None:
    """Copy what the peers show now into the inputs."""
    u = member.component.u
    for feed in member.feeds:
        u[feed.inputs] = feed.source.y[feed.outputs]


def step(member: Member, t: float, h: float) -> None:
    """One component over [t, t + h]."""
    component = member.component
    component.write()
    component.step(t, h)
    component.read()
