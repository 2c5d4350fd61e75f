"""Picture of a sweep: each figure over each varied key and, if two keys are numbers, as a map."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from itertools import product
from typing import Any

import numpy as np

from orchestrator.results.table import Column, Table, cell_text
from orchestrator.studies.files import Picture, new_figure
from orchestrator.studies.variations import Design, Variation

MOST_CURVES = 8  # that a legend names
MOST_MAPS = 4  # of a figure
ACROSS = 4  # panes in a line, unless a figure has more

Record = Mapping[str, Any]  # of a case, by key of the columns


def draw(design: Design, table: Table, title: str) -> Picture:
    """Draw the columns of numbers behind the varied keys, panes over every key and maps for each."""
    records, variations = table.records(), design.variations
    drawn = [column for column in table.columns[len(variations) :] if _has_numbers(records, column.key)]
    numbers = [one for one in variations if one.is_number]
    words = [one for one in variations if not one.is_number]
    combinations = list(product(*([value.shown for value in one.values] for one in words)))
    maps = combinations if len(numbers) == 2 and len(combinations) <= MOST_MAPS else []
    across = len(variations) + len(maps)  # panes of a figure
    side_by_side = max(ACROSS // across, 1)  # figures
    down = max(-(-len(drawn) // side_by_side), 1)
    figure = new_figure(4.4 * across * side_by_side, 2.6 * down + 0.5)
    panes = figure.subplots(down, across * side_by_side, squeeze=False).reshape(-1, across)
    for pane in panes[len(drawn) :].flat:
        pane.set_axis_off()
    for line, column in zip(panes, drawn, strict=False):
        for pane, one in zip(line, variations, strict=False):
            _draw_curves(pane, design, one, records, column)
            if column is drawn[0] and 1 < len(pane.lines) <= MOST_CURVES:
                pane.legend(fontsize=7)
        values = [_number(record[column.key]) for record in records]
        for pane, combination in zip(line[len(variations) :], maps, strict=True):
            chosen = [each for each in records if tuple(each[one.key] for one in words) == combination]
            mesh = _draw_map(pane, design, numbers, chosen, column)
            mesh.set_clim(np.nanmin(values), np.nanmax(values))  # one scale for all maps of a figure
            figure.colorbar(mesh, ax=pane)
            pane.set_title(", ".join([column.head, *map(str, combination)]), fontsize=9)
    figure.suptitle(title, fontsize=12)
    return figure


def _has_numbers(records: Sequence[Record], key: str) -> bool:
    return any(isinstance(record[key], float) and math.isfinite(record[key]) for record in records)


def _number(value: float | None) -> float:
    return math.nan if value is None else value


def _draw_curves(pane: Any, design: Design, x: Variation, records: Sequence[Record], column: Column) -> None:
    """Draw a figure over a key, a curve for each combination of the other keys; sampled points are dots."""
    others = [one for one in design.variations if one is not x and not one.ends]
    curves: dict[str, list[Record]] = {}
    for record in sorted(records, key=lambda record: record[x.key]) if x.is_number else records:
        name = ", ".join(f"{one.key.rpartition('.')[2]} = {cell_text(record[one.key], '.6g')}" for one in others)
        curves.setdefault(name, []).append(record)
    for name, curve in curves.items():
        values = [_number(record[column.key]) for record in curve]
        pane.plot([record[x.key] for record in curve], values, "o" if design.sample else "o-", markersize=4, label=name)
    pane.set_xlabel(x.head, fontsize=8)
    pane.set_ylabel(column.head, fontsize=8)
    pane.grid(color="0.93")


def _draw_map(pane: Any, design: Design, keys: Sequence[Variation], records: Sequence[Record], column: Column) -> Any:
    """Draw a figure over two keys: cells of a grid, or sampled points; return what a colour bar needs."""
    x, y = ([record[one.key] for record in records] for one in keys)
    values = [_number(record[column.key]) for record in records]
    pane.set_xlabel(keys[0].head, fontsize=8)
    pane.set_ylabel(keys[1].head, fontsize=8)
    if design.sample:
        return pane.scatter(x, y, c=values)
    across, down = sorted(set(x)), sorted(set(y))
    cells = np.full((len(down), len(across)), np.nan)
    for i, j, value in zip(x, y, values, strict=True):
        cells[down.index(j), across.index(i)] = value
    return pane.pcolormesh(across, down, cells, shading="nearest")
