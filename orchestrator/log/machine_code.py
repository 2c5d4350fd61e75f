"""Functions in LLVM's assembly language, made for this processor: they run without Python's lock."""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import llvmlite.binding as llvm

ADDRESS, WORD, REAL = ctypes.c_void_p, ctypes.c_int64, ctypes.c_double


class Code(NamedTuple):
    """What was made of a source; its functions are there as long as it is."""

    engine: Any
    functions: Mapping[str, Callable[..., Any]]

    def address(self, name: str) -> int:
        """Of any function of the source."""
        return int(self.engine.get_function_address(name))


def made(source: str, kinds: Mapping[str, Sequence[Any]]) -> Code:
    """The functions of a source, as ctypes: what they return, then what they are given, by name."""
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    llvm.initialize_native_asmparser()
    module = llvm.parse_assembly(source)
    module.triple = llvm.get_process_triple()
    target = llvm.Target.from_triple(module.triple).create_target_machine(opt=2)
    engine = llvm.create_mcjit_compiler(module, target)
    engine.finalize_object()
    functions = {name: ctypes.CFUNCTYPE(*kind)(engine.get_function_address(name)) for name, kind in kinds.items()}
    return Code(engine, functions)
