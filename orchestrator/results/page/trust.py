"""Sections on how far to trust a run: checks, error, differences from reference and measurement, provenance."""

from __future__ import annotations

import math
from html import escape
from typing import Any, TypeGuard

import numpy as np

from orchestrator.log.container import LogUnreadable
from orchestrator.log.reader import Log
from orchestrator.log.time_series import Floats
from orchestrator.results.analyses.curves import CurveCollector, SignalCurve
from orchestrator.results.approximations import BINS, Curve
from orchestrator.results.difference import differences, worst
from orchestrator.results.divergence import divergence
from orchestrator.results.figures import Figure
from orchestrator.results.measured_difference import WHOLE, SignalDifference
from orchestrator.results.measured_record import MeasuredSignal
from orchestrator.results.measures import FIGURES
from orchestrator.results.page.embedded import instance, plain, quantity, text
from orchestrator.results.page.evaluation import Evaluation, attempt
from orchestrator.results.page.section import Content, PageSection, Pair, Trace, table
from orchestrator.results.run_data import EVER, RunData, Window, given_parts, within
from orchestrator.results.units import number, percent
from orchestrator.vocabulary import and_list

CHECKS_HEAD = ("Check", "Value", "Expected", "Tolerance", "Verdict")


def checks(pair: Pair) -> PageSection:
    """Section with the value, expectation and verdict of each check."""
    evaluation = pair.run
    run, made = evaluation.run, evaluation.summary.checks.items()
    rows = [_check_row(name, check, run.entry("expect", name)) for name, check in made]
    left_out = [text(plain(name)) for name in evaluation.summary.after_end]
    if rows:
        html = "<p>Made anew from this record when the page was written. Ratios and counts have no unit.</p>"
        html += table(CHECKS_HEAD, rows, "checks")
    else:
        html = ""
    if evaluation.summary.note:
        html += f"<p>Checks were not made: {text(evaluation.summary.note)}.</p>"
    elif not (rows or left_out or evaluation.summary.left_out):
        html += "<p>This record names no check to make. The page shows what happened, not whether it is right.</p>"
    if left_out and not evaluation.summary.note:
        html += (
            f"<p>Not made, because the record does not reach the end of what they look at: {and_list(left_out)}.</p>"
        )
    for name, why in evaluation.summary.left_out.items():
        html += f"<p>Not made, {text(plain(name))}: {text(why)}.</p>"
    return PageSection("checks", "Checks", "Did the checks hold?", html, {})


def _check_row(name: str, check: Any, entry: Any) -> tuple[str, ...]:
    note = f'<br><span class="muted">{text(check["note"])}</span>' if check["note"] else ""
    return (
        f"<b>{text(name.replace('_', ' '))}</b><br><span class='muted'>{_subject(entry)}</span>{_reason(entry)}{note}",
        number(check["value"], 6),
        number(check["expected"], 6),
        f"\N{PLUS-MINUS SIGN} {number(check['tolerance'], 3)}",
        '<span class="pill good">met</span>' if check["ok"] else '<span class="pill bad">not met</span>',
    )


def _figure(check: Any) -> Figure | None:
    return FIGURES.get(str(check.get("measure"))) if isinstance(check, dict) else None


def _reason(check: Any) -> str:
    """Reasons of a check's bounds, HTML; empty if its figure does not give one."""
    figure = _figure(check)
    return "".join(f'<br><span class="muted why">{escape(part)}</span>' for part in (figure.reasons if figure else ()))


def _subject(check: Any) -> str:
    """Measured quantity and window of a check, HTML."""
    if not isinstance(check, dict):
        return ""
    if figure := _figure(check):
        what = text(figure.meaning)
    else:
        what = f"{text(check.get('reduce', ''))} of {text(check.get('signal', ''))}"
    of = f", {text(check['of'])}" if check.get("of") else ""
    try:
        start, end = float(check.get("from") or 0.0), check.get("to")
        when = f"; {number(start)} to {number(float(end))} s" if end is not None else f"; from {number(start)} s on"
    except (TypeError, ValueError):
        when = ""
    return f"{what}{of}{when}"


ABOUT = (
    "RMS over the run, by runs with longer steps. An error is relative to the observable's own RMS, or to a floor where"
    " that is small. The largest of those that count is the error of the run. The order is that of the differences;"
    " without one, or outside of 0.5 to 2.5, the factor of safety is 3, else 1.25. Coupling is the part of the"
    " communication step, integration that of the steps inside components; they have signs and may cancel, so that the"
    " whole is smaller than each. What many links or both drives have is one vector, the error in its unit its length."
)
SENSITIVE = "instant by instant, sensitive: does not count"


