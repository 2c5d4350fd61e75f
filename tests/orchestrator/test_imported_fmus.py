"""FMUs that are not ours, in processes of their own: whatever they do, the run says it and its log is whole."""

import ctypes
import json
import logging
import os
import pickle
import signal
import subprocess
import sys
import time
from pathlib import Path

import foreign_fmus
import numpy as np
import pytest
from foreign_fmus import Variable
from logged import logged

from orchestrator.cosim.processes import server, supervisor
from orchestrator.execution.simulate import simulate
from orchestrator.files.messages import RUN
from orchestrator.files.progress import Progress
from orchestrator.fmi.slave import ComponentFailed
from orchestrator.log.reader import Log
from orchestrator.log.tools import WHOLE, verify
from orchestrator.scene.scene import any_from_table, load
from orchestrator.scene.tables import RunTable

GUEST = (
    Variable("u", "input"),
    Variable("y", "output"),
    Variable("together", "output"),
    Variable("when", "parameter", 1e9),
    Variable("manner", "parameter", 0, "Integer"),
    Variable("steps", "output", 0, "Integer"),
)
H = 2.0**-10
STOP = 64 * H
WHEN = 32 * H  # the step to this time is the one that misbehaves
ENDS, DIES, HANGS, NAN, NEGATIVE, LARGE, MOVES, ROUNDS, PRINTS = range(1, 10)
LEAVES_CHILD, CHILD_AND_DIES, COPY_AND_DIES, COPY_AND_HANGS, CLOSES, FLOODS, REFUSES = range(10, 17)
BAD_END, DIES_AT_END, HANGS_AT_END, DIES_WHEN_FREED = range(20, 24)


@pytest.fixture(scope="module")
def guest(tmp_path_factory):
    return foreign_fmus.build(tmp_path_factory.mktemp("guest") / "Guest.fmu", "guest", GUEST)


def table(fmus, connections=(), **run):
    times = {"stop": STOP, "step": H}
    more = {"run": times | run, "fmu": fmus, "connections": [*connections]}
    return {"name": "guests", "title": "Guests", "assembly": "fmus", **more}


def entry(guest, manner=0, **more):
    return {"file": str(guest), "parameters": {"manner": manner, "when": WHEN}, **more}


def run(tmp_path, fmus, connections=(), **more):
    path = tmp_path / "guests.mcap"
    return simulate(any_from_table(table(fmus, connections, **more), "guests.toml"), path), path


def outputs(path, name="a"):
    with Log(path, unfinished=True) as log:
        series = log.read(f"/{name}/out")
        return series.t, dict(zip(series.names, series.values.T, strict=True))


# --- what a guest does ------------------------------------------------------------------------------


@pytest.mark.parametrize(("manner", "said"), [
    (ENDS, "a: its process has ended with exit status 0 in fmi2DoStep at t = 0.0302734 s"),
    (CLOSES, "a: its process has closed its connection to the run in fmi2DoStep at t = 0.0302734 s"),
    (REFUSES, "a: no licence (fmi2DoStep, t = 0.0302734 s)"),
    (DIES, "a: its process has ended by SIGKILL in fmi2DoStep at t = 0.0302734 s"),
    (NAN, "a: output 'y' is nan (fmu.a.non_finite = \"warn\" lets the run go on) (fmi2GetReal, t = 0.0302734 s)"),
    (NEGATIVE, "a: fmi2DoStep returned the status -1, which FMI does not have (fmi2DoStep, t = 0.0302734 s)"),
    (LARGE, "a: fmi2DoStep returned the status 77, which FMI does not have (fmi2DoStep, t = 0.0302734 s)"),
])  # fmt: skip
def test_a_guest_that_fails_is_named_and_the_log_is_whole(guest, tmp_path, manner, said):
    summary, path = run(tmp_path, {"a": entry(guest, manner), "b": entry(guest)})
    assert (summary["status"], summary["message"]) == ("failed", said)
    t, values = outputs(path, "b")
    assert t[-1] == WHEN - H
    assert np.array_equal(values["y"], t)
    assert verify(path).code == WHOLE


