"""Heights of surveys: GeoTIFF and ESRI ASCII grids by rasterio, OpenCRG roads by PyOpenCRG (extra ``survey``).

Rasters: GDAL gets the bytes of a file and one driver, so that no file names another one. It makes corners of cells
out of pixel-is-point and xllcenter; a height lies in the middle of its cell. It reads words of an ASCII grid as 0 and
blocks that a sparse GeoTIFF leaves out as 0 too, so both are looked for here.

Roads: PyOpenCRG 0.2.2 is pure Python with numpy alone, in double precision. It agrees with pycrg 2.2.0, ASAM's C
library in single precision, to 1e-8 m on straight, curved, sloped and banked roads with each kind of modifier; crgutils
0.1.1 does not (``findings/crgutils_left_border.sh``). ASAM OpenCRG 1.2 leaves the modifiers of a file without a section
$ROAD_CRG_MODS to the reader. Both do as ASAM's tools: the road starts in x = y = z = 0 with heading 0, and its
borders go on where they are NaN. pycrg does so when it opens a file, PyOpenCRG when it is told to. Numbered long
sections without LONG_SECTION_V_INCREMENT are refused: PyOpenCRG divides the width, ASAM's tools take 0.01 m.
"""

from __future__ import annotations

import re
import warnings
from collections import Counter
from collections.abc import Callable, Sequence
from contextlib import ExitStack, suppress
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any
from uuid import uuid4

import numpy as np

from fmus.ground.tables import check_points
from fmus.interface.units import conversion
from fmus.vehicles.tables import FARTHEST, to_si
from orchestrator.files.budget import AT_ONCE, MEASURED, TOML, OverBudget, read_file
from orchestrator.files.columns import check_gaps, no_data
from orchestrator.log.extra import library
from orchestrator.log.time_series import Floats

EXTRA = "survey"
Pair = tuple[float, float]
WEB_MERCATOR = 3857  # stretches lengths, twice at a latitude of 60 degrees
STRAIGHT = 1e-9  # rad
ROUNDING = 1e-6  # part of a spacing
_WORD = re.compile(
    rb"(?i)ncols|nrows|[xy]ll(corner|center)|cellsize|d[xy]|nodata_value|nan|[-+]?(\d+[.,]?\d*|[.,]\d+)(e[-+]?\d+)?"
)


def read_raster(path: Path, heightmap: dict[str, Any]) -> Floats:
    """Heights of a GeoTIFF (.tif, .tiff) or an ESRI ASCII grid (.asc), m; lines follow x, east, and columns y, north.

    Places come into the raw table ``heightmap`` where it has none. Raises ValueError, OSError, NotInstalled.
    """
    rasterio = library("rasterio", EXTRA)
    content, text = read_file(path, MEASURED), path.suffix.lower() == ".asc"
    options = {"driver": "AAIGrid", "datatype": "Float64"} if text else {"driver": "GTiff"}
    words = content.lower().split() if text else []
    for word in words:
        if not _WORD.fullmatch(word):
            raise ValueError(f"has {word[:20].decode('latin-1')!r} where a number must be")
    with warnings.catch_warnings(), ExitStack() as stack:
        warnings.simplefilter("ignore")  # of files without places
        folder, projection = uuid4().hex, path.with_suffix(".prj")
        if text and projection.is_file():  # GDAL looks for it beside the grid
            stack.enter_context(rasterio.MemoryFile(read_file(projection, TOML), dirname=folder, filename="map.prj"))
        memory = stack.enter_context(rasterio.MemoryFile(content, dirname=folder, filename=f"map{path.suffix.lower()}"))
        source = stack.enter_context(_sound(lambda: memory.open(**options)))
        check_points(source.height, source.width, ": cut it or make it coarser, as gdalwarp -te -tr does")
        if source.count != 1 or source.subdatasets or source.dtypes[0].startswith("complex"):
            raise ValueError("must have one band of numbers: take the heights alone, as gdal_translate -b 1 does")
        if np.prod(source.block_shapes[0], dtype=float) * 16.0 > AT_ONCE:
            raise OverBudget(f"its blocks have more than {AT_ONCE} bytes")
        if text:
            _check_grid(words, source)
        raw, missing = _sound(lambda: (source.read(1), source.read_masks(1) == 0))
        for (i, j), window in () if text else source.block_windows(1):
            if source.get_tag_item(f"BLOCK_OFFSET_{j}_{i}", "TIFF", bidx=1) is None:  # left out
                missing[window.toslices()] = True
        check_gaps(raw, missing | no_data(raw))
        heights = _in_metres(source, raw)
        grid, (rows, columns) = source.transform, raw.shape
    x, y = grid.c + grid.a * (np.arange(columns) + 0.5), grid.f + grid.e * (np.arange(rows) + 0.5)
    if grid.is_identity:
        y = -y  # rows run from north to south
        if not {"corner", "spacing"} <= heightmap.keys():
            raise ValueError("has no places: give ground.heightmap.corner and ground.heightmap.spacing")
    elif abs(grid.b) + abs(grid.d) > STRAIGHT * abs(grid.a):
        raise ValueError("its rows do not run from west to east: turn it, as gdalwarp does")
    else:
        _set_places(heightmap, (float(x.min()), float(y.min())), (abs(grid.a), abs(grid.e)))
    return heights.T[np.argsort(x)][:, np.argsort(y)]


