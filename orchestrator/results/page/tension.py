"""Section with the tension of the chain: over time, along the chain, by link, and the loads of the worst links."""

from __future__ import annotations

import numpy as np

from orchestrator.log.time_series import Floats
from orchestrator.results.analyses import link_loads, profile
from orchestrator.results.analyses.link_loads import LinkLoads
from orchestrator.results.analyses.profile import Profile
from orchestrator.results.page.charts import Trace, heat, lines
from orchestrator.results.page.evaluation import Evaluation, attempt
from orchestrator.results.page.section import Content, PageSection, Pair
from orchestrator.results.page.words import and_list, instance, plain, quantity
from orchestrator.results.thinned import Curve
from orchestrator.results.units import number

INSTANTS = 4  # evenly spaced instants of profiles
CHOICE = """<label class="choice">shown: <select data-chart="tension-map"><option value="run">the run</option>
<option value="reference">the reference</option><option value="difference">run less reference</option>
</select></label>"""
BEARS = {"tension": "bore the most tension", "stress": "had the most stress", "force": "had the most force in its pin"}
NO_LINKS = "The record holds no outputs of single links: which link bore the most is not known."
LOADS = (
    ("tension", "Tension", "N"),
    ("stress", "Axial stress of tension and bending, at its most stressed fibre", "Pa"),
    ("force", "Force in the pin where it begins", "N"),
)


def tension(pair: Pair) -> PageSection | None:
    """Section of the tension; None if no track recorded it."""
    study, content = pair.run, Content()
    tracks = [track for track in study.run.tracks if f"{track}.tension.max" in study.signals]
    if tracks:
        drawn = pair.lines([(f"{track}.tension.max", f"largest, {plain(track)}") for track in tracks[:2]])
        drawn += pair.lines([(f"{track}.tension.mean", f"mean, {plain(track)}") for track in tracks[:2]], 2)
        chart, note = pair.over_time("tension", "N", drawn), "Over all links of a track, at every step."
        content.figure("tension", chart, "Largest and mean tension", note, "wide")
    if found := study.hardest:
        content.html += _largest(study, found)
        _along(study, found, content)
        _map(pair, found, content)
        _bearers(study, found, content)
    elif tracks:
        content.html += f"<p class='muted'>{NO_LINKS}</p>"
    title = "What does the chain bear?"
    return PageSection("tension", "Tension", title, content.html, content.charts) if content.charts else None


def _largest(study: Evaluation, found: LinkLoads) -> str:
    """Sentences on the extreme loads of links, HTML."""
    worst, slack = found.most["tension"], found.slackest
    stressed, loaded = found.most.get("stress"), found.most.get("force")
    said = f"The largest tension in the records of links is <b>{quantity(worst.value, 'N')}</b>"
    said += f" in <b>link {worst.member}</b> of {instance(found.track)} at {number(worst.t)} s"
    if stressed and stressed.value > 0.0:
        said += f". The largest stress is {quantity(stressed.value, 'Pa')} in link {stressed.member}"
        said += f" at {number(stressed.t)} s"
    if loaded:
        said += f". The largest force in a pin is {quantity(loaded.value, 'N')} where link {loaded.member} begins,"
        said += f" at {number(loaded.t)} s"
    said += f". The smallest tension is {quantity(slack.value, 'N')} in link {slack.member} at {number(slack.t)} s"
    said += ": there the link is pressed" if slack.value < 0.0 else ""
    return f'<p class="lead">{said}.{_other_track(study)}</p>'


def _other_track(study: Evaluation) -> str:
    """Sentence on the largest tension of the other track; empty unless there are two."""
    if len(study.chains) != 2:
        return ""
    one, other = ((each.track, each.most["tension"].value) for each in study.chains.values())
    if abs(one[1] - other[1]) <= 1e-3 * abs(one[1]):
        return " The other track bears as much, to a thousandth."
    track, value = min(one, other, key=lambda each: each[1])
    return f" In {instance(track)} the largest tension is {quantity(value, 'N')}."


def profiles(study: Evaluation, found: LinkLoads) -> list[Profile]:
    """Profiles of a chain at even instants and at the largest tension; none if positions were not recorded."""
    evenly = np.linspace(found.t[0], found.t[-1], INSTANTS + 1)[1:] if len(found.t) > 1 else found.t[:1]
    instants = sorted({*map(float, evenly), found.most["tension"].t})
    return attempt(lambda: [profile.of(study.run, found, t) for t in instants], study.missing) or []


def _along(study: Evaluation, found: LinkLoads, content: Content) -> None:
    """Figure of the tension along the chain."""
    made = profiles(study, found)
    if not made:
        return
    worst = found.most["tension"].t
    drawn = [
        Trace(f"{number(one.t)} s{' (largest)' if one.t == worst else ''}", Curve(one.place, one.tension), k)
        for k, one in enumerate(made)
    ]
    x = f"place along the chain from {'the sprocket' if found.closed else 'its first pin'}, m"
    chart = lines("tension", "N", drawn, x=x, timed=False, stretches=made[-1].stretches)
    where = "From the middle of the wrap on the sprocket on, the way that the numbers of links go. "
    note = f"{where if found.closed else ''}At {len(made)} instants, link by link."
    content.figure("round", chart, "Tension along the chain", note, "wide")


def _map(pair: Pair, found: LinkLoads, content: Content) -> None:
    """Figure of the tension of every link over time."""
    worst = found.most["tension"]
    mark = worst.t, worst.member, f"link {worst.member}, {number(worst.t)} s"
    other = _of_reference(pair, found)
    chart = heat("tension", "N", found.middle, found.tension, mark, other)
    note = "Largest tension in each slice of time; the ring marks the largest of all."
    if found.closed:
        note += " Stripes that slant are places on the way round, which the links pass one after the other."
    title = f"Every link over time, {instance(found.track)}"
    content.figure("tension-map", chart, title, note, "tall", CHOICE if other is not None else "")


def _of_reference(pair: Pair, found: LinkLoads) -> Floats | None:
    """Tensions of the reference in the run's intervals of time; None unless it has the same links."""
    reference = pair.reference
    other = reference.chains.get(found.track) if reference else None
    if reference is None or other is None or other.links != found.links:
        return None
    span = pair.run.run.span
    return attempt(lambda: link_loads.tensions_in(reference.run, found.track, span, found), pair.run.missing)


def _bearers(study: Evaluation, found: LinkLoads, content: Content) -> None:
    """Figures of the loads over time of each link with a largest load."""
    for link, parts in link_loads.curves(study.run, found).items():
        most = and_list([BEARS[what] for what in found.bearers[link]])
        content.html += f"<h3 class='group'>Link {link} of {instance(found.track)}, which {most}</h3><div class='grid'>"
        for key, title, unit in LOADS:
            if key in parts and parts[key][1].value > 0.0:
                curve, peak = parts[key]
                note = f"Largest: {quantity(peak.value, unit)} at {number(peak.t)} s."
                content.figure(f"link-{link}-{key}", lines(key, unit, [Trace(key, curve, 0)], mark=peak), title, note)
        content.html += "</div>"
