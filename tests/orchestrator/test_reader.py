"""A log is read by name, window and block; differences to the bit; who reads the format."""

import re
import shutil
from contextlib import nullcontext
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader
from recorded import ATTACHMENTS, METADATA, STEP, TOPICS, chunked_log, small_log, spans, values

from orchestrator.log.bitwise import first_difference
from orchestrator.log.container import LogUnreadable
from orchestrator.log.reader import Log
from orchestrator.log.recorder import Recorder
from orchestrator.log.time_series import Series

small = pytest.fixture(scope="module")(small_log)
chunked = pytest.fixture(scope="module")(chunked_log)


def test_what_a_log_says(small):
    with Log(small) as log:
        assert log.complete
        assert log.faults == []
        assert {one: [*zip(about.names, about.units, strict=True)] for one, about in log.topics.items()} == TOPICS
        assert log.topics["/left_track/links"].every == 5
        assert log.metadata == METADATA
        assert {name: log.attachment(name) for name in log.attachments} == ATTACHMENTS
        assert [log.closing[key] for key in ("status", "message", "steps")] == ["ok", "", 100]
        assert log.closing["messages"] == {topic: 21 if topic.endswith("links") else 101 for topic in TOPICS}
        assert log.closing["sha256"] == log.hashes()
        for topic in TOPICS:
            if not topic.startswith("/stats/"):
                every = log.topics[topic].every
                series = log.read(topic)
                assert np.array_equal(log.sequence(topic), np.arange(0, 101, every))
                assert np.array_equal(series.t, np.arange(0, 101, every) * STEP)
                assert np.array_equal(series.values, [values(topic, k) for k in range(0, 101, every)])


def test_signals_by_name(small):
    with Log(small) as log:
        t, tension = log.signal("left_track.link[64].tension")
        assert np.array_equal(t, np.arange(0, 101, 5) * STEP)
        assert tension[3] == values("/left_track/links", 15)[126]
        assert log.unit("left_track.link[64].tension") == "N"
        assert log.signal("stats.chassis.wall_time")[1][5] == 5.0
        assert "chassis.left.road_arm[3].angle" in log.signals


def series(values, t=None):
    values = np.array(values, float)
    t = np.arange(len(values)) * 0.5 if t is None else np.array(t)
    return Series(t, np.full(len(t), 0.5), ("x", "y"), values)


def test_first_difference():
    recorded = series([[0, 1], [np.nan, 0.0], [4, 5]])
    assert first_difference("chassis", recorded, series([[0, 1], [np.nan, 0.0], [4, 5]])) is None
    difference = first_difference("chassis", recorded, series([[0, 1], [np.nan, -0.0], [5, 5]]))
    assert (difference.variable, difference.step, difference.t) == ("y", 1, 0.5)
    assert str(difference) == (
        "chassis.y differs first at step 1, t = 0.5 s: "
        "recorded 0.0 (0x0000000000000000), replayed -0.0 (0x8000000000000000)"
    )
    assert first_difference("chassis", recorded, series([[0, 1], [np.nan, 0.0]])).step == 2
    assert first_difference("chassis", recorded, series([[0, 1], [np.nan, 0.0], [4, 5]], [0, 0.5, 1.1])).variable == "t"
    with pytest.raises(ValueError, match="different variables"):
        first_difference("chassis", recorded, Series(*recorded[:2], ("x", "z"), recorded.values))


def test_who_knows_mcap_and_protobuf():
    """Only the modules of a log's file, chunks and messages import mcap, only the schema imports protobuf."""
    mcap = {"container.py", "container_writer.py", "log_file.py", "message_records.py", "seal.py"}
    for package, users in (("mcap", mcap), ("google.protobuf", {"schema.py"})):
        found = re.compile(rf"^\s*(from|import) {re.escape(package)}\b", re.MULTILINE)
        files = Path(__file__).parents[2].glob("orchestrator/**/*.py")
        assert {path.name for path in files if found.search(path.read_text())} == users


