"""Tables of the ground: units, sentences for bad input, and maps from files."""

from __future__ import annotations

import struct
import zlib
from importlib import resources

import numpy as np
import pytest
from matplotlib import image
from PIL import Image

from fmus.ground.keys import is_terrain
from fmus.ground.terrain import heights, terrain
from fmus.vehicles.tables import BadInput
from orchestrator.scene.ground_tables import GroundTable
from orchestrator.scene.height_files import read_heights
from orchestrator.scene.scene import load

STEP = "ground.step={x=[3, 4], rise='20 cm'}"
ROUGH = "ground.rough={iso_class='D', start=1}"
WAVES = "ground.washboard={amplitude=0.05, wavelength=1.5, start=1, phase='90 deg'}"
HALF_ROUND = "ground.half_round={x=[3.1], radius=0.2}"
MAP = "ground.heightmap={heights=[[0, 0.1], [0, 0.1], [0.2, 0]], corner=[1, -2], spacing=[1, 4], start=1}"
ALL = (
    "ground.grade=20 %", "ground.bank=-0.1", "ground.incline_start=2", STEP, "ground.half_round={x=[6], radius=0.1}",
    "ground.trench={start=8, width=1, depth=0.5}", "ground.kerb={y=-1.5, rise=0.1, start=2}", WAVES, ROUGH,
    "ground.friction=[{x=[2, 3], factor=0.5}]",
    MAP,
)  # fmt: skip


def test_units_and_defaults_and_the_way_to_a_terrain():
    scene = load("straight", "rigid", ALL)
    ground = scene.ground.model_dump()
    assert (ground["grade"], ground["bank"], ground["step"]["rise"]) == (pytest.approx(0.2), -0.1, pytest.approx(0.2))
    assert is_terrain(ground)
    assert heights(ground, [-4.0, 0.0, 0.9], [0.0, 1.0, -1.2]) == pytest.approx(np.zeros(3))
    shape = terrain(ground)
    assert shape.plane[:3] == (pytest.approx(0.2), -0.1, 2.0)
    assert shape.washboard.phase == pytest.approx(np.pi / 2.0)
    assert (shape.kerb.start, shape.rough.start, shape.heightmap.start) == (2.0, 1.0, 1.0)
    assert not is_terrain(GroundTable().model_dump())
    assert load("straight", "rigid").resolved()["ground"] == {"hull": False}


@pytest.mark.parametrize(
    ("settings", "sentence"),
    [
        (["ground.step={x=[3], rise=0}"], "rise = 0 m: a step needs a height, up or down"),
        ([STEP, HALF_ROUND], r"step begins at x = 2\.98 m, before half_round ends at 3\.3"),
        (["ground.incline_start=2"], "incline_start needs grade or bank"),
        (["ground.grade=3"], r"ground\.grade = 3: must be -2 to 2"),
        ([WAVES, "ground.washboard.end=3"], "end = 3 m must be two waves or more beyond start = 1 m"),
        ([ROUGH, "ground.rough.band=[0.101, 0.102]"], "no multiple of 1/period, period = 200 m: longer period"),
        ([ROUGH, "ground.rough.period=5000"], "more than 6000 waves"),
        ([ROUGH, "ground.rough.isotropic=true", "ground.rough.correlated=true"], "exclude each other: a surface"),
        (["ground.rough={iso_class='D'}"], "start is missing: lanes begin at an x"),
        (["ground.rough={iso_class='D', isotropic=true}", "symmetric=true"], r"both sides, but ground\.rough differs"),
        (["ground.rough={iso_class='I', start=1}"], r"ground\.rough\.iso_class = 'I'"),
        (["ground.friction=[{x=[2, 1], factor=1}]"], r"x = \[2, 1\] m must be in order"),
        (["ground.friction=[{x=[1, 2]}]"], "needs one of factor and coefficient"),
        ([MAP, "ground.heightmap.heights=[[0, 1], [1]]"], "at least 2"),
        ([MAP, "ground.heightmap.heights=[[0, 1, 2], [1, 2]]"], "as many columns, not 2 and 3"),
        ([MAP, "ground.heightmap.heights=a.las"], r"must be a file \.csv, \.npy, \.png, \.tif, \.asc or \.crg"),
        ([MAP, "ground.heightmap.range=[0, 1]"], "the heights are numbers already"),
        ([WAVES, "symmetric=true"], r"same ground on both sides, but ground\.washboard differs"),
        ([ROUGH, "start.roll=180 deg"], r"ground\.rough needs start\.roll = 0"),
    ],
)  # fmt: skip
def test_bad_input_is_refused_in_a_sentence(settings, sentence):
    with pytest.raises(BadInput, match=sentence) as refused:
        load("straight", "rigid", settings)
    assert "\n" not in str(refused.value)


