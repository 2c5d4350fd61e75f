"""The cache folder: results of earlier work by kind and key; every file is checked before it is used.

A folder ``cache/kind/key`` has the mode 0700. A file ends with a checksum over its kind, key, name and
content and is replaced as
a whole. Nothing is read from a folder that others can write into. Without a cache everything works, but takes longer.
It knows the standard library alone, because the master, which imports nothing else of ``fmus``, uses it too.
"""

from __future__ import annotations

import atexit
import hashlib
import json
import logging
import os
import secrets
import shutil
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import cache
from pathlib import Path
from typing import Any

CHECKSUM = 64  # bytes at the end of a file of the cache: a sha256 in hexadecimal
OTHERS = 0o022  # mode bits by which a group or others may write

_logger = logging.getLogger("cotrack")
_reported: set[tuple[type, int | None]] = set()
_unlogged: list[str] = []


class UntrustedFolder(PermissionError):
    """Others can write into a folder of the cache; the message is one sentence."""


def cache_folder() -> Path:
    """The cache: ``$COTRACK_CACHE``, else in the user's cache folder; a temporary one if there is no such home."""
    chosen = os.environ.get("COTRACK_CACHE")
    if chosen:
        base = chosen
    elif sys.platform == "win32":
        base = os.environ.get("LOCALAPPDATA") or "~/AppData/Local"
    elif sys.platform == "darwin":
        base = "~/Library/Caches"
    else:
        base = os.environ.get("XDG_CACHE_HOME") or "~/.cache"
    place = Path(base) if chosen else Path(base, "cotrack")
    try:
        return place.expanduser().absolute()
    except (OSError, RuntimeError):  # no such user, a user without a home, a working folder that is gone
        os.environ["COTRACK_CACHE"] = str(temporary_folder())  # also for child processes
        logging.getLogger("cotrack").warning(
            "the cache folder %s cannot be found, so every command compiles and builds anew, in a temporary folder:"
            " name another one in COTRACK_CACHE",
            place,
        )
        return temporary_folder()


# ------------------------------------------------------------------ folders


def make_folder(folder: Path) -> None:
    """Make a folder and its missing parents with mode 0700. Raises OSError."""
    for level in reversed((folder, *folder.parents)):
        if not level.exists():
            with suppress(FileExistsError):  # another process was faster
                level.mkdir(mode=0o700)


def private_folder(place: Path) -> Path:
    """Make a folder of the cache, unless it is there, and check it. Raises OSError, UntrustedFolder."""
    check_trust(place, *place.parents[:2])
    make_folder(place)
    check_trust(place, *place.parents[:2])  # another user may have been faster
    mark_used(place)
    return place


def mark_used(folder: Path) -> None:
    """Set the time of a folder to now, unless it is less than an hour ago, see ``fmus.cache.limit``."""
    with suppress(OSError):
        if time.time() - folder.stat().st_mtime > 3600.0:
            os.utime(folder)


def check_trust(*folders: Path) -> None:
    """Raise UntrustedFolder where one of these folders is another user's or can be written by others."""
    if os.name == "nt":  # no such owners and modes
        return
    for folder in folders:
        with suppress(FileNotFoundError):
            status = folder.stat()
            if not _is_trusted(status):
                raise UntrustedFolder(
                    f"{folder} belongs to another user ({status.st_uid}); name a folder of your own in COTRACK_CACHE"
                )
            if status.st_mode & OTHERS:
                raise UntrustedFolder(
                    f"others can write into {folder} (mode {status.st_mode & 0o777:o}); chmod -R go-w it, "
                    "or name another folder in COTRACK_CACHE"
                )


def _is_trusted(status: os.stat_result) -> bool:
    return os.name == "nt" or status.st_uid in (0, os.geteuid())


@cache
def temporary_folder() -> Path:
    """Folder used instead of the cache, deleted at the end of this process."""
    folder = Path(tempfile.mkdtemp(prefix="cotrack-"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    return folder


# ------------------------------------------------------------------ files


@contextmanager
def replacing(file: Path) -> Iterator[Path]:
    """New empty file beside ``file``, which it replaces at the end, or which is deleted after an error.

    Its random name is short, keeps the suffix, and is never that of a file or link of others. Raises OSError.
    """
    fresh = file.with_name(f".{secrets.token_hex(8)}{file.suffix[:16]}")
    with fresh.open("xb"):
        pass
    try:
        yield fresh
        os.replace(fresh, file)
    finally:
        fresh.unlink(missing_ok=True)


def write(file: Path, content: bytes) -> None:
    """Replace a file as a whole; a process that has the old one open keeps it. Raises OSError."""
    with replacing(file) as fresh:
        fresh.write_bytes(content)


def write_checked(file: Path, content: bytes) -> None:
    """Write a file of the cache with its checksum. Raises OSError."""
    write(file, content + _checksum(file, content))


def read_checked(file: Path) -> bytes | None:
    """Content that `write_checked` wrote; None if the file is missing or damaged. Raises OSError, UntrustedFolder."""
    check_trust(*file.parents[:3])
    if not (file.is_file() or file.is_dir()):  # missing, or a pipe or a device, which is not opened
        return None
    try:
        with file.open("rb") as stream:
            trusted, stored = _is_trusted(os.fstat(stream.fileno())), stream.read()
    except FileNotFoundError:
        return None
    content = stored[:-CHECKSUM]
    mark_used(file.parent)
    return content if trusted and stored[-CHECKSUM:] == _checksum(file, content) else None


def cached_result(kind: str, name: str, request: object, compute: Callable[[], Any]) -> Any:
    """Result of ``compute``, as JSON reads it back; from the file ``name`` of the cache after an equal ``request``."""
    key = hashlib.sha256(json.dumps(request, sort_keys=True).encode()).hexdigest()[:24]
    file = cache_folder() / kind / key / name
    with reporting_errors():
        if (cached := read_checked(file)) is not None:
            return json.loads(cached)
    content = json.dumps(compute())
    with reporting_errors():
        write_checked(private_folder(file.parent) / file.name, content.encode())
    return json.loads(content)


def _checksum(file: Path, content: bytes) -> bytes:
    digest = hashlib.sha256("/".join(file.parts[-3:]).encode() + b"\0")  # kind, key and name
    digest.update(content)
    return digest.hexdigest().encode()


# ------------------------------------------------------------------ without a cache


@contextmanager
def reporting_errors() -> Iterator[None]:
    """Context in which an OSError of the cache is reported and ignored: it costs time, nothing else."""
    try:
        yield
    except OSError as error:
        report_error(error)


def report_error(error: OSError) -> None:
    """Log why the cache is not used; each reason once a process."""
    kind = (type(error), error.errno)
    if kind in _reported:
        return
    _reported.add(kind)
    sentence = (
        f"the cache folder {cache_folder()} cannot be used, so every process compiles and builds anew: "
        f"{error_text(error)}"
    )
    _logger.warning("%s", sentence)
    if not _logger.hasHandlers():
        _unlogged.append(sentence)


def error_text(error: OSError) -> str:
    """Text of an error of the cache, without the number of its errno."""
    return str(error) if error.strerror is None else f"{error.filename or 'it'}: {error.strerror}"


def unlogged_warnings() -> Iterator[str]:
    """Yield, and forget, the sentences that no log handler received: an FMU passes them to its host."""
    while _unlogged:
        yield _unlogged.pop(0)