def _check_grid(words: Sequence[bytes], source: Any) -> None:
    """Raise ValueError for an ESRI grid, open as ``source``, whose words GDAL would rearrange, mirror or pass over."""
    keys = Counter(word.replace(b"center", b"corner") for word in words if word[:1].isalpha() and word != b"nan")
    count = len(words) - 2 * keys.total()
    for key in (key.decode() for key in keys if keys[key] > 1):
        raise ValueError(f"gives {key} twice")
    if count != source.width * source.height:
        raise ValueError(f"has {count} heights, and its header says {source.width} columns x {source.height} rows")
    if source.transform.a <= 0.0 or source.transform.e >= 0.0 or {b"cellsize", b"dx"} <= keys.keys():
        raise ValueError("must have one cellsize, or dx and dy, above 0")


def _sound(read: Callable[[], Any]) -> Any:
    """Result of a library that raises whatever it likes at a file of others; raises ValueError."""
    try:
        return read()
    except Exception:
        raise ValueError("is damaged, or no file of its suffix") from None


def _in_metres(source: Any, raw: Floats) -> Floats:
    """Heights of a raster, m, from the numbers in it; raises ValueError for other units of places and unknown ones."""
    crs = source.crs
    if crs and (not crs.is_projected or crs.linear_units != "metre" or crs.to_epsg() == WEB_MERCATOR):
        raise ValueError("has places in degrees, feet, Web Mercator or unknown: project it, as gdalwarp -t_srs does")
    try:
        return (raw.astype(float) * source.scales[0] + source.offsets[0]) * conversion(source.units[0] or "", "m")[0]
    except ValueError as error:
        raise ValueError(f"{error}: convert its heights to m") from None


def read_road(path: Path, heightmap: dict[str, Any]) -> Floats:
    """Heights of an OpenCRG road (.crg) with its modifiers, m, on a grid over its extent; lines follow x, columns y.

    Beside the road, the grid has the height of the nearest border. Places come into the raw table ``heightmap``; its
    spacing counts, else the road's own increments, along x if it is straight and runs there, else the smaller one.
    Raises ValueError, OSError, NotInstalled.
    """
    crg = library("pyopencrg", EXTRA)
    content = read_file(path, MEASURED)
    text = b"\n" + content.lower()
    if b"\n$road_crg_file" in text:
        raise ValueError("refers to another file by $ROAD_CRG_FILE: name that one, with the modifiers in it")
    if re.search(rb"\n\s*d:\s*long section\s+\d", text) and not re.search(rb"\n\s*long_section_v_increment", text):
        raise ValueError("numbers its long sections, but lacks LONG_SECTION_V_INCREMENT: add it to $ROAD_CRG")
    with TemporaryDirectory() as folder, warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of what is odd but sound
        copy = Path(folder, "road.crg")
        copy.write_bytes(content)
        try:
            road = crg.read(copy)
        except Exception as error:
            reason = error.report.errors[0] if hasattr(error, "report") else str(error).replace(f"{copy}: ", "")
            raise ValueError(f"is no sound OpenCRG road: {' '.join(reason.split())}") from None
        known = ~np.isnan(road.z)
        inside = np.maximum.accumulate(known, 1) & np.maximum.accumulate(known[:, ::-1], 1)[:, ::-1]
        _check_length(road, content)
        check_gaps(road.z, inside & ~known, ("cross section", "long section"))
        return _over_extent(_sound(lambda: road.apply_mods().fill_nan()), heightmap)


