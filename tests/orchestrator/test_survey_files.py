"""Heights of surveys and roads: places and turns of their grids, units, gaps, and sentences for what is refused."""

from importlib import resources

import numpy as np
import pytest
import rasterio
from jsonschema import Draft202012Validator
from PIL import Image
from rasterio.transform import Affine, from_origin
from survey_files import GRID, KEEP, ROWS, SURFACE, TOP, U, V, X, Y, asc, crg, hill, read_map, tif

from fmus.vehicles.tables import BadInput
from orchestrator.scene.keys import scene_schema
from orchestrator.scene.scene import load

FOOT, SURVEY_FOOT = 0.3048, 1200.0 / 3937.0


def geotiff_by_hand(path, point):
    """Without GDAL: its tie is the corner of the first cell, or its middle if pixels are points."""
    tie = (0.0, 0.0, 0.0, *((700.0, 309.0) if point else (699.0, 310.5)), 0.0)
    keys = (1, 1, 0, 3, 1024, 0, 1, 1, 1025, 0, 1, 2 if point else 1, 3072, 0, 1, 25832)
    tags = {33550: (2.0, 3.0, 0.0), 33922: tie, 34735: keys}
    Image.fromarray(ROWS.astype(np.float32)).save(path, tiffinfo=tags)
    return path


def is_right(table):
    """Whether heights and places are those of the hill."""
    x, y = (low + step * np.arange(n) for low, step, n in zip(table["corner"], table["spacing"], (5, 4), strict=True))
    heights = np.array(table["heights"])
    return heights.shape == (5, 4) and np.array_equal(heights, hill(x[:, None], y[None, :])) and heights.max() == 5.0


SURVEYS = {
    "area": lambda folder: geotiff_by_hand(folder / "a.tif", point=False),
    "point": lambda folder: geotiff_by_hand(folder / "a.tiff", point=True),
    "large suffix": lambda folder: tif(folder / "a.TIF"),
    "from the south": lambda folder: tif(folder / "a.tif", ROWS[::-1], transform=Affine(2, 0, 699, 0, 3, 298.5)),
    "from the east": lambda folder: tif(folder / "a.tif", ROWS[:, ::-1], transform=Affine(-2, 0, 709, 0, -3, 310.5)),
    "corner": lambda folder: asc(folder / "a.asc"),
    "center": lambda folder: asc(folder / "a.asc", "xllcenter 700\nyllcenter 300"),
}


@pytest.mark.parametrize("name", SURVEYS)
def test_the_top_of_a_hill_is_at_its_x_and_y(tmp_path, name):
    table = read_map(SURVEYS[name](tmp_path))
    assert (table["corner"], table["spacing"]) == ([700.0, 300.0], [2.0, 3.0])
    assert is_right(table)
    i, j = np.unravel_index(np.argmax(table["heights"]), (5, 4))
    assert (X[i], Y[j]) == TOP


def test_the_hill_tells_each_wrong_turn_and_half_a_cell():
    places = {"corner": [700.0, 300.0], "spacing": [2.0, 3.0]}
    assert is_right({"heights": GRID, **places})
    for turned in (ROWS.T, GRID[::-1], GRID[::-1, ::-1], ROWS, GRID.T):
        assert not is_right({"heights": turned, **places})
    for corner in ([701.0, 300.0], [700.0, 301.5]):
        assert not is_right({"heights": GRID, **places, "corner": corner})


def test_a_corner_moves_a_survey_and_the_spacing_may_be_repeated(tmp_path):
    far = tif(tmp_path / "far.tif", transform=from_origin(500e3, 5300e3, 2.0, 3.0))
    table = read_map(far, corner=[-4, "9 m"], spacing=["200 cm", 3])
    assert (table["corner"], table["spacing"]) == ([-4, "9 m"], [2.0, 3.0])
    assert np.array_equal(table["heights"], GRID)
    bare = tif(tmp_path / "bare.tif", crs=None, transform=None)
    assert np.array_equal(read_map(bare, corner=[0, 0], spacing=[2, 3])["heights"], GRID)


