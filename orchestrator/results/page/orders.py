"""Section with the spectra of torque and tension by tooth order, of the longest phase at constant speed."""

from __future__ import annotations

from orchestrator.results.analyses import spectrum
from orchestrator.results.analyses.phases import Phase, phase_name
from orchestrator.results.analyses.spectrum import Spectrum
from orchestrator.results.page.charts import Trace, lines
from orchestrator.results.page.evaluation import Evaluation, attempt
from orchestrator.results.page.section import Content, PageSection, Pair
from orchestrator.results.page.words import quantity, side, text
from orchestrator.results.run_data import Window
from orchestrator.results.thinned import Curve
from orchestrator.results.units import number

HIGHEST = 8.0  # tooth order that is drawn
SLOW = 0.5  # tooth order: below it are motions of the hull
COVERED = 1e-2  # of the largest amplitude: the curve of one side covers that of the other
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
    name, span = text(phase_name(phase)), f"{number(phase.start)} to {number(phase.end)} s"
    section = content.as_section("orders", "Tooth orders", "What do the teeth excite?")
    note = f"Amplitudes in the longest phase at constant speed: {name}, {span}. Order 1 is one tooth that passes."
    return section._replace(html=f"<p class='muted'>{note}</p>{section.html}") if section else None


def constant_speed(evaluation: Evaluation) -> Phase | None:
    """Longest phase of motion at constant speed; None without one."""
    held = [phase for phase in evaluation.phases if phase.kind in ("steady", "turn")]
    return max(held, key=lambda phase: phase.end - phase.start, default=None)


def _spectra(evaluation: Evaluation, signals: list[str]) -> dict[str, Spectrum]:
    """Spectra of signals in the longest phase at constant speed, of those whose sprocket passes enough teeth."""
    phase = constant_speed(evaluation)
    if phase is None:
        return {}
    window, spectra = Window(phase.start, phase.end), {}
    for signal in filter(evaluation.run.has, signals):
        found = attempt(
            lambda signal=signal: spectrum.of(evaluation.run, signal, window, orders=True),  # type: ignore[misc]
            evaluation.missing,
        )
        if found and found.teeth * (phase.end - phase.start) >= PASSINGS:
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
