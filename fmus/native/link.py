"""Object files and C sources -> shared library of a platform, by ziglang's compiler or by the system's.

All platforms are on x86-64.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
from collections.abc import Sequence
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path
from typing import NamedTuple

HERE = Path(__file__).parent
FLAGS = "-std=c11", "-O2", "-fvisibility=hidden", "-fno-sanitize=all", "-g0", "-shared", "-s"


INSTALLATION = "pip install -c constraints.txt -e '.[native]' in the clone of cotrack brings"


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


def compiler_release() -> str:
    """Name and version of the compiler."""
    if find_spec("ziglang"):
        return f"ziglang {version('ziglang')}"
    process = subprocess.run([*compiler(), "--version"], capture_output=True, text=True)
    return process.stdout.partition("\n")[0]


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
