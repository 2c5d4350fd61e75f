"""Inputs that are outputs of others are recorded once and read back exactly, wherever a log is cut."""

import json

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.reader import make_reader
from mcap.writer import Writer

from orchestrator.cosim.coupling import SCHEMES
from orchestrator.execution.simulate import simulate
from orchestrator.log import recorder as module
from orchestrator.log.log_file import LogFailed
from orchestrator.log.reader import Log
from orchestrator.log.recorder import Recorder
from orchestrator.log.time_series import RULES, Wire, wired_inputs
from orchestrator.log.tools import BROKEN, RECOVERED, WHOLE, recover, verify
from orchestrator.scene.scene import load

STEP, STEPS = 1e-3, 300
TOPICS = {
    "/a/in": [("f", "N"), ("own", "1"), ("g", "N"), ("w", "1")],
    "/a/out": [("x", "m"), ("y", "m"), ("z", "m")],
    "/b/in": [("x", "m"), ("y", "m")],
    "/b/out": [("f", "N"), ("g", "N")],
}
WIRES = {
    "/a/in": [Wire("/b/out", "end", ("f",), ("f",)), Wire("/b/out", "middle", ("g",), ("g",)),
              Wire("/a/out", "start", ("z",), ("w",))],
    "/b/in": [Wire("/a/out", "start", ("y", "x"), ("y", "x"))],
}  # fmt: skip


def rows(k):
    """Inputs of the step that leads to k, and outputs at k, of both instances."""

    def out(j):
        return np.sin(j + np.arange(3.0)), np.cos(0.1 * j) * np.array([1.0, -2.5])

    (x, y, z), (_, g) = out(k - 1)[0], out(k - 1)[1]
    f, later = out(k)[1]
    return np.array([f, float(k), 0.5 * (g + later), z]), np.array([x, y]), *out(k)


def write(path, wires=WIRES, change=lambda k, row: None, chunk=3000):
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(module, "CHUNK", chunk)
        with Recorder(path, TOPICS, {}, {}, wires=wires, flush=60) as recorder:
            page = recorder.join_topics(["/a/in", "/b/in"], ["/a/out", "/b/out"])
            for k in range(STEPS + 1):
                row = rows(k)
                change(k, row)
                recorder.write(page, k, k * STEP, STEP, *row)
            recorder.close("ok", "", STEPS)
    return path


@pytest.fixture(scope="module")
def wired(tmp_path_factory):
    return write(tmp_path_factory.mktemp("logs") / "wired.mcap")


def whole(topic):
    """Expected values of a topic."""
    number = list(TOPICS).index(topic) // 2 + 2 * topic.endswith("out")
    first = int(topic.endswith("in"))
    return np.array([rows(k)[number] for k in range(first, STEPS + 1)])


def test_all_ways_of_reading_give_what_was_handed_over(wired):
    with Log(wired) as log:
        assert verify(wired).code == WHOLE
        assert log.topics["/a/in"].names == ("f", "own", "g", "w")
        blocks = list(log.blocks([*TOPICS], 64))
        for topic in TOPICS:
            series, expected = log.read(topic), whole(topic)
            assert series.values.tobytes() == expected.tobytes()
            assert np.array_equal(series.t, np.arange(len(expected)) * STEP)
            assert log.ends(topic).values.tobytes() == expected[[0, -1]].tobytes()
            assert np.concatenate([block[topic].values for block in blocks]).tobytes() == expected.tobytes()
            for window in ((0.1, 0.2), (0.0, 0.0), (0.2995, 1.0)):
                inside = (series.t >= window[0] - 1e-9) & (series.t <= window[1] + 1e-9)
                for columns in ([len(TOPICS[topic]) - 1], [1, 0]):
                    selection = log.select({topic: columns}, window)[topic]
                    assert selection.values.tobytes() == expected[inside][:, columns].tobytes()
        assert np.array_equal(log.signal("b.y")[1], whole("/b/in")[:, 1])


def test_they_take_no_room(wired, tmp_path):
    full = write(tmp_path / "full.mcap", {})
    with Log(full) as log, Log(wired) as short:
        sizes = [{m.topic: m.rows.shape[1] for piece in one.chunks() for m in piece} for one in (log, short)]
        assert [sizes[0][topic] - sizes[1][topic] for topic in TOPICS] == [30, 0, 20, 0]
        assert sizes[1]["/b/in"] == 31 + 18
        assert sizes[1]["/a/in"] == 31 + 18 + 10
        assert all(np.array_equal(log.read(topic).values, short.read(topic).values) for topic in TOPICS)


