"""Compilation of kernels, cached by the content of their sources.

numba's own cache is keyed by the path of the source file, so that an FMU unpacked elsewhere compiles again, and reads
that file alone, so that an edited callee in another module is missed and old machine code runs. Here a kernel is keyed
by a hash of its module and of every module of this package that it reaches by imports. An overload is one file, named
by signature, by the same hash of the classes in it, by processor and compiler, and written as a whole, so processes may
compile at the same time. A file with a wrong checksum is compiled again, because damaged machine code would end the
process. A kernel that the cache lacks is taken from a pack, if there is one (``fmus.cache.pack``).
"""

from __future__ import annotations

import gc
import hashlib
import inspect
import logging
import pickle
import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from functools import cache, wraps
from importlib import import_module
from importlib.util import resolve_name
from pathlib import Path
from typing import Any, TypeVar

import llvmlite
import llvmlite.binding
import numba
import numpy
from numba.core.caching import CompileResultCacheImpl, FunctionCache, _CacheLocator
from numba.core.compiler import Compiler
from numba.core.serialize import dumps
from numba.extending import overload

from fmus.cache import pack
from fmus.cache.files import cache_folder, private_folder, read_checked, reporting_errors, write_checked
from fmus.cache.sources import reachable_hash
from fmus.kernels import by_reference, linking  # noqa: F401 - change how numba passes tuples, and how it links

COMPILED = logging.getLogger("cotrack.kernels")  # logs each kernel that has to be compiled
Kernel = TypeVar("Kernel", bound=Callable[..., Any])  # a kernel has the type of its Python function
Class = TypeVar("Class", bound=type)
IMPLEMENTED, REACHED = "_implemented", "_reached"  # attributes of a class: module by group of functions; their hash
# numba's settings that change the machine code of a source
SETTINGS = ("BOUNDSCHECK", "OPT", "LOOP_VECTORIZE", "SLP_VECTORIZE", "USING_SVML", "DEBUGINFO_DEFAULT")


class _Locator(_CacheLocator):
    """Folder and stamp of a kernel in the cache, from the hash of the sources that it reaches."""

    def __init__(self, function: Callable[..., Any], file: str) -> None:
        self._py_file = file  # numba names it in warnings
        self._module = function.__module__
        self._line = function.__code__.co_firstlineno
        self._stamp = reachable_hash(function.__module__, Path(file))

    def get_cache_path(self) -> str:
        return str(cache_folder() / "kernels" / f"{self._module}-{self._stamp[:20]}")

    def ensure_cache_path(self) -> None:
        private_folder(Path(self.get_cache_path()))

    def get_source_stamp(self) -> str:
        return self._stamp

    def get_disambiguator(self) -> str:
        return str(self._line)

    @classmethod
    def from_function(cls, py_func: Callable[..., Any], py_file: str) -> _Locator:
        return cls(py_func, py_file)


class _Implementation(CompileResultCacheImpl):
    _locator_classes = [_Locator]  # noqa: RUF012 - numba's own name for it


class _Overloads:
    """Overloads of a kernel, one file each: numba's index loses or swaps entries when two processes write."""

    def __init__(self, folder: Path, stem: str, stamp: str) -> None:
        self._folder, self._stem, self._stamp = folder, stem, stamp

    def _path(self, key: object) -> Path:
        settings = [getattr(numba.config, name, None) for name in SETTINGS]
        # numba itself takes a kernel for any version of numpy
        made = (numba.__version__, llvmlite.__version__, numpy.__version__[0], settings, self._stamp, key)
        name = hashlib.sha256(repr(made).encode()).hexdigest()
        return self._folder / f"{self._stem}.{name[:24]}.kernel"

    def load(self, key: Any) -> Any:
        content = None
        with reporting_errors():
            content = read_checked(self._path(key))
        if content := content or self._packed(key):
            with suppress(Exception):  # of a class that is gone
                return pickle.loads(content)
        COMPILED.info("%s is compiled%s", self._stem, ": no pack fits" * any(pack.names()))
        return None

    def _packed(self, key: Any) -> bytes | None:
        """Kernel in a pack, for the level instead of this processor."""
        if not _has_level():
            return None
        signature, (triple, *_), *rest = key
        return pack.read("/".join(self._path((signature, (triple, *pack.LEVEL), *rest)).parts[-3:]))

    def save(self, key: object, data: object) -> None:
        write_checked(self._path(key), dumps(data))

    def flush(self) -> None:
        for path in self.files():
            path.unlink(missing_ok=True)

    def is_packed(self) -> bool:
        """Whether a pack has an overload of the kernel."""
        start = f"{pack.KERNELS}/{self._folder.name}/{self._stem}."
        return _has_level() and any(name.startswith(start) for name in pack.names())

    def files(self) -> Iterator[Path]:
        return self._folder.glob(f"{self._stem}.*.kernel")


@cache
def _has_level() -> bool:
    """Whether this processor has the level of packs."""
    features = llvmlite.binding.get_host_cpu_features()
    return all(features.get(name) for name in pack.FEATURES)


def _classes(types: Iterable[Any]) -> Iterator[type]:
    """Classes of the named tuples among numba types and inside them: they choose the module of a ``dispatch``."""
    for numba_type in types:
        if hasattr(numba_type, "instance_class"):
            yield numba_type.instance_class
        yield from _classes(getattr(numba_type, "types", ()))