def _check_length(road: Any, content: bytes) -> None:
    """Raise ValueError if a road ends before its header says: PyOpenCRG reads what is there."""
    number = rb"[-+]?(?:\d+\.?\d*|\.\d+)(?:e[-+]?\d+)?"
    given = re.search(rb"(?im)^\s*reference_line_end_u\s*=\s*(" + number + rb")", content.partition(b"$$$$")[0])
    if given and abs(float(given[1]) - road.u_end) > 0.5 * road.u_inc:
        raise ValueError(f"ends at u = {road.u_end:g} m, and its header says {float(given[1]):g} m: it was cut off")


def _over_extent(road: Any, heightmap: dict[str, Any]) -> Floats:
    """Heights of a road without gaps on a grid over its extent; completes a raw table; raises ValueError."""
    road.opts = {key: value for key, value in road.opts.items() if key.startswith("border_smooth")}  # borders go on
    edges = np.array(road.uv_to_xy(*map(np.ravel, np.meshgrid(road.u, road.v[[0, -1]]))))
    along, across = road.u_inc, float(np.diff(road.v).min())
    ahead = road.is_straight and abs(road.phi_start) < STRAIGHT
    spacing = _given_spacing(heightmap) or ((along, across) if ahead else (min(along, across),) * 2)
    corner, extent = edges.min(1), np.ptp(edges, 1)
    points = np.ceil(extent / spacing - ROUNDING) + 1.0
    check_points(points[0], points[1], ": give a larger ground.heightmap.spacing, [{:g}, {:g}] m now".format(*spacing))
    _set_places(heightmap, (float(corner[0]), float(corner[1])), spacing)
    x, y = (low + step * np.arange(int(n)) for low, step, n in zip(corner, spacing, points, strict=True))
    return np.asarray(road.xy_to_z(*map(np.ravel, np.meshgrid(x, y, indexing="ij")))).reshape(len(x), len(y))


def _given_spacing(heightmap: dict[str, Any]) -> Pair | None:
    """Spacing that a raw table gives, m; raises ValueError."""
    if heightmap.get("spacing") is None:
        return None
    with suppress(TypeError, ValueError):
        x, y = map(to_si("m"), heightmap["spacing"])
        if min(x, y) > 0.0:
            return x, y
    raise ValueError("ground.heightmap.spacing must be two lengths above 0")


def _set_places(heightmap: dict[str, Any], corner: Pair, spacing: Pair) -> None:
    """Complete a raw table by the least x and y and the spacing of a file, m; raises ValueError."""
    given = _given_spacing(heightmap)
    if given is not None and not np.allclose(given, spacing, rtol=ROUNDING, atol=0.0):
        text = "ground.heightmap.spacing = [{:g}, {:g}] m contradicts that of the file, [{:.7g}, {:.7g}]: leave it out"
        raise ValueError(text.format(*given, *spacing))
    heightmap["spacing"] = list(spacing)
    if "corner" not in heightmap and not max(map(abs, corner)) <= FARTHEST:
        far = "lies at x = {:.7g} m, y = {:.7g} m, beyond {:g} m".format(*corner, FARTHEST)
        raise ValueError(
            f"{far}: ground.heightmap.corner = [x, y] places its least x and y, and vehicles start at x = 0, y = 0"
        )
    heightmap.setdefault("corner", list(corner))
