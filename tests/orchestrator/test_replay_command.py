"""The commands replay and compare."""

import shutil
from pathlib import Path

import pytest
from short_run import SHORT

from orchestrator.execution import replay_model
from orchestrator.log.export import to_pandas
from orchestrator.log.reader import Log, NoSuchTime
from orchestrator.log.recorder import Recorder


def test_equal_runs_have_equal_digests_and_replay_is_equal(cotrack):
    digests = []
    for name in ("a.mcap", "b.mcap"):
        assert cotrack(*SHORT, "--log", name)[0] == 0
        with Log(name) as log:
            digests.append(log.digest())
    assert digests[0] == digests[1]
    out = cotrack.done("replay", "a.mcap", "--component", "chain")
    assert out.startswith("equal: ")
    assert cotrack(*SHORT, "--log", "c.mcap", "--set", "vehicle.gravity=9.8100001")[0] == 0
    with Log("c.mcap") as log:
        assert log.digest() != digests[0], "the twin has the same digest"


@pytest.mark.long
def test_replay_with_the_other_track_model(cotrack, tmp_path):
    assert cotrack(*SHORT, "--log", "a.mcap")[0] == 0
    out = cotrack.done("replay", "a.mcap", "--with", "rigid", "--picture", "x.png")
    assert "tension.max" in out
    assert (out.splitlines()[-1], Path("x.png").stat().st_size > 10_000) == ("x.png", True)
    with Log(tmp_path / "a-chain-rigid.mcap") as log:
        assert len(log.read("/chain/out").t) == 21
    assert "no component 'left_track'" in cotrack.refused("replay", "a.mcap", "--component", "left_track")
    assert "no FMU 'none.fmu'" in cotrack.refused("replay", "a.mcap", "--component", "chain", "--with", "none.fmu")


@pytest.mark.long
def test_replay_with_other_numbers(cotrack, tmp_path):
    assert cotrack(*SHORT, "--log", "a.mcap")[0] == 0
    replay = ("replay", "a.mcap", "--component", "chain")
    status, out, _ = cotrack(*replay, "--set", "vehicle.gravity=10")
    assert (status, out.splitlines()[-1]) == (0, "log a-chain-vehicle.gravity=10.mcap")
    assert next(line for line in out.splitlines() if line.startswith("tension.max")).split()[-1] == "0.0000"
    status, out, _ = cotrack(*replay, "--set", "vehicle.gravity=9.81")
    assert (status, out[:7]) == (0, "equal: ")
    for settings, said in (
        (("vehicle.gravitty=1",), "unknown key 'vehicle.gravitty'"),
        (("vehicle.gravity",), "must be KEY=VALUE"),
        (("vehicle.gravity=10", "--with", "mine.fmu"), "says nothing about --with mine.fmu"),
        (("vehicle.gravity=10", "--from", "9"), "from 9 to inf: the run is recorded from 0 to 0.02 s"),
    ):
        status, _, err = cotrack(*replay, "--set", *settings)
        assert status == 2
        assert said in err


@pytest.mark.long
def test_an_answer_is_replayed_in_turn(cotrack, tmp_path):
    assert cotrack(*SHORT, "--log", "a.mcap")[0] == 0
    assert cotrack("replay", "a.mcap", "--component", "chain", "--with", "rigid", "-o", "b.mcap")[0] == 0
    status, out, _ = cotrack("replay", "b.mcap", "--component", "chain")
    assert (status, out[:7]) == (0, "equal: ")
    with replay_model.open_replay(Path("a.mcap"), "chain", None) as again:
        shutil.copy(again.model.fmu, "mine.fmu")
    status, out, _ = cotrack("replay", "a.mcap", "--component", "chain", "--with", "mine.fmu")
    assert (status, out[:7]) == (0, "equal: "), "the file is not what ran"
    status, out, _ = cotrack("replay", "b.mcap", "--component", "chain", "--with", "mine.fmu")
    assert (status, out.splitlines()[-1]) == (0, "log b-chain-mine.mcap")
    assert "name its FMU with --with" in cotrack.refused("replay", "b-chain-mine.mcap", "--component", "chain")
    assert cotrack("replay", "b-chain-mine.mcap", "--component", "chain", "--with", "mine.fmu")[0] == 0


