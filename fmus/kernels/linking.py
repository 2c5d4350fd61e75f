"""Deferred linking of kernels: machine code only for those that Python calls, callees included.

numba optimises each function with all that it calls and emits machine code for it, although a function that only others
call is copied into their code and compiled again there. Here both wait until the address of a function is requested: a
cold start of a vehicle takes a third less. ``internal`` with SLP saves 8 % of a warm run. The module depends on numba's
internals: with a version other than ``TESTED`` numba compiles its standard way, to the same bits.
"""

from __future__ import annotations

import logging
from contextlib import suppress
from typing import Any

import numba
from numba import config
from numba.core.codegen import JITCodeLibrary, JITCPUCodegen

TESTED = "0.68."  # prefix of the versions of numba whose internals are known; pyproject.toml allows no later ones
OURS, OWN = "_ZN4fmus", ".own"  # prefix of mangled names of this package's functions; suffix of a kernel's copies
PARTS = ("_optimize_final_module", "_finalize_final_module", "get_pointer_to_function", "serialize_using_object_code")
Environments = dict[str, Any]  # of numba, by the name of their variable


def internal(library: Any) -> None:
    """Make the functions that a kernel of this package calls internal to its library.

    Visible functions keep their general form in LLVM: arrays stay tuples in memory and are counted at each call. LLVM
    rewrites internal functions with fewer arguments: the same operations in the same order, hence the same bits, in 0.6
    of the time. They get names of their own, because numba's linker binds internal names too, and a rewritten function
    has other arguments. Functions that count references keep their names, by which numba removes pairs of counts.
    """
    with suppress(AttributeError):
        functions = [function for function in library._final_module.functions if not function.is_declaration]
        if any(OURS in function.name for function in functions):
            for function in functions:
                if function.linkage.name == "linkonce_odr" and not function.name.startswith("NRT_"):
                    function.linkage = "internal"
                    function.name = f"{function.name}{OWN}"


def defer() -> None:
    """Make numba optimise and emit a function when its address is requested."""
    # neighbouring operations become one, with the same bits: half of those on the matrices of links
    config.SLP_VECTORIZE = 1  # type: ignore[attr-defined]
    optimise, finish, get_pointer, store = (getattr(JITCodeLibrary, name) for name in PARTS)
    set_environment = JITCPUCodegen.set_env
    waiting: Environments = {}  # of functions without an address, by the name of the variable for the pointer

    def linked(library: Any) -> None:
        if library._object_caching_enabled and library._compiled_object:  # from the cache
            finish(library)
            return
        library._finalize_dynamic_globals()
        library._verify_declare_only_symbols()
        library._finalized = library._linked_only = True

    def pointer(library: Any, name: str) -> int:
        library._ensure_finalized()
        if getattr(library, "_linked_only", False):
            defined = {function.name for function in library._final_module.functions if not function.is_declaration}
            if name not in defined:
                return 0
            library._linked_only = False
            library._get_module_for_linking()  # keeps the unchanged module for the linking of other kernels
            internal(library)
            optimise(library)
            library._final_module.verify()
            finish(library)
            for variable in library._final_module.global_variables:
                if variable.name in waiting:
                    set_environment(library.codegen, variable.name, waiting[variable.name])
        address: int = get_pointer(library, name)
        return address

    def bound(codegen: Any, name: str, environment: Any) -> None:
        """``set_env``: set now if the engine has the variable, else in ``pointer``."""
        if codegen._engine.is_symbol_defined(name):
            set_environment(codegen, name, environment)
        else:
            waiting[name] = environment

    def stored(library: Any) -> Any:
        library._ensure_finalized()
        return library.serialize_using_bitcode() if getattr(library, "_linked_only", False) else store(library)

    for name, ours in zip(PARTS, (lambda library: None, linked, pointer, stored), strict=True):
        setattr(JITCodeLibrary, name, ours)
    JITCPUCodegen.set_env = bound  # type: ignore[method-assign]


if numba.__version__.startswith(TESTED):
    defer()
else:
    logging.getLogger("cotrack").warning(
        "kernels take longer to compile and to run: numba is %s, not %sx", numba.__version__, TESTED
    )
