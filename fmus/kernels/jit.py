"""Declaration of kernels; ``numba_internals`` compiles them, cached by the content of their sources."""

from __future__ import annotations

import inspect
import sys
from collections.abc import Callable
from functools import wraps
from importlib import import_module
from importlib.util import resolve_name
from pathlib import Path
from typing import Any, TypeVar

import numba
from numba.extending import overload

from fmus.cache.sources import reachable_hash
from fmus.kernels.numba_internals.compilation import INNER, OPTIONS, REACHED, compiled
from fmus.kernels.numba_internals.compilation import compiled_before as compiled_before
from fmus.kernels.numba_internals.references import by_reference as by_reference

Kernel = TypeVar("Kernel", bound=Callable[..., Any])  # a kernel has the type of its Python function
Class = TypeVar("Class", bound=type)
IMPLEMENTED = "_implemented"  # attribute of a class: module by group of functions


def kernel(function: Kernel) -> Kernel:
    """Compile a kernel: no Python objects, no GIL, IEEE division, cached by content.

    A kernel makes no arrays and borrows its arguments: it counts no references, which would cost as much as a contact.
    A kernel that makes an array must be ``allocating``. Kernels call kernels by import, because the cache does not find
    a kernel that closes over a jitted function or takes one as an argument. With ``NUMBA_DISABLE_JIT=1`` the function
    is returned unchanged; with ``NUMBA_BOUNDSCHECK=1`` it checks its indices.
    """
    return compiled(function, OPTIONS)


def allocating(function: Kernel) -> Kernel:
    """Compile a kernel that makes arrays or calls one that returns them; it counts references."""
    return compiled(function, OPTIONS | {"_nrt": True})


def noalias(function: Kernel) -> Kernel:
    """Declare, below ``kernel`` or ``allocating``, that arrays do not alias (Fortran's rule).

    No array argument that the kernel writes overlaps another array that it uses. The compiler then keeps entries in
    registers and does several operations at once, with the same bits in three quarters of the time; otherwise each
    store might change every entry.
    """
    function.noalias = True  # type: ignore[attr-defined]
    return function


def at_start(function: Kernel) -> Kernel:
    """Declare, below ``kernel`` or ``allocating``, that Python calls the kernel before a run steps, not at each step.

    It is optimised less, to the same bits: LLVM needs a fifth of the time, a start as long as before.
    """
    function.at_start = True  # type: ignore[attr-defined]
    return function


def plain(function: Kernel) -> Kernel:
    """Python function of a kernel, for calls that are not worth compiling."""
    return getattr(function, "py_func", function)


def implemented_in(**modules: str) -> Callable[[Class], Class]:
    """Declare in which modules the functions on a class of parameters are, by group of functions; subclasses inherit.

    A module that begins with a dot is relative to the package of the class. It is imported when a ``dispatch``
    chooses it, not before; the hash of a kernel that takes the class follows it.
    """

    def declared(kind: Class) -> Class:
        package = kind.__module__.rpartition(".")[0]
        module_names = {group: resolve_name(name, package) for group, name in modules.items()}
        setattr(kind, IMPLEMENTED, {**getattr(kind, IMPLEMENTED, {}), **module_names})
        setattr(kind, REACHED, reachable_hash(kind.__module__, Path(str(sys.modules[kind.__module__].__file__))))
        return kind

    return declared


def namesake(function: Kernel) -> Kernel:
    """Declare a ``kernel`` to be what a stub of ``dispatch`` calls; the stub's docstring is that of both."""
    return kernel(function)


def implementation(group: str, optional: bool = False) -> Callable[[type], Any]:
    """Function that returns the module of a ``group`` of functions on a class.

    Where the class declares none, it returns None if the group is ``optional``, else it raises TypeError.
    """

    def module_of(kind: type) -> Any:
        module = getattr(kind, IMPLEMENTED, {}).get(group)
        if module is None and not optional:
            raise TypeError(f"{kind.__name__} does not declare in which module its {group} are: see jit.implemented_in")
        return module and import_module(module)

    return module_of


def dispatch(
    group: str | Callable[[type], Any], shared: bool = False, default: bool = False
) -> Callable[[Callable[..., Any]], Any]:
    """Make a stub call its namesake in the module of a ``group`` that the type of the first argument declares.

    Kernels call kernels by import; a stub chooses when its caller is compiled, so that nothing else is imported or
    compiled. Instead of a name, ``group`` may be a function from the type to the module, which it imports by name; the
    hash follows that too. A namesake becomes part of its caller; with ``shared`` it is compiled once for all of them,
    which is for those that are large or make arrays. With ``default`` the body of the stub is that of all classes that
    declare no module of this group, or one without a namesake.
    """
    module_of = implementation(group, optional=default) if isinstance(group, str) else group

    def decorate(stub: Callable[..., Any]) -> Any:
        def namesake_of(kind: type) -> Any:
            return getattr(module_of(kind), stub.__name__, *([stub] if default else []))

        @wraps(stub)
        def plain(*args: Any) -> Any:
            return namesake_of(type(args[0]))(*args)

        def chosen(*args: Any) -> Any:
            found = namesake_of(getattr(args[0], "instance_class", type(None)))
            function = getattr(found, "py_func", found)
            if [*inspect.signature(function).parameters] != [*signature.parameters]:
                raise TypeError(f"{found.__module__}.{stub.__name__}: other parameters than those of its stub")
            if shared and found is not stub:  # the body of a stub is no kernel
                caller = eval(f"lambda {names}: namesake({names})", {"namesake": found})
                # numba numbers functions as a process meets them: of two processes' kernels in one, a number and the
                # name <lambda> may mean two functions, and the linker takes the one for the other
                caller.__name__ = caller.__qualname__ = f"{found.__module__}.{stub.__name__}".replace(".", "_")
                return caller
            return function

        signature = inspect.signature(stub)
        names = ", ".join(signature.parameters)
        chosen.__signature__ = signature  # type: ignore[attr-defined]
        # not strict: numba would compare annotations too, and those of a stub and of its namesakes differ
        overload(plain, jit_options=OPTIONS | INNER, strict=False)(chosen)  # type: ignore[arg-type]
        return plain

    return decorate


def entry(function: Callable[..., Any], *like: Any) -> Callable[..., Any]:
    """Machine code of a kernel for arguments of the types of ``like``; a call takes a tenth of the time.

    At each call of a kernel numba checks the type of every array in every tuple, 8 us for a chain. Here the caller must
    pass the right types: arguments of other types are misread.
    """
    compile_for = getattr(function, "compile", None)  # none with NUMBA_DISABLE_JIT
    return compile_for(tuple(map(numba.typeof, like))) if compile_for else function


def compile_inner(function: Callable[..., Any], *like: Any) -> None:
    """Compile a kernel, for arguments of the types of ``like``, as kernels call it: without machine code of its own."""
    inner = getattr(function, "inner", None)  # none with NUMBA_DISABLE_JIT
    if inner is not None:
        inner.compile(tuple(map(numba.typeof, like)))
