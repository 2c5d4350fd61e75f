"""Charts as tables for the script of the page: what is drawn, in which unit, in whose colour."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np

from orchestrator.log.time_series import Floats
from orchestrator.results.page.circuit import Section
from orchestrator.results.page.embedded import floats
from orchestrator.results.page.words import scaled, text
from orchestrator.results.thinned import Curve, Peak

Chart = dict[str, Any]
FLAT = 1e-5  # of the largest value


class Line(NamedTuple):
    """A curve of a chart."""

    name: str
    curve: Curve
    colour: int  # place in the page's row of colours
    mean: Curve | None = None  # of a curve that is a band: the line through it
    reference: bool = False  # drawn dashed
    behind: bool = False  # drawn broad, so that one that covers it leaves it visible
    points: bool = False  # its samples are marked

    def times(self, factor: float) -> Line:
        """The same in another unit."""
        return self._replace(curve=self.curve.times(factor), mean=self.mean and self.mean.times(factor))


def lines(
    quantity: str,
    unit: str,
    drawn: Iterable[Line],
    *,
    x: str = "time, s",
    timed: bool = True,
    sections: Sequence[Section] = (),
    mark: Peak | None = None,
    window: str = "",
) -> Chart:
    """Curves over time, or over something else; ``window``: what the means of bands are over, in words."""
    curves = list(drawn)
    size = max((float(np.nanmax(np.abs(line.curve.y), initial=0.0)) for line in curves), default=0.0)
    by, name = scaled(size, unit)
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
                "y": floats(line.curve.y / by),
                "colour": line.colour,
                "reference": line.reference,
                "behind": line.behind,
                "points": line.points,
                "mean": {"t": floats(line.mean.t), "y": floats(line.mean.y / by)} if line.mean else None,
            }
            for line in curves
        ],
        "sections": [[section.start, section.end, text(section.name)] for section in sections],
        "mark": [mark.t, mark.value / by] if mark else None,
        "window": text(window) if any(line.mean for line in curves) else "",
        "flat": [(low - 0.1 * size) / by, (high + 0.1 * size) / by] if level else None,
    }


def waterfall(rows: Sequence[tuple[str, float, str]]) -> Chart:
    """Energies, J, of work by what became of it: name, amount, and "work", "stored", "lost" or "open"."""
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
    """Values (m, links) over time and link; ``mark``: time, link and a word; ``reference``: to be shown instead."""
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
