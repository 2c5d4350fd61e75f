"""Comparison of another model's answer with the recorded outputs, for equal inputs."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np

from orchestrator.log.reader import Log
from orchestrator.log.time_series import EVER, Floats
from orchestrator.results.picture import saved
from orchestrator.results.run_data import mean

PARTED = 0.01  # of the largest value: two answers that differ by more have parted
ROUNDING = 1e-9  # of the largest value of the same unit
DRAWN = ("tension.max", "sprocket.force.x", "ground.force.z", "speed")  # if present


class Answer(NamedTuple):
    """Output of both models at the recorded steps."""

    signal: str
    unit: str
    t: Floats  # (m,) s
    recorded: Floats  # (m,)
    now: Floats  # (m,)

    @property
    def apart(self) -> Floats:
        """Answer less recorded value, (m,)."""
        return self.now - self.recorded

    @property
    def largest(self) -> float:
        """Largest absolute value of both."""
        return float(max(abs(self.recorded).max(), abs(self.now).max()))

    @property
    def peak(self) -> tuple[float, float]:
        """Largest difference, with its sign, and its time, s."""
        k = int(abs(self.apart).argmax())
        return float(self.apart[k]), float(self.t[k])

    @property
    def parted(self) -> float:
        """First time at which the difference exceeds PARTED of the largest value, s; NaN if it never does."""
        beyond = np.flatnonzero(abs(self.apart) > PARTED * self.largest)
        return float(self.t[beyond[0]]) if len(beyond) else np.nan


def answers(log: Log, answer: Log, component: str, window: tuple[float, float] = EVER) -> list[Answer]:
    """Outputs of a component that both logs hold, without those that are zero or rounding in both.

    ``window``: closed interval of time, s. Raises NoSuchSignal, LogUnreadable.
    """
    topic = f"/{component}/out"
    about = {one: one.topics[one.known_topic(topic)] for one in (log, answer)}
    names = [name for name in about[log].names if name in about[answer].names]
    found = [one.select({topic: [about[one].names.index(name) for name in names]})[topic] for one in (log, answer)]
    t, at, there = np.intersect1d(found[0].t, found[1].t, return_indices=True)
    inside = (t >= window[0] - 1e-9) & (t <= window[1] + 1e-9)
    t, at, there = t[inside], at[inside], there[inside]
    if not len(t):
        return []
    shown = [
        Answer(name, log.unit(f"{component}.{name}"), t, found[0].values[at, k], found[1].values[there, k])
        for k, name in enumerate(names)
    ]
    most: dict[str, float] = {}  # by unit
    for one in shown:
        most[one.unit] = max(most.get(one.unit, 0.0), one.largest)
    return [one for one in shown if one.largest > ROUNDING * most[one.unit]]


def lines(found: list[Answer]) -> list[str]:
    """Lines of a table of the outputs."""
    rows = [
        f"{'signal':28} {'unit':5} {'rms, log':>12} {'rms, now':>12} {'rms apart':>12} {'most apart':>12}"
        f" {'at, s':>8} {'parted, s':>10}"
    ]
    for one in found:
        most, at = one.peak
        figures = *(mean(one.t, values**2) ** 0.5 for values in (one.recorded, one.now, one.apart)), most
        parted = f"{one.parted:10.4f}" if np.isfinite(one.parted) else f"{'never':>10}"
        rows.append(f"{one.signal:28} {one.unit:5} {' '.join(f'{x:12.5g}' for x in figures)} {at:8.4f} {parted}")
    return rows


def draw(found: list[Answer], output: Path, title: str) -> None:
    """Draw a few outputs of both models over time, and their difference; raises BadInput."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    chosen = [one for one in found if one.signal in DRAWN] or found[: len(DRAWN)]
    figure = Figure(figsize=(9.0, 1.9 * len(chosen) + 0.8), layout="constrained")
    FigureCanvasAgg(figure)
    for one, (pane, beside) in zip(chosen, figure.subplots(len(chosen), 2, sharex=True, squeeze=False), strict=True):
        pane.plot(one.t, one.recorded, linewidth=0.9, label="log")
        pane.plot(one.t, one.now, linewidth=0.9, label="now")
        pane.set_ylabel(f"{one.signal}\n{one.unit}", fontsize=8)
        beside.plot(one.t, one.apart, linewidth=0.9, color="C3")
        beside.axhline(0.0, color="0.7", linewidth=0.6, zorder=0)
        pane.grid(alpha=0.3)
        beside.grid(alpha=0.3)
    panes = figure.axes
    panes[0].legend(fontsize=8)
    panes[0].set_title("both answers", fontsize=9)
    panes[1].set_title("now less log", fontsize=9)
    for pane in panes[-2:]:
        pane.set_xlabel("t, s")
    figure.suptitle(title, fontsize=10, parse_math=False)
    saved(figure, output)
