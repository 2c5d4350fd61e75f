"""Section with the spectra of torque and tension by tooth order, of the longest phase at constant speed."""

from __future__ import annotations

from functools import partial
from itertools import pairwise

import numpy as np

from orchestrator.log.time_series import Floats
from orchestrator.results.analyses import hull, spectrum
from orchestrator.results.analyses.phases import Phase, phase_name
from orchestrator.results.analyses.spectrum import Spectrum
from orchestrator.results.page.charts import Trace, lines
from orchestrator.results.page.evaluation import Evaluation, attempt
from orchestrator.results.page.section import Content, PageSection, Pair
from orchestrator.results.page.words import quantity, side, text
from orchestrator.results.run_data import Window, mean
from orchestrator.results.thinned import Curve
from orchestrator.results.units import number, percent

HIGHEST = 8.0  # tooth order that is drawn
SLOW = 0.5  # tooth order: below it are motions of the hull
COVERED = 1e-2  # of the largest amplitude: the curve of one side covers that of the other
CONSTANT = 0.01  # of the mean speed: tolerance of a constant speed
RIPPLE = 2.0  # tooth passings: averaging time of the sprocket's speed
PASSINGS = 8.0  # of teeth: a phase with fewer resolves no orders


def orders(pair: Pair) -> PageSection | None:
    """Section of the tooth orders; None without a phase at constant speed with enough teeth that pass."""
    run, content = pair.run, Content()
    phase = constant_speed(run)
    if phase is None:
        return None
    tensions = [f"{track}.tension.max" for track in run.run.tracks]
    for key, title, signals in (
        ("torque", "Torque of the drives", [f"{prefix}torque" for prefix in run.drives]),
        ("tension", "Largest link tension", tensions),
    ):
        if spectra := _spectra(run, signals):
            drawn = _traces(signals, spectra)
            if pair.reference:
                drawn += _traces(signals, _spectra(pair.reference, [*spectra]), reference=True)
            chart = lines("amplitude", next(iter(spectra.values())).units[0], drawn, x="tooth order", timed=False)
            content.add_figure(f"{key}-orders", chart, title, _largest(spectra, several=len(signals) > 1))
    section = content.as_section("orders", "Tooth orders", "What do the teeth excite?")
    note = (
        f"Amplitudes in the longest phase at constant speed, {text(phase_name(phase))}, while the sprocket of a signal"
    )
    note += f" keeps its mean speed to {percent(CONSTANT)}: {_intervals(run, [*run.drives, *tensions])}."
    note += " Order 1 is one tooth that passes."
    return section._replace(html=f"<p class='muted'>{note}</p>{section.html}") if section else None


def constant_speed(evaluation: Evaluation) -> Phase | None:
    """Longest phase of motion at constant speed; None without one."""
    held = [phase for phase in evaluation.phases if phase.kind in ("steady", "turn")]
    return max(held, key=lambda phase: phase.end - phase.start, default=None)


def _intervals(evaluation: Evaluation, signals: list[str]) -> str:
    """Intervals of the spectra of signals, "left 2.6 to 6 s, right 2.7 to 6 s"; one if all are alike."""
    windows = {side(name): steady_window(evaluation, name) for name in signals if evaluation.run.has(name)}
    texts = {name: f"{number(each.start)} to {number(each.end)} s" for name, each in windows.items() if each}
    if len({*texts.values()}) == 1:
        return next(iter(texts.values()))
    return ", ".join(f"{text(name)} {span}" for name, span in texts.items())


def steady_window(evaluation: Evaluation, signal: str) -> Window | None:
    """Longest part of the longest phase at constant speed in which a signal's sprocket keeps its mean speed.

    A phase of the hull may include ramps of the sprockets. None without a phase or a sprocket.
    """
    phase = constant_speed(evaluation)
    if phase is None:
        return None
    run, window = evaluation.run, Window(phase.start, phase.end)
    return attempt(
        lambda: longest_constant(
            *run.signal(hull.sprocket_speed(run, signal), window),
            RIPPLE / spectrum.tooth_passing_frequency(run, signal, window),
        ),
        evaluation.missing,
    )


def longest_constant(t: Floats, speed: Floats, slice_length: float) -> Window:
    """Longest interval in which means of a speed (m,) over slices, s, stay within CONSTANT of the interval's mean.

    Slices of some tooth passings leave out the ripple of a sprocket's speed.
    """
    edges = np.linspace(t[0], t[-1], max(2, int((t[-1] - t[0]) / slice_length) + 1))
    slices = [(a, b) for a, b in pairwise(np.searchsorted(t, edges)) if b > a]
    level = np.array([mean(t[a:b], speed[a:b]) for a, b in slices])
    best = 0, 0
    first = 0
    for last in range(len(level)):
        while np.abs(level[first : last + 1] - level[first : last + 1].mean()).max() > CONSTANT * abs(level[last]):
            first += 1
        best = max(best, (first, last + 1), key=lambda pair: pair[1] - pair[0])
    return Window(float(t[slices[best[0]][0]]), float(t[slices[best[1] - 1][1] - 1]))


def _spectra(evaluation: Evaluation, signals: list[str]) -> dict[str, Spectrum]:
    """Spectra of signals while their sprocket keeps its speed, of those for which enough teeth pass."""
    spectra = {}
    for signal in filter(evaluation.run.has, signals):
        window = steady_window(evaluation, signal)
        found = window and attempt(
            partial(spectrum.of, evaluation.run, signal, window, orders=True), evaluation.missing
        )
        if window and found and found.teeth * (window.end - window.start) >= PASSINGS:
            spectra[signal] = found
    return spectra


def _traces(signals: list[str], spectra: dict[str, Spectrum], reference: bool = False) -> list[Trace]:
    """Traces of spectra up to HIGHEST, in the colours of all signals' places."""
    traces: list[Trace] = []
    tops = [found.peak(SLOW * found.teeth)[1] for found in spectra.values()]
    covered = len(tops) == 2 and not reference and max(tops) - min(tops) <= COVERED * max(tops)
    for signal, found in spectra.items():
        drawn = slice(1, int((found.order <= HIGHEST).sum()))
        curve = Curve(found.order[drawn], found.amplitude[drawn, 0])
        name = f"{side(signal.partition('.tension')[0])}{', reference' * reference}"
        traces.append(Trace(name, curve, signals.index(signal), reference=reference, behind=covered and not traces))
    return traces


def _largest(spectra: dict[str, Spectrum], several: bool) -> str:
    """Sentence on the largest amplitude, of one of several signals; HTML."""
    peaks = {signal: found.peak(SLOW * found.teeth) for signal, found in spectra.items()}
    signal = max(peaks, key=lambda name: peaks[name][1])
    (frequency, amplitude), found = peaks[signal], spectra[signal]
    place = f", {text(side(signal))}" if several else ""
    return (
        f"Largest: {quantity(amplitude, found.units[0])} at order {number(frequency / found.teeth, 3)},"
        f" {number(frequency)} Hz{place}."
    )