@pytest.mark.parametrize("room", [0, 1 << 30])
def test_what_is_selected_is_what_is_read_and_is_kept_where_there_is_room(chunked, tmp_path, room):
    path = Path(shutil.copy(chunked, tmp_path / "log.mcap"))
    with Log(path, kept=room) as log, Log(chunked) as whole:
        for topic, about in log.topics.items():
            series, columns = whole.read(topic), [len(about.names) - 1, 0]
            for window in ((-np.inf, np.inf), (0.7, 0.9), (0.0, 0.0), (5.0, 6.0)):
                inside = (series.t >= window[0] - 1e-9) & (series.t <= window[1] + 1e-9)
                selection = log.select({topic: columns}, window)[topic]
                assert np.array_equal(selection.t, series.t[inside])
                assert np.array_equal(selection.values, series.values[inside][:, columns])
                assert selection.names == (about.names[-1], about.names[0])
            ends = log.ends(topic)
            assert np.array_equal(ends.t, series.t[[0, -1]])
            assert np.array_equal(ends.values, series.values[[0, -1]])
            assert log.lengths()[topic] == len(series.t)
        with path.open("r+b") as stream:
            stream.write(bytes(path.stat().st_size))  # what is read again is not there
        with nullcontext() if room else pytest.raises(LogUnreadable):
            assert log.ends("/chassis/out").values[-1].tobytes() == whole.ends("/chassis/out").values[-1].tobytes()


@pytest.mark.parametrize(("size", "more"), [(100, 0), (1499, 2), (1500, 0), (1, 1), (2000, 2)])
def test_blocks_are_topics_side_by_side(chunked, size, more):
    topics = ["/left_track/in", "/chassis/out"]
    with Log(chunked) as log:
        blocks = list(log.blocks(topics, size, more))
        for topic in topics:
            parts = [block[topic].values for block in blocks]
            assert [len(part) for part in parts[:-1]] == [size + more] * (len(parts) - 1)
            assert 0 < len(parts[-1]) < size + max(more, 1)
            again = np.concatenate([*(part[:size] for part in parts[:-1]), parts[-1]])
            assert np.array_equal(again, log.read(topic).values)


def test_topics_of_one_kind_share_a_message_type_where_they_are_alike(tmp_path):
    topics = {"/a/out": [("x", "m")], "/b/out": [("x", "m")], "/c/out": [("y", "m")]}
    with Recorder(tmp_path / "a.mcap", topics, {}, {}, types=dict.fromkeys(topics, "cotrack.Kind.Out")) as recorder:
        recorder.close("ok", "", 0)
    with (tmp_path / "a.mcap").open("rb") as stream:
        summary = make_reader(stream).get_summary()
    type_names = {channel.topic: summary.schemas[channel.schema_id].name for channel in summary.channels.values()}
    assert type_names == {"/a/out": "cotrack.Kind.Out", "/b/out": "cotrack.Kind.Out", "/c/out": "cotrack.c.Out"}
    assert len(summary.schemas) == 2


def test_a_window_needs_no_byte_of_other_chunks(chunked, tmp_path):
    """A log is opened by its summary, and a window reads the chunks that overlap it: all others may be destroyed."""
    data = bytearray(chunked.read_bytes())
    with Log(chunked) as log:
        wanted, window = log.choose(["chassis.speed"]), (0.5, 0.6)
        expected = log.select(wanted, window)["/chassis/out"]
        topics, names = log.topics, log.attachments
    others = [(begin, end) for begin, end, first, last in spans(data) if last < 0.49 or first > 0.61]
    assert len(others) > 4
    for begin, end in others:
        data[begin:end] = bytes(end - begin)
    (tmp_path / "holes.mcap").write_bytes(data)
    with Log(tmp_path / "holes.mcap") as log:
        assert (log.topics, log.attachments, log.complete) == (topics, names, True)
        read = log.select(wanted, window)["/chassis/out"]
        assert np.array_equal(read.t, expected.t)
        assert np.array_equal(read.values, expected.values)
        with pytest.raises(LogUnreadable):
            log.read("/chassis/out")
    with Log(tmp_path / "holes.mcap", by_index=False) as log:
        assert not log.complete


def test_messages_of_a_chunk_are_in_order_of_time(chunked):
    """Also by MCAP's own reader; those of a log in any other order read alike (``test_seal``)."""
    with chunked.open("rb") as stream:
        about = make_reader(stream).get_summary().statistics
        times = [message.log_time for _, _, message in make_reader(stream).iter_messages(log_time_order=False)]
    assert (about.message_start_time, about.message_end_time, about.message_count) == (0, max(times), len(times))
    falls = [k for k, (a, b) in enumerate(pairwise(times)) if b < a]
    assert len(falls) <= len(spans(chunked.read_bytes())) - 1, "one at most from a chunk to the next"
