"""Kernels of this folder as C functions without Python's lock, cached as one object file.

numba compiles them, llvmlite links them into an object file named by the hash of this folder: a process that finds it
need not import numba. The functions need the C library alone; one that needs Python's run time is refused.
"""

from __future__ import annotations

import ctypes
import hashlib
import logging
import platform
import sys
from collections.abc import Callable, Sequence
from contextlib import suppress
from functools import cache
from importlib import import_module
from importlib.metadata import version
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import llvmlite.binding as llvm

from fmus.cache import pack
from fmus.cache.files import cache_folder, private_folder, read_checked, write_checked

INSIDE = Path(pack.__file__).parents[1] / "kernels" / "numba_internals" / "__init__.py"  # makes intermediate code
CAN_STEP = sys.platform == "linux" and platform.machine() == "x86_64"  # on which ``stepping`` is tested
WORD, REAL = ctypes.c_int64, ctypes.c_double
PACKING = {"copy_words": (WORD,) * 8}
STEPPING = {
    "step_all": (WORD, REAL, REAL),
    "step_many": (*(WORD,) * 8, REAL),
    "work": (WORD, WORD),
    "set_state": (WORD, WORD),
}
KERNELS: dict[str, dict[str, Any]] = {"packing": PACKING, **({"stepping": STEPPING} if CAN_STEP else {})}
FROM_C = {"clock_gettime", "memcpy", "sched_yield", "sem_post", "sem_wait"}
COMPILED = logging.getLogger("cotrack.kernels")  # receives a message for each compilation


@cache
def kernels() -> SimpleNamespace:
    """Load all kernels, compiled if necessary; return them by name. Each returns an integer."""
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    llvm.initialize_native_asmparser()
    content = cached(cache_key(), _object_file)
    engine = llvm.create_mcjit_compiler(llvm.parse_assembly(""), processor())
    engine.add_object_file(llvm.ObjectFileRef.from_data(content))
    engine.finalize_object()
    functions = {
        name: function(name, engine.get_function_address(name), kinds)
        for group in KERNELS.values()
        for name, kinds in group.items()
    }
    return SimpleNamespace(engine=engine, **functions)


def function(name: str, address: int, kinds: Sequence[Any]) -> Callable[..., int]:
    """Wrap a kernel in numba's calling convention: addresses of result and exception, then arguments.

    The wrapper raises RuntimeError if the kernel raised.
    """
    kernel = ctypes.CFUNCTYPE(ctypes.c_int32, ctypes.POINTER(WORD), ctypes.POINTER(WORD), *kinds)(address)

    def call(*values: float) -> int:
        result, exception = WORD(), WORD()
        if kernel(result, exception, *values):
            raise RuntimeError(f"the kernel {name} raised an exception")
        return result.value

    return call


def cache_key() -> str:
    """Hash of the sources of this folder and of ``INSIDE``, the versions of compilers, system and type of processor."""
    digest = hashlib.sha256()
    for source in (*sorted(Path(__file__).parent.glob("*.py")), INSIDE):
        digest.update(source.name.encode() + b"\0" + hashlib.sha256(source.read_bytes()).digest())
    for text in (version("numba"), version("llvmlite"), sys.platform, platform.machine()):
        digest.update(text.encode() + b"\0")
    return digest.hexdigest()[:24]


def cached(key: str, make: Callable[[], bytes]) -> bytes:
    """Return the object file of the cache or a pack, or make and cache it; an unusable cache is ignored."""
    file = cache_folder() / "kernels" / "orchestrator" / f"{key}.o"
    with suppress(OSError):
        if content := read_checked(file) or pack.read("/".join(file.parts[-3:])):
            return content
    COMPILED.info("the orchestrator's kernels are compiled")
    content = make()
    with suppress(OSError):
        private_folder(file.parent)
        write_checked(file, content)
    return content


def _object_file() -> bytes:
    """Compile all kernels into one object file."""
    linked = llvm.parse_assembly("")
    for module, functions in KERNELS.items():
        for name, kinds in functions.items():
            linked.link_in(compiled(getattr(import_module(f"orchestrator.kernels.{module}"), name), kinds))
    return bytes(processor().emit_object(linked))


def compiled(kernel: Callable[..., Any], kinds: Sequence[Any]) -> llvm.ModuleRef:
    """Compile a kernel with its callees into an LLVM module that exports the kernel's name.

    ``kinds``: C types of the arguments. Raises TypeError if the kernel needs Python's run time.
    """
    from numba import types

    from fmus.kernels.numba_internals import intermediate_code

    numba_type = {WORD: types.int64, REAL: types.float64}
    signature = types.int64(*(numba_type[kind] for kind in kinds))
    text, name = intermediate_code(kernel, signature, emitted=True, _nrt=False)
    module = llvm.parse_assembly(text)
    for symbol in (*module.functions, *module.global_variables):
        if not symbol.is_declaration:
            symbol.linkage = "internal"
    inner = module.get_function(name)
    inner.linkage, inner.name = "external", kernel.__name__
    module.triple = llvm.get_process_triple()
    passes = llvm.create_pass_builder(processor(), llvm.create_pipeline_tuning_options(speed_level=2))
    passes.getModulePassManager().run(module, passes)
    needed = {
        symbol.name for symbol in module.functions if symbol.is_declaration and not symbol.name.startswith("llvm.")
    }
    if needed - FROM_C:
        raise TypeError(f"the kernel {kernel.__name__} needs {', '.join(sorted(needed - FROM_C))}")
    return module


def processor() -> Any:
    """Target for any processor of this type, because machines may share the cache."""
    return llvm.Target.from_triple(llvm.get_process_triple()).create_target_machine(opt=2)
