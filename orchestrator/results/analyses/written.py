"""Files written whole or not at all."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from fmus.vehicle import BadInput


def check(path: Path, suffixes: Sequence[str]) -> None:
    """Whether a file of one of these kinds can be written, as far as can be said before; raises BadInput."""
    above = path.absolute().parent
    if path.suffix.lower() not in suffixes:
        raise BadInput(f"{path} cannot be written: its name must end in {' or '.join(suffixes)}")
    if path.is_dir():
        raise BadInput(f"{path} cannot be written: it is a directory")
    if not above.is_dir():
        raise BadInput(f"{path} cannot be written: there is no folder {above}")
    if not os.access(above, os.W_OK):
        raise BadInput(f"{path} cannot be written: the folder {above} is read-only")


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
