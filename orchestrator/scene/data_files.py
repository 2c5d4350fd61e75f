"""Points over time or speed, points of a path and arcs from files, read with the scene: logs need no files."""

from __future__ import annotations

import csv
import re
from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from fmus.interface.units import conversion
from fmus.vehicles.tables import BadInput
from orchestrator.files.budget import CSV, ROWS
from orchestrator.files.columns import csv_lines, head, no_data, number
from orchestrator.log.measured_formats import SUFFIXES, FileColumn, other_suffix, read_samples

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
OVER_TIME = ("speed_points", "torque_points", "brake_points")
NUMBER = r"\d+\.?\d*(?:[eE][-+]?\d+)?"


class FilePoints(list[list[float]]):
    """Points that a file has."""


class Commands(FilePoints):
    """Points that are recorded commands: each holds until the next one, unless the scene says otherwise."""


def set_interpolation(table: Tables, where: str) -> None:
    """Say how the points over time of a raw scene go on where it does not, sides before what they share.

    Raises BadInput, with a message that begins with ``where``, for commands beside other points.
    """
    shared = {name: drive for name, drive in _drives(table)}
    for name, drive in reversed(shared.items()):
        kinds = {isinstance(drive[key], Commands) for key in OVER_TIME if drive.get(key)}
        above = shared.get(name.rpartition(".")[0], {}) if name.endswith(("left", "right")) else {}
        if kinds and "interpolation" not in {*drive, *above}:
            if len(kinds) > 1:
                raise BadInput(f"{where}: {name} has commands beside other points: interpolation = says how they go on")
            drive["interpolation"] = "hold" if True in kinds else "linear"


def points_behind(table: Tables, stop: float) -> Iterator[str]:
    """Yield a sentence for each list of points over time of a file of which a run that ends at ``stop``, s, has a part.

    One point behind the end is usual where points are linear, and so are several of a list that is written by hand.
    """
    for name, drive in _drives(table):
        for key in OVER_TIME:
            points = drive.get(key)
            behind = [t for t, _ in points if t > stop * (1.0 + 1e-9)] if isinstance(points, FilePoints) else []
            if len(behind) > (not isinstance(points, Commands)):
                yield (
                    f"{name}.{key}: {len(behind)} of {len(drive[key])} points of its file are behind the run's end,"
                    f" run.stop = {stop:.10g} s; run.stop = {behind[-1]:.10g} s has them all"
                )


def read_files(table: Tables, folder: Path, where: str) -> None:
    """Replace the files that drives, driver and hitch of a raw scene name by their points.

    Paths are relative to ``folder``. Raises BadInput, with a message that begins with ``where``, for files that
    cannot be read.
    """
    for name, drive in _drives(table):
        for key, units in (OF_DRIVER if name == "driver" else UNITS).items():
            if isinstance(drive.get(key), str):
                path, column = _named(folder, drive[key])
                read = partial(_of_bag, column) if column else _read_pairs
                drive[key] = read(path, f"{where}: {name}.{key} = '{folder / drive[key]}'", units)


def _drives(table: Tables) -> Iterator[tuple[str, dict[str, Any]]]:
    for name in TABLES:
        drive = table.get(name)
        if isinstance(drive, dict):
            yield name, drive
            for side in ("left", "right", "steering"):
                if isinstance(drive.get(side), dict):
                    yield f"{name}.{side}", drive[side]


def _named(folder: Path, text: str) -> tuple[Path, str]:
    """File, and column of "FILE:COLUMN", which names one of a bag, "" without one."""
    ends = [k for k, mark in enumerate(text) if mark == ":" and (folder / text[:k]).exists()]
    return (folder / text[: ends[0]], text[ends[0] + 1 :]) if ends else (folder / text, "")


