"""Observers of a run: log, checkpoints, progress; statistics of link outputs between two records of the log.

Outputs of forces, sliding and depth of links are means since the last record. The mean over one step follows from the
difference of two readings.
"""

from __future__ import annotations

import math
import re
import time
from collections.abc import Sequence

import numpy as np

from orchestrator.cosim import checkpoint
from orchestrator.cosim.component import WALL_TIME, Component
from orchestrator.cosim.coupling.power_residual import PowerResidual
from orchestrator.cosim.coupling.scheme import Scheme
from orchestrator.cosim.coupling.variable_step import VariableStep
from orchestrator.cosim.graph import Floats, Recordable
from orchestrator.cosim.master import NO_LIMIT
from orchestrator.cosim.row_writer import RowWriter
from orchestrator.files.messages import PROGRESS
from orchestrator.log.log_metadata import CHECKPOINT
from orchestrator.log.recorder import Recorder
from orchestrator.log.time_series import Rule, Wire

REFRESH = 0.2  # s of wall time between messages of progress
STATS = (WALL_TIME,)  # last signals of /stats/<instance>, after the counters


def wires(scheme: Scheme) -> dict[str, list[Wire]]:
    """Wires by topic: inputs that the coupling takes from outputs before and after a step alone."""
    by_topic = {}
    for member in scheme.members:
        by_source: dict[tuple[str, Rule], Wire] = {}  # by source and rule, as few as possible
        for feed in member.feeds:
            rule = scheme.rule(feed, feed.source.name in scheme.stepped_before(member))
            if rule is not None:
                source = f"/{feed.source.name}/out"
                wire = by_source.get((source, rule), Wire(source, rule, (), ()))
                outputs = (feed.source.outputs[k] for k in feed.outputs)
                inputs = (member.component.inputs[k] for k in feed.inputs)
                pairs = [pair for pair in zip(outputs, inputs, strict=True) if pair[1] not in member.converted]
                if pairs:
                    more_outputs, more_inputs = zip(*pairs, strict=True)
                    by_source[source, rule] = wire._replace(
                        outputs=wire.outputs + more_outputs, inputs=wire.inputs + more_inputs
                    )
        by_topic[f"/{member.component.name}/in"] = list(by_source.values())
    return by_topic


class Logging:
    """Observer that records inputs at the beginning of a step, outputs and links at its end.

    ``statistics``: links are read at every step, and their statistics go to "/<instance>/links/between". Batches of
    steps are recorded from the ``row_writer``, single steps from the components.
    """

    def __init__(
        self, recorder: Recorder, components: Sequence[Recordable], stats_every: int, statistics: bool = False
    ) -> None:
        self.recorder = recorder
        self.components = components
        self.stats_every = stats_every
        self._step = recorder.join_topics(
            [f"/{component.name}/in" for component in components],
            [f"/{component.name}/out" for component in components],
        )
        self._values = [component.u for component in components] + [component.y for component in components]
        self._with_links = [component for component in components if component.links]
        self._pages = [self._step]
        if self._with_links:
            self._links = recorder.join_topics([], [f"/{component.name}/links" for component in self._with_links])
            self._pages.append(self._links)
        self._stats = recorder.join_topics([], [f"/stats/{component.name}" for component in components])
        self._statistics = [IntervalStatistics(component.links) for component in self._with_links if statistics]
        self._link_ends = np.cumsum([len(component.links) for component in self._with_links])
        self.row_writer = self._row_writer(1 if statistics else recorder.stride(self._links) if self._with_links else 1)

    def _row_writer(self, every: int) -> RowWriter | None:
        loaded = [component for component in self.components if isinstance(component, Component)]
        if len(loaded) < len(self.components):
            return None
        return RowWriter(loaded, every, self.recorder.pages(*self._pages), self.recorder.reserve)

    def patience(self, k: int) -> int:
        """Steps until solver counters are recorded."""
        return self.stats_every - k % self.stats_every

    def continue_after(self, k: int, t: float, h: float) -> None:
        """Continue after step k, which is recorded already."""
        self.recorder.continue_after(self._step, k, t, h, *self._values)

    def __call__(self, k: int, t: float, h: float) -> None:
        """Record the inputs of step k - 1 and the outputs at time t."""
        counts = self.row_writer.pop_counts() if self.row_writer else None
        if counts is None or self.row_writer is None:
            self._record(k, t, h)
        else:
            links = self.row_writer.link_rows(counts) if self._statistics else None
            self.recorder.commit(dict(zip(self._pages, counts, strict=False)))
            if links is not None:
                self._add_statistics(*links, h)
        if k % self.stats_every == 0:
            for component in self.components:
                component.read_counters()
            costs = [np.array([*component.counters.tolist(), component.wall_time]) for component in self.components]
            self.recorder.write(self._stats, k, t, h, *costs)

    def _record(self, k: int, t: float, h: float) -> None:
        """Record the present values of the components."""
        self.recorder.write(self._step, k, t, h, *self._values)
        if self._with_links and (self._statistics or self.recorder.due(self._links, k)):
            for component in self._with_links:
                component.read_links()
            links = [component.y_links for component in self._with_links]
            self.recorder.write(self._links, k, t, h, *links)
            if self._statistics:
                self._add_statistics([k], [t], np.concatenate(links)[None], h)

    def _add_statistics(self, numbers: Sequence[int], times: Sequence[float], links: Floats, h: float) -> None:
        """Add link outputs (m, n), one row a step, to the statistics; record these where due."""
        parts = np.split(links, self._link_ends[:-1], axis=1)
        for component, statistics, part in zip(self._with_links, self._statistics, parts, strict=True):
            for row, number, t in zip(part, numbers, times, strict=True):
                statistics.add(row, h)
                if self.recorder.due(self._links, number):
                    self.recorder.write(f"/{component.name}/links/between", number, t, h, statistics.pop())


