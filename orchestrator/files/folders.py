"""Folders for results: whether a file can be made in them, asked before the work of hours."""

from __future__ import annotations

import errno
import tempfile
from pathlib import Path


def flaw(folder: Path) -> str:
    """Why no file can be made in a folder, or in the one in which it would be made; empty if one can.

    A file without a name is made, because permissions do not tell it of every file system.
    """
    present = next(each for each in (folder.absolute(), *folder.absolute().parents) if each.exists())
    if not present.is_dir():
        return f"{present} is no folder"
    try:
        with tempfile.TemporaryFile(dir=present):
            return ""
    except OSError as error:
        if error.errno in (errno.EACCES, errno.EPERM, errno.EROFS):
            return f"the folder {present} is read-only"
        return f"no file can be made in the folder {present}: {(error.strerror or str(error)).lower()}"
