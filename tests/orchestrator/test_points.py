"""Files of points in a scene: columns, headings, places of files."""

from math import pi

import numpy as np
import pytest

from orchestrator.scene.data_files import OF_DRIVER, UNITS, read_files
from orchestrator.scene.drive_tables import DriverTable, HitchTable, VehicleDriveTable

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


def write_parquet(path, columns):
    arrow, parquet = pytest.importorskip("pyarrow"), pytest.importorskip("pyarrow.parquet")
    parquet.write_table(arrow.table({f"{name} [{unit}]": values for name, unit, values in columns}), path)


def write_mf4(path, columns):
    asammdf = pytest.importorskip("asammdf")
    (_, _, t), *others = columns
    with asammdf.MDF(version="4.10") as file:
        file.append([asammdf.Signal(values, t, name=name, unit=unit) for name, unit, values in others])
        file.save(path, overwrite=True)


def write_tdms(path, channels):
    """Write channels (name, unit, values, start, step)."""
    nptdms = pytest.importorskip("nptdms")
    with nptdms.TdmsWriter(path) as file:
        found = [
            nptdms.ChannelObject("g", name, values, {"unit_string": unit, "wf_increment": h, "wf_start_offset": start})
            for name, unit, values, start, h in channels
        ]
        file.write_segment(found or [nptdms.RootObject({})])


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


@pytest.mark.parametrize("place", [("drive",), ("idler_drive",), ("driver",), ("drive", "left"), ("drive", "steering")])
def test_every_drive_may_name_files(tmp_path, place):
    (tmp_path / "a.csv").write_text("0,0\n2,-8.5\n30,4\n")
    drive = {"points": "a.csv", "torque_points": [[1.0, 2.0]]}
    table = {place[0]: drive} if len(place) == 1 else {place[0]: {place[1]: drive}}
    read_files(table, tmp_path, "mine.toml")
    assert drive == {"points": PAIRS, "torque_points": [[1.0, 2.0]]}
