"""Pictures of signals: over time, frequency or tooth order, or as a map of a family."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import takewhile
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from fmus.vehicles.tables import BadInput
from orchestrator.log.reader import Log, Missing
from orchestrator.log.schema import family
from orchestrator.log.time_series import Floats
from orchestrator.results.analyses import signal_curves
from orchestrator.results.analyses.signal_curves import PLACE, LabelledCurve, SignalMap, measured_curve, member
from orchestrator.results.measured_record import MeasuredSignal
from orchestrator.results.output_files import atomic_write, check_output
from orchestrator.results.run_data import EVER, RunData, Window
from orchestrator.results.units import scaled

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

PICTURE_SUFFIXES = (".png", ".svg", ".pdf")
STYLES = (("-", "solid"), ("--", "dashed"), (":", "dotted"), ("-.", "dash-dotted"))  # by log
INSIDE, LEGEND, BESIDE = 4, 10, 24  # most curves for: legend inside, thick lines, legend beside; more: none
NOTE: dict[str, Any] = {"textcoords": "offset points", "fontsize": 7}  # on a part of the circuit
DECADES = 1e-4  # of the largest amplitude: lower limit of the axis


def draw(logs: Sequence[Path], signals: Sequence[str], output: Path, window: Window = EVER, **form: Any) -> None:
    """Write a picture of signals; ``form`` and errors as of ``figure_of``. Raises BadInput for a bad ``output``."""
    check_output(output, PICTURE_SUFFIXES)
    figure = figure_of(logs, signals, window, **form)
    with atomic_write(output) as temporary:
        figure.savefig(temporary, dpi=120)


def figure_of(
    logs: Sequence[Path],
    signals: Sequence[str],
    window: Window = EVER,
    *,
    frequency: bool = False,
    order: bool = False,
    waterfall: bool = False,
    place: bool = False,
    at: Sequence[float] = (),
    measured: Sequence[MeasuredSignal] = (),
) -> Figure:
    """Draw signals ("*" stands for anything) of one or more logs.

    :param frequency: amplitudes over frequency, Hz, instead of values over time.
    :param order: over tooth orders.
    :param waterfall: a map of a family as "left_track.link[*].tension", by its members and time (or frequency).
    :param place: a map by place on the circuit (``circuit.py``) and time; of a single record curves over the place.
    :param at: instants, s: curves over the place in the records nearest to them, instead of a map.
    :param measured: signals of a test, on the clock of the runs, drawn over time with those of the runs.
    :raises BadInput: for what cannot be drawn. Raises Missing, LogUnreadable.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    frequency = frequency or order
    if place and frequency:
        raise BadInput("places on the circuit are drawn over time, not over frequency or tooth order")
    if at and not place:
        raise BadInput("at: needs place, a map of values by place on the circuit, of which it is an instant")
    if measured and (frequency or waterfall or place):
        raise BadInput("measured signals are drawn as curves over time only")
    figure = Figure(layout="constrained")
    FigureCanvasAgg(figure)
    x_label = "tooth order" if order else "frequency, Hz" if frequency else "t, s"
    if waterfall or place:
        maps = []
        for path in logs:
            if at:
                break
            with Log(path) as log:
                maps += [*signal_curves.maps(RunData(log), signals, window, frequency, order, place, len(logs) > 1)]
        if place and (at or all(len(each.x) == 1 for each in maps)):
            _draw_profiles(figure, logs, signals, at or [float(maps[0].x[0])])
        elif single := next((each.title for each in maps if len(each.x) < 2), ""):
            raise Missing(f"'{single}' has a single record in the window: a map needs two")
        else:
            _draw_maps(figure, maps, x_label, frequency)
    else:
        curves, signals = [], [*signals, *(each.signal for each in measured)]
        for number, path in enumerate(logs):
            with Log(path) as log:
                curves += [
                    *signal_curves.curves(RunData(log), signals, window, frequency, order, number, len(logs) > 1)
                ]
        curves += [measured_curve(each, window, len(logs)) for each in measured]
        _draw_curves(figure, curves, x_label, frequency)
    if len(logs) == 1:
        figure.suptitle(logs[0].stem, fontsize=10, parse_math=False)
    return figure


def _draw_profiles(figure: Figure, logs: Sequence[Path], signals: Sequence[str], at: Sequence[float]) -> None:
    """Draw families over the place on the circuit at some instants, with the parts of the first one."""
    drawn = []
    for number, path in enumerate(logs):
        with Log(path) as log:
            drawn += [*signal_curves.profiles(RunData(log), signals, at, number, len(logs) > 1)]
    _draw_curves(figure, [curve for curve, _ in drawn], PLACE, False)
    pane = figure.axes[0]
    for part in drawn[0][1]:
        pane.axvline(part.start, color="0.6", linewidth=0.6)
        pane.annotate(part.name, (part.middle, 1.0), (0, 3), xycoords=("data", "axes fraction"), ha="center", **NOTE)


def _draw_curves(figure: Figure, curves: list[LabelledCurve], x_label: str, frequency: bool) -> None:
    """Draw curves in one pane per unit."""
    units = list(dict.fromkeys(curve.unit for curve in curves))
    figure.set_size_inches(9.0, 1.2 + 3.0 * len(units))
    panes = figure.subplots(len(units), 1, sharex=True, squeeze=False)[:, 0]
    for pane, unit in zip(panes, units, strict=True):
        _pane(figure, pane, [curve for curve in curves if curve.unit == unit], unit, frequency)
    panes[-1].set_xlabel(x_label)


