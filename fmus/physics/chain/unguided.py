"""No guides, for links that cannot leave their plane; sibling: ``guides``."""

from __future__ import annotations

from fmus.jit import kernel


@kernel
def guide(links, contacts, x, w, rows, by_rate, tangent):
    """See ``faces``."""


@kernel
def overhang(links):
    """See ``faces``."""
    return 0.0


@kernel
def horn(links, contacts, x, w, k, row, i, a, b, off, by_rate, tangent):
    """See ``faces``."""
