"""Runs on a damaged cache are right and heal it; a folder that others can write is not used."""

import json
import os
import pickle
import random
import shutil
import subprocess
import sys
from collections import Counter
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
from damaged_files import POSIX, damage, forget_notices

import fmus.cache.files
from orchestrator.execution import precision
from orchestrator.execution.precision import Setting
from orchestrator.log.reader import Log

_nothing_said_yet = pytest.fixture(autouse=True)(forget_notices)


# --- runs of the toy -------------------------------------------------------------------------------

TOY_RUN = """
import sys
from pathlib import Path
from conftest import build_toy
from orchestrator.cosim.component import Component
def heard(name, status, message):
    print(status, message)
with Component(build_toy(), "toy", heard) as component:
    component.initialise({})
    for i in range(3):
        component.step(i * 1e-3, 1e-3)
    component.read()
    import toy.kernels
    hits = sum(toy.kernels.advance.stats.cache_hits.values())
    print(component.y.tobytes().hex(), hits)
"""


def run_toy(environment, cache):
    """Run the toy in its own process: messages, outputs, number of kernels found, text of its log."""
    done = subprocess.run(
        [sys.executable, "-c", TOY_RUN], env={**environment, "COTRACK_CACHE": str(cache)},
        capture_output=True, text=True,
    )  # fmt: skip
    assert done.returncode == 0, (done.returncode, done.stderr[-2000:])
    *messages, last = done.stdout.splitlines()
    values, hits = last.split()
    return messages, np.frombuffer(bytes.fromhex(values)).tolist(), int(hits), done.stderr


@pytest.fixture(scope="module")
def warm(environment, tmp_path_factory):
    """A cache that one run has filled, and the outputs of that run."""
    cache = tmp_path_factory.mktemp("warm") / "cache"
    return cache, run_toy(environment, cache)[1]


@pytest.fixture
def cache(warm, tmp_path):
    """A copy of the warm cache."""
    return shutil.copytree(warm[0], tmp_path / "cache")


@pytest.mark.long
def test_a_run_on_damaged_files_is_right_and_heals_them(environment, warm, cache):
    """A run on damaged files is right and repairs them.

    Without checks a cut library ended the process by SIGBUS, a missing resource by SIGSEGV.
    """
    rng = random.Random(6)
    for pattern, how in (
        ("kernels/*/*advance*.kernel", "flip"),
        ("unpacked/*/binaries/linux64/*.so", "cut"),
        ("unpacked/*/resources/config.json", "delete"),
    ):
        (file,) = cache.glob(pattern)
        damage(file, how, rng)
    assert run_toy(environment, cache) == ([], warm[1], 0, "")
    assert run_toy(environment, cache) == ([], warm[1], 1, "")


class Trap:
    """An object that makes a folder when it is unpickled."""

    def __init__(self, folder):
        self.folder = folder

    def __reduce__(self):
        return os.mkdir, (self.folder,)


@pytest.mark.long
@POSIX
def test_nothing_is_unpickled_from_a_folder_that_others_can_write(environment, warm, cache, tmp_path):
    trap = tmp_path / "trap"
    (kernel,) = cache.glob("kernels/*/*advance*.kernel")
    fmus.cache.files.write_checked(kernel, pickle.dumps(Trap(trap)))
    cache.chmod(0o777)
    messages, values, hits, said = run_toy(environment, cache)
    assert (values, hits, trap.exists()) == (warm[1], 0, False)
    sentence = (
        f"the cache folder {cache} cannot be used, so every process compiles and builds anew: "
        f"others can write into {cache} (mode 777); chmod -R go-w it, or name another folder in COTRACK_CACHE"
    )
    assert messages == [f"1 {sentence}"], "the message for a host without Python's log"
    assert said == f"{sentence}\n"
    cache.chmod(0o700)
    pickle.loads(fmus.cache.files.read_checked(kernel))
    assert trap.exists(), "the trap does not work"


# --- whole runs ------------------------------------------------------------------------------------

