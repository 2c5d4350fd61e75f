"""Stubs: a kernel that calls one is compiled with the function that is chosen, and again after its edits."""

import ast
import os
import shutil
import types
from importlib.util import resolve_name
from typing import NamedTuple

import numba
import pytest

from fmus.cache import sources
from fmus.kernels import jit


class Square(NamedTuple):
    side: float


@pytest.mark.parametrize("swaps", [False, True])
def test_a_namesake_has_the_parameters_of_its_stub(swaps):
    def as_declared(c: Square, high: float, low: float) -> float:
        return c.side * (high - low)

    def swapped(c: Square, low: float, high: float) -> float:
        return c.side * (high - low)

    namesake = numba.njit(swapped if swaps else as_declared)

    @jit.dispatch(lambda kind: types.SimpleNamespace(area=namesake))
    def area(c, high, low):  # annotations may differ
        """Area of a part of a square."""

    @numba.njit
    def caller(c):
        return area(c, 3.0, 1.0)

    if swaps:
        with pytest.raises((TypeError, numba.TypingError), match="area: other parameters than those of its stub"):
            caller(Square(2.0))
    else:
        assert caller(Square(2.0)) == 4.0


@pytest.mark.parametrize("module", [None, types.SimpleNamespace()], ids=["no module declared", "no namesake"])
def test_the_body_of_a_stub_is_that_of_classes_without_their_own(module):
    @jit.dispatch(lambda kind: module, default=True)
    def area(c: Square) -> float:
        return 2.0 * c.side

    @numba.njit
    def caller(c):
        return area(c)

    assert caller(Square(3.0)) == area(Square(3.0)) == 6.0


@pytest.mark.long
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

    def fingerprint(place, module) -> str:
        return sources.reachable_hash(module, place.joinpath(*module.split(".")).with_suffix(".py"))

    choices = dispatched()
    assert len(choices) >= 30
    before = tmp_path / "before"
    shutil.copytree(sources.ROOT, before / "fmus", ignore=shutil.ignore_patterns("__pycache__", "*.md"))
    for number, chosen in enumerate({chosen for _, chosen in choices}):
        place = tmp_path / str(number)
        shutil.copytree(before / "fmus", place / "fmus", copy_function=os.link)
        path = place.joinpath(*chosen.split(".")).with_suffix(".py")
        text = path.read_text(encoding="utf-8")
        path.unlink()  # a link
        path.write_text(text + "# edited\n", encoding="utf-8")
        for stub in (stub for stub, each in choices if each == chosen):
            assert fingerprint(place, stub) != fingerprint(before, stub), chosen
        shutil.rmtree(place)


def test_a_stub_refuses_a_class_that_it_does_not_know():
    @jit.dispatch("values")
    def value(c):
        """Value of a class that declares its module."""

    @numba.njit
    def doubled(c):
        return 2.0 * value(c)

    said = "Square does not declare in which module its values are"
    with pytest.raises(TypeError, match=said):
        value(Square(1.0))
    with pytest.raises((TypeError, numba.TypingError), match=said):  # numba passes errors on or wraps them
        doubled(Square(1.0))
