"""Loads of road wheels: upward force of the track on each, in hull axes."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from orchestrator.log.time_series import Floats
from orchestrator.results.analyses import common_steps
from orchestrator.results.analyses.unloaded import TOUCHES, UnloadedIntervals, unloaded_intervals
from orchestrator.results.rotation import body_axis
from orchestrator.results.run_data import EVER, Missing, RunData, Window, means, record_durations
from orchestrator.results.table import Table


class WheelLoads(NamedTuple):
    """Loads over a window, weighted by time."""

    wheels: tuple[str, ...]  # "left_track.road_wheel[1]"
    mean: Floats  # (wheels,) N
    least: Floats  # (wheels,) N
    most: Floats  # (wheels,) N
    rms: Floats  # (wheels,) N, deviation from the mean
    lifted: Floats  # (wheels,) share of time without load
    threshold: float  # N, a smaller load counts as lifted (``unloaded.py``)

    def table(self) -> Table:
        """Table with a row for each wheel."""
        values = (self.mean / 1e3, self.least / 1e3, self.most / 1e3, self.rms / 1e3, 100.0 * self.lifted)
        rows = list(zip(self.wheels, *(each.tolist() for each in values), strict=True))
        columns = (
            ("wheel", ""), ("mean", "kN"), ("least", "kN"), ("largest", "kN"), ("rms about mean", "kN"),
            ("lifted", "% of time"),
        )  # fmt: skip
        least = self.threshold / 1e3
        note = f"a wheel is lifted from where it carries less than {least:.3g} kN to more than {TOUCHES * least:.3g} kN"
        return Table.of("Load of road wheels, up in the hull", columns, rows, (note,))


def names(run: RunData) -> tuple[str, ...]:
    """Names of the road wheels whose forces were recorded, "left_track.road_wheel[1]"."""
    return tuple(
        f"{track}.{name.removesuffix('.force.x')}"
        for track in run.tracks
        for name in run.log.topics[f"/{track}/out"].names
        if name.startswith("road_wheel[") and name.endswith(".force.x")
    )


def blocks(run: RunData, window: Window = EVER) -> Iterator[tuple[Floats, Floats]]:
    """Times (m,), s, and loads of the road wheels (m, wheels), N, in blocks; raises Missing.

    In a log that was cut off only steps of all components count.
    """
    wheels = names(run)
    if not wheels:
        raise Missing(f"{run.log.path} holds no road wheel")
    signals = [f"{name}.force.{axis}" for name in wheels for axis in "xyz"]
    turned = run.has("chassis.chassis.orientation.w")
    signals += [f"chassis.chassis.orientation.{part}" for part in "wxyz"] if turned else []
    for t, values in common_steps.blocks(run, signals, window):
        force, orientation = np.split(values, [3 * len(wheels)], axis=1)
        up = body_axis(orientation, 2) if turned else np.tile([0.0, 0.0, 1.0], (len(t), 1))
        yield t, np.einsum("mki,mi->mk", force.reshape(len(t), len(wheels), 3), up)


def lifted(run: RunData, window: Window = EVER) -> UnloadedIntervals:
    """Intervals in which road wheels are lifted (``unloaded.py``), by wheel; raises Missing."""
    return run.compute_once(
        f"lifted wheels, {window}", lambda run: unloaded_intervals(names(run), lambda: blocks(run, window))
    )


def of(run: RunData, window: Window = EVER) -> WheelLoads:
    """Loads of all road wheels; raises Missing."""
    t, load = (np.concatenate(parts) for parts in zip(*blocks(run, window), strict=True))
    if not len(t):
        raise Missing(f"{run.log.path} holds no step between {window.start:g} and {window.end:g} s")
    mean = means(t, load)
    rms = np.sqrt(means(t, (load - mean) ** 2))
    unloaded = lifted(run, window)
    share = (
        np.array([sum(interval.time for interval in unloaded.by_member[name]) for name in names(run)])
        / record_durations(t).sum()
    )
    return WheelLoads(names(run), mean, load.min(axis=0), load.max(axis=0), rms, share, unloaded.threshold)
