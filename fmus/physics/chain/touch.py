"""Dispatch from a chain to its contacts, resolved when a chain with contacts is compiled.

Where ``contacts`` is None numba drops the call, and no module of contact is imported.
"""

from __future__ import annotations

from typing import Any

from fmus.jit import dispatch


def _rolling(links: type) -> Any:
    from fmus.physics.chain import rolling

    return rolling


@dispatch(_rolling)
def evaluate_contacts(links, contacts, x, w, rows, by_rate, tangent):
    """See ``rolling.evaluate_contacts``."""