def read_file(path, **keys):
    table = {"ground": {"heightmap": {"heights": path.name, "corner": [0, 0], "spacing": [1, 1], **keys}}}
    read_heights(table, path.parent, "mine.toml")
    return table["ground"]["heightmap"]


def test_heights_from_a_csv_file_and_an_array(tmp_path):
    heights = np.array([[0.0, 0.1, 0.2], [0.3, 0.4, 0.55]])
    np.savetxt(tmp_path / "a.csv", heights, delimiter=",")
    np.save(tmp_path / "a.npy", heights)
    for name in ("a.csv", "a.npy"):
        assert read_file(tmp_path / name)["heights"] == heights.tolist()
    whole = np.array([[0, -3], [12, 40]], dtype=np.int16)  # m, as elevation models have them
    np.save(tmp_path / "b.npy", whole)
    assert read_file(tmp_path / "b.npy")["heights"] == whole.tolist()


@pytest.mark.parametrize(("mark", "kind"), [
    (-9999, "<f8"), (-9999, "<i2"), (-32768, "<i2"), (1e20, "<f4"), (-3.4028235e38, "<f4"), (np.nan, "<f8"),
])  # fmt: skip
def test_marks_of_no_data_in_heights_are_refused(tmp_path, mark, kind):
    heights = np.zeros((3, 4), dtype=kind)
    heights[1, 2] = heights[2, 2] = mark
    np.save(tmp_path / "a.npy", heights)
    np.savetxt(tmp_path / "a.csv", heights, delimiter=",", fmt="%.9g")
    for name in ("a.csv", "a.npy"):
        with pytest.raises(BadInput, match=rf"{name}': line 2, column 3 is .*, a mark of no data, and so are 1 more: "):
            read_file(tmp_path / name)
    heights[1, 2] = heights[2, 2] = -998
    np.save(tmp_path / "a.npy", heights)
    assert read_file(tmp_path / "a.npy")["heights"][1][2] == -998.0


def test_slopes_that_no_ground_has_are_refused():
    """Ten on one is the limit, along x and y, with the spacing of that way."""
    for steep in ([[0, 0], [0, 0], [0, -9999]], [[0, 0], [0, 10.1]]):
        given = MAP.replace("[[0, 0.1], [0, 0.1], [0.2, 0]]", str(steep))
        with pytest.raises(BadInput, match=r"column 2 to the next line they change by .* m over 1 m, no ground"):
            load("straight", "rigid", [given])
    given = MAP.replace("[[0, 0.1], [0, 0.1], [0.2, 0]]", "[[0, 40.1], [9.9, 49]]")
    with pytest.raises(BadInput, match=r"line 1, column 1 to the next column they change by 40\.1 m over 4 m"):
        load("straight", "rigid", [given])
    given = MAP.replace("[[0, 0.1], [0, 0.1], [0.2, 0]]", "[[0, 39.9], [9.9, 49]]")
    assert load("straight", "rigid", [given]).ground.heightmap.heights[0][1] == 39.9


def test_heights_from_a_grey_image_of_16_bits(tmp_path):
    """Seen from above: the first row is farthest ahead, its first column farthest to the left."""
    grey = np.array([[0, 1, 65535], [4660, 20000, 300]], dtype=np.uint16)
    Image.fromarray(grey).save(tmp_path / "a.png")
    table = read_file(tmp_path / "a.png", range=[-1.0, 2.0])
    assert np.array(table["heights"])[::-1, ::-1] == pytest.approx(-1.0 + 3.0 * grey / 65535.0, abs=1e-15)
    assert "range" not in table


