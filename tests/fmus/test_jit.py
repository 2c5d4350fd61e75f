"""Kernels are found by content: at any path, and not after an edit of a function that they call."""

import os
import shutil
import subprocess
import sys
import types
from pathlib import Path

import numpy as np
import pytest

from fmus.cache import sources
from fmus.cache.files import cache_folder, temporary_folder
from fmus.kernels import jit

MODULES = {
    "__init__.py": "",
    "deep/__init__.py": "",
    "bystander.py": "LIMIT = 1\n",
    "caller.py": """
from fmus.kernels.jit import kernel
from parts.deep.callee import factor
@kernel
def scaled(x):
    return factor(x) * x.size
""",
    "deep/callee.py": """
from fmus.kernels.jit import kernel
@kernel
def factor(x):
    return 2.0 + 0.0 * x.size
""",
    "kinds.py": """
from typing import NamedTuple
from fmus.kernels.jit import implemented_in
@implemented_in(values=".deep.callee")
class Kind(NamedTuple):
    size: float
class Heavy(Kind):  # inherits what its base declares
    __slots__ = ()
""",
}
STUB = """
from fmus.kernels.jit import allocating, dispatch

def one(kind):
    from parts.deep import callee
    return callee

@dispatch({0}, shared={1})
def factor(x):
    pass

@allocating
def scaled(x):
    return factor(x) * x.size
"""
CALLERS = {
    "imported": MODULES["caller.py"],
    "chosen by a function": STUB.format("one", False),
    "declared by a class, compiled once": STUB.format("'values'", True),
}
RUN = """
from parts.caller import scaled
from parts.kinds import Heavy
value = scaled(Heavy(3.0))
stats = scaled.stats
print(value, sum(stats.cache_hits.values()), sum(stats.cache_misses.values()))
"""


def written(folder, modules):
    """Write sources by path; return the folder."""
    for name, text in modules.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text)
    return folder


