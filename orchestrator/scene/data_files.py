"""Points over time or speed, points of a path and arcs from files, read with the scene: logs need no files."""

from __future__ import annotations

import csv
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from fmus.vehicles.tables import BadInput
from orchestrator.files.budget import CSV, ROWS
from orchestrator.files.columns import head, no_data, unit_size
from orchestrator.files.csv_lines import csv_lines

Tables = dict[str, Any]  # raw scene
UNITS = {  # of both columns of the keys that may name a file, where its head gives none
    "speed_points": ("s", "rad/s"),
    "torque_points": ("s", "N m"),
    "brake_points": ("s", "N m"),
    "engine_points": ("rad/s", "N m"),
    "drag_points": ("m/s", "N"),
    "points": ("m", "m"),
    "arcs": ("m", "rad/m"),
}
OF_DRIVER = UNITS | {"speed_points": ("s", "m/s")}
TABLES = ("drive", "idler_drive", "driver", "hitch")


def read_files(table: Tables, folder: Path, where: str) -> None:
    """Replace the files that drives, driver and hitch of a raw scene name by their points.

    Paths are relative to ``folder``. Raises BadInput, with a message that begins with ``where``, for files that
    cannot be read.
    """
    for name, drive in _drives(table):
        for key, units in (OF_DRIVER if name == "driver" else UNITS).items():
            if isinstance(drive.get(key), str):
                path = folder / drive[key]
                drive[key] = _read_pairs(path, f"{where}: {name}.{key} = '{path}'", units)


def _drives(table: Tables) -> Iterator[tuple[str, dict[str, Any]]]:
    for name in TABLES:
        drive = table.get(name)
        if isinstance(drive, dict):
            yield name, drive
            for side in ("left", "right", "steering"):
                if isinstance(drive.get(side), dict):
                    yield f"{name}.{side}", drive[side]


def _read_pairs(path: Path, key: str, units: tuple[str, str]) -> list[list[float]]:
    """Pairs of numbers, SI, from a file with two columns, whose first line may hold names with units."""
    try:
        rows = [*csv_lines(path, CSV, ROWS)]
    except (OSError, ValueError, csv.Error) as error:
        reason = error.strerror if isinstance(error, OSError) else error
        raise BadInput(f"{key}: cannot be read: {reason}") from None
    pairs, sizes = [], [1.0, 1.0]
    for number, row in rows:
        try:
            first, second = (float(cell) for cell in row)
        except ValueError:
            if number > 1 or any(_is_number(cell) for cell in row):
                raise BadInput(f"{key}, line {number}: must be two numbers") from None
            sizes = [*_sizes(key, row, units), 1.0, 1.0]  # a first line of fewer cells is a title
            continue
        for value in (first, second):
            if no_data(np.array(value)):
                raise BadInput(f"{key}, line {number}: {value:.7g} is a mark of no data: leave the line out")
        pairs.append([first * sizes[0], second * sizes[1]])
    return pairs


def _sizes(key: str, row: list[str], units: tuple[str, str]) -> Iterator[float]:
    """Sizes of the units in a head; raises BadInput for those of another quantity."""
    for cell, unit in zip(row, units, strict=False):
        try:
            yield unit_size(head(cell)[1], unit)
        except ValueError as error:
            raise BadInput(f"{key}: column '{head(cell)[0]}' {error}") from None


def _is_number(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return False
    return True
