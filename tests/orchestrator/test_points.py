"""Files of points in a scene: columns, headings, places of files, refusals."""

import re
from math import pi

import numpy as np
import pytest

from fmus.vehicles.tables import BadInput
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


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("0,0\n2,-8.5\nend,of\n", 3),
        ("x,y\n0,0\n1\n", 3),
        ("x,3\n0,0\n", 1),
        ("1\n2\n", 1),
        ("x,y\nx,y\n", 2),
        ("1_0,2_0\n3,4\n", 1),
        ("0,0\n\u0661,2\n", 2),
    ],
)
def test_a_line_that_is_no_pair_is_named(tmp_path, text, line):
    with pytest.raises(
        BadInput, match=rf"^mine\.toml: driver\.points = '.*way\.csv', line {line}: must be two numbers$"
    ):
        read_text(tmp_path, text)


def write_parquet(path, columns):
    arrow, parquet = pytest.importorskip("pyarrow"), pytest.importorskip("pyarrow.parquet")
    parquet.write_table(arrow.table({f"{name} [{unit}]": values for name, unit, values in columns}), path)


def write_mf4(path, columns):
    asammdf = pytest.importorskip("asammdf")
    (_, _, t), *others = columns
    with asammdf.MDF(version="4.10") as file:
        file.append([asammdf.Signal(values, t, name=name, unit=unit) for name, unit, values in others])
        file.save(path, overwrite=True)


def write_tdms(path, columns):
    nptdms = pytest.importorskip("nptdms")
    (_, _, t), *others = columns
    with nptdms.TdmsWriter(path) as file:
        for name, unit, values in others:
            about = {"unit_string": unit, "wf_increment": float(t[1] - t[0]), "wf_start_offset": float(t[0])}
            file.write_segment([nptdms.ChannelObject("g", name, values, about)])


@pytest.mark.parametrize("write", [write_parquet, write_mf4, write_tdms])
def test_points_of_measured_files(tmp_path, write):
    """Times of a channel are the first column; units are those of the file."""
    kind = write.__name__.removeprefix("write_")
    t, v = np.array([0.0, 0.5, 1.0]), np.array([0.0, 36.0, 18.0])
    write(tmp_path / f"a.{kind}", [("t", "s", t), ("v", "km/h", v)])
    table = {"driver": {"speed_points": f"a.{kind}"}}
    read_files(table, tmp_path, "mine.toml")
    assert np.array(table["driver"]["speed_points"]) == pytest.approx(np.stack([t, v / 3.6], axis=1), rel=1e-12)
    write(tmp_path / f"b.{kind}", [("t", "s", t), ("v", "km/h", v), ("w", "kg", v), ("x", "m", v)])
    with pytest.raises(
        BadInput, match=r"^mine\.toml: driver\.speed_points = '.*b\..*': must have two columns, and has "
    ):
        read_files({"driver": {"speed_points": f"b.{kind}"}}, tmp_path, "mine.toml")
    write(tmp_path / f"c.{kind}", [("t", "s", t), ("v", "kg", v)])
    with pytest.raises(BadInput, match="column 'v': "):
        read_files({"driver": {"speed_points": f"c.{kind}"}}, tmp_path, "mine.toml")
    write(tmp_path / f"d.{kind}", [("t", "s", t), ("v", "km/h", np.array([0.0, np.nan, 1.0]))])
    with pytest.raises(BadInput, match="row 2: nan is a mark of no data: leave the row out"):
        read_files({"driver": {"speed_points": f"d.{kind}"}}, tmp_path, "mine.toml")


def test_points_of_an_unknown_format_name_those_that_are_read(tmp_path):
    (tmp_path / "a.mat").write_bytes(b"MATLAB\x80")
    with pytest.raises(BadInput, match=r"'.*a\.mat': cannot be read: .* are read, by suffix: \.csv, \.parquet"):
        read_files({"driver": {"speed_points": "a.mat"}}, tmp_path, "mine.toml")


def test_channels_on_two_clocks_are_no_points(tmp_path):
    """Two channels of a test make a curve only sample by sample; a file without channels makes none."""
    nptdms = pytest.importorskip("nptdms")
    late = [{"wf_increment": 0.5, "wf_start_offset": start, "unit_string": "N m"} for start in (0.0, 0.25)]
    for about, said in (
        (late, "two columns have times of their own that differ"),
        ([], "must have two columns, and has none"),
    ):
        with nptdms.TdmsWriter(tmp_path / "a.tdms") as file:
            channels = [nptdms.ChannelObject("g", f"c{k}", np.arange(3.0), one) for k, one in enumerate(about)]
            file.write_segment(channels or [nptdms.RootObject({})])
        with pytest.raises(BadInput, match=said):
            read_files({"drive": {"engine_points": "a.tdms"}}, tmp_path, "mine.toml")


def test_a_file_that_is_not_there_is_named(tmp_path):
    with pytest.raises(
        BadInput, match=r"^here: drive\.left\.speed_points = '.*none\.csv': cannot be read: No such file"
    ):
        read_files({"drive": {"left": {"speed_points": "none.csv"}}}, tmp_path, "here")


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


@pytest.mark.parametrize(
    ("key", "heading", "reason"),
    [
        (
            "speed_points",
            "Time [s],n [Hz]",
            "column 'n': 'Hz' does not convert to rad/s; an angle needs deg, rad or rev",
        ),
        ("speed_points", "n [rpm],Time [s]", "column 'n': 'rpm' does not convert to s"),
        ("speed_points", "t,speed (left)", "column 'speed': 'left' is no known unit"),
        ("torque_points", "t,M [kN]", "column 'M': 'kN' does not convert to N m"),
    ],
)
def test_a_heading_with_another_quantity_is_refused(tmp_path, key, heading, reason):
    (tmp_path / "a.csv").write_text(f"{heading}\n0,0\n4,96\n")
    with pytest.raises(BadInput, match=rf"^mine\.toml: drive\.{key} = '.*a\.csv': {reason}"):
        read_files({"drive": {key: "a.csv"}}, tmp_path, "mine.toml")


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


@pytest.mark.parametrize("mark", ["-9999", "-32768.0", "1e20", "-3.4028235e38", "nan"])
def test_marks_of_no_data_are_refused(tmp_path, mark):
    shown = f"{float(mark):.7g}"
    with pytest.raises(BadInput, match=rf"way\.csv', line 2: {re.escape(shown)} is a mark of no data: leave the line"):
        read_text(tmp_path, f"0,0\n1,{mark}\n")
    assert read_text(tmp_path, "0,0\n1,-9998\n")[1] == [1.0, -9998.0]


@pytest.mark.parametrize("place", [("drive",), ("idler_drive",), ("driver",), ("drive", "left"), ("drive", "steering")])
def test_every_drive_may_name_files(tmp_path, place):
    (tmp_path / "a.csv").write_text("0,0\n2,-8.5\n30,4\n")
    drive = {"points": "a.csv", "torque_points": [[1.0, 2.0]]}
    table = {place[0]: drive} if len(place) == 1 else {place[0]: {place[1]: drive}}
    read_files(table, tmp_path, "mine.toml")
    assert drive == {"points": PAIRS, "torque_points": [[1.0, 2.0]]}
