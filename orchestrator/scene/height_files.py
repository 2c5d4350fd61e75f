"""Heights of the ground from files, read with the scene: logs need no files."""

from __future__ import annotations

import csv
import io
import struct
from pathlib import Path
from typing import Any

import numpy as np

from fmus.ground.tables import MAX_HEIGHTS, check_points
from fmus.vehicles.tables import BadInput
from orchestrator.files.budget import MEASURED, read_file
from orchestrator.files.columns import check_gaps, csv_lines, no_data, number
from orchestrator.log.time_series import Floats
from orchestrator.scene.survey_files import read_raster, read_road

SIGNATURE = b"\x89PNG\r\n\x1a\n"
HEADER = struct.Struct(">8x4x4sIIBB")  # of a PNG: its first chunk, columns, rows, bits, colour
GREY = 0  # colour


def read_heights(table: dict[str, Any], folder: Path, where: str) -> None:
    """Replace a file that ``ground.heightmap.heights`` of a raw scene names by its heights, and places if it has some.

    The path is relative to ``folder``. Raises BadInput, with a message that begins with ``where``, for files that
    cannot be read, and NotInstalled.
    """
    heightmap = _of_file(table)
    if not heightmap:
        return
    path = folder / heightmap["heights"]
    try:
        match path.suffix.lower():
            case ".csv":
                heights = _read_csv(path)
            case ".npy":
                heights = _read_array(path)
            case ".png":
                heights = _read_image(path, heightmap.pop("range", None))
            case ".tif" | ".tiff" | ".asc":
                heights = read_raster(path, heightmap)
            case ".crg":
                heights = read_road(path, heightmap)
            case _:
                raise ValueError("must be a file .csv, .npy, .png, .tif, .asc or .crg")
        check_gaps(heights, no_data(heights))
    except (OSError, ValueError, csv.Error) as error:
        reason = f"cannot be read: {error.strerror}" if isinstance(error, OSError) else error
        raise BadInput(f"{where}: ground.heightmap.heights = '{path}': {reason}") from None
    heightmap["heights"] = heights.tolist()


def locate_heights(table: dict[str, Any], folder: Path) -> None:
    """Make the path of a file of heights in a raw scene, which is relative to ``folder``, one of the working folder."""
    if heightmap := _of_file(table):
        heightmap["heights"] = str(folder / heightmap["heights"])


def _of_file(table: dict[str, Any]) -> dict[str, Any]:
    """Table of the map of a raw scene if it names a file, else an empty one."""
    ground = table.get("ground")
    heightmap = ground.get("heightmap") if isinstance(ground, dict) else None
    return heightmap if isinstance(heightmap, dict) and isinstance(heightmap.get("heights"), str) else {}


def _read_csv(path: Path) -> Floats:
    rows = []
    for line, row in csv_lines(path, MEASURED, MAX_HEIGHTS):
        try:
            rows.append([number(cell) for cell in row])
        except ValueError:
            raise ValueError(f"line {line}: must be numbers") from None
        if len(row) != len(rows[0]):
            raise ValueError(f"line {line}: has {len(row)} numbers, the first line {len(rows[0])}")
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
    check_points(*shape)
    stream.seek(0)
    try:
        return np.asarray(np.load(stream, allow_pickle=False), dtype=float)
    except ValueError:
        raise ValueError("is a damaged array: it has not the numbers that its header says") from None


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
    check_points(rows, columns)
    from PIL import Image

    try:
        with Image.open(io.BytesIO(content), formats=["PNG"]) as image:
            if image.size != (columns, rows):  # a second size behind the first one
                raise ValueError(f"it says that it has {image.width} x {image.height} points too")
            whole = np.asarray(image, dtype=float) / 65535.0
    except Exception as error:
        raise ValueError(f"is a damaged image: {error}") from None
    return limits[0] + (limits[1] - limits[0]) * whole[::-1, ::-1]