def exactness(pair: Pair) -> PageSection:
    """Section with a row for each observable, or the reason why there is none."""
    error = pair.run.result("error")
    rows = _error_rows(error.get("observables")) if isinstance(error, dict) else []
    if rows:
        head = "Observable", "Relative", "Order", "Coupling", "Integration", "Estimated error"
        html = f"<p>{ABOUT}</p>{table(head, rows, 'numbers')}"
    else:
        message = text(error.get("message") or "") if isinstance(error, dict) else ""
        reason = message or "no coarser run was made beside it (<code>cotrack run</code> makes one by default)"
        html = f"<p>The error of this run was not estimated: {reason}.</p>"
    return PageSection("exactness", "Error", "How large is the error of its steps?", html, {})


def _error_rows(observables: Any) -> list[tuple[str, ...]]:
    """Rows of observables, decisive ones first, the largest error first; without errors that are no numbers."""
    named = observables.items() if isinstance(observables, dict) else ()
    numeric = [
        (name, observable)
        for name, observable in named
        if isinstance(observable, dict) and _is_number(observable.get("total"))
    ]
    rows = []
    for name, observable in sorted(numeric, key=lambda item: (not item[1].get("decisive"), -item[1]["total"])):
        what, share = text(name.replace("_", " ")), percent(observable["total"], 2)
        parts = (observable.get(part) for part in ("coupling", "integration"))
        shares = (percent(part, 2) if _is_number(part) else "" for part in parts)
        order = number(observable["order"], 2) if _is_number(observable.get("order")) else ""
        absolute, unit = observable.get("absolute"), str(observable.get("unit", "")).replace("N m", "N.m")
        error = quantity(absolute, unit, 3) if _is_number(absolute) else ""
        if observable.get("decisive"):
            rows.append((what, f"<b>{share}</b>", order, *shares, error))
        else:
            rows.append((f"{what}<br><span class='muted'>{SENSITIVE}</span>", share, order, *shares, error))
    return rows


def _is_number(value: Any) -> TypeGuard[float]:
    return isinstance(value, (int, float)) and not isinstance(value, bool) and math.isfinite(value)


WORDS = {"good": "complete", "fair": "not whole", "bad": "not complete"}
RECOVERED = "recovered from a broken log"  # message of ``cotrack log recover``
LIMITS = (
    f"Curves are thinned for a screen: of each of {BINS} equal intervals of time the smallest and the largest value are"
    " kept, so that no peak is lost. What lies between is in the record.",
    "Outputs of single links are recorded more seldom than steps are made. A link may have borne more between two"
    " records; the largest tension of all links is known at every recorded step.",
    "Checks compare with what the scene expects. They do not show that the model is right for a real vehicle.",
    "An estimated error is one of steps and coupling, not of the parameters of the model.",
    "Pressure is the vertical force on a link over its whole area. How it is spread within a link is not recorded.",
)
CHEAP = 2e8  # bytes of both logs together: larger ones are not compared bit by bit


def comparison(pair: Pair) -> PageSection | None:
    """Section with the differences by observable, and the first different bit; None without a reference."""
    if pair.reference is None:
        return None
    run, reference = pair.run.run, pair.reference.run
    missing: list[str] = []
    html = (
        f"<p>The reference is <b>{text(reference.log.path.name)}</b>. In all charts over time its curves are dashed;"
        " the side view draws its chain as a thin line, the map of tensions can show it, profiles show the run"
        " alone.</p>"
    )
    html += table(("", "Run", "Reference"), _settings(run, reference))
    if found := attempt(lambda: differences(run, reference), missing):
        decisive = {name: difference for name, difference in found.items() if difference.decisive}
        if decisive:
            largest = max(decisive, key=lambda name: decisive[name].relative)
            html += (
                f'<p class="lead">The runs are <b>{percent(worst(found), 2)}</b> apart, by the observable that differs'
                f" most, {text(largest.replace('_', ' '))}.</p>"
            )
        rows = [
            (
                text(name.replace("_", " ")),
                quantity(difference.absolute, difference.unit.replace("N m", "N.m"), 3),
                percent(difference.relative, 2),
                "" if difference.decisive else f"<span class='muted'>{SENSITIVE}</span>",
            )
            for name, difference in found.items()
        ]
        html += table(("Observable", "RMS difference", "of the reference", ""), rows)
    html += _first_difference(run.log, reference.log)
    html += "".join(f"<p>{text(reason)}</p>" for reason in missing)
    return PageSection("compared", "Against reference", "How far is it from the reference?", html, {})


