"""Packs of compiled kernels, in the folder ``fmus`` of an installation or of an FMU: ``fmus/*.pack``.

A pack is a zip of files of the cache, without their checksums, each compressed by LZMA, under their names there.
``cotrack warm --pack`` makes it for all processors of a LEVEL; others, for other versions of Python, may lie beside
it. It is code, trusted as the sources beside it. A file that no pack has, and a damaged pack, cost a compilation and
nothing else.
"""

from __future__ import annotations

import hashlib
import io
import lzma
import os
import zipfile
from collections.abc import Collection, Iterator
from contextlib import suppress
from functools import cache
from pathlib import Path

from fmus.cache.files import CHECKSUM
from fmus.cache.sources import ROOT

LEVEL = "x86-64-v3", ""  # processor and features in the key of a kernel
# its features beyond those of x86-64-v2, by their names in LLVM
FEATURES = ("avx", "avx2", "bmi", "bmi2", "cx16", "f16c", "fma", "lzcnt", "movbe", "popcnt", "sse4.2", "xsave")
KERNELS, INNER = "kernels", ".inner."  # folder of kernels in the cache; part of the names of those that kernels call
NAME = "kernels.pack"  # in an FMU

_folders: list[Path] = [ROOT]


@cache
def has_level() -> bool:
    """Whether this processor has the level of packs."""
    import llvmlite.binding  # a process that compiles nothing needs none

    features = llvmlite.binding.get_host_cpu_features()
    return all(features.get(name) for name in FEATURES)


def add(folder: Path) -> None:
    """Look into the packs of a folder too: that of an FMU of this build, whose code this process runs."""
    if folder not in _folders:
        _folders.append(folder)


@cache
def _packs(folder: Path) -> tuple[zipfile.ZipFile, ...]:
    """Packs in a folder: none where a processor is named, because its own code is wanted, or a pack is made."""
    packs = []
    for file in [] if os.environ.get("NUMBA_CPU_NAME") else sorted(folder.glob("*.pack")):
        with suppress(OSError, zipfile.BadZipFile):
            packs.append(zipfile.ZipFile(file))
    return tuple(packs)


def names() -> Iterator[str]:
    """Yield the names of all files in packs: folders and file, as in the cache."""
    for folder in _folders:
        for packed in _packs(folder):
            yield from packed.namelist()


def read(name: str) -> bytes | None:
    """Content of a file by its name in the cache; None if no pack has it, or a damaged one."""
    compressed = _compressed(name)
    with suppress(lzma.LZMAError):
        return None if compressed is None else lzma.decompress(compressed)
    return None


def _compressed(name: str) -> bytes | None:
    for folder in _folders:
        for packed in _packs(folder):
            if name in packed.NameToInfo:
                with suppress(Exception):  # zipfile raises several errors of its own for damage
                    return packed.read(name)
    return None


def part(modules: Collection[str]) -> bytes | None:
    """Pack of the kernels of modules, for an FMU that has these; None if there are none."""
    files = {name: _compressed(name) for name in names() if name.split("/")[1].rpartition("-")[0] in modules}
    whole = {name: content for name, content in files.items() if content is not None}
    return _zip(whole) if whole else None


def identity() -> str:
    """Digest of all that packs hold; empty without packs."""
    held = sorted((one.filename, one.CRC) for folder in _folders for pack in _packs(folder) for one in pack.infolist())
    return hashlib.sha256(repr(held).encode()).hexdigest() if held else ""


def of_cache(cache: Path) -> bytes:
    """Pack of the kernels that a cache holds, of those that Python calls; the same for the same kernels."""
    files = (f for f in (cache / KERNELS).rglob("*") if f.is_file() and INNER not in f.name)
    return _zip({f.relative_to(cache).as_posix(): lzma.compress(f.read_bytes()[:-CHECKSUM]) for f in files})


def _zip(files: dict[str, bytes]) -> bytes:
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_STORED) as target:
        for name in sorted(files):
            target.writestr(zipfile.ZipInfo(name), files[name])
    return packed.getvalue()
