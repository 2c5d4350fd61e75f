"""Tables of the ground: units, and maps from files."""

from __future__ import annotations

from importlib import resources

import numpy as np
import pytest
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
    steep = MAP.replace("[[0, 0.1], [0, 0.1], [0.2, 0]]", "[[0, 39.9], [9.9, 49]]")  # ten on one is the limit
    assert load("straight", "rigid", [steep]).ground.heightmap.heights[0][1] == 39.9


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
        with pytest.raises(BadInput):
            read_file(tmp_path / name)
    heights[1, 2] = heights[2, 2] = -998
    np.save(tmp_path / "a.npy", heights)
    assert read_file(tmp_path / "a.npy")["heights"][1][2] == -998.0


def test_heights_from_a_grey_image_of_16_bits(tmp_path):
    """Seen from above: the first row is farthest ahead, its first column farthest to the left."""
    grey = np.array([[0, 1, 65535], [4660, 20000, 300]], dtype=np.uint16)
    Image.fromarray(grey).save(tmp_path / "a.png")
    table = read_file(tmp_path / "a.png", range=[-1.0, 2.0])
    assert np.array(table["heights"])[::-1, ::-1] == pytest.approx(-1.0 + 3.0 * grey / 65535.0, abs=1e-15)
    assert "range" not in table


def test_heights_lie_beside_the_scene_and_a_log_needs_no_file(tmp_path):
    np.savetxt(tmp_path / "hills.csv", [[0.0, 0.1], [0.2, 0.3]], delimiter=",")
    text = resources.files("orchestrator.gallery").joinpath("straight.toml").read_text()
    table = "[ground.heightmap]\nheights = 'hills.csv'\ncorner = [2.0, -5.0]\nspacing = ['50 cm', 10.0]\n"
    (tmp_path / "mine.toml").write_text(f"{text}\n{table}")
    resolved = load(str(tmp_path / "mine.toml"), "rigid").resolved()
    assert resolved["ground"]["heightmap"]["heights"] == [[0.0, 0.1], [0.2, 0.3]]
    assert resolved["ground"]["heightmap"]["spacing"] == [0.5, 10.0]
