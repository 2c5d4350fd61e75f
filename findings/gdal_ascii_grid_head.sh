#!/usr/bin/env bash
# GDAL in rasterio 1.4.4: an ESRI ASCII grid whose head does not fit its numbers is read without a word.
#
# A grid of 2 rows of 3 heights whose head says ncols 2 is read as the heights 1 2 / 3 4: rows are not looked at, surplus
# numbers are ignored. A second cellsize is ignored too, and a negative one mirrors the grid north to south. Users: hold
# ncols x nrows against the count of numbers before.
#
# Exit status 0: it still does so; 1: it behaves differently now.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/pip" install --quiet rasterio==1.4.4
"$folder/env/bin/python" - "$folder" <<'PYTHON'
import sys
from pathlib import Path

import rasterio

folder = Path(sys.argv[1])


def read(columns, cellsize, more="", rows="1 2 3\n4 5 6\n"):
    file = folder / "grid.asc"
    file.write_text(f"ncols {columns}\nnrows 2\nxllcorner 0\nyllcorner 0\ncellsize {cellsize}\n{more}{rows}")
    with rasterio.open(file) as grid:
        return grid.read(1).tolist(), grid.transform.e


right, narrow, twice, mirrored = read(3, 1), read(2, 1), read(3, 1, "cellsize 7\n"), read(3, -1)
print(right, narrow, twice, mirrored)
assert right == ([[1, 2, 3], [4, 5, 6]], -1.0)
assert narrow[0] == [[1, 2], [3, 4]], "surplus numbers are told"
assert twice[1] in (-1.0, -7.0), "a second cellsize is told"
assert mirrored[1] == 1.0, "a negative cellsize is told"
PYTHON
echo "as described"
