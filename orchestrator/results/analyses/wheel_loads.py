"""Loads of road wheels, and of others on the ground: upward force of the track on each, in hull axes.

Intervals without load: one rule for lifted wheels and tracks off the ground.

An interval begins with the step in which the load is below LIFTED of the mean load of all members, and ends with the
step in which it exceeds TOUCHES times that threshold. Loads between do not change the state, so a load near one value
counts once.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fmus.vehicles.sides import ground_wheels, of_side
from orchestrator.log.reader import Missing
from orchestrator.log.time_series import Floats
from orchestrator.results.analyses import record_blocks
from orchestrator.results.rotation import body_axis
from orchestrator.results.run_data import EVER, RunData, Window, means, record_durations
from orchestrator.results.table import Table

LIFTED = 0.02  # threshold over the mean load of all members
TOUCHES = 2.0  # upper over lower threshold
SETTLING = 0.1  # s: a vehicle that starts as drawn does not rest on its tracks and wheels yet

Blocks = Iterator[tuple[Floats, Floats]]  # times (m,), s, and loads (m, members), N, in blocks


class UnloadedInterval(NamedTuple):
    """Interval without load."""

    start: float  # s, of its first step
    end: float  # s, of its last step, or of the end of the run
    time: float  # s, total of its steps
    begins: bool  # False if it begins with the first step
    ends: bool  # False if it lasts until the end of the run
    load: float  # N, at its end; NaN without one


class UnloadedIntervals(NamedTuple):
    """Intervals of all members."""

    threshold: float  # N, lower threshold
    by_member: dict[str, list[UnloadedInterval]]  # by name, in order of time


def switches(low: NDArray[np.bool_], high: NDArray[np.bool_], state: bool) -> Iterator[tuple[int, bool]]:
    """Begin (``low``) and end (``high``) of a state in samples (m,); samples between keep the state."""
    known = np.flatnonzero(low | high)
    changes = np.diff(low[known], prepend=state)
    yield from zip(known[changes].tolist(), low[known[changes]].tolist(), strict=True)


def starts_as_drawn(run: RunData) -> bool:
    """True if a vehicle starts as drawn, not in equilibrium."""
    return run.scene.get("assembly") == "vehicle" and run.entry("start", "state") != "equilibrium"


def is_settling(run: RunData, t: float) -> bool:
    """True if a vehicle still settles on its tracks at a time, s."""
    return starts_as_drawn(run) and t <= SETTLING


def unloaded_intervals(names: tuple[str, ...], blocks: Callable[[], Blocks]) -> UnloadedIntervals:
    """Intervals without load of the members ``names``; ``blocks`` is called twice; non-finite loads are left out."""
    total, duration = np.zeros(len(names)), np.zeros(len(names))
    for _, weights, loads in _weighed(blocks()):
        known = np.isfinite(loads) & np.isfinite(weights)[:, None]
        weights = np.where(np.isfinite(weights), weights, 0.0)
        total += weights @ np.where(known, loads, 0.0)
        duration += weights @ known
    seen = duration > 0.0
    least = LIFTED * float(np.mean(total[seen] / duration[seen])) if seen.any() else 0.0
    finished: dict[str, list[UnloadedInterval]] = {name: [] for name in names}
    if not least > 0.0:
        return UnloadedIntervals(least, finished)
    open_intervals: dict[str, UnloadedInterval] = {}  # intervals that still last
    first = True
    for t, weights, loads in _weighed(blocks()):
        for name, values in zip(names, loads.T, strict=True):
            low, high, done = values < least, values > TOUCHES * least, 0
            if first and low[0]:
                open_intervals[name] = UnloadedInterval(float(t[0]), np.nan, 0.0, False, False, np.nan)
            for k, begins in switches(low, high, name in open_intervals):
                if begins:
                    open_intervals[name] = UnloadedInterval(float(t[k]), np.nan, 0.0, True, False, np.nan)
                else:
                    interval = open_intervals.pop(name)
                    time = interval.time + float(weights[done:k].sum())
                    finished[name].append(
                        interval._replace(end=float(t[k]), time=time, ends=True, load=float(values[k]))
                    )
                done = k
            if name in open_intervals:
                open_intervals[name] = open_intervals[name]._replace(
                    end=float(t[-1]), time=open_intervals[name].time + float(weights[done:].sum())
                )
        first = False
    for name, interval in open_intervals.items():
        finished[name].append(interval)
    return UnloadedIntervals(least, finished)


def _weighed(blocks: Blocks) -> Iterator[tuple[Floats, Floats, Floats]]:
    """Times, weights (m,), s, and loads."""
    last: float | None = None
    for t, loads in blocks:
        if len(t):
            yield t, record_durations(t, last), loads
            last = float(t[-1])


def off_ground(run: RunData, window: Window = EVER) -> UnloadedIntervals:
    """Intervals without ground contact of each track, by the vertical ground force."""
    names = tuple(track for track in run.tracks if run.has(f"{track}.ground.force.z"))
    signals = [f"{name}.ground.force.z" for name in names]
    return run.compute_once(
        f"tracks off the ground, {window}",
        lambda _: unloaded_intervals(names, lambda: record_blocks.common_blocks(run, signals, window)),
    )


class WheelLoads(NamedTuple):
    """Loads over a window, weighted by time."""

    wheels: tuple[str, ...]  # "left_track.road_wheel[1]"
    mean: Floats  # (wheels,) N
    least: Floats  # (wheels,) N
    most: Floats  # (wheels,) N
    rms: Floats  # (wheels,) N, deviation from the mean
    lifted: Floats  # (wheels,) share of time without load; NaN for raised wheels that carry nothing at rest
    threshold: float  # N, a smaller load counts as lifted

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
        road = "road " * all("road_wheel[" in name for name in self.wheels)
        return Table.of(f"Load of {road}wheels, up in the hull", columns, rows, (note,))


def names(run: RunData) -> tuple[str, ...]:
    """Names of road wheels and others on the ground whose forces were recorded, "left_track.road_wheel[1]"."""
    grounded = _on_level_ground(run)
    return tuple(
        f"{track}.{wheel}"
        for track in run.tracks
        for name in run.log.topics[f"/{track}/out"].names
        if (wheel := name.removesuffix(".force.x")) != name
        if wheel.startswith("road_wheel[") or f"{track}.{wheel}" in grounded
    )


def _on_level_ground(run: RunData) -> set[str]:
    """Names of the wheels that stand on level ground as drawn; none in a log that does not say."""
    try:
        tables = {track: of_side(run.scene["vehicle"], track.removesuffix("_track")) for track in run.tracks}
        return {f"{track}.{wheel['name']}" for track, table in tables.items() for wheel in ground_wheels(table)}
    except (AttributeError, LookupError, TypeError, ValueError):
        return set()


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
    for t, values in record_blocks.common_blocks(run, signals, window):
        force, orientation = np.split(values, [3 * len(wheels)], axis=1)
        up = body_axis(orientation, 2) if turned else np.tile([0.0, 0.0, 1.0], (len(t), 1))
        yield t, np.einsum("mki,mi->mk", force.reshape(len(t), len(wheels), 3), up)


def lifted(run: RunData, window: Window = EVER) -> UnloadedIntervals:
    """Intervals in which wheels are lifted; none of raised ones that carry nothing at rest, or if none was recorded."""
    found = _lifted(run, window)
    raised = {*found.by_member}.difference(_on_level_ground(run) or found.by_member)
    raised = raised and raised & hang_at_rest(run)
    return found._replace(by_member={name: each for name, each in found.by_member.items() if name not in raised})


def _lifted(run: RunData, window: Window = EVER) -> UnloadedIntervals:
    try:
        return run.compute_once(
            f"lifted wheels, {window}", lambda run: unloaded_intervals(names(run), lambda: blocks(run, window))
        )
    except Missing:
        return UnloadedIntervals(0.0, {})


def hang_at_rest(run: RunData) -> set[str]:
    """Road wheels that carry nothing at rest, as raised end wheels, of tracks on the ground."""
    hang = {
        name
        for name, intervals in (off_ground(run).by_member | _lifted(run).by_member).items()
        if any(not each.begins and not is_settling(run, each.end) for each in intervals)
    }
    return {name for name in hang if "." in name and name.partition(".")[0] not in hang}


def of(run: RunData, window: Window = EVER) -> WheelLoads:
    """Loads of all road wheels; raises Missing."""
    t, load = (np.concatenate(parts) for parts in zip(*blocks(run, window), strict=True))
    if not len(t):
        raise Missing(f"{run.log.path} holds no step between {window.start:g} and {window.end:g} s")
    mean = means(t, load)
    rms = np.sqrt(means(t, (load - mean) ** 2))
    unloaded = lifted(run, window)
    time = {name: sum(interval.time for interval in intervals) for name, intervals in unloaded.by_member.items()}
    share = np.array([time.get(name, np.nan) for name in names(run)]) / record_durations(t).sum()
    return WheelLoads(names(run), mean, load.min(axis=0), load.max(axis=0), rms, share, unloaded.threshold)
