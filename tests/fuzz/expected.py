"""Finds that are not mended yet: name of the file in ``corpus/`` -> pattern of what is wrong, and reason.

A find in this table does not fail the fuzzing. Its file in the corpus must still show it, until it is mended and leaves
the table.
"""

from __future__ import annotations

import re
from typing import NamedTuple


class Expected(NamedTuple):
    """A known find."""

    kind: str
    pattern: str
    reason: str


EXPECTED: dict[str, Expected] = {}


def expected_name(kind: str, wrong: str) -> str:
    """Name of the known find that this is, else empty."""
    hits = (name for name, one in EXPECTED.items() if one.kind == kind and re.search(one.pattern, wrong))
    return next(hits, "")
