"""Platforms of the libraries, all on x86-64."""

from __future__ import annotations

from typing import NamedTuple


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
