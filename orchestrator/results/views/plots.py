"""Curves beside a view of bodies: speed, torque, power and tension, as far as a log has them."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from orchestrator.log.reader import Log
from orchestrator.log.time_series import EVER, Floats
from orchestrator.results.units import size

LONGEST = 1e9  # s: later times are damage


class Plot(NamedTuple):
    """Curves of one unit."""

    name: str  # one word
    title: str  # with the unit
    size: float  # of that unit
    signals: tuple[str, ...]  # "instance.variable"


ABOUT = (
    ("speed", "speed", "m/s", ("speed",), "m/s"),
    ("torque", "torque of the drives", "kN m", ("torque", "left.torque", "right.torque"), "N.m"),
    ("power", "power of the drives", "kW", ("power", "left.power", "right.power"), "W"),
    ("tension", "tension of a track, largest and mean link", "kN", ("tension.max", "tension.mean"), "N"),
)


def plots(log: Log) -> list[Plot]:
    """Return the plots whose signals a log holds."""
    plots_of_log = []
    for name, title, shown_unit, variables, unit in ABOUT:
        signals = [
            log.name(topic, column)
            for topic, about in log.topics.items()
            if topic.endswith("/out")
            for column, variable in enumerate(about.names)
            if variable in variables and about.units[column] == unit
        ]
        if "chassis.speed" in signals:
            signals = ["chassis.speed"]
        if signals:
            plots_of_log.append(Plot(name, f"{title}, {shown_unit}", size(shown_unit), tuple(signals)))
    return plots_of_log


def curves(
    log: Log, chosen: list[Plot], window: tuple[float, float] = EVER
) -> Iterator[tuple[Plot, str, Floats, Floats]]:
    """Yield plot, signal, times (m,), s, and values (m,) in the unit of the title: all records, in blocks."""
    places = {signal: (plot, log.find(signal)) for plot in chosen for signal in plot.signals}
    columns: dict[str, list[int]] = {}
    for _, (topic, column) in places.values():
        columns.setdefault(topic, []).append(column)
    for piece in log.stream(columns, window):
        for signal, (plot, (topic, column)) in places.items():
            if topic in piece:
                series = piece[topic].rows((piece[topic].t >= 0.0) & (piece[topic].t < LONGEST))
                yield plot, signal, series.t, series.values[:, columns[topic].index(column)] * (1.0 / plot.size)
