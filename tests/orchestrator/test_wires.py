"""Inputs that are outputs of others are recorded once and read back exactly, wherever a log is cut."""

import json

import numpy as np
import pytest
from mutated import Content
from wired_logs import STEP, STEPS, TOPICS, WIRES, rows, write

from orchestrator.cosim.coupling import COUPLINGS
from orchestrator.execution.simulate import simulate
from orchestrator.log.log_file import LogFailed
from orchestrator.log.reader import Log
from orchestrator.log.recorder import Recorder
from orchestrator.log.time_series import RULES
from orchestrator.log.tools import BROKEN, WHOLE, verify
from orchestrator.scene.scene import load


def wire_of(rule):
    """Topic and wire of a rule."""
    return next((topic, wire) for topic, wires in WIRES.items() for wire in wires if wire.rule == rule)


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


@pytest.mark.parametrize("rule", RULES)
@pytest.mark.parametrize("zeros", [False, True])
def test_an_input_that_is_another_by_one_bit_ends_the_log(tmp_path, rule, zeros):
    """At step 200 the last bit of an input changes, or it is -0.0 where all is 0: equal as a number."""
    topic, wire = wire_of(rule)
    column = [name for name, _ in TOPICS[topic]].index(wire.inputs[0])

    def change(k, row):
        given = row[list(TOPICS).index(topic) // 2]
        for values in row if zeros else ():
            values[:] = 0.0
        if k == 200:
            given[column] = -0.0 if zeros else np.nextafter(given[column], 9.0)

    with pytest.raises(LogFailed, match=rf"{topic}: '{wire.inputs[0]}' at t = 0\.199 s is not what its coupling"):
        write(tmp_path / "a.mcap", change=change)
    with Log(tmp_path / "a.mcap", unfinished=True) as log:
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


def without(source, path, lost):
    """The log without one message: topic and step."""
    content = Content(source)
    for piece in content.chunks:
        for k, (number, block, times) in enumerate(piece):
            kept = np.ascontiguousarray(block[:, 11:15]).view("<u4")[:, 0] != lost[1]
            if content.channels[number][0] == lost[0]:
                piece[k] = number, block[kept], times[kept]
    return content.write(path)


@pytest.mark.parametrize(("rule", "missing"), [("start", [100]), ("end", [99]), ("middle", [99, 100])])
def test_lost_outputs_take_along_the_inputs_that_need_them(tmp_path, rule, missing):
    """Outputs at step 100 are the start of the step 100 and the end of the step 99; a lost input is missing alone."""
    topic, wire = wire_of(rule)
    log = write(tmp_path / "whole.mcap", {topic: [wire]})
    for lost, gone in ((wire.source, missing), (topic, [100])):
        with Log(without(log, tmp_path / "lost.mcap", (lost, 100))) as found:
            series = found.read(topic)
        there = np.setdiff1d(np.arange(STEPS), gone)
        assert np.array_equal(np.rint(series.t / STEP), there)
        assert series.values.tobytes() == whole(topic)[there].tobytes()


def test_a_wire_that_leads_nowhere_is_a_fault(tmp_path):
    topics = {topic: about for topic, about in TOPICS.items() if topic != "/b/out"}
    with Recorder(tmp_path / "a", topics, {}, {}, wires=WIRES) as log:
        log.close("ok", "", 0)
    with Log(tmp_path / "a") as log:
        assert "/a/in" not in log.topics
        assert "/b/in" in log.topics
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


HANDED_ON = {
    "tracks_first": {"state", "rate", "mean"},
    "jacobi": {"state"},
    "gauss_seidel": {"state", "mean"},
    "iterative": {"state", "mean"},
}


@pytest.mark.parametrize("coupling", COUPLINGS)
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