def _settings(run: RunData, reference: RunData) -> list[tuple[str, str, str]]:
    settings, reference_settings = (data.log.metadata.get("run", {}) for data in (run, reference))
    rows = [("record", text(run.log.path.name), text(reference.log.path.name))]
    for key in ("scene", "track", "coupling", "step", "stop", "fmus"):
        if key in settings or key in reference_settings:
            default = "python" if key == "fmus" else ""
            rows.append((key, text(settings.get(key, default)), text(reference_settings.get(key, default))))
    pair = given_parts(run), given_parts(reference)
    for name in dict.fromkeys([*pair[0], *pair[1]]):
        first, second = (text(parts.get(name, "part of cotrack")) for parts in pair)
        rows.append((instance(name), first, second))
    return rows


def _first_difference(log: Log, reference: Log) -> str:
    if log.size + reference.size > CHEAP:
        return "<p>Where they part bit by bit: <code>cotrack compare A B --bits</code>.</p>"
    result = attempt(lambda: divergence(log, reference), [])
    if result is None:
        return ""
    if result.first is None:
        return f"<p>Bit by bit they are equal in all {result.value_count} numbers that both hold.</p>"
    first = result.first
    return (
        f"<p>They part first in <code>{text(first.instance)}.{text(first.variable)}</code> at step {first.step},"
        f" t = {number(first.t)} s.</p>"
    )


def completeness(log: Log) -> tuple[str, str]:
    """Completeness of a record: good, fair or bad, and a sentence, HTML."""
    if log.closing is None:
        return "bad", "The record was cut off: it has no closing record, and what came after its last piece is lost."
    if log.closing["message"].startswith(RECOVERED):
        return (
            "bad",
            f"This record was saved from a broken one and lacks what was lost: {text(log.closing['message'])}.",
        )
    try:
        log.check_seal()
    except LogUnreadable as damage:
        return "bad", f"The record is not as it was written: {text(damage)}"
    if not log.complete:
        return "fair", f"All topics are as recorded, but the file is not whole: {text(' '.join(log.faults))}"
    sealed = "it is as it was sealed" if log.seal else "it has no seal"
    topics = f"all {len(log.closing['sha256'])} topics have the sha256 that the run wrote when it ended"
    return "good", f"The record is complete: {topics}, and {sealed}."


def provenance(pair: Pair, plotting: str) -> PageSection:
    """Section with the records of both runs, the limits of the page, and evaluations that failed."""
    html = _run_record(pair.run, "run") + (_run_record(pair.reference, "reference") if pair.reference else "")
    html += (
        f"<h3>What this page cannot say</h3><ul>{''.join(f'<li>{limit}</li>' for limit in LIMITS)}</ul>"
        f"<p class='muted'>Made by <code>cotrack report</code>; curves are drawn by {text(plotting)}, which is part of"
        " this file. The page asks nothing of any other machine.</p>"
    )
    if missing := list(dict.fromkeys(pair.run.missing)):
        sentences = "; ".join(text(reason) for reason in missing)
        html += f"<p>Left out, because the record does not hold it: {sentences}.</p>"
    return PageSection("made", "How it was made", "How was this page made, and what can it not say?", html, {})


def _run_record(evaluation: Evaluation, role: str) -> str:
    """Record of a run: completeness, digest, and commands that verify it; HTML."""
    log = evaluation.run.log
    grade, sentence = completeness(log)
    name = text(log.path.name)
    facts = [
        ("size", f"{number(log.size / 1e6, 3)} MB"),
        ("digest", f"<code>{text(attempt(log.digest, []) or '')}</code><br>"
                   "<span class='muted'>equal runs have equal digests</span>"),
        *[("seal", f"<code>{text(log.seal)}</code><br><span class='muted'>of all that this file holds;"
                   " it does not say who made it</span>")] * bool(log.seal),
        *[("run it again", f"<code>{text(evaluation.summary.command)}</code>")] * bool(evaluation.summary.command),
        ("is it as written?", f"<code>cotrack log verify {name}</code>"),
        *(
            ("does a component give the same again?", f"<code>cotrack replay {name} --component {text(one)}</code>")
            for one in evaluation.run.instances[:1]
        ),
    ]  # fmt: skip
    html = (
        f"<h3>{role.capitalize()}: {name}</h3><p><span class='pill {grade}'>{WORDS[grade]}</span> {sentence}</p>"
        f"<dl class='facts'>{''.join(f'<dt>{term}</dt><dd>{value}</dd>' for term, value in facts)}</dl>"
    )
    if topics := sorted((log.closing or {}).get("sha256", {}).items()):
        rows = [(f"<code>{text(topic)}</code>", f"<code>{text(value)}</code>") for topic, value in topics]
        html += (
            f"<details><summary>sha256 of every topic</summary>{table(('Topic', 'sha256'), rows)}<p class='muted'>"
            "Inputs (/in) that are outputs of others hold only times: equal ones are no mistake.</p></details>"
        )
    return html