def _pane(figure: Figure, pane: Axes, curves: list[LabelledCurve], unit: str, frequency: bool) -> None:
    """Draw the curves of one unit."""
    import matplotlib

    top = max(_largest(curve.y) for curve in curves)
    size, shown = scaled(top, unit)
    names = list(dict.fromkeys(curve.signal for curve in curves))
    many = len(curves) > LEGEND
    colours = matplotlib.colormaps["viridis"](np.linspace(0.0, 0.95, len(names)))
    signals = [curve.signal for curve in curves]
    for number, curve in enumerate(curves):
        style = STYLES[curve.log % 4][0] if len(names) > 1 else "-"
        index = signals.index(curve.signal) if curve.measured and len(names) > 1 else number
        pane.plot(
            curve.x, curve.y / size, style, color=colours[names.index(curve.signal)] if many else f"C{index}",
            linewidth=0.5 if many else 1.0, alpha=0.7 if many else 1.0, label=curve.label,
        )  # fmt: skip
    text = f"{_common(names)}{', amplitude' if frequency else ''}".removeprefix(", ")
    pane.set_ylabel(", ".join(filter(None, [text, shown])), parse_math=False)
    if frequency and top > 0.0:
        pane.set_yscale("log")
        pane.set_ylim(DECADES * top / size, 2.0 * top / size)
    pane.grid(alpha=0.3)
    pane.margins(x=0.0)
    barred = many and _bar(figure, pane, names)
    if 1 < len(curves) <= BESIDE and not barred:
        legend_place: dict[str, Any] = (
            {"loc": "center left", "bbox_to_anchor": (1.0, 0.5)} if len(curves) > INSIDE else {}
        )
        for label in pane.legend(fontsize=6 if many else 8, **legend_place).get_texts():
            label.set_parse_math(False)
    if many:
        styles = dict.fromkeys((curve.log % 4, curve.label.partition(", ")[2]) for curve in curves)
        logs = ", ".join(f"{name} {STYLES[style][1]}" for style, name in styles if name)
        pane.set_title(f"{len(curves)} curves{': ' * bool(logs)}{logs}", fontsize=9, loc="left", parse_math=False)


def _common(names: Sequence[str]) -> str:
    """Common part of the names of signals: a family or an ending; else empty."""
    families = {family(name)[0] for name in names}
    if len(names) == 1 or len(families) == 1:
        return names[0] if len(names) == 1 else families.pop()
    words = [name.split(".")[::-1] for name in names]
    alike = list(takewhile(lambda each: len(set(each)) == 1, zip(*words, strict=False)))
    return ".".join(each[0] for each in alike[::-1])


def _bar(figure: Figure, pane: Axes, names: list[str]) -> bool:
    """Draw a colour bar for the members of a family; False if the signals are not one family."""
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize

    keys, numbers = zip(*map(family, names), strict=True)
    if len(set(keys)) != 1 or None in numbers:
        return False
    scale = ScalarMappable(Normalize(min(numbers), max(numbers)), "viridis")
    figure.colorbar(scale, ax=pane, label=f"number of the {member(names[0])}")
    return True


def _draw_maps(figure: Figure, maps: list[SignalMap], x_label: str, frequency: bool) -> None:
    """Draw maps in one pane each, with one scale per unit."""
    from matplotlib.colors import LogNorm, Normalize

    figure.set_size_inches(9.0, 0.8 + 3.4 * len(maps))
    panes = figure.subplots(len(maps), 1, sharex=True, squeeze=False)[:, 0]
    for pane, family_map in zip(panes, maps, strict=True):
        alike = [other.values for other in maps if other.unit == family_map.unit]
        most, least = (pick([pick(values) for values in alike]) for pick in (np.nanmax, np.nanmin))
        size, shown = scaled(float(max(abs(most), abs(least))), family_map.unit)
        scale = (
            LogNorm(DECADES * most / size, most / size)
            if frequency and most > 0
            else Normalize(least / size, most / size)
        )
        values = np.maximum(family_map.values / size, DECADES * most / size) if frequency else family_map.values / size
        mesh = pane.pcolormesh(
            family_map.x, family_map.y, values, norm=scale, cmap="viridis", shading="nearest", rasterized=True
        )
        amplitude = "amplitude, " if frequency else ""
        figure.colorbar(mesh, ax=pane, label=f"{amplitude}{shown}")
        pane.set_title(family_map.title, fontsize=9, loc="left", parse_math=False)
        pane.set_ylabel(family_map.label)
        for part in family_map.parts:
            pane.axhline(part.start, color="1.0", linewidth=0.6)
            beside = {"xycoords": ("axes fraction", "data"), "color": "1.0", "va": "center"}
            pane.annotate(part.name, (0.0, part.middle), (3, 0), **beside, **NOTE)
    panes[-1].set_xlabel(x_label)


def _largest(values: Floats) -> float:
    finite = values[np.isfinite(values)]
    return float(np.abs(finite).max()) if len(finite) else 0.0
