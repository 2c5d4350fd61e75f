"""Stubs: a kernel that calls one is compiled with the function that is chosen, and again after its edits."""

import ast
import shutil
import subprocess
import sys
import types
from importlib.util import resolve_name
from typing import NamedTuple

import numba
import pytest

from fmus.cache import sources
from fmus.kernels import jit


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


@pytest.mark.parametrize("module", [None, types.SimpleNamespace()], ids=["no module declared", "no namesake"])
def test_the_body_of_a_stub_is_that_of_classes_without_their_own(module):
    @jit.dispatch(lambda kind: module, default=True)
    def area(c: Square) -> float:
        return 2.0 * c.side

    @numba.njit
    def caller(c):
        return area(c)

    assert caller(Square(3.0)) == area(Square(3.0)) == 6.0


def test_each_namesake_has_a_stub_that_documents_it():
    functions = [
        (path, part, [ast.unparse(mark) for mark in part.decorator_list])
        for path in sources.sources()
        for part in ast.parse(path.read_text(encoding="utf-8")).body
        if isinstance(part, ast.FunctionDef)
    ]
    documented = {
        part.name for _, part, marks in functions if marks[:1] and "dispatch(" in marks[0] and ast.get_docstring(part)
    }
    named = {(path.name, part.name) for path, part, marks in functions if "namesake" in marks}
    assert len(named) > 100
    assert not {(file, name) for file, name in named if name not in documented}


def dispatched() -> list[tuple[str, str]]:
    """Return pairs of a module of stubs, or of classes that stubs dispatch on, and a module that they choose."""
    pairs = []
    for path in sources.sources():
        tree = ast.parse(path.read_text(encoding="utf-8"))
        module = ".".join(("fmus", *path.relative_to(sources.ROOT).with_suffix("").parts))
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
    shutil.copytree(sources.ROOT, tree, ignore=shutil.ignore_patterns("__pycache__", "*.md"))

    def fingerprint(module: str) -> str:
        sources.reachable_hash.cache_clear()
        sources._source.cache_clear()
        return sources.reachable_hash(module, tmp_path.joinpath(*module.split(".")).with_suffix(".py"))

    choices = dispatched()
    assert len(choices) >= 30
    for stub, chosen in choices:
        path, before = tmp_path.joinpath(*chosen.split(".")).with_suffix(".py"), fingerprint(stub)
        text = path.read_text(encoding="utf-8")
        path.write_text(text + "# edited\n", encoding="utf-8")
        assert fingerprint(stub) != before, chosen
        path.write_text(text, encoding="utf-8")
    sources.reachable_hash.cache_clear()
    sources._source.cache_clear()


FRESH = {"PYTHONDONTWRITEBYTECODE": "1"}  # byte code of a source of the same size and second is not read again
STUB = """
from fmus.kernels.jit import allocating, dispatch

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
from fmus.kernels.jit import implemented_in

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
@pytest.mark.parametrize("choice", ["one", "'values'"])
def test_an_edit_behind_a_stub_compiles_its_caller_again(environment, tmp_path, choice, shared):
    package = tmp_path / "parts"
    package.mkdir()
    (package / "__init__.py").touch()
    (package / "stubs.py").write_text(STUB.format(choice, shared))
    (package / "kinds.py").write_text(KIND)
    path = f"{tmp_path}:{sources.ROOT.parent}"
    program = "import logging; logging.basicConfig(level=logging.INFO); from parts.kinds import Heavy\n"
    program += "from parts.stubs import doubled; print(doubled(Heavy(1.5)))"

    def outcome(factor: float) -> tuple[str, bool]:
        (package / "room.py").write_text(
            f"from fmus.kernels.jit import kernel\n\n@kernel\ndef value(x):\n    return {factor} * x.x\n"
        )
        done = subprocess.run(
            [sys.executable, "-c", program],
            env={**environment, **FRESH, "COTRACK_CACHE": str(tmp_path / "cache"), "PYTHONPATH": path},
            capture_output=True, text=True, check=True,
        )  # fmt: skip
        return done.stdout.strip(), "doubled" in done.stderr

    assert [outcome(1.0), outcome(1.0), outcome(3.0)] == [("3.0", True), ("3.0", False), ("9.0", True)]


def test_a_stub_refuses_a_class_that_it_does_not_know(tmp_path, monkeypatch, clean_imports):
    package = tmp_path / "parts"
    package.mkdir()
    for name, text in (("__init__", ""), ("stubs", STUB.format("'values'", False)), ("kinds", KIND)):
        (package / f"{name}.py").write_text(text)
    monkeypatch.syspath_prepend(str(tmp_path))
    from parts.kinds import Stranger
    from parts.stubs import doubled, value

    said = "Stranger does not declare in which module its values are"
    with pytest.raises(TypeError, match=said):
        value(Stranger(1.0))
    with pytest.raises((TypeError, numba.TypingError), match=said):  # numba passes errors on or wraps them
        doubled(Stranger(1.0))