MEASURED_HEAD = ("Signal", "Window", "RMS", "Relative", "Mean", "Largest", "Correlation", "Instants")
MEASURED_NOTE = (
    "Differences are run minus measured, at the instants of the sparser record; an instant next to a gap of the"
    " measured signal is left out. Relative is the RMS over that of the measured signal."
)


def measured(pair: Pair) -> PageSection | None:
    """Section with a row for each signal and window, and a chart for each signal; None without a measured record."""
    if pair.measured is None:
        return None
    record, content = pair.measured.record, Content()
    whole = {each.signal: each for each in pair.measured.differences if each.window == WHOLE}
    for k, signal in enumerate(record.signals):
        if drawn := _traces(pair, signal):
            chart = pair.over_time(signal.signal.partition(".")[2], signal.unit, drawn)
            apart = f"RMS difference {quantity(whole[signal.signal].rms, signal.unit, 3)}"
            note = f"Measured as {text(signal.column)}. {apart}, {percent(whole[signal.signal].relative)}."
            content.add_figure(f"measured-{k}", chart, text(signal.signal), note)
    content.as_grid()
    name = f"The measured record is <b>{text(record.file.name)}</b>, {number(record.shift, 6)} s added to its times."
    html = "".join(f"<p>{sentence}</p>" for sentence in (f"{name} {MEASURED_NOTE}", *map(text, record.notes)))
    html += table(MEASURED_HEAD, [_measured_row(each) for each in pair.measured.differences], "phases")
    title = "How far is it from the measurement?"
    return PageSection("measured", "Measured", title, html + content.html, content.charts)


def _measured_row(each: SignalDifference) -> tuple[str, ...]:
    left_out = f"<br><span class='muted'>{each.left_out} left out</span>" if each.left_out else ""
    instance, _, variable = each.signal.partition(".")
    return (
        f"<b>{text(variable)}</b><br><span class='muted'>{text(instance)}</span>" if each.window == WHOLE else "",
        f"{text(each.window)}<br><span class='muted'>{number(each.start)} to {number(each.end)} s</span>",
        quantity(each.rms, each.unit, 3),
        percent(each.relative),
        quantity(each.mean, each.unit, 3),
        f"{quantity(each.largest, each.unit, 3)}<br><span class='muted'>at {number(each.at)} s</span>",
        number(each.correlation) if each.correlation == each.correlation else "",
        f"{each.instants}{left_out}",
    )


def _traces(pair: Pair, measured: MeasuredSignal) -> list[Trace]:
    """Curves of the run and of the measured signal; the moving mean of the latter if the run's is a band."""
    run, window = pair.run.run, pair.run.ripple.window
    own = _curve(run, *run.signal(measured.signal, EVER), measured.unit)
    inside = within(measured.t, Window(*run.span))
    other = _curve(run, measured.t[inside], measured.values[inside], measured.unit)
    if own is None or other is None:
        return []
    mean = own.moving_mean.over(window) if own.curve.is_band(*run.span) else None
    beside = other.moving_mean.over(window) if mean else other.curve
    traces = [Trace("run", own.curve, 0, mean)]
    return [*traces, Trace("measured", _where_measured(beside, measured, run.span), 0, reference=True)]


def _curve(run: RunData, t: Floats, values: Floats, unit: str) -> SignalCurve | None:
    """Thinned curve; None without finite values."""
    collector = CurveCollector(run, 1)
    collector.add(t, values[:, None])
    return collector.curves(["signal"], [unit]).get("signal")


def _where_measured(curve: Curve, measured: MeasuredSignal, span: tuple[float, float]) -> Curve:
    """Curve within the record, interrupted in its gaps that are wide enough to be seen."""
    known = np.flatnonzero(~np.isnan(measured.values))
    t = measured.t[known]
    gaps = np.flatnonzero((np.diff(known) > 1) & (np.diff(t) > (span[1] - span[0]) / BINS))
    inside = within(curve.t, Window(t[0], t[-1]))
    for k in gaps:
        inside &= ~((curve.t > t[k]) & (curve.t < t[k + 1]))
    places = 0.5 * (t[gaps] + t[gaps + 1])
    times, values = np.append(curve.t[inside], places), np.append(curve.y[inside], np.full(len(places), np.nan))
    order = np.argsort(times)
    return Curve(times[order], values[order])