@pytest.mark.parametrize(
    ("window", "said"),
    [
        (("--from", "0.02", "--to", "0.01"), "from 0.02 to 0.01: the first instant must not be after the last"),
        (("--from", "3", "--to", "4"), "from 3 to 4: the run is recorded from 0 to 0.02 s"),
    ],
)
def test_a_window_outside_of_the_run_is_refused_by_every_command(cotrack, tmp_path, window, said):
    assert cotrack(*SHORT, "--no-estimate", "--log", "a.mcap")[0] == 0
    for command in (
        ("replay", "a.mcap"), ("log", "export", "a.mcap", "-o", "e.csv", "--topic", "/chain/out"),
        ("view", "a.mcap", "-o", "f.gif"), ("plot", "a.mcap", "chain.speed", "-o", "p.png"),
        ("compare", "a.mcap", "a.mcap"), ("compare", "a.mcap", "a.mcap", "--map", "chain.speed=chain.speed"),
        ("analyse", "a.mcap", "validity"),
    ):  # fmt: skip
        assert said in cotrack.refused(*command, *window), command
    with pytest.raises(NoSuchTime, match=said), Log("a.mcap") as log:
        to_pandas(log, "chain.speed", window=(float(window[1]), float(window[3])))
    assert not [file for file in tmp_path.iterdir() if file.suffix in (".csv", ".gif", ".png")]
    assert cotrack("log", "export", "a.mcap", "-o", "e.csv", "--topic", "/chain/out", "--from", "0.02")[0] == 0


def test_a_replay_of_no_step_is_exit_1(cotrack, tmp_path):
    assert cotrack(*SHORT, "--log", "a.mcap")[0] == 0
    with Log("a.mcap") as log:
        topics = {topic: list(zip(*log.topics[topic][:2], strict=True)) for topic in ("/chain/in", "/chain/out")}
        attachments = {name: log.attachment(name) for name in log.attachments}
        out = log.read("/chain/out")
        with Recorder(tmp_path / "start.mcap", topics, attachments, log.metadata) as recorder:
            recorder.write("/chain/out", 0, 0.0, out.h[0], out.values[0])
            recorder.close("failed", "no step", 0)
    status, out, _ = cotrack("replay", "start.mcap", "--component", "chain")
    assert status == 1
    assert out.startswith("nothing was compared: the log holds 0 steps")
    status, _, err = cotrack("replay", "start.mcap", "--component", "chain", "--with", "rigid", "-o", "b.mcap")
    assert status == 1
    assert "holds no step of 'chain'" in err
    assert not (tmp_path / "b.mcap").exists()
    for arguments in (("compare", "start.mcap", "a.mcap"), ("view", "start.mcap", "-o", "v.png")):
        status, _, err = cotrack(*arguments)
        notice, _ = err.splitlines()
        assert (status, notice) == (2, "cotrack: start.mcap: its run failed: no step")


@pytest.mark.long
def test_different_scenes_are_compared_when_asked(cotrack):
    for name, *settings in (
        ("a",), ("b", "--track", "rigid", "--step", "2 ms", "--coupling", "jacobi"),
        ("c", "--set", "vehicle.gravity=9.9"), ("d", "--set", "chain.span=0.7"),
        ("e", "--set", "name=mine", "--set", "expect.rest.expected=3"),
    ):  # fmt: skip
        assert cotrack(*SHORT, "--no-estimate", *settings, "--log", f"{name}.mcap")[0] in (0, 1)
    for same in ("b", "e"):
        assert "pins" in cotrack.done("compare", f"{same}.mcap", "a.mcap")
    for other, apart in (("c", "vehicle.gravity = 9.9 and 9.80665"), ("d", "chain.span = 0.7 and 0.8")):
        err = cotrack.refused("compare", f"{other}.mcap", "a.mcap")
        named = f"{other}.mcap ('hanging_chain') and a.mcap ('hanging_chain') are runs of different scenes: {apart}"
        assert named in err.replace("9.81", "9.80665")
        assert err.strip().endswith("; --different compares them all the same")
        assert cotrack("compare", f"{other}.mcap", "a.mcap", "--different")[0] == 0
    err = cotrack.refused("truth", "rig", "--against", "a.mcap")
    assert "a.mcap ('hanging_chain') and the truth of rig ('rig') are runs of different scenes: assembly" in err


def test_replay_refuses_a_log_with_a_gap(cotrack, tmp_path):
    assert cotrack(*SHORT, "--log", "a.mcap")[0] == 0
    with Log(tmp_path / "a.mcap") as log:
        topics = {topic: list(zip(*log.topics[topic][:2], strict=True)) for topic in ("/chain/in", "/chain/out")}
        attachments = {name: log.attachment(name) for name in log.attachments}
        with Recorder(tmp_path / "gap.mcap", topics, attachments, log.metadata) as recorder:
            for topic in topics:
                series = log.read(topic)
                for k, row in enumerate(series.values):
                    if k not in (7, 8):
                        recorder.write(topic, k, series.t[k], series.h[k], row)
            recorder.close("ok", "", 20)
    assert "lacks its inputs from t = 0.007 to 0.009 s" in cotrack.refused("replay", "gap.mcap", "--component", "chain")