def test_scale_offset_and_units_become_metres(tmp_path):
    def stored(made):
        made.scales, made.offsets, made.units = (0.125,), (-2.0,), ("ft",)

    counts = ((ROWS + 2.0) / 0.125).astype(np.int16)
    table = read_map(tif(tmp_path / "a.tif", counts, more=stored))
    assert np.array(table["heights"]) == pytest.approx(FOOT * GRID, rel=1e-14)
    assert np.array(table["heights"]) != pytest.approx(SURVEY_FOOT * GRID, rel=1e-6), "2e-6 apart"
    table = read_map(tif(tmp_path / "b.tif", crs="EPSG:25832+6360"))  # heights in feet of US surveys
    assert np.array(table["heights"]) == pytest.approx(SURVEY_FOOT * GRID, rel=1e-14)
    assert table["spacing"] == [2.0, 3.0]
    assert is_right(read_map(tif(tmp_path / "c.tif", crs="EPSG:25832+7837")))  # metres by name
    assert np.array_equal(read_map(asc(tmp_path / "b.asc", rows=ROWS + 0.1))["heights"], GRID + 0.1)  # no float32


def test_blocks_that_a_sparse_file_leaves_out_are_gaps(tmp_path):
    path = tmp_path / "a.tif"
    tiles = {"driver": "GTiff", "tiled": True, "blockxsize": 16, "blockysize": 16, "sparse_ok": True}
    places = {"crs": "EPSG:25832", "transform": from_origin(5.0, 5.0, 1.0, 1.0)}
    with rasterio.open(path, "w", height=16, width=32, count=1, dtype="float32", **tiles, **places) as made:
        made.write(np.ones((16, 16), "f4"), 1, window=rasterio.windows.Window(0, 0, 16, 16))
    with pytest.raises(BadInput, match="column 17 is 0"):
        read_map(path)


def test_a_straight_road_is_exact_at_its_own_nodes(tmp_path):
    start = ["REFERENCE_LINE_START_X = 10", "REFERENCE_LINE_START_Y = 5", "REFERENCE_LINE_START_Z = 0.5"]
    slopes = ["REFERENCE_LINE_START_S = 0.1", "REFERENCE_LINE_START_B = 0.05"]
    table = read_map(crg(tmp_path / "a.crg", head=[*start, *slopes]))
    assert (table["corner"], table["spacing"]) == ([10.0, 4.0], [0.5, 0.5])
    placed = 0.5 + 0.1 * U[:, None] + 0.05 * V[None, :]
    assert np.array(table["heights"]) == pytest.approx(SURFACE + placed, abs=1e-13)
    assert np.array(table["heights"])[:, ::-1] != pytest.approx(SURFACE + placed, abs=1e-2)
    assert np.array(table["heights"]) != pytest.approx(SURFACE + placed + 0.02 * 0.05 * V[None, :], abs=1e-4)


def test_a_road_far_away_gets_no_line_more_by_rounding(tmp_path):
    table = read_map(crg(tmp_path / "a.crg", head=["REFERENCE_LINE_START_X = 400000.3"]))
    assert np.array(table["heights"]) == pytest.approx(SURFACE, abs=1e-9)


@pytest.mark.parametrize(("mods", "corner", "up"), [
    (None, [0.0, -1.0], -0.6),  # ASAM's default: its start, on the road, goes to the origin
    (KEEP, [10.0, 4.0], 0.0),
    (["REFLINE_OFFSET_Z = 2"], [10.0, 4.0], 2.0),
    (["REFPOINT_X = 3", "REFPOINT_Z = 1"], [3.0, -1.0], 0.4),
])  # fmt: skip
def test_modifiers_place_a_road_as_the_tools_of_asam_do(tmp_path, mods, corner, up):
    start = ["REFERENCE_LINE_START_X = 10", "REFERENCE_LINE_START_Y = 5", "REFERENCE_LINE_START_Z = 0.5"]
    table = read_map(crg(tmp_path / "a.crg", SURFACE + 0.1, mods=mods, head=start))
    assert table["corner"] == pytest.approx(corner, abs=1e-13)
    assert np.array(table["heights"]) == pytest.approx(SURFACE + 0.5 + 0.1 + up, abs=1e-13)
    moved = read_map(tmp_path / "a.crg", corner=[0, 0])
    assert (moved["corner"], moved["heights"]) == ([0, 0], table["heights"])


