"""Charts as JSON tables for the script of the page: curves, bars and maps with their units and colours."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from orchestrator.log.time_series import Floats
from orchestrator.results.analyses.circuit import Stretch
from orchestrator.results.page.embedded import floats
from orchestrator.results.page.words import text
from orchestrator.results.thinned import Curve, Peak
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
