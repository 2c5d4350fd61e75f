"""Commands that are interrupted or fail: signals, a full disk, a closed stdout, a failing component."""

import os
import signal
import subprocess
import sys
import threading
import time

import pytest
from short_runs import SHORT, last

from orchestrator.cosim.component import Component
from orchestrator.cosim.coupling import scheme
from orchestrator.cosim.program import Program
from orchestrator.execution import estimate, loading, replay_model, simulate, summary
from orchestrator.execution.prepared_run import PreparedRun
from orchestrator.fmi.slave import ComponentFailed
from orchestrator.log.log_file import LogFailed
from orchestrator.log.page import Page
from orchestrator.log.reader import Log
from orchestrator.log.tools import BROKEN, RECOVERED, WHOLE, recover, verify
from orchestrator.scene import scene

STARTS = {
    "build": (loading, "assemble"), "initialise": (Component, "initialise"), "warm up": (Component, "step"),
}  # fmt: skip


@pytest.mark.parametrize("phase", STARTS)
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

    monkeypatch.setattr(*STARTS[phase], interrupted)
    try:
        status, out, err = cotrack(*SHORT)
        assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
    finally:
        signal.signal(signal.SIGINT, before)
    assert status == 1
    assert err.startswith("cotrack: interrupted")
    assert len(err.splitlines()) == 1
    assert last(out)["status"] == "interrupted"


@pytest.mark.parametrize(("owner", "name"), [(summary, "evaluate"), (estimate, "differences"), (estimate, None)])
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_the_evaluation_at_once(cotrack, monkeypatch, owner, name, number):
    """Evaluation of the run, that of its error, or a coarser run, which ends with its step; the log is whole."""

    def signalled(*_):
        signal.raise_signal(number)
        pytest.fail("the evaluation went on")

    def step_to_end(run, observers, interrupt, result):
        if run.scene.run.step > 0.001:
            signal.raise_signal(number)
        return original(run, observers, interrupt, result)

    original = PreparedRun.step_to_end
    monkeypatch.setattr(*(owner, name, signalled) if name else (PreparedRun, "step_to_end", step_to_end))
    status, out, err = cotrack(*SHORT, "--track", "flexible")
    assert (status, err.splitlines()[0]) == (1, "cotrack: interrupted while it was evaluated")
    assert last(out)["communication_steps"] == 20
    log = last(out)["log"]
    assert verify(log).code == WHOLE
    with Log(log) as reading:
        assert (reading.closing["status"], reading.closing["steps"]) == ("interrupted", 20)


@pytest.mark.parametrize(("place", "error", "status"), [
    (None, None, 0),
    ("exchange_block", MemoryError(), 1),
    ("pack", KeyError("a fault of ours"), 1),
    ("pack", SystemExit(), 1),
    ("pack", OSError(28, "No space left on device"), 1),
])  # fmt: skip
def test_a_recorder_that_dies_fails_the_run(cotrack, monkeypatch, place, error, status):
    """Whatever ends the recorder's thread, wherever in it; the first case has no fault."""

    def broken(*arguments):
        if threading.current_thread().name == "recorder":
            raise error
        return original(*arguments)

    if place:
        original = getattr(Page, place)
        monkeypatch.setattr(Page, place, broken)
    found, out, err = cotrack(*SHORT, "--no-estimate")
    assert (found, last(out)["status"]) == (status, "failed" if status else "ok")
    assert ("cannot be written" in err) == bool(status)
    assert ("no space left on device" in err) == isinstance(error, OSError)


@pytest.mark.long
def test_a_run_of_a_study_raises_what_is_no_answer_of_the_model(monkeypatch, tmp_path):
    """A full disk, and a signal; a refusal of a component is an answer. Without ``answer`` they are in the summary."""
    short = scene.load("hanging_chain", "rigid", {"run.stop": 0.02, "expect": {}})

    def outcome(error, **answer):
        def broken(*_):
            raise error

        monkeypatch.setattr(Page, "pack", broken if isinstance(error, OSError) else pack)
        monkeypatch.setattr(Program, "run", run if isinstance(error, OSError) else broken)
        return simulate.simulate(short, tmp_path / "a.mcap", **answer)

    pack, run = Page.pack, Program.run
    monkeypatch.setattr(scheme, "LONGEST_BATCH", 0.0)  # calls one by one
    assert outcome(OSError(28, "No space left on device"))["status"] == "failed"
    with pytest.raises(OSError, match="no space left on device"):
        outcome(OSError(28, "No space left on device"), raise_faults=True)
    assert outcome(ComponentFailed("lost"), raise_faults=True)["message"].startswith("lost")


def test_a_run_that_fails_before_it_writes_names_no_log(cotrack, monkeypatch, tmp_path):
    """A run that fails before it writes reports no log, although an earlier log has the same name."""
    assert cotrack(*SHORT)[0] == 0
    earlier = tmp_path / "logs" / "hanging_chain-flexible-run.stop=0.02.mcap"
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
    assert "\n  log  " not in out
    assert "None" not in out


@pytest.fixture
def failing(monkeypatch):
    """Times after which the component fails, one for each run, in a list that a test fills."""
    run, instants = Program.run, []

    def step(self, t, h):
        if instants and t > instants[0]:
            instants.pop(0)
            raise ComponentFailed("chain: no convergence at t = 0.011 s, link 7")
        run(self, t, h)

    monkeypatch.setattr(Program, "run", step)
    monkeypatch.setattr(scheme, "LONGEST_BATCH", 0.0)  # calls one by one
    return instants


def test_a_failed_run_keeps_the_log_of_one_that_ended_well(cotrack, failing, tmp_path):
    """The log of a failed run is replaced by any later one, and has a name of its own beside one that ended well."""
    own = "hanging_chain-flexible-run.stop=0.02.mcap"
    beside = own.replace(".mcap", "-failed.mcap")
    runs = (
        (0.0055, own, 6), (0.0105, own, 11), (1.0, own, 20),
        (0.0055, beside, 6), (0.0105, beside, 11), (1.0, own, 20),
    )  # fmt: skip
    for instant, name, steps in runs:
        failing[:] = [instant]
        status, out, err = cotrack(*SHORT, "--no-estimate")
        failed, result = instant < 0.02, last(out)
        assert (status, result["log"]) == (int(failed), os.path.join("logs", name))
        assert (f"{own} is kept: its run ended well" in err, "link 7" in err) == (name == beside, failed)
        assert verify(result["log"]).code == WHOLE
        with Log(tmp_path / "logs" / name) as log:
            assert (log.closing["status"], log.closing["steps"]) == ("failed" if failed else "ok", steps)
            assert ("link 7" in log.closing["message"]) == failed
            assert result["log_bytes"] == log.size
        if name == beside:
            with Log(tmp_path / "logs" / own) as log:
                assert (log.closing["status"], log.closing["steps"]) == ("ok", 20)
    assert {file.name for file in (tmp_path / "logs").iterdir()} == {own, beside}


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

    monkeypatch.setattr(scene, "scene_names", broken)
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
    assert bool(result["observables"]) == (number == signal.SIGINT), "SIGTERM does not wait for an evaluation"
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