def png_chunk(kind, content):
    return struct.pack(">I", len(content)) + kind + content + struct.pack(">I", zlib.crc32(kind + content))


def test_files_of_heights_that_are_refused(tmp_path):
    image.imsave(tmp_path / "colour.png", np.zeros((3, 3, 3)))
    (tmp_path / "text.csv").write_text("1,2\n3,x\n")
    (tmp_path / "ragged.csv").write_text("1,2\n3\n")
    (tmp_path / "no.png").write_text("no image")
    (tmp_path / "cut.npy").write_bytes(b"\x93NUMPY")
    np.save(tmp_path / "flags.npy", np.zeros((3, 3), dtype=bool))
    np.save(tmp_path / "rows.npy", np.zeros((3, 3)))
    header = (tmp_path / "rows.npy").read_bytes()[:128]
    (tmp_path / "none.npy").write_bytes(header.replace(b"(3, 3), }  ", b"(3000, 0), }")[:128])
    (tmp_path / "many.npy").write_bytes(header.replace(b"(3, 3), }      ", b"(3000, 3000), }"))
    (tmp_path / "few.npy").write_bytes(header)
    Image.fromarray(np.zeros((2, 2), np.uint16)).save(tmp_path / "small.png")
    small = (tmp_path / "small.png").read_bytes()
    (tmp_path / "text.png").write_bytes(small[:8] + png_chunk(b"tEXt", small[16:29]) + small[8:])
    larger = png_chunk(b"IHDR", b"\0\0\0\3" + small[20:29])
    (tmp_path / "twice.png").write_bytes(small[:33] + larger + small[33:])
    for name, keys, sentence in [
        ("colour.png", {"range": [0, 51]}, "8 bits of colour, must be grey of 16: 8 bits make steps of 0.2 m"),
        ("colour.png", {}, r"an image needs ground\.heightmap\.range = \[black, white\]"),
        ("no.png", {"range": [0, 1]}, "is no PNG image"),
        ("text.csv", {}, "line 2: must be numbers"),
        ("ragged.csv", {}, "line 2: has 1 numbers, the first line 2"),
        ("cut.npy", {}, "is no array of numpy"),
        ("flags.npy", {}, "two-dimensional array of numbers"),
        ("missing.csv", {}, "cannot be read: No such file"),
        ("none.npy", {}, "has 0 x 3000 points, must have 1 to 200000"),
        ("many.npy", {}, "has 3000 x 3000 points, must have 1 to 200000"),
        ("few.npy", {}, "is a damaged array"),
        ("text.png", {"range": [0, 1]}, "it does not begin with its size"),
        ("twice.png", {"range": [0, 1]}, "is a damaged image: it says that it has 3 x 2 points too"),
    ]:
        with pytest.raises(BadInput, match=sentence) as refused:
            read_file(tmp_path / name, **keys)
        assert str(refused.value).startswith(f"mine.toml: ground.heightmap.heights = '{tmp_path / name}'")


def test_heights_lie_beside_the_scene_and_a_log_needs_no_file(tmp_path):
    np.savetxt(tmp_path / "hills.csv", [[0.0, 0.1], [0.2, 0.3]], delimiter=",")
    text = resources.files("orchestrator.gallery").joinpath("straight.toml").read_text()
    table = "[ground.heightmap]\nheights = 'hills.csv'\ncorner = [2.0, -5.0]\nspacing = ['50 cm', 10.0]\n"
    (tmp_path / "mine.toml").write_text(f"{text}\n{table}")
    resolved = load(str(tmp_path / "mine.toml"), "rigid").resolved()
    assert resolved["ground"]["heightmap"]["heights"] == [[0.0, 0.1], [0.2, 0.3]]
    assert resolved["ground"]["heightmap"]["spacing"] == [0.5, 10.0]
