"""Sections of the chain: tension over time, along it and by link; spectra by tooth order; fatigue."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from itertools import pairwise

import numpy as np

from orchestrator.log.time_series import Floats
from orchestrator.results.analyses import fatigue as analysis
from orchestrator.results.analyses import hull, link_loads, profile, record_blocks, spectrum
from orchestrator.results.analyses.fatigue import FIBRES, TrackFatigue
from orchestrator.results.analyses.link_loads import LinkLoads
from orchestrator.results.analyses.phases import Phase, phase_name
from orchestrator.results.analyses.profile import Profile
from orchestrator.results.analyses.spectrum import Spectrum
from orchestrator.results.approximations import Curve, Peak
from orchestrator.results.measures import OBSERVABLES
from orchestrator.results.page.embedded import at_time, instance, plain, quantity, side, text
from orchestrator.results.page.evaluation import Evaluation, attempt
from orchestrator.results.page.section import Content, PageSection, Pair, Trace, heat, lines, table
from orchestrator.results.run_data import Window, mean
from orchestrator.results.units import hours, number, percent
from orchestrator.vocabulary import and_list

INSTANTS = 4  # evenly spaced instants of profiles
CHOICE = """<label class="choice">shown: <select data-chart="tension-map"><option value="run">the run</option>
<option value="reference">the reference</option><option value="difference">run less reference</option>
</select></label>"""
BEARS = {"tension": "bore the most tension", "stress": "had the most stress", "force": "had the most force in its pin"}
NO_LINKS = "The record holds no outputs of single links: which link bore the most is not known."
LARGEST = (  # load, its name, unit, and the words before and after the number of its link
    ("tension", "largest tension in the records of links", "N", "in link", ""),
    ("stress", "largest stress", "Pa", "in link", ""),
    ("force", "largest force in a pin", "N", "where link", " begins"),
)
LOADS = (
    ("tension", "Tension", "N"),
    ("stress", "Axial stress of tension and bending, at its most stressed fibre", "Pa"),
    ("force", "Force in the pin where it begins", "N"),
)


def tension(pair: Pair) -> PageSection | None:
    """Section of the tension; None if no track recorded it."""
    evaluation, content = pair.run, Content()
    tracks = [track for track in evaluation.run.tracks if f"{track}.tension.max" in evaluation.signals]
    if tracks:
        drawn = pair.lines([(f"{track}.tension.max", f"largest, {plain(track)}") for track in tracks[:2]])
        drawn += pair.lines([(f"{track}.tension.mean", f"mean, {plain(track)}") for track in tracks[:2]], 2)
        chart, note = pair.over_time("tension", "N", drawn), "Over all links of a track, at every step."
        content.add_figure("tension", chart, "Largest and mean tension", note, "wide")
    if loads := evaluation.most_loaded:
        content.html += _largest_loads(evaluation)
        _along(evaluation, loads, content)
        _map(pair, loads, content)
        _bearers(evaluation, content)
    elif tracks:
        content.html += f"<p class='muted'>{NO_LINKS}</p>"
    title = "What does the chain bear?"
    return PageSection("tension", "Tension", title, content.html, content.charts) if content.charts else None


def _largest_loads(evaluation: Evaluation) -> str:
    """Sentences on the extreme loads of the links of all tracks, HTML."""
    sentences = [
        f"The {what} is {quantity(loads.most[load].value, unit)} {where} {loads.most[load].member} of"
        f" {instance(loads.track)}{ending} at {number(loads.most[load].t)} s"
        for load, what, unit, where, ending in LARGEST
        if (loads := evaluation.largest(load)) and (load == "tension" or loads.most[load].value > 0.0)
    ]
    if track := evaluation.slackest:
        slack = track.slackest
        pressed = ": there the link is pressed" if slack.value < 0.0 else ""
        sentences.append(
            f"The smallest tension is {quantity(slack.value, 'N')} in link {slack.member} of {instance(track.track)}"
            f" at {number(slack.t)} s{pressed}"
        )
    return f'<p class="lead">{". ".join(sentences)}.{_other_track(evaluation)}</p>'


def _other_track(evaluation: Evaluation) -> str:
    """Sentence on the largest tension of the other track; empty unless there are two."""
    if len(evaluation.chains) != 2:
        return ""
    first, second = (
        (track_loads.track, track_loads.most["tension"].value) for track_loads in evaluation.chains.values()
    )
    if abs(first[1] - second[1]) <= 1e-3 * abs(first[1]):
        return " The largest tensions of both tracks agree to a thousandth."
    track, value = min(first, second, key=lambda track_loads: track_loads[1])
    return f" In {instance(track)} the largest tension is {quantity(value, 'N')}."


def profiles(evaluation: Evaluation, loads: LinkLoads) -> list[Profile]:
    """Profiles of a chain at even instants and at the largest tension; none if positions were not recorded."""
    evenly = np.linspace(loads.t[0], loads.t[-1], INSTANTS + 1)[1:] if len(loads.t) > 1 else loads.t[:1]
    instants = sorted({*map(float, evenly), loads.most["tension"].t})
    return attempt(lambda: [profile.of(evaluation.run, loads, t) for t in instants], evaluation.missing) or []


def _along(evaluation: Evaluation, loads: LinkLoads, content: Content) -> None:
    """Figure of the tension along the chain."""
    drawn_profiles = profiles(evaluation, loads)
    if not drawn_profiles:
        return
    worst = loads.most["tension"].t
    names = [f"{number(profile.t)} s{' (largest)' if profile.t == worst else ''}" for profile in drawn_profiles]
    along = [Curve(profile.place, profile.tension) for profile in drawn_profiles]
    drawn = [Trace(name, curve, k) for k, (name, curve) in enumerate(zip(names, along, strict=True))]
    x = f"place along the chain from {'the sprocket' if loads.closed else 'its first pin'}, m"
    chart = lines("tension", "N", drawn, x=x, timed=False, stretches=drawn_profiles[-1].stretches)
    where = "From the middle of the wrap on the sprocket on, the way that the numbers of links go. "
    note = f"{where if loads.closed else ''}At {len(drawn_profiles)} instants, link by link."
    content.add_figure("round", chart, "Tension along the chain", note, "wide")


def _map(pair: Pair, loads: LinkLoads, content: Content) -> None:
    """Figure of the tension of every link over time."""
    worst = loads.most["tension"]
    mark = worst.t, worst.member, f"link {worst.member}, {number(worst.t)} s"
    other = _of_reference(pair, loads)
    chart = heat("tension", "N", loads.middle, loads.tension, mark, other)
    note = "Largest tension in each slice of time; the ring marks the largest of all."
    if loads.closed:
        note += " Stripes that slant are places on the way round, which the links pass one after the other."
    title = f"Every link over time, {instance(loads.track)}"
    content.add_figure("tension-map", chart, title, note, "tall", CHOICE if other is not None else "")


def _of_reference(pair: Pair, loads: LinkLoads) -> Floats | None:
    """Tensions of the reference in the run's intervals of time; None unless it has the same links."""
    reference = pair.reference
    other = reference.chains.get(loads.track) if reference else None
    if reference is None or other is None or other.links != loads.links:
        return None
    span = pair.run.run.span
    return attempt(lambda: link_loads.tensions_in(reference.run, loads.track, span, loads), pair.run.missing)


