"""A file that is there whole or not at all, and is refused before work starts where it cannot be."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from fmus.vehicle import BadInput


def refuse(path: Path, suffixes: Sequence[str], besides: str = "") -> None:
    """Raise BadInput for a file that cannot be written, as far as can be said before, or whose name says another kind.

    ``besides``: what a name with another ending may ask for instead.
    """
    folder = path.absolute().parent
    if path.is_dir():
        why = "it is a directory"
    elif path.suffix.lower() not in suffixes:
        *others, last = suffixes
        why = f"its name must end in {', '.join(others)}{' or ' if others else ''}{last}{besides}"
    elif not folder.is_dir():
        why = f"there is no folder {path.parent}"
    elif not os.access(folder, os.W_OK):
        why = f"the folder {path.parent} is read-only"
    else:
        return
    raise BadInput(f"{path} cannot be written: {why}")


@contextmanager
def fresh(path: Path) -> Iterator[Path]:
    """A file beside the other, which it replaces in the end; raises BadInput where that cannot be."""
    beside = path.with_name(f".{path.stem}.{os.getpid()}{path.suffix}")
    try:
        yield beside
        os.replace(beside, path)
    except OSError as error:
        raise BadInput(f"{path} cannot be written: {error.strerror or error}") from None
    finally:
        beside.unlink(missing_ok=True)
