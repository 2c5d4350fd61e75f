"""The command line: its output, exit codes and files."""

import json
import os
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from short_runs import SHORT, last

from fmus.vehicles import vehicle as vehicles
from fmus.vehicles.tables import BadInput
from orchestrator.files.budget import read_file
from orchestrator.files.command import command_scope
from orchestrator.log.log_file import LogFailed, check_writable
from orchestrator.log.reader import Log
from orchestrator.log.recorder import Recorder
from orchestrator.log.tools import WHOLE, verify
from orchestrator.results.output_files import atomic_write, check_unread
from orchestrator.scene.scene import scene_names

KEYS = {
    "scene", "track", "status", "message", "simulated_time", "startup_time", "wall_time", "cpu_time",
    "real_time_factor", "communication_steps", "rejected_steps", "log", "log_bytes", "seal", "components", "fmus",
    "energy", "energy_missing", "error", "checks", "observables", "windows", "places", "phases", "warnings", "validity",
    "checks_after_end", "checks_left_out", "passed_over", "track_tension",
}  # fmt: skip


def test_scenes_and_vehicles_are_listed(cotrack):
    listed = [line.split()[0] for line in cotrack.done("scenes").splitlines()]
    assert listed == scene_names()
    assert listed[:5] == ["hanging_chain", "sprocket_bench", "rig", "settle", "straight"]
    out = cotrack.done("vehicles")
    assert [line.split()[0] for line in out.splitlines()] == vehicles.names()
    assert "m113        15892 kg, 64 links, 5 road wheels a side: tracked carrier" in out  # 155,896 N of weight


def test_run_ends_with_one_json_object(cotrack, tmp_path):
    out = cotrack.done(*SHORT)
    result = last(out)
    assert set(result) == KEYS
    assert (result["status"], result["message"]) == ("ok", "")
    assert result["communication_steps"] == 20
    assert result["simulated_time"] == pytest.approx(0.02)
    assert set(result["checks"]) == {"rest"}, "checks of windows that the run does not reach are reported"
    assert set(result["components"]["chain"]) >= {"wall_time", "steps", "evaluations", "iterations", "rejected"}
    log = tmp_path / "logs" / "hanging_chain-flexible-run.stop=0.02.mcap"
    assert result["log"] == os.path.join("logs", log.name)
    assert result["log_bytes"] == log.stat().st_size
    assert verify(log).code == WHOLE


def test_what_replays_and_recoveries_read_or_what_is_no_log_is_not_replaced(cotrack, tmp_path):
    note = tmp_path / "note.txt"
    note.write_text("mine")
    assert cotrack("log", "recover", "note.txt", "-o", "note.txt")[0] == 1
    assert cotrack(*SHORT, "--no-estimate", "--log", "a.mcap")[0] == 0
    for target in ("note.txt", "a.mcap"):
        assert target in cotrack.refused("replay", "a.mcap", "--component", "chain", "--with", "rigid", "-o", target)
    assert verify("a.mcap").code == WHOLE
    assert note.read_text() == "mine"


@pytest.mark.parametrize("write", [lambda path: atomic_write(path).__enter__(), check_writable])
def test_a_file_that_is_read_is_not_replaced(tmp_path, write):
    """Tables, pictures and pages; logs. What was read before is no input of the next command."""
    (tmp_path / "a.csv").write_text("t,y")
    (tmp_path / "link.csv").symlink_to("a.csv")
    with command_scope():
        read_file(tmp_path / "a.csv", 10)
        for name in ("a.csv", "link.csv"):
            with pytest.raises((BadInput, LogFailed), match=f"{name}.* cannot be written: it is a file that is read"):
                write(tmp_path / name)
        check_unread(tmp_path / "b.csv")
    with command_scope():
        check_unread(tmp_path / "a.csv")


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


def test_names_of_files_need_not_be_text(cotrack, tmp_path):
    odd = os.fsdecode(b"\xff.mcap")
    assert cotrack(*SHORT, "--no-estimate", "--log", odd)[0] == 0
    out = cotrack.done("log", "verify", odd)
    assert out.startswith("\\udcff.mcap is whole")
    assert cotrack("replay", odd, "--component", "chain", "--set", "vehicle.gravity=10", "-o", "b.mcap")[0] == 0
    with Log("b.mcap") as log:
        assert log.metadata["replay"]["of"] == "\\udcff.mcap"


@pytest.mark.long
def test_build_names_variants(cotrack, tmp_path):
    out = cotrack.done("build", "hanging_chain", "--track", "rigid", "-o", "fmus")
    assert [file.name for file in (tmp_path / "fmus").iterdir()] == ["TrackRigid-hanging_chain.fmu"]
    assert out.strip().endswith("TrackRigid-hanging_chain.fmu")
    assert cotrack.refused("build", "hanging_chain", "-o", "fmus/TrackRigid-hanging_chain.fmu/below")


@pytest.mark.long
def test_a_run_for_an_analysis_records_what_it_needs(cotrack, tmp_path, monkeypatch):
    """The sentence of the analysis names the option, and the option makes the analysis possible."""
    plain, made = tmp_path / "plain.mcap", tmp_path / "made.mcap"
    assert cotrack(*SHORT, "--no-estimate", "-o", plain)[0] == 0
    for analysis in ("fatigue", "deformation"):
        assert f"or cotrack run --for {analysis}" in cotrack.refused("analyse", plain, analysis)
    assert cotrack(*SHORT, "--no-estimate", "--for", "fatigue", "--for", "deformation", "-o", made)[0] == 0
    for analysis in ("fatigue", "deformation"):
        assert cotrack("analyse", made, analysis)[0] == 0
    assert cotrack(*SHORT, "--no-estimate", "--for", "fatigue", "--set", "run.links=5", "-o", "fifth.mcap")[0] == 0
    with Log(plain) as before, Log(made) as after, Log(Path("fifth.mcap")) as fifth:
        assert set(before.signals) < set(after.signals)
        second = [log.signal("chain.link[1].tension")[0][1] for log in (after, fifth, before)]  # time of that record
        assert second == pytest.approx(after.signal("chain.tension.max")[0][1] * np.array([1, 5, 10]))
        assert (before.signal("chain.tension.max")[1] == after.signal("chain.tension.max")[1]).all()
    monkeypatch.setitem(sys.modules, "rainflow", None)
    status, _, err = cotrack(*SHORT, "--for", "deformation", "--for", "fatigue", "-o", "none.mcap")
    assert (status, Path("none.mcap").exists()) == (2, False), "a run is made for an analysis that cannot be made"
    assert err.startswith("cotrack: rainflow is not installed: pip install -c constraints.txt -e '.[analysis]' in ")
