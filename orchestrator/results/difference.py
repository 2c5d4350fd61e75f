"""Difference of two runs of a scene by observable, in one norm.

The norm is relative: RMS over time of the difference, divided by the RMS over time of the reference, or by a floor if
that is larger. A sample counts for the time since the one before it, so steps may vary. Positions count from their
start. Link tensions and joint forces are sensitive (errors grow some 15-fold per second at speed): they are compared
by mean and RMS over windows of a second, and link by link only up to ``POINTWISE`` s. A log holds joint forces as means
over its own interval of records; the RMS of means depends on that interval, so both are brought to INTERVAL first.
Where one log has records of links at some of the instants of the other, only these count in both.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from itertools import chain, pairwise
from pathlib import Path
from typing import NamedTuple

import numpy as np

from fmus.vehicles.tables import BadInput
from orchestrator.log.reader import Log, Missing
from orchestrator.log.time_series import within
from orchestrator.results.run_data import EVER, UNANSWERED, Floats, RunData, Window, given_parts, record_durations

FORMS = "time, travel or SIGNAL=VALUE"


class Alignment(NamedTuple):
    """Map from the time of a run to the axis of the comparison."""

    unit: str
    clock: Callable[[RunData], Callable[[Floats], Floats]]  # run -> (times (m,), s -> places (m,)); raises Missing


def alignment(text: str) -> Alignment:
    """Alignment by name: "time", "travel" or "SIGNAL=VALUE".

    Travel is the mean of the tracks, m. "SIGNAL=VALUE" counts time from the first instant at which the signal passes
    the value. Raises BadInput.
    """
    if text == "time":
        return TIME
    if text == "travel":
        return Alignment("m", _travel_clock)
    signal, _, number = text.rpartition("=")
    try:
        value = float(number)
    except ValueError:
        value = np.nan
    if not signal or not np.isfinite(value):
        raise BadInput(f"align = {text}: must be {FORMS}")
    return Alignment("s", lambda run: _event_clock(run, signal, value))


TIME = Alignment("s", lambda run: lambda t: t)


def _travel_clock(run: RunData) -> Callable[[Floats], Floats]:
    if not run.tracks:
        raise Missing(f"{run.log.path} has no track whose travel runs could be compared along")
    travels = [run.signal(f"{track}.travel", EVER) for track in run.tracks]
    t = min((t_of_track for t_of_track, _ in travels), key=len)
    travel = np.mean([abs(values[: len(t)]) for _, values in travels], axis=0)
    return lambda times: np.interp(times, t, travel)


def _event_clock(run: RunData, signal: str, value: float) -> Callable[[Floats], Floats]:
    t, values = run.signal(signal, EVER)
    above = values >= value
    passed = np.flatnonzero(above[1:] != above[:-1])
    if not len(passed):
        raise Missing(f"'{signal}' of {run.log.path} never passes {value:g}")
    k = passed[0]
    event = t[k] + (value - values[k]) / (values[k + 1] - values[k]) * (t[k + 1] - t[k])
    return lambda times: times - event


WINDOW = 1.0  # s
INTERVAL = 0.01  # s: joint forces are compared as means over this time; sparser logs as they are
SAME_END = 1e-6  # s: runs whose ends differ by less have one length
POINTWISE = 4.0  # s: sensitive observables are compared instant by instant up to here
EARLY = Window(-np.inf, POINTWISE)


class ObservableSamples(NamedTuple):
    """Values of an observable, k numbers at each time."""

    t: Floats  # (m,) s
    values: Floats  # (m, k)
    mean: bool = False  # the values are means since the last sample
    from_start: bool = False  # the values count from those of the first compared instant


class Observable(NamedTuple):
    """Quantity by which runs are compared."""

    unit: str
    floor: float  # lower bound of the reference size, in ``unit``
    read: Callable[..., ObservableSamples]  # (run, every): of links only every so many records
    decisive: bool = True  # counts towards the error of the run as a whole
    windowed: bool = False  # averages over windows of time, which cannot be aligned otherwise


class ObservableDifference(NamedTuple):
    """Difference of one observable between a run and a reference."""

    absolute: float  # RMS, in the observable's unit
    relative: float
    unit: str
    decisive: bool
    by_window: tuple[float, ...] = ()  # of averages: difference in each window


def differences(
    run: RunData, reference: RunData, window: Window = EVER, alignment: Alignment = TIME
) -> dict[str, ObservableDifference]:
    """Differences of all common observables over a window of the axis; raises Missing for none.

    Of runs of different lengths, averages over windows of time that the shorter one does not fill are left out.
    """
    found = {}
    ends = run.span[1], reference.span[1]
    filled = window if abs(ends[0] - ends[1]) < SAME_END else Window(window.start, min(window.end, *ends))
    clocks, strides = (alignment.clock(run), alignment.clock(reference)), _strides(run, reference)
    for name, observable in observables(reference):
        if observable.windowed and alignment is not TIME:
            continue
        try:
            pair = tuple(
                each.compute_once(f"observable {name} {every}", partial(observable.read, every=every))
                for each, every in zip((run, reference), strides, strict=True)
            )
            if alignment is not TIME:
                pair = _on_axis(pair[0], clocks[0]), _on_axis(pair[1], clocks[1])
            if pair[0].values.shape[1:] == pair[1].values.shape[1:]:  # half a vehicle has fewer links
                a, b = (_within(each, filled if observable.windowed else window) for each in pair)
                with np.errstate(all="ignore"):  # runs that blew up overflow; their result shows it
                    found[name] = difference(a, b, observable)
        except UNANSWERED:
            continue
    if not found:
        raise Missing("the two logs have no observable in common, or no time")
    return found


def differences_of_logs(run: Path, reference: Path) -> dict[str, ObservableDifference]:
    """Differences of two logs by observable; raises Missing, LogUnreadable."""
    with Log(run) as run_log, Log(reference) as reference_log:
        return differences(RunData(run_log), RunData(reference_log))


def worst(by_observable: dict[str, ObservableDifference]) -> float:
    """Largest relative error of the decisive observables."""
    return max(
        observable_difference.relative
        for observable_difference in by_observable.values()
        if observable_difference.decisive
    )


def difference(run: ObservableSamples, reference: ObservableSamples, observable: Observable) -> ObservableDifference:
    """RMS difference over the common time, absolute and relative; raises Missing without common time."""
    t = instants(run, reference)
    if len(t) <= run.mean:
        raise Missing("the two logs have no time in common")
    a, b = aligned(run, reference)
    lengths = np.diff(t) if run.mean else record_durations(t)
    absolute = rms(a - b, lengths)
    relative = absolute / max(rms(b, lengths), observable.floor)
    by_window = tuple((a - b).ravel().tolist()) if observable.windowed else ()
    return ObservableDifference(absolute, relative, observable.unit, observable.decisive, by_window)


def _on_axis(signal: ObservableSamples, clock: Callable[[Floats], Floats]) -> ObservableSamples:
    """A signal over the clock of the alignment, as far as that increases."""
    places = clock(signal.t)
    increasing = np.diff(np.maximum.accumulate(places), prepend=-np.inf) > 0.0
    return signal._replace(t=places[increasing], values=signal.values[increasing], mean=False)


def _within(signal: ObservableSamples, window: Window) -> ObservableSamples:
    """Samples within a window."""
    if window == EVER:
        return signal
    inside = within(signal.t, window)
    return signal._replace(t=signal.t[inside], values=signal.values[inside])


def aligned(run: ObservableSamples, reference: ObservableSamples) -> tuple[Floats, Floats]:
    """Values of both signals at the instants of the sparser one: interpolated, or means between instants."""
    t = instants(run, reference)
    a, b = _sampled(run, t), _sampled(reference, t)
    return (a - a[:1], b - b[:1]) if reference.from_start else (a, b)


def instants(run: ObservableSamples, reference: ObservableSamples) -> Floats:
    """Instants of the sparser signal in the common time; raises Missing for a signal without samples."""
    if not len(run.t) or not len(reference.t):
        raise Missing("a log holds no step")
    common = Window(max(run.t[0], reference.t[0]), min(run.t[-1], reference.t[-1]))
    a, b = (signal.t[within(signal.t, common)] for signal in (run, reference))
    return a if len(a) <= len(b) else b


def _sampled(signal: ObservableSamples, t: Floats) -> Floats:
    if not signal.mean:
        return np.stack([np.interp(t, signal.t, column) for column in signal.values.T], axis=1)
    integrals = np.vstack([np.zeros_like(signal.values[:1]), signal.values[1:] * np.diff(signal.t)[:, None]])
    total = np.cumsum(integrals, axis=0)
    sums = np.stack([np.interp(t, signal.t, column) for column in total.T], axis=1)
    return np.diff(sums, axis=0) / np.diff(t)[:, None]


def rms(values: Floats, lengths: Floats) -> float:
    """RMS over time of the norms of rows."""
    return float(np.sqrt(np.average(np.sum(values**2, axis=1), weights=lengths)))


# --- observables -----------------------------------------------------------------------------------


def observables(run: RunData) -> Iterator[tuple[str, Observable]]:
    """Observables of this kind of run."""
    if "chassis" in run.instances:
        yield "position", Observable("m", 0.1, lambda run, every: _of_hull(run, "position")._replace(from_start=True))
        yield "velocity", Observable("m/s", 0.1, lambda run, every: _of_hull(run, "velocity"))
        yield "pitch", Observable("rad", 0.01, lambda run, every: _signals(run, ["chassis.pitch"]))
    drives = [name for name in (*run.instances, *map(run.drive, run.sides)) if run.has(f"{name}.torque")]
    if drives:
        torques = [f"{drive}.torque" for drive in dict.fromkeys(drives)]
        yield "torque", Observable("N m", 100.0, lambda run, every: _signals(run, torques, mean=True))
    if not run.tracks:
        return
    if not drives:  # a chain without drives: each pin
        yield "pins", Observable("m", 0.01, _pins)
        yield "tension", Observable("N", 100.0, _tension)
        return
    if "chassis" not in run.instances:
        names = [f"{track}.speed" for track in run.tracks]
        yield "chain_speed", Observable("m/s", 0.01, lambda run, every: _signals(run, names))
    yield "tension_mean", Observable("N", 100.0, _mean_tension, windowed=True)
    statistics = (
        ("tension", _tension, "rms"),
        ("joint_force", _joint_force, "mean"),
        ("joint_force", _joint_force, "rms"),
    )
    for name, read, statistic in statistics:
        own = partial(_windowed, name, read, statistic == "rms")
        yield f"{name}_{statistic}", Observable("N", 100.0, own, windowed=True)
    yield "tension", Observable("N", 100.0, partial(_tension, window=EARLY), decisive=False)
    yield "joint_force", Observable("N", 100.0, partial(_joint_force, window=EARLY), decisive=False)


def _strides(run: RunData, reference: RunData) -> tuple[int, int]:
    """Records of links from one that counts to the next, in both logs: more than 1 where the other one is sparser."""
    try:
        ratio = _interval(reference) / _interval(run) if run.tracks and reference.tracks else np.nan
    except UNANSWERED:
        ratio = np.nan
    if not np.isfinite(ratio):
        return 1, 1
    own, other = (n if n and abs(each / n - 1.0) < 1e-6 else 1 for each in (ratio, 1.0 / ratio) for n in [round(each)])
    return own, other


def _interval(run: RunData) -> float:
    """Time between two records of links, s; NaN where it varies. Raises Missing."""
    lengths = np.diff(run.compute_once("times of links", _times))
    return float(lengths[0]) if len(lengths) and np.allclose(lengths[:-1], lengths[0], 0.0, 1e-9) else np.nan


def _signals(run: RunData, names: list[str], mean: bool = False) -> ObservableSamples:
    return _side_by_side([(t, values[:, None]) for t, values in (run.signal(name, EVER) for name in names)], mean)


def _side_by_side(parts: list[tuple[Floats, Floats]], mean: bool = False) -> ObservableSamples:
    """Columns of several topics side by side; after a cut-off one topic may be shorter."""
    if not parts or not all(values.shape[1] for _, values in parts):
        raise Missing("nothing of the kind was recorded")
    m = min(len(t) for t, _ in parts)
    if m < 2:
        raise Missing("the log holds no step")
    first = parts[0][0][:m]
    if not all(np.array_equal(t[:m], first) for t, _ in parts):
        raise Missing("the log holds different steps of its components")
    return ObservableSamples(first, np.hstack([values[:m] for _, values in parts]), mean)


def _of_hull(run: RunData, vector: str) -> ObservableSamples:
    return _side_by_side([run.vectors("chassis", "out", f"chassis.{vector}", window=EVER)])


def _links(run: RunData, window: Window, start: str, *ends: str) -> list[ObservableSamples]:
    """Outputs of links of all tracks by the beginning and ending of their names, one signal per ending."""
    columns_of_ends = {}
    for track in run.tracks:
        topic, names = run.link_outputs(track)
        columns_of_ends[topic] = [
            [i for i, n in enumerate(names) if n.startswith(start) and n.endswith(end)] for end in ends
        ]
    series = run.log.select({topic: [*chain(*groups)] for topic, groups in columns_of_ends.items()}, window)
    parts = {
        topic: np.split(series[topic].values, np.cumsum([len(columns) for columns in groups])[:-1], axis=1)
        for topic, groups in columns_of_ends.items()
    }
    return [
        _side_by_side([(series[topic].t, parts[topic][number]) for topic in columns_of_ends])
        for number in range(len(ends))
    ]


def _axes(run: RunData, what: str, window: Window) -> list[ObservableSamples]:
    """Signals ``joint[i].what`` along x, y and z."""
    parts = _links(run, window, "joint[", *(f"].{what}.{axis}" for axis in "xyz"))
    if len({part.values.shape for part in parts}) > 1:
        raise Missing(f"the log does not have three of 'joint[i].{what}' each")
    return parts


def _pins(run: RunData, every: int) -> ObservableSamples:
    parts = _axes(run, "position", EVER)
    return ObservableSamples(parts[0].t[::every], np.hstack([part.values[::every] for part in parts]), from_start=True)


def _tension(run: RunData, every: int, window: Window = EVER) -> ObservableSamples:
    samples = _links(run, window, "link[", "].tension")[0]
    return samples._replace(t=samples.t[::every], values=samples.values[::every])


def _joint_force(run: RunData, every: int, window: Window) -> ObservableSamples:
    """Magnitudes of the mean joint forces over each INTERVAL, or longer one of records; the first record as it is."""
    parts = _axes(run, "force", window)
    (begin, end), own = parts[0].t[[0, -1]], _interval(run)
    interval = max(INTERVAL, every * own) if own == own else INTERVAL
    t = begin + interval * np.arange(int((end - begin) / interval + 1e-6) + 1)
    if len(t) < 2:
        raise Missing(f"the log holds less than {interval:g} s")
    means = [np.vstack([part.values[:1], _sampled(part._replace(mean=True), t)]) for part in parts]
    return ObservableSamples(t, np.sqrt(sum(mean**2 for mean in means)))


ReadWindow = Callable[[RunData, int, Window], ObservableSamples]


def _mean_tension(run: RunData, every: int) -> ObservableSamples:
    """Mean over the links of each track and over windows of time, by the trapezoidal rule from its own output.

    Records of links are too sparse for the waves along cables, whose aliases differ from step to step.
    """
    from scipy.integrate import cumulative_trapezoid  # which takes half a second to load

    samples = _signals(run, [f"{track}.tension.mean" for track in run.tracks])
    edges = samples.t[0] + _edges(samples.t)
    ends = np.minimum(edges, samples.t[-1])
    integrals = cumulative_trapezoid(samples.values, samples.t, axis=0, initial=0.0)
    at_ends = np.stack([np.interp(ends, samples.t, column) for column in integrals.T], axis=1)
    return ObservableSamples(edges[1:], np.diff(at_ends, axis=0) / np.diff(ends)[:, None])


def _edges(t: Floats) -> Floats:
    """Edges of the windows of time, s from the start; a last one of less than half the length is left out."""
    return WINDOW * np.arange(max(1, round((t[-1] - t[0]) / WINDOW)) + 1.0)


def _windowed(name: str, read: ReadWindow, is_rms: bool, run: RunData, every: int) -> ObservableSamples:
    """Mean or RMS of an observable over windows of time."""
    return run.compute_once(f"windows of {name} {every}", lambda run: _mean_and_rms(run, read, every))[is_rms]


def _mean_and_rms(run: RunData, read: ReadWindow, every: int) -> tuple[ObservableSamples, ObservableSamples]:
    """Mean and RMS over all links and the samples of each window of time.

    One window is in memory at a time.
    """
    t = run.compute_once("times of links", _times)[::every]
    if len(t) < 2:
        raise Missing("the log holds no step")
    edges = t[0] + _edges(t)
    means, squares = [], []
    for low, high in pairwise(edges):
        inside = np.flatnonzero((t > low + 1e-9) & (t <= high + 1e-9))
        if not len(inside):
            raise Missing(f"nothing was recorded between {low:g} and {high:g} s")
        samples = read(run, every, Window(float(t[inside[0] - 1]), float(t[inside[-1]])))
        lengths, values = np.diff(samples.t), samples.values[1:]
        means.append(_mean(values, lengths))
        squares.append(_mean(values**2, lengths))
    return ObservableSamples(edges[1:], np.array(means)[:, None]), ObservableSamples(
        edges[1:], np.sqrt(squares)[:, None]
    )


def _times(run: RunData) -> Floats:
    """Times at which all tracks have link outputs (m,)."""
    found = run.log.select({f"/{track}/links": [] for track in run.tracks})
    return min((series.t for series in found.values()), key=len)


def _mean(values: Floats, lengths: Floats) -> float:
    return float(np.average(values.mean(axis=1), weights=lengths))


def part_differences(run: RunData, reference: RunData) -> list[str]:
    """Sentences on parts that are another FMU in one of two runs of a scene, or have other parameters there."""
    pair = given_parts(run), given_parts(reference)
    hashes = [{each["name"]: each.get("sha256") for each in data.system["instances"]} for data in (run, reference)]
    sentences = []
    for name in dict.fromkeys([*pair[0], *pair[1]]):
        first, second = (parts.get(name) for parts in pair)
        if hashes[0].get(name) != hashes[1].get(name):
            files = (str(part) if part else "the part of cotrack" for part in (first, second))
            sentences.append(f"{name} is {' and '.join(files)}")
        elif first and second:
            for key in sorted(first.parameters.keys() | second.parameters.keys()):
                a, b = (part.parameters.get(key, "not given") for part in (first, second))
                sentences += [f"{name}: {key} = {a} and {b}"] if a != b else []
    return sentences
