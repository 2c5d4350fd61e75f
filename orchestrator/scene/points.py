"""Points over time or speed, points of a path, arcs or heights from files, read with the scene: logs need no files."""

from __future__ import annotations

import csv
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from fmus.vehicle import BadInput
from orchestrator.files.budget import CSV, ROWS
from orchestrator.files.csv_lines import csv_lines
from orchestrator.scene import height_files

Tables = dict[str, Any]  # raw scene
POINTS = ("speed_points", "torque_points", "brake_points", "engine_points", "drag_points", "points", "arcs")
TABLES = ("drive", "idler_drive", "driver", "hitch")


def read(table: Tables, folder: Path, where: str) -> None:
    """Replace the files that drives, driver, hitch and ground of a raw scene name by their points and heights.

    Paths are relative to ``folder``. Raises BadInput, with a message that begins with ``where``, for files that
    cannot be read.
    """
    for name, drive in _drives(table):
        for key in POINTS:
            if isinstance(drive.get(key), str):
                drive[key] = _read_pairs(folder / drive[key], f"{where}: {name}.{key}")
    height_files.read(table, folder, where)


def _drives(table: Tables) -> Iterator[tuple[str, dict[str, Any]]]:
    for name in TABLES:
        drive = table.get(name)
        if isinstance(drive, dict):
            yield name, drive
            for side in ("left", "right", "steering"):
                if isinstance(drive.get(side), dict):
                    yield f"{name}.{side}", drive[side]


def _read_pairs(path: Path, key: str) -> list[list[float]]:
    """Pairs of numbers, SI, from a file with two columns; a first line of words is skipped."""
    try:
        rows = [*csv_lines(path, CSV, ROWS)]
    except (OSError, ValueError, csv.Error) as error:
        reason = error.strerror if isinstance(error, OSError) else error
        raise BadInput(f"{key} = '{path}': cannot be read: {reason}") from None
    pairs = []
    for number, row in rows:
        try:
            first, second = (float(cell) for cell in row)
            pairs.append([first, second])
        except ValueError:
            if number > 1 or any(_is_number(cell) for cell in row):
                raise BadInput(f"{key} = '{path}', line {number}: must be two numbers") from None
    return pairs


def _is_number(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return False
    return True
