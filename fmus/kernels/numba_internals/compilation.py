"""Compilation of a kernel, cached by the content of its sources, and deferred linking.

numba's own cache is keyed by the path of the source file, so that an FMU unpacked elsewhere compiles again, and reads
that file alone, so that an edited callee in another module is missed and old machine code runs. Here a kernel is keyed
by a hash of its module and of every module of this package that it reaches by imports. An overload is one file, named
by signature, by the same hash of the classes in it, by processor and compiler, and written as a whole, so processes may
compile at the same time. A file with a wrong checksum is compiled again, because damaged machine code would end the
process. A kernel that the cache lacks is taken from a pack, if there is one (``fmus.cache.pack``).

numba optimises each function with all that it calls and emits machine code for it, although a function that only others
call is copied into their code and compiled again there. Here both wait until the address of a function is requested: a
cold start of a vehicle takes a third less. ``internal`` with SLP saves 8 % of a warm run. With another version of numba
than the tested one it compiles its standard way, to the same bits.
"""

from __future__ import annotations

import gc
import hashlib
import logging
import pickle
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import llvmlite.binding
import numba
import numpy
from numba import config
from numba.core.caching import CompileResultCacheImpl, FunctionCache, _CacheLocator
from numba.core.codegen import JITCodeLibrary, JITCPUCodegen
from numba.core.compiler import Compiler
from numba.core.serialize import dumps

from fmus.cache import pack
from fmus.cache.files import cache_folder, private_folder, read_checked, reporting_errors, write_checked
from fmus.cache.sources import reachable_hash
from fmus.kernels.numba_internals import other_version

COMPILED = logging.getLogger("cotrack.kernels")  # logs each kernel that has to be compiled
REACHED = "_reached"  # attribute of a class: hash of the modules that a ``dispatch`` chooses by it
# numba's settings that change the machine code of a source
SETTINGS = ("BOUNDSCHECK", "OPT", "LOOP_VECTORIZE", "SLP_VECTORIZE", "USING_SVML", "DEBUGINFO_DEFAULT")
OPTIONS: dict[str, Any] = {"error_model": "numpy", "nogil": True, "_nrt": False, "no_cfunc_wrapper": True}
INNER = {"no_cpython_wrapper": True}
OURS, OWN = "_ZN4fmus", ".own"  # prefix of mangled names of this package's functions; suffix of a kernel's copies
PARTS = ("_optimize_final_module", "_finalize_final_module", "get_pointer_to_function", "serialize_using_object_code")
Environments = dict[str, Any]  # of numba, by the name of their variable


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
        settings = [getattr(config, name, None) for name in SETTINGS]
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
        if not pack.has_level():
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
        return pack.has_level() and any(name.startswith(start) for name in pack.names())

    def files(self) -> Iterator[Path]:
        return self._folder.glob(f"{self._stem}.*.kernel")


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


class _StartCompiler(_PlainCompiler):
    """The compiler for kernels declared ``at_start``."""

    def compile_extra(self, function: Any) -> Any:
        library = self.state.targetctx.codegen().create_library(function.__qualname__)
        library.enable_object_caching()
        library.is_of_start = True
        self.state.library = library
        return super().compile_extra(function)


def compiled(function: Callable[..., Any], options: dict[str, Any]) -> Any:
    """Two kernels of a function: one that Python calls, and one for kernels, without an entry from Python.

    An entry from Python checks every array of every tuple, for a chain some fifty, and takes longer to compile than
    most kernels.
    """
    declared = {"noalias": _NoAliasCompiler, "at_start": _StartCompiler}
    compilers = [compiler for name, compiler in declared.items() if hasattr(function, name)]
    options = options | {"pipeline_class": (*compilers, _PlainCompiler)[0]}
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
        outer.get_overload, outer.inner = inner.get_overload, inner
    return outer


def compiled_before(function: Any) -> bool:
    """Whether the cache or a pack has a kernel for some types of its arguments, or none is needed (plain Python)."""
    made = getattr(function, "_cache", None)
    return not isinstance(made, _Cache) or any(made._cache_file.files()) or made._cache_file.is_packed()


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
            (simplify if hasattr(library, "is_of_start") else optimise)(library)
            library._final_module.verify()
            finish(library)
            for variable in library._final_module.global_variables:
                if variable.name in waiting:
                    set_environment(library.codegen, variable.name, waiting[variable.name])
        address: int = get_pointer(library, name)
        return address

    def simplify(library: Any) -> None:
        """LLVM's level 1 instead of 3, for what a run calls a few times; the bits are the same."""
        passes, builder = library.codegen._module_pass_manager(opt=1, loop_vectorize=False, slp_vectorize=False)
        passes.run(library._final_module, builder)

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


if unknown := other_version("kernels take longer to compile and to run"):
    logging.getLogger("cotrack").warning("%s", unknown)
else:
    defer()
