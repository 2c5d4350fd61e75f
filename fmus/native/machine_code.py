"""Machine code of a component: intermediate code of its entries -> object files, with C sources -> shared library.

The object files need no Python, for any machine. Everything but the entries becomes internal, and the whole is
optimised once more, for a level of x86-64. LLVM neither contracts nor reorders floating-point operations by itself, so
each level gives the bits of the Python component. The compiler of C is ziglang's or the system's. All platforms are on
x86-64.
"""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from collections.abc import Sequence
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path
from typing import NamedTuple

import llvmlite.binding as llvm

from fmus.cache.pack import has_level
from fmus.native.entries import EntryPoint

HERE = Path(__file__).parent
FLAGS = "-std=c11", "-O2", "-fvisibility=hidden", "-fno-sanitize=all", "-g0", "-shared", "-s"
INSTALLATION = "pip install -c constraints.txt -e '.[native]' in the clone of cotrack brings"
ANY, WIDE = "x86-64-v2", "x86-64-v3"  # processors of the last fifteen years; those with AVX2
LEVELS = {"any_": ANY, "wide_": WIDE}  # by the prefix of the entries' names; the shell chooses
Prefixes = tuple[str, ...]  # some of them


def sources(fmi: int) -> tuple[Path, ...]:
    """C sources of a library for a version of FMI (2 or 3)."""
    return tuple(HERE / name for name in (f"fmi{fmi}.c", "runtime.c", "processor.c"))


def headers(fmi: int) -> tuple[Path, ...]:
    """Files that ``sources`` include, but ``model.h``."""
    return HERE / f"fmi{fmi}.h", HERE / "instance.h", HERE / "numbers.h"


class Platform(NamedTuple):
    """Operating system, as its tools name it."""

    folder: str  # in an FMU's ``binaries``, as FMI 2.0 names it
    fmi3_folder: str  # as FMI 3.0 does
    suffix: str  # of a library
    triple: str  # target triple of LLVM
    target: str  # target of ziglang, with the oldest C library
    flags: tuple[str, ...]  # of the linker


LINUX = Platform(
    "linux64",
    "x86_64-linux",
    ".so",
    "x86_64-unknown-linux-gnu",
    "x86_64-linux-gnu.2.17",  # glibc of 2012
    ("-fPIC", "-Wl,-z,defs", "-Wl,-z,noexecstack", "-Wl,--gc-sections", "-Wl,--build-id=none"),
)
WINDOWS = Platform("win64", "x86_64-windows", ".dll", "x86_64-w64-windows-gnu", "x86_64-windows-gnu", ())


class NoCompiler(RuntimeError):
    """A C compiler is missing or failed; the message is one sentence."""


def compiler(platform: Platform = LINUX) -> list[str]:
    """Command of a C compiler for a platform; raises NoCompiler."""
    if find_spec("ziglang"):
        return [sys.executable, "-m", "ziglang", "cc", "-target", platform.target]
    if platform != LINUX:
        raise NoCompiler(f"libraries for Windows need the compiler ziglang: {INSTALLATION} it")
    for name in ("cc", "gcc", "clang"):
        if path := shutil.which(name):
            return [path]
    raise NoCompiler(f"native FMUs need a C compiler: {INSTALLATION} one")


def of_this_processor() -> Prefixes:
    """Prefix of the level for this processor alone, in half of the compilation."""
    return ("wide_",) if has_level() else ("any_",)


def definitions(prefixes: Prefixes) -> str:
    """Lines of ``model.h`` on the levels that a library has."""
    return "".join(f"#define FOR_{prefix[:-1].upper()} {int(prefix in prefixes)}\n" for prefix in LEVELS)


def compiler_release() -> str:
    """Name and version of the compiler."""
    if find_spec("ziglang"):
        return f"ziglang {version('ziglang')}"
    process = subprocess.run([*compiler(), "--version"], capture_output=True, text=True)
    return process.stdout.partition("\n")[0]


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
    if address := re.search(r"inttoptr \(i64 (\d{6,})", entry.text):
        raise RuntimeError(f"the code of {entry.name} holds an address of this process, {address[1]}")
    module, count = llvm.parse_assembly(entry.text), 0
    for symbol in (*module.functions, *module.global_variables):
        if symbol.is_declaration:
            continue
        count += 1
        if symbol.name == entry.symbol:
            symbol.name, symbol.linkage, symbol.visibility = prefix + entry.name, "external", "hidden"
        else:
            symbol.name, symbol.linkage = f"{entry.name}.{count}", "internal"
    return module


def link(objects: Sequence[Path], include: Path, library: Path, platform: Platform, fmi: int) -> None:
    """Link ``library`` from objects and ``sources(fmi)``; ``include`` has ``model.h``. Raises NoCompiler."""
    command = [*compiler(platform), *FLAGS, f"-I{include}", f"-I{HERE}", "-o", str(library)]
    command += [*map(str, (*sources(fmi), *objects)), *platform.flags]
    process = subprocess.run(command, capture_output=True, text=True)
    if process.returncode:
        errors = process.stderr.strip().splitlines()
        telling = [line for line in errors if "undefined reference" in line or "error:" in line]
        first = [*telling, *errors[-1:], "no message"][0]
        raise NoCompiler(f"{library.name} could not be linked by {Path(command[0]).name}: {first}")
