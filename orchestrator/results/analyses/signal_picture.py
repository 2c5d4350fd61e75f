"""Pictures of signals: over time, frequency or tooth order, or as a map of a family.

A picture shows some thousand instants. Longer records are reduced to the least and largest value of equal intervals
of time (curves, ``approximations.py``) or to means of several records (maps), so a long log needs little memory.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import takewhile
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from fmus.vehicles.tables import BadInput
from orchestrator.log.reader import Log
from orchestrator.log.schema import family
from orchestrator.log.time_series import Floats
from orchestrator.results.analyses import circuit, spectrum
from orchestrator.results.approximations import TimeEnvelope
from orchestrator.results.measured_record import MeasuredSignal
from orchestrator.results.output_files import atomic_write, check_output
from orchestrator.results.run_data import BLOCK, EVER, Missing, RunData, Window, within
from orchestrator.results.units import scaled

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

KINDS = (".png", ".svg", ".pdf")
CURVE, MAP = 2000, 1500  # intervals of time of a curve, instants of a map
PLACE = "along the chain from the sprocket, m"
STYLES = (("-", "solid"), ("--", "dashed"), (":", "dotted"), ("-.", "dash-dotted"))  # by log
INSIDE, LEGEND, BESIDE = 4, 10, 24  # most curves for: legend inside, thick lines, legend beside; more: none
DECADES = 1e-4  # of the largest amplitude: lower limit of the axis


class LabelledCurve(NamedTuple):
    """Signal of a log."""

    label: str
    unit: str
    x: Floats  # (k,)
    y: Floats  # (k,)
    log: int  # number of its log
    signal: str


class SignalMap(NamedTuple):
    """Family of signals of a log."""

    title: str
    label: str  # label of y
    x: Floats  # (k,)
    y: Floats  # (n,)
    values: Floats  # (n, k)
    unit: str
    parts: tuple[circuit.Stretch, ...] = ()  # named parts of y


def draw(logs: Sequence[Path], signals: Sequence[str], output: Path, window: Window = EVER, **form: Any) -> None:
    """Write a picture of signals; ``form`` and errors as of ``figure_of``. Raises BadInput for a bad ``output``."""
    check_output(output, KINDS)
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
    :param measured: signals of a test, on the clock of the runs, drawn with the others over time.
    :raises BadInput: for what cannot be drawn. Raises Missing, NoSuchSignal, LogUnreadable.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    frequency = frequency or order
    if place and frequency:
        raise BadInput("places on the circuit are drawn over time, not over frequency or tooth order")
    if at and not place:
        raise BadInput("--at takes an instant of --place, values by place on the circuit")
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
                maps += [*_maps(RunData(log), signals, window, frequency, order, place, len(logs) > 1)]
        if place and (at or all(len(each.x) == 1 for each in maps)):
            _draw_profiles(figure, logs, signals, at or [float(maps[0].x[0])])
        elif single := next((each.title for each in maps if len(each.x) < 2), ""):
            raise Missing(f"'{single}' has a single record in the window: a map needs two")
        else:
            _draw_maps(figure, maps, x_label, frequency)
    else:
        curves = []
        for number, path in enumerate(logs):
            with Log(path) as log:
                curves += [*_curves(RunData(log), signals, window, frequency, order, number, len(logs) > 1)]
        curves += [_measured_curve(each, window, len(logs)) for each in measured]
        _draw_curves(figure, curves, x_label, frequency)
    if len(logs) == 1:
        figure.suptitle(logs[0].stem, fontsize=10, parse_math=False)
    return figure


def _chosen(run: RunData, signals: Sequence[str], window: Window) -> Iterator[tuple[str, list[int], Floats]]:
    """Topic, columns and times (m,) of the signals; raises Missing without records."""
    for topic, columns in run.log.choose(signals).items():
        t = run.log.select({topic: []}, window)[topic].t
        if not len(t):
            raise Missing(f"{run.log.path} holds no records on {topic} between {window.start:g} and {window.end:g} s")
        if not np.isfinite(t).all():
            raise Missing(f"{run.log.path}: times of {topic} are no finite numbers: there is nothing to draw")
        yield topic, columns, t


def _curves(
    run: RunData, signals: Sequence[str], window: Window, frequency: bool, order: bool, number: int, several: bool
) -> Iterator[LabelledCurve]:
    """Signals of a log over time or frequency."""
    for topic, columns, t in _chosen(run, signals, window):
        names = [run.log.name(topic, column) for column in columns]
        labels = [f"{name}, {run.log.path.stem}" if several else name for name in names]
        units = [run.log.topics[topic].units[column] for column in columns]
        if frequency:
            spectra = spectrum.of(run, names, window, orders=order)
            x, y = (spectra.order if order else spectra.frequency)[1:], spectra.amplitude[1:]
            drawn = [(x, y[:, k]) for k in range(len(names))]
        else:
            drawn = _thinned(run, topic, columns, window, t)
        for k, (x, y) in enumerate(drawn):
            yield LabelledCurve(labels[k], units[k], x, y, number, names[k])


def _thinned(run: RunData, topic: str, columns: list[int], window: Window, t: Floats) -> list[tuple[Floats, Floats]]:
    """Times and values of each column, thinned; ``t`` (m,): times of all records in the window, s."""
    envelope = TimeEnvelope(float(t.min()), float(t.max()), len(columns), CURVE)
    for block in run.log.blocks({topic: columns}, BLOCK, window=window):
        envelope.add(block[topic].t, block[topic].values)
    return [(curve.t, curve.y) for curve in map(envelope.curve, range(len(columns)))]


def _measured_curve(measured: MeasuredSignal, window: Window, number: int) -> LabelledCurve:
    """Curve of a measured signal in the style of the log of this number; raises Missing without values."""
    inside = within(measured.t, window) & ~np.isnan(measured.values)
    if not inside.any():
        raise Missing(f"'{measured.column}' was not measured between {window.start:g} and {window.end:g} s")
    t, values = measured.t[inside], measured.values[inside]
    envelope = TimeEnvelope(float(t[0]), float(t[-1]), 1, CURVE)
    envelope.add(t, values[:, None])
    x, y = envelope.curve(0)
    return LabelledCurve(f"{measured.column}, measured", measured.unit, x, y, number, measured.signal)


def _maps(
    run: RunData, signals: Sequence[str], window: Window, frequency: bool, order: bool, place: bool, several: bool
) -> Iterator[SignalMap]:
    """Families of a log as maps; raises BadInput for a signal without a family."""
    for pattern in signals:
        for topic, columns, t in _chosen(run, [pattern], window):
            names = [run.log.name(topic, column) for column in columns]
            key, members = _family(names, pattern)
            unit = run.log.topics[topic].units[columns[0]]
            title = key + (f", {run.log.path.stem}" if several else "")
            y = np.array(members, float)
            number = _member(names[0])
            if place:
                x, y, values, parts = _by_place(run, names[0], window, -(-len(t) // MAP))
                yield SignalMap(title, PLACE, x, y, values, unit, parts)
            elif frequency:
                spectra = spectrum.of(run, names, window, orders=order)
                x = spectra.order if order else spectra.frequency
                yield SignalMap(title, number, x[1:], y, spectra.amplitude[1:].T, unit)
            else:
                x, values = _means(run, topic, columns, window, -(-len(t) // MAP))
                yield SignalMap(title, number, x, y, values.T, unit)


def _family(names: Sequence[str], pattern: str) -> tuple[str, list[int]]:
    """Name and members of a family of signals; raises BadInput for others."""
    keys, members = zip(*map(family, names), strict=True)
    if None in members or len(set(keys)) != 1:
        raise BadInput(f"'{pattern}' is no family of signals as left_track.link[*].tension: it makes no map")
    if len(names) < 2:
        raise BadInput(f"'{pattern}' is a single signal: it makes no map")
    return keys[0], list(members)


def _means(run: RunData, topic: str, columns: list[int], window: Window, stride: int) -> tuple[Floats, Floats]:
    """Times and means of ``stride`` records at a time."""
    times, values = [], []
    for block in run.log.blocks({topic: columns}, stride * 100, window=window):
        if len(block[topic].t):
            t, mean = _grouped(block[topic].t, block[topic].values, stride)
            times.append(t)
            values.append(mean)
    return np.concatenate(times), np.concatenate(values)


def _grouped(t: Floats, values: Floats, stride: int) -> tuple[Floats, Floats]:
    starts = np.arange(0, len(t), stride)
    counts = np.diff(np.append(starts, len(t)))
    return np.add.reduceat(t, starts) / counts, np.add.reduceat(values, starts, axis=0) / counts[:, None]


def _by_place(
    run: RunData, name: str, window: Window, stride: int
) -> tuple[Floats, Floats, Floats, tuple[circuit.Stretch, ...]]:
    """Times (k,), places (n,), m, values (n, k) of the family of a signal of links or pins, and parts of the circuit.

    The parts are those of the first record.
    """
    track, signal = _on_circuit(run, name)
    times, values, lengths, parts = [], [], [], None
    for block in circuit.records(run, track, window, signal):
        if parts is None:
            order = np.argsort(block.links[0])
            parts = circuit.stretches(run.scene, block.links[0, order], block.centres[0, order])
        where = block.joints if signal.startswith("joint") else block.links
        n = where.shape[1]
        share = where / block.length[:, None]
        places = (np.arange(n) + 0.5) / n
        rows = [np.interp(places, *_closed_round(share[k], block.values[0][k])) for k in range(len(share))]
        t, mean = _grouped(block.t, np.array(rows), stride)
        times.append(t)
        values.append(mean)
        lengths.append(float(block.length.mean()))
    place = places * float(np.mean(lengths))
    return np.concatenate(times), place, np.concatenate(values).T, tuple(parts or ())


def _on_circuit(run: RunData, name: str) -> tuple[str, str]:
    """Track and signal of a name, "link[*].tension"; raises BadInput for a signal of no link or pin."""
    track, _, rest = name.partition(".")
    signal = family(rest)[0]
    if track not in run.tracks or not signal.startswith(("link[", "joint[")):
        raise BadInput(f"'{name}' is of no link or pin of a track: it has no place on a circuit")
    return track, signal


def _profiles(
    run: RunData, signals: Sequence[str], at: Sequence[float], number: int, several: bool
) -> Iterator[tuple[LabelledCurve, list[circuit.Stretch]]]:
    """Families of a log over the place on the circuit, in the records nearest to some times, s; parts of the circuit.

    Raises BadInput for a signal without a family or a place, Missing.
    """
    for pattern in signals:
        for topic, columns, t in _chosen(run, [pattern], EVER):
            names = [run.log.name(topic, column) for column in columns]
            key, _ = _family(names, pattern)
            track, signal = _on_circuit(run, names[0])
            for moment in at:
                nearest = float(t[np.abs(t - moment).argmin()])
                block = next(circuit.records(run, track, Window(nearest, nearest), signal))
                where = (block.joints if signal.startswith("joint") else block.links)[0]
                order, links = np.argsort(where), np.argsort(block.links[0])
                parts = circuit.stretches(run.scene, block.links[0, links], block.centres[0, links])
                label = f"{key} at {nearest:.4g} s" + (f", {run.log.path.stem}" if several else "")
                unit = run.log.topics[topic].units[columns[0]]
                yield LabelledCurve(label, unit, where[order], block.values[0][0, order], number, key), parts


def _draw_profiles(figure: Figure, logs: Sequence[Path], signals: Sequence[str], at: Sequence[float]) -> None:
    """Draw families over the place on the circuit at some instants, with the parts of the first one."""
    drawn = []
    for number, path in enumerate(logs):
        with Log(path) as log:
            drawn += [*_profiles(RunData(log), signals, at, number, len(logs) > 1)]
    _draw_curves(figure, [curve for curve, _ in drawn], PLACE, False)
    pane = figure.axes[0]
    for part in drawn[0][1]:
        pane.axvline(part.start, color="0.6", linewidth=0.6)
        pane.annotate(
            part.name, (part.middle, 1.0), (0, 3), xycoords=("data", "axes fraction"), textcoords="offset points",
            fontsize=7, ha="center",
        )  # fmt: skip


def _closed_round(share: Floats, values: Floats) -> tuple[Floats, Floats]:
    """Sorted places and values of a circuit, with the first and last one repeated at the other end."""
    order = np.argsort(share)
    x, y = share[order], values[order]
    return np.concatenate([[x[-1] - 1.0], x, [x[0] + 1.0]]), np.concatenate([[y[-1]], y, [y[0]]])


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
    top = max(_largest(curve.y) for curve in curves)
    size, shown = scaled(top, unit)
    names = list(dict.fromkeys(curve.signal for curve in curves))
    many = len(curves) > LEGEND
    colours = _colours(len(names))
    for number, curve in enumerate(curves):
        style = STYLES[curve.log % 4][0] if len(names) > 1 else "-"
        pane.plot(
            curve.x, curve.y / size, style, color=colours[names.index(curve.signal)] if many else f"C{number}",
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
        logs = ", ".join(
            f"{name} {('solid', 'dashed', 'dotted', 'dash-dotted')[style]}" for style, name in styles if name
        )
        pane.set_title(f"{len(curves)} curves{': ' * bool(logs)}{logs}", fontsize=9, loc="left", parse_math=False)


def _common(names: Sequence[str]) -> str:
    """Common part of the names of signals: a family or an ending; else empty."""
    families = {family(name)[0] for name in names}
    if len(names) == 1 or len(families) == 1:
        return names[0] if len(names) == 1 else families.pop()
    words = [name.split(".")[::-1] for name in names]
    alike = list(takewhile(lambda each: len(set(each)) == 1, zip(*words, strict=False)))
    return ".".join(each[0] for each in alike[::-1])


def _colours(count: int) -> list[Any]:
    import matplotlib

    return [*matplotlib.colormaps["viridis"](np.linspace(0.0, 0.95, count))]


def _bar(figure: Figure, pane: Axes, names: list[str]) -> bool:
    """Draw a colour bar for the members of a family; False if the signals are not one family."""
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize

    keys, numbers = zip(*map(family, names), strict=True)
    if len(set(keys)) != 1 or None in numbers:
        return False
    scale = ScalarMappable(Normalize(min(numbers), max(numbers)), "viridis")
    figure.colorbar(scale, ax=pane, label=f"number of the {_member(names[0])}")
    return True


def _member(name: str) -> str:
    """Name of the members of a family: "link"."""
    return name.partition("[")[0].rpartition(".")[2].replace("_", " ")


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
            pane.annotate(
                part.name,
                (0.0, part.middle),
                (3, 0),
                xycoords=("axes fraction", "data"),
                textcoords="offset points",
                fontsize=7,
                color="1.0",
                va="center",
            )
    panes[-1].set_xlabel(x_label)


def _largest(values: Floats) -> float:
    finite = values[np.isfinite(values)]
    return float(np.abs(finite).max()) if len(finite) else 0.0
