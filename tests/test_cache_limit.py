"""The cache is kept below its largest size; what was used longest ago goes first, and nothing of others."""

import inspect
import os
import sys
import time

import pytest

from fmus.cache import limit as cache_limit
from fmus.cache.files import cache_folder, private_folder, read_checked, write_checked
from orchestrator.cosim.fmu_files import unpack

DAY = 86400.0


@pytest.fixture
def filled(fresh_cache):
    """Folders of 1 kB, used 10, 9, ... 1 days ago, and things of others beside them."""
    folders = []
    for k in range(10):
        folder = private_folder(cache_folder() / ("fmus", "numbers")[k % 2] / f"{k:024x}")
        write_checked(folder / "a", bytes(1000 - 64))
        used = time.time() - (10 - k) * DAY
        os.utime(folder, (used, used))
        folders.append(folder)
    for other in ("pictures/0123456789abcdef01234567", "fmus/mine", "kernels/ahead"):
        (cache_folder() / other).mkdir(parents=True)
        (cache_folder() / other / "kept").write_bytes(bytes(5000))
    return folders


def test_what_was_used_longest_ago_goes_first(filled):
    assert [entry.folder for entry in cache_limit.entries()] == filled
    removed = cache_limit.prune(6500.0, 0.0)
    assert [entry.folder for entry in removed] == filled[:4]
    assert [folder.exists() for folder in filled] == [False] * 4 + [True] * 6
    assert {file.parent.name for file in cache_folder().rglob("kept")} == {"0123456789abcdef01234567", "mine", "ahead"}
    assert not list(cache_folder().rglob("*.removed"))


def test_a_folder_deeper_than_the_stack_is_measured(filled):
    deep = filled[3]
    for _ in range(200):
        deep = deep / "d"
        deep.mkdir()
    (deep / "file").write_bytes(bytes(300))
    most = sys.getrecursionlimit()
    sys.setrecursionlimit(len(inspect.stack(0)) + 100)
    try:
        found = {entry.folder: entry.size for entry in cache_limit.entries()}
    finally:
        sys.setrecursionlimit(most)
    assert found == {folder: 1300 if folder == filled[3] else 1000 for folder in filled}


def test_what_was_used_in_the_last_day_stays(filled):
    assert read_checked(filled[0] / "a") is not None  # a use
    assert len(cache_limit.prune(0.0)) == 9
    assert filled[0].exists()


def test_every_use_counts(filled, toy):
    old = time.time() - 5 * DAY
    folder = unpack(toy)
    for used in (folder, filled[0]):
        os.utime(used, (old, old))
    unpack(toy)
    private_folder(filled[0])
    for used in (folder, filled[0]):
        assert time.time() - used.stat().st_mtime < 60.0


@pytest.mark.parametrize(("text", "said"), [("-1", "must be a size in GB"), ("many", "'many'"), ("nan", "0 or more")])
def test_a_bad_size_is_a_sentence(fresh_cache, cotrack, monkeypatch, text, said):
    monkeypatch.setenv(cache_limit.SIZE, text)
    assert said in cotrack.refused("cache")


def test_commands_keep_the_size(filled, cotrack, monkeypatch):
    monkeypatch.setenv(cache_limit.SIZE, "4.5e-6")
    assert "fmus" in cotrack.done("cache")
    assert len(cache_limit.entries()) == 4  # pruned at the end of the command
    os.utime(filled[9], (time.time() - 20 * DAY,) * 2)
    monkeypatch.setenv(cache_limit.SIZE, "0")
    cotrack("cache")
    assert len(cache_limit.entries()) == 4  # not looked at again within the hour
    status, out, _ = cotrack("cache", "--prune", "--most", "0")
    assert (status, len(cache_limit.entries())) == (0, 0)
    assert "removed 4 folders" in out
