"""Picture of a sweep: each figure over each varied key and, if two keys are numbers, as a map."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from itertools import pairwise, product
from typing import Any

import numpy as np

from orchestrator.results.output_files import Picture, new_figure
from orchestrator.results.table import Column, Table, cell_text
from orchestrator.results.units import scaled
from orchestrator.studies.variations import Design, Variation

MAX_CURVES = 8  # that a legend names
MAX_MAPS = 4  # of a figure
COLOURS = ("viridis", "plasma", "cividis", "cool")  # of curves, by the key that they are curves over
WIDE = 100.0  # largest over least of positive figures that are drawn on a logarithmic scale
NUMBERS = " pin"  # ends the key of a column that numbers parts, which is no figure
ACROSS = 4  # panes in a line, unless a figure has more
Record = Mapping[str, Any]  # of a case, by key of the columns


def draw(design: Design, table: Table, title: str) -> Picture:
    """Draw the columns of numbers behind the varied keys, panes over every key and maps for each."""
    records, variations = table.records(), design.variations
    figures = [column for column in table.columns[len(variations) :] if not column.key.endswith(NUMBERS)]
    drawn = [column for column in figures if _varies(records, column.key)]
    scales = {column.key: _scale(records, column) for column in drawn}
    numbers = [one for one in variations if one.is_number]
    words = [one for one in variations if not one.is_number]
    combinations = list(product(*([value.shown for value in one.values] for one in words)))
    maps = combinations if len(numbers) == 2 and len(combinations) <= MAX_MAPS else []
    across = len(variations) + len(maps)  # panes of a figure
    side_by_side = max(ACROSS // across, 1)  # figures
    down = max(-(-len(drawn) // side_by_side), 1)
    figure = new_figure(4.4 * across * side_by_side, 2.6 * down + 0.5)
    panes = figure.subplots(down, across * side_by_side, squeeze=False).reshape(-1, across)
    for pane in panes[len(drawn) :].flat:
        pane.set_axis_off()
    for line, column in zip(panes, drawn, strict=False):
        for pane, one in zip(line, variations, strict=False):
            _draw_curves(pane, design, one, records, column, scales[column.key])
            if column is drawn[0] and 1 < len(pane.lines) <= MAX_CURVES:
                pane.legend(fontsize=7)
        factor, head = scales[column.key]
        values = [factor * _number(record[column.key]) for record in records]
        wide = np.nanmin(values) > 0.0 and np.nanmax(values) > WIDE * np.nanmin(values)
        for pane in line[: len(variations)] if wide else ():
            pane.set_yscale("log")
        for pane, combination in zip(line[len(variations) :], maps, strict=True):
            chosen = [each for each in records if tuple(each[one.key] for one in words) == combination]
            mesh = _draw_map(pane, design, numbers, chosen, column, factor)
            if wide:
                mesh.set_norm("log")
            mesh.set_clim(np.nanmin(values), np.nanmax(values))  # one scale for all maps of a figure
            figure.colorbar(mesh, ax=pane)
            pane.set_title(", ".join([head, *map(str, combination)]), fontsize=9)
    figure.suptitle(title, fontsize=12)
    return figure


def _varies(records: Sequence[Record], key: str) -> bool:
    """Whether there are numbers under a key, and not all the same."""
    values = {record[key] for record in records if isinstance(record[key], float) and math.isfinite(record[key])}
    return len(values) > 1


def _scale(records: Sequence[Record], column: Column) -> tuple[float, str]:
    """Factor of the numbers of a column, and its heading with the prefix of the unit that they are shown in."""
    largest = max(abs(_number(record[column.key])) for record in records if isinstance(record[column.key], float))
    size, shown = scaled(largest, column.unit)
    return 1.0 / size, column.head.removesuffix(column.unit) + shown


def _number(value: float | None) -> float:
    return math.nan if value is None else value


def _draw_curves(
    pane: Any, design: Design, x: Variation, records: Sequence[Record], column: Column, scale: tuple[float, str]
) -> None:
    """Draw a figure over a key, a curve for each combination of the other keys; sampled points are dots.

    A colour means the same combination in all panes over that key, and is none of those over another key.
    """
    factor, head = scale
    others = [one for one in design.variations if one is not x and not one.ends]
    curves: dict[str, list[Record]] = {}
    for record in sorted(records, key=lambda record: record[x.key]) if x.is_number else records:
        named = ((one.key.rpartition(".")[2], cell_text(record[one.key], ".6g"), one.unit) for one in others)
        name = ", ".join(f"{key} = {text} {unit}".rstrip() for key, text, unit in named)
        curves.setdefault(name, []).append(record)
    from matplotlib import colormaps  # loaded where a picture is drawn

    colours = colormaps[COLOURS[design.variations.index(x) % len(COLOURS)]]
    for k, (name, curve) in enumerate(curves.items()):
        values, style = [factor * _number(record[column.key]) for record in curve], "o" if design.sample else "o-"
        colour = colours(0.15 + 0.7 * k / max(len(curves) - 1, 1))
        pane.plot([record[x.key] for record in curve], values, style, markersize=4, label=name, color=colour)
    pane.set_xlabel(x.head, fontsize=8)
    pane.set_ylabel(head, fontsize=8)
    pane.grid(color="0.93")


def _draw_map(
    pane: Any, design: Design, keys: Sequence[Variation], records: Sequence[Record], column: Column, factor: float
) -> Any:
    """Draw a figure over two keys: cells of a grid, or sampled points; return what a colour bar needs."""
    x, y = ([record[one.key] for record in records] for one in keys)
    values = [factor * _number(record[column.key]) for record in records]
    pane.set_xlabel(keys[0].head, fontsize=8)
    pane.set_ylabel(keys[1].head, fontsize=8)
    if design.sample:
        return pane.scatter(x, y, c=values)
    across, down = sorted(set(x)), sorted(set(y))
    cells = np.full((len(down), len(across)), np.nan)
    for i, j, value in zip(x, y, values, strict=True):
        cells[down.index(j), across.index(i)] = value
    return pane.pcolormesh(tile_edges(across), tile_edges(down), cells)


def tile_edges(values: Sequence[float]) -> list[float]:
    """Edges of tiles of ordered values: halfway, at the ends as far; that of positive values above half the first."""
    gaps = [0.5 * (b - a) for a, b in pairwise(values)] or [0.5 * abs(values[0]) or 0.5]
    first = max(values[0] - gaps[0], 0.5 * values[0]) if values[0] > 0.0 else values[0] - gaps[0]
    return [first, *(a + gap for a, gap in zip(values[:-1], gaps, strict=False)), values[-1] + gaps[-1]]
