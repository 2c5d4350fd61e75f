"""Bounded size of the cache: folders of results that have not been used for longest go first.

A folder ``cache/kind/key`` is used when a file in it is read or written, by the time of the folder, to the hour. What
was used in the last RECENT seconds stays, because a process may still read it. Other files in the cache folder are not
touched.
"""

from __future__ import annotations

import os
import re
import shutil
import time
import uuid
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

from fmus.cache.files import cache_folder, check_trust

CACHE_KINDS = {
    "fmus": "built FMUs",
    "libraries": "native libraries",
    "numbers": "numbers of native FMUs",
    "unpacked": "unpacked FMUs and archives",
    "kernels": "compiled kernels",
    "places": "places of idlers and equilibria",
    "states": "states of other runs",
    "contents": "contents of FMUs",
}
KEY = re.compile(r"(.*-)?[0-9a-f]{20,64}")  # name of a folder of results
SIZE = "COTRACK_CACHE_SIZE"  # largest size of the cache in GB
DEFAULT, GB = 4.0, 1e9
RECENT = 86400.0  # s
PERIOD = 3600.0  # s from one look of a process at the size to the next
STAMP = "pruned"  # file whose time is that of the last look


class Entry(NamedTuple):
    """Folder of results in the cache."""

    kind: str  # a key of ``CACHE_KINDS``
    folder: Path
    size: int  # bytes
    used: float  # time of the last use, s since the epoch


def entries() -> list[Entry]:
    """All folders of results in the cache, the one that was used last at the end; raises UntrustedFolder."""
    cache = cache_folder()
    check_trust(cache)
    return sorted(_entries(cache), key=lambda entry: entry.used)


def _entries(cache: Path) -> Iterator[Entry]:
    for kind in CACHE_KINDS:
        with suppress(OSError), os.scandir(cache / kind) as folders:
            for folder in folders:
                if KEY.fullmatch(folder.name) and folder.is_dir(follow_symlinks=False):
                    with suppress(OSError):
                        yield Entry(kind, Path(folder.path), _size(folder.path), folder.stat().st_mtime)


def _size(folder: str) -> int:
    total, folders = 0, [folder]  # a list, because ``os.walk`` of Python 3.11 recurses and fails in a deep folder
    while folders:
        with suppress(OSError), os.scandir(folders.pop()) as files:
            for file in files:
                if file.is_dir(follow_symlinks=False):
                    folders.append(file.path)
                else:
                    total += file.stat(follow_symlinks=False).st_size
    return total


def limit() -> float:
    """Largest size of the cache, bytes; raises ValueError with a sentence for a bad ``$COTRACK_CACHE_SIZE``."""
    text = os.environ.get(SIZE)
    if not text:
        return DEFAULT * GB
    with suppress(ValueError):
        if 0.0 <= (size := float(text)) < float("inf"):
            return size * GB
    raise ValueError(f"{SIZE} = {text[:40]!r}: must be a size in GB, 0 or more")


def prune(most: float, recent: float = RECENT) -> list[Entry]:
    """Remove what was used longest ago until the cache has at most ``most`` bytes; return what was removed.

    What was used in the last ``recent`` seconds stays. Raises UntrustedFolder.
    """
    held, removed = entries(), []
    size, now = sum(entry.size for entry in held), time.time()
    for entry in held:
        if size <= most or now - entry.used < recent:
            break
        gone = entry.folder.with_name(f"{uuid.uuid4().hex[:12]}.removed")  # at once, for others
        with suppress(OSError, RecursionError):
            entry.folder.rename(gone)
            shutil.rmtree(gone, ignore_errors=True)
            size -= entry.size
            removed.append(entry)
    return removed


def keep_limit() -> None:
    """Prune the cache to its limit, once in PERIOD on a machine; an error of the cache is ignored."""
    with suppress(OSError, ValueError):
        stamp = cache_folder() / STAMP
        if stamp.parent.is_dir() and not (stamp.exists() and time.time() - stamp.stat().st_mtime < PERIOD):
            check_trust(stamp.parent)
            stamp.touch(mode=0o600)
            prune(limit())
