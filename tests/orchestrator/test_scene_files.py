"""Files of points and heights, and tables of the ground in a scene: columns, headings, units, places of files."""

from __future__ import annotations

from importlib import resources
from math import pi

import numpy as np
import pytest
from data_files import MAP, ROUGH, STEP, WAVES, read_file, write_parquet, write_tdms
from PIL import Image

from fmus.ground.tables import GroundTable, is_terrain
from fmus.ground.terrain import heights, terrain
from fmus.vehicles.tables import BadInput
from orchestrator.scene.data_files import OF_DRIVER, UNITS, Commands, points_behind, read_files
from orchestrator.scene.drive_tables import DriverTable, HitchTable, VehicleDriveTable
from orchestrator.scene.scene import load

PAIRS = [[0.0, 0.0], [2.0, -8.5], [3e1, 4.0]]


def read_text(tmp_path, text):
    """Points of a driver whose file ``way.csv`` has this text."""
    (tmp_path / "way.csv").write_bytes(text.encode())
    table = {"driver": {"points": "way.csv", "speed": 3.0}}
    read_files(table, tmp_path, "mine.toml")
    return table["driver"]["points"]


@pytest.mark.parametrize("heading", ["", "x,y\n", "x [m],y [m]\r\n", "\ufeffx,y\n", "\ufeff", "a way\n"])
def test_two_columns_with_or_without_a_heading(tmp_path, heading):
    assert read_text(tmp_path, f"{heading}0,0\n\n2, -8.5\r\n3e1,4.0") == PAIRS
    assert read_text(tmp_path, "0,0\n1,-9998\n")[1] == [1.0, -9998.0], "a mark of no data is -9999"


def write_mf4(path, columns):
    asammdf = pytest.importorskip("asammdf")
    (_, _, t), *others = columns
    with asammdf.MDF(version="4.10") as file:
        file.append([asammdf.Signal(values, t, name=name, unit=unit) for name, unit, values in others])
        file.save(path, overwrite=True)


@pytest.mark.parametrize("kind", ["parquet", "mf4", "tdms"])
def test_points_of_measured_files(tmp_path, kind):
    """Times of a channel are the first column; units are those of the file."""
    t, v, path = np.array([0.0, 0.5, 1.0]), np.array([0.0, 36.0, 18.0]), tmp_path / f"a.{kind}"
    if kind == "tdms":
        write_tdms(path, [("v", "km/h", v, 0.0, 0.5)])
    else:
        {"parquet": write_parquet, "mf4": write_mf4}[kind](path, [("t", "s", t), ("v", "km/h", v)])
    table = {"driver": {"speed_points": path.name}}
    read_files(table, tmp_path, "mine.toml")
    assert np.array(table["driver"]["speed_points"]) == pytest.approx(np.stack([t, v / 3.6], axis=1), rel=1e-12)


@pytest.mark.parametrize(
    ("place", "key", "heading", "sizes"),
    [
        ("drive", "speed_points", "Time [s],n [rpm]", (1.0, 2.0 * pi / 60.0)),
        ("drive", "speed_points", "t (ms),w (deg/s)", (1e-3, pi / 180.0)),
        ("drive", "torque_points", '"t, min","M, kNm"', (60.0, 1e3)),
        ("idler_drive", "brake_points", "t,M [N m]", (1.0, 1.0)),
        ("drive", "engine_points", "n [rpm],M [Nm]", (2.0 * pi / 60.0, 1.0)),
        ("hitch", "drag_points", "v [km/h],F [kN]", (1.0 / 3.6, 1e3)),
        ("driver", "speed_points", "t [s],v [km/h]", (1.0, 1.0 / 3.6)),
        ("driver", "points", "x [km],y [cm]", (1e3, 1e-2)),
        ("driver", "arcs", "length [m],curvature [1/m]", (1.0, 1.0)),
        ("driver", "arcs", "length [m],curvature [deg/m]", (1.0, pi / 180.0)),
    ],
)
def test_a_heading_names_the_units(tmp_path, place, key, heading, sizes):
    (tmp_path / "a.csv").write_text(f"{heading}\n0,0\n4,96\n")
    table = {place: {key: "a.csv"}}
    read_files(table, tmp_path, "mine.toml")
    assert table[place][key] == [[0.0, 0.0], pytest.approx([4.0 * sizes[0], 96.0 * sizes[1]], rel=1e-14)]


def test_units_of_columns_are_those_of_the_keys():
    """The unit of a column without one is the unit in which the table reads the numbers."""
    tables = {VehicleDriveTable: UNITS, HitchTable: UNITS, DriverTable: OF_DRIVER}
    found = {}
    for table, units in tables.items():
        schema = table.model_json_schema()["properties"]
        for key in units.keys() & schema.keys():
            found[table, key] = units[key]
            points = next(one for one in schema[key]["anyOf"] if one.get("type") == "array")
            assert tuple(one["unit"] for one in points["items"]["prefixItems"]) == units[key], key
    assert {key for _, key in found} == UNITS.keys()


@pytest.mark.parametrize(
    ("text", "settings", "told"),
    [
        ("t [ms],n\n0,0\n1,2\n2,3\n30,3\n40.5,3\n", [], "2 of 5 points"),
        ("0,0\n0.01,2\n30,3\n", [], ""),  # the line to one point behind the end is driven
        ("0,0\n2,2\n30,3\n", ["drive.speed_points=[[0, 0], [2, 2], [30, 3]]"], ""),  # by hand
        ("0,0\n2,2\n30,3\n", ["run.stop=30"], ""),
    ],
)
def test_points_of_a_file_behind_the_end_are_told(cotrack, monkeypatch, tmp_path, text, settings, told):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "a.csv").write_text(text)
    asked = ["drive.speed_points=a.csv", "run.stop=0.02", *settings]
    found = load("sprocket_bench", None, asked).unfelt
    run_stop = "run.stop = 0.02 s; run.stop = 0.0405 s has them all"
    sentence = f"drive.speed_points: {told} of its file are behind the run's end, {run_stop}"
    assert found == [f"sprocket_bench.toml: {sentence}"] * bool(told)
    if told:
        sets = [part for one in asked for part in ("--set", one)]
        assert sentence in " ".join("".join(cotrack("run", "sprocket_bench", *sets, "--no-estimate")[1:]).split())


def test_a_command_behind_the_end_is_lost():
    (told,) = points_behind({"drive": {"left": {"speed_points": Commands([[0.0, 1.0], [3.0, 0.0]])}}}, 2.0)
    assert told.startswith("drive.left.speed_points: 1 of 2 points")


@pytest.mark.parametrize("place", [("drive",), ("idler_drive",), ("driver",), ("drive", "left"), ("drive", "steering")])
def test_every_drive_may_name_files(tmp_path, place):
    (tmp_path / "a.csv").write_text("0,0\n2,-8.5\n30,4\n")
    drive = {"points": "a.csv", "torque_points": [[1.0, 2.0]]}
    table = {place[0]: drive} if len(place) == 1 else {place[0]: {place[1]: drive}}
    read_files(table, tmp_path, "mine.toml")
    assert drive == {"points": PAIRS, "torque_points": [[1.0, 2.0]]}


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
