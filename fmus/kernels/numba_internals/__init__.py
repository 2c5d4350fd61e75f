"""All that depends on the inside of numba, which numba does not promise: cache, compilers, linking, references.

No other module imports from ``numba.core`` or changes numba; ``tests/fmus/test_numba_internals.py`` lists what is used.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numba

TESTED = "0.68."  # prefix of the versions whose inside is known; pyproject.toml allows no later ones


def other_version(so: str) -> str:
    """Sentence that says what another version means, ``so``; empty for one whose inside is known."""
    known = numba.__version__.startswith(TESTED)
    return "" if known else f"{so}: numba is {numba.__version__}, not {TESTED}x, whose inside is known"


def intermediate_code(
    function: Callable[..., Any], signature: Any, emitted: bool = False, **options: Any
) -> tuple[str, str]:
    """LLVM text of a function with all that it calls, and its name there; ``emitted``: as numba optimises it.

    Before its arguments it takes the addresses of its result and of an exception; it returns 0, or else has raised one.
    """
    options |= {"error_model": "numpy", "no_cpython_wrapper": True, "no_cfunc_wrapper": True}
    settings: Any = numba.config
    disabled, settings.DISABLE_JIT = settings.DISABLE_JIT, 0  # Python cannot run all of them uncompiled
    try:
        dispatcher: Any = numba.njit(**options)(function)
        dispatcher.compile(signature)
    finally:
        settings.DISABLE_JIT = disabled
    (compiled,) = dispatcher.overloads.values()
    library, name = compiled.library, compiled.fndesc.llvm_func_name
    if emitted:
        library.get_pointer_to_function(name)  # which optimises it, also where linking is deferred
    return library.get_llvm_str(), name
