"""Input hold: every input is constant over [t, t + h], at its value for t + h/2 if that is known.

A constant input at the value of the middle has no error in the mean, which makes a coupling of order 2:

| carries | held, of time t | extrapolated to the middle | when the source has stepped |
| --- | --- | --- | --- |
| value | y | y + (y - y_past) h / (2 h_1), or y + y' h / 2 with rates | (y + y_after) / 2 |
| mean | y | y + (y - y_past) (h + h_1) / (h_1 + h_2) | y_after |
| state | y | y: the receiver extrapolates with the rate | y |
| rate | y | as a value | (y + y_after) / 2 |
| discrete | y | y | y |

h_1 and h_2 are the lengths of the last two steps: a mean belongs to the middle of its step. The first step has no
past and holds values at t. The means of the start are instantaneous, so h_2 = 0 in the second step.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

from orchestrator.cosim.graph import Feed, Floats
from orchestrator.log.time_series import Rule, wired_inputs

Outputs = Mapping[str, Floats]  # y of every component by its name


class Past(NamedTuple):
    """Past of the outputs before the communication point t."""

    outputs: Outputs  # y one step before; empty in the first step
    last: float  # h_1, s
    older: float  # h_2, s


def constant(feed: Feed, now: Outputs) -> Floats:
    """Return the outputs of the source at t."""
    return now[feed.source.name][feed.outputs]


def extrapolated(feed: Feed, now: Outputs, past: Past, h: float) -> Floats:
    """Extrapolate the outputs of the source to the middle of the step."""
    y = constant(feed, now)
    if feed.held:
        return y
    if feed.rates is not None:
        return y + 0.5 * h * now[feed.source.name][feed.rates]
    if not past.outputs:
        return y
    reach = (h + past.last) / (past.last + past.older) if feed.carries == "mean" else 0.5 * h / past.last
    return y + reach * (y - past.outputs[feed.source.name][feed.outputs])


def at_end(feed: Feed) -> Rule:
    """Rule for the output at t + h of a source that has stepped; what is held always belongs to t."""
    return "start" if feed.held else "end"


def interpolated(feed: Feed) -> Rule:
    """Rule for the middle of the step of a source that has stepped."""
    return at_end(feed) if feed.held or feed.carries == "mean" else "middle"


def mean(feed: Feed, now: Outputs) -> Floats:
    """Return the value for the middle of the step of a source that has stepped; ``now``: outputs at t."""
    return wired_inputs(interpolated(feed), constant(feed, now), feed.source.y[feed.outputs])
