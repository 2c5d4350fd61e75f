"""The sections of a page about one run, with or without a reference: HTML, and charts by name."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from html import escape
from typing import Any, NamedTuple

import numpy as np

from orchestrator.log.time_series import Floats
from orchestrator.results import measures
from orchestrator.results.analyses import wheel_loads
from orchestrator.results.analyses.events import off_ground
from orchestrator.results.analyses.spells import LIFTED, SETTLING, TOUCHES, drops, settling
from orchestrator.results.page import chain as links
from orchestrator.results.page.balance import KINDS, sentence
from orchestrator.results.page.chain import Chain
from orchestrator.results.page.charts import Chart, Line, heat, lines, waterfall
from orchestrator.results.page.circuit import Profile, profile
from orchestrator.results.page.events import Event, events, lifted
from orchestrator.results.page.facts import COMING_TO_REST, unmade
from orchestrator.results.page.pressure import pressure
from orchestrator.results.page.signals import Recorded
from orchestrator.results.page.study import Study, attempt
from orchestrator.results.page.words import and_list, instance, number, percent, plain, quantity, text, wheel_name
from orchestrator.results.run_data import EVER, Window
from orchestrator.results.thinned import Curve

INSTANTS = 4  # at which the chain is shown round its way
SHOWN_EVENTS = 40
AT_REST = 1e-6  # m/s
CHOICE = """<label class="choice">shown: <select data-chart="tension-map"><option value="run">the run</option>
<option value="reference">the reference</option><option value="difference">run less reference</option>
</select></label>"""
BEARS = {"tension": "bore the most tension", "stress": "had the most stress", "force": "had the most force in its pin"}
DEGREES = 180.0 / np.pi
LEAST_WAY = 0.5  # m beside the straight line: below, a way from above shows nothing


class Section(NamedTuple):
    """A part of the page."""

    key: str
    name: str  # in the table of contents
    title: str
    html: str
    charts: dict[str, Chart]


class Pair(NamedTuple):
    """The run and, if there is one, its reference."""

    run: Study
    reference: Study | None
    figures: dict[str, Any]  # of the run, as ``facts.figures`` has them

    def drawn(self, parts: Sequence[tuple[str, str]], colour: int = 0) -> list[Line]:
        """Curves of signals, of each its name and what it is called, of both runs as far as they have them."""
        known = [(signal, name, k) for k, (signal, name) in enumerate(parts, colour) if signal in self.run.signals]
        alike = len(known) == 2 and _alike(*(self.run.signals[signal] for signal, *_ in known))
        window = self.run.ripple.window
        means = {signal: self.run.mean(signal, window) for signal, *_ in known}
        found = [
            Line(name, self.run.signals[signal].curve, k, means[signal], behind=alike and not place)
            for place, (signal, name, k) in enumerate(known)
        ]
        others = self.reference.signals if self.reference and known else {}
        for k, (signal, name) in enumerate(parts, colour):
            if other := others.get(signal):  # one band is enough: of what is held against it the mean alone
                curve = other.moving.over(window) if means.get(signal) else other.curve
                found.append(Line(f"{name}, reference", curve, k, reference=True))
        return found

    def over_time(self, quantity: str, unit: str, drawn: Sequence[Line]) -> Chart:
        """A chart of what ``drawn`` made."""
        return lines(quantity, unit, drawn, window=self.run.ripple.words)


def _alike(one: Recorded, other: Recorded) -> bool:
    """Whether the curve of one covers that of the other."""
    size = max(abs(one.largest.value), abs(other.largest.value))
    apart = abs(one.most.value - other.most.value), abs(one.least.value - other.least.value)
    return max(apart) <= 1e-2 * size


def figure(key: str, title: str, note: str = "", size: str = "", choice: str = "") -> str:
    """The place of a chart; ``size``: tall, wide; ``choice``: what chooses between its values; HTML."""
    caption = f"<h3>{title}</h3>" + (f"<p>{note}</p>" if note else "") + choice
    return (
        f'<figure class="{size}"><figcaption>{caption}</figcaption>'
        f'<div class="chart {size}" id="chart-{key}" role="img" aria-label="{title}"></div></figure>'
    )


def table(head: Sequence[str], rows: Iterable[Sequence[str]], classes: str = "") -> str:
    """HTML cells as they are."""
    top = "".join(f'<th scope="col">{cell}</th>' for cell in head)
    body = "".join(f"<tr>{''.join(f'<td>{cell}</td>' for cell in row)}</tr>" for row in rows)
    return (
        f'<div class="scroll"><table class="{classes}"><thead><tr>{top}</tr></thead><tbody>{body}</tbody></table></div>'
    )


def checks(pair: Pair) -> Section:
    """What the scene expects, and whether it came."""
    study = pair.run
    expected = study.run.scene.get("expect")
    expected = expected if isinstance(expected, dict) else {}
    rows = []
    for name, check in study.judged.checks.items():
        mark = '<span class="pill good">met</span>' if check["ok"] else '<span class="pill bad">not met</span>'
        note = f'<br><span class="muted">{text(check["note"])}</span>' if check["note"] else ""
        rows.append(
            (
                f"<b>{text(name.replace('_', ' '))}</b><br>"
                f"<span class='muted'>{_looks_at(expected.get(name))}</span>{_why(expected.get(name))}{note}",
                number(check["value"], 6),
                number(check["expected"], 6),
                f"\N{PLUS-MINUS SIGN} {number(check['tolerance'], 3)}",
                mark,
            )
        )
    html = table(("Check", "Value", "Expected", "Tolerance", "Verdict"), rows, "checks") if rows else ""
    undone = [text(plain(name)) for name in unmade(study)]
    if study.judged.note:
        html += f"<p>Checks were not made: {text(study.judged.note)}.</p>"
    elif not rows:
        html += "<p>This record names no check to make. The page shows what happened, not whether it is right.</p>"
    if undone and not study.judged.note:
        html += f"<p>Not made, because the record does not reach the end of what they look at: {and_list(undone)}.</p>"
    if rows:
        html = "<p>Made anew from this record when the page was written. Ratios and counts have no unit.</p>" + html
    return Section("checks", "Checks", "Did the checks hold?", html, {})


def _paragraphs(measure: Callable[..., Any]) -> list[str]:
    """What a measure says of itself: what it is and, where it says so, which values are right and why."""
    return [" ".join(part.split()) for part in (measure.__doc__ or "").split("\n\n")]


def _why(check: Any) -> str:
    """Why a check's bounds are what they are, HTML; nothing where its measure does not say so."""
    measure = measures.NAMES.get(str(check.get("measure"))) if isinstance(check, dict) else None
    told = _paragraphs(measure)[1:] if measure else []
    return "".join(f'<br><span class="muted why">{escape(part.replace("``", ""))}</span>' for part in told)


