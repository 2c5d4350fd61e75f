"""CSV files of points in a scene: columns, headings, places of files, refusals."""

import pytest

from fmus.vehicle import BadInput
from orchestrator.scene.points import read

PAIRS = [[0.0, 0.0], [2.0, -8.5], [3e1, 4.0]]


def read_text(tmp_path, text):
    """Points of a driver whose file ``way.csv`` has this text."""
    (tmp_path / "way.csv").write_bytes(text.encode())
    table = {"driver": {"points": "way.csv", "speed": 3.0}}
    read(table, tmp_path, "mine.toml")
    return table["driver"]["points"]


@pytest.mark.parametrize("heading", ["", "x,y\n", "x [m],y [m]\r\n", "\ufeffx,y\n", "\ufeff"])
def test_two_columns_with_or_without_a_heading(tmp_path, heading):
    assert read_text(tmp_path, f"{heading}0,0\n\n2, -8.5\r\n3e1,4.0") == PAIRS


@pytest.mark.parametrize(
    ("text", "line"),
    [("0,0\n2,-8.5\nend,of\n", 3), ("x,y\n0,0\n1\n", 3), ("x,3\n0,0\n", 1), ("1\n2\n", 1), ("x,y\nx,y\n", 2)],
)
def test_a_line_that_is_no_pair_is_named(tmp_path, text, line):
    with pytest.raises(
        BadInput, match=rf"^mine\.toml: driver\.points = '.*way\.csv', line {line}: must be two numbers$"
    ):
        read_text(tmp_path, text)


def test_a_file_that_is_not_there_is_named(tmp_path):
    with pytest.raises(
        BadInput, match=r"^here: drive\.left\.speed_points = '.*none\.csv': cannot be read: No such file"
    ):
        read({"drive": {"left": {"speed_points": "none.csv"}}}, tmp_path, "here")


@pytest.mark.parametrize("place", [("drive",), ("idler_drive",), ("driver",), ("drive", "left"), ("drive", "steering")])
def test_every_drive_may_name_files(tmp_path, place):
    (tmp_path / "a.csv").write_text("0,0\n2,-8.5\n30,4\n")
    drive = {"points": "a.csv", "torque_points": [[1.0, 2.0]]}
    table = {place[0]: drive} if len(place) == 1 else {place[0]: {place[1]: drive}}
    read(table, tmp_path, "mine.toml")
    assert drive == {"points": PAIRS, "torque_points": [[1.0, 2.0]]}