@pytest.mark.parametrize("manner", [NAN, NEGATIVE, LARGE])
@pytest.mark.parametrize("way", ["kernels", "Python"])
def test_in_the_process_of_the_run_statuses_and_outputs_are_looked_at_too(guest, tmp_path, monkeypatch, manner, way):
    monkeypatch.setattr("orchestrator.cosim.coupling.scheme.CAN_STEP", way != "Python")
    summary, path = run(tmp_path, {"a": entry(guest, manner, in_process=True)})
    assert summary["status"] == "failed"
    assert "t = 0.0302734 s" in summary["message"]
    assert outputs(path)[0][-1] == WHEN - H


def dies(*_):
    raise KeyError("a fault of ours")


@pytest.mark.parametrize(("owner", "name", "broken", "error"), [
    (supervisor, "MAX_MESSAGE", "no number", TypeError),  # of bytes that are heard at once
    (supervisor.SlaveProcess, "has_ended", dies, KeyError),  # who watches
])  # fmt: skip
def test_a_thread_that_dies_fails_the_run(guest, tmp_path, monkeypatch, owner, name, broken, error):
    """Who hears and who watches the guests."""
    monkeypatch.setattr(owner, name, broken)
    monkeypatch.setattr(supervisor, "PERIOD", 1e-4)
    with pytest.raises(error):
        run(tmp_path, {"a": entry(guest)}, stop=1024 * H)


def test_an_output_that_is_not_finite_can_be_a_warning(guest, tmp_path):
    summary, path = run(tmp_path, {"a": entry(guest, NAN, non_finite="warn")})
    assert summary["status"] == "ok"
    assert [(each["component"], each["text"]) for each in summary["warnings"]] == [("a", "output 'y' is nan")]
    assert summary["warnings"][0]["count"] == 33  # of 64 steps; the 31 before are finite
    assert np.isnan(outputs(path)[1]["y"]).sum() == 33


@pytest.mark.parametrize("in_process", [False, True])
def test_a_guest_cannot_move_print_or_round_for_others(guest, tmp_path, capfd, in_process):
    """In the process of the run it can: that is what the other half shows."""
    here, thirds = os.getcwd(), []
    for manner in (MOVES, ROUNDS, PRINTS):
        run(tmp_path, {"a": entry(guest, manner, in_process=in_process)})
        thirds.append(float(np.float64(1.0) / np.float64(3.0)))
    moved, printed, rounds = os.getcwd() != here, "red" in capfd.readouterr().out, thirds[1] > thirds[0]
    os.chdir(here)
    ctypes.CDLL("libm.so.6").fesetround(0)
    assert (moved, printed, rounds) == (in_process,) * 3


@pytest.mark.parametrize(("alone", "shared"), [(True, False), (False, True)])
def test_instances_share_a_process_only_where_there_are_too_many(guest, tmp_path, monkeypatch, alone, shared):
    """Their static variable tells."""
    monkeypatch.setattr(supervisor, "MAX_PROCESSES", 8 if alone else 1)
    _, path = run(tmp_path, {"a": entry(guest), "b": entry(guest)})
    together = outputs(path, "b")[1]["together"][-1]
    assert together == (2.0 * STOP if shared else STOP)


@pytest.mark.parametrize(("owner", "name", "value", "said"), [
    (supervisor, "MAX_PROCESSES", 1, "2 FMUs need processes of their own, and a run has at most 1"),
    (supervisor.resource, "getrlimit", lambda which: (40, 4096),
     r"2 FMUs need (\d+) open files, 40 are allowed: ulimit -n \1$"),
    (supervisor, "fcntl", None, "a: processes of FMUs of yours need Linux: set in_process = true"),
])  # fmt: skip
def test_fmus_that_get_no_process_are_refused(guest, tmp_path, monkeypatch, owner, name, value, said):
    monkeypatch.setattr(owner, name, value)
    other = foreign_fmus.build(
        tmp_path / "Other.fmu", "guest", GUEST, library=foreign_fmus.library_of(guest), states=True
    )
    with pytest.raises(ComponentFailed, match=said):
        run(tmp_path, {"a": entry(guest), "b": entry(other)})