def test_borders_go_on_beside_a_road(tmp_path):
    z = SURFACE.copy()
    z[3, :2] = z[5, 4] = np.nan
    filled = SURFACE.copy()
    filled[3, :2], filled[5, 4] = z[3, 2], z[5, 3]
    ends = ["REFERENCE_LINE_START_PHI = 0.5"]
    for mods in (None, KEEP, ["GRID_NAN_MODE = 0"], ["GRID_NAN_MODE = 2"]):
        table = read_map(crg(tmp_path / "a.crg", z, mods=mods))
        assert np.array(table["heights"]) == pytest.approx(filled, abs=1e-13)
    table = read_map(crg(tmp_path / "b.crg", np.broadcast_to(V**2, SURFACE.shape), head=ends), spacing=[0.25, 0.25])
    heights, (x, y) = np.array(table["heights"]), table["corner"]
    x, y = x + 0.25 * np.arange(len(heights)), y + 0.25 * np.arange(heights.shape[1])
    v = np.cos(0.5) * y - np.sin(0.5) * x[:, None]
    assert np.abs(v).max() > 2.0, "no place beside the road"
    assert heights == pytest.approx(np.interp(np.abs(v), [0.0, 0.5, 1.0], [0.0, 0.25, 1.0]), abs=1e-12)


def test_a_curve_lies_on_its_circle(tmp_path):
    """Banking makes the height a function of the distance to the centre, here 10 m to the left of the start."""
    count, radius, bank = 41, 10.0, 0.2
    phi = np.concatenate([[np.nan], (np.arange(count - 1) + 0.5) * 0.5 / radius])
    head = ["REFERENCE_LINE_START_PHI = 0.025", f"REFERENCE_LINE_START_B = {bank}"]
    flat = np.zeros((count, len(V)))
    path = crg(tmp_path / "a.crg", flat, head=head, channels=[("reference line phi,rad", phi)])
    table = read_map(path, spacing=[0.25, 0.25])
    heights, corner = np.array(table["heights"]), table["corner"]
    x, y = (low + 0.25 * np.arange(n) for low, n in zip(corner, heights.shape, strict=True))
    v = radius - np.hypot(x[:, None], y[None, :] - radius)
    ahead = np.arctan2(x[:, None], radius - y[None, :])
    on = (np.abs(v) < 0.9) & (ahead > 0.1) & (ahead < 1.9)
    assert on.sum() > 300
    sagitta = 0.5**2 / 8.0 / radius * 2.0
    assert heights[on] == pytest.approx(bank * v[on], abs=bank * sagitta)
    assert heights[on] != pytest.approx(1.03 * bank * v[on], abs=bank * sagitta)
    own = read_map(path)
    assert own["spacing"] == [0.5, 0.5]
    assert np.array(own["heights"])[:22, :31] == pytest.approx(heights[:44:2, :62:2], abs=1e-12)


@pytest.mark.long
def test_a_scene_names_a_survey_beside_it_and_settings_place_it(tmp_path, cotrack, monkeypatch):
    tif(tmp_path / "hills.tif")
    crg(tmp_path / "road.crg")
    text = resources.files("orchestrator.gallery").joinpath("straight.toml").read_text()
    scene = tmp_path / "mine.toml"
    scene.write_text(f"{text}\n[ground.heightmap]\nheights = 'hills.tif'\n")
    monkeypatch.chdir(tmp_path.parent)
    heightmap = load(str(scene), "rigid").resolved()["ground"]["heightmap"]
    assert is_right(heightmap)
    moved = load(f"{tmp_path.name}/mine.toml", "rigid", ["ground.heightmap.corner=[1, 2]"])
    assert moved.ground.heightmap.corner == (1, 2)
    with pytest.raises(BadInput):
        load(str(scene), "rigid", ["ground.heightmap.spacing=[1, 1]"])
    road = [f"ground.heightmap.heights={tmp_path / 'road.crg'}", "ground.heightmap.spacing=[1, '50 cm']"]
    heights = load("straight", "rigid", road).ground.heightmap.heights
    assert np.array(heights) == pytest.approx(SURFACE[::2], abs=1e-13)
    assert "hills.tif" not in cotrack.done("show", scene, "--track", "rigid")
    checker = Draft202012Validator(scene_schema())
    assert checker.is_valid({"assembly": "vehicle", "ground": {"heightmap": {"heights": "a.tif"}}}) == checker.is_valid(
        {"assembly": "vehicle", "ground": {"heightmap": {"heights": "a.csv", "corner": [0, 0], "spacing": [1, 1]}}}
    )


@pytest.mark.long
def test_show_tells_where_a_map_lies(cotrack, tmp_path):
    crg(tmp_path / "a.crg")
    out = cotrack.done("show", "straight", "--set", f"ground.heightmap.heights={tmp_path / 'a.crg'}")
    low, high = f"{SURFACE.min():g}", f"{SURFACE.max():g}"
    assert (
        f"  height map: x 0 to 4 m, y -1 to 1 m; 9 x 5 heights of {low} to {high} m, and beyond it those of its" in out
    )