OPENED = """
import os, sys
opened = set()
def note(event, arguments):
    if event in ("open", "ctypes.dlopen") and isinstance(arguments[0], str | os.PathLike):
        opened.add(os.fspath(arguments[0]))
sys.addaudithook(note)
from orchestrator.cli import main
try:
    main()
finally:
    print("opened", *opened, sep="\\n", file=sys.stderr)
"""
SHORT = ("--stop", "0.02", "--json")
COMMANDS = (
    ("run", "hanging_chain", *SHORT, "--no-estimate", "--log", "run.mcap"),
    ("run", "rig", *SHORT, "--no-estimate", "--log", "run.mcap"),
    ("run", "hanging_chain", *SHORT, "--no-estimate", "--log", "run.mcap", "--error", "1%"),
    ("truth", "hanging_chain", *SHORT),
)
KINDS = {
    "kernels": 80, "fmus": 25, "binaries": 25, "resources": 25, "modelDescription.xml": 15, "truth": 20,
    "precision.json": 10,
}  # fmt: skip


class Ran(NamedTuple):
    """Result of a command."""

    status: int
    result: str  # digest of its log; of a truth its errors and the digests of its logs
    messages: list[str]  # messages
    opened: set[Path]


def command(arguments, folder, environment):
    """Run a command in a folder that also holds its cache."""
    log = folder / "run.mcap"
    log.unlink(missing_ok=True)
    done = subprocess.run(
        [sys.executable, "-c", OPENED, *arguments], env={**environment, "COTRACK_CACHE": str(folder / "cache")},
        cwd=folder, capture_output=True, text=True, timeout=900,
    )  # fmt: skip
    said, _, opened = done.stderr.partition("opened\n")
    result, logs = "", [log]
    if arguments[0] == "truth" and done.returncode == 0:
        answer = json.loads(done.stdout)
        result, logs = json.dumps(answer["observables"]), [Path(answer["log"]), Path(answer["coarse_log"])]
    for each in logs:
        if each.exists():
            with Log(each) as written:
                result += written.digest()
    messages = [line for line in said.splitlines() if line.startswith(("cotrack: ", "Traceback"))]
    inside = {Path(name) for name in opened.splitlines() if name.startswith(str(folder / "cache"))}
    return Ran(
        done.returncode, result, messages, {file.relative_to(folder / "cache") for file in inside if file.is_file()}
    )


@pytest.mark.study
def test_two_hundred_flips_and_sixty_other_damages(environment, tmp_path):
    """A run is right after any damage, possibly with a message. Takes half an hour."""
    precision_table = tmp_path / "cache" / "precision.json"
    fmus.cache.files.make_folder(precision_table.parent)
    swing = ("run.step=2 ms", "track.step=1 ms")
    precision.write([Setting("hanging_chain", "flexible", swing, 0.004, 0.2)], precision_table)
    for arguments in COMMANDS:
        command(arguments, tmp_path, environment)  # fill the cache
    right = {arguments: command(arguments, tmp_path, environment) for arguments in COMMANDS}
    assert all(ran.status == 0 and ran.result for ran in right.values())
    pristine = tmp_path / "pristine"
    shutil.copytree(tmp_path / "cache", pristine)
    places = {kind: [] for kind in KINDS}
    for arguments, ran in right.items():
        for file in sorted(ran.opened):
            kind = next((part for part in file.parts if part in KINDS), None)
            if kind and (pristine / file).stat().st_size:
                places[kind].append((arguments, file))
    rng = random.Random(7)
    plan = [("flip", kind) for kind, share in KINDS.items() for _ in range(share)]
    plan += [(how, list(KINDS)[i % len(KINDS)]) for how in ("cut", "empty", "delete") for i in range(20)]
    became = Counter()
    wrong = []
    for how, kind in plan:
        arguments, file = rng.choice(places[kind])
        shutil.rmtree(tmp_path / "cache")
        shutil.copytree(pristine, tmp_path / "cache")
        damage(tmp_path / "cache" / file, how, rng)
        ran = command(arguments, tmp_path, environment)
        verdict = "right" if ran[:2] == right[arguments][:2] else "wrong"
        if verdict == "wrong" and kind == "precision.json" and ran.status == 0:
            verdict = "told" if any("precision.json is damaged" in line for line in ran.messages) else "wrong"
            verdict = "right" if how == "delete" else verdict  # a deleted file is as if it never existed
        became[how, verdict] += 1
        if verdict == "wrong":
            wrong.append((how, file, ran))
    print(became)
    assert not wrong, wrong
    assert sum(count for (how, _), count in became.items() if how == "flip") == 200
