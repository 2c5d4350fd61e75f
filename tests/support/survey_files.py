"""Files of heights: a hill in GeoTIFF and ESRI ASCII grids, a road in OpenCRG."""

import numpy as np
import rasterio
from rasterio.transform import from_origin

from orchestrator.scene.height_files import read_heights

X, Y = 700.0 + 2.0 * np.arange(5), 300.0 + 3.0 * np.arange(4)  # m, of the middles of cells
TOP = (704.0, 309.0)


def hill(x, y):
    """Height, m, with its top at ``TOP``, different along x and y and on each side."""
    return 5.0 - 0.25 * np.abs(x - TOP[0]) - 0.5 * np.abs(y - TOP[1]) + 0.125 * (x > TOP[0])


GRID = hill(X[:, None], Y[None, :])  # lines follow x, columns y
ROWS = GRID.T[::-1]  # as in a file: from north to south, from west to east


def read_map(path, **keys):
    """Table of the height map that names this file."""
    table = {"ground": {"heightmap": {"heights": path.name, **keys}}}
    read_heights(table, path.parent, "mine.toml")
    return table["ground"]["heightmap"]


def tif(path, rows=ROWS, *, more=lambda made: None, **profile):
    """Write a GeoTIFF; ``more`` is called with the open file."""
    shape = {"height": rows.shape[0], "width": rows.shape[1], "count": 1, "dtype": rows.dtype.name}
    places = {"crs": "EPSG:25832", "transform": from_origin(699.0, 310.5, 2.0, 3.0)}
    with rasterio.open(path, "w", driver="GTiff", **{**shape, **places, **profile}) as made:
        for band in range(1, made.count + 1):
            made.write(rows, band)
        more(made)
    return path


def asc(path, where="xllcorner 699\nyllcorner 298.5", size="dx 2\ndy 3", rows=ROWS, mark="-9999"):
    """Write an ESRI ASCII grid."""
    lines = "\n".join(" ".join(f"{z:.17g}" for z in row) for row in rows)
    header = f"ncols {rows.shape[1]}\nnrows {rows.shape[0]}\n{where}\n{size}\nNODATA_value {mark}\n"
    path.write_text(header + lines + "\n")
    return path


def gap(value, kind=float, rows=ROWS):
    """Rows with two places without data."""
    rows = rows.astype(kind)
    rows[1, 2] = rows[3, 0] = value
    return rows


U, V = 0.5 * np.arange(9), np.array([-1.0, -0.5, 0.0, 0.5, 1.0])  # m, along and across a road
SURFACE = 0.01 * U[:, None] ** 2 + 0.04 * V[None, :] + 0.02 * U[:, None] * V[None, :]
KEEP = ()  # an empty section of modifiers
NUMBERED = [f"long section {i + 1},m" for i in range(len(V))]


def crg(path, z=SURFACE, mods=KEEP, head=(), channels=(), names=NUMBERED):
    """Road as text, 20 characters a number: ``channels`` are pairs of names and columns of the reference line."""
    sections = {
        "$ROAD_CRG": ["REFERENCE_LINE_INCREMENT = 0.5", "LONG_SECTION_V_RIGHT = -1", "LONG_SECTION_V_LEFT = 1",
                      "LONG_SECTION_V_INCREMENT = 0.5", *head],
        "$ROAD_CRG_MODS": mods,
        "$KD_DEFINITION": ["#:LDFI", *(f"D:{name}" for name in (*dict(channels), *names))],
    }  # fmt: skip
    lines = [line for key, content in sections.items() if content is not None for line in (key, *content, "$")]
    lines.append(72 * "$")
    for row in np.column_stack([*dict(channels).values(), z]):
        words = [20 * "*" if np.isnan(value) else f"{value:20.14f}" for value in row]
        lines += ["".join(words[k : k + 4]) for k in range(0, len(words), 4)]
    path.write_text("\n".join([*lines, ""]))
    return path
