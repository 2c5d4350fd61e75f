"""Recorded values as files and as tables of other libraries: they come back bit by bit."""

import csv
import sys

import numpy as np
import pandas
import polars
import psutil
import pyarrow.parquet
import pytest
from recorded import STEP, TOPICS, chunked_log, small_log, values
from scipy.io import loadmat

from orchestrator.cli.common import message_and_status
from orchestrator.log import export as export_module
from orchestrator.log.export import export, to_arrow, to_pandas, to_polars, to_xarray
from orchestrator.log.extra import NotInstalled
from orchestrator.log.reader import Log
from orchestrator.log.recorder import Recorder

small = pytest.fixture(scope="module")(small_log)
chunked = pytest.fixture(scope="module")(chunked_log)

TENSIONS, GROUP = "left_track.link[*].tension", export_module.GROUP


def table(path):
    with path.open(newline="") as stream:
        header, *rows = csv.reader(stream)
    return header, np.array(rows, float)


def test_export_of_everything_of_signals_and_of_topics(small, tmp_path):
    files = export(small, tmp_path / "csv")
    assert [file.name for file in files] == [f"{topic[1:].replace('/', '.')}.csv" for topic in TOPICS]
    header, rows = table(tmp_path / "csv" / "left_track.out.csv")
    assert header == ["t [s]", "left_track.speed [m/s]", "left_track.tension.mean [N]"]
    with Log(small) as log:
        series = log.read("/left_track/out")
    assert np.array_equal(rows, np.column_stack([series.t, series.values]))
    (file,) = export(small, tmp_path / "a.csv", ["chassis.speed", "left_track.tension.*"])
    header, rows = table(file)
    assert header == ["t [s]", "left_track.tension.mean [N]", "chassis.speed [m/s]"]
    assert rows.shape == (101, 3)
    assert len(table(*export(small, tmp_path / "csv", [TENSIONS]))[0]) == 65
    (file,) = export(small, tmp_path / "csv", topics=["/*/in"])
    assert file.name == "left_track.in.csv"


def test_files_of_topics_stay_in_their_folder(tmp_path):
    topics = ["/../../a/out", "/..\\..\\a/out", "/A.b", "/a/b", "/", "\0", "/" + "x" * 5000]
    with Recorder(tmp_path / "a.mcap", {topic: [("x", "m")] for topic in topics}, {}, {}) as recorder:
        recorder.close("ok", "", 0)
    files = export(tmp_path / "a.mcap", tmp_path / "csv")
    assert len({file.name.lower() for file in files}) == len(topics)
    assert all(file.parent == tmp_path / "csv" and file.is_file() and len(file.name) < 120 for file in files)


def test_parquet_gives_every_bit_back(chunked, tmp_path):
    odd = np.array([np.nan, -0.0, 5e-324, np.inf])
    with Recorder(tmp_path / "odd.mcap", {"/a/out": [("x", "m")]}, {}, {}) as recorder:
        for k, x in enumerate(odd):
            recorder.write("/a/out", k, 0.1 * k, 0.1, np.array([x]))
        recorder.close("ok", "", 3)
    (file,) = export(tmp_path / "odd.mcap", tmp_path / "odd.parquet")
    assert pyarrow.parquet.read_table(file)["a.x"].to_numpy().tobytes() == odd.tobytes()

    files = export(chunked, tmp_path / "all", kind="parquet")
    assert [file.name for file in files] == [f"{topic[1:].replace('/', '.')}.parquet" for topic in TOPICS]
    with Log(chunked) as log:
        for topic, file in zip(TOPICS, files, strict=True):
            parquet, series = pyarrow.parquet.read_table(file), log.read(topic)
            assert np.array_equal(parquet["t"].to_numpy(), series.t)
            names = [log.name(topic, column) for column in range(len(series.names))]
            assert parquet.column_names == ["t", *names]
            assert np.stack([parquet[name] for name in names], axis=1).tobytes() == series.values.tobytes()
            units = [parquet.field(name).metadata[b"unit"].decode() for name in names]
            assert tuple(units) == log.topics[topic].units


