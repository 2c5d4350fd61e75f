"""Curves beside a view of bodies, as far as a log has them: tension, wheel loads, speed, yaw rate, slip, drives.

Tensions of the links of a track also over their places on the circuit, at the instants of a view. Values are those of
the log and of the analyses ``wheel_loads`` and ``profile``.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator
from contextlib import suppress
from itertools import chain
from typing import NamedTuple

import numpy as np

from orchestrator.log.reader import Missing
from orchestrator.log.time_series import ALL_TIME, Floats
from orchestrator.results.analyses import profile, record_blocks, wheel_loads
from orchestrator.results.run_data import POSITION, TENSION, RunData, Window
from orchestrator.results.units import size
from orchestrator.results.views.pose_columns import MAX_TIME, matched_times

ROUNDING = 1e-9  # of each shown unit: smaller values are rounding, and are shown as 0
LOADS, MOTION = "loads", "motion"  # groups of plots, which viewers show in turn


class Plot(NamedTuple):
    """Curves of one unit."""

    name: str  # one word
    title: str  # with the unit
    size: float  # of that unit
    signals: tuple[str, ...]  # "instance.variable"
    group: str


ABOUT = (
    ("tension", "tension of a track, largest and mean link", "kN", ("tension.max", "tension.mean"), "N", LOADS),
    ("speed", "speed", "m/s", ("speed",), "m/s", MOTION),
    ("yaw_rate", "yaw rate, to the left", "rad/s", ("chassis.angular_velocity.z",), "rad/s", MOTION),
    ("slip", "slip of a track on the ground", "m/s", ("slip",), "m/s", MOTION),
    ("torque", "torque of the drives", "kN m", ("torque", "left.torque", "right.torque"), "N.m", MOTION),
    ("power", "power of the drives", "kW", ("power", "left.power", "right.power"), "W", MOTION),
)


def plots(run: RunData) -> list[Plot]:
    """Return the plots whose signals a log holds, group by group."""
    log, plots_of_run = run.log, []
    for name, title, shown_unit, variables, unit, group in ABOUT:
        signals = [
            log.name(topic, column)
            for topic, about in log.topics.items()
            if topic.endswith("/out")
            for column, variable in enumerate(about.names)
            if variable in variables and about.units[column] == unit
        ]
        if "chassis.speed" in signals:
            signals = ["chassis.speed"]
        if signals and (name != "slip" or run.scene.get("assembly") == "vehicle"):
            plots_of_run.append(Plot(name, f"{title}, {shown_unit}", size(shown_unit), tuple(signals), group))
    loads = _load_columns(run)
    for track in run.tracks:
        if signals := [name for name in loads if name.startswith(f"{track}.")]:
            title = f"loads of the road wheels of {track}, kN"
            plots_of_run.append(Plot(f"loads_{track}", title, size("kN"), tuple(signals), LOADS))
    return sorted(plots_of_run, key=lambda plot: plot.group)


def _load_columns(run: RunData) -> dict[str, int]:
    """Columns of the loads of road wheels in ``wheel_loads.blocks``, by names as in the report."""
    return {f"{name}.load": column for column, name in enumerate(wheel_loads.names(run))}


def curves(
    run: RunData, chosen: list[Plot], window: tuple[float, float] = ALL_TIME
) -> Iterator[tuple[Plot, str, Floats, Floats]]:
    """Yield plot, signal, times (m,), s, and values (m,) in the unit of the title: all records, in blocks."""
    plot_of_signal = {signal: plot for plot in chosen for signal in plot.signals}
    for signal, t, values in chain(_recorded(run, plot_of_signal, window), _loads(run, plot_of_signal, window)):
        plot, kept = plot_of_signal[signal], (t >= 0.0) & (t < MAX_TIME)
        shown = values[kept] * (1.0 / plot.size)
        yield plot, signal, t[kept], np.where(np.abs(shown) < ROUNDING, 0.0, shown)


Curves = Iterator[tuple[str, Floats, Floats]]  # signal, times (m,), s, and values (m,), SI


def _recorded(run: RunData, signals: Collection[str], window: tuple[float, float]) -> Curves:
    """Yield those of the signals that the log itself holds."""
    places = {signal: run.log.find(signal) for signal in signals if signal in run.log}
    columns: dict[str, list[int]] = {}
    for topic, column in places.values():
        columns.setdefault(topic, []).append(column)
    for piece in run.log.stream(columns, window):
        for signal, (topic, column) in places.items():
            if topic in piece:
                yield signal, piece[topic].t, piece[topic].values[:, columns[topic].index(column)]


def _loads(run: RunData, signals: Collection[str], window: tuple[float, float]) -> Curves:
    """Yield the loads of road wheels among the signals; none of a damaged log whose components differ in steps."""
    loads = {name: column for name, column in _load_columns(run).items() if name in signals}
    with suppress(Missing):
        for t, values in wheel_loads.blocks(run, Window(*window)) if loads else ():
            for name, column in loads.items():
                yield name, t, values[:, column]


class ChainProfile(NamedTuple):
    """Tensions of the links of a track over its circuit."""

    track: str
    title: str  # with units, and the parts of the circuit at the first instant


def chain_profiles(run: RunData) -> list[ChainProfile]:
    """Return the profiles of tracks whose links' tensions and places a log holds."""
    profiles = []
    for track in run.tracks:
        if all(record_blocks.has(run, track, signal) for signal in (TENSION, POSITION)):
            with suppress(Missing):
                first = next(profile.tensions(run, track))
                parts = [f"{part.name} {part.start:z.1f} to {part.end:z.1f} m" for part in first.stretches]
                title = "; ".join([f"{track}: tension, kN, over place along it, m", *parts])
                profiles.append(ChainProfile(track, title))
    return profiles


def tensions(run: RunData, track: str, t: Floats) -> Iterator[tuple[float, Floats, Floats]]:
    """Yield time, s, places (links,), m, in order, and tensions (links,), kN, of the link records at times (m,), s.

    Ends early where a chain that blew up no longer goes round its sprocket.
    """
    if not len(t):
        return
    with suppress(Missing):
        for block in profile.tensions(run, track, Window(float(t[0]), float(t[-1]))):
            rows, matched = matched_times(block.t, t)
            for k in np.flatnonzero(matched):
                yield float(t[rows[k]]), block.place[k], block.tension[k] * (1.0 / size("kN"))
