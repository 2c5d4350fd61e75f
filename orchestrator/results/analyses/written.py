"""Files of analyses: refused before work starts."""

from __future__ import annotations

import os
from collections.abc import Sequence
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