def _looks_at(check: Any) -> str:
    """What a check of a scene looks at, HTML."""
    if not isinstance(check, dict):
        return ""
    measure = measures.NAMES.get(str(check.get("measure")))
    if measure is not None:
        what = text(_paragraphs(measure)[0].rstrip("."))
    else:
        what = f"{text(check.get('reduce', ''))} of {text(check.get('signal', ''))}"
    of = f", {text(check['of'])}" if check.get("of") else ""
    try:
        start, end = float(check.get("from") or 0.0), check.get("to")
        when = f"; {number(start)} to {number(float(end))} s" if end is not None else f"; from {number(start)} s on"
    except (TypeError, ValueError):
        when = ""
    return f"{what}{of}{when}"


def motion(pair: Pair) -> Section | None:
    """How the hull, or else the chain, moved."""
    study, charts, html = pair.run, {}, ""
    for key, title in (("speed", "Speed of the hull"), ("distance", "Way along the heading at the start")):
        signal = f"chassis.{key}"
        if drawn := pair.drawn([(signal, key)]):
            charts[key] = pair.over_time(key, study.signals[signal].unit, drawn)
            html += figure(key, title, _range(study.signals[signal]))
    angles = pair.drawn([("chassis.pitch", "pitch"), ("chassis.roll", "roll")])
    if angles:
        charts["pitch"] = pair.over_time("angle", "degrees", [line.times(DEGREES) for line in angles])
        html += figure("pitch", "Pitch and roll", "Nose down and right side down are positive.")
    settled = pair.drawn([("chassis.settlement", "settlement")])
    if settled:
        charts["settlement"] = pair.over_time("down", "mm", [line.times(1e3) for line in settled])
        html += figure("settlement", "Settlement", "The hull's centre of mass below its drawn place.")
    if way := _way(pair):
        charts["way"] = way
        html += figure("way", "Way from above", "World axes; the centre of mass of the hull.")
    drawn = pair.drawn([(f"{track}.speed", plain(track)) for track in study.run.tracks])
    if any(np.abs(line.curve.y).max() > AT_REST for line in drawn):
        charts["chain-speed"] = pair.over_time("speed", "m/s", drawn)
        html += figure("chain-speed", "Speed of the chain", "Along itself, seen from the vehicle.")
    return (
        Section("motion", "Motion", "How did it move?", f'<div class="grid">{html}</div>', charts) if charts else None
    )


