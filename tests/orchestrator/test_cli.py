"""The command line: its output, exit codes and files."""

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from decimal import Decimal
from pathlib import Path

import numpy as np
import pytest

from fmus.vehicle import BadInput
from orchestrator.cli import printed
from orchestrator.cosim.component import Component, ComponentFailed
from orchestrator.cosim.coupling import scheme
from orchestrator.cosim.program import Program
from orchestrator.execution import replay_model, simulate, summary
from orchestrator.log.container_writer import ContainerWriter
from orchestrator.log.reader import Log
from orchestrator.log.recorder import LogFailed, Recorder
from orchestrator.log.tools import BROKEN, RECOVERED, WHOLE, recover, verify
from orchestrator.results.analyses.phases import Phase
from orchestrator.results.run_data import RunData
from orchestrator.results.views import side_view, top_view
from orchestrator.results.views.bodies import EVERY, Bodies
from orchestrator.scene import gallery
from orchestrator.scene.scene import load

KEYS = {
    "scene", "track", "status", "message", "simulated_time", "startup_time", "wall_time", "cpu_time",
    "real_time_factor",
    "communication_steps", "rejected_steps", "log", "log_bytes", "components", "energy", "error", "checks",
    "observables", "windows", "phases", "warnings", "validity",
}  # fmt: skip
SHORT = ("run", "hanging_chain", "--stop", "0.02", "--json")


def last(out):
    return json.loads(out.splitlines()[-1])


def test_scenes_lists_the_gallery(cotrack):
    status, out, _ = cotrack("scenes")
    assert status == 0
    assert [line.split()[0] for line in out.splitlines()] == gallery.names()


def test_show(cotrack):
    status, out, _ = cotrack("show", "straight", "--track", "rigid")
    assert status == 0
    assert "TrackRigid" in out
    assert "left out" in out


def test_an_open_ledger_is_not_a_success(cotrack, tmp_path):
    """An open energy balance is a failure: a chain without checks falls 20 cm per step."""
    text = (Path(gallery.__file__).parents[1] / "gallery" / "released_chain.toml").read_text(encoding="utf-8")
    (tmp_path / "fall.toml").write_text(text.partition("[expect")[0], encoding="utf-8")
    fall = ("run", "fall.toml", "--no-estimate", "--set", "chain.links=8", "--stop", "0.6", "--json")
    for step, wanted in (("50 ms", 1), ("2 ms", 0)):
        status, out, err = cotrack(*fall, "--step", step, "--set", f"track.step={step}")
        result = last(out)
        assert (result["status"], result["checks"]) == ("ok", {})
        assert status == wanted, (step, result["energy"])
        assert ("ledger" in err) == bool(wanted)


def test_run_ends_with_one_json_object(cotrack, tmp_path):
    status, out, err = cotrack(*SHORT)
    assert status == 0, err
    result = last(out)
    assert set(result) == KEYS
    assert (result["status"], result["message"]) == ("ok", "")
    assert result["communication_steps"] == 20
    assert result["simulated_time"] == pytest.approx(0.02)
    assert set(result["checks"]) == {"rest"}, "checks of windows that the run does not reach are reported"
    assert set(result["components"]["chain"]) >= {
        "wall_time",
        "steps",
        "evaluations",
        "iterations",
        "rejected",
    }
    log = tmp_path / "logs" / "hanging_chain-flexible.mcap"
    assert result["log"] == os.path.join("logs", "hanging_chain-flexible.mcap")
    assert result["log_bytes"] == log.stat().st_size
    assert verify(log).code == WHOLE


def test_run_prints_a_summary(cotrack):
    status, out, _ = cotrack("run", "hanging_chain", "--stop", "0.02", "--log", "own.mcap")
    assert status == 0
    assert out.startswith("hanging_chain, flexible links: ok")
    assert "kN" in out
    assert "own.mcap" in out