def python(program, *arguments, **env):
    """Output of a program in a process of its own."""
    done = subprocess.run([sys.executable, "-c", program, *arguments], env=env, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return done.stdout.strip()


@pytest.mark.long
@pytest.mark.parametrize("how", CALLERS)
def test_a_kernel_is_found_at_another_path_and_not_after_an_edit_of_what_it_calls(environment, tmp_path, how):
    """It calls what it imports, or what a stub chooses; without a cache it is compiled."""
    modules = MODULES | {"caller.py": CALLERS[how]}
    parts = written(tmp_path / "here", {f"parts/{name}": text for name, text in modules.items()})

    def run(where, cache="cache"):
        path = f"{where}:{environment['PYTHONPATH']}"
        more = {"COTRACK_CACHE": str(tmp_path / cache), "PYTHONPATH": path, "PYTHONDONTWRITEBYTECODE": "1"}
        return tuple(map(float, python(RUN, **environment | more).split()))

    assert run(parts) == (6.0, 0, 1)
    assert run(parts) == (6.0, 1, 0)
    elsewhere = shutil.copytree(parts, tmp_path / "elsewhere")
    (elsewhere / "parts" / "bystander.py").write_text("LIMIT = 2\n")  # not imported by the kernel
    assert run(elsewhere) == (6.0, 1, 0)
    callee = elsewhere / "parts" / "deep" / "callee.py"
    callee.write_text(callee.read_text().replace("2.0 +", "5.0 +"))
    assert run(elsewhere) == (15.0, 0, 1)
    assert run(parts) == (6.0, 1, 0)  # the old value is right at the old path
    (tmp_path / "file").write_text("")
    assert run(parts, "file/cache") == (6.0, 0, 1)


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
    said = [python(BEYOND, **environment | more) for more in ({}, {"NUMBA_BOUNDSCHECK": "1"}) * 2]
    assert said == ["", "index is out of bounds"] * 2


def halved(x):
    return 0.5 * x


def test_a_kernel_is_that_of_its_compiler(fresh_cache, monkeypatch):
    def is_found():
        made = jit.kernel(halved)
        assert made(3.0) == 1.5
        return sum(made.stats.cache_hits.values()) == 1

    assert [is_found(), is_found()] == [False, True]
    for place, value in (
        ("numba.__version__", "1"), ("llvmlite.__version__", "1"), ("numpy.__version__", "3"),
        ("numba.config.OPT", 0), ("numba.config.USING_SVML", "?"),
    ):  # fmt: skip
        with monkeypatch.context() as other:
            other.setattr(place, value)
            assert [is_found(), is_found()] == [False, True], place
    assert is_found()


def scaled_sum(out, x, y):
    for i in range(out.size):
        out[i] = 3.0 * x[i] + y[i] / 7.0


def test_kernels_of_starts_are_optimised_less_to_the_same_bits(fresh_cache):
    """LLVM's third level does several numbers at once, its first one by one."""
    x, y = np.random.default_rng(1).standard_normal((2, 1001))
    results, packed = [], []
    for declare in (jit.kernel, lambda function: jit.kernel(jit.at_start(function))):
        copy = types.FunctionType(scaled_sum.__code__, globals())  # which is not declared
        copy.__module__ = __name__
        made, out = declare(copy), np.zeros_like(x)
        made(out, x, y)
        (compiled,) = made.overloads.values()
        results.append(out)
        packed.append("divpd" in compiled.library.get_asm_str())
        made._cache._cache_file.flush()  # the sources are the same
    assert packed == [True, False]
    assert results[0].tobytes() == results[1].tobytes()


def test_without_compilation_the_function_itself_comes_back(environment):
    code = "from toy.kernels import acceleration as f; assert type(f).__name__ == 'function'; f(1,2,3,4,5)"
    assert python(code, **environment | {"NUMBA_DISABLE_JIT": "1"}) == ""


IMPORTS = {
    name: "" for name in ("__init__", "plain", "named", "inside", "guarded", "sub/__init__", "sub/up", "far")
} | {
    "start": "import reach.plain as p\nfrom reach import named\nfrom .sub import near\n"
    "def f():\n    import reach.inside\n"
    "try:\n    pass\nexcept ValueError:\n    import reach.guarded\n",
    "sub/near": "from .. import sub\nfrom ..sub.up import *\n",
}


def test_reachable_sources_follow_every_kind_of_import(tmp_path):
    def fingerprint(edited):
        texts = {f"{name}.py": text + "# edited\n" * (name == edited) for name, text in IMPORTS.items()}
        place = written(tmp_path / edited.replace("/", "-") / "reach", texts)
        return sources.reachable_hash("reach.start", place / "start.py")

    hashes = {name: fingerprint(name) for name in ("none", *IMPORTS)}
    assert hashes["none"] == hashes["far"]
    assert len(set(hashes.values())) == len(IMPORTS)


def test_a_kernel_is_hashed_with_its_callees_when_its_package_was_loaded_from_elsewhere(tmp_path, monkeypatch):
    """A kernel is hashed with its callees even if its package was loaded from a folder that is gone.

    A tool may have deleted the first of its FMUs. An edit of the callee changes the hash all the same.
    """
    monkeypatch.setitem(sys.modules, "parts", types.ModuleType("parts"))
    hashes = []
    for name, there, edit in (("here", True, ""), ("again", False, ""), ("edited", False, "factor = 3\n")):
        place = written(tmp_path / name / "parts", MODULES | {"deep/callee.py": edit or MODULES["deep/callee.py"]})
        sys.modules["parts"].__path__ = [str(place if there else tmp_path / "gone")]
        hashes.append(sources.reachable_hash("parts.caller", place / "caller.py"))
    assert hashes[0] == hashes[1] != hashes[2]


def test_source_hash_sees_names_and_contents_of_sources_only(tmp_path):
    def hashed(name, modules):
        return sources.source_hash(written(tmp_path / name, modules))

    first = hashed("one", {"a.py": "x = 1\n"})
    assert hashed("other", {"a.py": "x = 1\n", "__pycache__/a.pyc": "x", "notes.md": "x"}) == first
    assert len({first, hashed("named", {"b.py": "x = 1\n"}), hashed("edited", {"a.py": "x = 2\n"})}) == 3
    (tmp_path / "one" / "a.py").write_text("x = 22\n")
    assert sources.source_hash(tmp_path / "one") != first


@pytest.mark.parametrize("chosen", ["~nouser/x", "", "gone"])
def test_a_cache_folder_that_cannot_be_found_is_a_temporary_one(monkeypatch, tmp_path, caplog, chosen):
    """A user who does not exist or has no home, a working folder that is gone; children use the same folder."""
    monkeypatch.setenv("COTRACK_CACHE", str(tmp_path / "chosen"))
    assert cache_folder() == tmp_path / "chosen"
    monkeypatch.setenv("COTRACK_CACHE", chosen)
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    if chosen == "":
        assert cache_folder() == tmp_path / "home" / ".cache" / "cotrack"
        monkeypatch.delenv("HOME")
        monkeypatch.setattr("pwd.getpwuid", {}.__getitem__)
    if chosen == "gone":
        (tmp_path / "gone").mkdir()
        monkeypatch.chdir(tmp_path / "gone")
        (tmp_path / "gone").rmdir()
    assert cache_folder() == temporary_folder() == Path(os.environ["COTRACK_CACHE"]) == cache_folder()
    (record,) = caplog.records
    named = chosen or "~/.cache/cotrack"
    assert record.getMessage().startswith(f"the cache folder {named} cannot be found, so every command compiles")
