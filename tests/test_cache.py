"""The cache recovers from any damage to its files, and folders that others can write are not used."""

import errno
import inspect
import json
import logging
import os
import pickle
import random
import shutil
import stat
import subprocess
import sys
import zipfile
from collections import Counter
from itertools import product
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
from conftest import build_toy

import fmus.cache
import orchestrator.kernels.cache
from fmus.jit import _Overloads
from fmus.vehicle import BadInput
from orchestrator.cosim.fmu_files import unpack
from orchestrator.execution import precision
from orchestrator.execution.precision import Setting
from orchestrator.execution.truth import FIGURES, LOGS, _hashes, truth
from orchestrator.log.reader import Log
from orchestrator.scene.scene import load

POSIX = pytest.mark.skipif(os.name == "nt", reason="no owners and modes there")
DAMAGES = ("flip", "cut", "empty", "delete")


def damage(file, how, rng):
    """Damage a file in place, as a bad disk does: processes that have it open see the damage."""
    content = bytearray(file.read_bytes())
    if how == "delete":
        file.unlink()
        return
    if how == "flip":
        at = rng.randrange(8 * len(content))
        content[at // 8] ^= 1 << at % 8
    with file.open("r+b") as stream:
        stream.write(content)
        stream.truncate({"flip": len(content), "cut": rng.randrange(1, len(content)), "empty": 0}[how])


@pytest.fixture(autouse=True)
def _nothing_said_yet(monkeypatch):
    monkeypatch.setattr(fmus.cache, "_reported", set())
    monkeypatch.setattr(fmus.cache, "_unlogged", [])


def test_both_packages_say_the_same():
    for name, one in vars(orchestrator.kernels.cache).items():
        if getattr(one, "__module__", None) == "orchestrator.kernels.cache":
            assert inspect.getsource(one) == inspect.getsource(getattr(fmus.cache, name)), name
    assert orchestrator.kernels.cache.OTHERS == fmus.cache.OTHERS


# --- files -----------------------------------------------------------------------------------------


def test_a_kept_file_is_found_whole_or_not_at_all(fresh_cache):
    file = fmus.cache.private_folder(fresh_cache / "kind" / "key") / "name"
    assert fmus.cache.read_checked(file) is None
    fmus.cache.write_checked(file, b"content")
    assert fmus.cache.read_checked(file) == b"content"
    whole = file.read_bytes()
    for bit in range(0, 8 * len(whole), 5):
        file.write_bytes(bytes(byte ^ (1 << bit % 8) * (i == bit // 8) for i, byte in enumerate(whole)))
        assert fmus.cache.read_checked(file) is None, bit
    for size in range(len(whole)):
        file.write_bytes(whole[:size])
        assert fmus.cache.read_checked(file) is None, size
    file.write_bytes(whole)
    assert fmus.cache.read_checked(file) == b"content"
    file.rename(file.with_name("other"))
    assert fmus.cache.read_checked(file.with_name("other")) is None, "the content of another file was accepted"


def test_a_damaged_kernel_is_not_unpickled(fresh_cache, monkeypatch):
    overloads = _Overloads(fmus.cache.private_folder(fresh_cache / "kernels" / "module"), "kernel", "stamp")
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
    overloads = _Overloads(fmus.cache.private_folder(fresh_cache / "kernels" / "module"), "kernel", "stamp")
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
    assert fmus.cache.read_checked(fmu) is None
    assert build_toy() == fmu
    with zipfile.ZipFile(fmu) as archive:
        again = {name: archive.read(name) for name in archive.namelist()}
    assert {name for name in packed if again[name] != packed[name]} <= {"modelDescription.xml"}, "only its date differs"
    assert fmus.cache.read_checked(fmu) is not None


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
        fmus.cache.write_checked(folder / FIGURES, json.dumps(figures).encode())
        return figures

    return build


def test_a_damaged_table_of_settings_is_left_out_and_named(fresh_cache, caplog):
    precision.write([Setting("swing", "flexible", ("run.step=4 ms",), 0.0125, 1.0)], precision.local_file())
    file = precision.local_file()
    whole, rng = file.read_bytes(), random.Random(5)
    assert precision.cheapest("swing", "flexible", 0.1).error == 0.0125
    for how in ("flip", "cut", "empty") * 40:
        file.write_bytes(whole)
        damage(file, how, rng)
        caplog.clear()
        rows = [row for row in precision.read() if row.scene not in ("straight", "hard_stop", "rig", "hanging_chain")]
        if rows:  # a blank was changed to another one
            assert rows[0].error == 0.0125
            assert json.loads(file.read_bytes()) == json.loads(whole)
        else:
            assert f"the table {file} is damaged and is left out" in caplog.text
    assert file.read_bytes() != whole


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
    place = fmus.cache.private_folder(fresh_cache / "kind" / "key")
    fmus.cache.write_checked(place / "file", b"content")
    folder = (place, *place.parents)[level]
    for mode in (0o720, 0o702, 0o777):
        folder.chmod(mode)
        for call in (fmus.cache.private_folder, lambda place: fmus.cache.read_checked(place / "file")):
            with pytest.raises(fmus.cache.UntrustedFolder) as caught:
                call(place)
            assert str(caught.value).startswith(f"others can write into {folder} (mode {mode:o}); chmod -R go-w it, ")
    folder.chmod(0o755)
    assert fmus.cache.read_checked(place / "file") == b"content"
    me = os.geteuid()
    monkeypatch.setattr(os, "geteuid", lambda: me + 1)
    if me:  # files of root are trusted
        with pytest.raises(
            fmus.cache.UntrustedFolder, match=rf"belongs to another user \({me}\); name a folder of your own"
        ):
            fmus.cache.private_folder(place)


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
    fmus.cache.write_checked(kernel, pickle.dumps(Trap(trap)))
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
    pickle.loads(fmus.cache.read_checked(kernel))
    assert trap.exists(), "the trap does not work"


# --- runs without a cache ---------------------------------------------------------------------------


@pytest.fixture
def full(tmp_path, monkeypatch):
    """A cache on a full disk."""
    place = tmp_path / "full"
    monkeypatch.setenv("COTRACK_CACHE", str(place))
    put = fmus.cache.write

    def write(file, content):
        if file.is_relative_to(place):
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(file))
        put(file, content)

    for module in ("fmus.cache", "orchestrator.kernels.cache", "orchestrator.cosim.fmu_files"):
        monkeypatch.setattr(f"{module}.write", write)
    return place


@pytest.mark.long
def test_without_a_cache_fmus_are_built_and_unpacked_for_this_process(full, caplog):
    fmu = build_toy()
    assert build_toy() == fmu
    folder = unpack(fmu)
    assert as_packed(fmu, folder) == []
    for place, module in ((fmu, fmus.cache), (folder, orchestrator.kernels.cache)):
        assert place.is_relative_to(module.temporary_folder())
    (record,) = caplog.records
    assert record.levelno == logging.WARNING
    assert record.getMessage().startswith(
        f"the cache folder {full} cannot be used, so every process compiles and builds anew: {full}/"
    )
    assert record.getMessage().endswith("/toy_fmu.fmu: No space left on device")


def test_a_truth_needs_a_cache(full, monkeypatch):
    monkeypatch.setattr("orchestrator.execution.truth._build", built_of(Counter()))
    with pytest.raises(BadInput, match=r"^truth: it cannot be kept in the cache: .*/truth.json: No space left"):
        truth(short_chain())


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
    fmus.cache.make_folder(precision_table.parent)
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