def test_a_failed_check_is_exit_1(cotrack):
    wrong = ("--set", "expect.rest.expected=1")
    status, out, _ = cotrack(*SHORT, *wrong)
    assert status == 1
    result = last(out)
    assert result["status"] == "ok"
    assert result["checks"]["rest"]["ok"] is False


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("run", "hanging_chian"), "did you mean 'hanging_chain'?"),
        (("run", "hanging_chain", "--set", "run.stp=1"), "unknown key 'run.stp'"),
        (("run", "hanging_chain", "--step", "2 kg"), "must be a quantity in s"),
        (("run", "straight", "--set", "vehicle.chassis.mass=-1"), "vehicle.chassis.mass = -1"),
        (("run", "rig", "--set", "rig.links=40"), "rig.links = 40: the track cannot be laid out"),
        (("run", "rig", "--set", "rig.tension=1e9"), "rig.tension = 1e+09 N: not reached with the idler"),
        (("run", "hanging_chain", "--set", "track.integrator=euler"), "hanging_chain.toml: track.integrator = 'euler'"),
        (("run", "hanging_chain", "--set", "track.start=straight"), "start = 'straight': must be one of rest, polygon"),
        (("run", "hanging_chain", "--set", "vehicle=none.toml"), "none.toml"),
    ],
)
def test_bad_input_is_one_sentence_and_leaves_nothing(cotrack, tmp_path, arguments, said):
    status, out, err = cotrack(*arguments, "--json")
    assert status == 2
    assert said in err
    assert len(err.splitlines()) == 1
    assert last(out)["status"] == "failed"
    assert last(out)["message"] in err
    assert list(tmp_path.rglob("*.mcap")) == []


@pytest.mark.parametrize(
    "arguments",
    [("run",), ("fly", "straight"), ("run", "hanging_chain", "--track", "soft"), ("log", "info", "none.mcap"),
     ("replay", "none.mcap", "--component", "chain"), ("build", "straight", "--all", "-o", "x")],
)  # fmt: skip
def test_other_bad_input_is_exit_2(cotrack, arguments):
    status, _, err = cotrack(*arguments)
    assert status == 2
    assert err
    assert "Traceback" not in err


@pytest.mark.long
def test_a_log_never_replaces_what_is_no_log(cotrack, tmp_path):
    (tmp_path / "folder").mkdir()
    note = tmp_path / "note.txt"
    note.write_text("mine")
    for place, said in (
        ("folder", "it is a directory"),
        ("note.txt", "there is a file that is no log"),
        ("note.txt/a.mcap", "note.txt is no folder"),
    ):
        status, out, err = cotrack(*SHORT, "--log", place)
        assert (status, last(out)["communication_steps"]) == (2, 0)
        assert said in err
        assert len(err.splitlines()) == 1
    assert cotrack("log", "recover", "note.txt", "-o", "note.txt")[0] == 1
    assert cotrack(*SHORT, "--log", "a.mcap")[0] == 0
    for target, said in (("note.txt", "is no log"), ("a.mcap", "a.mcap is the log itself")):
        status, _, err = cotrack("replay", "a.mcap", "--component", "chain", "--with", "rigid", "-o", target)
        assert status == 2
        assert said in err
    assert verify("a.mcap").code == WHOLE
    assert note.read_text() == "mine"
    status, _, err = cotrack("build", "hanging_chain", "-o", "note.txt")
    assert status == 2
    assert "the folder note.txt cannot be made" in err


def test_what_cannot_be_read_back_is_refused_before_the_run(cotrack, tmp_path):
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "link").symlink_to(tmp_path / "nothing")
    said = {"pipe": "it is a device or a pipe", "/dev/null": "it is a device or a pipe", "link": "it is a link to"}
    for name, why in said.items():
        status, out, err = cotrack(*SHORT, "--log", name)
        assert (status, last(out)["status"], len(err.splitlines())) == (2, "failed", 1)
        assert f"the log {name} cannot be written: {why}" in err


