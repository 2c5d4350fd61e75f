"""Kernels are found by content: at any path, and not after an edit of a function that they call."""

import ast
import json
import os
import shutil
import subprocess
import sys
import types
from importlib.util import resolve_name
from pathlib import Path
from typing import NamedTuple

import numba
import numpy as np
import pytest

from fmus import jit, linking
from fmus.physics.wheels import move

MODULES = {
    "__init__.py": "",
    "caller.py": """
from fmus.jit import kernel
from parts.deep.callee import factor
@kernel
def scaled(x):
    return factor(x) * x
""",
    "deep/__init__.py": "",
    "deep/callee.py": """
from fmus.jit import kernel
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


@pytest.mark.long
def test_arrays_of_kernels_that_are_apart_do_not_overlap(environment):
    """No arrays overlap in kernels that are declared free of aliasing.

    A step of each kind of track on its wheels is checked call by call.
    """
    program, kinds = Path(__file__).with_name("overlaps.py"), ["rigid", "cable", "free", "planar", "beam"]
    path = os.pathsep.join([str(program.parent), environment["PYTHONPATH"]])
    env = {**environment, "NUMBA_DISABLE_JIT": "1", "PYTHONPATH": path}
    done = subprocess.run([sys.executable, str(program), *kinds], env=env, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    seen = json.loads(done.stdout)
    twin = seen.pop("twin")
    assert twin["found"] == ["solve writes 5 over 4"]
    assert {kind: each["found"] for kind, each in seen.items()} == {kind: [] for kind in kinds}
    assert min(each["calls"] for each in seen.values()) > 1000


def test_reachable_sources_follow_every_kind_of_import(tmp_path, monkeypatch, clean_imports):
    package = tmp_path / "reach"
    (package / "sub").mkdir(parents=True)
    for name in (
        "__init__",
        "plain",
        "named",
        "inside",
        "guarded",
        "sub/__init__",
        "sub/near",
        "sub/up",
        "far",
    ):
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
        jit.reachable_hash.cache_clear()
        jit._imports.cache_clear()
        return jit.reachable_hash("reach.start", package / "start.py")

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
        hashes.append(jit.reachable_hash.__wrapped__("parts.caller", caller))
    (parts / "parts" / "deep" / "callee.py").write_text("factor = 3\n")
    hashes.append(jit.reachable_hash.__wrapped__("parts.caller", caller))
    assert hashes[0] == hashes[1] != hashes[2]


def test_source_hash_sees_names_and_contents_of_sources_only(tmp_path):
    (tmp_path / "a.py").write_text("x = 1\n")
    first = jit.source_hash(tmp_path)
    (tmp_path / "__pycache__").mkdir()
    (tmp_path / "__pycache__" / "a.pyc").write_bytes(b"x")
    (tmp_path / "notes.md").write_text("x")
    assert jit.source_hash(tmp_path) == first
    (tmp_path / "a.py").rename(tmp_path / "b.py")
    assert jit.source_hash(tmp_path) != first
    (tmp_path / "b.py").rename(tmp_path / "a.py")
    assert jit.source_hash(tmp_path) == first
    (tmp_path / "a.py").write_text("x = 2\n")
    assert jit.source_hash(tmp_path) != first


def test_cache_folder_is_the_chosen_one_or_the_users(monkeypatch):
    monkeypatch.setenv("COTRACK_CACHE", "/somewhere/else")
    assert jit.cache_folder() == Path("/somewhere/else")
    monkeypatch.delenv("COTRACK_CACHE")
    assert jit.cache_folder().name == "cotrack"


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


def test_what_a_kernel_calls_is_its_own_and_computes_the_same_bits(monkeypatch):
    """The callees of a kernel are internal to it and compute the same bits.

    This relies on numba's internals: if they change, kernels become slower and this test fails.
    """
    linkages: list[set[tuple[str, bool]]] = []
    internal = linking.internal

    def watched(change):
        def watch(library):
            change(library)
            defined = [each for each in library._final_module.functions if not each.is_declaration]
            ours = {
                (each.linkage.name, each.name.endswith(linking.OWN)) for each in defined if linking.OURS in each.name
            }
            linkages.append(ours)

        return watch

    rows = np.random.default_rng(1).normal(size=(7, 15))
    moved = []
    for change in (internal, lambda library: None):
        monkeypatch.setattr(linking, "internal", watched(change))
        out = np.zeros_like(rows)
        numba.njit(lambda rows, tau, out: move(rows, tau, out))(rows, 1e-3, out)
        moved.append(out)
    own, others = (kinds for kinds in linkages if kinds)
    assert own == {("internal", True)}
    assert others == {("linkonce_odr", False)}
    assert np.array_equal(*moved)


OTHER = """
import numba
numba.__version__ = "0.67.9"
from numba.core.codegen import JITCodeLibrary, JITCPUCodegen
parts = [JITCodeLibrary.get_pointer_to_function, JITCPUCodegen.set_env]
from fmus import linking
print(parts == [JITCodeLibrary.get_pointer_to_function, JITCPUCodegen.set_env])
"""


def test_another_numba_compiles_its_plain_way_and_says_so(environment):
    done = subprocess.run([sys.executable, "-c", OTHER], env=environment, capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "True"
    assert "numba is 0.67.9, not 0.68.x" in done.stderr
    assert numba.__version__.startswith(linking.TESTED)
    major, minor = map(int, linking.TESTED.split(".")[:2])
    assert f'"numba>=0.61,<{major}.{minor + 1}"' in (jit.ROOT.parent / "pyproject.toml").read_text(encoding="utf-8")


@jit.kernel
def handed_back(a):
    return a


MAKING = ("np.zeros(", "np.empty(", "np.array(", "np.ones(", "np.eye(", ".copy()", ".ravel()", " @ ")


def test_a_kernel_that_borrows_its_arrays_returns_none():
    with pytest.raises(TypeError, match=r"handed_back at .* returns an array: it must be ``allocating``"):
        handed_back(np.zeros(3))


def test_only_what_python_calls_has_machine_code(fresh_cache, monkeypatch):
    """Only functions that Python calls get machine code.

    This relies on numba's internals: if they change, a cold start takes longer and this test fails.
    """

    @jit.kernel
    def halved(x):
        return 0.5 * x

    @jit.kernel
    def quartered(x):
        return halved(halved(x))

    emitted: list[str] = []
    optimise = linking.internal
    monkeypatch.setattr(linking, "internal", lambda library: (emitted.append(library.name), optimise(library)))
    assert quartered(2.0) == 0.5
    assert halved(2.0) == 1.0
    assert [name.rpartition(".")[2] for name in emitted] == ["quartered", "halved"]


@jit.allocating
def assigned(a, b):
    a[:] = b


@jit.allocating
def assigned_within(a, b):
    assigned(a, b)


def test_an_exception_comes_out_of_a_kernel_that_a_kernel_calls():
    with pytest.raises(ValueError, match=r"cannot assign slice of shape \(2,\) from input of shape \(3,\)"):
        assigned_within(np.zeros(2), np.zeros(3))


def test_kernels_that_make_arrays_say_so():
    """Kernels that allocate arrays are declared as allocating, or nothing would free the arrays.

    Numba itself notices only some of them.
    """
    makers = {"kernel": [], "allocating": []}
    for file in jit.sources():
        for node in ast.walk(ast.parse(file.read_text())):
            if isinstance(node, ast.FunctionDef):
                body = ast.unparse(ast.Module(node.body, []))
                for decorator in node.decorator_list:
                    if ast.unparse(decorator) in makers and any(call in body for call in MAKING):
                        makers[ast.unparse(decorator)].append(f"{file.name}: {node.name}")
    assert not makers["kernel"]
    assert len(makers["allocating"]) > 20


def test_kernels_count_the_arrays_that_they_receive():
    """A kernel that receives a new array from a kernel is declared as allocating, or nothing would free the array."""
    functions: dict[tuple[str, str], ast.FunctionDef] = {}
    names: dict[str, dict[str, tuple[str | None, str]]] = {}
    for file in jit.sources():
        module = ".".join(("fmus", *file.relative_to(jit.ROOT).with_suffix("").parts))
        tree = ast.parse(file.read_text(encoding="utf-8"))
        functions |= {(module, node.name): node for node in tree.body if isinstance(node, ast.FunctionDef)}
        names[module] = {
            alias.asname or alias.name: (line.module, alias.name)
            for line in ast.walk(tree)
            if isinstance(line, ast.ImportFrom)
            for alias in line.names
        }

    def is_new(value: ast.expr | None, node: ast.FunctionDef) -> bool:
        made = [ast.unparse(line.targets[0]) for line in ast.walk(node) if isinstance(line, ast.Assign)
                and ast.unparse(line.value).startswith(MAKING)]  # fmt: skip
        return value is not None and (ast.unparse(value) in made or ast.unparse(value).startswith(MAKING))

    def returns_array(node: ast.FunctionDef) -> bool:
        return any(is_new(line.value, node) for line in ast.walk(node) if isinstance(line, ast.Return))

    makers = {place for place, node in functions.items() if returns_array(node)}
    leaking = [
        f"{module}.{name} calls {call.func.id}"
        for (module, name), node in functions.items()
        if "kernel" in map(ast.unparse, node.decorator_list)
        for call in ast.walk(node)
        if isinstance(call, ast.Call)
        and isinstance(call.func, ast.Name)
        and names[module].get(call.func.id, (module, call.func.id)) in makers
    ]
    assert len(makers) > 5
    assert not leaking


class Square(NamedTuple):
    side: float


@pytest.mark.parametrize("order", ["as declared", "swapped"])
def test_a_namesake_has_the_parameters_of_its_stub(order):
    def as_declared(c: Square, high: float, low: float) -> float:
        return c.side * (high - low)

    def swapped(c: Square, low: float, high: float) -> float:
        return c.side * (high - low)

    namesake = numba.njit({"as declared": as_declared, "swapped": swapped}[order])

    @jit.dispatch(lambda kind: types.SimpleNamespace(area=namesake))
    def area(c, high, low):  # annotations may differ
        """Area of a part of a square."""

    @numba.njit
    def caller(c):
        return area(c, 3.0, 1.0)

    if order == "as declared":
        assert caller(Square(2.0)) == 4.0
    else:
        with pytest.raises((TypeError, numba.TypingError), match="area: other parameters than those of its stub"):
            caller(Square(2.0))


def dispatched() -> list[tuple[str, str]]:
    """Return pairs of a module of stubs, or of classes that stubs dispatch on, and a module that they choose."""
    pairs = []
    for path in jit.sources():
        tree = ast.parse(path.read_text(encoding="utf-8"))
        module = ".".join(("fmus", *path.relative_to(jit.ROOT).with_suffix("").parts))
        marks = [mark for part in ast.walk(tree) for mark in getattr(part, "decorator_list", ())]
        calls = [mark for mark in marks if isinstance(mark, ast.Call)]
        for call in calls:
            if ast.unparse(call.func) == "implemented_in":
                package = module.rpartition(".")[0]
                pairs += [(module, resolve_name(ast.literal_eval(each.value), package)) for each in call.keywords]
        if any("dispatch(" in ast.unparse(call) for call in calls):
            pairs += [
                (module, f"{line.module}.{line.names[0].name}")
                for opener in tree.body
                if isinstance(opener, ast.FunctionDef)
                for line in ast.walk(opener)
                if isinstance(line, ast.ImportFrom)
            ]
    return pairs


@pytest.mark.long
def test_an_edit_behind_any_stub_is_another_kernel(tmp_path):
    """An edit of a chosen module changes the hash of every kernel that reaches the stub or takes the class."""
    tree = tmp_path / "fmus"
    shutil.copytree(jit.ROOT, tree, ignore=shutil.ignore_patterns("__pycache__", "*.md"))

    def fingerprint(module: str) -> str:
        jit.reachable_hash.cache_clear()
        jit._imports.cache_clear()
        return jit.reachable_hash(module, tmp_path.joinpath(*module.split(".")).with_suffix(".py"))

    choices = dispatched()
    assert len(choices) >= 30
    for stub, chosen in choices:
        path, before = tmp_path.joinpath(*chosen.split(".")).with_suffix(".py"), fingerprint(stub)
        text = path.read_text(encoding="utf-8")
        path.write_text(text + "# edited\n", encoding="utf-8")
        assert fingerprint(stub) != before, chosen
        path.write_text(text, encoding="utf-8")
    jit.reachable_hash.cache_clear()
    jit._imports.cache_clear()


STUB = """
from fmus.jit import allocating, dispatch, implementation

def one(kind):
    from parts import room
    return room

@dispatch({0}, shared={1})
def value(x):
    pass

@allocating
def doubled(x):
    return 2.0 * value(x)
"""
KIND = """
from typing import NamedTuple
from fmus.jit import implemented_in

@implemented_in(values=".room")
class Kind(NamedTuple):
    x: float

class Heavy(Kind):  # inherits what its base declares
    __slots__ = ()

class Stranger(NamedTuple):
    x: float
"""


@pytest.mark.long
@pytest.mark.parametrize("shared", [False, True])
@pytest.mark.parametrize("choice", ["one", "implementation('values')"])
def test_an_edit_behind_a_stub_compiles_its_caller_again(environment, tmp_path, choice, shared):
    package = tmp_path / "parts"
    package.mkdir()
    (package / "__init__.py").touch()
    (package / "stubs.py").write_text(STUB.format(choice, shared))
    (package / "kinds.py").write_text(KIND)
    path = f"{tmp_path}:{jit.ROOT.parent}"
    program = "import logging; logging.basicConfig(level=logging.INFO); from parts.kinds import Heavy\n"
    program += "from parts.stubs import doubled; print(doubled(Heavy(1.5)))"

    def outcome(factor: float) -> tuple[str, bool]:
        (package / "room.py").write_text(
            f"from fmus.jit import kernel\n\n@kernel\ndef value(x):\n    return {factor} * x.x\n"
        )
        done = subprocess.run(
            [sys.executable, "-c", program],
            env={**environment, "COTRACK_CACHE": str(tmp_path / "cache"), "PYTHONPATH": path},
            capture_output=True, text=True, check=True,
        )  # fmt: skip
        return done.stdout.strip(), "doubled" in done.stderr

    assert [outcome(1.0), outcome(1.0), outcome(3.0)] == [("3.0", True), ("3.0", False), ("9.0", True)]


def test_a_stub_refuses_a_class_that_it_does_not_know(tmp_path, monkeypatch, clean_imports):
    package = tmp_path / "parts"
    package.mkdir()
    for name, text in (("__init__", ""), ("stubs", STUB.format("implementation('values')", False)), ("kinds", KIND)):
        (package / f"{name}.py").write_text(text)
    monkeypatch.syspath_prepend(str(tmp_path))
    from parts.kinds import Stranger
    from parts.stubs import doubled, value

    said = "Stranger does not declare in which module its values are"
    with pytest.raises(TypeError, match=said):
        value(Stranger(1.0))
    with pytest.raises((TypeError, numba.TypingError), match=said):  # numba passes errors on or wraps them
        doubled(Stranger(1.0))
