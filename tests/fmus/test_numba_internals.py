"""Names inside numba that the project uses and numba does not promise, each once; a test says what has changed.

A new version of numba is tried like this: allow it in ``pyproject.toml``, set ``linking.TESTED``, run this module. A
name that has changed fails with the place that relies on it; all other names need no look.
"""

import ast
import json
import re
import subprocess
import sys
from pathlib import Path
from typing import NamedTuple

import numba
from numba.core.caching import FunctionCache
from numba.core.compiler import Flags
from numba.core.options import DefaultOptions

from fmus.kernels import jit, linking

ROOT = Path(jit.__file__).parents[2]


class Internal(NamedTuple):
    """Name inside numba, and what relies on it."""

    path: str  # module and name; a member of a class after the class
    parameters: str | None  # of a function, in order; None: not called with arguments of ours
    used: str  # where, and for what


CACHE, CODEGEN, CONTEXT = "numba.core.caching", "numba.core.codegen", "numba.core.base.BaseContext"
INTERNALS = [
    Internal(f"{CACHE}._CacheLocator", None, "jit: where the kernels of a module are stored"),
    Internal(f"{CACHE}.CompileResultCacheImpl._locator_classes", None, "jit: our locator instead of numba's"),
    Internal(f"{CACHE}.CompileResultCacheImpl.filename_base", None, "jit: name of a kernel's files"),
    Internal(f"{CACHE}.CompileResultCacheImpl.locator", None, "jit: folder and stamp of a kernel's files"),
    Internal(f"{CACHE}.FunctionCache", "py_func", "jit: compiled kernels by content"),
    Internal(f"{CACHE}.FunctionCache._impl_class", None, "jit: our locator instead of numba's"),
    Internal(f"{CACHE}.FunctionCache._index_key", "self sig codegen", "jit: key of a compiled kernel"),
    Internal(f"{CACHE}.FunctionCache.save_overload", "self sig data", "jit: refuses arrays that are not counted"),
    Internal(f"{CACHE}.FunctionCache._guard_against_spurious_io_errors", None, "jit: reports a cache on a full disk"),
    Internal("numba.core.compiler.Compiler.compile_extra", "self func", "jit: no cycle collection in between"),
    Internal(
        "numba.core.compiler.Compiler.__init__",
        "self typingctx targetctx library args return_type flags locals",
        "jit: arrays that do not alias",
    ),
    Internal("numba.core.serialize.dumps", "obj", "jit: compiled kernels as bytes"),
    Internal(f"{CODEGEN}.JITCodeLibrary._optimize_final_module", "self", "linking: optimises at the first call"),
    Internal(f"{CODEGEN}.JITCodeLibrary._finalize_final_module", "self", "linking: emits code at the first call"),
    Internal(f"{CODEGEN}.JITCodeLibrary._finalize_dynamic_globals", "self", "linking: the first half of it"),
    Internal(f"{CODEGEN}.JITCodeLibrary._verify_declare_only_symbols", "self", "linking: the first half of it"),
    Internal(f"{CODEGEN}.JITCodeLibrary._ensure_finalized", "self", "linking: before the first call"),
    Internal(f"{CODEGEN}.JITCodeLibrary._get_module_for_linking", "self", "linking: keeps the code for other kernels"),
    Internal(f"{CODEGEN}.JITCodeLibrary.get_pointer_to_function", "self name", "linking: when code is needed"),
    Internal(f"{CODEGEN}.JITCodeLibrary.serialize_using_object_code", "self", "linking: stores code that was needed"),
    Internal(f"{CODEGEN}.JITCodeLibrary.serialize_using_bitcode", "self", "linking: stores code that was not"),
    Internal(f"{CODEGEN}.JITCodeLibrary.get_llvm_str", "self", "native: intermediate code of an entry"),
    Internal(f"{CODEGEN}.JITCPUCodegen.set_env", "self env_name env", "linking: later, where code is not there yet"),
    Internal("numba.core.cgutils.alloca_once", "builder ty size name zfill", "by_reference: a kernel's tuple"),
    Internal("numba.core.cgutils.gep_inbounds", "builder ptr inds kws", "by_reference: a field"),
    Internal("numba.core.cgutils.voidptr_t", None, "by_reference: an address"),
    Internal("numba.core.imputils.impl_ret_borrowed", "ctx builder retty ret", "by_reference: a field, not counted"),
    Internal("numba.core.registry.cpu_target.target_context", None, "by_reference: types as in memory"),
    Internal(f"{CONTEXT}.get_abi_sizeof", "self ty", "by_reference: bytes of a tuple"),
    Internal(f"{CONTEXT}.get_data_type", "self ty", "by_reference: a tuple as in memory"),
    Internal(f"{CONTEXT}.pack_value", "self builder ty value ptr align", "by_reference: writes a tuple"),
    Internal(f"{CONTEXT}.unpack_value", "self builder ty ptr align", "by_reference: reads a field"),
    Internal("numba.core.typing.templates.AttributeTemplate.generic_resolve", None, "by_reference: type of a field"),
    Internal("numba.core.typing.templates.infer_getattr", None, "by_reference: type of a field"),
]
# attributes that an object has, not its class, and those of a dispatcher; tests below need each of them
OF_OBJECTS = {
    "_cache", "_cache_file", "_compiled_object", "_engine", "_final_module", "_finalized", "_impl", "_linked_only",
    "_name", "_object_caching_enabled",
}  # fmt: skip
KNOWN = {name for internal in INTERNALS for name in internal.path.split(".")} | OF_OBJECTS | {"_messages"}  # of a model
USERS = {
    "fmus": "kernels/jit kernels/linking kernels/by_reference native/entries native/emit",
    "orchestrator": "kernels/compiled",
}
FILES = [ROOT / folder / f"{name}.py" for folder, names in USERS.items() for name in names.split()]