def test_a_log_that_is_being_written_is_called_so(cotrack, tmp_path):
    recorder = Recorder(tmp_path / "a.mcap", {"/a/out": [("x", "m")]}, {}, {}, flush=0.01)
    recorder.write("/a/out", 0, 0.0, 0.1, np.zeros(1))
    until = time.monotonic() + 10.0
    while not cotrack("log", "info", "a.mcap", "--json")[1].count('"messages": 1'):
        assert time.monotonic() < until
    status, out, _ = cotrack("log", "info", "a.mcap")
    assert "0 to 0 s, still being written" in out
    assert "cut off" not in out
    status, out, _ = cotrack("log", "verify", "a.mcap", "--json")
    answer = json.loads(out)
    assert (status, answer["code"]) == (1, 1)
    assert answer["sentences"][-1].endswith("has no closing record: the run has come to t = 0 s")
    recorder.close("ok", "", 0)
    assert cotrack("log", "verify", "a.mcap")[0] == 0
    assert "/a/out:\n  x [m]\n" in cotrack("log", "info", "a.mcap", "--signals")[1]


def test_checks_that_cannot_be_made_say_why(cotrack):
    status, out, err = cotrack(
        *SHORT,
        *("--set", "run.outputs=1000", "--set", "run.links=1000"),
        *("--set", "expect.rest.signal=chain.enrgy"),
        *("--set", 'expect.span={measure="span_tension", expected=1, tolerance=1}'),
        *("--set", 'expect.top={measure="tension_top", expected=1, tolerance=1}'),
        *("--set", 'expect.late={signal="chain.speed", expected=1, tolerance=1, from=0.01}'),
    )
    assert status == 1, err
    notes = {name: check["note"] for name, check in last(out)["checks"].items()}
    assert notes == {
        "rest": "the log has no signal 'chain.enrgy'",
        "span": "'span_tension' finds nothing to measure in this scene and window",
        "top": "'tension_top' finds nothing to measure in this scene and window",
        "late": "'chain.speed' was not recorded between 0.01 and 0.02 s",
    }
    assert not any(check["ok"] for check in last(out)["checks"].values())
    assert last(out)["observables"]["tension_max"] > 0


