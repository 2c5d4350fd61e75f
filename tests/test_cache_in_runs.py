"""Runs on a damaged cache are right and heal it; a folder that others can write is not used."""

import os
import pickle
import random
import shutil

import pytest
from damaged_files import POSIX, damage
from toy_runs import run_toy

from fmus.cache.files import read_checked, write_checked


@pytest.fixture(scope="module")
def warm(environment, tmp_path_factory):
    """A cache that one run has filled, and the outputs of that run."""
    cache = tmp_path_factory.mktemp("warm") / "cache"
    messages, values, hits, _ = run_toy(environment, cache)
    assert hits == 0
    assert ["compiles the kernels" in message for message in messages] == [True], "once on a machine"
    return cache, values


@pytest.fixture
def cache(warm, tmp_path):
    """A copy of the warm cache."""
    return shutil.copytree(warm[0], tmp_path / "cache")


@pytest.mark.long
def test_a_run_on_damaged_files_is_right_and_heals_them(environment, warm, cache):
    """Without checks a cut library ended the process by SIGBUS, a missing resource by SIGSEGV."""
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
def test_nothing_is_unpickled_that_others_can_write_or_that_is_damaged(environment, warm, cache, tmp_path):
    trap = tmp_path / "trap"
    (kernel,) = cache.glob("kernels/*/*advance*.kernel")
    write_checked(kernel, pickle.dumps(Trap(trap)))
    content = kernel.read_bytes()
    cache.chmod(0o777)
    messages, values, hits, said = run_toy(environment, cache)
    assert (values, hits, trap.exists()) == (warm[1], 0, False)
    sentence = (
        f"the cache folder {cache} cannot be used, so every process compiles and builds anew: "
        f"others can write into {cache} (mode 777); chmod -R go-w it, or name another folder in COTRACK_CACHE"
    )
    assert messages == [f"WARNING toy: {sentence}"], "the message for a host without Python's log"
    assert said == f"{sentence}\n"
    cache.chmod(0o700)
    kernel.write_bytes(content + b" ")
    assert run_toy(environment, cache) == ([], warm[1], 0, "")
    assert not trap.exists()
    kernel.write_bytes(content)
    pickle.loads(read_checked(kernel))
    assert trap.exists(), "the trap does not work"
