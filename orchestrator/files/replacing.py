"""Replacement of a file as a whole."""

from __future__ import annotations

import os
import secrets
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


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