@pytest.mark.parametrize("phase", ["build", "initialise", "warm up"])
def test_ctrl_c_during_the_start_up(cotrack, monkeypatch, tmp_path, phase):
    """Ctrl-C during the start is reported, also where a component reports it as its own failure."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)  # a background job ignores it

    def interrupted(*_):
        try:
            signal.raise_signal(signal.SIGINT)
        except KeyboardInterrupt:
            if phase == "build":
                raise
        raise ComponentFailed("chain: KeyboardInterrupt")

    owner, name = {
        "build": (simulate, "assemble"),
        "initialise": (Component, "initialise"),
        "warm up": (Component, "step"),
    }[phase]
    monkeypatch.setattr(owner, name, interrupted)
    try:
        status, out, err = cotrack(*SHORT)
        assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
    finally:
        signal.signal(signal.SIGINT, before)
    assert status == 1
    assert err.startswith("cotrack: interrupted")
    assert len(err.splitlines()) == 1
    assert last(out)["status"] == "failed"


def test_a_full_disk_fails_the_run(cotrack, monkeypatch):
    append = ContainerWriter._append

    def full(writer, *parts):
        if writer.size > 10_000:
            raise OSError(28, "No space left on device")
        append(writer, *parts)

    monkeypatch.setattr(ContainerWriter, "_append", full)
    status, out, err = cotrack(*SHORT)
    assert status == 1
    assert "no space left on device, at t = 0 s" in err
    assert last(out)["status"] == "failed"


def test_a_run_that_fails_before_it_writes_names_no_log(cotrack, monkeypatch, tmp_path):
    """A run that fails before it writes reports no log, although an earlier log has the same name."""
    assert cotrack(*SHORT)[0] == 0
    earlier = tmp_path / "logs" / "hanging_chain-flexible.mcap"
    assert earlier.is_file()

    def refused(*arguments):
        raise LogFailed("the log cannot be written: nothing may be written here")

    monkeypatch.setattr(simulate, "open_log", refused)
    status, out, err = cotrack(*SHORT)
    result = last(out)
    assert (status, result["status"]) == (1, "failed")
    assert (result["log"], result["log_bytes"]) == (None, 0)
    assert "nothing may be written here" in err
    _, out, _ = cotrack(*SHORT[:-1])
    assert "log " not in out
    assert "None" not in out


def test_headline_figures_have_their_window(cotrack):
    status, out, _ = cotrack("run", "hanging_chain", "--track", "rigid", "--stop", "1.5", "--no-estimate")
    assert status == 0
    assert any(line.startswith("  whole run, 0 to 1.5 s: largest link tension ") for line in out.splitlines())
    assert any(line.startswith("  mean of 0.5 to 1.5 s: mean link tension ") for line in out.splitlines())
    _, out, _ = cotrack("run", "hanging_chain", "--track", "rigid", "--stop", "1.5", "--no-estimate", "--json")
    result = last(out)
    assert set(result["windows"]) == set(result["observables"])
    assert result["windows"]["tension_max"] == {"from": 0.0, "to": 1.5}
    assert result["windows"]["sag"] == {"from": 0.5, "to": 1.5}
    assert result["phases"] == [], "without a hull there are no phases"


def test_turns_of_the_last_second_are_left_to_phases(capsys):
    """The summary of a run that turned and stands at the end leaves turn radius and rate to the phases."""
    turned = dict.fromkeys(Phase._fields, float("nan")) | {
        "kind": "turn", "turning": "right", "start": 3.6, "end": 6.0, "yaw_rate": -0.25, "yaw_rate_most": -0.31,
        "radius": 7.9, "tension": 42e3, "tension_t": 3.743, "tension_track": "right_track", "speed": 1.96, "way": 4.77,
    }  # fmt: skip
    observables = {"tension_max": 42e3, "weight": 1.5e5, "speed": 0.0, "yaw_rate": -1e-5, "turn_radius": 242.6}
    result = summary.empty("turn", "flexible") | {
        "simulated_time": 9.0, "observables": observables, "phases": [turned],
        "windows": summary.windows(observables, 9.0),
    }  # fmt: skip
    printed.summary(result)
    out = capsys.readouterr().out
    assert "242.6" not in out
    assert "largest link tension 42 kN in right track at 3.743 s" in out
    assert "3.6 to 6 s: turn right at 1.96 m/s over 4.77 m; yaw rate -0.25 rad/s, -0.31 at most, radius 7.9 m" in out
    printed.summary(result | {"phases": []})
    assert "mean of 8 to 9 s: speed 0 m/s, yaw rate -1e-05 rad/s, turn radius 242.6 m" in capsys.readouterr().out


def test_a_component_that_fails_ends_the_run_and_closes_the_log(cotrack, monkeypatch, tmp_path):
    run = Program.run

    def failing(self, t, h):
        if t > 0.0105:
            raise ComponentFailed("chain: no convergence at t = 0.011 s, link 7")
        run(self, t, h)

    monkeypatch.setattr(Program, "run", failing)
    monkeypatch.setattr(scheme, "LONGEST_BATCH", 0.0)  # calls one by one
    status, out, err = cotrack(*SHORT)
    assert status == 1
    assert "link 7" in err
    result = last(out)
    assert (result["status"], result["communication_steps"]) == ("failed", 11)
    log = tmp_path / result["log"]
    assert verify(log).code == WHOLE
    with Log(log) as reading:
        assert reading.closing["status"] == "failed"
        assert "link 7" in reading.closing["message"]


def test_equal_runs_have_equal_digests_and_replay_is_equal(cotrack):
    digests = []
    for name in ("a.mcap", "b.mcap"):
        assert cotrack(*SHORT, "--log", name)[0] == 0
        with Log(name) as log:
            digests.append(log.digest())
    assert digests[0] == digests[1]
    status, out, _ = cotrack("replay", "a.mcap", "--component", "chain")
    assert status == 0
    assert out.startswith("equal: ")
    assert cotrack(*SHORT, "--log", "c.mcap", "--set", "vehicle.gravity=9.8100001")[0] == 0
    with Log("c.mcap") as log:
        assert log.digest() != digests[0], "the twin has the same digest"


def test_replay_with_the_other_track_model(cotrack, tmp_path):
    assert cotrack(*SHORT, "--log", "a.mcap")[0] == 0
    status, out, _ = cotrack("replay", "a.mcap", "--with", "rigid", "--picture", "x.png")
    assert status == 0
    assert "tension.max" in out
    assert (out.splitlines()[-1], Path("x.png").stat().st_size > 10_000) == ("x.png", True)
    with Log(tmp_path / "a-chain-rigid.mcap") as log:
        assert len(log.read("/chain/out").t) == 21
    status, _, err = cotrack("replay", "a.mcap", "--component", "left_track")
    assert status == 2
    assert "no component 'left_track'" in err
    status, _, err = cotrack("replay", "a.mcap", "--component", "chain", "--with", "none.fmu")
    assert status == 2
    assert "no FMU 'none.fmu'" in err


@pytest.mark.long
def test_replay_with_other_numbers(cotrack, tmp_path):
    assert cotrack(*SHORT, "--log", "a.mcap")[0] == 0
    replay = ("replay", "a.mcap", "--component", "chain")
    status, out, _ = cotrack(*replay, "--set", "vehicle.gravity=10")
    assert (status, out.splitlines()[-1]) == (0, "log a-chain-set.mcap")
    assert next(line for line in out.splitlines() if line.startswith("tension.max")).split()[-1] == "0.0000"
    status, out, _ = cotrack(*replay, "--set", "vehicle.gravity=9.81")
    assert (status, out[:7]) == (0, "equal: ")
    for settings, said in (
        (("vehicle.gravitty=1",), "unknown key 'vehicle.gravitty'"),
        (("vehicle.gravity",), "must be KEY=VALUE"),
        (("vehicle.gravity=10", "--with", "mine.fmu"), "says nothing about --with mine.fmu"),
        (("vehicle.gravity=10", "--from", "9"), "nothing of 'chain' is there to be compared from 9 to inf s"),
    ):
        status, _, err = cotrack(*replay, "--set", *settings)
        assert status == (1 if "--from" in settings else 2)
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
    status, _, err = cotrack("replay", "b-chain-mine.mcap", "--component", "chain")
    assert status == 2
    assert "name its FMU with --with" in err
    assert cotrack("replay", "b-chain-mine.mcap", "--component", "chain", "--with", "mine.fmu")[0] == 0


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
        assert (status, len(err.splitlines())) == (2, 1), err


@pytest.mark.long
def test_different_scenes_are_compared_when_asked(cotrack):
    for name, *settings in (
        ("a",), ("b", "--track", "rigid", "--step", "2 ms", "--coupling", "jacobi"),
        ("c", "--set", "vehicle.gravity=9.9"), ("d", "--set", "chain.span=0.7"),
        ("e", "--set", "name=mine", "--set", "expect.rest.expected=3"),
    ):  # fmt: skip
        assert cotrack(*SHORT, "--no-estimate", *settings, "--log", f"{name}.mcap")[0] in (0, 1)
    for same in ("b", "e"):
        status, out, err = cotrack("compare", f"{same}.mcap", "a.mcap")
        assert status == 0, err
        assert "pins" in out
    for other, apart in (("c", "vehicle.gravity = 9.9 and 9.80665"), ("d", "chain.span = 0.7 and 0.8")):
        status, _, err = cotrack("compare", f"{other}.mcap", "a.mcap")
        assert status == 2
        named = f"{other}.mcap ('hanging_chain') and a.mcap ('hanging_chain') are runs of different scenes: {apart}"
        assert named in err.replace("9.81", "9.80665")
        assert err.strip().endswith("; --different compares them all the same")
        assert cotrack("compare", f"{other}.mcap", "a.mcap", "--different")[0] == 0
    status, _, err = cotrack("truth", "rig", "--against", "a.mcap")
    assert status == 2
    assert "a.mcap ('hanging_chain') and the truth of rig ('rig') are runs of different scenes: assembly" in err


@pytest.mark.parametrize(("step", "refused"), [("0.3e-3", 557), ("0.7e-3", 71), ("1e-3", 0)])
def test_view_takes_the_end_as_it_is_written(step, refused):
    """View accepts the end as printed, which rounding puts above the last record for some k H."""
    above = 0
    for k in range(1, 1001):
        recorded = np.arange(k + 1) * float(step)
        end = float(k * Decimal(step))
        above += end > recorded[-1]
        assert side_view._instants(recorded, recorded[-1], [end]) == [recorded[k]]
        assert side_view._instants(recorded, recorded[-1], None)[-1] == recorded[k]
        with pytest.raises(BadInput, match=f"from 0 to {end:.9g} s"):
            side_view._instants(recorded, recorded[-1], [end + 1e-3 * float(step)])
    assert above == refused


def child(arguments, environment, **streams):
    command = [sys.executable, "-m", "orchestrator", *arguments]
    return subprocess.run(command, env=environment, text=True, **streams)


@pytest.mark.long
@pytest.mark.parametrize("buffered", [True, False])
def test_a_full_or_closed_stdout_is_a_sentence(environment, buffered):
    if not os.path.exists("/dev/full"):
        pytest.skip("no /dev/full here")
    environment = {**environment, "PYTHONUNBUFFERED": "" if buffered else "1"}
    with open("/dev/full", "w") as full:
        ended = child(["scenes"], environment, stdout=full, stderr=subprocess.PIPE)
    assert (ended.returncode, ended.stderr) == (1, "cotrack: the output cannot be written: no space left on device\n")
    reading, writing = os.pipe()
    os.close(reading)
    ended = child(["scenes"], environment, stdout=writing, stderr=subprocess.PIPE)
    os.close(writing)
    assert (ended.returncode, ended.stderr) == (1, ""), "a closed pipe is not an error to report"


def test_an_error_of_ours_is_a_sentence_too(cotrack, monkeypatch):
    def broken():
        raise ZeroDivisionError("by\nnought")

    monkeypatch.setattr(gallery, "names", broken)
    status, _, err = cotrack("scenes")
    assert status == 1
    assert err == "cotrack: internal error: ZeroDivisionError: by\\nnought; run 'cotrack --debug ...' to see where\n"
    status, _, err = cotrack("--debug", "scenes")
    assert status == 1
    assert "Traceback" in err
    assert "in broken" in err
    status, out, err = cotrack("run", "rig", "--json")
    assert status == 1
    assert last(out)["message"].startswith("internal error: ZeroDivisionError")
    assert "Traceback" not in err, "the error is reported more than once"


def test_names_of_files_need_not_be_text(cotrack, tmp_path):
    odd = os.fsdecode(b"\xff.mcap")
    status, _, err = cotrack("log", "info", odd)
    assert status == 2
    assert "the log \\udcff.mcap cannot be read" in err
    assert cotrack(*SHORT, "--no-estimate", "--log", odd)[0] == 0
    status, out, _ = cotrack("log", "verify", odd)
    assert status == 0
    assert out.startswith("\\udcff.mcap is whole")
    assert cotrack("replay", odd, "--component", "chain", "--with", "rigid", "-o", "b.mcap")[0] == 0
    with Log("b.mcap") as log:
        assert log.metadata["replay"]["of"] == "\\udcff.mcap"
    for arguments in (
        ("show", odd), ("truth", odd), ("build", odd, "-o", "x"), ("study", odd, "-o", "x"),
        ("run", "rig", "--stop", odd), ("run", "rig", "--set", odd), ("run", "rig", "--set", f"name={odd}"),
    ):  # fmt: skip
        status, _, err = cotrack(*arguments)
        assert (status, len(err.splitlines())) == (2, 1), err


def test_log_commands(cotrack, tmp_path):
    assert cotrack(*SHORT, "--log", "a.mcap")[0] == 0
    status, out, _ = cotrack("log", "info", "a.mcap")
    assert status == 0
    assert "/chain/out" in out
    assert cotrack("log", "verify", "a.mcap")[0] == 0
    status, out, _ = cotrack("log", "export", "a.mcap", "-o", "t.csv", "--signal", "chain.tension.max")
    assert status == 0
    assert (tmp_path / "t.csv").read_text().splitlines()[0] == "t [s],chain.tension.max [N]"
    content = bytearray((tmp_path / "a.mcap").read_bytes())
    (tmp_path / "cut.mcap").write_bytes(content[: len(content) // 2])
    assert cotrack("log", "verify", "cut.mcap")[0] == 1
    assert cotrack("log", "recover", "cut.mcap", "-o", "saved.mcap")[0] in (1, 3)
    assert cotrack("log", "verify", "none.mcap")[0] == 1


@pytest.mark.long
def test_view_draws(cotrack, tmp_path):
    assert cotrack(*SHORT, "--log", "a.mcap")[0] == 0
    assert cotrack("view", "a.mcap", "-o", "a.png")[0] == 0
    assert (tmp_path / "a.png").read_bytes()[:4] == b"\x89PNG"
    status, _, err = cotrack("view", "a.mcap", "-o", "nowhere/a.png")
    assert status == 2
    assert "cannot be written" in err
    status, _, err = cotrack("view", "a.mcap", "-o", ".")
    assert status == 2
    assert "it is a directory" in err
    assert cotrack(*SHORT, "--log", "b.mcap", "--set", "track.link_outputs=false")[0] == 0
    cut = (tmp_path / "a.mcap").read_bytes()
    with Log("a.mcap") as log:
        (tmp_path / "cut.mcap").write_bytes(cut[: next(iter(log._chunks.spans))])
    status, _, err = cotrack("view", "cut.mcap", "-o", "cut.png")
    assert status == 2
    assert "cut.mcap holds no links to draw" in err
    status, _, err = cotrack("view", "a.mcap", "--at", "0.03", "-o", "b.png")
    assert status == 2
    assert "from 0 to 0.02 s" in err
    assert not (tmp_path / "b.png").exists()


@pytest.mark.long
def test_view_from_above(cotrack, tmp_path):
    brief = ("run", "turn", "--track", "rigid", "--stop", "0.02", "--no-estimate")
    assert cotrack(*brief, "--log", "a.mcap")[0] in (0, 1)
    status, out, err = cotrack("view", "a.mcap", "--above", "-o", "a.png")
    assert (status, out) == (0, "a.png\n"), err
    assert (tmp_path / "a.png").read_bytes()[:4] == b"\x89PNG"
    with Log("a.mcap") as log:
        bodies = Bodies(RunData(log), EVERY)
        bodies.select_instants([0.0, 0.02])
        views = [top_view.top_view(bodies, poses) for poses in bodies.blocks(1)]
        whole = [log.signal(f"left_track.ground.force.{axis}")[1] for axis in "xy"]
    corners = np.concatenate(views[1].links)
    left = corners[corners[:, 1] > 0.0]
    assert np.ptp(left[:, 0]) == pytest.approx(4.5, abs=0.3)  # as long as a track, as wide as a link
    assert [left[:, 1].min(), left[:, 1].max()] == pytest.approx([1.0795 - 0.189, 1.0795 + 0.189], abs=1e-3)
    force = [view.force[:64] for view in views]
    assert [view.feet.shape for view in views] == [(128, 2), (128, 2)]
    every = load("turn", "rigid").links_every  # steps over which link forces are averaged
    for k, rows in ((0, slice(1)), (1, slice(21 - every, 21))):
        assert force[k].sum(axis=0) == pytest.approx([part[rows].mean() for part in whole], abs=1e-6)
    assert "from 0 to 0.02 s" in cotrack("view", "a.mcap", "--above", "--at", "1", "-o", "b.png")[2]
    assert cotrack(*SHORT, "--log", "chain.mcap")[0] == 0
    short = ("--set", "track.link_outputs=false", "--log", "short.mcap")
    assert cotrack(*brief, *short)[0] in (0, 1)
    assert "short.mcap holds no vehicle" in cotrack("view", "short.mcap", "--above", "-o", "d.png")[2]
    status, _, err = cotrack("view", "chain.mcap", "--above", "-o", "c.png")
    assert (status, "chain.mcap holds no vehicle with the links of its tracks" in err) == (2, True)


def test_a_check_without_its_signals_is_not_ok(cotrack):
    status, out, err = cotrack("run", "hanging_chain", "--set", "track.link_outputs=false", "--json")
    assert status == 1, err
    checks = last(out)["checks"]
    assert checks["rest"]["ok"]
    assert not checks["tension"]["ok"]
    assert checks["tension"]["value"] is None


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
    status, _, err = cotrack("replay", "gap.mcap", "--component", "chain")
    assert status == 2
    assert "lacks its inputs from t = 0.007 to 0.009 s" in err


@pytest.mark.long
def test_build_names_variants(cotrack, tmp_path):
    status, out, _ = cotrack("build", "hanging_chain", "--track", "rigid", "-o", "fmus")
    assert status == 0
    assert [file.name for file in (tmp_path / "fmus").iterdir()] == ["TrackRigid-hanging_chain.fmu"]
    assert out.strip().endswith("TrackRigid-hanging_chain.fmu")
    status, _, err = cotrack("build", "hanging_chain", "-o", "fmus/TrackRigid-hanging_chain.fmu/below")
    assert status == 2
    assert "cannot be made" in err


def started(tmp_path, environment):
    """Start a long run in its own process and wait until it writes its log."""
    log = tmp_path / "long.mcap"
    command = [sys.executable, "-m", "orchestrator", "run", "hanging_chain", "--stop", "1000"]
    process = subprocess.Popen(
        [*command, "--log", str(log), "--json"],
        env=environment, cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip
    until = time.monotonic() + 120
    while time.monotonic() < until and process.poll() is None:
        if log.exists() and log.stat().st_size > 600_000:
            return process, log
        time.sleep(0.05)
    process.kill()
    pytest.fail(f"the run did not begin: {process.communicate()}")


@pytest.mark.long
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_closes_the_log(tmp_path, environment, number):
    process, log = started(tmp_path, environment)
    second = [sys.executable, "-m", "orchestrator", "run", "hanging_chain", "--log", str(log)]
    if number == signal.SIGTERM:
        refused = subprocess.run(second, env=environment, cwd=tmp_path, capture_output=True, text=True)
        assert refused.returncode == 2
        assert "another run is writing it" in refused.stderr
    process.send_signal(number)
    out, err = process.communicate(timeout=60)
    assert process.returncode == 1
    assert "interrupted at t = " in err
    result = last(out)
    assert result["communication_steps"] > 0
    assert verify(log).code == WHOLE
    with Log(log) as reading:
        assert reading.closing["status"] == "interrupted"
        assert reading.closing["steps"] == result["communication_steps"]


@pytest.mark.long
def test_a_killed_run_leaves_a_log_that_can_be_saved(tmp_path, environment):
    process, log = started(tmp_path, environment)
    process.kill()
    process.communicate()
    assert verify(log).code == BROKEN
    saved = tmp_path / "saved.mcap"
    assert recover(log, saved).code == RECOVERED
    assert verify(saved).code == WHOLE
    with replay_model.open_replay(saved, "chain", None) as again:
        verdict = again.verify()
    assert verdict.equal, verdict.sentence
