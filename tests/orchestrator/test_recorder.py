"""The recorder: every bit comes back, by the standard's decoding too; digests, rows and pages."""

import tempfile
import time
from pathlib import Path

import numpy as np
import pytest
from google.protobuf.descriptor_pb2 import FileDescriptorSet
from google.protobuf.descriptor_pool import DescriptorPool
from google.protobuf.message_factory import GetMessageClass
from hypothesis import given
from hypothesis import strategies as st
from mcap.reader import make_reader
from recorded import STEP, TOPICS, record, write_steps

from orchestrator.log import recorder as module
from orchestrator.log import schema
from orchestrator.log.reader import Log
from orchestrator.log.recorder import Recorder

ODD_BITS = [
    0x8000000000000000,  # -0.0
    0x0000000000000001,  # the smallest denormal
    0x800FFFFFFFFFFFFF,  # the largest negative denormal
    0x7FF0000000000000,  # inf
    0x7FF8000000000000,  # nan
    0x7FF0DEADBEEF0001,  # a signalling nan with a payload
    0xFFFFFFFFFFFFFFFF,
]
WORDS = st.one_of(st.sampled_from(ODD_BITS), st.integers(0, 2**64 - 1))
NAMES = st.lists(
    st.one_of(
        st.sampled_from(["t", "h", "speed", "a.b", "a_b", "aB", "der(x)", "3d", "z[1].k[2]", "w[3].y", "w[5].y"]),
        st.builds("link[{}].{}".format, st.integers(1, 6), st.sampled_from(["tension", "stress"])),
        st.text("abcXY_.[]12", min_size=1, max_size=8),
    ),
    unique=True,
    max_size=24,
)


def standard_messages(path):
    """(channel, message, decoded message) by MCAP's own reader and protobuf's own decoder."""
    pool, classes = DescriptorPool(), {}
    with path.open("rb") as stream:
        for kind, channel, message in make_reader(stream, validate_crcs=True).iter_messages():
            if kind.id not in classes:
                for file in FileDescriptorSet.FromString(kind.data).file:
                    pool.Add(file)
                classes[kind.id] = GetMessageClass(pool.FindMessageTypeByName(kind.name))
            decoded = classes[kind.id].FromString(message.data)
            assert message.log_time == message.publish_time == round(decoded.t * 1e9)
            yield channel, message, decoded


def of_place(message, place):
    field, _, index = place.rstrip("]").partition("[")
    value = getattr(message, field)
    return value[int(index)] if index else value


@given(NAMES, st.data())
def test_every_bit_comes_back(names, data):
    words = data.draw(st.lists(st.lists(WORDS, min_size=len(names), max_size=len(names)), min_size=1, max_size=4))
    recorded = np.array(words, np.uint64).reshape(len(words), len(names))
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "bits.mcap"
        with Recorder(path, {"/a/out": [(name, "1") for name in names]}, {}, {}) as recorder:
            for k, row in enumerate(recorded):
                recorder.write("/a/out", k, k * 0.1, 0.1, row.view(np.float64))
            recorder.close("ok", "", len(words))
        with Log(path) as log:
            series = log.read("/a/out")
        assert log.complete
        assert series.names == tuple(names)
        assert np.array_equal(np.ascontiguousarray(series.values).view(np.uint64), recorded)
        assert np.array_equal(series.t, np.arange(len(words)) * 0.1)
        assert sum(1 for _ in standard_messages(path)) == len(words)


def test_fields_with_longer_tags(tmp_path):
    names = [f"x{i}" for i in range(3000)]
    row = np.random.default_rng(1).normal(size=3000)
    with Recorder(tmp_path / "wide.mcap", {"/a/out": [(n, "1") for n in names]}, {}, {}) as recorder:
        recorder.write("/a/out", 0, 0.0, 0.1, row)
    ((_, _, message),) = standard_messages(tmp_path / "wide.mcap")
    assert [getattr(message, name) for name in names] == row.tolist()


def test_standard_decoding_gives_the_same_values(tmp_path):
    path = record(tmp_path / "a.mcap", steps=20)
    counts = dict.fromkeys(TOPICS, 0)
    sizes = {}
    with Log(path) as log:
        for channel, message, decoded in standard_messages(path):
            names = [name for name, _ in TOPICS[channel.topic]]
            where = schema.places(names)
            series = log.read(channel.topic)
            row = int(np.flatnonzero(log.sequence(channel.topic) == message.sequence)[0])
            assert [of_place(decoded, place) for place in where] == series.values[row].tolist()
            assert (decoded.t, decoded.h) == (series.t[row], series.h[row])
            counts[channel.topic] += 1
            assert sizes.setdefault(channel.topic, len(message.data)) == len(message.data)
    assert counts == {topic: 5 if topic.endswith("links") else 21 for topic in TOPICS}