def _bearers(evaluation: Evaluation, content: Content) -> None:
    """Figures of the loads over time of each link with a largest load of the whole run."""
    bearers = evaluation.bearers
    for k, track in enumerate(evaluation.chains):
        of_track = {link: what for (name, link), what in bearers.items() if name == track}
        if not of_track:
            continue
        for link, parts in link_loads.curves(evaluation.run, track, [*of_track]).items():
            most = and_list([BEARS[what] for what in of_track[link]])
            content.html += f"<h3 class='group'>Link {link} of {instance(track)}, which {most}</h3><div class='grid'>"
            _curves(f"link-{k}-{link}", parts, content)
            content.html += "</div>"


def _curves(key: str, parts: Mapping[str, tuple[Curve, Peak]], content: Content) -> None:
    """Figures of the loads of a link over time."""
    for load, title, unit in LOADS:
        if load in parts and parts[load][1].value > 0.0:
            curve, peak = parts[load]
            note = f"Largest: {at_time(peak, unit)}."
            chart = lines(load, unit, [Trace(load, curve, 0)], mark=peak)
            content.add_figure(f"{key}-{load}", chart, title, note)


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
        ("tension", OBSERVABLES["tension_max"].shown.title, tensions),
    ):
        if spectra := _spectra(run, signals):
            drawn = _traces(signals, spectra)
            if pair.reference:
                drawn += _traces(signals, _spectra(pair.reference, [*spectra]), reference=True)
            chart = lines("amplitude", next(iter(spectra.values())).units[0], drawn, x="tooth order", timed=False)
            content.add_figure(f"{key}-orders", chart, title, _largest_amplitude(spectra, several=len(signals) > 1))
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