PROBE = """
import inspect, json, sys
from importlib import import_module

def found(path):
    parts = path.split(".")
    for k in range(len(parts) - 1, 0, -1):
        try:
            at = import_module(".".join(parts[:k]))
        except ImportError:
            continue
        for name in parts[k:]:
            at = getattr(at, name)
        return at

def parameters(path):
    try:
        at = found(path)
        return " ".join(inspect.signature(at).parameters) if callable(at) else ""
    except ValueError:
        return ""
    except AttributeError:
        return None

print(json.dumps({path: parameters(path) for path in json.load(sys.stdin)}))
"""


def parameters_in_numba(paths):
    """Parameters of names in numba itself, which `linking` has not changed; None for a name that is gone."""
    done = subprocess.run([sys.executable, "-c", PROBE], input=json.dumps(paths), capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def what_changed(internal, parameters):
    """Sentence about a name that is not as the table has it; "" if it is."""
    if parameters is None:
        return f"numba {numba.__version__} has no {internal.path}: {internal.used}"
    if internal.parameters not in (None, parameters):
        return f"{internal.path} has the parameters {parameters}, not {internal.parameters}: {internal.used}"
    return ""


def test_names_inside_numba_are_as_we_know_them():
    gone = Internal(f"{CACHE}.FunctionCache.gone", None, "nothing")
    changed = Internal(f"{CACHE}.FunctionCache._index_key", "self key", "nothing")
    parameters = parameters_in_numba([each.path for each in (*INTERNALS, gone)])
    sentences = [what_changed(internal, parameters[internal.path]) for internal in INTERNALS]
    assert [sentence for sentence in sentences if sentence] == []
    for twin, part in ((gone, "has no"), (changed, "not self key")):
        assert part in what_changed(twin, parameters[twin.path])


def test_attributes_of_compiled_kernels_are_as_we_know_them():
    """A function compiled by numba alone has every attribute on whose presence our caching and linking rely."""
    function = numba.njit(lambda x: x + 1.0)
    assert function(1.0) == 2.0
    (result,) = function.overloads.values()
    library = result.library
    assert any(result.fndesc.llvm_func_name == each.name for each in library._final_module.functions)
    assert library._finalized is True
    assert isinstance(library._compiled_object, bytes)
    assert library._object_caching_enabled is True
    assert library.codegen._engine.is_symbol_defined("none") is False
    assert result.fndesc.llvm_func_name in library.get_llvm_str()
    assert callable(function.get_call_template)
    assert callable(function.get_overload)
    cache = FunctionCache(jit.kernel)
    assert "kernel" in cache._name
    assert cache._impl.filename_base.startswith("jit.kernel")
    assert cache._cache_file is not None
    assert function._cache is not None


def test_flags_and_options_are_as_we_know_them():
    """``noalias`` is a flag of the compiler, and kernels may leave out reference counts and wrappers."""
    flags = Flags()
    flags.noalias = True
    assert flags.noalias is True
    for name in (*jit.OPTIONS, *jit.INNER):
        assert hasattr(DefaultOptions, name), f"njit of numba {numba.__version__} has no option {name}"


def test_nothing_else_of_numbas_inside_is_used():
    """The modules below are the only ones that reach into numba, and their private names are in the table."""
    files = [file for package in USERS for file in (ROOT / package).rglob("*.py")]
    reaching = {file for file in files if "from numba.core" in file.read_text(encoding="utf-8")}
    assert reaching <= {*FILES}
    for file in FILES:
        tree = ast.parse(file.read_text(encoding="utf-8"))
        names = {node.attr for node in ast.walk(tree) if isinstance(node, ast.Attribute)}
        private = {name for name in names if name.startswith("_") and not name.startswith("__")}
        own = {
            target.attr
            for node in ast.walk(tree)
            if isinstance(node, ast.Assign | ast.AnnAssign)
            for target in ast.walk(node)
            if isinstance(target, ast.Attribute) and isinstance(target.ctx, ast.Store)
        } | {node.name for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)}
        assert private - KNOWN - own == set(), f"{file.name} uses more of numba's inside than the table has"
        for node in ast.walk(tree):
            if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("numba.core"):
                assert {alias.name for alias in node.names} <= KNOWN, ast.unparse(node)


def test_the_table_has_no_name_that_is_not_used():
    text = "".join(file.read_text(encoding="utf-8") for file in FILES)
    for name in {internal.path.rpartition(".")[2] for internal in INTERNALS} | OF_OBJECTS:
        assert re.search(rf"\b{re.escape(name)}\b", text), f"nothing uses {name} any more"


def test_the_version_in_use_is_the_tested_one():
    assert numba.__version__.startswith(linking.TESTED)
