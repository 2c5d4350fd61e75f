"""Section of a page, the runs that it shows, its HTML elements, and its charts as JSON tables for the script."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from orchestrator.log.time_series import Floats
from orchestrator.results.analyses.circuit import Stretch
from orchestrator.results.analyses.curves import SignalCurve
from orchestrator.results.analyses.fatigue import StressLifeLine
from orchestrator.results.approximations import Curve, Peak
from orchestrator.results.measured_difference import MeasuredComparison
from orchestrator.results.page.embedded import floats, text
from orchestrator.results.page.evaluation import Evaluation
from orchestrator.results.units import scaled

Chart = dict[str, Any]
COLOURS = 6  # of the page
DASHES = ("9 9", "3 3", "9 3 3 3", "15 15")  # of references, as page.js has them
FLAT = 1e-5  # of the largest value


class Trace(NamedTuple):
    """Curve of a chart."""

    name: str
    curve: Curve
    colour: int  # index of the page's colours
    mean: Curve | None = None  # moving mean, if the curve is a band
    reference: bool = False  # drawn dashed
    behind: bool = False  # drawn broad, so that it shows under a curve that covers it
    points: bool = False  # its samples are marked

    def scaled_by(self, factor: float) -> Trace:
        """Trace in another unit."""
        return self._replace(curve=self.curve.scaled_by(factor), mean=self.mean and self.mean.scaled_by(factor))


def lines(
    quantity: str,
    unit: str,
    traces: Iterable[Trace],
    *,
    x: str = "time, s",
    timed: bool = True,
    stretches: Sequence[Stretch] = (),
    mark: Peak | None = None,
    window: str = "",
) -> Chart:
    """Chart of curves over time or over ``x``.

    ``stretches``: named parts of x; ``mark``: a marked point; ``window``: averaging time of means, in words.
    """
    curves = list(traces)
    size = max((float(np.nanmax(np.abs(line.curve.y), initial=0.0)) for line in curves), default=0.0)
    factor, name = scaled(size, unit)
    low, high = (
        min((float(np.nanmin(line.curve.y, initial=np.inf)) for line in curves), default=0.0),
        max((float(np.nanmax(line.curve.y, initial=-np.inf)) for line in curves), default=0.0),
    )
    level = high - low < FLAT * size  # rounding is not worth an axis
    return {
        "kind": "lines",
        "x": x,
        "y": f"{quantity}, {name}" if name else quantity,
        "timed": timed,
        "traces": [
            {
                "name": text(line.name),
                "t": floats(line.curve.t),
                "y": floats(line.curve.y / factor),
                "colour": line.colour,
                "reference": line.reference,
                "behind": line.behind,
                "points": line.points,
                "mean": {"t": floats(line.mean.t), "y": floats(line.mean.y / factor)} if line.mean else None,
            }
            for line in curves
        ],
        "sections": [[stretch.start, stretch.end, text(stretch.name)] for stretch in stretches],
        "mark": [mark.t, mark.value / factor] if mark else None,
        "named": len(curves) > 1,  # its legend names the curves
        "banded": any(line.mean for line in curves),  # its legend says what line and band are
        "window": text(window) if any(line.mean for line in curves) else "",
        "flat": [(low - 0.1 * size) / factor, (high + 0.1 * size) / factor] if level else None,
    }


def shared_legend(charts: Mapping[str, Chart]) -> str:
    """Legend of the curves that charts have in common, and of bands, HTML; the charts lose what it says."""
    keys_of: dict[tuple[tuple[str, int, bool], ...], list[str]] = {}
    for key, chart in charts.items():
        entries = tuple((trace["name"], trace["colour"], trace["reference"]) for trace in chart.get("traces", ()))
        keys_of.setdefault(entries, []).append(key)
    legend = ""
    for entries, keys in keys_of.items():
        if len(entries) > 1 and len(keys) > 1:
            legend += "".join(_entry(*entry, keys) for entry in entries)
            for key in keys:
                charts[key]["named"] = False
    banded = [chart for chart in charts.values() if chart.get("window")]
    if len(charts) > 1 and banded:
        legend += f"<span>line: mean over {banded[0]['window']}; light: least to most</span>"
        for chart in banded:
            chart["banded"] = False
    return f'<div class="key">{legend}</div>' if legend else ""


def _entry(name: str, colour: int, reference: bool, keys: Sequence[str]) -> str:
    """Entry of the legend of the charts ``keys``, which hides and shows a curve, HTML."""
    look = "reference" if reference else f"c{colour % COLOURS}"
    dashes = DASHES[colour % len(DASHES)] if reference else "none"
    sample = f'<svg width="30" height="4" stroke-dasharray="{dashes}"><path d="M0 2H30"/></svg>'
    where = f'data-trace="{text(name)}" data-charts="{" ".join(keys)}"'
    return f'<button type="button" class="{look}" {where}>{sample}{name}</button>'


def waterfall(rows: Sequence[tuple[str, float, str]]) -> Chart:
    """Chart of energies: name, amount, J, and role of each bar: "work", "stored", "lost" or "open"."""
    factor, unit = scaled(max((abs(energy) for _, energy, _ in rows), default=1.0), "J")
    return {
        "kind": "waterfall",
        "x": f"energy, {unit}",
        "labels": [text(name) for name, *_ in rows],
        "values": [energy / factor for _, energy, _ in rows],
        "roles": [role for *_, role in rows],
    }


def heat(
    quantity: str,
    unit: str,
    t: Floats,
    values: Floats,
    mark: tuple[float, int, str] | None = None,
    reference: Floats | None = None,
) -> Chart:
    """Chart of values (m, links) over time and link.

    ``mark``: time, link and label of a point; ``reference``: values (m, links) that the reader can choose instead.
    """
    factor, name = scaled(float(np.nanmax(np.abs(values), initial=0.0)), unit)
    return {
        "kind": "heat",
        "x": "time, s",
        "y": "link",
        "z": f"{quantity}, {name}",
        "t": floats(t),
        "links": values.shape[1],
        "values": floats(values.T / factor),
        "reference": None if reference is None else floats(reference.T / factor),
        "mark": [mark[0], mark[1], text(mark[2])] if mark else None,
    }


class PageSection(NamedTuple):
    """Section of the page, with the data of its charts."""

    key: str  # anchor
    name: str  # in the table of contents
    title: str
    html: str
    charts: dict[str, Chart]  # by key of their figure


class Pair(NamedTuple):
    """Evaluation of a run and, if there is one, of its reference."""

    run: Evaluation
    reference: Evaluation | None
    figures: dict[str, Any]  # key figures of the run (``heading.figures``)
    measured: MeasuredComparison | None = None
    line: StressLifeLine | None = None  # S-N line of the fatigue; None: the default one

    @property
    def named(self) -> list[tuple[Evaluation, str]]:
        """Both evaluations with their names."""
        return [(self.run, "run"), *([(self.reference, "reference")] if self.reference else [])]

    def lines(self, labelled: Sequence[tuple[str, str]], colour: int = 0) -> list[Trace]:
        """Curves of signals, given with their labels, of both runs; signals that a run lacks are left out.

        Colours count from ``colour``. A single signal is named after its run if there are two.
        """
        if self.reference and len(labelled) == 1:
            labelled = [(labelled[0][0], "run")]
        recorded = [
            (signal, name, k) for k, (signal, name) in enumerate(labelled, colour) if signal in self.run.signals
        ]
        covered = len(recorded) == 2 and _alike(*(self.run.signals[signal] for signal, *_ in recorded))
        window = self.run.ripple.window
        means = {signal: self.run.mean(signal, window) for signal, *_ in recorded}
        traces = [
            Trace(name, self.run.signals[signal].curve, k, means[signal], behind=covered and not number)
            for number, (signal, name, k) in enumerate(recorded)
        ]
        others = self.reference.signals if self.reference and recorded else {}
        for k, (signal, name) in enumerate(labelled, colour):
            if other := others.get(signal):  # one band is enough: the reference of a band is its mean
                curve = other.moving_mean.over(window) if means.get(signal) else other.curve
                other_name = "reference" if name == "run" else f"{name}, reference"
                traces.append(Trace(other_name, curve, k, reference=True))
        return traces

    def over_time(self, quantity: str, unit: str, traces: Sequence[Trace]) -> Chart:
        """Chart of lines over time."""
        return lines(quantity, unit, traces, window=self.run.ripple.description)


def _alike(first: SignalCurve, second: SignalCurve) -> bool:
    """True if the curve of one signal covers that of the other."""
    size = max(abs(first.largest.value), abs(second.largest.value))
    differences = abs(first.most.value - second.most.value), abs(first.least.value - second.least.value)
    return max(differences) <= 1e-2 * size


class Content:
    """HTML of a section in the making, and its charts."""

    def __init__(self) -> None:
        self.html, self.charts = "", dict[str, Chart]()

    def add_figure(self, key: str, chart: Chart, title: str, note: str = "", size: str = "", choice: str = "") -> None:
        """Add a chart; ``size``: tall or wide; ``choice``: HTML that selects between its values."""
        self.charts[key] = chart
        caption = f"<h3>{title}</h3>" + (f"<p>{note}</p>" if note else "") + choice
        self.html += (
            f'<figure class="{size}"><figcaption>{caption}</figcaption>'
            f'<div class="chart {size}" id="chart-{key}" role="img" aria-label="{title}"></div></figure>'
        )

    def as_grid(self) -> None:
        """Put the figures so far side by side, below the legend that they share."""
        self.html = f'{shared_legend(self.charts)}<div class="grid">{self.html}</div>'

    def as_section(self, key: str, name: str, title: str) -> PageSection | None:
        """Section with the figures side by side; None without any."""
        self.as_grid()
        return PageSection(key, name, title, self.html, self.charts) if self.charts else None


def table(head: Sequence[str], rows: Iterable[Sequence[str]], classes: str = "") -> str:
    """HTML table of cells that are HTML."""
    top = "".join(f'<th scope="col">{cell}</th>' for cell in head)
    body = "".join(f"<tr>{''.join(f'<td>{cell}</td>' for cell in row)}</tr>" for row in rows)
    return (
        f'<div class="scroll"><table class="{classes}"><thead><tr>{top}</tr></thead><tbody>{body}</tbody></table></div>'
    )
