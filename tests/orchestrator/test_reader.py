import re
import struct
import tempfile
from pathlib import Path

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer
from recorded import ATTACHMENTS, METADATA, STEP, TOPICS, chunked_log, record, small_log, values

from orchestrator.log import container, log_metadata
from orchestrator.log.bitwise import first_difference
from orchestrator.log.container import LogUnreadable
from orchestrator.log.reader import Log, NoSuchSignal
from orchestrator.log.recorder import Recorder
from orchestrator.log.time_series import Series
from orchestrator.log.tools import WHOLE, verify

small = pytest.fixture(scope="module")(small_log)
chunked = pytest.fixture(scope="module")(chunked_log)


def test_what_a_log_says(small):
    with Log(small) as log:
        assert log.complete
        assert log.faults == []
        assert {
            topic: list(zip(about.names, about.units, strict=True)) for topic, about in log.topics.items()
        } == TOPICS
        assert log.topics["/left_track/links"].every == 5
        assert log.metadata == METADATA
        assert {name: log.attachment(name) for name in log.attachments} == ATTACHMENTS
        assert {key: log.closing[key] for key in ("status", "message", "steps")} == {
            "status": "ok",
            "message": "",
            "steps": 100,
        }
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


def test_an_unknown_signal_is_searched_in_descriptions(tmp_path):
    """A damaged description leaves names like the unknown one."""
    topics = {"/chassis/out": [(name, "1") for name in ("turning.z", "yaw", "tension.min", "tension.max", "x")]}
    described = b'<m><ScalarVariable name="turning.z" description="Its yaw rate, world"/></m>'
    for content, found in ((described, "turning.z"), (described[:-1], "yaw"), (b"", "yaw")):
        with Recorder(tmp_path / "a.mcap", topics, {"chassis.modelDescription.xml": content}, {}) as recorder:
            recorder.close("ok", "", 0)
        with Log(tmp_path / "a.mcap") as log:
            with pytest.raises(NoSuchSignal, match=rf"'chassis\.yaw_rate'; did you mean 'chassis\.{found}'\?"):
                log.signal("chassis.yaw_rate")
            with pytest.raises(NoSuchSignal, match=r"mean 'chassis\.tension\.min' or 'chassis\.tension\.max'"):
                log.signal("tension")


def test_a_vector_is_told_by_its_components(tmp_path):
    topics = {"/track/links": [*((f"joint[4].force.{axis}", "N") for axis in "xyz"), ("joint[4].force_peak", "N")]}
    with Recorder(tmp_path / "a.mcap", topics, {}, {}) as recorder:
        recorder.close("ok", "", 0)
    said = (
        r"has no signal 'track\.joint\[4\]\.force': it has the components \.x, \.y, \.z; 'track\.joint\[4\]\.force\.\*'"
    )
    with Log(tmp_path / "a.mcap") as log:
        with pytest.raises(NoSuchSignal, match=said):
            log.signal("track.joint[4].force")
        with pytest.raises(NoSuchSignal, match="did you mean"):
            log.signal("track.joint[4].forc")


def test_what_a_log_does_not_hold_is_one_sentence(small):
    with Log(small) as log:
        with pytest.raises(NoSuchSignal, match=r"has no signal 'chassis\.sped'; did you mean 'chassis\.speed'\?"):
            log.signal("chassis.sped")
        with pytest.raises(NoSuchSignal, match="has no topic '/chassis/outs'; did you mean '/chassis/out'"):
            log.read("/chassis/outs")
        with pytest.raises(NoSuchSignal, match="has no attachment"):
            log.attachment("scene.toml")


@pytest.mark.parametrize("content", [b"", b"t,x\n0,1\n", b"\x89MCAP1\r\n" * 9])
def test_what_is_no_log_is_one_sentence(tmp_path, content):
    (tmp_path / "a.mcap").write_bytes(content)
    with pytest.raises(LogUnreadable, match="is not a log"):
        Log(tmp_path / "a.mcap")


def test_a_missing_log_is_one_sentence(tmp_path):
    with pytest.raises(LogUnreadable, match=r"the log .* cannot be read: no such file or directory"):
        Log(tmp_path / "a.mcap")


@settings(max_examples=60)
@given(st.floats(0.0, 1.0))
@example(0.0)
@example(2.5e-05)  # in the header
def test_a_cut_log_reads_as_far_as_it_goes(chunked, fraction):
    data = chunked.read_bytes()
    with Log(chunked) as log:
        whole = {topic: log.read(topic) for topic in TOPICS}
    end = 8 + int(fraction * (len(data) - 9))
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "cut.mcap"
        path.write_bytes(data[:end])
        with Log(path) as log:
            assert not log.complete
            assert log.faults
            for topic in log.topics:
                series = log.read(topic)
                m = len(series.t)
                assert np.array_equal(series.t, whole[topic].t[:m])
                assert np.array_equal(series.values, whole[topic].values[:m])
            later = [chunk for chunk in log._file.spans if chunk >= end]
            assert not later


