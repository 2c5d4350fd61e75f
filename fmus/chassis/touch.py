"""Dispatch from the chassis to its contacts: resolved when a chassis with contacts is compiled.

Where ``contacts`` is None numba removes the call, and the contact modules are not imported.
"""

from __future__ import annotations

from typing import Any

from fmus.kernels.jit import dispatch


def _kernels(contacts: type) -> Any:
    from fmus.chassis import contacts as kernels

    return kernels


@dispatch(_kernels, shared=True)
def touch(contacts, tree, x, A, v, w):
    """See ``contacts.touch``."""
