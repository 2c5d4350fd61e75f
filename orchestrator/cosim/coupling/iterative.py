"""Iterative coupling with rollback: a step is repeated until each input is its source's mean.

The mean is that over the step. The sweeps follow the stages; only inputs from later stages are unknowns. The
fixed-point iteration is accelerated by D. G. Anderson, J. ACM 12, 1965, doi 10.1145/321296.321305 (type II, scaled by
the largest value that each connection has carried); it also converges where plain iteration does not.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from orchestrator.cosim.coupling import input_hold
from orchestrator.cosim.coupling.input_hold import Outputs
from orchestrator.cosim.coupling.scheme import CouplingFailed, Scheme, require_states
from orchestrator.cosim.graph import Feed, Floats, Stages
from orchestrator.log.time_series import Rule

HISTORY = 6  # earlier differences that the acceleration uses


class Coupling(Scheme):
    """Coupling that repeats a step until its unknown inputs converge.

    Converged: no unknown changes by more than ``tolerance`` of the largest value of its connection.

    :raises CouplingFailed: here if a component cannot save its state, in ``advance`` after ``iterations`` sweeps.
    """

    ORDER = 2

    def __init__(self, stages: Stages, tolerance: float = 1e-6, iterations: int = 20, threads: bool = True) -> None:
        super().__init__(stages, threads)
        require_states(self, "coupling 'iterative'")
        self.tolerance, self.iterations = tolerance, iterations
        self.sweeps = 0  # total number
        feeds = [
            (member.component.name, feed)
            for member in self.members
            for feed in member.feeds
            if not feed.held and feed.source.name not in self.stepped_before(member)
        ]
        ends = np.cumsum([0, *(len(feed.inputs) for _, feed in feeds)])
        self._feeds = feeds
        self._slices = {id(feed): slice(a, b) for (_, feed), a, b in zip(feeds, ends[:-1], ends[1:], strict=True)}
        self._largest = np.zeros(len(feeds))
        self._guess = np.zeros(int(ends[-1]))

    def exchange(self, t: float, h: float, now: Outputs) -> None:
        """Sweep until the unknown inputs converge; raises CouplingFailed."""
        z = self._collect(lambda feed: input_hold.extrapolated(feed, now, self.past, h))
        if not len(z):  # no input comes from a later stage
            super().exchange(t, h, now)
            return
        start = self.save()
        try:
            history: list[tuple[Floats, Floats]] = []
            for sweep in range(self.iterations):
                if sweep:
                    self.restore(start)
                self._guess = z
                super().exchange(t, h, now)
                self.sweeps += 1
                residual = self._collect(lambda feed: input_hold.mean(feed, now)) - z
                scale = self._scale(z + residual)
                history.append((z, residual))
                if np.abs(residual / scale).max() <= self.tolerance:
                    return
                z = scale * anderson([(guess / scale, error / scale) for guess, error in history[-HISTORY - 1 :]])
        finally:
            self.free(start)
        raise CouplingFailed(self._complaint(t, h, residual / scale))

    def rule(self, feed: Feed, source_stepped: bool) -> Rule | None:
        """Mean over the step if the source has stepped; None for an unknown; else the value at t."""
        if source_stepped:
            return input_hold.interpolated(feed)
        return None if id(feed) in self._slices else "start"

    def computed_inputs(self, feed: Feed, now: Outputs, h: float) -> Floats:
        """Return the present guess of the unknown inputs of a feed."""
        return self._guess[self._slices[id(feed)]]

    def memory(self) -> dict[str, Floats]:
        """Memory of the coupling, with the largest value of each connection."""
        return super().memory() | {"largest": self._largest}

    def restore_memory(self, memory: Mapping[str, Floats]) -> None:
        """Restore the memory, with the largest value of each connection."""
        super().restore_memory(memory)
        self._largest[:] = memory["largest"]

    def _collect(self, values_of: Callable[[Feed], Floats]) -> Floats:
        parts = [values_of(feed) for _, feed in self._feeds]
        return np.concatenate(parts) if parts else np.zeros(0)

    def _scale(self, z: Floats) -> Floats:
        """Scale of every unknown: the largest value of its connection so far, 1 if that is 0."""
        for k, (_, feed) in enumerate(self._feeds):
            self._largest[k] = max(self._largest[k], float(np.abs(z[self._slices[id(feed)]]).max()))
        sizes = [len(feed.inputs) for _, feed in self._feeds]
        return np.repeat(np.where(self._largest > 0.0, self._largest, 1.0), sizes)

    def _complaint(self, t: float, h: float, residual: Floats) -> str:
        worst = int(np.abs(residual).argmax())
        taker, feed = next(
            (taker, feed)
            for taker, feed in self._feeds
            if self._slices[id(feed)].start <= worst < self._slices[id(feed)].stop
        )
        member = next(member for member in self.members if member.component.name == taker)
        name = member.component.inputs[feed.inputs[worst - self._slices[id(feed)].start]]
        return (
            f"coupling 'iterative': {taker}.{name} still changes by {abs(residual[worst]):.2g} of its size after "
            f"{self.iterations} iterations at t = {t:.6g} s, step {h:.3g} s (allowed {self.tolerance:g})"
        )


def anderson(history: list[tuple[Floats, Floats]]) -> Floats:
    """Anderson's next guess from (guess, residual) pairs, newest last: least residual plus the residual."""
    z, r = history[-1]
    if len(history) == 1:
        return z + r
    dz = np.diff([guess for guess, _ in history], axis=0).T
    dr = np.diff([residual for _, residual in history], axis=0).T
    share = np.linalg.lstsq(dr, r, rcond=1e-10)[0]
    return np.asarray(z + r - (dz + dr) @ share)
