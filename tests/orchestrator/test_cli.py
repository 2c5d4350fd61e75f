"""The command line: its output, exit codes and files."""

import json
import os
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from short_run import SHORT, last

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
    "energy", "error", "checks", "observables", "windows", "places", "phases", "warnings", "validity",
    "checks_after_end", "checks_left_out", "passed_over", "track_tension",
}  # fmt: skip


def test_scenes_lists_the_gallery(cotrack):
    assert [line.split()[0] for line in cotrack.done("scenes").splitlines()] == scene_names()


def test_vehicles_lists_the_packaged_ones(cotrack):
    out = cotrack.done("vehicles")
    assert [line.split()[0] for line in out.splitlines()] == vehicles.names()
    assert "m113        15892 kg, 64 links, 5 road wheels a side: tracked carrier" in out  # 155,896 N of weight


def test_every_command_with_scenes_takes_a_vehicle(cotrack):
    """A file that is missing is refused by its name, so each command reads the vehicle that it is given."""
    options = {"build": ("-o", "built"), "ssp": ("-o", "own.ssp"), "sweep": ("--vary", "run.stop=1,2", "-o", "swept")}
    for command in ("run", "truth", "show", "build", "ssp", "sweep"):
        status, _, err = cotrack(command, "straight", "--vehicle", "none.toml", *options.get(command, ()))
        assert (status, err) == (2, "cotrack: no vehicle file 'none.toml'\n"), command


def test_show(cotrack):
    out = cotrack.done("show", "straight", "--track", "rigid")
    assert "TrackRigid" in out
    present, absent = out.split("\nleft out\n")
    unused = "of the suspension: springs by a table, gas springs, dampers by a table, torsion bars, rotary dampers"
    assert f"  {unused}, bump stops, rebound stops, recoil springs\n" in absent
    assert "  bushes in the pins\n" in absent
    assert "bushes" not in present


@pytest.mark.parametrize(
    ("vehicle", "elements"),
    [
        ("leopard2", "14 arms with wheels, 2 idlers, 8 return rollers, 2 mounts, torsion bars"),
        ("dozer", "14 wheels on axles, 2 idlers, 2 return rollers, 2 mounts, recoil springs;"),
    ],
)
def test_show_names_the_elements_of_a_vehicle(cotrack, vehicle, elements):
    """Elements of a vehicle stand with its chassis and its tracks, and not among what is left out."""
    bushes = "--set", "vehicle.track.bushing.stiffness=500"
    present, absent = cotrack.done("show", "straight", "--vehicle", vehicle, *bushes).split("\nleft out\n")
    assert elements in present
    assert present.count(", bushes in the pins, ") == 2
    assert "  bushes in the pins\n" not in absent  # a module's list may have the word
    unused = absent.partition("of the suspension: ")[2].partition("\n")[0].split(", ")
    assert len(unused) > 3
    assert not [name for name in unused if name in present]


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


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("run", "hanging_chian"), "did you mean 'hanging_chain'?"),
        (("run", "hanging_chain", "--set", "run.stp=1"), "unknown key 'run.stp'"),
        (("run", "hanging_chain", "--step", "2 kg"), "must be a quantity in s"),
        (("run", "straight", "--set", "vehicle.chassis.mass=-1"), "vehicle.chassis.mass = -1"),
        (
            ("run", "rig", "--set", "rig.links=40"),
            "rig.links = 40, vehicle.track.pitch = 0.1524 m and the wheels do not fit together: the track",
        ),
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
    err = cotrack.refused(*arguments)
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
    for target, said in (("note.txt", "is no log"), ("a.mcap", "a.mcap cannot be written: it is a file that is read")):
        assert said in cotrack.refused("replay", "a.mcap", "--component", "chain", "--with", "rigid", "-o", target)
    assert verify("a.mcap").code == WHOLE
    assert note.read_text() == "mine"
    assert "the folder note.txt cannot be made" in cotrack.refused("build", "hanging_chain", "-o", "note.txt")


@pytest.mark.parametrize("write", [
    lambda path: atomic_write(path).__enter__(),
    check_writable,
])  # fmt: skip
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


def test_errors_in_the_command_line_are_short(cotrack):
    word = "x" * 3000
    wrong = (word,), ("log", word), ("show", "rig", f"--{word}"), ("run", "rig", "--track", word), ("show", word)
    for arguments in wrong:
        status, _, err = cotrack(*arguments)
        lines = [line for line in err.splitlines() if line.startswith(("Error: ", "cotrack: "))]
        assert (status, len(lines)) == (2, 1)
        assert "xxx" in lines[0]
        assert len(lines[0]) <= 400


def test_what_cannot_be_read_back_is_refused_before_the_run(cotrack, tmp_path):
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "link").symlink_to(tmp_path / "link")
    said = {
        "pipe": "it is a device or a pipe",
        "/dev/null": "it is a device or a pipe",
        "link": "it is a link that leads to itself",
    }
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


def test_names_of_files_need_not_be_text(cotrack, tmp_path):
    odd = os.fsdecode(b"\xff.mcap")
    assert "the log \\udcff.mcap cannot be read" in cotrack.refused("log", "info", odd)
    assert cotrack(*SHORT, "--no-estimate", "--log", odd)[0] == 0
    out = cotrack.done("log", "verify", odd)
    assert out.startswith("\\udcff.mcap is whole")
    assert cotrack("replay", odd, "--component", "chain", "--set", "vehicle.gravity=10", "-o", "b.mcap")[0] == 0
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
    assert "/chain/out" in cotrack.done("log", "info", "a.mcap")
    assert cotrack("log", "verify", "a.mcap")[0] == 0
    cotrack.done("log", "export", "a.mcap", "-o", "t.csv", "--signal", "chain.tension.max")
    assert (tmp_path / "t.csv").read_text().splitlines()[0] == "t [s],chain.tension.max [N]"
    content = bytearray((tmp_path / "a.mcap").read_bytes())
    (tmp_path / "cut.mcap").write_bytes(content[: len(content) // 2])
    assert cotrack("log", "verify", "cut.mcap")[0] == 1
    assert cotrack("log", "recover", "cut.mcap", "-o", "saved.mcap")[0] in (1, 3)
    assert cotrack("log", "verify", "none.mcap")[0] == 1


@pytest.mark.long
def test_build_names_variants(cotrack, tmp_path):
    out = cotrack.done("build", "hanging_chain", "--track", "rigid", "-o", "fmus")
    assert [file.name for file in (tmp_path / "fmus").iterdir()] == ["TrackRigid-hanging_chain.fmu"]
    assert out.strip().endswith("TrackRigid-hanging_chain.fmu")
    err = cotrack.refused("build", "hanging_chain", "-o", "fmus/TrackRigid-hanging_chain.fmu/below")
    assert "cannot be made" in err


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
    assert "no analysis 'fatig': one of power, spectrum" in cotrack.refused(*SHORT, "--for", "fatig")
    status, _, err = cotrack(*SHORT, "--track", "rigid", "--for", "fatigue", "-o", "none.mcap")
    assert (status, Path("none.mcap").exists()) == (2, False)
    assert "--for fatigue: rigid links have no stress" in err
    monkeypatch.setitem(sys.modules, "rainflow", None)
    status, _, err = cotrack(*SHORT, "--for", "deformation", "--for", "fatigue", "-o", "none.mcap")
    assert (status, Path("none.mcap").exists()) == (2, False), "a run is made for an analysis that cannot be made"
    assert err.startswith("cotrack: rainflow is not installed: pip install -c constraints.txt -e '.[analysis]' in ")