class ReachedPoint:
    """Observer that keeps the state of the run: ``k`` steps done, time ``t``, s."""

    k, t = 0, 0.0

    def patience(self, k: int) -> int:
        """Return a number above any run: this observer need not see every step."""
        return NO_LIMIT

    def __call__(self, k: int, t: float, h: float) -> None:
        """Store k and t."""
        self.k, self.t = k, t


class Checkpoints:
    """Observer that writes a checkpoint every ``every`` steps."""

    def __init__(self, recorder: Recorder, scheme: Scheme, every: int) -> None:
        self.recorder, self.scheme, self.every = recorder, scheme, every

    def patience(self, k: int) -> int:
        """Steps until the next checkpoint."""
        return self.every - k % self.every

    def __call__(self, k: int, t: float, h: float) -> None:
        """Write a checkpoint if it is due."""
        if k and k % self.every == 0:
            content = checkpoint.save(self.scheme, checkpoint.CommunicationPoint(k, t, h))
            self.recorder.attach(f"{CHECKPOINT}{k}", content)


class TimedCheckpoints:
    """Observer that writes checkpoints of variable steps, every ``period`` s, where the step control allows one.

    Checkpoints are at multiples of ``every`` steps. ``start``: time at which the run continues, s.
    """

    def __init__(
        self,
        recorder: Recorder,
        scheme: Scheme,
        step_control: VariableStep | PowerResidual,
        period: float,
        every: int,
        start: float,
    ) -> None:
        self.recorder, self.scheme, self.step_control = recorder, scheme, step_control
        self.period, self.every = period, every
        self._due = self._after(start)

    def _after(self, t: float) -> float:
        return self.period * (math.floor(t / self.period + 1e-9) + 1)

    def __call__(self, k: int, t: float, h: float) -> None:
        """Write a checkpoint if it is due."""
        if t < self._due - 1e-9 or k % self.every or (memory := self.step_control.memory(self.scheme)) is None:
            return
        self._due = self._after(t)
        self.recorder.attach(
            f"{CHECKPOINT}{k}", checkpoint.save(self.scheme, checkpoint.CommunicationPoint(k, t, h), memory)
        )


class TimeReached:
    """Logs simulated time and real-time factor, a few times a second, as progress.

    :param stop: end of the run, s.
    """

    def __init__(self, stop: float) -> None:
        self._stop = stop
        self._start = self._next = 0.0

    def patience(self, k: int) -> int:
        """Return a number above any run: progress follows the wall clock, not the steps."""
        return NO_LIMIT

    def __call__(self, k: int, t: float, h: float) -> None:
        """Log time t, s, if it is due."""
        now = time.perf_counter()
        if not k:
            self._start = now
        elif now >= self._next or t >= self._stop - 1e-12:
            self._next = now + REFRESH
            text, count = "%.4g of %g s simulated, %.2f x real time", {"done": t, "of": self._stop}
            PROGRESS.debug(text, t, self._stop, t / (now - self._start), extra=count)


STATISTICS_PARTS = ("mean", "least", "most")  # order of the parts in a topic
MEANS = re.compile(r"(link|joint)\[\d+\]\.(ground\..+|(\w+\.)?(force|moment)\.\w)")  # link outputs that are means


class IntervalStatistics:
    """Accumulator of mean, least and most for outputs ``names``."""

    def __init__(self, names: Sequence[str]) -> None:
        size = len(names)
        self._means = np.array([bool(MEANS.fullmatch(name)) for name in names], dtype=bool)
        self._last_means = np.zeros(int(self._means.sum()))
        self._sum, self._least, self._most = np.zeros(size), np.full(size, np.inf), np.full(size, -np.inf)
        self._length = 0.0

    def add(self, values: Floats, h: float) -> None:
        """Add ``values`` (size,) at the end of a step of ``h`` s; the mean is weighted with h."""
        previous_length, means = self._length, values[self._means]
        self._length += h
        if previous_length > 0.0:
            values = values.copy()
            values[self._means] = (self._length * means - previous_length * self._last_means) / h
        self._last_means = means
        self._sum += h * values
        np.minimum(self._least, values, out=self._least)
        np.maximum(self._most, values, out=self._most)

    def pop(self) -> Floats:
        """Return means, least and most, (3 size,), and reset; needs at least one step."""
        statistics = np.concatenate([self._sum / self._length, self._least, self._most])
        self._sum[:], self._least[:], self._most[:], self._length = 0.0, np.inf, -np.inf, 0.0
        self._last_means = np.zeros_like(self._last_means)
        return statistics


def statistics_names(outputs: tuple[str, ...]) -> list[str]:
    """Return the names of the values that ``pop`` returns."""
    return [f"{name}.{part}" for part in STATISTICS_PARTS for name in outputs]
