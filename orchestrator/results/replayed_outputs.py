"""Comparison of another model's outputs with the recorded ones, for equal inputs."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np

from orchestrator.log.reader import Log
from orchestrator.log.time_series import ALL_TIME, Floats, within
from orchestrator.results.output_files import new_figure, save_figure
from orchestrator.results.run_data import mean

PARTED = 0.01  # of the largest value: outputs that differ by more have parted
ROUNDING = 1e-9  # of the largest value of the same unit
DRAWN = ("tension.max", "sprocket.force.x", "ground.force.z", "speed")  # if present


class ReplayedOutput(NamedTuple):
    """Output of both models at the recorded steps."""

    signal: str
    unit: str
    t: Floats  # (m,) s
    recorded: Floats  # (m,)
    replayed: Floats  # (m,) by the other model

    @property
    def difference(self) -> Floats:
        """Replayed less recorded value, (m,)."""
        return self.replayed - self.recorded

    @property
    def largest(self) -> float:
        """Largest absolute value of both."""
        return float(max(abs(self.recorded).max(), abs(self.replayed).max()))

    @property
    def peak(self) -> tuple[float, float]:
        """Largest difference, with its sign, and its time, s."""
        k = int(abs(self.difference).argmax())
        return float(self.difference[k]), float(self.t[k])

    @property
    def parting_time(self) -> float:
        """First time at which the difference exceeds PARTED of the largest value, s; NaN if it never does."""
        beyond = np.flatnonzero(abs(self.difference) > PARTED * self.largest)
        return float(self.t[beyond[0]]) if len(beyond) else np.nan

    def figures(self) -> dict[str, float]:
        """RMS of recorded and replayed values and of their difference, the largest difference, its time and parting."""
        rms = [mean(self.t, values**2) ** 0.5 for values in (self.recorded, self.replayed, self.difference)]
        names = "rms, log", "rms, now", "rms apart", "most apart", "at, s", "parted, s"
        return dict(zip(names, (*rms, *self.peak, self.parting_time), strict=True))


def compared(log: Log, replay: Log, component: str, window: tuple[float, float] = ALL_TIME) -> list[ReplayedOutput]:
    """Outputs of a component that both logs hold, without those that are zero or rounding in both.

    ``window``: closed interval of time, s. Raises Missing, LogUnreadable.
    """
    topic = f"/{component}/out"
    topics = {item: item.topics[item.known_topic(topic)] for item in (log, replay)}
    names = [name for name in topics[log].names if name in topics[replay].names]
    series = [item.select({topic: [topics[item].names.index(name) for name in names]})[topic] for item in (log, replay)]
    t, in_log, in_replay = np.intersect1d(series[0].t, series[1].t, return_indices=True)
    inside = within(t, window)
    t, in_log, in_replay = t[inside], in_log[inside], in_replay[inside]
    if not len(t):
        return []
    outputs = [
        ReplayedOutput(
            name, log.unit(f"{component}.{name}"), t, series[0].values[in_log, k], series[1].values[in_replay, k]
        )
        for k, name in enumerate(names)
    ]
    most: dict[str, float] = {}  # by unit
    for item in outputs:
        most[item.unit] = max(most.get(item.unit, 0.0), item.largest)
    return [item for item in outputs if item.largest > ROUNDING * most[item.unit]]


def lines(outputs: list[ReplayedOutput]) -> list[str]:
    """Lines of a table of the outputs."""
    rows: list[str] = []
    for output in outputs:
        *values, at, parted = output.figures().items()
        if not rows:
            rows.append(
                f"{'signal':28} {'unit':5} {' '.join(f'{name:>12}' for name, _ in values)} {at[0]:>8} {parted[0]:>10}"
            )
        parting_time = f"{parted[1]:10.4f}" if np.isfinite(parted[1]) else f"{'never':>10}"
        texts = " ".join(f"{value:12.5g}" for _, value in values)
        rows.append(f"{output.signal:28} {output.unit:5} {texts} {at[1]:8.4f} {parting_time}")
    return rows


def draw(outputs: list[ReplayedOutput], picture: Path, title: str) -> None:
    """Draw a few outputs of both models over time, and their difference; raises BadInput."""
    chosen = [output for output in outputs if output.signal in DRAWN] or outputs[: len(DRAWN)]
    figure = new_figure(9.0, 1.9 * len(chosen) + 0.8)
    for output, (pane, difference_pane) in zip(
        chosen, figure.subplots(len(chosen), 2, sharex=True, squeeze=False), strict=True
    ):
        pane.plot(output.t, output.recorded, linewidth=0.9, label="log")
        pane.plot(output.t, output.replayed, linewidth=0.9, label="now")
        pane.set_ylabel(f"{output.signal}\n{output.unit}", fontsize=8)
        difference_pane.plot(output.t, output.difference, linewidth=0.9, color="C3")
        difference_pane.axhline(0.0, color="0.7", linewidth=0.6, zorder=0)
        pane.grid(alpha=0.3)
        difference_pane.grid(alpha=0.3)
    panes = figure.axes
    panes[0].legend(fontsize=8)
    panes[0].set_title("both models", fontsize=9)
    panes[1].set_title("now less log", fontsize=9)
    for pane in panes[-2:]:
        pane.set_xlabel("t, s")
    figure.suptitle(title, fontsize=10, parse_math=False)
    save_figure(figure, picture)
