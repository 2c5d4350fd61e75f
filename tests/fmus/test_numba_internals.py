"""Names inside numba that the project uses and numba does not promise, each once; a test says what has changed.

A new version of numba is tried like this: allow it in ``pyproject.toml``, set ``numba_internals.TESTED``, run this
module. A name that has changed fails with the place that relies on it; all other names need no look.
"""

import ast
import json
import re
import subprocess
import sys
from pathlib import Path

import numba

from fmus.kernels import numba_internals

CACHE, CODEGEN = "numba.core.caching", "numba.core.codegen.JITCodeLibrary"
CONTEXT, TEMPLATES = "numba.core.base.BaseContext", "numba.core.typing.templates"
# Path of a name in numba; of a function that is called with arguments of ours its parameters, in order; where it is
# used, and for what.
INTERNALS = [
    (f"{CACHE}._CacheLocator", "", "compilation: where the kernels of a module are stored"),
    (f"{CACHE}.CompileResultCacheImpl._locator_classes", "", "compilation: our locator instead of numba's"),
    (f"{CACHE}.CompileResultCacheImpl.filename_base", "", "compilation: name of a kernel's files"),
    (f"{CACHE}.CompileResultCacheImpl.locator", "", "compilation: folder and stamp of a kernel's files"),
    (f"{CACHE}.FunctionCache", "py_func", "compilation: compiled kernels by content"),
    (f"{CACHE}.FunctionCache._impl_class", "", "compilation: our locator instead of numba's"),
    (f"{CACHE}.FunctionCache._index_key", "self sig codegen", "compilation: key of a compiled kernel"),
    (f"{CACHE}.FunctionCache.save_overload", "self sig data", "compilation: refuses arrays that are not counted"),
    (f"{CACHE}.FunctionCache._guard_against_spurious_io_errors", "", "compilation: reports a cache on a full disk"),
    ("numba.core.compiler.Compiler.compile_extra", "self func", "compilation: no cycle collection in between"),
    ("numba.core.compiler.Compiler.__init__", "self typingctx targetctx library args return_type flags locals",
     "compilation: arrays that do not alias"),
    ("numba.core.serialize.dumps", "obj", "compilation: compiled kernels as bytes"),
    (f"{CODEGEN}._optimize_final_module", "self", "compilation: optimises at the first call"),
    (f"{CODEGEN}._finalize_final_module", "self", "compilation: emits code at the first call"),
    (f"{CODEGEN}._finalize_dynamic_globals", "self", "compilation: the first half of it"),
    (f"{CODEGEN}._verify_declare_only_symbols", "self", "compilation: the first half of it"),
    (f"{CODEGEN}._ensure_finalized", "self", "compilation: before the first call"),
    (f"{CODEGEN}._get_module_for_linking", "self", "compilation: keeps the code for other kernels"),
    (f"{CODEGEN}.get_pointer_to_function", "self name", "compilation: when code is needed"),
    (f"{CODEGEN}.serialize_using_object_code", "self", "compilation: stores code that was needed"),
    (f"{CODEGEN}.serialize_using_bitcode", "self", "compilation: stores code that was not"),
    (f"{CODEGEN}.get_llvm_str", "self", "intermediate_code: text of a function"),
    (f"{CODEGEN}.enable_object_caching", "self", "compilation: a library that is optimised less"),
    ("numba.core.codegen.JITCPUCodegen.create_library", "self name kwargs", "compilation: the same"),
    ("numba.core.codegen.JITCPUCodegen._module_pass_manager", "self kwargs", "compilation: optimises it less"),
    ("numba.core.codegen.JITCPUCodegen.set_env", "self env_name env", "compilation: later, where no code is there yet"),
    ("numba.core.cgutils.gep_inbounds", "builder ptr inds kws", "references: a field"),
    ("numba.core.cgutils.voidptr_t", "", "references: an address"),
    ("numba.core.imputils.impl_ret_borrowed", "ctx builder retty ret", "references: a field, not counted"),
    ("numba.core.registry.cpu_target.target_context", "", "references: types as in memory"),
    (f"{CONTEXT}.get_abi_sizeof", "self ty", "references: bytes of a tuple"),
    (f"{CONTEXT}.get_data_type", "self ty", "references: a tuple as in memory"),
    (f"{CONTEXT}.pack_value", "self builder ty value ptr align", "references: writes a tuple"),
    (f"{CONTEXT}.unpack_value", "self builder ty ptr align", "references: reads a field"),
    (f"{TEMPLATES}.AttributeTemplate.generic_resolve", "", "references: type of a field"),
    (f"{TEMPLATES}.infer_getattr", "", "references: type of a field"),
]  # fmt: skip
# attributes that an object has, not its class, and those of a dispatcher; tests below need each of them
OF_OBJECTS = {
    "_cache", "_cache_file", "_compiled_object", "_engine", "_final_module", "_finalized", "_impl", "_linked_only",
    "_name", "_object_caching_enabled",
}  # fmt: skip
KNOWN = {name for path, *_ in INTERNALS for name in path.split(".")} | OF_OBJECTS | {"_messages"}  # of a model
FILES = sorted(Path(numba_internals.__file__).parent.glob("*.py"))


PROBE = """
import inspect, json, pydoc, sys

def parameters(path):
    at = pydoc.locate(path)
    try:
        return "gone" if at is None else " ".join(inspect.signature(at).parameters) if callable(at) else ""
    except ValueError:
        return ""

print(json.dumps([parameters(path) for path in json.load(sys.stdin)]))
"""


def test_names_inside_numba_are_as_we_know_them():
    """They are looked up in another process, where `compilation` has changed none."""
    twins = (f"{CACHE}.FunctionCache.gone", "", ""), (f"{CACHE}.FunctionCache._index_key", "self key", "")
    rows = [*INTERNALS, *twins]
    paths = json.dumps([path for path, *_ in rows])
    done = subprocess.run([sys.executable, "-c", PROBE], input=paths, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    changed = [
        f"numba {numba.__version__}: {path} has the parameters {found}, not {known}: {used}"
        for (path, known, used), found in zip(rows, json.loads(done.stdout), strict=True)
        if found == "gone" or known not in ("", found)
    ]
    assert len(changed) == len(twins), changed


def test_nothing_else_of_numbas_inside_is_used():
    """Private names of the package are in the table; ``tests/test_house.py`` sees to it that no other reaches in."""
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
    for name in {path.rpartition(".")[2] for path, *_ in INTERNALS} | OF_OBJECTS:
        assert re.search(rf"\b{re.escape(name)}\b", text), f"nothing uses {name} any more"


def test_the_version_in_use_is_the_tested_one():
    assert numba.__version__.startswith(numba_internals.TESTED)
