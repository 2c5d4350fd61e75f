"""No guides, for links that cannot leave their plane; sibling: ``guides``."""

from __future__ import annotations

from fmus.jit import kernel


@kernel
def evaluate_guides(links, contacts, x, w, rows, by_rate, tangent):
    """See ``faces``."""


@kernel
def horn_height(links):
    """See ``faces``."""
    return 0.0


@kernel
def evaluate_horn(links, contacts, x, w, k, row, i, a, b, offset, by_rate, tangent):
    """See ``faces``."""