class _Cache(FunctionCache):
    _impl_class = _Implementation
    counts_references = False  # whether the kernel counts references to arrays

    def save_overload(self, sig: Any, data: Any) -> None:
        """Save an overload; raises TypeError for a kernel that returns an array without counting references."""
        if not self.counts_references and "array(" in str(data.signature.return_type):
            raise TypeError(f"the kernel {self._name} returns an array: it must be ``allocating``")
        super().save_overload(sig, data)

    def __init__(self, function: Callable[..., Any], part: str) -> None:
        super().__init__(function)
        locator, stem = self._impl.locator, f"{self._impl.filename_base}{part}"
        self._cache_file: Any = _Overloads(Path(locator.get_cache_path()), stem, locator.get_source_stamp())

    def _index_key(self, signature: Any, codegen: Any) -> tuple[Any, ...]:
        """Key of an overload: numba's, and hashes of the sources that `dispatch` chooses for these arguments."""
        hashes = {getattr(kind, REACHED, "") for kind in _classes(signature)}
        return (*super()._index_key(signature, codegen), sorted(hashes))

    _guard_against_spurious_io_errors = staticmethod(reporting_errors)

    def has_overloads(self) -> bool:
        """Whether there is any overload, in the cache or a pack."""
        return any(self._cache_file.files()) or self._cache_file.is_packed()


OPTIONS: dict[str, Any] = {"error_model": "numpy", "nogil": True, "_nrt": False, "no_cfunc_wrapper": True}
INNER = {"no_cpython_wrapper": True}


def kernel(function: Kernel) -> Kernel:
    """Compile a kernel: no Python objects, no GIL, IEEE division, cached by content.

    A kernel makes no arrays and borrows its arguments: it counts no references, which would cost as much as a contact.
    A kernel that makes an array must be ``allocating``. Kernels call kernels by import, because the cache does not find
    a kernel that closes over a jitted function or takes one as an argument. With ``NUMBA_DISABLE_JIT=1`` the function
    is returned unchanged; with ``NUMBA_BOUNDSCHECK=1`` it checks its indices.
    """
    compiled: Kernel = _compiled(function, OPTIONS)
    return compiled


def allocating(function: Kernel) -> Kernel:
    """Compile a kernel that makes arrays or calls one that returns them; it counts references."""
    compiled: Kernel = _compiled(function, OPTIONS | {"_nrt": True})
    return compiled


def noalias(function: Kernel) -> Kernel:
    """Declare, below ``kernel`` or ``allocating``, that arrays do not alias (Fortran's rule).

    No array argument that the kernel writes overlaps another array that it uses. The compiler then keeps entries in
    registers and does several operations at once, with the same bits in three quarters of the time; otherwise each
    store might change every entry.
    """
    function.noalias = True  # type: ignore[attr-defined]
    return function


class _PlainCompiler(Compiler):
    """numba's compiler without Python's cycle collection, which would take a tenth of its time."""

    def compile_extra(self, function: Any) -> Any:
        collecting = gc.isenabled()
        gc.disable()
        try:
            return super().compile_extra(function)
        finally:
            if collecting:
                gc.enable()


class _NoAliasCompiler(_PlainCompiler):
    """The compiler for kernels declared ``noalias``."""

    def __init__(self, typing: Any, target: Any, library: Any, args: Any, result: Any, flags: Any, local: Any) -> None:
        flags.noalias = True
        super().__init__(typing, target, library, args, result, flags, local)


def _compiled(function: Callable[..., Any], options: dict[str, Any]) -> Any:
    """Two kernels of a function: one that Python calls, and one for kernels, without an entry from Python.

    An entry from Python checks every array of every tuple, for a chain some fifty, and takes longer to compile than
    most kernels.
    """
    options = options | {"pipeline_class": _NoAliasCompiler if getattr(function, "noalias", False) else _PlainCompiler}
    outer = numba.njit(**options)(function)
    if outer is not function:
        inner = numba.njit(**options | INNER)(function)
        for compiled, part in ((outer, ""), (inner, ".inner")):
            compiled._cache = _Cache(function, part)  # what numba's cache=True does, with our cache
            compiled._cache.counts_references = options["_nrt"]
        # otherwise each constant argument has a type of its own and is compiled separately
        outer.get_call_template = lambda args, kws: inner.get_call_template(
            tuple(map(numba.types.unliteral, args)), kws
        )
        outer.get_overload = inner.get_overload
    return outer


def plain(function: Kernel) -> Kernel:
    """Python function of a kernel, for calls that are not worth compiling."""
    function_of: Kernel = getattr(function, "py_func", function)
    return function_of


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
    compiled = getattr(function, "compile", None)  # none with NUMBA_DISABLE_JIT
    return compiled(tuple(map(numba.typeof, like))) if compiled else function


def compiled_before(function: Any) -> bool:
    """Whether the cache has a kernel for some types of its arguments; otherwise its first call compiles."""
    if not isinstance(getattr(function, "_cache", None), _Cache):  # NUMBA_DISABLE_JIT
        return True
    return function._cache.has_overloads()