def _largest_amplitude(spectra: dict[str, Spectrum], several: bool) -> str:
    """Sentence on the largest amplitude, of one of several signals; HTML."""
    peaks = {signal: found.peak(SLOW * found.teeth) for signal, found in spectra.items()}
    signal = max(peaks, key=lambda name: peaks[name][1])
    (frequency, amplitude), found = peaks[signal], spectra[signal]
    place = f", {text(side(signal))}" if several else ""
    return (
        f"Largest: {quantity(amplitude, found.units[0])} at order {number(frequency / found.teeth, 3)},"
        f" {number(frequency)} Hz{place}."
    )


FATIGUE_HEAD = (
    "Track", "First link to break", "Fibre", "After", "Damage, run repeated", "Damage, run once", "Cycles",
    "Largest range", "Equivalent range",
)  # fmt: skip


def fatigue(pair: Pair) -> PageSection | None:
    """Section of the fatigue of each track; None without stress of fibres, or without the library."""
    run, content = pair.run.run, Content()
    fibres = [record_blocks.has(run, track, f"link[*].fibre.{fibre}") for track in run.tracks for fibre in FIBRES]
    if not fibres or not all(fibres):
        return None
    result = attempt(lambda: analysis.of(run, sn=pair.line), pair.run.missing)
    if result is None:
        return None
    found = result.tracks
    drawn = [
        Trace(f"{fibre} fibre, {plain(each.track)}", Curve(np.arange(1.0, len(damage) + 1.0), damage), 2 * k + column)
        for k, each in enumerate(found)
        for column, (fibre, damage) in enumerate(zip(FIBRES, each.damage_repeated.T, strict=True))
    ]
    line, *_, counts, same, along, recorded = result.notes()
    counts, along, same = (f"{sentence[0].upper()}{sentence[1:]}." for sentence in (counts, along, same))
    note = f"Miner's sum of each link over each repeat of the run. {line}. {counts} {along} Stress is {recorded}."
    note += f" {same} Notches and mean stress are left out."
    content.add_figure("damage", lines("damage", "", drawn, x="link", timed=False), "Damage", note, "wide")
    content.html = table(FATIGUE_HEAD, [_fatigue_row(each) for each in found]) + content.html
    return PageSection("fatigue", "Fatigue", "How long do the links last?", content.html, content.charts)


def _fatigue_row(found: TrackFatigue) -> tuple[str, ...]:
    link, fibre = found.worst
    return (
        instance(found.track), f"link {link + 1}", FIBRES[fibre],
        f"{hours(found.life)} of this, repeated" if np.isfinite(found.life) else "none breaks",
        number(float(found.damage_repeated[link, fibre]), 3), number(float(found.damage_once[link, fibre]), 3),
        number(float(found.cycles[link, fibre])),
        quantity(float(found.largest[link, fibre]), "Pa"), quantity(float(found.equivalent[link, fibre]), "Pa"),
    )  # fmt: skip
