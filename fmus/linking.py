"""How numba links and emits kernels: machine code for those that Python calls, what they call inside them.

numba optimises each function with all that it calls and emits machine code for it, although what only others call is
copied into theirs and done again there. Here both wait until somebody asks for the address of a function: a cold start
of a vehicle takes a third less. ``internal`` with SLP saves 8 % of a warm run. This reaches into numba: with a version
that is not ``TESTED`` it compiles its plain way, to the same bits.
"""

from __future__ import annotations

import logging
from contextlib import suppress
from typing import Any

import numba
from numba import config
from numba.core.codegen import JITCodeLibrary, JITCPUCodegen

TESTED = "0.68."  # begins the versions of numba whose insides this module knows; pyproject.toml allows no later ones
OURS, OWN = "_ZN4fmus", ".own"  # begins the names of our functions as LLVM knows them; ends those of a kernel's copies
PARTS = ("_optimize_final_module", "_finalize_final_module", "get_pointer_to_function", "serialize_using_object_code")
Environments = dict[str, Any]


def internal(library: Any) -> None:
    """Make the functions that one of our kernels calls its own.

    They are otherwise visible to others, and LLVM keeps them in their general form: arrays stay tuples in memory and
    are counted at each call. Internal functions are taken apart: the same operations in the same order, hence the same
    bits, in 0.6 of the time. They get names of their own, because numba's linker binds names whether internal or not,
    and a function that was taken apart has other arguments. What counts references keeps its name, by which numba
    leaves out what cancels.
    """
    with suppress(AttributeError):
        functions = [each for each in library._final_module.functions if not each.is_declaration]
        if any(OURS in each.name for each in functions):
            for each in functions:
                if each.linkage.name == "linkonce_odr" and not each.name.startswith("NRT_"):
                    each.linkage = "internal"
                    each.name = f"{each.name}{OWN}"


def defer() -> None:
    """Have numba optimise and emit a function when its address is asked for."""
    # operations beside each other become one, with the same bits: on the matrices of links half of them
    config.SLP_VECTORIZE = 1  # type: ignore[attr-defined]
    optimise, finish, point, store = (getattr(JITCodeLibrary, name) for name in PARTS)
    bind = JITCPUCodegen.set_env
    waiting: Environments = {}  # of functions without an address, by the name of the variable that points to it

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
            defined = {each.name for each in library._final_module.functions if not each.is_declaration}
            if name not in defined:
                return 0
            library._linked_only = False
            library._get_module_for_linking()  # as others want it, before it is changed
            internal(library)
            optimise(library)
            library._final_module.verify()
            finish(library)
            for variable in library._final_module.global_variables:
                if variable.name in waiting:
                    bind(library.codegen, variable.name, waiting[variable.name])
        address: int = point(library, name)
        return address

    def bound(codegen: Any, name: str, environment: Any) -> None:
        if codegen._engine.is_symbol_defined(name):
            bind(codegen, name, environment)
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
