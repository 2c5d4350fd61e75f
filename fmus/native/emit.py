"""Intermediate code of a component's entries -> object file, without Python, for any machine.

Everything but the entries becomes internal, and the whole is optimised once more, for a level of x86-64. LLVM neither
contracts nor reorders floating-point operations by itself, so each level gives the bits of the Python component.
"""

from __future__ import annotations

import re
from collections.abc import Sequence

import llvmlite.binding as llvm

from fmus.native.entries import EntryPoint
from fmus.native.link import Platform

ANY, WIDE = "x86-64-v2", "x86-64-v3"  # processors of the last fifteen years; those with AVX2
LEVELS = {"any_": ANY, "wide_": WIDE}  # by the prefix of the entries' names; the shell chooses


def emit(entries: Sequence[EntryPoint], prefix: str, platform: Platform) -> bytes:
    """Object file for a level of ``LEVELS``; raises RuntimeError if the code holds a process address."""
    machine = llvm.Target.from_triple(platform.triple).create_target_machine(
        cpu=LEVELS[prefix], features="", opt=3, reloc="pic", codemodel="small"
    )
    whole = None
    for entry in entries:
        module = _isolated_module(entry, prefix)
        if whole is None:
            whole = module
        else:
            whole.link_in(module)
    assert whole is not None
    whole.triple = platform.triple
    tuning = llvm.create_pipeline_tuning_options(speed_level=3)
    tuning.slp_vectorization = True
    passes = llvm.create_pass_builder(machine, tuning)
    passes.getModulePassManager().run(whole, passes)
    return bytes(machine.emit_object(whole))


def _isolated_module(entry: EntryPoint, prefix: str) -> llvm.ModuleRef:
    """LLVM module of an entry; all else in it is internal, named without numba's counters and hashes."""
    text = entry.compiled.library.get_llvm_str()
    if address := re.search(r"inttoptr \(i64 (\d{6,})", text):
        raise RuntimeError(f"the code of {entry.name} holds an address of this process, {address[1]}")
    module, entry_name = llvm.parse_assembly(text), entry.compiled.fndesc.llvm_func_name
    count = 0
    for symbol in (*module.functions, *module.global_variables):
        if symbol.is_declaration:
            continue
        count += 1
        if symbol.name == entry_name:
            symbol.name, symbol.linkage, symbol.visibility = prefix + entry.name, "external", "hidden"
        else:
            symbol.name, symbol.linkage = f"{entry.name}.{count}", "internal"
    return module
