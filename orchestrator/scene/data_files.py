"""Points over time or speed, points of a path, arcs or heights from files, read with the scene: logs need no files."""

from __future__ import annotations

import csv
import io
import struct
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from fmus.vehicles.tables import BadInput
from orchestrator.files.budget import CSV, MEASURED, ROWS, read_file
from orchestrator.files.columns import head, no_data, unit_size
from orchestrator.files.csv_lines import csv_lines
from orchestrator.log.time_series import Floats
from orchestrator.scene.ground_tables import MOST_HEIGHTS

SIGNATURE = b"\x89PNG\r\n\x1a\n"
HEADER = struct.Struct(">8x4x4sIIBB")  # of a PNG: its first chunk, columns, rows, bits, colour
GREY = 0  # colour


def read_heights(table: dict[str, Any], folder: Path, where: str) -> None:
    """Replace a file that ``ground.heightmap.heights`` of a raw scene names by its heights.

    The path is relative to ``folder``. Raises BadInput, with a message that begins with ``where``, for files that
    cannot be read.
    """
    ground = table.get("ground")
    heightmap = ground.get("heightmap") if isinstance(ground, dict) else None
    if not isinstance(heightmap, dict) or not isinstance(heightmap.get("heights"), str):
        return
    path = folder / heightmap["heights"]
    try:
        if path.suffix == ".csv":
            heights = _read_csv(path)
        elif path.suffix == ".npy":
            heights = _read_array(path)
        elif path.suffix == ".png":
            heights = _read_image(path, heightmap.pop("range", None))
        else:
            raise ValueError("must be a file .csv, .npy or .png; write an OpenCRG road as .csv first")
        missing = np.argwhere(no_data(heights))
        if len(missing):
            (i, j), more = missing[0], f", and so are {len(missing) - 1} more" if len(missing) > 1 else ""
            raise ValueError(
                f"line {i + 1}, column {j + 1} is {heights[i, j]:.7g}, a mark of no data{more}: fill or cut the gaps"
            )
    except (OSError, ValueError, csv.Error) as error:
        reason = f"cannot be read: {error.strerror}" if isinstance(error, OSError) else error
        raise BadInput(f"{where}: ground.heightmap.heights = '{path}': {reason}") from None
    heightmap["heights"] = heights.tolist()


def _read_csv(path: Path) -> Floats:
    rows = []
    for number, row in csv_lines(path, MEASURED, MOST_HEIGHTS):
        try:
            rows.append([float(cell) for cell in row])
        except ValueError:
            raise ValueError(f"line {number}: must be numbers") from None
        if len(row) != len(rows[0]):
            raise ValueError(f"line {number}: has {len(row)} numbers, the first line {len(rows[0])}")
    return np.array(rows)


def _read_array(path: Path) -> Floats:
    stream = io.BytesIO(read_file(path, MEASURED))
    try:
        version = np.lib.format.read_magic(stream)
        header = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
        shape, _, kind = header(stream)
    except Exception:  # zip archives, pickles, damaged headers
        raise ValueError("is no array of numpy") from None
    if len(shape) != 2 or kind.kind not in "fiu":
        raise ValueError("must be a two-dimensional array of numbers")
    _check_points(*shape)
    stream.seek(0)
    try:
        return np.asarray(np.load(stream, allow_pickle=False), dtype=float)
    except ValueError:
        raise ValueError("is a damaged array: it has not the numbers that its header says") from None


def _check_points(rows: int, columns: int) -> None:
    """Raise ValueError for a map that is empty or too large."""
    if not 0 < rows * columns <= MOST_HEIGHTS:
        raise ValueError(f"has {columns} x {rows} points, must have 1 to {MOST_HEIGHTS}")


def _read_image(path: Path, limits: Any) -> Floats:
    """Heights of a grey image of 16 bits, from ``limits`` of black and white."""
    if not (isinstance(limits, list | tuple) and len(limits) == 2 and all(isinstance(z, int | float) for z in limits)):
        raise ValueError("an image needs ground.heightmap.range = [black, white], heights in m")
    content = read_file(path, MEASURED)
    if not content.startswith(SIGNATURE) or len(content) < HEADER.size:
        raise ValueError("is no PNG image")
    first, columns, rows, bits, colour = HEADER.unpack_from(content)
    if first != b"IHDR":
        raise ValueError("is no PNG image: it does not begin with its size (IHDR)")
    if (bits, colour) != (16, GREY):
        step = (limits[1] - limits[0]) / 255.0
        kind = "grey" if colour == GREY else "colour"
        raise ValueError(
            f"has {bits} bits of {kind}, must be grey of 16: 8 bits make steps of {abs(step):.3g} m out of slopes"
        )
    _check_points(rows, columns)
    from PIL import Image

    try:
        with Image.open(io.BytesIO(content), formats=["PNG"]) as image:
            if image.size != (columns, rows):  # a second size behind the first one
                raise ValueError(f"it says that it has {image.width} x {image.height} points too")
            whole = np.asarray(image, dtype=float) / 65535.0
    except Exception as error:
        raise ValueError(f"is a damaged image: {error}") from None
    return limits[0] + (limits[1] - limits[0]) * whole[::-1, ::-1]


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
    """Replace the files that drives, driver, hitch and ground of a raw scene name by their points and heights.

    Paths are relative to ``folder``. Raises BadInput, with a message that begins with ``where``, for files that
    cannot be read.
    """
    for name, drive in _drives(table):
        for key, units in (OF_DRIVER if name == "driver" else UNITS).items():
            if isinstance(drive.get(key), str):
                path = folder / drive[key]
                drive[key] = _read_pairs(path, f"{where}: {name}.{key} = '{path}'", units)
    read_heights(table, folder, where)


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
