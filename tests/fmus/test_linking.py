"""Kernels that call kernels: internal callees, machine code, exceptions, arrays that are made and handed on."""

import ast
import json
import subprocess
import sys
from pathlib import Path

import numba
import numpy as np
import pytest

from fmus.cache import sources
from fmus.kernels import jit, numba_internals
from fmus.kernels.numba_internals import compilation
from fmus.physics.wheels import move


@pytest.mark.long
@pytest.mark.parametrize(
    "kinds",
    [["free", "planar", "beam", "constrained", "explicit", "recursive"], ["rigid", "cable", "spring"]],
    ids="-".join,
)
def test_arrays_of_kernels_that_are_apart_do_not_overlap(environment, kinds):
    """No arrays overlap in kernels that are declared free of aliasing.

    A step of each kind of track on its wheels is checked call by call, without compilation.
    """
    program = Path(__file__).parents[1] / "support" / "overlaps.py"
    env = {**environment, "NUMBA_DISABLE_JIT": "1"}
    done = subprocess.run([sys.executable, str(program), *kinds], env=env, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    seen = json.loads(done.stdout)
    twin = seen.pop("twin")
    assert twin["found"] == ["_substitute writes 4.1 over 4.0", "solve writes 5 over 4"]
    assert {kind: each["found"] for kind, each in seen.items()} == {kind: [] for kind in kinds}
    assert min(each["calls"] for each in seen.values()) > 500


def test_what_a_kernel_calls_is_its_own_and_computes_the_same_bits(monkeypatch):
    """The callees of a kernel are internal to it and compute the same bits.

    This relies on numba's internals: if they change, kernels become slower and this test fails.
    """
    linkages: list[set[tuple[str, bool]]] = []  # of each library: linkage, and whether its name is made its own
    internal = compilation.internal

    def watched(change):
        def watch(library):
            change(library)
            defined = [each for each in library._final_module.functions if not each.is_declaration]
            named = [each for each in defined if compilation.OURS in each.name]
            ours = {(each.linkage.name, each.name.endswith(compilation.OWN)) for each in named}
            linkages.append(ours)

        return watch

    rows = np.random.default_rng(1).normal(size=(7, 15))
    moved = []
    for change in (internal, lambda library: None):
        monkeypatch.setattr(compilation, "internal", watched(change))
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
from fmus.kernels.numba_internals import compilation
print(parts == [JITCodeLibrary.get_pointer_to_function, JITCPUCodegen.set_env])
"""


def test_another_numba_compiles_its_plain_way_and_says_so(environment):
    done = subprocess.run([sys.executable, "-c", OTHER], env=environment, capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "True"
    assert "numba is 0.67.9, not 0.68.x" in done.stderr
    assert numba.__version__.startswith(numba_internals.TESTED)
    major, minor = map(int, numba_internals.TESTED.split(".")[:2])
    assert f'"numba>=0.61,<{major}.{minor + 1}"' in (sources.ROOT.parent / "pyproject.toml").read_text(encoding="utf-8")


MAKING = ("np.zeros(", "np.empty(", "np.array(", "np.ones(", "np.eye(", ".copy()", ".ravel()", " @ ")


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
    optimise = compilation.internal
    monkeypatch.setattr(compilation, "internal", lambda library: (emitted.append(library.name), optimise(library)))
    assert quartered(2.0) == 0.5
    assert halved(2.0) == 1.0
    assert [name.rpartition(".")[2] for name in emitted] == ["quartered", "halved"]


@jit.allocating
def assigned(a, b):
    a[:] = b


@jit.allocating
def assigned_within(a, b):
    assigned(a, b)


@pytest.mark.long
def test_an_exception_comes_out_of_a_kernel_that_a_kernel_calls():
    with pytest.raises(ValueError, match=r"cannot assign slice of shape \(2,\) from input of shape \(3,\)"):
        assigned_within(np.zeros(2), np.zeros(3))


@pytest.mark.long
def test_kernels_that_make_arrays_or_receive_new_ones_say_so():
    """They are declared as allocating, or nothing would free the arrays; numba itself notices only some of them."""
    functions: dict[tuple[str, str], ast.FunctionDef] = {}
    names: dict[str, dict[str, tuple[str | None, str]]] = {}
    making = {"kernel": [], "namesake": [], "allocating": []}
    for file in sources.sources():
        module = ".".join(("fmus", *file.relative_to(sources.ROOT).with_suffix("").parts))
        tree = ast.parse(file.read_text(encoding="utf-8"))
        functions |= {(module, node.name): node for node in tree.body if isinstance(node, ast.FunctionDef)}
        names[module] = {
            alias.asname or alias.name: (line.module, alias.name)
            for line in ast.walk(tree)
            if isinstance(line, ast.ImportFrom)
            for alias in line.names
        }
        for node in (node for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)):
            body = ast.unparse(ast.Module(node.body, []))
            for mark in {*map(ast.unparse, node.decorator_list)} & making.keys():
                making[mark] += [f"{module}.{node.name}"] if any(call in body for call in MAKING) else []
    assert not making["kernel"] + making["namesake"]
    # what a start lays out, and a stage of the monolith; 30 more before steps had work arrays
    assert len(making["allocating"]) == 3

    def returns_new(node: ast.FunctionDef) -> bool:
        made = [ast.unparse(line.targets[0]) for line in ast.walk(node) if isinstance(line, ast.Assign)
                and ast.unparse(line.value).startswith(MAKING)]  # fmt: skip
        returned = [ast.unparse(line.value) for line in ast.walk(node) if isinstance(line, ast.Return) and line.value]
        return any(value in made or value.startswith(MAKING) for value in returned)

    makers = {place for place, node in functions.items() if returns_new(node)}
    leaking = [
        f"{module}.{name} calls {call.func.id}"
        for (module, name), node in functions.items()
        if {"kernel", "namesake"} & {*map(ast.unparse, node.decorator_list)}
        for call in ast.walk(node)
        if isinstance(call, ast.Call)
        and isinstance(call.func, ast.Name)
        and names[module].get(call.func.id, (module, call.func.id)) in makers
    ]
    assert len(makers) > 3
    assert not leaking
