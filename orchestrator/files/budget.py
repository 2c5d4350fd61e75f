"""Limits on what is read from files, which may come from anyone: logs, scenes, vehicles, point tables, FMUs.

A reader takes regular files only. Unpacked bytes, parts and records are limited relative to the size of the file, so
that an honest file of any size can be read: logs of the recorder unpack to 1.2 times their size, to 66 times if every
value is constant, and have at least 20 packed bytes per message. Bytes in memory at once, and bytes to be parsed, have
limits of their own.

The limits are in the orchestrator alone: ``log`` and ``cosim`` import nothing of ``fmus``, and ``fmus`` reads no file
of others but gets tables.
"""

from __future__ import annotations

import errno
import os
import re
import stat
import struct
import tomllib
from io import BufferedReader
from math import inf
from pathlib import Path
from typing import Any

from orchestrator.files.command import note_input

TOML = 1 << 18  # bytes of a TOML file, which takes up to 2 s per MB to parse; long tables of points are CSV files
CSV = 4 << 20  # bytes of a table of points
ROWS = 50_000  # of a table of points
MEASURED, MEASURED_ROWS = 16 << 20, 250_000  # bytes and lines of a measured record
MEASURED_BINARY, MEASURED_SAMPLES = 1 << 28, 2_000_000  # bytes of one that is not text, samples of its columns
CSV_LINE = 1 << 16  # characters of a line of a CSV file
DOCUMENT = 8 << 20  # bytes of a JSON or XML document, which takes up to 25 times its size in memory
AT_ONCE = 64 << 20  # bytes read or unpacked into memory at once: a record or a chunk of a log
FMU = 1 << 30  # bytes of an FMU
DESCRIBED, DESCRIBED_RATIO = 2 << 20, 32  # bytes of the description in an FMU; more per packed byte; ours have 22
PATH_PARTS, PATH_LENGTH = 64, 1024  # folders and characters of a name in a zip archive
DIRECTORY = 1 << 20  # bytes of the directory of an FMU, of which a file takes 100
NESTING = 64  # levels of tables and arrays in a TOML file, of systems in an SSP archive
UNPACKED, RATIO = 32 << 20, 80  # bytes that any file may unpack to; more per byte of its size
PARTS, PART = 2000, 128  # chunks or packed files that any file may have; bytes of the file for each further one
RECORDS, RECORD = 64, 8  # records that any chunk may have; packed bytes for each further one
OTHERS, OTHER = 2000, 256  # records outside chunks that any log may have; bytes of the log for each further one
CHANNELS = 16 << 20  # bytes of all channel records of a log, the summary's included
ELEMENTS = 1 << 19  # XML elements of an SSP archive, each time that it names their document, and steps between them
HOLES = 16  # size of a large file over its bytes on the disk; file systems that compress reach less

_KINDS = {stat.S_IFIFO: "a pipe", stat.S_IFCHR: "a device", stat.S_IFBLK: "a device", stat.S_IFSOCK: "a socket"}
_BRACKETS = re.compile(r"[\[\]{}]")
_PART = r"""(?:"(?:[^"\\\n]|\\.)*+"|'[^'\n]*+'|[\w-]++)"""  # of a key
_DOTTED = re.compile(rf"""(?<![\w"'.\\-])(?:{_PART}[ \t]*+\.[ \t]*+){{{NESTING}}}""")
_DIRECTORY = struct.Struct("<4s4H2LH")  # end of a zip archive: sizes and place of its directory
_ZIP64 = b"PK\6\7"


class OverBudget(ValueError):
    """A file holds more than a reader takes; the message is the end of a sentence."""


class UnpackedBudget:
    """Unpacked bytes, parts (chunks, packed files), records and elements that ``size`` bytes of a file may have."""

    def __init__(self, size: int) -> None:
        self._bytes = self._most_bytes = UNPACKED + RATIO * size
        self._parts = self._most_parts = PARTS + size // PART
        self._others = self._most_others = most_others(size)
        self._channels, self._elements = CHANNELS, ELEMENTS

    def take(self, unpacked: int, most: int = AT_ONCE) -> None:
        """Count a part of ``unpacked`` bytes, of which ``most`` are allowed; raises OverBudget."""
        if unpacked > most:
            raise OverBudget(f"a part of it unpacks to {unpacked} bytes, and {most} are allowed")
        self._bytes -= unpacked
        self._parts -= 1
        if self._bytes < 0:
            raise OverBudget(f"it unpacks to more than {self._most_bytes} bytes, which are allowed for its size")
        if self._parts < 0:
            raise OverBudget(f"it has more than {self._most_parts} parts, which are allowed for its size")

    def take_record(self, channel: int = 0) -> None:
        """Count a record outside chunks; ``channel``: its bytes if it is a channel record. Raises OverBudget."""
        self._others -= 1
        self._channels -= channel
        if self._others < 0:
            raise OverBudget(f"it has more than {self._most_others} records, which are allowed for its size")
        if self._channels < 0:
            raise OverBudget(f"its channel records have more than {CHANNELS} bytes")

    def take_elements(self, count: int) -> None:
        """Count elements of an archive's documents; raises OverBudget."""
        self._elements -= count
        if self._elements < 0:
            raise OverBudget(f"its documents have more than {ELEMENTS} elements")