def _of_bag(text: str, path: Path, key: str, units: tuple[str, str]) -> FilePoints:
    """Pairs from "COLUMN[:UNIT][*FACTOR][@START]" of a bag; those before START s are left out but for the last one."""
    name, factor, start = re.findall(rf"(?s)^(.+?)(?:\*(-?{NUMBER}))?(?:@({NUMBER}))?$", text)[0]
    read = _of_columns(path, key, units, name)
    pairs = np.array(read) - [float(start or 0.0), 0.0]
    pairs = pairs[max(np.count_nonzero(pairs[:, 0] <= 0.0) - 1, 0) :] * [1.0, float(factor or 1.0)]
    return type(read)(np.maximum(pairs, [0.0, -np.inf]).tolist())


def _read_pairs(path: Path, key: str, units: tuple[str, str]) -> FilePoints:
    """Pairs of numbers, SI, from a file with two columns, which in CSV may have a first line of names with units."""
    if path.suffix.lower() in {*SUFFIXES, ".mcap"} - {".csv"} or path.is_dir():
        return _of_columns(path, key, units)
    try:
        rows = [*csv_lines(path, CSV, ROWS)]
    except (OSError, ValueError, csv.Error) as error:
        reason = error.strerror if isinstance(error, OSError) else f"{error}{other_suffix(path)}"
        raise BadInput(f"{key}: cannot be read: {reason}") from None
    found, sizes = [], [1.0, 1.0]
    for line, row in rows:
        try:
            first, second = (number(cell) for cell in row)
        except ValueError:
            if line > 1 or any(_is_number(cell) for cell in row):
                raise BadInput(f"{key}, line {line}: must be two numbers") from None
            sizes = [*_sizes(key, row, units), 1.0, 1.0]  # a first line of fewer cells is a title
            continue
        found.append([line, first, second])
    lines, pairs = np.split(np.array(found).reshape(-1, 3), [1], axis=1)
    for at, place in np.argwhere(no_data(pairs))[:1]:
        raise BadInput(f"{key}, line {lines[at, 0]:g}: {pairs[at, place]:.7g} is a mark of no data: leave the line out")
    return FilePoints((pairs * sizes[:2]).tolist())


def _of_columns(path: Path, key: str, units: tuple[str, str], column: str = "") -> FilePoints:
    """Pairs, SI, from the two columns of a file, from one that has times of its own, or from a ``column`` of a bag."""
    found: list[FileColumn] = []

    def both(present: Sequence[FileColumn]) -> list[int]:
        if len(present) != 2 and [column.timed for column in present] != [True]:
            raise BadInput(f"must have two columns, and has {', '.join(one.whole for one in present) or 'none'}")
        found.extend(present)
        return [*range(len(present))]

    try:
        samples = read_samples(path, both, [column] * bool(column))
    except BadInput as error:
        raise BadInput(f"{key}: {error}") from None
    columns, times = ([getattr(samples[k], part) for k in range(len(found))] for part in ("values", "t"))
    if not all(t is None or np.array_equal(t, times[0]) for t in times):
        raise BadInput(f"{key}: its two columns have times of their own that differ: save them over one clock")
    if len(found) == 1:
        columns.insert(0, times[0])
        found.insert(0, FileColumn("time", "time", "s"))
    if len(columns[0]) != len(columns[1]) or len(columns[0]) > ROWS:
        counts = " and ".join(str(len(column)) for column in columns)
        raise BadInput(f"{key}: has columns of {counts} samples, must have as many in both, and {ROWS} at most")
    pairs = np.stack(columns, axis=1)
    for row, place in np.argwhere(no_data(pairs))[:1]:
        raise BadInput(f"{key}, row {row + 1}: {pairs[row, place]:.7g} is a mark of no data: leave the row out")
    pairs = pairs * [*_sizes(key, [f"{one.name} [{one.unit}]" for one in found], units)]
    return (Commands if found[-1].commands else FilePoints)(pairs.tolist())


def _sizes(key: str, row: list[str], units: tuple[str, str]) -> Iterator[float]:
    """Sizes of the units in a head; raises BadInput for those of another quantity."""
    for cell, unit in zip(row, units, strict=False):
        try:
            yield conversion(head(cell)[1], unit)[0]
        except ValueError as error:
            raise BadInput(f"{key}: column '{head(cell)[0]}': {error}") from None


def _is_number(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return False
    return True