def _range(signal: Recorded) -> str:
    unit = signal.unit
    return (
        f"From {quantity(signal.least.value, unit)} at {number(signal.least.t)} s"
        f" to {quantity(signal.most.value, unit)} at {number(signal.most.t)} s."
    )


def _way(pair: Pair) -> Chart | None:
    drawn = []
    for study, name in ((pair.run, "run"), (pair.reference, "reference")):
        if study is None or "chassis.chassis.position.x" not in study.signals:
            continue
        _, places = study.run.vectors("chassis", "out", "chassis.position", "xy", EVER)
        thinned = places[:: max(1, len(places) // 1000)]
        drawn.append(Line(name, Curve(thinned[:, 0], thinned[:, 1]), 0, reference=study is pair.reference))
    if not drawn:
        return None
    last = drawn[0].curve
    heading = float(attempt(lambda: pair.run.run.scene["start"]["heading"], []) or 0.0)
    beside = -np.sin(heading) * (last.t - last.t[0]) + np.cos(heading) * (last.y - last.y[0])
    if np.nanmax(np.abs(beside)) < LEAST_WAY:
        return None
    return lines("y", "m", drawn, x="x, m", timed=False) | {"equal": True}


def drive(pair: Pair) -> Section | None:
    """What the motors did."""
    study, charts, html = pair.run, {}, ""
    for key, title, what, note in (
        ("torque", "Torque of the drives", "torque", "Mean over each step."),
        ("sprocket-speed", "Speed of the drives", "speed", "Of a sprocket against its mount."),
        ("power", "Power of the motors", "power", "Negative where the chain turns the motor."),
    ):
        signals = [found for each in study.drives if (found := study.signals.get(f"{each}{what}"))]
        if signals:
            drawn = pair.drawn([(f"{each}{what}", plain(each.rstrip("."))) for each in study.drives])
            charts[key] = pair.over_time(what, signals[0].unit, drawn)
            top = max(signals, key=lambda signal: abs(signal.largest.value)).largest
            html += figure(key, title, f"{note} Largest: {quantity(top.value, signals[0].unit)} at {number(top.t)} s.")
    slips = pair.drawn([(f"{track}.slip", plain(track)) for track in study.run.tracks])
    if any(np.any(line.curve.y) for line in slips):
        charts["slip"] = pair.over_time("slip", "mm/s", [line.times(1e3) for line in slips])
        note = (
            "Rearward speed of the pads over the ground, weighted by their load. It may be below zero under a driven"
            " vehicle: wheels rock the loaded links forward about their pads, and the hull outruns the pin line."
        )
        html += figure("slip", "Slip on the ground", note)
    return (
        Section("drive", "Drive", "What did the drives do?", f'<div class="grid">{html}</div>', charts)
        if charts
        else None
    )


def energy(pair: Pair) -> Section | None:
    """Where the work went."""
    found, study = pair.run.balance, pair.run
    if found is None:
        return None
    books = found.ledger
    rows = [("put in by drives", books.work, "work")]
    rows += [(f"released: {KINDS[kind]}", change, "stored") for kind, change in found.stored.items() if change < 0.0]
    rows += [(f"stored: {KINDS[kind]}", change, "stored") for kind, change in found.stored.items() if change > 0.0]
    rows += [
        (f"dissipated: {plain(name)}{', both sides' if study.run.copies(name) > 1 else ''}", lost, "lost")
        for name, lost in found.lost.items()
        if lost
    ]
    rows.append(("lost: contacts moving along links", books.covered, "lost"))
    least = 1e-5 * max(abs(each) for _, each, _ in rows)
    rows = [row for row in rows if abs(row[1]) > least]
    rows.append(("unaccounted for", books.residual, "open"))
    html = f'<p class="lead">{sentence(found)}</p>'
    charts: dict[str, Chart] = {}
    moved = max(abs(books.work), abs(books.change), abs(books.dissipated))
    if moved > 1e-3:
        charts["energy"] = waterfall(rows)
        html += figure("energy", "From what was put in to what is unaccounted for",
                       "Each bar begins where the one above ends: what is stored or lost is taken from what came in.",
                       "tall")  # fmt: skip
        names = {"work": "put in", "stored": "stored", "lost": "lost"}
        drawn = [Line(names[part], curve, k) for k, (part, curve) in enumerate(study.energies.items())]
        drawn += [
            Line(f"{names[part]}, reference", curve, k, reference=True)
            for k, (part, curve) in enumerate(pair.reference.energies.items() if pair.reference else ())
        ]
        if drawn:
            charts["energy-time"] = lines("energy", "J", drawn)
            html += figure("energy-time", "Energy since the start", "All components together.")
    html += _losses(study)
    parts = [(instance(name), quantity(open_, "J", 3)) for name, open_ in books.integration.items()]
    parts.append(("ports between components", quantity(books.port, "J", 3)))
    html += (
        "<details><summary>Which part makes what is unaccounted for</summary><p class='muted'>By the integration of"
        " each component (of one, where the vehicle has two alike), and by the coupling.</p>"
        + table(("Component", "Unaccounted for"), parts)
        + "</details>"
    )
    return Section("energy", "Energy", "Where does the work go?", html, charts)


def _losses(study: Study) -> str:
    """What each component lost, and by what."""
    assert study.balance is not None
    found = {name: loss for name, loss in study.balance.losses.items() if loss.dissipated or loss.covered}
    if not found:
        return ""
    whole = sum(loss.dissipated + loss.covered for loss in found.values())
    rows = [
        (
            f"{instance(name)}{', both sides' if study.run.copies(name) > 1 else ''}<br>"
            f"<span class='muted'>{text(loss.parts) or 'its model description does not say'}</span>",
            quantity(loss.dissipated, "J"),
            quantity(loss.covered, "J", 3) if loss.covered else "",
            percent((loss.dissipated + loss.covered) / whole) if whole else "",
        )
        for name, loss in found.items()
    ]
    head = "Component, and what its losses are", "Dissipated", "Contacts moving<br>along links", "Of all losses"
    told = "A component gives the sum of its losses, not their parts: what is in it is told in the words of its FMU."
    return f"<h3>What was lost where</h3><p class='muted'>{told}</p>{table(head, rows, 'numbers')}"


def tension(pair: Pair) -> Section | None:
    """What the chain bears."""
    study, charts, html = pair.run, {}, ""
    tracks = [track for track in study.run.tracks if f"{track}.tension.max" in study.signals]
    if tracks:
        drawn = pair.drawn([(f"{track}.tension.max", f"largest, {plain(track)}") for track in tracks[:2]])
        drawn += pair.drawn([(f"{track}.tension.mean", f"mean, {plain(track)}") for track in tracks[:2]], 2)
        charts["tension"] = pair.over_time("tension", "N", drawn)
        html += figure("tension", "Largest and mean tension", "Over all links of a track, at every step.", "wide")
    if study.chains:
        found = study.hardest
        assert found is not None
        html += _worst(study, found)
        html += _round(study, found, charts)
        worst = found.worst
        mark = worst.t, worst.link, f"link {worst.link}, {number(worst.t)} s"
        other = _tension_of_reference(pair, found)
        charts["tension-map"] = heat("tension", "N", found.middle, found.tension, mark, other)
        note = "Largest tension in each slice of time; the ring marks the largest of all."
        if found.columns.closed:
            note += " Stripes that slant are places on the way round, which the links pass one after the other."
        title = f"Every link over time, {instance(found.track)}"
        html += figure("tension-map", title, note, "tall", CHOICE if other is not None else "")
        html += _of_bearers(study, found, charts)
    elif tracks:
        html += (
            "<p class='muted'>The record holds no outputs of single links: which link bore the most is not known.</p>"
        )
    return Section("tension", "Tension", "What does the chain bear?", html, charts) if charts else None


def _tension_of_reference(pair: Pair, found: Chain) -> Floats | None:
    """Tensions of the reference in the run's slices of time; None where it has not the same links."""
    reference = pair.reference
    other = reference.chains.get(found.track) if reference else None
    if reference is None or other is None or other.tension.shape[1] != found.tension.shape[1]:
        return None
    slices = len(found.middle)
    return attempt(lambda: links.tension_in(reference.run, other, pair.run.span, slices), pair.run.missing)


def _worst(study: Study, found: Chain) -> str:
    worst = found.worst
    told = f"The largest tension in the records of links is <b>{quantity(worst.value, 'N')}</b>"
    told += f" in <b>link {worst.link}</b> of {instance(found.track)} at {number(worst.t)} s"
    if found.stressed and found.stressed.value > 0.0:
        stressed = found.stressed
        told += f". The largest stress is {quantity(stressed.value, 'Pa')} in link {stressed.link}"
        told += f" at {number(stressed.t)} s"
    if found.loaded:
        loaded = found.loaded
        told += f". The largest force in a pin is {quantity(loaded.value, 'N')} where link {loaded.link} begins,"
        told += f" at {number(loaded.t)} s"
    slack = found.slackest
    told += f". The smallest tension is {quantity(slack.value, 'N')} in link {slack.link} at {number(slack.t)} s"
    told += ": there the link is pressed" if slack.value < 0.0 else ""
    other = _other_track(study)
    return f'<p class="lead">{told}.{other}</p>'


def _other_track(study: Study) -> str:
    """A word about the other track where both bear the same."""
    if len(study.chains) != 2:
        return ""
    one, other = study.chains.values()
    if abs(one.worst.value - other.worst.value) <= 1e-3 * abs(one.worst.value):
        return " The other track bears as much, to a thousandth."
    less = min((one, other), key=lambda each: each.worst.value)
    return f" In {instance(less.track)} the largest tension is {quantity(less.worst.value, 'N')}."


def instants(study: Study, found: Chain) -> list[float]:
    """When the chain is shown round its way: evenly over the run, and when it bears the most."""
    evenly = np.linspace(found.t[0], found.t[-1], INSTANTS + 1)[1:] if len(found.t) > 1 else found.t[:1]
    return sorted({*map(float, evenly), found.worst.t})


def profiles(study: Study, found: Chain) -> list[Profile]:
    """The chain round its way at some instants; none where places were not recorded."""

    def make() -> list[Profile]:
        return [profile(study.run, found, t) for t in instants(study, found)]

    return attempt(make, study.missing) or []


def _round(study: Study, found: Chain, charts: dict[str, Chart]) -> str:
    made = profiles(study, found)
    if not made:
        return ""
    drawn = [
        Line(f"{number(one.t)} s{' (largest)' if one.t == found.worst.t else ''}", Curve(one.place, one.tension), k)
        for k, one in enumerate(made)
    ]
    closed = found.columns.closed
    x = "place along the chain from the sprocket, m" if closed else "place along the chain from its first pin, m"
    sections = made[-1].sections
    charts["round"] = lines("tension", "N", drawn, x=x, timed=False, sections=sections)
    where = "From the middle of the wrap on the sprocket on, the way that the numbers of links go. " if closed else ""
    return figure("round", "Tension along the chain", f"{where}At {len(made)} instants, link by link.", "wide")


def _of_bearers(study: Study, found: Chain, charts: dict[str, Chart]) -> str:
    """Of each link that bears the most of something its curves, with the instants of their largest values."""
    html = ""
    for link, parts in links.of_bearers(study.run, found).items():
        own = ""
        for key, title, unit in (
            ("tension", "Tension", "N"),
            ("stress", "Axial stress of tension and bending, at its most stressed fibre", "Pa"),
            ("force", "Force in the pin where it begins", "N"),
        ):
            if key in parts and parts[key][1].value > 0.0:
                curve, peak = parts[key]
                charts[f"link-{link}-{key}"] = lines(key, unit, [Line(key, curve, 0)], mark=peak)
                own += figure(
                    f"link-{link}-{key}", title, f"Largest: {quantity(peak.value, unit)} at {number(peak.t)} s."
                )
        most = and_list([BEARS[what] for what in found.bearers[link]])
        title = f"Link {link} of {instance(found.track)}, which {most}"
        html += f"<h3 class='group'>{title}</h3><div class='grid'>{own}</div>"
    return html


def loads(pair: Pair) -> Section | None:
    """Wheels and ground."""
    study, charts, html = pair.run, {}, ""
    for side, track in enumerate(study.run.tracks):
        names = [name.removesuffix(".load") for name in study.signals if name.endswith(".load")]
        own = [name for name in names if name.partition(".")[0] == track]
        if drawn := pair.drawn([(f"{name}.load", wheel_name(name.partition(".")[2])) for name in own]):
            charts[f"wheels-{side}"] = pair.over_time("force", "N", drawn)
            html += figure(f"wheels-{side}", f"Road wheels, {instance(track)}", _least_loaded(study, track))
    grounded = [
        track for track in study.run.tracks
        if (signal := study.signals.get(f"{track}.ground.force.z")) and signal.most.value > signal.least.value
    ]  # fmt: skip
    if grounded:
        drawn = pair.drawn([(f"{track}.ground.force.z", plain(track)) for track in grounded])
        charts["ground"] = pair.over_time("force", "N", drawn)
        html += figure("ground", "Vertical force of the ground", "On each track.")
    html = f'<div class="grid">{html}</div>' if html else ""
    html += _of_wheels(study) if html else ""
    html += _pressure(study, charts)
    return Section("loads", "Loads", "What do wheels and ground carry?", html, charts) if charts else None


def _least_loaded(study: Study, track: str) -> str:
    told = (
        "Force of the chain on each wheel, along the hull's own upward axis, mean over each step. Wheel 1 is next to"
        " the sprocket. The chain's tension pulls the hull down: the loads add up to more than it weighs."
    )
    found = {wheel: spells for (of, wheel), spells in lifted(study.run).items() if of == track and spells}
    late = [wheel for wheel, spells in found.items() if any(not settling(study.run, each.end) for each in spells)]
    if late:
        names = and_list([text(wheel_name(each)) for each in late])
        return f"{told} <b>Lifted off for a time: {names}.</b>"
    return f"{told} {f'After the first {number(SETTLING)} s none' if found else 'None'} is ever lifted off."


def _of_wheels(study: Study) -> str:
    """A row for each wheel; of a vehicle once it has come to rest on its tracks."""
    begin = COMING_TO_REST if drops(study.run) else study.span[0]
    found = attempt(lambda: wheel_loads.of(study.run, Window(begin, study.span[1])), [])
    if found is None:
        return ""
    rows = [
        (f"{text(wheel_name(wheel))}, {instance(track)}", *(quantity(value, "N") for value in values))
        for (track, _, wheel), *values in zip(
            (name.partition(".") for name in found.wheels), found.least, found.mean, found.most, strict=True
        )
    ]
    title = f"Load of each wheel, {number(begin)} to {number(study.span[1])} s"
    return f"<h3>{title}</h3>{table(('Wheel', 'Least', 'Mean', 'Largest'), rows)}"


def _pressure(study: Study, charts: dict[str, Chart]) -> str:
    chain = next((each for each in study.chains.values() if each.columns.ground), None)
    found = attempt(lambda: pressure(study.run, chain), study.missing) if chain else None
    if chain is None or found is None:
        return ""
    told = "Force of the ground into a link over its area, pitch times width,"
    told += f" {number(1e4 * found.area, 3)} cm\N{SUPERSCRIPT TWO}."
    made = [one for one in profiles(study, chain) if one.pressure is not None]
    html = ""
    if made:
        charts["pressure"] = lines("pressure", "Pa", [_under(one, k) for k, one in enumerate(made)],
                                   x="ahead of the sprocket's axle, m", timed=False)  # fmt: skip
        html += figure("pressure", f"Pressure under the links, {instance(chain.track)}",
                       f"{told} The front is on the right; peaks stand under the road wheels.", "wide")  # fmt: skip
    most, when, link = found.peak
    mark = when, link, f"link {link}, {number(when, 3)} s"
    early = when < COMING_TO_REST and drops(study.run)
    told = ""
    if early:
        later = found.most[found.middle > COMING_TO_REST]
        told = ", as the drawn vehicle comes to rest on its tracks"
        if later.size:
            told += f"; {quantity(float(np.nanmax(later)), 'Pa')} at most after {number(COMING_TO_REST)} s"
    charts["pressure-map"] = heat("pressure", "Pa", found.middle, np.maximum(found.most, 0.0), mark)
    return html + figure("pressure-map", f"Pressure under every link over time, {instance(chain.track)}",
                         f"Largest in each slice of time; {quantity(most, 'Pa')} at most, under link {link} at"
                         f" {number(when)} s{told}.", "tall")  # fmt: skip


def _under(one: Profile, colour: int) -> Line:
    """Pressures of links that touch the ground, and of their neighbours, along the vehicle."""
    assert one.pressure is not None
    order = np.argsort(one.ahead)
    touched = one.pressure > 1e-3 * max(one.pressure.max(), 0.0)
    shown = [k for k in order if touched[max(k - 1, 0) : k + 2].any()]
    return Line(f"{number(one.t)} s", Curve(one.ahead[shown], one.pressure[shown]), colour, points=True)


def _peaks(pair: Pair) -> list[Event]:
    """When the run was at its extremes."""
    found = []
    for key, what in (
        ("top_speed", "Top speed"),
        ("tension", "Largest link tension"),
        ("stress", "Largest link stress"),
        ("wheel_load", "Largest wheel load"),
        ("ground_force", "Largest force of the ground on a track"),
    ):
        one = pair.figures.get(key)
        if one and abs(one["value"]) > AT_REST:
            track, _, variable = one["signal"].partition(".")
            wheel = f", {text(wheel_name(variable.removesuffix('.load')))}" if key == "wheel_load" else ""
            link = f", link {one['link']}" if "link" in one else ""
            found.append(Event(one["t"], what, f"{instance(track)}{wheel}{link}", quantity(one["value"], one["unit"])))
    return found


def happened(pair: Pair) -> Section:
    """Events, warnings, how the run ended."""
    study = pair.run
    found = sorted([*events(study.run), *_peaks(pair)], key=lambda event: event.t)
    rows = [(f"{number(event.t)} s", event.what, event.where, event.detail) for event in found[:SHOWN_EVENTS]]
    html = table(("First at", "What", "Where", "How much, how often"), rows) if rows else ""
    if len(found) > SHOWN_EVENTS:
        html += f"<p class='muted'>and {len(found) - SHOWN_EVENTS} more.</p>"
    quiet = []
    early = [where for where, times in lifted(study.run).items() if any(settling(study.run, one.end) for one in times)]
    rest = " once the vehicle had come to rest"
    if not any("lifted" in event.what for event in found) and any(name.endswith(".load") for name in study.signals):
        quiet.append(f"no road wheel was lifted off{rest if early else ''}")
    hops = off_ground(study.run)
    if hops.threshold > 0.0 and not any("off the ground" in event.what for event in found):
        quiet.append(f"no track left the ground{rest if any(hops.of.values()) else ''}")
    if any("solver.rejected" in about.names for about in study.run.log.topics.values()) and not any(
        "Solver" in event.what for event in found
    ):
        quiet.append("no solver took back a step")
    if study.run.log.closing is not None and not study.run.log.closing["warnings"]:
        quiet.append("no component warned")
    if quiet:
        html += f"<p>{and_list(quiet).capitalize()}.</p>"
    if early:
        names = and_list([f"{wheel_name(wheel)} ({instance(track)})" for track, wheel in early])
        html += (
            f"<p class='muted'>In its first {number(SETTLING)} s, while the drawn vehicle comes to rest on its tracks,"
            f" {len(early)} road wheel{'s are' if len(early) > 1 else ' is'} lifted off: {text(names)}.</p>"
        )
    if any(name.endswith(".load") for name in study.signals):
        html += (
            f"<p class='muted'>A road wheel is lifted off from where it carries less than {percent(LIFTED)} of the mean"
            f" load of all to where it carries more than {percent(TOUCHES * LIFTED)}.</p>"
        )
    return Section("events", "Events", "What happened on the way?", html, {})
