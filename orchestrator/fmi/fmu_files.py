"""Files of an FMU, or of an archive of FMUs, unpacked into a cache folder named by its content."""

from __future__ import annotations

import hashlib
import os
import shutil
import zipfile
import zlib
from pathlib import Path

from fmus.cache.files import cache_folder, make_folder, private_folder, replacing, temporary_folder, write
from orchestrator.files.budget import (
    DESCRIBED,
    DESCRIBED_RATIO,
    FMU,
    OverBudget,
    UnpackedBudget,
    check_name,
    check_zip,
    open_file,
)
from orchestrator.fmi.slave import ComponentFailed

DESCRIPTION = "modelDescription.xml"
PIECE = 1 << 20  # bytes unpacked at once
_BYTECODE = "__pycache__"


def unpack(file: Path, description: str = DESCRIPTION, kind: str = "FMU", budget: UnpackedBudget | None = None) -> Path:
    """Unpack an FMU into a cache folder named by its content; return the folder. Raises ComponentFailed.

    ``description``: file that an archive of this ``kind`` must have. ``budget``: that of an archive which holds it.

    A file that differs from the packed one is replaced; a process that has the old one open keeps it. If the cache
    cannot be used, a temporary folder lasts until the end of the process.
    """
    try:
        stream = open_file(file)
    except FileNotFoundError:
        raise ComponentFailed(f"there is no {kind} '{file}'") from None
    except OSError as error:
        raise ComponentFailed(f"cannot read the {kind} '{file}': {error.strerror}") from None
    try:
        check_zip(stream)
        place = Path("unpacked", hashlib.file_digest(stream, "sha256").hexdigest()[:24])
        with stream, zipfile.ZipFile(stream) as archive:
            if description not in archive.namelist():
                raise ComponentFailed(f"'{file}' is not an {kind}: it has no {description}")
            size = os.fstat(stream.fileno()).st_size
            _check_size(archive, size, description, budget or UnpackedBudget(size))
            try:
                return _unpack_missing(archive, private_folder(cache_folder() / place))
            except OSError:
                return _unpack_missing(archive, private_folder(temporary_folder() / place))
    except ComponentFailed:
        raise
    except OverBudget as excess:
        raise ComponentFailed(f"the {kind} '{file}' is not unpacked: {excess}") from None
    except OSError as error:
        raise ComponentFailed(f"cannot unpack the {kind} '{file}': {error}") from None
    except Exception as error:  # every compression method has its own error class
        raise ComponentFailed(f"'{file}' is not an {kind}: it is not a zip archive that can be read: {error}") from None


def _check_size(archive: zipfile.ZipFile, size: int, description: str, budget: UnpackedBudget) -> None:
    """Raise OverBudget if an archive of ``size`` bytes declares too many files or bytes; zipfile unpacks no more."""
    for entry in archive.infolist():
        check_name(entry.filename)
        budget.take(entry.file_size, FMU)
    described = archive.getinfo(description)
    if described.file_size > DESCRIBED + DESCRIBED_RATIO * min(described.compress_size, size):
        raise OverBudget(f"its {description} unpacks to more than its size allows: {described.file_size} bytes")


def _unpack_missing(archive: zipfile.ZipFile, folder: Path) -> Path:
    """Make every file of the archive in the folder equal to the packed one; other files remain.

    Bytecode is not unpacked, because Python would run it unchecked; an empty file blocks its folder.
    """
    source_folders = set()
    for name in dict.fromkeys(archive.namelist()):
        entry = archive.getinfo(name)
        parts = [part for part in name.split("/") if part not in ("", ".")]
        if ".." in parts:
            raise zipfile.BadZipFile(f"it holds a file outside of it, '{name}'")
        file = folder.joinpath(*parts)
        if _BYTECODE in parts:
            continue
        if file.suffix == ".py":
            source_folders.add(file.parent)
        if entry.is_dir():
            make_folder(file)
        elif not _is_unpacked(file, entry):
            if not file.is_relative_to(folder):  # the name contains a drive
                raise zipfile.BadZipFile(f"it holds a file called '{name}'")
            make_folder(file.parent)
            with archive.open(entry) as packed, replacing(file) as fresh, fresh.open("wb") as stream:
                shutil.copyfileobj(packed, stream, PIECE)  # raises BadZipFile for a wrong checksum or size
    for source_folder in source_folders:
        _block_bytecode(source_folder / _BYTECODE)
    return folder


def _is_unpacked(file: Path, entry: zipfile.ZipInfo) -> bool:
    crc = 0
    try:
        with open_file(file) as stream:
            if os.fstat(stream.fileno()).st_size != entry.file_size:
                return False
            while piece := stream.read(PIECE):
                crc = zlib.crc32(piece, crc)
    except OSError:  # missing, or no regular file
        return False
    return crc == entry.CRC


def _block_bytecode(bytecode: Path) -> None:
    if bytecode.is_dir():
        shutil.rmtree(bytecode)
    if not bytecode.exists():
        write(bytecode, b"")
