"""Hostile files cost any command at most a second of a processor and 200 MB more than a small valid file."""

import json
import os
import subprocess
import sys
from pathlib import Path

import hostile
import pytest

pytestmark = [pytest.mark.study, pytest.mark.skipif(not hasattr(os, "fork"), reason="measured in forks")]

SECONDS, MEMORY = 1.0, 200  # s of a processor, MB
HERE = Path(__file__).parent
SMALL = HERE / "logs" / "format_1.mcap"
GALLERY = HERE.parents[1] / "orchestrator" / "gallery"


def measured(commands, environment, folder):
    """Results of commands in forks of one process, each with 1.5 GB and 20 s."""
    child = subprocess.run(
        [sys.executable, HERE.parent / "support" / "limited.py", "1500", "20"],
        input=json.dumps([list(map(str, command)) for command in commands]),
        stdout=subprocess.PIPE,
        text=True,
        cwd=folder,
        env=environment,
        check=True,
    )
    return list(map(json.loads, child.stdout.splitlines()))


def check(valid, command, result):
    """Check what a command on a hostile file cost, against the same command on a ``valid`` one."""
    assert 0 <= result["status"] <= 3, (command, result)
    assert not any(word in result["stderr"] for word in ("internal error", "Traceback")), (command, result)
    said = [line for line in result["stderr"].splitlines() if not line.startswith("... ")]
    assert all(len(line) <= 400 for line in said), (command, said)
    assert result["seconds"] <= valid["seconds"] + SECONDS, (command, result)
    assert result["memory"] <= valid["memory"] + MEMORY, (command, result)


def log_commands(log):
    """Every command that reads a log."""
    return [
        ["log", "info", log], ["log", "verify", log], ["log", "recover", log, "-o", "recovered.mcap"],
        ["log", "export", log, "-o", "exported"], ["replay", log, "--to", "0"], ["resume", log, "-o", "resumed.mcap"],
        ["compare", log, SMALL], ["compare", SMALL, log], ["plot", log, "*.speed", "-o", "plot.png"],
        ["view", log, "-o", "view.png"], ["analyse", log, "links"], ["report", log, "-o", "report.html"],
    ]  # fmt: skip


@pytest.mark.parametrize("make", hostile.LOGS)
def test_logs(make, environment, tmp_path):
    log = make(SMALL, tmp_path / "hostile.mcap")
    commands = log_commands(log)
    results = measured([*log_commands(SMALL), *commands], environment, tmp_path)
    for valid, command, result in zip(results, commands, results[len(commands) :], strict=False):
        check(valid, command, result)


def scene_commands(scene):
    """Every command that reads a scene."""
    return [["show", scene], ["run", scene, "--no-estimate"], ["build", scene, "-o", "fmus"]]


def test_scenes_and_vehicles(environment, tmp_path):
    base = (GALLERY / "straight.toml").read_text()
    files = [tmp_path / f"{number}.toml" for number in range(len(hostile.SCENES))]
    for file, kind in zip(files, hostile.SCENES, strict=True):
        file.write_text(hostile.scene(kind, base))
    files += [hostile.pipe(tmp_path / "pipe.toml"), hostile.sparse(tmp_path / "sparse.toml"), "/dev/zero.toml"]
    commands = [command for file in files for command in [["show", file], ["show", "rig", "--set", f"vehicle={file}"]]]
    commands += [command for file in files[-3:] for command in scene_commands(file)[1:]]
    check_all([["show", "no such scene"], *commands], environment, tmp_path)


def hostile_files(make, kinds, folder, suffix):
    """Hostile files of these kinds, a pipe, a file with a hole, and a device."""
    files = [make(folder / f"{kind}.{suffix}", kind) for kind in kinds]
    return [*files, hostile.pipe(folder / f"pipe.{suffix}"), hostile.sparse(folder / f"sparse.{suffix}"), "/dev/zero"]


def check_all(commands, environment, folder):
    """Check the commands against the first one, whose file is valid; return the results of the others."""
    valid, *results = measured(commands, environment, folder)
    for command, result in zip(commands[1:], results, strict=True):
        check(valid, command, result)
    return results


COMPARED = ("--clock", "0:s", "--map", "chain.speed=1", "--shift", "find")


@pytest.mark.parametrize(
    ("kinds", "command"),
    [(hostile.TABLES, lambda file: ["show", "sprocket_bench", "--set", f"drive.speed_points={file}"]),
     (tuple(hostile.TEXTS), lambda file: ["compare", SMALL, file, *COMPARED])],
    ids=["points", "measured"],
)  # fmt: skip
def test_tables(environment, tmp_path, kinds, command):
    small = tmp_path / "small.csv"
    small.write_text("0,1\n1,2\n2,3\n")
    files = [small, *hostile_files(hostile.table, kinds, tmp_path, "csv")]
    check_all([command(file) for file in files], environment, tmp_path)


def test_fmus(environment, tmp_path):
    files = ["no.fmu", *hostile_files(hostile.fmu, hostile.FMUS, tmp_path, "fmu")]
    commands = [["replay", SMALL, "--component", "chain", "--with", file] for file in files]
    assert {result["status"] for result in check_all(commands, environment, tmp_path)} == {2}


def test_pipes_and_devices_as_logs(environment, tmp_path):
    pipe, sparse = hostile.pipe(tmp_path / "pipe.mcap"), hostile.sparse(tmp_path / "sparse.mcap")
    commands = [["log", "info", SMALL]]
    commands += [command for log in (pipe, sparse, "/dev/zero") for command in log_commands(log)]
    assert {result["status"] for result in check_all(commands, environment, tmp_path)} <= {1, 2}
