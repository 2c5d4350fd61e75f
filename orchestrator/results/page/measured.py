"""Section with the difference of a run from measured signals, and the curves of both."""

from __future__ import annotations

import numpy as np

from orchestrator.log.time_series import Floats
from orchestrator.results.analyses.curves import CurveCollector, SignalCurve
from orchestrator.results.approximations import BINS, Curve
from orchestrator.results.measured_difference import WHOLE, SignalDifference
from orchestrator.results.measured_record import MeasuredSignal
from orchestrator.results.page.embedded import quantity, text
from orchestrator.results.page.section import Content, PageSection, Pair, Trace, table
from orchestrator.results.run_data import EVER, RunData, Window, within
from orchestrator.results.units import number, percent

HEAD = ("Signal", "Window", "RMS", "Relative", "Mean", "Largest", "Correlation", "Instants")
NOTE = (
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
    html = "".join(f"<p>{sentence}</p>" for sentence in (f"{name} {NOTE}", *map(text, record.notes)))
    html += table(HEAD, [_row(each) for each in pair.measured.differences], "phases")
    title = "How far is it from the measurement?"
    return PageSection("measured", "Measured", title, html + content.html, content.charts)


def _row(each: SignalDifference) -> tuple[str, ...]:
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