WITHOUT_POSIX = """
import sys, os
sys.modules.update(dict.fromkeys(["fcntl", "resource", "pwd", "grp", "termios"]))
del os.memfd_create
from orchestrator.__main__ import main
for line in sys.stdin.read().splitlines():
    sys.argv[1:] = line.split()
    try:
        main()
    except SystemExit as end:
        assert not end.code, line
"""


@pytest.mark.long
def test_without_posix_all_but_processes_of_others_fmus_runs(tmp_path):
    """As on Windows, where ``fcntl`` and ``resource`` cannot be imported: run, report, build."""
    commands = (
        "run hanging_chain --stop 0.05 --no-estimate -o chain.mcap", "report chain.mcap -o chain.html",
        "build hanging_chain --track rigid --native -o built",
    )  # fmt: skip
    program = [sys.executable, "-P", "-c", WITHOUT_POSIX]
    options = {
        "capture_output": True,
        "text": True,
        "cwd": tmp_path,
        "env": os.environ | {"PYTHONPATH": str(supervisor.ROOT)},
    }
    done = subprocess.run(program, input="\n".join(commands), **options)
    assert done.returncode == 0, done.stderr
    assert {"chain.mcap", "chain.html", "built"} <= {file.name for file in tmp_path.iterdir()}
    assert [file.suffix for file in (tmp_path / "built").iterdir()] == [".fmu"]


@pytest.mark.parametrize("coupling", ["tracks_first", "jacobi", "gauss_seidel"])
def test_bits_are_those_of_the_process_of_the_run(guest, tmp_path, coupling):
    digests = []
    for in_process in (False, True):
        fmus = {name: {"file": str(guest), "in_process": in_process, "stage": k} for k, name in enumerate("abc")}
        summary, path = run(tmp_path, fmus, ["a.y -> b.u", "b.y -> c.u", "c.y -> a.u"], coupling=coupling)
        assert summary["status"] == "ok"
        digests.append({name: outputs(path, name)[1]["y"].tobytes() for name in fmus})
    assert digests[0] == digests[1]


# --- calls that do not return -----------------------------------------------------------------------


def test_a_call_can_have_a_limit(guest, tmp_path):
    began = time.monotonic()
    summary, path = run(tmp_path, {"a": entry(guest, HANGS, call_limit=0.5), "b": entry(guest)})
    assert summary["message"] == "a: fmi2DoStep at t = 0.0302734 s has not returned within 0.5 s"
    assert time.monotonic() - began < 10.0
    assert outputs(path, "b")[0][-1] == WHEN - H


