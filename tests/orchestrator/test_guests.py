"""FMUs that are not ours, in processes of their own: whatever they do, the run says it and its log is whole."""

import ctypes
import json
import os
import signal
import subprocess
import sys
import time

import foreign_fmus
import numpy as np
import pytest
from foreign_fmus import Variable

from fmus.vehicles.tables import BadInput
from orchestrator.cosim.graph import ComponentFailed
from orchestrator.cosim.guests import room
from orchestrator.execution.simulate import simulate
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


@pytest.fixture(scope="module")
def guest(tmp_path_factory):
    return foreign_fmus.build(tmp_path_factory.mktemp("guest") / "Guest.fmu", "guest", GUEST)


def table(fmus, connections=(), **run):
    return {
        "name": "guests",
        "title": "Guests",
        "assembly": "fmus",
        "run": {"stop": STOP, "step": H, **run},
        "fmu": fmus,
        "connections": [*connections],
    }


def entry(guest, manner=0, **more):
    return {"file": str(guest), "parameters": {"manner": manner, "when": WHEN}, **more}


def run(tmp_path, fmus, connections=(), logger=None, **more):
    path = tmp_path / "guests.mcap"
    return simulate(any_from_table(table(fmus, connections, **more), "guests.toml"), path, logger), path


def outputs(path, name="a"):
    with Log(path, unfinished=True) as log:
        series = log.read(f"/{name}/out")
        return series.t, dict(zip(series.names, series.values.T, strict=True))


# --- what a guest does ------------------------------------------------------------------------------


@pytest.mark.parametrize(("manner", "said"), [
    (ENDS, "a: its process has ended with exit status 0 in fmi2DoStep at t = 0.0302734 s"),
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
    monkeypatch.setattr(room, "MOST", 8 if alone else 1)
    _, path = run(tmp_path, {"a": entry(guest), "b": entry(guest)})
    together = outputs(path, "b")[1]["together"][-1]
    assert together == (2.0 * STOP if shared else STOP)


def test_too_many_fmus_are_refused(guest, tmp_path, monkeypatch):
    monkeypatch.setattr(room, "MOST", 1)
    other = foreign_fmus.build(
        tmp_path / "Other.fmu", "guest", GUEST, library=foreign_fmus.library_of(guest), states=True
    )
    with pytest.raises(ComponentFailed, match="2 FMUs need processes of their own, and a run has at most 1"):
        run(tmp_path, {"a": entry(guest), "b": entry(other)})


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


@pytest.mark.parametrize(("number", "when"), [
    pytest.param(signal.SIGINT, WHEN, marks=pytest.mark.long),
    (signal.SIGTERM, WHEN),
    (signal.SIGHUP, 0.0),
    pytest.param(signal.SIGINT, 0.0, marks=pytest.mark.long),
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
        f"... a: fmi2{'DoStep at t = 0.0302734 s' if when else 'ExitInitializationMode'} has"
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


# --- once per process -------------------------------------------------------------------------------


def test_an_fmu_for_one_instance_has_each_in_a_process(guest, tmp_path):
    once = foreign_fmus.build(tmp_path / "Once.fmu", "guest", GUEST, library=foreign_fmus.library_of(guest), once=True)
    _, path = run(tmp_path, {"a": entry(once), "b": entry(once)})
    assert outputs(path, "b")[1]["together"][-1] == STOP
    with pytest.raises(ComponentFailed, match=r"b: '\S*/Once.fmu' can be instantiated once per process"):
        run(tmp_path, {"a": entry(once, in_process=True), "b": entry(once, in_process=True)})


def test_a_bad_key_is_refused(guest):
    with pytest.raises(BadInput, match="non_finite"):
        any_from_table(table({"a": entry(guest, non_finite="shrug")}), "guests.toml")


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