def last_bit(k, arrays, given, column):
    """Change an input of step 200 in its last bit."""
    if k == 200:
        given[column] = np.nextafter(given[column], 9.0)


def sign_of_zero(k, arrays, given, column):
    """Write 0 everywhere, but for an input of step 200, which is -0.0: equal to 0 as a number."""
    for values in arrays:
        values[:] = 0.0
    if k == 200:
        given[column] = -0.0


@pytest.mark.parametrize("rule", RULES)
@pytest.mark.parametrize("fault", [last_bit, sign_of_zero])
def test_an_input_that_is_another_by_one_bit_ends_the_log(tmp_path, rule, fault):
    topic, wire = next((topic, wire) for topic, wires in WIRES.items() for wire in wires if wire.rule == rule)
    column = [name for name, _ in TOPICS[topic]].index(wire.inputs[0])

    def change(k, row):
        fault(k, row, row[list(TOPICS).index(topic) // 2], column)

    with pytest.raises(LogFailed, match=rf"{topic}: '{wire.inputs[0]}' at t = 0\.199 s is not what its coupling"):
        write(tmp_path / "a.mcap", change=change)
    with Log(tmp_path / "a.mcap") as log:
        assert 100 < len(log.read("/a/in").t) <= 199


def test_a_step_that_was_not_written_is_no_proof(tmp_path):
    log = Recorder(tmp_path / "a", TOPICS, {}, {}, wires=WIRES)
    page = log.join_topics(["/a/in", "/b/in"], ["/a/out", "/b/out"])
    for k in (0, 1, 3):
        log.write(page, k, k * STEP, STEP, *rows(k))
    with pytest.raises(LogFailed, match="a step is missing"):
        log.close("ok", "", 3)


def test_outputs_that_are_not_all_recorded_make_no_wires(tmp_path):
    with Recorder(tmp_path / "a", TOPICS, {}, {}, wires=WIRES, every={"/b/out": 2}) as log:
        with pytest.raises(ValueError, match="/a/in: not every step of /b/out is recorded with it"):
            log.join_topics(["/a/in", "/b/in"], ["/a/out", "/b/out"])
        log.close("ok", "", 0)


@pytest.mark.long
@settings(max_examples=60)
@given(st.floats(0.0, 1.0))
def test_a_cut_log_gives_what_it_has(wired, fraction):
    data = wired.read_bytes()
    path = wired.with_name("cut.mcap")
    path.write_bytes(data[: 8 + int(fraction * (len(data) - 9))])
    with Log(path) as log:
        for topic in log.topics:
            values = log.read(topic).values
            assert values.tobytes() == whole(topic)[: len(values)].tobytes()


def test_a_lost_chunk_takes_its_inputs_along(wired, tmp_path):
    with Log(wired) as log:
        lost = list(log._file.spans)[2]
        first, last = (round(end / STEP) for end in log._file.spans[lost])
    data = bytearray(wired.read_bytes())
    data[lost + 200] ^= 1
    (tmp_path / "bad.mcap").write_bytes(data)
    assert verify(tmp_path / "bad.mcap").code == BROKEN
    assert recover(tmp_path / "bad.mcap", tmp_path / "saved.mcap").code == RECOVERED
    with Log(tmp_path / "saved.mcap") as log:
        there = np.setdiff1d(np.arange(STEPS), np.arange(first, last + 1))
        series = log.read("/a/in")
        assert np.array_equal(np.rint(series.t / STEP), there)
        assert series.values.tobytes() == whole("/a/in")[there].tobytes()
        assert np.array_equal(np.rint(log.read("/b/in").t / STEP), there)


def write_again(source, path, by_time, lost=("", -1)):
    """Write the messages of a log again, by time or as they stand, without the ``lost`` one: topic and sequence."""
    with source.open("rb") as stream, path.open("wb") as target:
        writer = Writer(target, chunk_size=2000)
        writer.start()
        numbers = {}
        for kind, channel, message in make_reader(stream).iter_messages(log_time_order=by_time):
            if channel.topic not in numbers:
                schema = writer.register_schema(kind.name, kind.encoding, kind.data)
                numbers[channel.topic] = writer.register_channel(channel.topic, "protobuf", schema, channel.metadata)
            if (channel.topic, message.sequence) != lost:
                number = numbers[channel.topic]
                writer.add_message(number, message.log_time, message.data, message.publish_time, message.sequence)
        writer.finish()
    return path


def test_messages_in_the_order_of_time_read_alike(wired, tmp_path):
    with Log(wired) as ours, Log(write_again(wired, tmp_path / "other.mcap", by_time=True)) as theirs:
        assert theirs.digest() == ours.digest()
        for topic in TOPICS:
            assert theirs.read(topic).values.tobytes() == ours.read(topic).values.tobytes()


@pytest.mark.parametrize(("rule", "missing"), [("start", [100]), ("end", [99]), ("middle", [99, 100])])
def test_lost_outputs_take_along_the_inputs_that_need_them(tmp_path, rule, missing):
    """Outputs at step 100 are the start of the step 100 and the end of the step 99."""
    topic, wire = next((topic, wire) for topic, wires in WIRES.items() for wire in wires if wire.rule == rule)
    whole_log = write(tmp_path / "whole.mcap", {topic: [wire]})
    with Log(write_again(whole_log, tmp_path / "lost.mcap", by_time=False, lost=(wire.source, 100))) as log:
        series = log.read(topic)
    there = np.setdiff1d(np.arange(STEPS), missing)
    assert np.array_equal(np.rint(series.t / STEP), there)
    assert series.values.tobytes() == whole(topic)[there].tobytes()


def test_a_lost_input_is_missing_alone(wired, tmp_path):
    """Its outputs are there: the inputs before and behind it get theirs."""
    topic = next(topic for topic, wires in WIRES.items() if wires)
    with Log(write_again(wired, tmp_path / "lost.mcap", by_time=False, lost=(topic, 100))) as log:
        series = log.read(topic)
    there = np.setdiff1d(np.arange(STEPS), [100])
    assert np.array_equal(np.rint(series.t / STEP), there)
    assert series.values.tobytes() == whole(topic)[there].tobytes()


def test_a_wire_that_leads_nowhere_is_a_fault(tmp_path):
    topics = {topic: about for topic, about in TOPICS.items() if topic != "/b/out"}
    with Recorder(tmp_path / "a", topics, {}, {}, wires=WIRES) as log:
        log.close("ok", "", 0)
    with Log(tmp_path / "a") as log:
        assert "/a/in" not in log.topics
        assert "/b/in" in log.topics
        assert any("/a/in is wired to /b/out, which lacks what it needs" in fault for fault in log.faults)
    assert verify(tmp_path / "a").code == BROKEN


@pytest.mark.parametrize(
    ("output", "says"), [("y", ""), ("z", "takes 'y' from 'y' of /a/out, which system.json does not connect")]
)
def test_wires_are_held_against_the_connections(tmp_path, output, says):
    ways = [("a", ["x", output], "b", ["x", "y"]), ("b", ["f", "g"], "a", ["f", "g"]), ("a", ["z"], "a", ["w"])]
    table = {
        "instances": [{"name": "a"}, {"name": "b"}],
        "connections": [dict(zip(("source", "outputs", "target", "inputs"), way, strict=True)) for way in ways],
    }
    with Recorder(tmp_path / "a", TOPICS, {"system.json": json.dumps(table).encode()}, {}, wires=WIRES) as log:
        log.close("ok", "", 0)
    verdict = verify(tmp_path / "a")
    assert verdict.code == (BROKEN if says else WHOLE)
    assert says in verdict.sentences[0]


@pytest.mark.parametrize("rule", RULES)
def test_rules(rule):
    start, end = np.array([1.0, -0.0]), np.array([2.0, 4.0])
    expected = {"start": [1.0, -0.0], "end": [2.0, 4.0], "middle": [1.5, 2.0]}[rule]
    assert np.array_equal(wired_inputs(rule, start, end), expected)


HANDED_ON = {
    "tracks_first": {"state", "rate", "mean"},
    "jacobi": {"state"},
    "gauss_seidel": {"state", "mean"},
    "iterative": {"state", "mean"},
    "energy_corrected": {"state", "mean"},
}


@pytest.mark.parametrize("coupling", SCHEMES)
def test_couplings_say_what_they_only_hand_on(tmp_path, coupling):
    """Couplings say which inputs they only hand on; extrapolated or iterated inputs are recorded in full.

    The log's own check passes for all others.
    """
    settings = ("run.stop=0.05", "expect={}", "drive.ramp_start=0", f"run.coupling={coupling}")
    assert simulate(load("rig", "rigid", settings), tmp_path / "a.mcap")["status"] == "ok"
    with Log(tmp_path / "a.mcap") as log:
        connections = log.table("system.json")["connections"]
        assert {each["carries"] for each in connections} == {"state", "rate", "mean"}
        wired = {(topic, name) for topic, about in log.topics.items() for wire in about.wires for name in wire.inputs}
        assert wired == {
            (f"/{each['target']}/in", name)
            for each in connections
            if each["carries"] in HANDED_ON[coupling]
            for name in each["inputs"]
        }
