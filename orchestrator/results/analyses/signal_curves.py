"""Signals of a log as curves and maps for pictures: over time, frequency, tooth order or place on the circuit.

A picture shows some thousand instants. Longer records are reduced to the least and largest value of equal intervals
of time (curves, ``approximations.py``) or to means of several records (maps), so a long log needs little memory.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from fmus.vehicles.tables import BadInput
from orchestrator.log.angles import Continuous
from orchestrator.log.reader import Missing
from orchestrator.log.schema import family
from orchestrator.log.time_series import Floats
from orchestrator.results.analyses import circuit, spectrum
from orchestrator.results.approximations import TimeEnvelope
from orchestrator.results.measured_record import MeasuredSignal
from orchestrator.results.run_data import BLOCK, EVER, RunData, Window, within

CURVE, MAP = 2000, 1500  # intervals of time of a curve, instants of a map
PLACE = "along the chain from the sprocket, m"


class LabelledCurve(NamedTuple):
    """Signal of a log."""

    label: str
    unit: str
    x: Floats  # (k,)
    y: Floats  # (k,)
    log: int  # number of its log
    signal: str
    measured: bool = False


class SignalMap(NamedTuple):
    """Family of signals of a log."""

    title: str
    label: str  # label of y
    x: Floats  # (k,)
    y: Floats  # (n,)
    values: Floats  # (n, k)
    unit: str
    parts: tuple[circuit.Stretch, ...] = ()  # named parts of y


def _chosen(run: RunData, signals: Sequence[str], window: Window) -> Iterator[tuple[str, list[int], Floats]]:
    """Topic, columns and times (m,) of the signals; raises Missing without records."""
    for topic, columns in run.log.choose(signals).items():
        t = run.log.select({topic: []}, window)[topic].t
        if not len(t):
            raise Missing(f"{run.log.path} holds no records on {topic} between {window.start:g} and {window.end:g} s")
        if not np.isfinite(t).all():
            raise Missing(f"{run.log.path}: times of {topic} are no finite numbers: there is nothing to draw")
        yield topic, columns, t


def curves(
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
    angles = Continuous([run.log.topics[topic].units[column] for column in columns])
    for block in run.log.blocks({topic: columns}, BLOCK, window=window):
        envelope.add(block[topic].t, angles(block[topic].values))
    return [(curve.t, curve.y) for curve in map(envelope.curve, range(len(columns)))]


def measured_curve(measured: MeasuredSignal, window: Window, number: int) -> LabelledCurve:
    """Curve of a measured signal in the style of the log of this number; raises Missing without values."""
    inside = within(measured.t, window) & ~np.isnan(measured.values)
    if not inside.any():
        raise Missing(f"'{measured.column}' was not measured between {window.start:g} and {window.end:g} s")
    t, values = measured.t[inside], measured.values[inside]
    envelope = TimeEnvelope(float(t[0]), float(t[-1]), 1, CURVE)
    envelope.add(t, values[:, None])
    x, y = envelope.curve(0)
    return LabelledCurve(f"{measured.column}, measured", measured.unit, x, y, number, measured.signal, measured=True)


def maps(
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
            number = member(names[0])
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
        parts = block.stretches(run.scene) if parts is None else parts
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


def profiles(
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
                order, parts = np.argsort(where), block.stretches(run.scene)
                label = f"{key} at {nearest:.4g} s" + (f", {run.log.path.stem}" if several else "")
                unit = run.log.topics[topic].units[columns[0]]
                yield LabelledCurve(label, unit, where[order], block.values[0][0, order], number, key), parts


def _closed_round(share: Floats, values: Floats) -> tuple[Floats, Floats]:
    """Sorted places and values of a circuit, with the first and last one repeated at the other end."""
    order = np.argsort(share)
    x, y = share[order], values[order]
    return np.concatenate([[x[-1] - 1.0], x, [x[0] + 1.0]]), np.concatenate([[y[-1]], y, [y[0]]])


def member(name: str) -> str:
    """Name of the members of a family: "link"."""
    return name.partition("[")[0].rpartition(".")[2].replace("_", " ")
