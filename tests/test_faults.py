"""Faults of the machine around a run: signals, full and read-only file systems, clocks, many runs."""

import json
import re
import shlex
import signal
import subprocess
import sys
import textwrap
import time
from pathlib import Path

import numpy as np
import pytest
from conftest import messages
from toy_runs import TOY_RUN, run_toy

from orchestrator.log.reader import Log
from orchestrator.log.tools import BROKEN, RECOVERED, WHOLE, recover, verify
from tests.fuzz.oracle import PARTIAL

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="signals and file systems of Linux")
HERE = Path(__file__).parent
CHAIN = (
    "run", "hanging_chain", "--track", "rigid", "--set", "chain.links=8", "--set", "expect={}", "--no-estimate",
    "--json",
)  # fmt: skip
HULL = ("run", "straight", "--track", "rigid", "--set", "tracks=[]", "--set", "expect={}", "--no-estimate", "--json")
COMMAND = (sys.executable, "-m", "orchestrator")


def digest(path):
    with Log(path) as log:
        return log.digest()


def call(arguments, environment, folder, command=COMMAND):
    return subprocess.run(
        [*command, *arguments], env=environment, cwd=folder, capture_output=True, text=True, timeout=300
    )


def said(err):
    """Lines of an error text; a slow machine shows progress besides."""
    return messages(err).splitlines()


def partial_files(cache):
    return [file for file in cache.rglob("*") if PARTIAL.search(file.name) and file.is_file()]


def test_the_table_names_a_test_for_each_fault():
    page = (HERE / "README.md").read_text(encoding="utf-8")
    rows = re.findall(r"(?m)^\| (.+) \| (.+) \| `(.+)::(.+)` \|$", page.partition("## Faults")[2])
    assert len(rows) >= 21
    for fault, _, file, name in rows:
        assert f"\ndef {name}(" in (HERE / file).read_text(encoding="utf-8"), fault


# --- signals ----------------------------------------------------------------------------------------


@pytest.mark.long
def test_a_run_that_was_stopped_goes_on(environment, tmp_path):
    run = [*CHAIN, "--stop", "2", "--set", "run.links=50", "--log"]
    process = subprocess.Popen([*COMMAND, *run, "a.mcap"], env=environment, cwd=tmp_path, stdout=subprocess.DEVNULL)
    stops = 0
    while process.poll() is None:
        if (tmp_path / "a.mcap").exists():
            process.send_signal(signal.SIGSTOP)
            stops += 1
            time.sleep(0.1)
            process.send_signal(signal.SIGCONT)
        time.sleep(0.05)
    assert process.returncode == 0
    assert stops
    assert verify(tmp_path / "a.mcap").code == WHOLE
    assert call([*run, "b.mcap"], environment, tmp_path).returncode == 0
    assert digest(tmp_path / "a.mcap") == digest(tmp_path / "b.mcap")


@pytest.mark.long
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_while_kernels_compile(environment, tmp_path, number):
    cold = {**environment, "COTRACK_CACHE": str(tmp_path / "cache")}
    streams = {"stdout": subprocess.DEVNULL, "stderr": subprocess.PIPE, "text": True}
    process = subprocess.Popen([*COMMAND, *CHAIN, "--log", "a.mcap"], env=cold, cwd=tmp_path, **streams)
    until = time.monotonic() + 120
    while not list((tmp_path / "cache").glob("kernels/*/*")):
        assert process.poll() is None
        assert time.monotonic() < until, "nothing was compiled"
        time.sleep(0.02)
    process.send_signal(number)
    _, err = process.communicate(timeout=60)
    assert (process.returncode, said(err)) == (1, ["cotrack: interrupted"])
    assert not (tmp_path / "a.mcap").exists()
    assert partial_files(tmp_path / "cache") == []


@pytest.fixture(scope="module")
def toy_answer(environment, tmp_path_factory):
    """Outputs of the toy."""
    return run_toy(environment, tmp_path_factory.mktemp("toy") / "cache")[1]


@pytest.mark.long
def test_a_killed_compilation_leaves_a_cache_that_works(environment, toy_answer, tmp_path):
    cache = tmp_path / "cache"
    for pattern in ("unpacked/*", "kernels/*"):  # as soon as one of these is there
        process = subprocess.Popen(
            [sys.executable, "-c", TOY_RUN], env={**environment, "COTRACK_CACHE": str(cache)}, stdout=subprocess.DEVNULL
        )
        while not list(cache.glob(pattern)) and process.poll() is None:
            time.sleep(0.005)
        process.kill()
        process.wait()
    assert run_toy(environment, cache)[1] == toy_answer
    assert run_toy(environment, cache)[:3] == ([], toy_answer, 1)


@pytest.mark.long
def test_four_cold_starts_at_once(environment, toy_answer, tmp_path):
    cold = {**environment, "COTRACK_CACHE": str(tmp_path / "cache")}
    started = [subprocess.Popen([sys.executable, "-c", TOY_RUN], env=cold, stdout=subprocess.PIPE) for _ in range(4)]
    answers = [process.communicate(timeout=300)[0].decode().split() for process in started]
    assert [process.returncode for process in started] == [0] * 4
    assert {answer[-2] for answer in answers} == {answers[0][-2]}  # outputs, behind messages of those that compile
    assert partial_files(tmp_path / "cache") == []
    assert run_toy(environment, tmp_path / "cache")[:3] == ([], toy_answer, 1)


# --- file systems -----------------------------------------------------------------------------------