def check_name(name: str) -> None:
    """Raise OverBudget for the name of a packed file that is too long or in too many folders."""
    if len(name) > PATH_LENGTH or name.count("/") + name.count("\\") >= PATH_PARTS:
        raise OverBudget(f"a file in it has a name of more than {PATH_LENGTH} characters or {PATH_PARTS} folders")


def most_others(size: int) -> int:
    """Return how many records outside chunks a log of ``size`` bytes may hold."""
    return OTHERS + size // OTHER


def most_records(packed: int) -> int:
    """Return how many records a chunk of ``packed`` bytes may hold."""
    return RECORDS + packed // RECORD


def open_file(path: Path, most: float = inf) -> BufferedReader:
    """Open a regular file of ``most`` bytes at most for reading; raises OverBudget for more.

    Raises OSError, also for pipes, devices and files that are mostly holes.
    """
    _check_kind(os.stat(path))  # a device is not even opened
    descriptor = os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0))
    try:
        status = os.fstat(descriptor)
        _check_kind(status)  # a pipe may have taken the place of the file
        _check_holes(descriptor, status)
        if status.st_size > most:
            raise OverBudget(f"it has more than {most} bytes")
    except (OSError, OverBudget):
        os.close(descriptor)
        raise
    note_input(path)
    return os.fdopen(descriptor, "rb")


def _check_kind(status: os.stat_result) -> None:
    kind = stat.S_IFMT(status.st_mode)
    if kind == stat.S_IFDIR:
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR))
    if kind != stat.S_IFREG:
        raise OSError(errno.EINVAL, f"it is {_KINDS.get(kind, 'special')}, not a regular file")


def _check_holes(descriptor: int, status: os.stat_result) -> None:
    size = status.st_size
    on_disk = 512 * getattr(status, "st_blocks", size)
    # Some file systems count the blocks of a new file late; these report no hole.
    if size > AT_ONCE and HOLES * on_disk < size and os.lseek(descriptor, 0, os.SEEK_HOLE) < size:
        raise OSError(errno.EINVAL, f"only {on_disk} of its {size} bytes are on the disk, the rest are holes")
    os.lseek(descriptor, 0, os.SEEK_SET)


def read_file(path: Path, most: int) -> bytes:
    """Return the content of a regular file of ``most`` bytes at most; raises OSError, OverBudget."""
    with open_file(path) as stream:
        content = stream.read(most + 1)
    check_size(content, most)
    return content


def check_size(content: bytes, most: int) -> None:
    """Raise OverBudget for a content of more than ``most`` bytes."""
    if len(content) > most:
        raise OverBudget(f"it has more than {most} bytes")


def read_toml(path: Path) -> dict[str, Any]:
    """Return the table in a TOML file; raises OSError, ValueError, RecursionError."""
    text = read_file(path, TOML).decode()
    check_nesting(text)
    return tomllib.loads(text)


def check_nesting(text: str) -> None:
    """Raise OverBudget for tables, arrays or keys of a TOML text that are nested too deeply; text in strings counts."""
    depth = 0
    for bracket in _BRACKETS.finditer(text):
        depth = max(depth + (1 if bracket[0] in "[{" else -1), 0)
        if depth > NESTING:
            raise OverBudget(f"its tables and arrays are nested more than {NESTING} deep")
    if _DOTTED.search(text):
        raise OverBudget(f"a key has more than {NESTING} parts")


def check_zip(stream: BufferedReader) -> None:
    """Raise OverBudget for an open zip archive with too large a directory, which is read as a whole when opened."""
    size = os.fstat(stream.fileno()).st_size
    if size > FMU:
        raise OverBudget(f"it has more than {FMU} bytes")
    stream.seek(max(size - (1 << 16) - _DIRECTORY.size, 0))
    tail = stream.read()
    place = tail.rfind(b"PK\5\6")
    if 0 <= place <= len(tail) - _DIRECTORY.size:
        if _ZIP64 in tail[max(place - 20, 0) : place]:
            raise OverBudget("it is a zip archive of more than 4 GiB or 65,535 files")
        if _DIRECTORY.unpack_from(tail, place)[5] > DIRECTORY:
            raise OverBudget(f"its directory has more than {DIRECTORY} bytes")
    stream.seek(0)
