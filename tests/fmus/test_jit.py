"""Kernels are found by content: at any path, and not after an edit of a function that they call."""

import os
import shutil
import subprocess
import sys
import types
from pathlib import Path

import pytest

from fmus.cache import sources
from fmus.cache.files import temporary_folder
from fmus.kernels import jit

MODULES = {
    "__init__.py": "",
    "caller.py": """
from fmus.kernels.jit import kernel
from parts.deep.callee import factor
@kernel
def scaled(x):
    return factor(x) * x
""",
    "deep/__init__.py": "",
    "deep/callee.py": """
from fmus.kernels.jit import kernel
@kernel
def factor(x):
    return 2.0 + 0.0 * x
""",
    "bystander.py": "LIMIT = 1\n",
}
RUN = """
from parts.caller import scaled
value = scaled(3.0)
stats = scaled.stats
print(value, sum(stats.cache_hits.values()), sum(stats.cache_misses.values()))
"""


@pytest.fixture
def parts(tmp_path):
    for name, text in MODULES.items():
        path = tmp_path / "here" / "parts" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    return tmp_path / "here"


@pytest.fixture
def run(environment, tmp_path):
    def run(where, **more):
        env = {**environment, "COTRACK_CACHE": str(tmp_path / "cache"), **more}
        env["PYTHONPATH"] = f"{where}:{env['PYTHONPATH']}"
        done = subprocess.run([sys.executable, "-c", RUN], env=env, capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
        value, hits, misses = done.stdout.split()
        return float(value), int(hits), int(misses)

    return run


@pytest.mark.long
def test_kernel_is_found_at_another_path_and_not_after_an_edit_of_its_callee(parts, run, tmp_path):
    assert run(parts) == (6.0, 0, 1)
    assert run(parts) == (6.0, 1, 0)

    elsewhere = shutil.copytree(parts, tmp_path / "elsewhere")
    (elsewhere / "parts" / "bystander.py").write_text("LIMIT = 2\n")  # not imported by the kernel
    assert run(elsewhere) == (6.0, 1, 0)

    callee = elsewhere / "parts" / "deep" / "callee.py"
    callee.write_text(callee.read_text().replace("2.0 +", "5.0 +"))
    assert run(elsewhere) == (15.0, 0, 1)
    assert run(parts) == (6.0, 1, 0)  # the old value is right at the old path


@pytest.mark.long
def test_damaged_or_forbidden_cache_only_costs_time(parts, run, tmp_path):
    assert run(parts) == (6.0, 0, 1)
    kept = list((tmp_path / "cache" / "kernels").rglob("*.kernel"))
    assert kept
    for path in kept:
        path.write_bytes(path.read_bytes()[:100])
    assert run(parts) == (6.0, 0, 1)
    (tmp_path / "file").write_text("")
    assert run(parts, COTRACK_CACHE=str(tmp_path / "file" / "cache")) == (6.0, 0, 1)


BEYOND = """
import numpy as np
from toy.kernels import advance
try:
    advance(np.zeros(2)[:1], 1, 1e-3, 1.0, 1.0, 0.0)  # writes two numbers
except IndexError as error:
    print(error)
"""


@pytest.mark.long
def test_indices_are_checked_when_asked_for_whatever_is_cached(environment):
    said = []
    for more in ({}, {"NUMBA_BOUNDSCHECK": "1"}, {}, {"NUMBA_BOUNDSCHECK": "1"}):
        done = subprocess.run(
            [sys.executable, "-c", BEYOND], env={**environment, **more}, capture_output=True, text=True, check=True
        )
        said.append(done.stdout.strip())
    assert said == ["", "index is out of bounds"] * 2


def test_without_compilation_the_function_itself_comes_back(environment):
    code = "from toy.kernels import acceleration as f; assert type(f).__name__ == 'function'; f(1,2,3,4,5)"
    env = {**environment, "NUMBA_DISABLE_JIT": "1"}
    assert subprocess.run([sys.executable, "-c", code], env=env).returncode == 0


def test_reachable_sources_follow_every_kind_of_import(tmp_path, monkeypatch, clean_imports):
    package = tmp_path / "reach"
    (package / "sub").mkdir(parents=True)
    for name in ("__init__", "plain", "named", "inside", "guarded", "sub/__init__", "sub/near", "sub/up", "far"):
        (package / f"{name}.py").write_text("")
    (package / "start.py").write_text(
        "import reach.plain as p\nfrom reach import named\nfrom .sub import near\n"
        "def f():\n    import reach.inside\n"
        "try:\n    pass\nexcept ValueError:\n    import reach.guarded\n"
    )
    (package / "sub" / "near.py").write_text("from .. import sub\nfrom ..sub.up import *\n")
    monkeypatch.syspath_prepend(str(tmp_path))
    import reach

    assert reach

    def fingerprint():
        sources.reachable_hash.cache_clear()
        sources._source.cache_clear()
        return sources.reachable_hash("reach.start", package / "start.py")

    first = fingerprint()
    for name in ("__init__", "plain", "named", "inside", "guarded", "sub/__init__", "sub/near", "sub/up"):
        path = package / f"{name}.py"
        text = path.read_text()
        path.write_text(text + "# edited\n")
        assert fingerprint() != first, name
        path.write_text(text)
    (package / "far.py").write_text("# edited\n")
    assert fingerprint() == first


def test_a_kernel_is_hashed_with_its_callees_when_its_package_was_loaded_from_elsewhere(parts, monkeypatch):
    """A kernel is hashed with its callees even if its package was loaded from a folder that is gone.

    A tool may have deleted the first of its FMUs. An edit of the callee changes the hash all the same.
    """
    caller = parts / "parts" / "caller.py"
    monkeypatch.setitem(sys.modules, "parts", types.ModuleType("parts"))
    hashes = []
    for folder in (parts / "parts", parts / "gone"):
        sys.modules["parts"].__path__ = [str(folder)]
        hashes.append(sources.reachable_hash.__wrapped__("parts.caller", caller))
    (parts / "parts" / "deep" / "callee.py").write_text("factor = 3\n")
    sources._source.cache_clear()  # of this process
    hashes.append(sources.reachable_hash.__wrapped__("parts.caller", caller))
    assert hashes[0] == hashes[1] != hashes[2]


def test_source_hash_sees_names_and_contents_of_sources_only(tmp_path):
    (tmp_path / "a.py").write_text("x = 1\n")
    first = sources.source_hash(tmp_path)
    (tmp_path / "__pycache__").mkdir()
    (tmp_path / "__pycache__" / "a.pyc").write_bytes(b"x")
    (tmp_path / "notes.md").write_text("x")
    assert sources.source_hash(tmp_path) == first
    (tmp_path / "a.py").rename(tmp_path / "b.py")
    assert sources.source_hash(tmp_path) != first
    (tmp_path / "b.py").rename(tmp_path / "a.py")
    assert sources.source_hash(tmp_path) == first
    (tmp_path / "a.py").write_text("x = 2\n")
    assert sources.source_hash(tmp_path) != first


def test_cache_folder_is_the_chosen_one_or_the_users(monkeypatch):
    monkeypatch.setenv("COTRACK_CACHE", "/somewhere/else")
    assert jit.cache_folder() == Path("/somewhere/else")
    monkeypatch.delenv("COTRACK_CACHE")
    assert jit.cache_folder().name == "cotrack"


@pytest.mark.parametrize("chosen", ["~nouser/x", "", "gone"])
def test_a_cache_folder_that_cannot_be_found_is_a_temporary_one(monkeypatch, tmp_path, caplog, chosen):
    """A user who does not exist or has no home, a working folder that is gone; children use the same folder."""
    monkeypatch.setenv("COTRACK_CACHE", chosen)
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    if chosen == "":
        assert jit.cache_folder() == tmp_path / "home" / ".cache" / "cotrack"
        monkeypatch.delenv("HOME")
        monkeypatch.setattr("pwd.getpwuid", {}.__getitem__)
    if chosen == "gone":
        (tmp_path / "gone").mkdir()
        monkeypatch.chdir(tmp_path / "gone")
        (tmp_path / "gone").rmdir()
    assert jit.cache_folder() == temporary_folder() == Path(os.environ["COTRACK_CACHE"]) == jit.cache_folder()
    (record,) = caplog.records
    named = chosen or "~/.cache/cotrack"
    assert record.getMessage().startswith(f"the cache folder {named} cannot be found, so every command compiles")


ANNOUNCED = """
import logging, sys
from pathlib import Path
from orchestrator.cosim.component import Component

events = []
class Heard(logging.Handler):
    def emit(self, record):
        events.append("kernel")

logging.getLogger("cotrack.kernels").addHandler(Heard())
logging.getLogger("cotrack.kernels").setLevel(logging.INFO)
with Component(Path(sys.argv[1]), "toy", lambda name, status, message: events.append(message)) as toy:
    toy.initialise({})
    toy.step(0.0, 1e-3)
print(*events, sep="|")
"""


@pytest.mark.long
def test_an_fmu_says_before_it_compiles(toy, environment, tmp_path):
    """An FMU announces once per machine that it compiles, and logs each kernel."""
    env = {**environment, "COTRACK_CACHE": str(tmp_path / "cache")}
    command = [sys.executable, "-c", ANNOUNCED, str(toy)]
    first, again = (
        subprocess.run(command, env=env, capture_output=True, text=True, check=True).stdout.strip() for _ in range(2)
    )
    said, *compiled = first.split("|")
    assert "compiles the kernels" in said
    assert set(compiled) == {"kernel"}
    assert again == ""