@pytest.mark.long
@pytest.mark.parametrize(("number", "when"), [
    (signal.SIGTERM, WHEN), (signal.SIGHUP, 0.0), (signal.SIGINT, WHEN),
])  # fmt: skip
def test_a_run_that_hangs_can_be_interrupted(guest, tmp_path, number, when):
    text = f'title = "x"\nassembly = "fmus"\nrun = {{ stop = "{STOP} s", step = "{H} s" }}\n'
    fmu = f'fmu.a = {{ file = "{guest}", parameters = {{ manner = 3, when = {when} }} }}\n'
    (tmp_path / "hangs.toml").write_text(text + fmu)
    process = subprocess.Popen(
        [sys.executable, "-m", "orchestrator", "run", "hangs.toml", "--json", "-o", "hangs.mcap"],
        cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip
    for line in process.stderr:
        if "has not returned for" in line:  # the progress names what hangs
            break
    assert line.strip().startswith(
        f"... a: fmi2{'DoStep at t = 0.0302734 s' if when else 'ExitInitializationMode at t = 0 s'} has"
    )
    process.send_signal(number)
    out, err = process.communicate(timeout=20.0)
    assert process.returncode == 1, err
    result = json.loads(out.splitlines()[-1])
    if when:
        assert result["message"].startswith("interrupted at t = 0.0302734 s: a: fmi2DoStep at t = 0.0302734 s was")
        assert outputs(tmp_path / "hangs.mcap")[0][-1] == WHEN - H
    else:
        assert result["message"] == "interrupted"
        assert not (tmp_path / "hangs.mcap").exists()


# --- processes of a guest ---------------------------------------------------------------------------


@pytest.mark.parametrize(("manner", "said"), [
    (LEAVES_CHILD, ""),
    (CHILD_AND_DIES, "a: its process has ended by SIGKILL in fmi2DoStep at t = 0.0302734 s: child "),
    (COPY_AND_DIES, "a: its process has ended by SIGKILL in fmi2DoStep at t = 0.0302734 s: child "),
    (COPY_AND_HANGS, "a: fmi2DoStep at t = 0.0302734 s has not returned within 0.3 s"),
])  # fmt: skip
def test_what_a_guest_has_started_ends_with_it(guest, tmp_path, manner, said):
    """A child holds the guest's end of the connection and of stdout, also as a copy without a program of its own."""
    began = time.monotonic()
    with logged() as lines:
        summary, _ = run(tmp_path, {"a": entry(guest, manner, call_limit=0.3)})
    assert time.monotonic() - began < 5.0  # the child lasts 30 s or for ever
    assert summary["message"].startswith(said)
    assert summary["status"] == ("failed" if said else "ok")
    child = next(int(text.split()[-1]) for text in lines if "child" in text)
    for _ in range(50):
        if not (lives := is_running(child)):
            break
        time.sleep(0.02)
    if lives:
        os.kill(child, signal.SIGKILL)
    assert not lives


def is_running(process):
    try:
        return Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


@pytest.mark.parametrize(("manner", "in_process", "said"), [
    (BAD_END, False, "no space for the results (fmi2Terminate)"),
    (BAD_END, True, "no space for the results (fmi2Terminate)"),
    (DIES_AT_END, False, "its process has ended by SIGKILL in fmi2Terminate"),
    (DIES_WHEN_FREED, False, "its process has ended by SIGKILL in fmi2FreeInstance"),
    (HANGS_AT_END, False, "fmi2Terminate has not returned within 0.3 s"),
    (0, False, None),
])  # fmt: skip
def test_a_bad_end_is_a_warning_and_the_results_are_whole(guest, tmp_path, manner, in_process, said):
    summary, path = run(tmp_path, {"a": entry(guest, manner, in_process=in_process, call_limit=0.3)})
    assert (summary["status"], summary["message"]) == ("ok", "")
    assert [(each["component"], each["text"]) for each in summary["warnings"]] == [("a", said)] * (said is not None)
    assert outputs(path)[0][-1] == STOP
    with Log(path) as log:  # the log of a guest in the run's process is closed before its end
        assert [each["text"] for each in log.closing["warnings"]] == [said] * (said is not None and not in_process)


def test_a_run_that_is_interrupted_at_the_end_of_a_guest_is_whole(guest, tmp_path, monkeypatch):
    monkeypatch.setattr(supervisor, "GRACE", 0.1)

    def told(line):
        if "fmi2Terminate has not returned" in line and not told.lines:
            told.lines.append(line)
            os.kill(os.getpid(), signal.SIGINT)

    told.lines = []
    monkeypatch.setattr(supervisor, "PATIENCE", 0.2)
    scene = any_from_table(table({"a": entry(guest, HANGS_AT_END)}), "guests.toml")
    with Progress("run", told):
        summary = simulate(scene, tmp_path / "guests.mcap")
    assert (summary["status"], summary["message"], summary["simulated_time"]) == ("ok", "", STOP)
    assert [each["text"] for each in summary["warnings"]] == ["fmi2Terminate was interrupted"]


def test_an_error_of_the_initialisation_names_call_and_time(guest, tmp_path):
    fmu = {"file": str(guest), "parameters": {"manner": REFUSES, "when": 0.0}}
    with pytest.raises(ComponentFailed, match=r"^a: no licence \(fmi2ExitInitializationMode, t = 0 s\)$"):
        run(tmp_path, {"a": fmu})


def test_messages_of_a_call_are_bounded_and_counted(guest, tmp_path, caplog):
    caplog.set_level(logging.DEBUG, RUN.name)
    summary, _ = run(tmp_path, {"a": entry(guest, FLOODS)})
    said = [each for each in summary["warnings"] if "left out" in each["text"]]
    assert [(each["text"], each["count"]) for each in said] == [
        (f"{5000 - server.MAX_MESSAGES} further messages left out", 33)
    ]
    assert sum("says nothing" in line for line in caplog.messages) == 33 * server.MAX_MESSAGES


sprung = []


class Trap:
    def __reduce__(self):
        return spring, ()


def spring():
    sprung.append(1)


def test_messages_hold_no_code():
    """Pickled objects would run some."""
    pickle.loads(pickle.dumps(Trap()))
    assert len(sprung) == 1
    ours, theirs = server.pair()
    with ours, theirs:
        theirs.sendall(b"." + pickle.dumps(Trap()))
        with pytest.raises(ValueError, match="decode"):
            server.receive(ours)
        for content in (["a", 0.1, None, [b"\x00\xff", [b"", b"text"]], float("inf")], {"u": [[1, 2], 3]}, "\udcff"):
            server.send(theirs, content)
            assert server.receive(ours) == content
        server.send(theirs, "x" * 2000)
        with pytest.raises(ValueError, match="too large"):
            server.receive(ours, 1000)
    assert len(sprung) == 1


@pytest.mark.parametrize("reply", [
    5, [1, 0], [1, 0, "", [], [[0, "text"]]], [7, 0, "", [], []], [1, 1 << 40, "", [], []], [1, 0, "", [b"12"], []],
    [1, 0, "", [[b"text"]], []], [1, 0, "", [5], []],
])  # fmt: skip
def test_an_answer_that_is_none_ends_the_guest(guest, tmp_path, monkeypatch, reply):
    """Buffers of other sizes would be written over the memory of the run."""
    replies = supervisor.receive

    def receive(connection, most):
        given = replies(connection, most)
        return reply if given[3] and isinstance(given[3], list) else given

    monkeypatch.setattr(supervisor, "receive", receive)
    with pytest.raises(ComponentFailed, match="was answered with what is no reply"):
        run(tmp_path, {"a": entry(guest)})


def test_a_guest_cannot_shrink_the_memory_of_the_run(guest):
    with supervisor.ProcessPool() as pool:
        (one,) = pool.open([supervisor.ProcessRequest("a", guest, False, 1.0)]).values()
        one.memory(8)
        shared = [int(each.name) for each in Path("/proc/self/fd").iterdir() if "memfd:" in os.path.realpath(each)]
        assert shared
        for number in shared:
            with pytest.raises(PermissionError):
                os.ftruncate(number, 0)


# --- once per process -------------------------------------------------------------------------------


def test_an_fmu_for_one_instance_has_each_in_a_process(guest, tmp_path):
    once = foreign_fmus.build(tmp_path / "Once.fmu", "guest", GUEST, library=foreign_fmus.library_of(guest), once=True)
    _, path = run(tmp_path, {"a": entry(once), "b": entry(once)})
    assert outputs(path, "b")[1]["together"][-1] == STOP
    with pytest.raises(ComponentFailed, match=r"b: '\S*/Once.fmu' can be instantiated once per process"):
        run(tmp_path, {"a": entry(once, in_process=True), "b": entry(once, in_process=True)})


# --- time -------------------------------------------------------------------------------------------


@pytest.mark.parametrize("start", [0.0, 5.0, 1e6])
def test_no_step_ends_after_the_stop_time_that_was_given(start):
    """Of 2,400 pairs of stop and step 633 did by a rounding."""
    for step in (1e-3, 3e-3, 0.1, 0.7e-3, 1 / 3, 1.25e-3):
        for n in range(1, 401):
            run = table({}, stop=n * step, step=step, start=start)["run"]
            begin, end = RunTable.model_validate(run).times
            assert begin == start
            assert all(begin + k * step + step <= end for k in (0, n // 2, n - 1))
            assert end - begin <= n * step + 1e-9


def test_our_fmus_run_by_the_time_of_the_scene(tmp_path):
    """Beside FMUs of users that begin at another time."""
    hashes = []
    for start in (0.0, 1e6):
        settings = {"run.stop": "5 ms", "run.start": start, "chain.links": 8, "run.links": 7, "expect": {}}
        simulate(load("hanging_chain", "flexible", settings), tmp_path / "a.mcap")
        with Log(tmp_path / "a.mcap") as log:
            hashes.append(log.hashes()["/chain/out"])
    assert hashes[0] == hashes[1]
