"""Columns of a topic that hold a signal of all links or pins of a track."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

POSITION, TENSION = "joint[*].position", "link[*].tension"  # *: number of the link or pin, from 1


def columns(names: Sequence[str], signal: str) -> np.ndarray:
    """Columns (n,), for a vector (n, 3), of a signal of links 1, 2, ... in a topic; empty for none."""
    column_of_name = {name: column for column, name in enumerate(names)}
    parts = [""] if signal.replace("*", "1") in column_of_name else [".x", ".y", ".z"]
    found: list[list[int]] = []
    while all(signal.replace("*", str(len(found) + 1)) + part in column_of_name for part in parts):
        found.append([column_of_name[signal.replace("*", str(len(found) + 1)) + part] for part in parts])
    whole = np.array(found, int).reshape(-1, len(parts))
    return whole[:, 0] if len(parts) == 1 else whole
