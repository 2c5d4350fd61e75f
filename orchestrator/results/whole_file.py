"""Files written whole or not at all; unwritable paths are refused before work starts."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from fmus.vehicle import BadInput, path_text
from orchestrator.files.replacing import replacing


def check_output(path: Path, suffixes: Sequence[str], hint: str = "") -> None:
    """Raise BadInput for a path that cannot be written or has another suffix, as far as known in advance.

    ``besides``: sentence about other suffixes.
    """
    folder = path.absolute().parent
    try:
        path.lstat()
    except (FileNotFoundError, NotADirectoryError):
        pass
    except OSError as error:  # a name that is too long, a folder that cannot be searched
        raise BadInput(f"{path_text(path)} cannot be written: {error.strerror}") from None
    if path.is_dir():
        why = "it is a directory"
    elif path.suffix.lower() not in suffixes:
        *others, last = suffixes
        why = f"its name must end in {', '.join(others)}{' or ' if others else ''}{last}{hint}"
    elif not folder.is_dir():
        why = f"there is no folder {path.parent}"
    elif not os.access(folder, os.W_OK):
        why = f"the folder {path.parent} is read-only"
    else:
        return
    raise BadInput(f"{path} cannot be written: {why}")


@contextmanager
def atomic_write(path: Path) -> Iterator[Path]:
    """Temporary file that replaces ``path`` at the end; raises BadInput if that fails."""
    try:
        with replacing(path) as temporary:
            yield temporary
    except OSError as error:
        raise BadInput(f"{path_text(path)} cannot be written: {error.strerror or error}") from None
