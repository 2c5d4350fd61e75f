"""Section of a page, the runs that it shows, and its HTML elements."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

from orchestrator.results.analyses.curves import SignalCurve
from orchestrator.results.page.charts import Chart, Trace, lines
from orchestrator.results.page.evaluation import Evaluation


class PageSection(NamedTuple):
    """Section of the page."""

    key: str  # anchor
    name: str  # in the table of contents
    title: str
    html: str
    charts: dict[str, Chart]  # by key of their figure


class Pair(NamedTuple):
    """Evaluated run and, if there is one, its reference."""

    run: Evaluation
    reference: Evaluation | None
    figures: dict[str, Any]  # key figures of the run (``key_figures.figures``)

    def lines(self, named: Sequence[tuple[str, str]], colour: int = 0) -> list[Trace]:
        """Lines of signals, given with their labels, of both runs; signals that a run lacks are left out.

        Colours count from ``colour``.
        """
        known = [(signal, name, k) for k, (signal, name) in enumerate(named, colour) if signal in self.run.signals]
        covered = len(known) == 2 and _alike(*(self.run.signals[signal] for signal, *_ in known))
        window = self.run.ripple.window
        means = {signal: self.run.mean(signal, window) for signal, *_ in known}
        found = [
            Trace(name, self.run.signals[signal].curve, k, means[signal], behind=covered and not place)
            for place, (signal, name, k) in enumerate(known)
        ]
        others = self.reference.signals if self.reference and known else {}
        for k, (signal, name) in enumerate(named, colour):
            if other := others.get(signal):  # one band is enough: the reference of a band is its mean
                curve = other.moving_mean.over(window) if means.get(signal) else other.curve
                found.append(Trace(f"{name}, reference", curve, k, reference=True))
        return found

    def over_time(self, quantity: str, unit: str, drawn: Sequence[Trace]) -> Chart:
        """Chart of lines over time."""
        return lines(quantity, unit, drawn, window=self.run.ripple.description)


def _alike(one: SignalCurve, other: SignalCurve) -> bool:
    """True if the curve of one signal covers that of the other."""
    size = max(abs(one.largest.value), abs(other.largest.value))
    apart = abs(one.most.value - other.most.value), abs(one.least.value - other.least.value)
    return max(apart) <= 1e-2 * size


class Content:
    """HTML of a section in the making, and its charts."""

    def __init__(self) -> None:
        self.html, self.charts = "", dict[str, Chart]()

    def figure(self, key: str, chart: Chart, title: str, note: str = "", size: str = "", choice: str = "") -> None:
        """Add a chart; ``size``: tall or wide; ``choice``: HTML that selects between its values."""
        self.charts[key] = chart
        caption = f"<h3>{title}</h3>" + (f"<p>{note}</p>" if note else "") + choice
        self.html += (
            f'<figure class="{size}"><figcaption>{caption}</figcaption>'
            f'<div class="chart {size}" id="chart-{key}" role="img" aria-label="{title}"></div></figure>'
        )

    def grid(self, key: str, name: str, title: str) -> PageSection | None:
        """Section with the figures side by side; None without any."""
        html = f'<div class="grid">{self.html}</div>'
        return PageSection(key, name, title, html, self.charts) if self.charts else None


def table(head: Sequence[str], rows: Iterable[Sequence[str]], classes: str = "") -> str:
    """HTML table of cells that are HTML."""
    top = "".join(f'<th scope="col">{cell}</th>' for cell in head)
    body = "".join(f"<tr>{''.join(f'<td>{cell}</td>' for cell in row)}</tr>" for row in rows)
    return (
        f'<div class="scroll"><table class="{classes}"><thead><tr>{top}</tr></thead><tbody>{body}</tbody></table></div>'
    )
