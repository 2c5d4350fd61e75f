"""A pack of kernels: the first run and the first instance of a Python FMU compile nothing, to the same bits."""

import os
import shutil
import subprocess
import sys
import zipfile

import pytest
from conftest import ROOT

from fmus.vehicles.tables import BadInput
from orchestrator.execution import warm

SCENE = ("sprocket_bench", "--track", "rigid")
RUN = ("run", *SCENE, "--stop", "0.02", "--no-estimate", "--set", "expect={}", "-o", "log.mcap")
MAKE = """
from pathlib import Path
from orchestrator.execution.warm import packed
if __name__ == "__main__":
    [*packed([("sprocket_bench", "rigid")], Path("made.pack"))]
"""
INSTANCE = """
import sys
from fmpy import simulate_fmu
print(len(simulate_fmu(sys.argv[1], stop_time=0.002, step_size=0.001, output_interval=0.001)))
"""
PACKED = """
import sys
from fmus.cache import pack
print(sum(pack.read(name) is not None for name in pack.names()))
"""
BEFORE = """
from fmus.cache import pack
pack.FEATURES += {lacking}
from fmus.kernels.jit import compiled_before
from fmus.track_rigid.model import Model
print(compiled_before(Model.step_kernel))
"""


def python(tree, place, *arguments, cache="cache"):
    """Output of Python with the sources of a tree and a cache of its own in ``place``."""
    environment = {**os.environ, "PYTHONPATH": str(tree), "COTRACK_CACHE": str(place / cache)}
    done = subprocess.run([sys.executable, *arguments], cwd=place, env=environment, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return done.stdout


def compiled(place, cache="cache"):
    return [file.name for file in (place / cache / "kernels").rglob("*.kernel")]


@pytest.fixture(scope="module")
def tree(tmp_path_factory):
    """A copy of the sources with a pack of one scene."""
    tree = tmp_path_factory.mktemp("tree")
    for folder in ("fmus", "orchestrator"):
        shutil.copytree(ROOT / folder, tree / folder, ignore=shutil.ignore_patterns("__pycache__", "*.pack"))
    (tree / "make.py").write_text(MAKE)
    python(tree, tree, "make.py")
    (tree / "made.pack").rename(tree / "fmus" / "made.pack")
    return tree


@pytest.mark.study
def test_the_first_run_compiles_nothing_and_has_the_same_bits(tree, tmp_path):
    python(tree, tmp_path, "-m", "orchestrator", *RUN)
    digest = python(tree, tmp_path, "-m", "orchestrator", "log", "info", "log.mcap").partition("digest")[2].split()[0]
    assert compiled(tmp_path) == []
    other = tmp_path / "other"
    other.mkdir()
    (ours := dict(os.environ)).pop("COTRACK_CACHE", None)
    subprocess.run([sys.executable, "-m", "orchestrator", *RUN], cwd=other, env={**ours, "PYTHONPATH": str(ROOT)})
    assert digest in python(ROOT, other, "-m", "orchestrator", "log", "info", "log.mcap")


@pytest.mark.study
def test_a_python_fmu_carries_its_kernels(tree, tmp_path):
    python(tree, tmp_path, "-m", "orchestrator", "build", *SCENE, "-o", ".")
    (fmu,) = tmp_path.glob("TrackRigid*.fmu")
    with zipfile.ZipFile(fmu) as files:
        assert "resources/fmus/kernels.pack" in files.namelist()
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    assert int(python(elsewhere, elsewhere, "-c", INSTANCE, str(fmu))) == 3
    assert compiled(elsewhere) == []


@pytest.mark.study
def test_a_pack_that_does_not_fit_is_not_used(tree, tmp_path):
    """On a processor below the level, with other sources, and with damage."""
    assert python(tree, tmp_path, "-c", BEFORE.format(lacking=())).strip() == "True"
    assert python(tree, tmp_path, "-c", BEFORE.format(lacking=("of-a-later-processor",))).strip() == "False"
    named = "import os; os.environ['NUMBA_CPU_NAME'] = 'x86-64-v3'\n"  # as where a pack is made: it needs no other
    assert int(python(tree, tmp_path, "-c", named + PACKED)) == 0
    copy = shutil.copytree(tree, tmp_path / "copy")
    with (copy / "fmus" / "physics" / "elementary.py").open("a") as source:
        source.write("# changed\n")
    assert python(copy, tmp_path, "-c", BEFORE.format(lacking=())).strip() == "False"
    whole = int(python(tree, tmp_path, "-c", PACKED))
    assert whole > 5
    pack = copy / "fmus" / "made.pack"
    content = bytearray(pack.read_bytes())
    with zipfile.ZipFile(pack) as files:
        largest = max(files.infolist(), key=lambda one: one.compress_size)
    content[largest.header_offset + largest.compress_size // 2] ^= 4
    pack.write_bytes(content)
    assert int(python(copy, tmp_path, "-c", PACKED)) == whole - 1
    pack.write_bytes(content[: len(content) // 2])
    assert int(python(copy, tmp_path, "-c", PACKED)) == 0


def test_a_scene_that_does_not_start_leaves_no_pack(tmp_path, monkeypatch):
    monkeypatch.setattr(warm, "warm", lambda pairs: iter([("one", "", 1.0), ("two", "no convergence", 2.0)]))
    file, before = tmp_path / "a.pack", dict(os.environ)
    steps = warm.packed([("one", "rigid"), ("two", "rigid")], file)
    assert [next(steps)[0], next(steps)[0]] == ["one", "two"]
    with pytest.raises(BadInput, match=r"a\.pack: no pack is written: two does not start"):
        next(steps)
    assert not [*tmp_path.iterdir()]
    assert dict(os.environ) == before
