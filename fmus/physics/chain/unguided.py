"""Links that keep their plane have no guides; sibling: ``guides``."""

from __future__ import annotations

from fmus.jit import kernel


@kernel
def guide(links, contacts, x, w, rows, by_rate, tangent):
    """Nothing to guide."""
