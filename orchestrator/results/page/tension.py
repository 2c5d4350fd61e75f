"""Section with the tension of the chain: over time, along the chain, by link, and the loads of the worst links."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from orchestrator.log.time_series import Floats
from orchestrator.results.analyses import link_loads, profile
from orchestrator.results.analyses.link_loads import LinkLoads
from orchestrator.results.analyses.profile import Profile
from orchestrator.results.page.charts import Trace, heat, lines
from orchestrator.results.page.evaluation import Evaluation, attempt
from orchestrator.results.page.section import Content, PageSection, Pair
from orchestrator.results.page.words import and_list, instance, plain, quantity
from orchestrator.results.thinned import Curve, Peak
from orchestrator.results.units import number

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
        content.html += _largest(evaluation)
        _along(evaluation, loads, content)
        _map(pair, loads, content)
        _bearers(evaluation, content)
    elif tracks:
        content.html += f"<p class='muted'>{NO_LINKS}</p>"
    title = "What does the chain bear?"
    return PageSection("tension", "Tension", title, content.html, content.charts) if content.charts else None


def _largest(evaluation: Evaluation) -> str:
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
    drawn = [
        Trace(
            f"{number(profile.t)} s{' (largest)' if profile.t == worst else ''}",
            Curve(profile.place, profile.tension),
            k,
        )
        for k, profile in enumerate(drawn_profiles)
    ]
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
    for side, track in enumerate(evaluation.chains):
        of_track = {link: what for (name, link), what in bearers.items() if name == track}
        if not of_track:
            continue
        for link, parts in link_loads.curves(evaluation.run, track, [*of_track]).items():
            most = and_list([BEARS[what] for what in of_track[link]])
            content.html += f"<h3 class='group'>Link {link} of {instance(track)}, which {most}</h3><div class='grid'>"
            _curves(f"link-{side}-{link}", parts, content)
            content.html += "</div>"


def _curves(key: str, parts: Mapping[str, tuple[Curve, Peak]], content: Content) -> None:
    """Figures of the loads of a link over time."""
    for load, title, unit in LOADS:
        if load in parts and parts[load][1].value > 0.0:
            curve, peak = parts[load]
            note = f"Largest: {quantity(peak.value, unit)} at {number(peak.t)} s."
            chart = lines(load, unit, [Trace(load, curve, 0)], mark=peak)
            content.add_figure(f"{key}-{load}", chart, title, note)
