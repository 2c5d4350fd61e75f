"""The cache mends or builds again any damaged file, and folders that others can write are not used."""

import errno
import json
import logging
import os
import pickle
import random
import stat
import subprocess
import sys
import zipfile
from collections import Counter
from itertools import product

import pytest
from conftest import build_toy
from damaged_files import DAMAGES, POSIX, damage, forget_notices

import fmus.cache.files
from fmus.kernels.jit import _Overloads
from fmus.vehicles.tables import BadInput
from orchestrator.cosim.fmu_files import unpack
from orchestrator.execution import precision
from orchestrator.execution.precision import Setting
from orchestrator.execution.truth import FIGURES, LOGS, _hashes, truth
from orchestrator.scene.scene import load

_nothing_said_yet = pytest.fixture(autouse=True)(forget_notices)


# --- files -----------------------------------------------------------------------------------------


def test_a_kept_file_is_found_whole_or_not_at_all(fresh_cache):
    file = fmus.cache.files.private_folder(fresh_cache / "kind" / "key") / "name"
    assert fmus.cache.files.read_checked(file) is None
    fmus.cache.files.write_checked(file, b"content")
    assert fmus.cache.files.read_checked(file) == b"content"
    whole = file.read_bytes()
    for bit in range(0, 8 * len(whole), 5):
        file.write_bytes(bytes(byte ^ (1 << bit % 8) * (i == bit // 8) for i, byte in enumerate(whole)))
        assert fmus.cache.files.read_checked(file) is None, bit
    for size in range(len(whole)):
        file.write_bytes(whole[:size])
        assert fmus.cache.files.read_checked(file) is None, size
    file.write_bytes(whole)
    assert fmus.cache.files.read_checked(file) == b"content"
    file.unlink()
    os.mkfifo(file)
    assert fmus.cache.files.read_checked(file) is None, "a pipe was opened"
    fmus.cache.files.write_checked(file, b"content")
    assert fmus.cache.files.read_checked(file) == b"content"
    elsewhere = fmus.cache.files.private_folder(fresh_cache / "kind" / "other key") / "name"
    elsewhere.write_bytes(whole)
    assert fmus.cache.files.read_checked(elsewhere) is None, "the content of another key was accepted"
    file.rename(file.with_name("other"))
    assert fmus.cache.files.read_checked(file.with_name("other")) is None, "the content of another file was accepted"


def test_a_damaged_kernel_is_not_unpickled(fresh_cache, monkeypatch):
    overloads = _Overloads(fmus.cache.files.private_folder(fresh_cache / "kernels" / "module"), "kernel", "stamp")
    overloads.save("signature", list(range(2000)))
    assert overloads.load("signature") == list(range(2000))
    (file,) = (fresh_cache / "kernels" / "module").iterdir()
    whole, rng = file.read_bytes(), random.Random(1)
    monkeypatch.setattr(pickle, "loads", lambda content: "unpickled")
    assert overloads.load("signature") == "unpickled"
    for how in [*DAMAGES, *["flip"] * 100]:
        file.write_bytes(whole)
        damage(file, how, rng)
        assert overloads.load("signature") is None, how


def test_a_kernel_is_that_of_its_compiler(fresh_cache, monkeypatch):
    overloads = _Overloads(fmus.cache.files.private_folder(fresh_cache / "kernels" / "module"), "kernel", "stamp")
    overloads.save("signature", 1)
    for place, value in (
        ("numba.__version__", "1"), ("llvmlite.__version__", "1"), ("numpy.__version__", "3"),
        ("numba.config.OPT", 0), ("numba.config.USING_SVML", "?"),
    ):  # fmt: skip
        with monkeypatch.context() as other:
            other.setattr(place, value)
            assert overloads.load("signature") is None, place
    assert overloads.load("signature") == 1


@pytest.mark.long
def test_a_damaged_fmu_is_built_again(fresh_cache):
    fmu = build_toy()
    with zipfile.ZipFile(fmu) as archive:
        packed = {name: archive.read(name) for name in archive.namelist()}
    damage(fmu, "flip", random.Random(2))
    assert fmus.cache.files.read_checked(fmu) is None
    assert build_toy() == fmu
    with zipfile.ZipFile(fmu) as archive:
        again = {name: archive.read(name) for name in archive.namelist()}
    assert {name for name in packed if again[name] != packed[name]} <= {"modelDescription.xml"}, "only its date differs"
    assert fmus.cache.files.read_checked(fmu) is not None


def as_packed(fmu, folder):
    """Names of files that differ from the content of the FMU."""
    with zipfile.ZipFile(fmu) as archive:
        return [
            name for name in archive.namelist()
            if not (folder / name).is_file() or (folder / name).read_bytes() != archive.read(name)
        ]  # fmt: skip


def test_an_unpacked_fmu_is_mended(toy, fresh_cache):
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


def test_mending_takes_nothing_away_from_who_has_it_open(toy, fresh_cache):
    folder = unpack(toy)
    (folder / "resources" / "written by the fmu.txt").write_text("stays")
    library = folder / "binaries" / "linux64" / "Toy.so"
    with library.open("r+b") as stream:
        stream.write(b"old")
        stream.flush()
        assert unpack(toy) == folder
        stream.seek(0)
        assert stream.read(3) == b"old"
    assert library.read_bytes()[:3] != b"old"
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


def test_a_damaged_truth_is_built_again(fresh_cache, monkeypatch):
    monkeypatch.setattr("orchestrator.execution.truth._build", built_of(counter := Counter()))
    scene = short_chain()
    first = truth(scene)
    assert (first.built, counter["built"]) == (True, 1)
    rng = random.Random(4)
    for file, how in product((*LOGS, FIGURES), DAMAGES):
        assert not truth(scene).built
        damage(first.log.with_name(file), how, rng)
        again = truth(scene)
        assert again.built, (file, how)
        assert again._replace(built=False) == truth(scene)


def short_chain():
    return load("hanging_chain", "flexible", ("run.stop=0.02",))


def built_of(counter):
    """Substitute for the monolith: the two logs, their hashes and some figures."""

    def build(scene, folder, title):
        counter["built"] += 1
        for name in LOGS:
            (folder / name).write_bytes(name.encode() * 100)
        figures = {"internal_step": 1e-6, "wall_time": 1.0, "difference": {}, "sha256": _hashes(folder)}
        fmus.cache.files.write_checked(folder / FIGURES, json.dumps(figures).encode())
        return figures

    return build


def test_a_damaged_table_of_settings_is_left_out_and_named(fresh_cache, caplog):
    precision.write([Setting("swing", "flexible", ("run.step=4 ms",), 0.0125, 1.0)], precision.local_file())
    file = precision.local_file()
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
    assert file.read_bytes() != whole


@POSIX
@pytest.mark.parametrize("make", [os.mkfifo, lambda file: file.write_text("[" * 100_000)])
def test_a_pipe_or_a_deep_text_in_place_of_the_table_is_left_out(fresh_cache, caplog, make):
    file = precision.local_file()
    precision.write([], file)
    file.unlink()
    make(file)
    assert precision.read(file) == []
    assert f"the table {file} is damaged and is left out" in caplog.text


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
    place = fmus.cache.files.private_folder(fresh_cache / "kind" / "key")
    fmus.cache.files.write_checked(place / "file", b"content")
    folder = (place, *place.parents)[level]
    for mode in (0o720, 0o702, 0o777):
        folder.chmod(mode)
        for call in (fmus.cache.files.private_folder, lambda place: fmus.cache.files.read_checked(place / "file")):
            with pytest.raises(fmus.cache.files.UntrustedFolder) as caught:
                call(place)
            assert str(caught.value).startswith(f"others can write into {folder} (mode {mode:o}); chmod -R go-w it, ")
    folder.chmod(0o755)
    assert fmus.cache.files.read_checked(place / "file") == b"content"
    me = os.geteuid()
    monkeypatch.setattr(os, "geteuid", lambda: me + 1)
    if me:  # files of root are trusted
        with pytest.raises(
            fmus.cache.files.UntrustedFolder, match=rf"belongs to another user \({me}\); name a folder of your own"
        ):
            fmus.cache.files.private_folder(place)


# --- runs without a cache ---------------------------------------------------------------------------


@pytest.fixture
def full(tmp_path, monkeypatch):
    """A cache on a full disk."""
    place = tmp_path / "full"
    monkeypatch.setenv("COTRACK_CACHE", str(place))
    put = fmus.cache.files.write

    def write(file, content):
        if file.is_relative_to(place):
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(file))
        put(file, content)

    for module in ("fmus.cache.files", "orchestrator.cosim.fmu_files"):
        monkeypatch.setattr(f"{module}.write", write)
    return place


@pytest.mark.long
def test_without_a_cache_fmus_are_built_and_unpacked_for_this_process(full, caplog):
    fmu = build_toy()
    assert build_toy() == fmu
    folder = unpack(fmu)
    assert as_packed(fmu, folder) == []
    assert fmu.is_relative_to(fmus.cache.files.temporary_folder())
    assert folder.is_relative_to(fmus.cache.files.temporary_folder())
    (record,) = caplog.records
    assert record.levelno == logging.WARNING
    assert record.getMessage().startswith(
        f"the cache folder {full} cannot be used, so every process compiles and builds anew: {full}/"
    )
    assert record.getMessage().endswith("/toy_fmu.fmu: No space left on device")


def test_a_home_that_is_not_there_is_one_sentence(tmp_path, environment):
    command = [sys.executable, "-m", "orchestrator", "scenes"]
    env = {**environment, "COTRACK_CACHE": "~nouser/x"}
    done = subprocess.run(command, env=env, cwd=tmp_path, capture_output=True, text=True)
    assert (done.returncode, len(done.stderr.splitlines())) == (0, 1), done.stderr
    assert done.stderr.startswith("the cache folder ~nouser/x cannot be found")
    assert "straight" in done.stdout
    assert [*tmp_path.iterdir()] == []


def test_a_truth_needs_a_cache(full, monkeypatch):
    monkeypatch.setattr("orchestrator.execution.truth._build", built_of(Counter()))
    with pytest.raises(BadInput, match=r"^truth: it cannot be kept in the cache: .*/truth.json: No space left"):
        truth(short_chain())