def test_equal_runs_have_equal_digests_and_a_changed_bit_or_unit_shows(tmp_path):
    def flip(topic, k, row):
        if (topic, k) == ("/chassis/out", 60):
            row.view(np.uint64)[4] ^= 1
        return row

    paths = {
        "one": record(tmp_path / "one.mcap", flush=0.25),
        "two": record(tmp_path / "two.mcap", wall=7.0, flush=0.001),  # other chunks and another wall clock
        "bit": record(tmp_path / "bit.mcap", change=flip),
    }
    for unit in ("m", "mm"):
        with Recorder(tmp_path / f"{unit}.mcap", {"/a/out": [("x", unit)]}, {}, {}) as recorder:
            recorder.write("/a/out", 0, 0.0, 0.1, np.ones(1))
            recorder.close("ok", "", 0)
        paths[unit] = tmp_path / f"{unit}.mcap"
    digests, seals = {}, {}
    for name, path in paths.items():
        with Log(path) as log:
            digests[name], seals[name] = log.digest(), log.seal
    assert digests["one"] == digests["two"] != digests["bit"]
    assert seals["one"] != seals["two"]
    assert digests["m"] != digests["mm"]


def test_the_array_is_copied_and_steps_that_are_not_due_are_left_out(tmp_path):
    row = np.zeros(2)
    with Recorder(tmp_path / "a.mcap", {"/a/out": [("x", "m"), ("y", "m")]}, {}, {}, every={"/a/out": 3}) as recorder:
        for k in range(10):
            assert recorder.due("/a/out", k) == (k % 3 == 0)
            row[:] = k
            recorder.write("/a/out", k, k * 0.1, 0.1, row)
        recorder.close("ok", "", 9)
    with Log(tmp_path / "a.mcap") as log:
        assert log.read("/a/out").values.tolist() == [[0, 0], [3, 3], [6, 6], [9, 9]]
        assert log.topics["/a/out"].every == 3


def test_an_exception_closes_the_log_as_failed(tmp_path):
    def fail():
        with Recorder(tmp_path / "a.mcap", TOPICS, {}, {}) as recorder:
            write_steps(recorder, 7)
            raise RuntimeError("the chain came off")

    with pytest.raises(RuntimeError, match="came off"):
        fail()
    with Log(tmp_path / "a.mcap") as log:
        assert log.complete
        assert [log.closing[key] for key in ("status", "message", "steps")] == ["failed", "the chain came off", 7]


def test_a_closed_log_stays_as_it_is(tmp_path):
    recorder = Recorder(tmp_path / "a.mcap", TOPICS, {}, {})
    recorder.close("ok", "", 0)
    recorder.close("failed", "again", 3)
    with Log(tmp_path / "a.mcap") as log:
        assert log.closing["status"] == "ok"


def test_pages_that_are_lent_are_left_alone(tmp_path):
    """Pages that are lent for filling stay in place, even if messages are overdue."""
    with Recorder(tmp_path / "a.mcap", {"/a/out": [("x", "m")]}, {}, {}, flush=0.02) as recorder:
        (page,) = recorder.pages("/a/out")
        for k in range(1, 4):
            recorder.reserve()
            before = page.block
            time.sleep(0.1)
            assert page.block is before
            row = before.count
            before.sequence[row], before.t[row], before.h[row], before.values[row] = k, k * STEP, STEP, -k
            recorder.commit({"/a/out": 1})
            assert page.block is not before
        recorder.close("ok", "", 3)
    with Log(tmp_path / "a.mcap") as log:
        assert log.read("/a/out").values[:, 0].tolist() == [-1.0, -2.0, -3.0]
        assert log.read("/a/out").t.tolist() == [STEP, 2 * STEP, 3 * STEP]


def test_topics_written_together_are_those_written_one_by_one(tmp_path, monkeypatch):
    monkeypatch.setattr(module, "CHUNK", 5_000)
    topics = {"/a/in": [("u", "m")], "/stats/b": [("wall_time", "s")], "/b/out": [("y", "m"), ("z", "m")]}
    topics["/a/out"] = [("x", "m")]
    for name in ("apart", "together"):
        with Recorder(tmp_path / name, topics, {}, {}, every={"/a/out": 2}, flush=60) as recorder:
            page = recorder.join_topics(["/a/in"], ["/a/out", "/b/out"]) if name == "together" else ""
            for k in range(301):
                a, b, u = np.array([k]), np.array([-k, 0.5 * k]), np.array([k - 1.0])
                if page:
                    recorder.write(page, k, k * STEP, STEP, u, a, b)
                else:
                    if k:
                        recorder.write("/a/in", k - 1, (k - 1) * STEP, STEP, u)
                    recorder.write("/b/out", k, k * STEP, STEP, b)
                    recorder.write("/a/out", k, k * STEP, STEP, a)
                recorder.write("/stats/b", k, k * STEP, STEP, a)
            recorder.close("ok", "", 300)
    with Log(tmp_path / "apart") as apart, Log(tmp_path / "together") as together:
        assert together.hashes() == apart.hashes()
        assert together.lengths() == {"/a/in": 300, "/b/out": 301, "/stats/b": 301, "/a/out": 151}
        order = [[messages.topic for messages in piece] for piece in together.chunks()]
        assert order[0] == list(topics)