def mounted(folder, options, command):
    """Command line of a shell that mounts a small file system on a folder, for itself alone; skips the test without."""
    mount = f"mount -t tmpfs -o {options} none {shlex.quote(str(folder))}"
    if subprocess.run(["unshare", "-m", "sh", "-c", mount], capture_output=True).returncode:
        pytest.skip("no file system may be mounted here")
    return ["unshare", "-m", "sh", "-c", f"{mount} && {command}"]


@pytest.mark.long
def test_a_file_system_that_is_full_under_the_log(environment, tmp_path):
    (tmp_path / "disk").mkdir()
    run = shlex.join([*COMMAND, *CHAIN, "--stop", "5", "--log", "disk/a.mcap"])
    command = mounted(tmp_path / "disk", "size=1m", f"{run}; status=$?; cp disk/a.mcap kept.mcap; exit $status")
    done = call((), environment, tmp_path, command)
    assert done.returncode == 1, done.stderr
    (sentence,) = said(done.stderr)
    full = r"cotrack: .*the log disk/a\.mcap cannot be written: no space left on device, at t = [\d.]+ s"
    assert re.fullmatch(full, sentence)
    result = json.loads(done.stdout.splitlines()[-1])
    assert (result["status"], result["communication_steps"] > 100) == ("failed", True)
    assert verify(tmp_path / "kept.mcap").code == BROKEN
    assert recover(tmp_path / "kept.mcap", tmp_path / "saved.mcap").code == RECOVERED
    assert verify(tmp_path / "saved.mcap").code == WHOLE


@pytest.mark.long
@pytest.mark.parametrize(
    ("options", "reason"), [("size=64k", "No space left on device"), ("ro", "Read-only file system")]
)
def test_a_cache_that_cannot_be_written(environment, toy_answer, tmp_path, options, reason):
    """A full file system under the cache, or a home that is read-only, costs time only."""
    home = {name: value for name, value in environment.items() if name not in ("COTRACK_CACHE", "XDG_CACHE_HOME")}
    (tmp_path / "home").mkdir()
    command = mounted(tmp_path / "home", options, shlex.join([sys.executable, "-c", TOY_RUN]))
    done = call((), {**home, "HOME": str(tmp_path / "home")}, None, command)
    assert done.returncode == 0, done.stderr
    *messages, last = done.stdout.splitlines()
    assert bytes.fromhex(last.split()[0]) == np.array(toy_answer).tobytes()
    (warning,) = (message for message in messages if message.startswith("WARNING"))
    assert warning.startswith(f"WARNING toy: the cache folder {tmp_path}/home/.cache/cotrack cannot be used")
    assert warning.endswith(reason)


# --- many runs, other clocks, other interpreters ----------------------------------------------------

HUNDRED = """
import json, os
from pathlib import Path
from orchestrator.execution.simulate import simulate
from orchestrator.files.progress import Progress
from orchestrator.scene.scene import load
scene = load("hanging_chain", "rigid", ["chain.links=8", "expect={}", "run.stop=0.004"])
def used():
    memory = int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGESIZE")
    return memory, len(os.listdir("/proc/self/fd")), len(os.listdir("/proc/self/task"))
seen = []
for k in range(100):
    with Progress("run", lambda line: None):
        assert simulate(scene, Path("a.mcap"))["status"] == "ok"
    seen.append(used())
print(json.dumps(seen))
"""


@pytest.mark.long
def test_a_hundred_runs_in_one_process(environment, tmp_path):
    done = call(("-c", HUNDRED), environment, tmp_path, [sys.executable])
    assert done.returncode == 0, done.stderr
    memory, descriptors, threads = zip(*json.loads(done.stdout.splitlines()[-1])[10:], strict=True)
    assert max(memory) - memory[0] < 20e6
    assert max(descriptors) == descriptors[0]
    # a thread that Python has joined is listed until the system has ended it
    assert min(threads[-10:]) == min(threads[:10])
    assert max(threads) <= min(threads) + 2


JUMPING = """
import itertools, time
days = itertools.cycle((0, 30, -400, 1))
now = time.time
time.time = lambda: now() + 86400.0 * next(days)
from orchestrator.cli import main
main()
"""
PYTHONS = {"clock that jumps": ("-c", textwrap.dedent(JUMPING)), "-OO": ("-OO", "-m", "orchestrator")}


@pytest.fixture(scope="module")
def hull(environment, tmp_path_factory):
    """Return a function that runs a hull in a Python as given and returns the digest; kernels are not compiled."""
    folder = tmp_path_factory.mktemp("hull")

    def run(*python):
        done = call([*HULL, "--stop", "0.01", "--log", "a.mcap"], without_jit(environment), folder, python)
        assert done.returncode == 0, done.stderr
        return digest(folder / "a.mcap")

    return run


@pytest.fixture(scope="module")
def undisturbed(hull):
    return hull(*COMMAND)


def without_jit(environment):
    return {**environment, "NUMBA_DISABLE_JIT": "1"}  # without assertions all kernels would be compiled anew


@pytest.mark.long
@pytest.mark.parametrize("how", PYTHONS)
def test_a_run_in_another_python(hull, undisturbed, how):
    assert hull(sys.executable, *PYTHONS[how]) == undisturbed


@pytest.mark.long
def test_bad_input_to_a_python_without_assertions(environment, tmp_path):
    bad = call(
        ("show", "rig", "--set", "rig.links=-1"), without_jit(environment), tmp_path, [sys.executable, *PYTHONS["-OO"]]
    )
    assert (bad.returncode, len(said(bad.stderr))) == (2, 1)