@pytest.mark.long
def test_row_groups_are_filled_and_hold_every_row_once(chunked, tmp_path, monkeypatch):
    for size, topic in ((4000, "/left_track/links"), (4000, "/left_track/out"), (1, "/stats/chassis")):
        monkeypatch.setattr(export_module, "GROUP", size)
        (file,) = export(chunked, tmp_path / "all", topics=[topic], kind="parquet")
        parquet = pyarrow.parquet.ParquetFile(file)
        with Log(chunked) as log:
            series = log.read(topic)
        group = max(size // (8 + 8 * len(series.names)), 1)
        numbers = [parquet.metadata.row_group(k).num_rows for k in range(parquet.num_row_groups)]
        assert set(numbers[:-1]) == {group}
        assert len(numbers) == -(-len(series.t) // group) > 2
        for read in (pandas.read_parquet, polars.read_parquet):
            table = read(file).to_numpy()
            assert np.array_equal(table[:, 0], series.t)
            assert table[:, 1:].tobytes() == series.values.tobytes()


@pytest.mark.long
def test_memory_is_that_of_a_row_group(tmp_path, monkeypatch):
    """Of 160 MB only a group of 2 MB is kept, and 2 kB for each column of each group; of a larger group all."""
    names = tuple(f"x{i}" for i in range(99))
    columns = export_module.Columns(names, ("m",) * 99)

    def held(group):
        monkeypatch.setattr(export_module, "GROUP", group)
        with export_module.open_table(tmp_path / "a.parquet", "parquet", columns) as writer:
            before = psutil.Process().memory_info().rss
            for k in range(200):
                writer.rows(np.full((1000, 100), float(k)))
            return psutil.Process().memory_info().rss - before

    assert held(2_000_000) < 2500 * 100 * 80 + 20e6
    assert held(400_000_000) > 130e6
    rows = GROUP / 8 / 320  # of a group of a track's links, with five groups of outputs
    assert 0.015 * 8 * rows > 2500, "the buffers of a column are large beside its written data"


def test_a_matlab_file(chunked, tmp_path):
    (file,) = export(chunked, tmp_path / "a.mat", [TENSIONS], window=(0.5, 0.7))
    content = loadmat(file)
    assert [str(name[0][0]) for name in content["names"]] == [f"left_track.link[{i}].tension" for i in range(1, 65)]
    assert {str(unit[0][0]) for unit in content["units"]} == {"N"}
    steps = range(500, 701, 5)
    assert np.array_equal(content["t"][:, 0], np.array(steps) * STEP)
    assert np.array_equal(content["values"], [values("/left_track/links", k)[::2] for k in steps])


def test_frames(chunked):
    with Log(chunked) as log:
        t, speed = log.signal("chassis.speed")
        assert log.choose(TENSIONS) == log.choose([TENSIONS])
        tensions = log.select(log.choose([TENSIONS]))["/left_track/links"]
        frame = to_pandas(log, "chassis.speed", "chassis.left.road_arm[*].angle", window=(0.5, 1.0))
        inside = (t >= 0.5) & (t <= 1.0)
        assert isinstance(frame, pandas.DataFrame)
        assert (frame.index.name, frame.shape, frame.attrs["units"]["chassis.speed"]) == ("t", (501, 6), "m/s")
        assert np.array_equal(frame["chassis.speed"].to_numpy(), speed[inside])
        assert np.array_equal(frame.index, t[inside])

        whole = to_polars(log, TENSIONS)
        assert isinstance(whole, polars.DataFrame)
        assert np.array_equal(whole.to_numpy()[:, 1:], tensions.values)
        assert to_arrow(log, TENSIONS).field("left_track.link[7].tension").metadata == {b"unit": b"N"}

        data = to_xarray(log, "left_track.link[*]*")
        assert dict(data.sizes) == {"t": 301, "link": 64}
        assert data["left_track.link.stress"].attrs["units"] == "Pa"
        assert np.array_equal(data["left_track.link.tension"].sel(link=7), tensions.values[:, 6])
        assert to_xarray(log, ["left_track.link[*]*"]).equals(data)
        assert to_pandas(log, ["chassis.speed"], "chassis.left.road_arm[*].angle", window=(0.5, 1.0)).equals(frame)
        alone = to_xarray(log, "chassis.speed", "chassis.left.road_arm[3].angle")
        angle = log.signal("chassis.left.road_arm[3].angle")[1]
        assert np.array_equal(alone["chassis.left.road_arm.angle"].sel(road_arm=3), angle)


def test_samples_lie_on_straight_lines(chunked):
    t = np.array([-1.0, 0.0, 0.0025, 0.77, 9.0])
    with Log(chunked) as log:
        samples = log.sample(["left_track.link[3].tension", "chassis.speed"], t)
        for column, signal in enumerate(("left_track.link[3].tension", "chassis.speed")):
            times, recorded = log.signal(signal)
            assert samples[0, column] == recorded[0]
            assert samples[-1, column] == recorded[-1]
            assert np.array_equal(samples[:, column], np.interp(t, times, recorded))


@pytest.mark.parametrize("package", ["pandas", "xarray", "polars", "pyarrow"])
def test_a_library_that_is_missing_is_exit_2(small, tmp_path, monkeypatch, package):
    ask = {"pandas": to_pandas, "xarray": to_xarray, "polars": to_polars, "pyarrow": to_arrow}[package]
    monkeypatch.setitem(sys.modules, package, None)
    with Log(small) as log, pytest.raises(NotInstalled) as missing:
        ask(log, "chassis.speed")
    assert message_and_status(missing.value)[1] == 2
    if package == "pyarrow":
        with pytest.raises(NotInstalled):
            export(small, tmp_path / "a.parquet", ["chassis.speed"])
        assert not list(tmp_path.iterdir())
