"""The cache mends or builds again any damaged file; folders that others can write are not used; its size is kept.

Random damage in runs: `fuzz/caches.py`; full and read-only file systems: `test_faults.py`.
"""

import inspect
import json
import os
import random
import stat
import subprocess
import sys
import time
import zipfile
from itertools import product

import pytest
from built_toy import build_toy
from damaged_files import POSIX, damage

from fmus.cache import limit as cache_limit
from fmus.cache.files import UntrustedFolder, cache_folder, private_folder, read_checked, write_checked
from orchestrator.cosim.master import RunOutcome
from orchestrator.execution import precision
from orchestrator.execution.precision import Setting
from orchestrator.execution.truth import FIGURES, LOGS, truth
from orchestrator.fmi.fmu_files import unpack
from orchestrator.scene.scene import load

DAY = 86400.0  # s
DAMAGES = ("flip", "cut", "empty", "delete")


# --- files -----------------------------------------------------------------------------------------


def test_a_kept_file_is_found_whole_or_not_at_all(fresh_cache):
    file = private_folder(fresh_cache / "kind" / "key") / "name"
    assert read_checked(file) is None
    write_checked(file, b"content")
    assert read_checked(file) == b"content"
    whole = file.read_bytes()
    for bit in range(0, 8 * len(whole), 5):
        file.write_bytes(bytes(byte ^ (1 << bit % 8) * (i == bit // 8) for i, byte in enumerate(whole)))
        assert read_checked(file) is None, bit
    for size in range(len(whole)):
        file.write_bytes(whole[:size])
        assert read_checked(file) is None, size
    file.unlink()
    os.mkfifo(file)
    assert read_checked(file) is None, "a pipe was opened"
    write_checked(file, b"content")
    assert read_checked(file) == b"content"
    elsewhere = private_folder(fresh_cache / "kind" / "other key") / "name"
    elsewhere.write_bytes(whole)
    assert read_checked(elsewhere) is None, "the content of another key was accepted"
    file.rename(file.with_name("other"))
    assert read_checked(file.with_name("other")) is None, "the content of another file was accepted"


def as_packed(fmu, folder):
    """Names of files that differ from the content of the FMU."""
    with zipfile.ZipFile(fmu) as archive:
        return [
            name for name in archive.namelist()
            if not (folder / name).is_file() or (folder / name).read_bytes() != archive.read(name)
        ]  # fmt: skip


@pytest.mark.long
def test_an_unpacked_fmu_is_mended(toy, fresh_cache):
    """It takes nothing away from who has a file open."""
    folder, rng = unpack(toy), random.Random(3)
    assert as_packed(toy, folder) == []
    files = [folder / name for name in (
        "modelDescription.xml", "binaries/linux64/Toy.so", "resources/config.json", "resources/toy/kernels.py",
    )]  # fmt: skip
    for file, how in product(files, [*DAMAGES, "flip", "flip"]):
        damage(file, how, rng)
        assert as_packed(toy, folder) != []
        assert unpack(toy) == folder
        assert as_packed(toy, folder) == []
    (folder / "resources" / "written by the fmu.txt").write_text("stays")
    library = folder / "binaries" / "linux64" / "Toy.so"
    with library.open("r+b") as stream:
        stream.write(b"old")
        stream.flush()
        assert unpack(toy) == folder
        stream.seek(0)
        assert stream.read(3) == b"old"
    assert as_packed(toy, folder) == []
    assert (folder / "resources" / "written by the fmu.txt").read_text() == "stays"


def test_no_bytecode_is_run_that_nobody_checks(toy, fresh_cache, tmp_path):
    sources = unpack(toy) / "resources" / "toy"
    code = "import sys; sys.path.insert(0, sys.argv[1]); import toy; print(toy.__cached__)"
    env = {**os.environ, "PYTHONDONTWRITEBYTECODE": "", "PYTHONPATH": ""}
    subprocess.run([sys.executable, "-c", code, sources.parent], env=env, check=True)
    assert (sources / "__pycache__").read_bytes() == b""
    (sources / "__pycache__").unlink()  # Python writes some later
    subprocess.run([sys.executable, "-c", code, sources.parent], env=env, check=True)
    assert list((sources / "__pycache__").iterdir())
    unpack(toy)
    assert (sources / "__pycache__").read_bytes() == b""
    brought = tmp_path / "brought.fmu"
    with zipfile.ZipFile(toy) as source, zipfile.ZipFile(brought, "w") as target:
        for name in source.namelist():
            target.writestr(name, source.read(name))
        target.writestr("resources/toy/__pycache__/model.cpython-311.pyc", b"no code")
    assert (unpack(brought) / "resources" / "toy" / "__pycache__").read_bytes() == b""


@pytest.mark.long
def test_a_damaged_fmu_or_truth_is_built_again(fresh_cache, monkeypatch):
    def written(scene, log, *rest):
        log.write_bytes(log.name.encode() * 100)
        return RunOutcome("ok", "", 0, 0.0), {"internal_step": 1e-6, "wall_time": 1.0}

    monkeypatch.setattr("orchestrator.execution.monolithic.run", written)
    monkeypatch.setattr("orchestrator.execution.truth.differences_of_logs", lambda *logs: {})
    scene, rng = load("hanging_chain", "flexible", ("run.stop=0.02",)), random.Random(4)
    first = truth(scene)
    assert first.built
    for file, how in product((*LOGS, FIGURES), DAMAGES):
        assert not truth(scene).built
        damage(first.log.with_name(file), how, rng)
        assert truth(scene) == first, (file, how)
    fmu = build_toy()
    content = fmu.read_bytes()
    damage(fmu, "flip", rng)
    assert build_toy() == fmu
    assert fmu.read_bytes() == content


def test_a_damaged_table_of_settings_is_left_out_and_named(fresh_cache, caplog):
    file = precision.local_file()
    precision.write([Setting("swing", "flexible", ("run.step=4 ms",), 0.0125, 1.0)], file)
    whole, rng, shipped = file.read_bytes(), random.Random(5), {row.scene for row in precision.read(precision.SHIPPED)}
    assert precision.cheapest("swing", "flexible", 0.1).error == 0.0125
    for how in ("flip", "cut", "empty") * 40:
        file.write_bytes(whole)
        damage(file, how, rng)
        caplog.clear()
        rows = [row for row in precision.read() if row.scene not in shipped]
        if rows:  # a blank was changed to another one
            assert rows[0].error == 0.0125
            assert json.loads(file.read_bytes()) == json.loads(whole)
        else:
            assert f"the table {file} is damaged and is left out" in caplog.text
    for make in (os.mkfifo, lambda file: file.write_text("[" * 100_000)):  # a pipe, a deep text
        file.unlink()
        make(file)
        assert precision.read(file) == []


# --- folders ---------------------------------------------------------------------------------------


@POSIX
def test_folders_are_made_for_their_user_alone(toy, tmp_path, monkeypatch):
    monkeypatch.setenv("COTRACK_CACHE", str(tmp_path / "a" / "b"))
    before = os.umask(0)
    try:
        unpack(toy)
    finally:
        os.umask(before)
    folders = [path for path in tmp_path.rglob("*") if path.is_dir()]
    assert len(folders) > 20
    assert {stat.S_IMODE(path.stat().st_mode) for path in folders} == {0o700}


@POSIX
@pytest.mark.parametrize("level", range(3))
def test_what_others_can_write_or_own_is_not_trusted(fresh_cache, level, monkeypatch):
    place = private_folder(fresh_cache / "kind" / "key")
    write_checked(place / "file", b"content")
    folder = (place, *place.parents)[level]
    for mode in (0o720, 0o702, 0o777):
        folder.chmod(mode)
        for call in (private_folder, lambda place: read_checked(place / "file")):
            with pytest.raises(UntrustedFolder) as caught:
                call(place)
            assert str(caught.value).startswith(f"others can write into {folder} (mode {mode:o}); chmod -R go-w it, ")
    folder.chmod(0o755)
    assert read_checked(place / "file") == b"content"
    me = os.geteuid()
    monkeypatch.setattr(os, "geteuid", lambda: me + 1)
    if me:  # files of root are trusted
        with pytest.raises(UntrustedFolder, match=rf"belongs to another user \({me}\); name a folder of your own"):
            private_folder(place)


# --- size -------------------------------------------------------------------------------------------


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
    deep = filled[3].joinpath(*["d"] * 200)
    deep.mkdir(parents=True)
    (deep / "file").write_bytes(bytes(300))
    most = sys.getrecursionlimit()
    sys.setrecursionlimit(len(inspect.stack(0)) + 100)
    try:
        found = {entry.folder: entry.size for entry in cache_limit.entries()}
    finally:
        sys.setrecursionlimit(most)
    assert found == {folder: 1300 if folder == filled[3] else 1000 for folder in filled}


def test_every_use_counts_and_what_was_used_in_the_last_day_stays(filled, toy):
    old = time.time() - 5 * DAY
    folder = unpack(toy)
    for use, used in (
        (lambda: unpack(toy), folder),
        (lambda: private_folder(filled[0]), filled[0]),
        (lambda: read_checked(filled[1] / "a"), filled[1]),
    ):
        os.utime(used, (old, old))
        use()
        assert time.time() - used.stat().st_mtime < 60.0
    assert {entry.folder for entry in cache_limit.prune(0.0)} == {*filled[2:]}


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