def test_most_of_a_cut_log_is_there(chunked):
    data = chunked.read_bytes()
    path = chunked.with_name("most.mcap")
    path.write_bytes(data[: int(0.9 * len(data))])
    with Log(path) as log:
        assert len(log.read("/chassis/out").t) > 700
        assert log.closing is None


def test_messages_in_any_order_and_compression_read_alike(small, tmp_path):
    """Messages in any order and compression read alike; MCAP's own writer sorts all topics by time."""
    for compression in (CompressionType.NONE, CompressionType.ZSTD):
        with small.open("rb") as stream, (tmp_path / "other.mcap").open("wb") as target:
            writer = Writer(target, chunk_size=20_000, compression=compression)
            writer.start()
            numbers = {}
            for kind, channel, message in make_reader(stream).iter_messages(log_time_order=True):
                if channel.topic not in numbers:
                    schema = writer.register_schema(kind.name, kind.encoding, kind.data)
                    numbers[channel.topic] = writer.register_channel(
                        channel.topic, "protobuf", schema, channel.metadata
                    )
                number = numbers[channel.topic]
                writer.add_message(number, message.log_time, message.data, message.publish_time, message.sequence)
            writer.finish()
        with Log(small) as ours, Log(tmp_path / "other.mcap") as theirs:
            assert theirs.digest() == ours.digest()
            assert np.array_equal(theirs.read("/left_track/links").values, ours.read("/left_track/links").values)


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
        first_difference("chassis", recorded, recorded._replace(names=("x", "z")))


def test_who_knows_mcap_and_protobuf():
    """Only the modules of a log's file, chunks and messages import mcap, only the schema imports protobuf."""
    users = {"mcap": set(), "google.protobuf": set()}
    for path in Path(__file__).parents[2].glob("orchestrator/**/*.py"):
        for package, importers in users.items():
            if re.search(rf"^\s*(from|import) {re.escape(package)}\b", path.read_text(), re.MULTILINE):
                importers.add(path.name)
    mcap = {
        "container.py", "container_writer.py", "log_file.py", "message_records.py", "seal.py",
    }  # fmt: skip
    assert users == {"mcap": mcap, "google.protobuf": {"schema.py"}}


@pytest.mark.parametrize("small", [0, 1 << 30])
def test_what_is_selected_is_what_is_read_and_is_kept_of_a_small_log_alone(chunked, monkeypatch, small):
    monkeypatch.setattr(container, "SMALL", small)
    with Log(chunked) as log, Log(chunked) as whole:
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
        assert bool(log._file.unpacked) == bool(small)
        with pytest.raises(NoSuchSignal, match="no topic '/left/out'"):
            log.select({"/left/out": [0]})


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


OLD = Path(__file__).with_name("logs") / "format_1.mcap"  # made on 2026-11-21, before formats had numbers


def test_an_old_log_stays_readable():
    """An old log stays readable, with the same digest."""
    with Log(OLD) as log:
        assert log.digest() == "aa9904c9ceb3be31b23ee579c6f99991302ec69b75dd956b3315d5acbb79fb3e"
        assert len(log.read("/chain/in").t) == 20
        assert log.read("/chain/links").values.shape == (5, 38)
    assert verify(OLD).code == WHOLE


def test_a_log_of_a_newer_format_is_refused_with_a_sentence(tmp_path, monkeypatch):
    monkeypatch.setattr(log_metadata, "FORMAT_VERSION", 3)
    record(tmp_path / "new.mcap", 3)
    monkeypatch.undo()
    with pytest.raises(
        LogUnreadable, match=r"new\.mcap has format 3 of a newer cotrack: this one reads formats 1 to 2"
    ):
        Log(tmp_path / "new.mcap")


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
        others = [offset for offset, (first, last) in log._file.spans.items() if last < 0.49 or first > 0.61]
        ends = {offset: log._file.following(offset) for offset in others}
        topics, names = log.topics, log.attachments
    assert len(others) > 4
    for offset, end in ends.items():
        data[offset:end] = bytes(end - offset)
    (tmp_path / "holes.mcap").write_bytes(data)
    with Log(tmp_path / "holes.mcap") as log:
        assert (log.topics, log.attachments, log.complete) == (topics, names, True)
        read = log.select(wanted, window)["/chassis/out"]
        assert np.array_equal(read.t, expected.t)
        assert np.array_equal(read.values, expected.values)
        with pytest.raises(LogUnreadable, match="is damaged"):
            log.read("/chassis/out")
    with Log(tmp_path / "holes.mcap", by_index=False) as log:
        assert not log.complete


def test_messages_of_a_chunk_are_in_order_of_time(chunked):
    prefix = struct.Struct("<BQHIQ")
    with Log(chunked) as log:
        contents = [log._file._content(offset) for offset in log._file.spans]
    for content in contents:
        offset, times = 0, []
        while offset < len(content):
            _, length, _, _, time = prefix.unpack_from(content, offset)
            times.append(time)
            offset += 9 + length
        assert len(times) > 100
        assert times == sorted(times)
