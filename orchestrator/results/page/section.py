"""Section of a page, the runs that it shows, and its HTML elements."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

from orchestrator.results.analyses.curves import SignalCurve
from orchestrator.results.analyses.fatigue import StressLifeLine
from orchestrator.results.measured_difference import MeasuredComparison
from orchestrator.results.page.charts import Chart, Trace, lines, shared_legend
from orchestrator.results.page.evaluation import Evaluation


class PageSection(NamedTuple):
    """Section of the page."""

    key: str  # anchor
    name: str  # in the table of contents
    title: str
    html: str
    charts: dict[str, Chart]  # by key of their figure


class Pair(NamedTuple):
    """Evaluation of a run and, if there is one, of its reference."""

    run: Evaluation
    reference: Evaluation | None
    figures: dict[str, Any]  # key figures of the run (``key_figures.figures``)
    measured: MeasuredComparison | None = None
    line: StressLifeLine | None = None  # S-N line of the fatigue; None: the default one

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
                traces.append(Trace(_of_reference(name), curve, k, reference=True))
        return traces

    def over_time(self, quantity: str, unit: str, traces: Sequence[Trace]) -> Chart:
        """Chart of lines over time."""
        return lines(quantity, unit, traces, window=self.run.ripple.description)


def _of_reference(name: str) -> str:
    return "reference" if name == "run" else f"{name}, reference"


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
